"""Calibration against closed forms, its own spread, seasons whose truth is known, and a measured river."""

import datetime as dt
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from rivid.config import Config, load_toml
from rivid.diagnose.blocks import split
from rivid.diagnose.calibrate import calibrate
from rivid.diagnose.choose import choose_response
from rivid.diagnose.data import as_record
from rivid.diagnose.days import read_record
from rivid.diagnose.gap import day_errors
from rivid.diagnose.linear_response import LinearPool
from rivid.diagnose.marquardt import Linear
from rivid.diagnose.noise import NoiseModel
from rivid.diagnose.response import FreeParameter, placed
from rivid.diagnose.river_response import RiverResponse
from rivid.effects import CATALOGUE, changes_of
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES
from tests.diagnose.responses import DEPTH, GAUGE, few, nominal, season

ROOT = Path(__file__).parents[2]
N = 40


@dataclass(frozen=True, eq=False)
class Curve:
    """``y = a u + curvature (a u)^2 + b o``, with flows as columns; refuses a above `breaks`."""

    parameters: tuple[FreeParameter, ...]
    curvature: float = 0.0
    breaks: float = np.inf
    surface_area: float = 1.0
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


def columns(rng, days, truth=(2.0, -1.0), noise=0.5):
    """A record whose flows are white and whose output is linear in them."""
    u, o = rng.standard_normal((2, days, N))
    y = truth[0] * u + truth[1] * o + noise * rng.standard_normal((days, N))
    dates = [dt.date(2024, 1, 1) + dt.timedelta(days=k) for k in range(days)]
    record = as_record(dates, 60.0 * np.arange(N), u, o, y, sample_time=60.0, delay=0)
    return replace(
        record, used=np.isfinite(record.output) & (record.time >= record.day_number[:, None] * 86400.0)
    )


def white(sd=0.5):
    """A refit that knows the noise."""
    return lambda residual, weights, area, last: NoiseModel(sd, 0.0, 0.0, 60.0, 0.0, 60.0, 60.0, None)


# Against closed forms


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("sd", [10.0, 0.01])
def test_a_linear_response_is_fitted_as_the_posterior_mean(seed, sd):
    record = columns(np.random.default_rng(seed), 3)
    found = calibrate(Curve(two(sd=sd)), record, refit=white())
    used, w = record.used, np.repeat(found.weights, N + record.lead).reshape(record.time.shape)
    X = np.stack([record.inflow[used], record.outflow[used]])
    W = w[used] / 0.5**2
    H = (X * W) @ X.T + np.eye(2) / sd**2
    wanted = np.linalg.solve(H, (X * W) @ record.output[used] + np.ones(2) / sd**2)
    off = np.array([e.value for e in found.estimates]) - wanted
    assert (np.abs(off) < 1e-3 * np.sqrt(np.diag(found.covariance))).all()  # steps are damped a little
    np.testing.assert_allclose(found.covariance, np.linalg.inv(H), rtol=1e-9)
    assert found.converged and found.at_limit == ()


def test_intervals_cover_the_truth_as_often_as_they_say():
    inside = []
    for seed in range(150):
        found = calibrate(Curve(two()), columns(np.random.default_rng(seed), 4), refit=white())
        inside += [e.low <= t <= e.high for e, t in zip(found.estimates, (2.0, -1.0), strict=True)]
    assert np.mean(inside) == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 300))


def test_the_cost_never_rises_within_a_round_and_ends_at_a_minimum():
    record = columns(np.random.default_rng(5), 4)
    bent = Curve(two(a=3.0), curvature=0.3)
    found = calibrate(bent, record, refit=white())
    assert len(found.steps) > 2
    assert all(step.after <= step.before for step in found.steps)
    for before, after in zip(found.steps, found.steps[1:], strict=False):
        if before.round == after.round:
            assert after.before == before.after
    a, b = (e.value for e in found.estimates)
    w = found.weights[:, None]

    def cost(a, b):
        r = np.where(record.used, record.output - bent.with_parameters([a, b]).baseline(record), 0.0) / 0.5
        return 0.5 * (w * r**2).sum() + 0.5 * (((a - 3.0) / 10.0) ** 2 + ((b - 1.0) / 10.0) ** 2)

    assert cost(a, b) == pytest.approx(found.cost, rel=1e-9)
    for da, db in ((0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)):
        assert cost(a + da, b + db) > found.cost


def test_what_cannot_be_simulated_is_a_step_refused():
    record = columns(np.random.default_rng(1), 4, truth=(2.0, -1.0))
    found = calibrate(Curve(two(), breaks=1.7), record, refit=white())
    assert 1.5 < found.estimates[0].value <= 1.7
    assert all(step.after <= step.before for step in found.steps)
    with pytest.raises(RividError, match="too much"):
        calibrate(Curve(two(), breaks=0.5), record, refit=white())


