"""Calibration against closed forms, its own spread, seasons of known truth, and a measured river."""

import datetime as dt
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from rivid.config import Config, load_toml
from rivid.diagnosis.blocks import split
from rivid.diagnosis.data import as_record, read_record
from rivid.diagnosis.fit import Model, calibrate, day_errors, evaluate, residual_of
from rivid.diagnosis.noise.model import day_weights
from rivid.diagnosis.response.base import FreeParameter, placed
from rivid.diagnosis.response.river import RiverResponse
from rivid.effects import CATALOGUE
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES
from tests.diagnosis import sizes
from tests.diagnosis.responses import DEPTH, GAUGE, few, nominal, season

ROOT = Path(__file__).parents[2]
N = 150


@dataclass(frozen=True, eq=False)
class Curve:
    """``y = a u + curvature (a u)^2 + b o``, with flows as columns; refuses a above `breaks`."""

    parameters: tuple[FreeParameter, ...]
    curvature: float = 0.0
    breaks: float = np.inf
    surface_area: None = None
    name: str = field(default="curve", init=False)

    def with_parameters(self, vector):
        return replace(self, parameters=placed(self.parameters, vector))

    def settled(self, record):
        return self

    def baseline(self, record, changes=NO_CHANGES):
        a, b = (p.value for p in self.parameters)
        if a > self.breaks:
            raise RividError("too much")
        return a * record.inflow + self.curvature * (a * record.inflow) ** 2 + b * record.outflow

    simulate = baseline

    def slopes(self, record, base, changes=NO_CHANGES):
        a = self.parameters[0].value
        return np.stack([record.inflow * (1 + 2 * self.curvature * a * record.inflow), record.outflow])


def two(a=1.0, b=1.0, sd=10.0, high=20.0):
    return tuple(FreeParameter(name, "-", v, v, sd, -high, high) for name, v in (("a", a), ("b", b)))


def columns(rng, days, truth=(2.0, -1.0), noise=0.5, curvature=0.0):
    """A record of white flows; its output is the curve with white noise."""
    u, o = rng.standard_normal((2, days, N))
    a, b = truth
    y = a * u + curvature * (a * u) ** 2 + b * o + noise * rng.standard_normal((days, N))
    dates = [dt.date(2024, 1, 1) + dt.timedelta(days=k) for k in range(days)]
    return as_record(dates, 60.0 * np.arange(N), u, o, y, sample_time=60.0, delay=0, kind="river")


def model_of(response, record, **others):
    """A model that is not calibrated."""
    return Model(response, None, record.usual_output, record.usual_flow, 0.0, **others)


def fitted(response, record, **how):
    """The same, calibrated."""
    return calibrate(model_of(response, record), record, **how)


def left_of(model, record):
    """What the model leaves, NaN where the record does not count."""
    return np.where(record.used, residual_of(record, model.baseline(record)), np.nan)


def values(model):
    return np.array([p.value for p in model.reach.parameters])


def natural(model, name):
    return next(p.natural for p in model.reach.parameters if p.name == name)


# Against closed forms


@pytest.mark.parametrize("sd", [10.0, 0.01])
def test_a_linear_response_is_fitted_as_the_posterior_mean(sd):
    record = columns(np.random.default_rng(1), 5)
    found = fitted(Curve(two(sd=sd)), record)
    left = left_of(found, record)
    root = np.sqrt(day_weights(found.noise.whiten(left)))[:, None]
    white = found.noise.whiten(np.stack([record.inflow, record.outflow, record.output]), like=left) * root
    (X, y) = white[:2].reshape(2, -1), white[2].ravel()
    H = X @ X.T + np.eye(2) / sd**2
    wanted = np.linalg.solve(H, X @ y + np.ones(2) / sd**2)
    off = (values(found) - wanted) / np.sqrt(np.diag(np.linalg.inv(H)))
    assert (np.abs(off) < 0.02).all()  # the last step was for a noise a little different
    if sd == 0.01:  # a prior as sharp as that holds against 750 samples
        assert (np.abs(values(found) - 1.0) < 0.5 * np.abs(np.array([2.0, -1.0]) - 1.0)).all()


