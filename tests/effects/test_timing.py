import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import fftconvolve

from rivid.effects import World
from rivid.effects.timing import (
    ClockOffset,
    FlowDependentDelay,
    GateDeadband,
    GateRateLimit,
    IceCover,
    OutflowLag,
    WaveAttenuation,
)
from tests.effects.worlds import FIRST, samples_of, seconds_of, times, total, world

MAPS = [
    ClockOffset(offset=-1234.5), WaveAttenuation(spread=777.0), FlowDependentDelay(delay=-3.0),
    IceCover(late=777.0),
]  # fmt: skip


def pulse_world(sample_time=133.0, rows=False):
    """Return a world with an inflow that differs from its base only in the middle of the record."""
    here = world(4, days=3, sample_time=sample_time, rows=rows)
    hour = here.hour if rows else here.time / 3600.0 + 24.0
    middle = (hour > 8) & (hour < 16) if rows else (hour > 30) & (hour < 66)
    return replace(here, inflow=np.where(middle, here.inflow, 250.0))


@pytest.mark.parametrize("effect", MAPS, ids=lambda e: e.name)
@pytest.mark.parametrize("rows", [False, True])
def test_maps_in_time_keep_the_volume(effect, rows):
    here = pulse_world(rows=rows)
    constant = replace(here, inflow=np.full(here.time.shape, 321.0))
    assert effect.changes(constant).inflow == pytest.approx(constant.inflow, rel=1e-12)
    real = effect.changes(here).inflow
    assert real.shape == here.inflow.shape
    assert np.abs(real - here.inflow).max() > 1.0
    for t, before, after in zip(*map(np.atleast_2d, (here.time, here.inflow, real)), strict=True):
        assert total(t, after, 133.0) == pytest.approx(total(t, before, 133.0), rel=1e-11)


@pytest.mark.parametrize("effect", MAPS, ids=lambda e: e.name)
def test_a_row_of_many_days_is_mapped_as_if_it_were_alone(effect):
    here = world(5, days=3, rows=True)
    real = effect.changes(here).inflow
    low, high = here.inflow.min(), here.inflow.max()
    for i in range(len(here.time)):
        alone = replace(here, time=here.time[i], inflow=here.inflow[i])
        if isinstance(effect, FlowDependentDelay):  # its layers are those of all rows
            thin = (high - low) / 64 * abs(effect.delay) / 2
            assert effect.changes(alone).inflow == pytest.approx(real[i], abs=thin * 2 * 80 / 133)
        else:
            assert effect.changes(alone).inflow == pytest.approx(real[i], rel=1e-12)


@pytest.mark.parametrize("offset", [1, -399, 5000, -50_400, 50_399])
def test_a_clock_that_is_off_shifts_the_held_inflow_second_by_second(offset):
    here = world(days=2)
    slow = seconds_of(here.time, here.inflow, 133.0, aside=90_000)
    n = len(slow) - 180_000
    expected = samples_of(here.time, slow[90_000 + offset : 90_000 + offset + n], 133.0)
    at = [ClockOffset(offset=offset + part).changes(here).inflow for part in (0.0, 0.5, 1.0)]
    assert at[0] == pytest.approx(expected, abs=1e-7)
    assert at[1] == pytest.approx((at[0] + at[2]) / 2, abs=1e-7)


@pytest.mark.parametrize("sample_time", [133.0, 3600.0])
def test_clocks_that_are_tried_are_within_the_limits(sample_time):
    limit = ClockOffset.parameters()["offset"].high
    sizes = [trial.effects[0].offset for trial in ClockOffset.trials(world(sample_time=sample_time))]
    assert 3600.0 <= max(sizes) == -min(sizes) <= limit == 14 * 3600.0