def test_a_limit_holds_is_said_and_the_rest_is_fitted_beside_it():
    rng = np.random.default_rng(2)
    record = columns(rng, 4)
    record = replace(record, outflow=record.outflow + 0.5 * record.inflow)
    record = replace(
        record, output=2.0 * record.inflow - record.outflow + 0.1 * rng.standard_normal(record.time.shape)
    )
    found = calibrate(Curve(two(high=1.5)), record, refit=white(0.1))
    assert found.at_limit == ("a",)
    assert found.estimates[0].value == 1.5 and found.estimates[0].sd == 0.0
    used, w = record.used, found.weights[:, None] * np.ones(record.time.shape)
    o, rest = record.outflow[used], (record.output - 1.5 * record.inflow)[used]
    wanted = (w[used] * o * rest).sum() / (w[used] * o * o).sum()
    assert found.estimates[1].value == pytest.approx(wanted, abs=1e-4)


def test_a_step_into_a_corner_is_the_best_inside_the_box():
    from scipy.optimize import lsq_linear

    rng = np.random.default_rng(0)
    for _ in range(20):
        X = rng.standard_normal((4, 30))
        r = 3.0 * rng.standard_normal(30)
        box = [FreeParameter(str(i), "-", 0.0, 0.0, 1e6, -0.3, 0.3) for i in range(4)]
        linear = Linear(X @ X.T, X @ r, np.full(4, 1e6), np.zeros(4), tuple(box))
        move = linear.move(0.0)
        assert (np.abs(move) <= 0.3).all()
        best = lsq_linear(X.T, r, (-0.3, 0.3)).cost
        assert best - 1e-9 <= 0.5 * ((r - X.T @ move) ** 2).sum() < 0.5 * (r**2).sum()


# Robustness


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_trimming_frees_the_fit_from_days_that_hold_something_else(seed):
    rng = np.random.default_rng(seed)
    record = columns(rng, 30)
    bad = np.zeros(30, bool)
    bad[rng.permutation(30)[:9]] = True
    spoiled = replace(
        record, output=np.where(bad[:, None], record.output - 1.6 * record.inflow, record.output)
    )
    plain = calibrate(Curve(two()), spoiled, refit=white())
    trimmed = calibrate(Curve(two()), spoiled, refit=white(), trim=0.35)
    assert abs(plain.estimates[0].value - 2.0) > 4.0 * plain.estimates[0].sd
    assert trimmed.estimates[0].value == pytest.approx(2.0, abs=0.08)
    assert (trimmed.weights[bad] == 0.0).all() and (trimmed.weights > 0.0).sum() >= 19


def test_a_noisy_day_weighs_less_and_days_that_do_not_fit_nothing():
    rng = np.random.default_rng(3)
    record = columns(rng, 20)
    output = record.output.copy()
    output[7] += 5.0 * rng.standard_normal(output.shape[1])
    fit = np.arange(20) % 4 != 3
    found = calibrate(Curve(two()), replace(record, output=output), fit, refit=white())
    assert (found.weights[~fit] == 0.0).all() and found.weights[7] == 0.0
    output[6] += 5.0 * rng.standard_normal(output.shape[1])
    found = calibrate(Curve(two()), replace(record, output=output), fit, refit=white())
    assert 0.0 < found.weights[6] < 0.1 * np.median(found.weights[fit])
    assert found.residual.shape == record.time.shape and found.jacobian.shape == (2, *record.time.shape)


def test_what_cannot_be_fitted_is_refused():
    record = columns(np.random.default_rng(3), 4)
    with pytest.raises(RividError, match="trim = 0.95: expected a share"):
        calibrate(Curve(two()), record, trim=0.95)
    with pytest.raises(RividError, match="no fit day has a reading"):
        calibrate(Curve(two()), record, np.zeros(4, bool))


# Saint-Venant


@pytest.fixture(scope="module")
def record():
    return season(6, days=30)


@pytest.fixture(scope="module")
def off(record):
    """Calibrated from a start a fifth off in depth and roughness, some percent in what a config knows."""
    start = few(record, length=8200 * 0.97, width=81.6 * 1.04, depth=0.8 * DEPTH, slope=1e-4, manning=0.036)
    return calibrate(start, record, split(record.days).fit)


def test_a_start_a_fifth_off_finds_the_truth(record, off):
    assert off.converged and off.at_limit == ()
    truth = (8200.0, 81.6, DEPTH, 1.64, 0.03)
    for estimate, true in zip(off.estimates, truth, strict=True):
        scale = true if estimate.name != "fall" else 1.0
        assert estimate.value == pytest.approx(true, abs=(4.0 * estimate.sd + 0.002) * scale), estimate.name
    assert all(step.after <= step.before for step in off.steps)