@sizes("seeds", 8, 30)
@pytest.mark.parametrize("curvature", [0.0, 0.2])
def test_the_scatter_over_seeds_is_the_standard_error_and_its_mean_the_truth(curvature, seeds):
    off = []
    for seed in range(seeds):
        record = columns(np.random.default_rng(seed), 5, curvature=curvature)
        found = fitted(Curve(two(), curvature=curvature), record)
        about = found.linear(record, split(record.days, 1))
        off.append((values(found) - [2.0, -1.0]) / evaluate(about).shift_errors)
    off = np.array(off)
    fit = split(5, 1).fit.sum() / 5  # the errors are of the fitting days alone
    assert (np.abs(off.mean(0)) < 4.0 * np.sqrt(fit / seeds)).all()
    assert (off**2).mean() == pytest.approx(fit, rel=4.0 * np.sqrt(2.0 / off.size))


# Steps


def likelihood(model, record):
    """Log-posterior of a calibrated model, all days alike."""
    off = [(p.value - p.mean) / p.sd for p in model.reach.parameters]
    return model.noise.log_likelihood(left_of(model, record)).sum() - 0.5 * np.square(off).sum()


def test_each_step_makes_the_data_likelier_even_where_the_whole_one_would_not():
    record = columns(np.random.default_rng(1), 5, curvature=1.0)
    bent = Curve(two(a=0.2), curvature=1.0)  # nearly straight here: the whole first step is far too long
    start = model_of(bent, record)
    X, z = bent.slopes(record, None)[:, record.used], left_of(start, record)[record.used]
    whole = model_of(bent.with_parameters(values(start) + np.linalg.solve(X @ X.T, X @ z)), record)
    assert np.nansum(left_of(whole, record) ** 2) > 2.0 * (z**2).sum()
    worth = [likelihood(fitted(bent, record, steps=steps), record) for steps in range(1, 5)]
    assert all(after >= before - 0.05 for before, after in zip(worth, worth[1:], strict=False)), worth
    lines = []
    found = fitted(bent, record, report=lines.append)
    assert lines and all(float(line.split("less")[1]) >= 0.0 for line in lines)
    assert likelihood(found, record) > worth[0]
    np.testing.assert_allclose(values(found), [2.0, -1.0], atol=0.1)


def test_what_cannot_be_simulated_is_a_step_refused():
    record = columns(np.random.default_rng(1), 5)
    assert 1.5 < values(fitted(Curve(two(), breaks=1.7), record))[0] <= 1.7
    with pytest.raises(RividError, match="too much"):
        fitted(Curve(two(), breaks=0.5), record)


def test_limits_hold_and_the_rest_is_fitted():
    record = columns(np.random.default_rng(1), 5, noise=0.1)
    found = fitted(Curve(two(high=1.5)), record)
    assert values(found)[0] == 1.5
    assert values(found)[1] == pytest.approx(-1.0, abs=0.1)
    effect = CATALOGUE["outflow_gain_error"](error=0.1)
    model = model_of(Curve(two()), record, effects=(effect,), free=(("error",),))
    limit = effect.parameters()["error"].high
    assert model.with_values(np.array([2.0 * limit])).effects[0].error == limit


# Robustness


def test_trimming_frees_the_fit_from_days_that_hold_something_else():
    rng = np.random.default_rng(1)
    record = columns(rng, 30)
    bad = np.zeros((30, 1), bool)
    bad[rng.permutation(30)[:9]] = True
    spoiled = replace(record, output=np.where(bad, record.output - 1.6 * record.inflow, record.output))
    (plain, *_), (trimmed, *_) = (values(fitted(Curve(two()), spoiled, trim=t)) for t in (0.0, 0.35))
    error = 0.5 / np.sqrt(21 * N)
    assert abs(plain - 2.0) > 4.0 * error
    assert trimmed == pytest.approx(2.0, abs=5.0 * error)


# Saint-Venant


@pytest.fixture(scope="module")
def record():
    return season(6, days=20)


def off_by_a_fifth(record):
    """Off a fifth in depth and roughness, some percent in what a config knows."""
    return few(record, length=8200 * 0.97, width=81.6 * 1.04, depth=0.8 * DEPTH, slope=1e-4, manning=0.036)


TRUTH = {"length": 8200.0, "width": 81.6, "depth": DEPTH, "fall": 1.64, "manning": 0.03}


