"""Test the fit of an explanation against closed forms, its own spread, and seasons of known truth."""

import datetime as dt
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from rivid.diagnosis.blocks import split
from rivid.diagnosis.data import as_record
from rivid.diagnosis.decision import errors_without, made_alone
from rivid.diagnosis.explanation import HORIZONS, LEAST_STEP, _secant, fits, fitted, scored, settled
from rivid.diagnosis.fit import MEMORY, WEATHER, Model, day_errors, residual_of
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.predictive import step_within
from rivid.diagnosis.response.base import FreeParameter, Response, vector_of
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.response.river import RiverResponse
from rivid.diagnosis.workflow import CHAINS
from rivid.effects import CATALOGUE
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, AddedFlow
from rivid.reach.gauge import stilled
from rivid.reach.saint_venant import simulate
from rivid.simulation.season import ar1
from tests import examples
from tests.diagnosis import pools, sizes
from tests.diagnosis.responses import DEPTH, GAUGE, few, season

N = 150


@dataclass(frozen=True, eq=False)
class Curve:
    """``y = a u + curvature (a u)^2 + b o``, with flows as columns; raises if a is above `breaks`."""

    parameters: tuple[FreeParameter, ...]
    curvature: float = 0.0
    breaks: float = np.inf
    surface_area: None = None
    longest_wave: float = 0.0
    name: str = field(default="curve", init=False)

    with_parameters, rough, finer = Response.with_parameters, Response.rough, Response.finer

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
    """Return a record of white flows; its output is the curve with white noise."""
    u, o = rng.standard_normal((2, days, N))
    a, b = truth
    y = a * u + curvature * (a * u) ** 2 + b * o + noise * rng.standard_normal((days, N))
    dates = [dt.date(2024, 1, 1) + dt.timedelta(days=k) for k in range(days)]
    return as_record(dates, 60.0 * np.arange(N), u, o, y, sample_time=60.0, lead=30, kind="river")


def curve_of(response, record, **others):
    """Return a model with a noise without limits: these flows are not those of a river."""
    flow = record.usual_flow
    return Model(response, None, record.usual_output, flow, 0.0, noise_kind="flow", **others)


def fit(response, record, **how):
    every = np.ones(record.days, bool)
    return fitted(curve_of(response, record), record, every, **({"fresh": 9, "steps": 9} | how))


def values(found):
    return np.array([p.value for p in found.model.reach.parameters])


def precision(found, record):
    """Return the precision of the parameters, from whitened columns (p, days, n) and priors."""
    left = np.where(record.used, found.residual, np.nan)
    white = found.noise.whiten(found.columns, like=left) * np.sqrt(found.weights)[:, None]
    X = white.reshape(len(white), -1)
    return X @ X.T + np.diag(found.sd**-2.0)


# Against closed forms


@pytest.mark.parametrize("sd", [10.0, 0.01])
def test_a_linear_response_is_fitted_as_the_posterior_mean(sd):
    record = columns(np.random.default_rng(1), 5)
    found = fit(Curve(two(sd=sd)), record)
    left = np.where(record.used, found.residual, np.nan)
    root = np.sqrt(found.weights)[:, None]
    white = found.noise.whiten(np.stack([record.inflow, record.outflow, record.output]), like=left) * root
    (X, y) = white[:2].reshape(2, -1), white[2].ravel()
    H = X @ X.T + np.eye(2) / sd**2
    wanted = np.linalg.solve(H, X @ y + np.ones(2) / sd**2)
    off = values(found) - wanted  # a step with a smaller gain is not taken
    assert off @ H @ off < 2.0 * LEAST_STEP + 0.01
    assert precision(found, record) == pytest.approx(H, rel=1e-6)
    if sd == 0.01:  # such a narrow prior outweighs 750 samples
        assert (np.abs(values(found) - 1.0) < 0.5 * np.abs(np.array([2.0, -1.0]) - 1.0)).all()