def test_a_clock_is_off_only_on_its_dates_and_hours():
    here = world(2, days=6)
    effect = ClockOffset(offset=400.0, dates=(FIRST, FIRST + dt.timedelta(days=2)), hours=(22, 6))
    always = ClockOffset(offset=400.0).changes(here).inflow
    hour = here.time / 3600.0 % 24.0
    there = (here.time >= 0) & (here.time < 3 * 86_400) & ((hour >= 22) | (hour < 6))
    assert effect.changes(here).inflow.tolist() == np.where(there, always, here.inflow).tolist()


@pytest.mark.parametrize("sample_time,spread", [(133.0, 300), (600.0, 900), (900.0, 120)])
def test_attenuation_is_a_normal_kernel_at_one_second(sample_time, spread):
    here = world(days=2, sample_time=sample_time)
    lag = np.arange(-8 * spread, 8 * spread + 1)
    kernel = np.exp(-0.5 * (lag / spread) ** 2)
    slow = seconds_of(here.time, here.inflow, sample_time, aside=8 * spread)
    smooth = fftconvolve(slow, kernel / kernel.sum(), mode="valid")
    expected = samples_of(here.time, smooth, sample_time)
    real = WaveAttenuation(spread=float(spread)).changes(here).inflow
    assert real == pytest.approx(expected, abs=1e-3)
    assert np.abs(real - here.inflow).max() > 5.0
    assert WaveAttenuation(spread=0.0).changes(here).inflow.tolist() == here.inflow.tolist()


@pytest.mark.parametrize("delay", [0.5, -5.0])
def test_each_flow_comes_by_its_own_delay(delay):
    here = world(days=1, sample_time=120.0)
    slow = seconds_of(here.time, here.inflow, 120.0, aside=2000)
    n, low, high = len(slow) - 4000, here.inflow.min(), here.inflow.max()
    levels = low + (high - low) * (np.arange(1000) + 0.5) / 1000
    moved = np.full(n, low)
    for q in levels:  # water above q arrives D(q) later, as long as the inflow is above q
        D = round(delay * (q - here.flow))
        moved += (slow[2000 - D : 2000 - D + n] > q) * (high - low) / 1000
    expected = samples_of(here.time, moved, 120.0)
    real = FlowDependentDelay(delay=delay).changes(here).inflow
    # a layer of 1/64 of the range is wrong by half its width at most, the reference by half a second
    off = abs(delay) * (high - low) / 64 / 2 + 0.5
    steps = np.abs(np.diff(here.inflow)).max()
    assert np.abs(real - expected).max() < 2 * off * steps / 120.0
    assert np.sqrt(np.mean((real - expected) ** 2)) < 0.05 * np.sqrt(np.mean((real - here.inflow) ** 2))


@pytest.mark.parametrize("delay", [-1.5, 2.0])
@pytest.mark.parametrize("low,high", [(250.0, 310.0), (320.0, 500.0)])
@pytest.mark.parametrize("reference", [0.7, 1.0, 1.3])
def test_a_rise_gains_the_volume_of_its_delays(delay, low, high, reference):
    here = world(days=2)
    flow = np.where(here.time >= 40_000.0, high, low)
    effect = FlowDependentDelay(delay=delay, reference=reference)
    real = effect.changes(replace(here, inflow=flow)).inflow
    gained = total(here.time, real - flow, 133.0)
    usual = reference * here.flow
    # minus the integral of delay (q - usual) from low to high
    expected = -delay * ((high - usual) ** 2 - (low - usual) ** 2) / 2
    assert gained == pytest.approx(expected, rel=1e-9)
    assert low <= real.min() + 1e-9 and real.max() <= high + 1e-9


def test_gates_have_their_limits_on_the_given_dates_only():
    here = world(days=4)
    dates = (FIRST + dt.timedelta(days=1), FIRST + dt.timedelta(days=2))
    there = (here.time >= 86_400) & (here.time < 3 * 86_400)
    assert OutflowLag(lag=250.0, dates=dates).changes(here).gate.lag.tolist() == (250.0 * there).tolist()
    band = GateDeadband(band=3.0, dates=dates).changes(here).gate.dead_band
    assert band.tolist() == (3.0 * there).tolist()
    rate = GateRateLimit(rate=0.02, dates=dates).changes(here).gate.rate
    assert rate.tolist() == np.where(there, 0.02, np.inf).tolist()