def test_on_sealed_days_little_is_left_but_the_gauge_noise(record, off):
    errors = day_errors(record, off.residual, off.noise, (1.0, 4.0)).rmse(split(record.days).sealed)
    assert (errors < 0.0042).all(), errors
    assert off.noise.gauge_sd == pytest.approx(GAUGE, rel=0.05)


def test_modes_and_corrections_are_not_needed_and_stay_small(record):
    found = calibrate(nominal(record, cells=28), record, split(record.days).fit)
    errors = day_errors(record, found.residual, found.noise, (1.0, 4.0)).rmse(split(record.days).sealed)
    assert (errors < 0.0045).all(), errors
    scale = record.sample_time / found.response.surface_area
    for estimate in found.estimates:
        if "_lag_" in estimate.name:
            assert abs(estimate.value) < scale
        if "_mode_" in estimate.name:
            assert abs(estimate.value) < 0.1 * (DEPTH if estimate.unit == "m" else 1.0)


def test_effects_that_are_given_are_not_fitted_again():
    planted = season(5, days=8, effects=(("outflow_gain_error", "error", 0.08),))
    effect = CATALOGUE["outflow_gain_error"](error=0.08)
    start = few(planted, depth=0.95 * DEPTH)
    known = calibrate(start, planted, changes=lambda r: changes_of([effect], r.world()))
    blind = calibrate(start, planted, rounds=4)
    depth = {name: found.estimates[2].value for name, found in (("known", known), ("blind", blind))}
    assert depth["known"] == pytest.approx(DEPTH, rel=0.02)
    assert known.noise.inflow_sd < 0.1 * blind.noise.inflow_sd


# The choice


def test_the_richest_response_that_predicts_best_is_chosen(record, off):
    cut = split(record.days)
    linear = [
        calibrate(
            LinearPool.nominal(record, fronts, surface_area=6.7e5, delay=1000.0), record, cut.fit, rounds=2
        )
        for fronts in ("none", "zero", "fir")
    ]
    choice = choose_response(record, cut, [linear[0], linear[1], linear[2], off])
    assert choice.calibration is off
    one_hour = {name: error[0] for name, error in choice.errors.items()}
    assert (
        one_hour["saint-venant"]
        < one_hour["fir"]
        < one_hour["integrator-delay-zero"]
        < one_hour["integrator-delay"]
    )
    assert choose_response(record, cut, linear[:2]).calibration is linear[1]
    twin = replace(linear[1], response=replace(linear[1].response, fronts="none"))
    assert choose_response(record, cut, [twin, linear[1]]).calibration is twin
    with pytest.raises(RividError, match="each name once"):
        choose_response(record, cut, [off, off])
    with pytest.raises(RividError, match="expected one or more"):
        choose_response(record, cut, [])


# A measured river


def glen_canyon(column):
    """Glen Canyon Dam to Lees Ferry, 426 days; the bypass of 133 days is in the total release alone."""
    config = load_toml(ROOT / "configs" / "glen_canyon.toml", Config)
    told = config.input.model_copy(update={"u_Qi": column})
    return read_record(ROOT / "sample_data" / "glen_canyon", config.model_copy(update={"input": told})).record


def test_trimmed_days_keep_a_bypass_out_of_a_rivers_response():
    turbines, everything = glen_canyon("power_release_cfs"), glen_canyon("total_release_cfs")
    fit = split(turbines.dates).fit & (turbines.day_number % 2 == 0)
    start = RiverResponse.nominal(3 * 3600.0, 3600.0, everything.usual_flow, gain_sd=0.3)
    true = calibrate(start, everything, fit)
    plain, trimmed = (calibrate(start, turbines, fit, trim=trim) for trim in (0.0, 0.45))
    for name, near in (("delay", 600.0), ("exponent", 0.05), ("held_time", 1200.0), ("inflow_gain", 0.015)):
        truth, bent, kept = (
            next(e.value for e in found.estimates if e.name == name) for found in (true, plain, trimmed)
        )
        assert kept == pytest.approx(truth, abs=near), name
        if name in ("exponent", "held_time"):
            assert abs(bent - truth) > 2.0 * near, name
    left = np.where(turbines.used, trimmed.residual, np.nan)[trimmed.weights > 0.0]
    assert np.sqrt(np.nanmean(left**2)) < 4.0  # m3/s, of 270
    assert plain.noise.level_sd > 3.0 * trimmed.noise.level_sd
    assert true.estimates[-1].value == pytest.approx(1.0, abs=0.01)