@sizes("seeds", 6, 30)
@pytest.mark.parametrize("curvature", [0.0, 0.2])
def test_the_scatter_over_seeds_is_the_standard_error_and_its_mean_the_truth(curvature, seeds):
    off, ratio = [], []
    for seed in range(seeds):
        record = columns(np.random.default_rng(seed), 12, curvature=curvature)
        found = scored(fit(Curve(two(), curvature=curvature), record, steps=5), record, np.arange(12), 100.0)
        errors = np.sqrt(np.diag(np.linalg.inv(precision(found, record))))
        off.append((values(found) - [2.0, -1.0]) / errors)
        ratio.append(found.standard_errors / errors)
    off = np.array(off)
    assert (np.abs(off.mean(0)) < 4.0 / np.sqrt(seeds)).all()
    assert (off**2).mean() == pytest.approx(1.0, rel=4.0 * np.sqrt(2.0 / off.size))
    # the posterior sd, or that of the jackknife if larger: of 12 similar blocks, slightly larger
    assert np.min(ratio) >= 1.0 - 1e-9 and 1.0 < np.mean(ratio) < 1.3


# Where a fit begins


class Costly(Curve):
    @property
    def rough(self):
        return Cheap(self.parameters, self.curvature)


class Cheap(Curve):
    """A curve that is wrong by a share and a constant, for the steps of :class:`Costly`."""

    def baseline(self, record, changes=NO_CHANGES):
        return 0.9 * super().baseline(record) + 0.3


@pytest.mark.parametrize("fresh", [0, 3])
def test_steps_on_a_cheaper_response_end_at_the_optimum_of_the_costly_one(fresh):
    record = columns(np.random.default_rng(1), 12, curvature=0.05)
    own, cheap = (fit(kind(two(), 0.05), record, fresh=fresh, steps=60) for kind in (Curve, Costly))
    off = values(cheap) - values(own)
    assert off @ precision(own, record) @ off < 0.1
    base = cheap.model.baseline(record)
    np.testing.assert_allclose(cheap.residual, residual_of(record, base), rtol=1e-12)
    np.testing.assert_allclose(cheap.defect, base - cheap.model.rough.baseline(record), rtol=1e-5)


@pytest.mark.parametrize("fresh", [0, 3])
def test_a_fit_ends_where_the_costly_response_carries_the_flows(fresh):
    """Regression: a fit was lost if its steps led the cheaper response beyond what the costly one carries."""
    record = columns(np.random.default_rng(1), 12)
    start = fit(Costly(two()), record, steps=0)
    found = fit(Costly(two(), breaks=1.6), record, start=start, fresh=fresh, steps=60)
    assert 1.45 < values(found)[0] < 1.6  # the optimum is at 2
    np.testing.assert_allclose(found.residual, residual_of(record, found.model.baseline(record)), rtol=1e-12)
    with pytest.raises(RividError, match="too much"):
        fit(Costly(two(), breaks=0.9), record, start=start, fresh=fresh, steps=60)


@dataclass(frozen=True, eq=False)
class Misled(Curve):
    """A curve with a cheaper one of which `a` acts the wrong way; after `better` finer ones, it is right."""

    better: int = 0

    @property
    def rough(self):
        return Wrong(self.parameters) if self.better else self

    @property
    def finer(self):
        return replace(self, better=self.better - 1) if self.better > 0 else self


class Wrong(Curve):
    """A curve of which `a` acts the wrong way."""

    def baseline(self, record, changes=NO_CHANGES):
        a, b = vector_of(self)
        return b * record.outflow - a * record.inflow

    def slopes(self, record, base, changes=NO_CHANGES):
        return np.stack([-record.inflow, record.outflow])


@pytest.mark.parametrize("b", [1.0, -1.0], ids=["some of the gain is real", "none is"])
def test_a_cheaper_response_that_changes_otherwise_is_replaced_by_a_finer_one(b):
    record = columns(np.random.default_rng(1), 12)
    own = fit(Curve(two(b=b)), record, steps=60)
    found = fit(Misled(two(b=b), better=2), record, steps=60)
    off = values(found) - values(own)
    assert off @ precision(own, record) @ off < 0.1 and found.model.reach.better == 0
    # Where there is none, a step that makes the costly one worse is taken back.
    left = fit(Misled(two(b=b), better=-1), record, steps=60)
    before = replace(record, output=record.output - Curve(two(b=b)).baseline(record))
    assert np.nansum(left.residual**2) <= np.nansum(before.output**2)


def test_steps_from_another_fit_that_make_the_costly_response_worse_are_taken_back():
    """Regression: rivals ended up to 170 nats below the fit that they started from."""
    record = columns(np.random.default_rng(1), 12, truth=(2.0, 1.0))
    start = fit(Misled(two(), better=-1), record, steps=0)
    found = fit(start.model.reach, record, start=start, fresh=0, steps=60)
    assert values(found)[0] == values(start)[0]
    np.testing.assert_allclose(found.residual, start.residual, atol=1e-6)