def test_the_grid_of_a_day_ends_at_midnight():
    here = World(
        time=times(1, 133.0, 0), inflow=np.r_[np.full(649, 100.0), 500.0][None], outflow=None,
        first_day=FIRST, sample_time=133.0, level=0.0, flow=300.0,
    )  # fmt: skip
    late = ClockOffset(offset=83.0).changes(here).inflow  # the last sample is 83 s long
    assert late[0, -2] == pytest.approx(100.0 + 400.0 * 83 / 133)
    assert late[0, -1] == pytest.approx(500.0)


def test_a_clock_that_drifts_is_off_by_more_each_day():
    """Compare with a clock that has the offset of each day's middle, to the drift within half a day."""
    here = world(days=6)
    first = FIRST + dt.timedelta(days=2)
    drifts = (
        ClockOffset(offset=300.0, drift=40.0, dates=(first, FIRST + dt.timedelta(days=5)))
        .changes(here)
        .inflow
    )
    assert drifts is not None
    there = here.time / 86_400.0
    np.testing.assert_array_equal(drifts[there < 2.0], here.inflow[there < 2.0])
    volume = np.cumsum(drifts * np.diff(here.edges))
    for day in (2, 4):
        middle = ClockOffset(offset=300.0 + 40.0 * (day - 1.5)).changes(here).inflow
        off, none = (x[(there >= day) & (there < day + 1)] for x in (drifts - middle, drifts - here.inflow))
        assert np.sqrt(np.mean(off**2)) < 0.15 * np.sqrt(np.mean(none**2))
    assert volume[-1] == pytest.approx(np.sum(here.inflow * np.diff(here.edges)), rel=0.01)
    assert ClockOffset(offset=300.0).to_table()["drift"] == 0.0


def test_water_under_ice_comes_late_by_the_cover_and_none_is_lost():
    """Each second of water is routed separately to its time of arrival."""
    here = world(days=8, sample_time=300.0)
    first = FIRST + dt.timedelta(days=1)
    ice = IceCover(late=1500.0, spread=0.0, growth=4.0, breakup=1.0, dates=(first, first + dt.timedelta(5)))
    t = np.arange(here.edges[0], here.edges[-1]) + 0.5
    days = t / 86_400.0 - 1.0
    thick = np.sqrt(np.clip(days / 4.0, 0.0, 1.0)) * np.clip(6.0 - days, 0.0, 1.0)
    slow = seconds_of(here.time, here.inflow, 300.0)
    late = np.maximum.accumulate(t + 1500.0 * thick)
    expected = np.histogram(late, here.edges, weights=slow)[0] / 300.0
    real = ice.changes(here).inflow
    # A second of water may be on either side of an edge; the root starts linearly within a sample.
    inside = np.abs(here.time - 86_400.0) > 600.0
    assert real[inside] == pytest.approx(expected[inside], abs=3.0 * here.inflow.max() / 300.0)
    assert np.abs(real - here.inflow).max() > 20.0
    assert total(here.time, real, 300.0) == pytest.approx(total(here.time, here.inflow, 300.0), rel=1e-6)
    spread = replace(ice, spread=0.7).changes(here).inflow
    assert total(here.time, spread, 300.0) == pytest.approx(total(here.time, here.inflow, 300.0), rel=1e-3)


def test_ice_grows_with_the_root_of_time_and_breaks():
    here = world(days=12)
    dates = (FIRST + dt.timedelta(days=1), FIRST + dt.timedelta(days=9))
    ice = IceCover(growth=4.0, breakup=2.0, dates=dates)
    at = np.array([0.0, 1.0, 2.0, 5.0, 8.0, 9.0, 10.0, 11.0]) * 86_400.0
    assert ice.cover(at, here) == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0])
    assert IceCover().cover(at, here).tolist() == [1.0] * 8
