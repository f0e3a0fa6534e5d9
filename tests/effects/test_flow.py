import datetime as dt

import numpy as np
import pytest

from rivid.effects import effect_classes
from rivid.effects.flow import (
    DiurnalInflow,
    GateHeadEffect,
    InflowGainError,
    LateralInflow,
    Leakage,
    OutflowGainError,
    PassingFlow,
    RecurringFlow,
    SideStorage,
    StorageAreaSlope,
)
from rivid.errors import ConfigError
from tests.effects.worlds import FIRST, samples_of, world

DATES = (FIRST, FIRST + dt.timedelta(days=9))  # across the end of the month


def added(effect, here):
    (one,) = effect.changes(here).added
    return one


def test_a_lateral_inflow_with_dates_and_hours_is_nowhere_else():
    here = world(days=12)
    one = added(LateralInflow(inflow=2.5, dates=DATES, hours=(21.5, 6.0), place=0.3), here)
    assert one.place == 0.3
    for t, q in zip(here.time.tolist(), one.flow.tolist(), strict=True):
        moment = dt.datetime.combine(FIRST, dt.time()) + dt.timedelta(seconds=t)
        night = moment.time() >= dt.time(21, 30) or moment.time() < dt.time(6)
        assert q == (2.5 if night and DATES[0] <= moment.date() <= DATES[1] else 0.0)


@pytest.mark.parametrize("rows", [False, True])
def test_a_slow_inflow_runs_straight_between_its_values_over_the_dates(rows):
    here = world(days=12, rows=rows)
    flow = added(LateralInflow(inflow=(1.0, 5.0, -2.0), dates=DATES), here).flow
    for t, q in zip(here.time.ravel().tolist(), flow.ravel().tolist(), strict=True):
        half = t / 86_400 / 5.0  # for ten days the middle value is five days from the first midnight
        if not 0 <= half < 2:
            assert q == 0.0
        else:
            a, b = (1.0, 5.0) if half < 1 else (5.0, -2.0)
            assert q == pytest.approx(a + (b - a) * (half % 1.0), abs=1e-12)


@pytest.mark.parametrize(("hour", "sample_time"), [(4.0, 133.0), (17.25, 3600.0)])
def test_a_diurnal_inflow_is_a_cosine_second_by_second(hour, sample_time):
    here = world(days=2, sample_time=sample_time)
    one = added(DiurnalInflow(amplitude=7.0, hour=hour, place=0.9), here)
    second = np.arange(3 * 86_400) - 86_400 + 0.5
    slow = 7.0 * np.cos(2 * np.pi * (second / 3600.0 - hour) / 24.0)
    assert one.flow == pytest.approx(samples_of(here.time, slow, sample_time), abs=1e-8)
    assert one.place == 0.9


def test_a_leak_counts_from_the_usual_level():
    here = world(days=2)
    (leak,) = Leakage(loss=12.0, place=0.7, hours=(0, 12)).changes(here).leaks
    assert (leak.place, leak.reference) == (0.7, 128.5)
    assert leak.loss.tolist() == [12.0 if t % 86_400 < 43_200 else 0.0 for t in here.time]


def test_gain_errors_begin_and_end_on_their_dates():
    here = world(days=5)
    dates = (FIRST + dt.timedelta(days=1), FIRST + dt.timedelta(days=2))
    there = [86_400 <= t < 3 * 86_400 for t in here.time]
    real = InflowGainError(error=-0.1, dates=dates).changes(here)
    assert real.inflow == pytest.approx(np.where(there, 0.9, 1.0) * here.inflow, rel=1e-15)
    assert real.gate_is_plain
    other = OutflowGainError(error=0.2, dates=dates).changes(here)
    assert other.gate.factor.tolist() == [1.2 if k else 1.0 for k in there]
    assert other.inflow is None