def test_a_linear_response_settles_where_it_is_fitted():
    """The regression is then exact for any draw."""
    record = columns(np.random.default_rng(1), 5)
    wanted = fit(Curve(two()), record)
    for number in range(3):
        found = vector_of(settled(curve_of(Curve(two()), record), record, number).reach)
        off = found - values(wanted)
        assert off @ precision(wanted, record) @ off < 0.05


@pytest.mark.parametrize("sd", [1e5, 1e6, 3e6, 1e7, 3e7])
def test_parameters_that_the_days_hardly_separate_settle(sd):
    """Regression: after a fit of lock pulses, normal equations of two equal columns were rounding errors."""
    record = columns(np.random.default_rng(1), 5)
    apart = record.inflow + 3e-8 * record.outflow
    record = replace(record, outflow=apart, output=record.inflow)
    a, b = vector_of(settled(curve_of(Curve(two(sd=sd, high=1e12)), record), record, 0).reach)
    assert a + b == pytest.approx(1.0, abs=1e-9)


def short_pool(seed, days=4, T_s=168.0):
    """Return a pool that waves cross in one and a half samples, and days of another, likely by its priors."""
    rng, n = np.random.default_rng(seed), round(86400.0 / T_s)
    dates = [dt.date(2024, 5, 1) + dt.timedelta(days=k) for k in range(days)]
    inflow = np.repeat(280.0 + 40.0 * rng.uniform(-1.0, 1.0, days * n // 8 + 1), 8)[: days * n]
    outflow = np.roll(inflow, 3) + np.repeat(rng.uniform(-9.0, 9.0, days * n // 6 + 1), 6)[: days * n]
    outflow += (inflow - outflow).mean()  # keeps the level stationary
    made = HydraulicResponse.nominal(
        2600.0, 90.0, 9.5, 100.0, sample_time=T_s, flow=280.0, corrections=False, cells=16
    )
    away = [p.sd for p in made.parameters] * rng.uniform(-1.5, 1.5, len(made.parameters))
    truth = made.with_parameters(vector_of(made) + away)
    flow = simulate(
        truth.channel, T_s * np.arange(days * n), inflow, outflow, 100.0, gate_time=truth.gate_time
    )
    level = stilled(T_s * np.arange(days * n)[None], flow.level[None], truth.parameters[-1].natural)
    level = level + 0.002 * rng.standard_normal(level.shape)
    columns = (column.reshape(days, n) for column in (inflow, outflow, level))
    return made, truth, as_record(dates, T_s * np.arange(n), *columns, sample_time=T_s, lead=40)


@pytest.mark.long
def test_a_short_pool_settles_where_local_steps_end_in_another_maximum():
    behind = []
    for seed in range(10):
        reach, truth, record = short_pool(seed)
        model = Model(reach, None, record.usual_output, record.usual_flow, 0.0)
        begun = [settled(model, record, number) for number in range(CHAINS)]
        (best,) = fits([replace(model, reach=truth)], record, fresh=12)
        local, found = (fits(models, record, fresh=12)[0] for models in ([model], begun))
        likely = [
            one.noise.log_likelihood(np.where(record.used, one.residual, np.nan)).sum()
            for one in (best, local, found)
        ]
        behind.append(likely[0] - np.array(likely[1:]))
    local, found = np.array(behind).T
    print("nats below the truth, from the nominal channel and settled:", local.round(), found.round())
    assert found.sum() < 0.3 * local.sum() and local.sum() > 10_000.0
    assert np.median(found) < 100.0


def test_a_response_that_few_draws_carry_settles_where_it_began():
    record = columns(np.random.default_rng(1), 5)
    model = curve_of(Curve(two(), breaks=-15.0), record)
    assert settled(model, record, 0) is model


# Steps


@pytest.mark.parametrize("seed", range(4))
def test_columns_agree_with_the_step_that_was_made_and_change_the_least(seed):
    rng = np.random.default_rng(seed)
    J, x, sd, change = (
        rng.normal(size=(4, 3, 5)),
        rng.normal(size=4),
        rng.uniform(0.1, 9.0, 4),
        rng.normal(size=(3, 5)),
    )
    now = _secant(J, x, sd, change)
    assert np.tensordot(x * sd, now, 1) == pytest.approx(change)
    scaled = ((now - J) * sd[:, None, None]).reshape(4, -1)
    # The smallest such change of the columns, per standard deviation, by the pseudo-inverse.
    missed = (change - np.tensordot(x * sd, J, 1)).ravel()
    assert scaled == pytest.approx(np.linalg.pinv(x[None]) @ missed[None])


def test_columns_computed_anew_and_corrected_ones_lead_to_the_same_fit():
    record = columns(np.random.default_rng(3), 6, curvature=0.5)
    start = Curve(two(a=0.5), curvature=0.5)
    few_, many = (fit(start, record, fresh=fresh) for fresh in (0, 20))
    assert posterior(few_, record) == pytest.approx(posterior(many, record), abs=1.0)


def test_a_fit_ends_where_new_columns_gain_less_than_is_enough(monkeypatch):
    record = columns(np.random.default_rng(3), 6, curvature=0.5)
    start, computed, plain = Curve(two(a=0.5), curvature=0.5), [], Model.jacobian

    def counted(*given):
        computed[-1] += 1
        return plain(*given)

    monkeypatch.setattr(Model, "jacobian", counted)
    found = []
    for enough in (1.0, 1e9):
        computed.append(0)
        found.append(posterior(fit(start, record, fresh=20, enough=enough), record))
    assert computed[1] < computed[0] and found[0] >= found[1] - 1e-6


def posterior(found, record):
    """Return the log-posterior of a fitted model, with equal weights of all days."""
    left = np.where(record.used, found.residual, np.nan)
    off = [(p.value - p.mean) / p.sd for p in found.model.reach.parameters]
    return found.noise.log_likelihood(left).sum() - 0.5 * np.square(off).sum()


def test_each_step_makes_the_data_likelier_even_where_the_whole_one_would_not():
    record = columns(np.random.default_rng(1), 5, curvature=1.0)
    bent = Curve(two(a=0.2), curvature=1.0)  # almost straight here: the whole first step is far too long
    start = curve_of(bent, record)
    z = residual_of(record, start.baseline(record))
    X = bent.slopes(record, None)[:, record.used]
    there = np.array([0.2, 1.0]) + np.linalg.solve(X @ X.T, X @ z[record.used])
    whole = residual_of(record, curve_of(bent.with_parameters(there), record).baseline(record))
    assert np.nansum(whole[record.used] ** 2) > 2.0 * (z[record.used] ** 2).sum()
    worth = [posterior(fit(bent, record, steps=steps), record) for steps in range(1, 5)]
    assert all(after >= before - 0.05 for before, after in zip(worth, worth[1:], strict=False)), worth
    found = fit(bent, record)
    assert posterior(found, record) > worth[0]
    np.testing.assert_allclose(values(found), [2.0, -1.0], atol=0.1)


def test_what_cannot_be_simulated_is_a_step_refused():
    record = columns(np.random.default_rng(1), 5)
    assert 1.5 < values(fit(Curve(two(), breaks=1.7), record))[0] <= 1.7
    with pytest.raises(RividError, match="too much"):
        fit(Curve(two(), breaks=0.5), record)


class Rippled(Curve):
    """A curve with small errors that change with its parameters, as those of time steps do."""

    def baseline(self, record, changes=NO_CHANGES):
        a = self.parameters[0].value
        return super().baseline(record) + 0.3 * np.sin(1e4 * a * record.outflow)

    simulate = baseline


@pytest.mark.parametrize("seed", range(5))
def test_columns_are_not_updated_by_the_errors_of_short_steps(seed):
    """Regression: columns were wrong by up to a hundred times, and standard errors with them."""
    record = columns(np.random.default_rng(seed), 3, curvature=0.2)
    found = fit(Rippled(two(), curvature=0.2), record, fresh=2, steps=30)
    reach = found.model.reach
    expected = reach.slopes(record, reach.baseline(record))
    assert found.columns == pytest.approx(expected, abs=0.15)


def test_limits_hold_and_the_rest_is_fitted():
    record = columns(np.random.default_rng(1), 5, noise=0.1)
    found = fit(Curve(two(high=1.5)), record)
    assert values(found)[0] == 1.5
    assert values(found)[1] == pytest.approx(-1.0, abs=0.1)
    effect = CATALOGUE["outflow_gain_error"](error=0.1)
    model = curve_of(Curve(two()), record, effects=(effect,), free=(("error",),))
    limit = effect.parameters()["error"].high
    assert model.with_values(np.array([2.0 * limit])).effects[0].error == limit


def test_sealed_days_do_not_take_part():
    record = columns(np.random.default_rng(4), 8)
    opened = np.arange(8) < 5
    other = replace(record, output=np.where(opened[:, None], record.output, 7.0))
    found = [fitted(curve_of(Curve(two()), r), r, opened, fresh=3) for r in (record, other)]
    assert values(found[0]) == pytest.approx(values(found[1]), abs=1e-12)
    assert (found[0].weights[~opened] == 0.0).all() and (found[0].weights[opened] > 0.0).all()


def test_a_response_that_fits_most_days_is_not_behind_one_that_fits_none():
    """Three of eight days have another inflow, as with a wrong clock from a date on."""
    record = columns(np.random.default_rng(4), 8, noise=0.001)
    other = columns(np.random.default_rng(5), 8, noise=0.001)
    late = np.arange(8)[:, None] > 4
    record = replace(record, output=np.where(late, 20.0 * other.output, record.output))
    right, wrong = (curve_of(one, record) for one in (Curve(two()), Curve(two(high=0.2))))
    for models in ([right, wrong], [wrong, right]):
        best, worst = fits(models, record, fresh=2)
        assert best.model.reach.parameters[0].value == pytest.approx(2.0, abs=0.1)
        seen = [np.where(record.used, one.residual, np.nan) for one in (best, worst)]
        plain = [one.noise.log_likelihood(left).sum() for one, left in zip((best, worst), seen, strict=True)]
        assert plain[0] < plain[1]  # these days decide, where each counts with its own likelihood


# The noise


def test_weather_has_limits_and_an_unknown_flow_has_none():
    """A wave of 60 m3/s that the model lacks: more than weather can be."""
    hidden = CATALOGUE["diurnal_inflow"](amplitude=60.0, hour=6.0)
    record = pools.season(2, days=10, effects=(hidden,))
    model = pools.model_of(record)
    left = np.where(record.used, residual_of(record, model.baseline(record)), np.nan)
    plain, free = (replace(model, noise_kind=k).fit_noise(left, record, None) for k in ("plain", "flow"))
    most = WEATHER * record.usual_flow
    assert plain.inflow_sd <= most * (1 + 1e-9) and MEMORY[0] <= plain.inflow_memory * (1 + 1e-9)
    assert plain.inflow_memory <= MEMORY[1] * (1 + 1e-9) and plain.level_sd <= model.gauge_floor * (1 + 1e-9)
    assert free.inflow_sd > 2.0 * most
    assert free.log_likelihood(left).sum() > plain.log_likelihood(left).sum() + 100.0
    windy = replace(model, noise_kind="wind").fit_noise(left, record, None)
    assert windy.level_sd > 0.0 and windy.inflow_sd <= most * (1 + 1e-9)


def test_weather_far_from_the_gauge_of_a_river_is_damped_and_an_unknown_flow_need_not_be():
    rng, T = np.random.default_rng(3), 600.0
    response = RiverResponse.nominal(12_000.0, 3000.0, 200.0)
    days, n = 30, 144
    flow = np.full((days, n), 200.0)
    dates = [dt.date(2024, 1, 1) + dt.timedelta(days=day) for day in range(days)]
    record = as_record(dates, T * np.arange(n), flow, None, flow, sample_time=T, lead=60, kind="river")
    weather = 2.0 * np.stack([ar1(60 + n, T, 10_000.0, rng) for _ in range(days)])
    model = Model(response, None, 200.0, 200.0, 0.05)

    def fit(place, kind):
        came = response.baseline(record, replace(NO_CHANGES, added=(AddedFlow(place, weather),)))
        gauge = np.random.default_rng(4).normal(0.0, 0.1, came.shape)
        left = np.where(record.used, came + gauge - response.baseline(record), np.nan)
        noise = replace(model, noise_kind=kind).fit_noise(left, record, None)
        return noise.wave, noise.log_likelihood(left).sum()

    (far, damped), (free, bare), (near, _) = fit(0.0, "plain"), fit(0.0, "flow"), fit(1.0, "plain")
    assert 1500.0 < far <= 3000.0 * (1.0 + 1e-9) and free == 0.0 and near < 0.5 * far
    assert damped > bare + 100.0


@sizes("seeds", 2, 8)
@pytest.mark.parametrize(("noise", "least", "most"), [(0.0005, 30.0, np.inf), (0.01, -10.0, 10.0)])
def test_the_rounding_of_a_gauge_lasts_until_its_level_has_gone_a_step_on(noise, least, most, seeds):
    """White noise alone is far less likely; for noise below a step nothing of the rounding persists."""
    record, step = pools.season(2, days=10), 0.01
    model = replace(pools.model_of(record), gauge_floor=step / np.sqrt(12.0))
    weather = NoiseModel(noise, 1e-5, 3.0, 9000.0, 0.0, 1.0, record.sample_time, 6.7e5)
    for seed in range(seeds):
        level = weather.simulate(*record.time.shape, np.random.default_rng(seed))
        left = np.round(level / step) * step
        lasting, white = (
            one.fit_noise(left, replace(record, activity=None), None)
            for one in (model, replace(model, gauge_floor=0.0))
        )
        gain = (lasting.log_likelihood(left) - white.log_likelihood(left)).sum()
        assert least < gain < most


# Saint-Venant

TRUTH = {
    "length": 8200.0, "width": 81.6, "depth": DEPTH, "fall": 1.64, "manning": 0.03, "bank": 0.0,
    "gate_time": 30.0,
}  # fmt: skip


def test_a_start_a_fifth_off_finds_the_truth_and_leaves_little_but_the_gauge_noise():
    record = season(6, days=9)
    dealt = split(record.dates)
    start = few(record, length=8200 * 0.97, width=81.6 * 1.04, depth=0.8 * DEPTH, slope=1e-4, manning=0.036)
    model = Model(start, None, record.usual_output, record.usual_flow, 0.0)
    found = scored(fitted(model, record, np.ones(9, bool), fresh=8), record, dealt.block, 100.0)
    parameters = found.model.reach.parameters
    assert [p.name for p in parameters] == [*TRUTH, "gauge_lag"]
    for p, error in zip(parameters, found.standard_errors, strict=False):
        if p.name in ("length", "width", "depth", "manning"):  # banks and fall are hardly identifiable
            assert p.natural == pytest.approx(TRUTH[p.name], rel=4.0 * error + 0.01), p.name
    errors = found.errors.rmse()[1:3]  # 1 and 4 h ahead, by fits without the day's block
    assert (errors < [0.005, 0.007]).all(), errors
    assert found.noise.gauge_sd == pytest.approx(GAUGE, rel=0.06)


def test_effects_that_are_given_are_not_fitted_again_and_free_ones_are_found():
    gain, depth = CATALOGUE["outflow_gain_error"], list[list[float]]()
    for seed in range(3, 3 + examples(3, 1)):  # the depth from five days scatters by some percent
        planted = season(seed, days=5, effects=(("outflow_gain_error", "error", 0.08),))
        start = few(planted, depth=0.95 * DEPTH)

        def of(planted=planted, start=start, **others):
            level, flow = planted.usual_output, planted.usual_flow
            model = Model(start, None, level, flow, 0.0, **others)
            return fitted(model, planted, np.ones(planted.days, bool), fresh=5).model

        known = of(effects=(gain(error=0.08),), free=((),))
        free = of(effects=(gain(error=0.01),), free=(("error",),))
        depth.append(
            [next(p.natural for p in m.reach.parameters if p.name == "depth") for m in (known, free)]
        )
        assert known.effects[0].error == 0.08
        assert free.effects[0].error == pytest.approx(0.08, abs=0.006)
    assert np.median(depth, axis=0) == pytest.approx([DEPTH, DEPTH], rel=0.03)
    assert known.noise.inflow_sd < 0.2 * of().noise.inflow_sd


def test_an_error_of_the_level_falls_back_as_the_leak_of_the_model_has_it():
    record = pools.season(3, days=6)
    plain = pools.model_of(record)
    assert plain.recall(record) == 1.0
    area, loss = plain.reach.surface_area, 40.0
    leaky = replace(plain, effects=(CATALOGUE["leakage"](loss=loss, place=1.0),), free=(("loss",),))
    share = loss * record.sample_time / area
    assert leaky.recall(record) == pytest.approx(1.0 - share, abs=0.1 * share)
    gain = replace(plain, effects=(CATALOGUE["outflow_gain_error"](error=0.02),), free=(("error",),))
    assert gain.recall(record) == pytest.approx(1.0, abs=1e-6)


def test_a_step_within_limits_is_that_of_a_slow_search_on_many_seeds():
    for seed in range(60):
        rng = np.random.default_rng(seed)
        k = int(rng.integers(1, 9))
        A = rng.standard_normal((k + 2, k)) * 10.0 ** rng.uniform(-1.0, 1.0, k)
        G, g = A.T @ A + np.eye(k), 5.0 * rng.standard_normal(k)
        low, high = -rng.uniform(0.0, 1.0, k), rng.uniform(0.0, 1.0, k)
        low[rng.random(k) < 0.3], high[rng.random(k) < 0.3] = -np.inf, np.inf
        x = step_within(G, g, low, high)
        assert (x >= low - 1e-8).all() and (x <= high + 1e-8).all()
        slope = G @ x - g  # zero inside, outward at a limit: the Karush-Kuhn-Tucker conditions
        inside = (x > low + 1e-7) & (x < high - 1e-7)
        assert np.abs(slope[inside]).max(initial=0.0) < 1e-6 * np.abs(g).max()
        assert (slope[x <= low + 1e-7] > -1e-6).all() and (slope[x >= high - 1e-7] < 1e-6).all()


def test_what_an_effect_makes_alone_is_what_the_other_columns_leave_of_it():
    planted = season(5, days=5, effects=(("outflow_gain_error", "error", 0.08),))
    every, gain = np.ones(planted.days, bool), CATALOGUE["outflow_gain_error"]
    plain = Model(few(planted), None, planted.usual_output, planted.usual_flow, 0.0)
    parent = fitted(plain, planted, every, steps=2)
    model = replace(plain, effects=(gain(error=0.08),), free=(("error",),))
    one = fitted(model, planted, every, steps=3, draft=parent.extended(0.0))
    both = one.model.rough, replace(one.model, effects=(), free=()).rough
    made = both[0].baseline(planted) - both[1].baseline(planted)
    alone = made_alone(one, one.model.effects[:1], planted)

    def white(values):
        seen = np.where(planted.used & np.isfinite(one.residual), values, np.nan)
        return (one.noise.whiten(seen, activity=planted.activity) * np.sqrt(one.weights)[:, None]).ravel()

    p = len(one.shared)
    X = np.stack([white(column * sd) for column, sd in zip(one.shared, one.sd[:p], strict=True)])
    taken = made - alone
    share = np.linalg.lstsq(
        (one.shared * one.sd[:p, None, None]).reshape(p, -1).T, taken.ravel(), rcond=None
    )[0]
    assert X @ white(alone) == pytest.approx(share, rel=1e-4, abs=1e-4 * np.abs(share).max())  # of the prior
    assert np.linalg.norm(white(alone)) < np.linalg.norm(white(made))

    twin = replace(one, shared=np.concatenate([one.shared, 1e3 * made[None]]), sd=np.append(one.sd, 1.0))
    assert np.abs(made_alone(twin, one.model.effects[:1], planted)).max() < 1e-2 * np.abs(made).max()
    assert made_alone(one, (gain(error=0.5),), planted) is None


def test_without_a_leak_errors_of_the_level_last():
    """A leak may cause little, but without it an error no longer decays."""
    planted = season(5, days=5, effects=(("leakage", "loss", 300.0),))
    plain = Model(few(planted), None, planted.usual_output, planted.usual_flow, 0.0)
    model = replace(plain, effects=(CATALOGUE["leakage"](loss=300.0),), free=(("loss",),))
    one = fitted(model, planted, np.ones(planted.days, bool), steps=2)
    one = scored(one, planted, np.arange(planted.days), 100.0)
    assert one.noise.recall < 0.98
    made = np.zeros(planted.time.shape)
    lasting = replace(one.noise, recall=1.0)
    expected = day_errors(planted, one.predicted, lasting, HORIZONS).squares
    found = errors_without(one, one.model.effects[:1], made, planted).squares
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert found[-1].sum() > 1.5 * one.errors.squares[-1].sum()
    gain = replace(one, model=replace(model, effects=(CATALOGUE["outflow_gain_error"](),), noise=lasting))
    same = errors_without(gain, gain.model.effects[:1], made, planted).squares
    np.testing.assert_array_equal(same, one.errors.squares)