def test_a_start_a_fifth_off_finds_the_truth_and_leaves_little_but_the_gauge_noise(record):
    dealt = split(record.days)
    off = fitted(off_by_a_fifth(record), record.take(dealt.fit))
    assert [p.name for p in off.reach.parameters] == list(TRUTH)
    errors = evaluate(off.linear(record, dealt)).shift_errors
    for p, error in zip(off.reach.parameters, errors, strict=True):
        true = TRUTH[p.name]
        scale = true if p.log else 1.0
        assert p.natural == pytest.approx(true, abs=(4.0 * error + 0.002) * scale), p.name
    residual = residual_of(record, off.baseline(record))
    errors = day_errors(record, residual, off.noise, (1.0, 4.0)).rmse(dealt.sealed)
    assert (errors < 0.0042).all(), errors
    assert off.noise.gauge_sd == pytest.approx(GAUGE, rel=0.05)


@pytest.mark.long
def test_without_gauge_noise_the_channel_is_found_to_a_thousandth():
    quiet = season(7, days=20, gauge=0.0)
    found = fitted(off_by_a_fifth(quiet), quiet)
    for name in ("length", "width", "depth", "manning"):
        assert natural(found, name) == pytest.approx(TRUTH[name], rel=2e-3), name


@pytest.mark.long
def test_modes_and_corrections_are_not_needed_and_stay_small(record):
    found = fitted(nominal(record, cells=28), record.take(split(record.days).fit))
    residual = residual_of(record, found.baseline(record))
    errors = day_errors(record, residual, found.noise, (1.0, 4.0)).rmse(split(record.days).sealed)
    assert (errors < 0.0045).all(), errors
    scale = record.sample_time / found.reach.surface_area
    for p in found.reach.parameters:
        if "_lag_" in p.name:
            assert abs(p.value) < scale
        if "_mode_" in p.name:
            assert abs(p.value) < 0.1 * (DEPTH if p.unit == "m" else 1.0)


def test_effects_that_are_given_are_not_fitted_again_and_free_ones_are_found():
    planted = season(5, days=5, effects=(("outflow_gain_error", "error", 0.08),))
    start = few(planted, depth=0.95 * DEPTH)
    gain = CATALOGUE["outflow_gain_error"]
    known = calibrate(model_of(start, planted, effects=(gain(error=0.08),), free=((),)), planted)
    free = calibrate(model_of(start, planted, effects=(gain(error=0.01),), free=(("error",),)), planted)
    blind = fitted(start, planted, steps=4)
    assert natural(known, "depth") == pytest.approx(DEPTH, rel=0.02)
    assert known.effects[0].error == 0.08
    assert known.noise.inflow_sd < 0.1 * blind.noise.inflow_sd
    assert free.effects[0].error == pytest.approx(0.08, abs=0.004)
    assert natural(free, "depth") == pytest.approx(DEPTH, rel=0.03)


# A measured river


def glen_canyon(column):
    """Glen Canyon Dam to Lees Ferry, 426 days; the bypass of 133 days is in the total release alone."""
    config = load_toml(ROOT / "configs" / "glen_canyon.toml", Config)
    columns = config.input.model_copy(update={"u_Qi": column})
    return read_record(ROOT / "sample_data" / "glen_canyon", config.model_copy(update={"input": columns}))[0]


@pytest.mark.long
def test_trimmed_days_keep_a_bypass_out_of_a_rivers_response():
    turbines, everything = glen_canyon("power_release_cfs"), glen_canyon("total_release_cfs")
    fit = np.flatnonzero(split(turbines.dates).fit & (turbines.day_number % 2 == 0))
    start = RiverResponse.nominal(3 * 3600.0, 3600.0, everything.usual_flow, gain_sd=0.3)

    def found(record, trim):
        rough = fitted(start, record.take(fit[::3]), trim=trim)
        return calibrate(rough, record.take(fit), trim=trim)

    true, plain, trimmed = found(everything, 0.0), found(turbines, 0.0), found(turbines, 0.4)
    assert natural(true, "inflow_gain") == pytest.approx(1.0, abs=0.01)
    for name, near in (("delay", 600.0), ("exponent", 0.05), ("held_time", 1200.0), ("inflow_gain", 0.015)):
        truth, bent, kept = (natural(model, name) for model in (true, plain, trimmed))
        assert kept == pytest.approx(truth, abs=near), name
        if name != "delay":
            assert abs(bent - truth) > 1.5 * near, name
    days = [np.sqrt(np.nanmean(left_of(m, turbines.take(fit)) ** 2, axis=1)) for m in (plain, trimmed)]
    usual = [np.median(rms) for rms in days]
    assert usual[1] < 0.6 * usual[0] and usual[1] < 6.0  # m3/s, of 270