def test_what_depends_on_the_level_counts_from_the_usual_one():
    here = world()
    head = GateHeadEffect(gain=0.07).changes(here).gate
    assert (head.head == 0.07).all() and head.reference == 128.5
    area = StorageAreaSlope(slope=0.3).changes(here)
    assert (area.area_slope, area.area_reference) == (0.3, 128.5)
    (pond,) = SideStorage(area=3e5, exchange=25.0).changes(here).ponds
    assert (pond.area, pond.place) == (3e5, 0.5)
    assert (pond.exchange == 25.0).all()


def test_windows_and_values_that_do_not_fit_are_refused():
    for given in ((), (1.0, 2.0)):
        with pytest.raises(ConfigError, match=r"lateral_inflow: inflow has .* dates = \[first, last\]"):
            LateralInflow(inflow=given)
    with pytest.raises(ConfigError, match="storage_area_slope: dates and hours are given"):
        StorageAreaSlope(dates=DATES)


def test_an_unknown_flow_in_pulses_is_their_sum_and_has_no_name():
    here = world(days=2)
    starts, sizes, lasts = (3.0, 3.5, 30.0), (5.0, 2.0, 7.0), (2.0, 4.0, 0.1)
    (one,) = PassingFlow.from_events(starts, sizes, lasts).changes(here).added
    T = here.sample_time / 3600.0  # sample means, in small steps
    at = here.time[..., None] / 3600.0 + (np.arange(1000) + 0.5) / 1000.0 * T
    fine = sum(q * ((at >= a) & (at < a + d)) for a, q, d in zip(starts, sizes, lasts, strict=True))
    assert one.flow == pytest.approx(fine.mean(axis=-1), abs=0.02)
    assert one.flow.max() == pytest.approx(7.0) and one.place == 0.5
    assert PassingFlow.name == "" and PassingFlow not in effect_classes().values()


@pytest.mark.parametrize("hours", [24.0, 7.3])
def test_an_unknown_flow_that_returns_is_any_sum_of_three_waves_and_has_no_name(hours):
    here = world(days=2)
    (one,) = RecurringFlow(waves=(3.0, 4.0, 0.0, 2.0, 1.0, 0.0), period=hours).changes(here).added
    turn = 2 * np.pi * here.time / (3600.0 * hours)
    slow = 3 * np.cos(turn) + 4 * np.sin(turn) + 2 * np.sin(2 * turn) + np.cos(3 * turn)
    assert one.flow == pytest.approx(slow, abs=1e-12)
    assert RecurringFlow.name == "" and RecurringFlow not in effect_classes().values()


def test_a_gain_error_in_certain_hours_is_tried_for_the_outflow_alone():
    """Regression: the inflow's was a release in these hours, which no record of a meter supports."""
    hours = [
        [trial.effects[0].hours for trial in effect_classes()[f"{flow}_gain_error"].trials(world())]
        for flow in ("inflow", "outflow")
    ]
    assert hours == [[None], [None, (5.0, 13.0), (13.0, 21.0), (21.0, 5.0)]]


@pytest.mark.parametrize("reference", [0.0, 0.3, -0.2])
def test_gates_let_through_what_the_log_shows_at_the_reference_and_more_above_it(reference):
    here = world(days=12)
    gate = GateHeadEffect(gain=0.4, reference=reference, dates=DATES).changes(here).gate
    level = here.level + np.linspace(-0.5, 0.5, here.time.size)
    real = gate.factor * (1.0 + gate.head * (level - gate.reference))
    acts = (here.time >= 0.0) & (here.time < 10 * 86_400.0)
    expected = 1.0 + 0.4 * acts * (level - here.level - reference)
    np.testing.assert_allclose(real, expected, rtol=1e-12)


def test_gates_may_let_through_nothing_at_the_usual_level():
    gate = GateHeadEffect(gain=2.0, reference=0.5).changes(world(days=2)).gate
    np.testing.assert_allclose(gate.factor * (1.0 + gate.head * 0.25), 0.5, rtol=1e-6)
