"""Test responses of pools and rivers against their own truth, closed forms and slow transcriptions."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import invgauss

from rivid.diagnosis.data import PAST, as_record
from rivid.diagnosis.explanation import fitted
from rivid.diagnosis.fit import Model
from rivid.diagnosis.response.base import (
    STEP,
    real_flows,
    slopes_by_differences,
    vector_of,
)
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.response.linear import LinearPool
from rivid.diagnosis.response.river import CELLS, RiverResponse, rates
from rivid.effects import CATALOGUE, changes_of
from rivid.errors import RividError
from rivid.reach.changes import AddedFlow, Changes, Gate, Leak, Pond
from rivid.reach.saint_venant import Channel, arrival_time, backwater_lift, simulate
from tests import examples
from tests.diagnosis.responses import DEPTH, few, nominal, one_row, river_record, season

rms = lambda x: float(np.sqrt(np.mean(np.square(x))))  # noqa: E731


def column(response, record, name, **values):
    """Return the change of the baseline by an effect."""
    changes = changes_of([CATALOGUE[name](**values)], record.world())
    return response.baseline(record, changes) - response.baseline(record)


# The hydraulic pool


def test_the_baseline_is_the_nudged_run_without_its_nudge():
    record = season(4, days=2)
    response = few(record)
    channel = Channel.smooth(8200.0, 81.6, 2e-4, 0.03, 32, end_bed=124.3)
    for day in range(2):
        start = record.output[day][np.isfinite(record.output[day])][:5].mean()
        flow = simulate(
            channel, record.time[day], record.inflow[day], record.outflow[day], start,
            observed=record.output[day], lift=backwater_lift(channel, response.flow, response.level)[0],
            speed=response.pace * 8200.0,
        )  # fmt: skip
        added = np.cumsum(flow.nudge[:-1] * np.diff(record.time[day]))
        level = flow.level - np.append(0.0, added)
        np.testing.assert_allclose(response.baseline(record)[day], level, atol=1e-9)


@pytest.mark.parametrize("length", [2000.0, 5000.0, 9000.0])
def test_a_wave_passes_a_cell_in_a_twelfth_of_a_sample_within_limits(length):
    response = HydraulicResponse.nominal(length, 80.0, 4.9, 130.0, sample_time=100.0, flow=300.0)
    cell = float(arrival_time(response.channel, [response.flow], [response.level])[0]) / response.cells
    assert response.cells == (48 if length == 2000.0 else 96 if length == 9000.0 else response.cells)
    if length == 5000.0:
        assert 48 < response.cells < 96 and cell == pytest.approx(100.0 / 12.0, rel=0.02)
    rough = response.rough
    assert rough.cells == 24 and rough.rough is rough and rough.finer is rough
    finer, finest = response.finer, response.finer.finer
    assert [finer.rough.cells, finest.rough.cells] == [34, 48] and finest.finer is finest
    assert finest.cells == response.cells and replace(response, cells=40).finer.finer.rough.cells == 40
    np.testing.assert_array_equal(vector_of(rough), vector_of(response))


@pytest.mark.parametrize("seed", range(examples(4, 2)))
def test_the_baseline_is_smooth_in_every_parameter_on_every_day(seed):
    """Regression: the steps of the solver depended on the parameters, and some days had too large slopes."""
    record = season(seed, days=4)
    response = nominal(record, cells=24)
    rng = np.random.default_rng(seed)
    sd = np.array([p.sd for p in response.parameters])
    response = response.with_parameters(vector_of(response) + 0.3 * sd * rng.standard_normal(len(sd)))
    at, base = vector_of(response), response.baseline(record)
    for i, p in enumerate(response.parameters):
        if p.low + 0.1 * p.sd < p.value < p.high - 0.1 * p.sd:
            unit = p.sd * (np.arange(len(sd)) == i)
            there = [response.with_parameters(at + h * unit) for h in (-0.02, -0.01, 0.01, 0.02)]
            far_down, down, up, far_up = (other.baseline(record) - base for other in there)
            # a curve has the same central slope over both; its curvature is in the sums
            slope, wide = up - down, 0.5 * (far_up - far_down)
            assert (rms_of_days(wide - slope) <= 0.003 * rms_of_days(slope) + 1e-7).all(), p.name
            bend, wide = up + down, 0.25 * (far_up + far_down)
            assert (rms_of_days(wide - bend) <= 0.006 * rms_of_days(slope) + 1e-7).all(), p.name


def rms_of_days(change):
    return np.sqrt(np.mean(change**2, axis=1))


def test_a_lasting_flow_moves_the_baseline_as_it_moves_the_reach():
    """Along a sloping pool the nudge keeps the volume in balance, at the dam and in the middle."""
    record = season(4, days=2)
    steep = few(record, slope=1.2e-3, depth=7.0)
    for place in (0.5, 1.0):
        more = Changes(added=(AddedFlow(place, np.full(record.time.shape, 2.0)),))
        moved = steep.baseline(record, more) - steep.baseline(record)
        hours = (record.time - record.time[:, :1]) / 3600.0
        rate = moved[:, -1] / (2.0 * 3600.0 * hours[:, -1] / steep.surface_area)
        np.testing.assert_allclose(rate, 1.0, atol=0.03)
    assert steep.surface_area < 0.97 * steep.channel.surface_area(steep.level)


@pytest.mark.parametrize("name, values", [("gate_head_effect", {"gain": 0.4}), ("leakage", {"loss": 150.0})])
def test_what_follows_the_level_follows_the_observed_one(name, values):
    """The remainder is the unlogged volume over the area, however fast the effect lets the level fall."""
    record = season(4, days=2)
    response = few(record)
    changes = changes_of([CATALOGUE[name](**values)], record.world())
    more = replace(changes, added=(AddedFlow(1.0, 3.0 * np.sin(record.time / 3000.0)),))
    about = replace(record, output=response.simulate(record, more))
    left = about.output - response.baseline(about, changes)
    plain = replace(record, output=response.simulate(record, Changes(added=more.added)))
    expected = plain.output - response.baseline(plain)
    seen = slice(5, None)  # exclude the first readings: a row starts at their mean
    off = (left - expected)[:, seen] - (left - expected)[:, seen].mean(axis=1, keepdims=True)
    assert rms(off) < 0.03 * rms(expected[:, seen] - expected[:, seen].mean(axis=1, keepdims=True))


def test_a_gate_rests_at_midnight_where_earlier_commands_left_it():
    """Regression: with the commanded flow at the start, three days of four began with a false outflow."""
    rng, days, n = np.random.default_rng(0), PAST + 1, 288
    moves = rng.integers(-3, 4, days * n) * (rng.random(days * n) < 0.1)
    outflow = 300.0 + np.cumsum(moves).reshape(days, n)
    dates = [dt.date(2024, 3, 1) + dt.timedelta(days=k) for k in range(days)]
    record = as_record(
        dates, 300.0 * np.arange(n), outflow, outflow, np.full((days, n), 130.0), sample_time=300.0, lead=40
    )
    got = real_flows(record, changes_of([CATALOGUE["gate_deadband"](band=8.0)], record.world())).outflow
    at, expected = outflow[0, 0], []
    for command in outflow.ravel():
        at = command if abs(command - at) >= 8.0 else at
        expected.append(at)
    np.testing.assert_array_equal(got[:, 40:], np.reshape(expected, (days, n)))
    assert (got[1:, 0] != record.outflow[1:, 0]).mean() > 0.5


def test_days_that_the_channel_cannot_carry_are_known():
    record = season(4, days=3)
    response = few(record)
    assert response.carried(record).all()
    inflow = record.inflow.copy()
    inflow[1] *= 12.0
    flood = replace(
        record, inflow=inflow, outflow=np.where(np.arange(3)[:, None] == 1, inflow, record.outflow)
    )
    np.testing.assert_array_equal(response.carried(flood), [True, False, True])


def test_a_gap_in_the_level_changes_little_and_leaves_no_gap():
    record = season(4)
    gap = record.output.copy()
    gap[2, 200:260] = np.nan
    response = few(record)
    whole, holed = response.baseline(record), response.baseline(replace(record, output=gap))
    assert np.isfinite(holed).all()
    assert np.abs(np.diff(holed - whole, axis=1)).max() < 1e-4
    np.testing.assert_array_equal(np.delete(holed, 2, 0), np.delete(whole, 2, 0))
    gap[2] = np.nan
    empty = response.baseline(replace(record, output=gap))
    assert empty[2, 0] == pytest.approx(response.level, abs=1e-6)


def test_an_offset_of_the_gauge_changes_the_reading_only():
    record = season(4, days=2)
    offset = 0.05 + 1e-7 * (record.time - record.time[:, :1])
    response = few(record)
    shifted = response.baseline(replace(record, output=record.output + offset), Changes(gauge=offset))
    np.testing.assert_allclose(shifted, response.baseline(record) + offset, atol=1e-9)


def test_corrections_are_lagged_flows_and_those_of_the_inflow_lie_about_its_arrival():
    record = season(4, days=2)
    response = nominal(record)
    names = [p.name for p in response.parameters]
    scale = record.sample_time / response.surface_area
    for name, flow in (("outflow_lag_2", record.outflow), ("inflow_lag_8", record.inflow)):
        lag = int(name.rsplit("_", 1)[1])
        vector = vector_of(response) + scale * (np.array(names) == name)
        added = response.with_parameters(vector).baseline(record) - response.baseline(record)
        np.testing.assert_allclose(added[:, lag:], scale * (flow[:, :-lag] - flow[:, :1]), atol=1e-12)
    assert response.inflow_lags == (7, 8, 9, 10, 11)  # lags of the nominal channel, which has banks


def test_the_mean_depth_and_width_are_the_same_whatever_the_modes():
    record = season(4, days=2)
    response = nominal(record)
    vector = vector_of(response)
    vector[6:11] = [0.1, -0.2, 0.1, 0.4, -0.3]
    channel = response.with_parameters(vector).channel
    assert response.level - channel.bed.mean() == pytest.approx(DEPTH, abs=0.01)  # with 32 cells
    assert channel.bottom_width.mean() == pytest.approx(81.6)


def test_parameters_stay_inside_their_limits():
    response = few(season(4, days=2))
    for far, which in ((999.0, "high"), (-999.0, "low")):
        moved = response.with_parameters(vector_of(response) + far)
        assert vector_of(moved).tolist() == [getattr(p, which) for p in response.parameters]
    with pytest.raises(RividError, match="expected 8 finite numbers, for length, width"):
        response.with_parameters([1.0, 2.0])
    with pytest.raises(RividError, match="slope = 0.1: expected 0 to"):
        few(season(4, days=2), slope=0.1)


def test_a_row_that_runs_dry_is_simulated_up_to_there():
    record = season(4, days=3)
    outflow = record.outflow.copy()
    outflow[1] += 250.0  # 1.5 m per hour
    thirsty = replace(record, outflow=outflow)
    response = few(record)
    level = response.simulate(thirsty)
    np.testing.assert_array_equal(level[[0, 2]], response.simulate(record)[[0, 2]])
    last = int(np.isfinite(level[1]).sum())
    assert 30 < last < 300 and np.isfinite(level[1, :last]).all() and level[1, last - 1] < 128.0


@pytest.mark.parametrize("response", [few, lambda record: pool_of("none")[1]])
def test_some_days_alone_are_simulated_as_among_all(response):
    """This also holds for effects with dates, for any first day."""
    record = season(4, days=4)
    reach, dates = response(record), (record.dates[1], record.dates[2])
    effect = CATALOGUE["lateral_inflow"](inflow=(20.0, 5.0), dates=dates)
    alone = record.take([2, 3])
    whole, part = (reach.baseline(r, changes_of([effect], r.world(125.0, 300.0))) for r in (record, alone))
    np.testing.assert_allclose(part, whole[2:], atol=1e-9)
    assert np.abs(part - reach.baseline(alone)).max() > 1e-3


def test_a_stilling_well_is_fitted_and_does_not_bend_the_geometry():
    """The well has 60 s, and the fit starts without it; without a well the fitted reach is longer."""
    record = season(5, days=8, lag=60.0)
    response = few(record, length=8300.0, width=80.0)
    start = Model(response, None, record.usual_output, record.usual_flow, 1e-4)
    every = np.ones(record.days, bool)
    with_well = fitted(start, record, every, fresh=8).model
    held = (*response.parameters[:-1], replace(response.parameters[-1], high=0.0))
    dry = replace(start, reach=replace(response, parameters=held))
    without = fitted(dry, record, every, fresh=8).model
    lag = with_well.reach.parameters[-1].natural
    white = with_well.noise.whiten(
        with_well.jacobian(record, with_well.baseline(record)), like=np.where(record.used, 0.0, np.nan)
    )
    X = white.reshape(len(white), -1)
    prior = np.diag([p.sd**-2.0 for p in response.parameters])
    assert abs(lag - 60.0) < 3.0 * np.sqrt(np.linalg.inv(X @ X.T + prior)[-1, -1]) < 10.0
    lengths = [m.reach.parameters[0].natural for m in (with_well, without)]
    assert abs(lengths[0] - 8200.0) < 0.5 * abs(lengths[1] - 8200.0)


@pytest.mark.parametrize("response", [few, lambda record: pool_of("none")[1]])
def test_a_well_that_silts_up_delays_the_reading_on_its_days(response):
    """On day 2, with its lead time, the well acts like a response of the same lag; on day 3 it does not."""
    record = season(4, days=3)
    reach, dates = response(record), (record.dates[0], record.dates[1])
    slow = replace(reach, parameters=(*reach.parameters[:-1], replace(reach.parameters[-1], value=90.0)))
    late = column(reach, record, "stilling_well", lag=90.0, dates=dates)
    assert not late[2, record.time[2] >= 2 * 86_400 + record.sample_time].any()
    np.testing.assert_allclose(late[1], (slow.baseline(record) - reach.baseline(record))[1], atol=1e-12)
    assert rms(late[1]) > 1e-4


# Derivatives


def pool_of(fronts):
    record = season(4, days=2)
    return record, LinearPool.nominal(record, fronts, surface_area=6.5e5, delay=900.0)


def a_river():
    record = river_record(np.random.default_rng(3))
    return record, RiverResponse.nominal(10_000.0, 3000.0, record.usual_flow)


CASES = {
    "hydraulic": lambda: (season(4, days=2), nominal(season(4, days=2))),
    "integrator": lambda: pool_of("none"),
    "fir": lambda: pool_of("fir"),
    "river": a_river,
}


@pytest.mark.parametrize("case", CASES)
def test_slopes_agree_with_central_differences(case):
    record, response = CASES[case]()
    inside = [{"gauge_lag": 40.0, "bank": 0.5}.get(p.name, 0.0) for p in response.parameters]
    response = response.with_parameters(vector_of(response) + inside)
    base = response.baseline(record)
    slopes = response.slopes(record, base)
    assert slopes.shape == (len(response.parameters), *base.shape)
    start = vector_of(response)
    picked = range(len(start)) if len(start) < 30 else [0, 1, 2, 3, 15, 40, 70, len(start) - 1]
    for i in picked:
        p = response.parameters[i]
        if p.value == p.low:
            continue
        h = np.zeros(len(start))
        h[i] = STEP * p.sd  # the slopes are those in the middle of such a step
        up, down = (response.with_parameters(start + s * h).baseline(record) for s in (0.7, 0.3))
        central = (up - down) / (0.4 * h[i])
        assert rms(slopes[i] - central) < 0.05 * rms(central) + 1e-9, p.name


def test_slopes_turn_round_at_a_limit():
    record, response = pool_of("fir")
    jump = vector_of(response)
    jump[4] = response.parameters[4].high
    edge = response.with_parameters(jump)
    slope = slopes_by_differences(edge, record, edge.baseline(record), Changes(), range(4, 5))
    inner = response.slopes(record, response.baseline(record))[4]
    np.testing.assert_allclose(slope[0], inner, atol=1e-6)


# Linear pools


def test_the_delay_of_a_linear_pool_follows_the_flow_of_the_day():
    record = season(4, days=2)
    response = LinearPool.nominal(record, "none", surface_area=6e5, delay=700.0, speed_share=0.2)
    means = record.inflow.mean(axis=1, keepdims=True)
    wanted = 700.0 / (1.0 + 0.2 * (means / record.usual_flow - 1.0))
    np.testing.assert_allclose(response.delay(record), wanted, rtol=1e-12)
    alone = [
        LinearPool.nominal(record, "none", surface_area=6e5, delay=delay).baseline(record.take([day]))[0]
        for day, delay in enumerate(wanted[:, 0].tolist())
    ]
    np.testing.assert_allclose(response.baseline(record), alone, atol=1e-9)


def test_the_integrator_is_the_model_of_the_reach():
    record = season(4, days=2)
    response = LinearPool.nominal(record, "none", surface_area=6e5, delay=700.0)
    level = response.baseline(record)
    for day in range(record.days):  # a grid of 1 s contains every sample
        time = np.arange(record.time[day, 0], record.time[day, -1] + 1.0)
        at = np.searchsorted(record.time[day], time, side="right") - 1
        u, o = record.inflow[day, at], record.outflow[day, at]
        late = np.concatenate([np.zeros(700), u - u[0]])[: len(u)]
        fine = np.concatenate([[0.0], np.cumsum(late - (o - u[0]))[:-1]]) / 6e5
        wanted = fine[np.searchsorted(time, record.time[day])]
        np.testing.assert_allclose(level[day] - level[day, 0], wanted, atol=1e-9)


def test_a_lateral_flow_of_a_linear_pool_arrives_by_its_place():
    record = season(4, days=2)
    response = LinearPool.nominal(record, "none", surface_area=6e5, delay=20 * 133.0)
    pulse = np.zeros(record.time.shape)
    pulse[0, 100] = 10.0
    base = response.baseline(record)
    for place, wait in ((0.0, 20), (0.5, 10), (1.0, 0)):
        rise = response.baseline(record, Changes(added=(AddedFlow(place, pulse),))) - base
        wanted = np.where(np.arange(pulse.shape[1]) > 100 + wait, 10.0 * 133.0 / 6e5, 0.0)
        np.testing.assert_allclose(rise[0], wanted, atol=1e-9)
        np.testing.assert_allclose(rise[1], 0.0, atol=1e-9)


def test_gates_leaks_and_ponds_see_the_observed_level():
    record = season(4, days=2)
    n = record.time.shape[1]
    level = np.where(np.isfinite(record.output), record.output, 130.0)
    record = replace(record, output=level)
    steps = np.diff(record.time, axis=1, append=record.time[:, -1:] + record.sample_time)
    changes = Changes(
        gate=Gate(lag=np.full(1, 300.0), head=np.full(1, 0.1), reference=130.0),
        leaks=(Leak(0.3, np.full(1, 12.0), 129.5),), ponds=(Pond(0.6, 2e5, np.full(1, 30.0)),),
    )  # fmt: skip
    flows = real_flows(record, changes)
    for day in range(2):
        gate, pond = record.outflow[day, 0], level[day, 0]
        for k in range(0, n):
            dt = steps[day, k]
            fine = dt / 400.0
            passed = into = 0.0
            for _ in range(400):  # small steps of the two lags
                gate += fine / 300.0 * (record.outflow[day, k] - gate)
                passed += gate / 400.0
                exchange = 30.0 * (level[day, k] - pond)
                pond += fine * exchange / 2e5
                into += exchange / 400.0
            if k % 37 == 0:
                head = 1.0 + 0.1 * (level[day, k] - 130.0)
                assert flows.outflow[day, k] == pytest.approx(passed * head, rel=2e-3)
                assert -flows.added[1].flow[day, k] == pytest.approx(into, rel=5e-3, abs=1e-3)
    np.testing.assert_allclose(flows.added[0].flow, 12.0 * (129.5 - level))


def test_a_surface_that_grows_with_the_level_slows_it():
    record = season(4, days=2)
    response = LinearPool.nominal(record, "none", surface_area=6e5, delay=700.0)
    grown = response.baseline(record, Changes(area_slope=0.5, area_reference=record.usual_output - 1.0))
    plain = response.baseline(record)
    rise, slow = np.diff(plain, axis=1), np.diff(grown, axis=1)
    observed = np.where(np.isfinite(record.output), record.output, record.output[1, record.lead])
    storage = 1.0 + 0.5 * (observed - record.usual_output + 1.0)
    np.testing.assert_allclose(slow[1], rise[1] / storage[1, :-1], rtol=1e-9, atol=1e-12)


# Rivers


def pulse_after(response, flow=200.0, size=40.0, n=400):
    """Return the time since a one-sample pulse of the inflow began [s], and its effect on the discharge."""
    inflow = np.full(n, flow)
    inflow[60] += size
    record = one_row(inflow)
    return record.time[0] - record.time[0, 60], response.baseline(record)[0] - flow


def nothing_held(response):
    vector = vector_of(response)
    vector[[p.name for p in response.parameters].index("held_share")] = 0.0
    return response.with_parameters(vector)


def test_a_pulse_arrives_as_in_a_diffusive_wave():
    after, came = pulse_after(nothing_held(RiverResponse.nominal(1e4, 2500.0, 200.0, exponent=0.0)))
    shape = 10_000.0**3 / 2500.0**2  # scipy's inverse Gaussian with this mean and standard deviation
    wave = invgauss(10_000.0 / shape, scale=shape)
    assert (wave.mean(), wave.std()) == pytest.approx((10_000.0, 2500.0))
    wanted = 40.0 * (wave.cdf(after) - wave.cdf(after - 900.0))  # pulse of 900 s
    assert np.abs(came - wanted).max() < 0.03 * wanted.max()  # tolerance of 24 cells


def test_held_water_comes_later_and_none_is_lost():
    response = RiverResponse.nominal(1e4, 2500.0, 200.0, exponent=0.0)
    held, hold = response.parameters[3].natural, response.parameters[4].natural
    after, came = pulse_after(response)
    assert came.sum() == pytest.approx(40.0, rel=1e-9)
    mean = (came * after).sum() / 40.0
    variance = (came * (after - mean) ** 2).sum() / 40.0
    assert mean == pytest.approx(10_450.0 + held * hold, rel=1e-3)
    blur = 900.0**2 / 12.0  # variance of the pulse
    assert variance == pytest.approx(2500.0**2 + held * (2.0 - held) * hold**2 + blur, rel=0.01)


def test_high_water_arrives_sooner_by_the_exponent():
    exponent = 0.6
    response = nothing_held(RiverResponse.nominal(12_000.0, 2500.0, 150.0, exponent=exponent))
    means = []
    for flow in (150.0, 300.0):
        after, came = pulse_after(response, flow, size=0.1)
        means.append((came * after).sum() / came.sum() - 450.0)
    # A pulse on a river is a wave: faster than the water by 1 + exponent, the ratio of dQ / dA to Q / A.
    assert means[0] / means[1] == pytest.approx(2.0**exponent, rel=0.01)


def test_a_river_is_the_row_of_cells_of_its_equations():
    """Compare with scipy's integrator for the same equations, written independently."""
    rng = np.random.default_rng(4)
    record = one_row(np.repeat(rng.uniform(100.0, 400.0, 20), 6))
    response = nothing_held(RiverResponse.nominal(1e4, 3500.0, 200.0, exponent=0.4))
    delay, e, spread = (p.natural for p in response.parameters[:3])
    cells, time, inflow = 24, record.time[0], record.inflow[0]
    kappa, full = 0.5 * (cells * (spread / delay) ** 2 - 1.0), delay * 200.0 / (cells * (1.0 - e))

    def rise(t, V):
        Q = 200.0 * (V / full) ** (1.0 / (1.0 - e))
        Q = np.append(Q, Q[-1])
        F = Q[:-1] + kappa * (Q[:-1] - Q[1:])
        coming = inflow[min(int(t // 900.0), len(inflow) - 1)]
        return np.append(coming, F[:-1]) - F

    start = np.full(cells, full * (inflow[0] / 200.0) ** (1.0 - e))
    clock = time - time[0]
    slow = solve_ivp(rise, (0.0, clock[-1]), start, t_eval=clock, max_step=60.0, rtol=1e-6)
    wanted = 200.0 * (slow.y[-1] / full) ** (1.0 / (1.0 - e))
    assert np.abs(response.baseline(record)[0] - wanted).max() < 0.005 * np.ptp(wanted)


def test_the_cells_of_a_river_exchange_their_water_exactly():
    rng = np.random.default_rng(1)
    volume, added, out = rng.uniform(5.0, 90.0, CELLS), rng.uniform(-2.0, 5.0, CELLS), np.empty(CELLS)
    table, flows = np.linspace(0.0, 30.0, 101) ** 1.6, np.empty(CELLS + 1)
    for kappa in (-0.3, 0.0, 2.5):
        assert rates(volume, 70.0, added, table, kappa, flows, out)
        assert out.sum() == pytest.approx(70.0 + added.sum() - flows[CELLS - 1], abs=1e-10)


def test_a_river_keeps_its_water_whatever_its_flow():
    rng = np.random.default_rng(7)
    inflow = np.r_[np.full(60, 200.0), np.repeat(rng.uniform(60.0, 500.0, 60), 4), np.full(200, 200.0)]
    response = RiverResponse.nominal(1e4, 2500.0, 200.0, exponent=0.8)
    came = response.baseline(one_row(inflow))[0]
    # Readings are instantaneous: their sum is the volume except for the curvature between them.
    assert (came - 200.0).sum() == pytest.approx((inflow - 200.0).sum(), rel=2e-4)


def test_a_lateral_flow_of_a_river_travels_the_rest_of_the_reach():
    """With a constant delay, an inflow at the upper dam acts as a release of that dam."""
    response = nothing_held(RiverResponse.nominal(12_000.0, 2500.0, 200.0, exponent=0.0))
    record = one_row(np.full(300, 200.0))
    pulse = np.zeros((1, 300))
    pulse[0, 60] = 5.0
    faster = nothing_held(RiverResponse.nominal(12_000.0, 2500.0, 200.0, exponent=0.7))
    lateral = faster.baseline(record, Changes(added=(AddedFlow(0.0, pulse),)))
    logged = faster.baseline(replace(record, inflow=record.inflow + pulse))
    np.testing.assert_allclose(lateral, logged, atol=1e-9)
    base = response.baseline(record)
    for place in (0.0, 0.5, 1.0):
        came = (response.baseline(record, Changes(added=(AddedFlow(place, pulse),))) - base)[0]
        assert came.sum() == pytest.approx(5.0)
        mean = (came * (record.time[0] - record.time[0, 60])).sum() / 5.0
        # 12 s: some of an inflow in the middle first spreads upstream
        assert mean - 450.0 == pytest.approx(12_000.0 * (1.0 - place), abs=12.0)


def test_a_river_is_the_same_on_a_grid_with_a_short_last_step():
    """For 700 s a day ends with a step of 300 s, and the row continues at midnight."""
    rng = np.random.default_rng(2)
    clock = np.concatenate([700.0 * np.arange(124), 86_400.0 + 700.0 * np.arange(124)])
    flow = np.repeat(rng.uniform(150.0, 300.0, 50), 5)[:248]
    fine = np.arange(0.0, 172_800.0, 100.0)

    def response_on(time, values, T_s):
        row = replace(one_row(values, T_s), time=time[None], sample_time=T_s)
        return RiverResponse.nominal(9000.0, 2500.0, 200.0).baseline(row)[0]

    uneven = response_on(clock, flow, 700.0)
    even = response_on(fine, flow[np.searchsorted(clock, fine, side="right") - 1], 100.0)
    assert np.abs(uneven - np.interp(clock, fine, even))[1:-1].max() < 0.01 * np.ptp(flow)


def test_a_river_refuses_what_needs_a_level():
    record, response = a_river()
    for changes, what in (
        (Changes(gate=Gate(lag=np.full(1, 300.0))), "a gate"),
        (Changes(leaks=(Leak(0.5, np.ones(1), 1.0),)), "a leak"),
        (Changes(area_slope=0.1), "an area slope"),
    ):
        with pytest.raises(RividError, match=f"{what} in a river reach, which has no level"):
            response.baseline(record, changes)


def test_an_fir_is_no_longer_than_the_lead_where_a_day_has_few_samples():
    n, T_s = 8, 10_800.0
    rng = np.random.default_rng(0)
    dates = [dt.date(2024, 5, day) for day in range(1, 7)]
    u, o, h = 300.0 + rng.normal(size=(3, len(dates), n))
    record = as_record(dates, T_s * np.arange(n), u, o, h, sample_time=T_s, lead=n)
    pool = LinearPool.nominal(record, "fir", surface_area=6e5, delay=950.0)
    assert max(pool.lags) == record.lead == n
    assert np.isfinite(pool.baseline(record)).all()
