"""Test values that are not measured: a stuck or jumping gauge, copies, constant flows, lost digits."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.check import check_days
from tests.check.season import STEP, held, raised, sound, the_one


def with_day(days, k, **columns):
    return [replace(day, **columns) if j == k else day for j, day in enumerate(days)]


def only_item(finding):
    """Return the only event of the only day of a finding."""
    ((item,),) = (of_day["items"] for of_day in finding.days.values())
    return item


def test_a_gauge_that_stands_still_for_hours_or_days():
    days, config = sound(15)
    spell = only_item(the_one(held(days, 12, 8, 13), config, "stuck", when=slice(12, 13)))
    assert "07:30" <= spell["first"] <= "08:05" and "12:58" <= spell["last"] <= "13:30"
    for k in range(5, 12):
        days = held(days, k, 0, 24)
    finding = the_one(days, config, "stuck", when=slice(5, 12))
    assert str(finding).startswith("2008-01-06 to 2008-01-12 (7 days): ")


def test_a_stuck_gauge_that_flickers_by_one_step():
    days, config = sound(15)
    noise = 0.01 * np.round(np.random.default_rng(1).normal(0, 0.4, len(days[0].output)))
    flickering = [
        replace(day, output=days[8].output[0] + noise) if 8 <= k < 11 else day for k, day in enumerate(days)
    ]
    finding = the_one(flickering, config, "stuck", when=slice(8, 11))
    for of_day in finding.days.values():
        assert sum(item["duration_s"] for item in of_day["items"]) > 12 * 3600


@pytest.mark.parametrize("rise", [False, True], ids=["equal flows", "an inflow on its way"])
def test_a_level_that_the_flows_do_not_move_yet_is_not_stuck(rise):
    """The flows are equal from 1 to 7 h, on a day that fills the pool; or the inflow rises at the end."""
    days, config = sound(15)
    day, n = days[9], len(days[9].inflow)
    hour = np.arange(n) * STEP / 3600.0
    quiet, late = (hour >= 1.0) & (hour < 7.0), (hour >= 10.0) & (hour < 20.0)
    inflow, outflow = np.where(quiet, day.outflow[hour < 1.0][-1], day.inflow), day.outflow.copy()
    outflow[quiet] = inflow[quiet]
    if rise:
        inflow[quiet & (hour >= 6.8)] += 150.0
    else:
        inflow[late] += 15.0
    (quiet_day,) = held([replace(day, inflow=inflow, outflow=outflow)], 0, 1, 7)
    days = [quiet_day if k == 9 else day for k, day in enumerate(days)]
    assert not [one for one in check_days(days, config) if one.kind == "stuck"]


def test_a_gauge_that_is_freed_at_midnight_makes_no_jump():
    days, config = sound(15)
    freed = raised(days, 9, 0, 0.5)
    the_one(freed, config, "jump", when=slice(9, 10))
    the_one(held(freed, 8, 8, 24), config, "stuck", when=slice(8, 9))


@pytest.mark.parametrize("n", [1, 5])
def test_a_dead_gauge_on_every_day(n):
    days, config = sound(5)
    dead = [replace(day, output=np.full_like(day.output, 130.0)) for day in days[:n]]
    finding = the_one(dead, config, "stuck", when=slice(None))
    assert all(values["items"][0]["value"] == 130 for values in finding.days.values())


@pytest.mark.parametrize("step", [0.02, 0.1])
def test_a_coarse_gauge_is_not_stuck(step):
    days, config = sound(15)
    assert check_days([replace(day, output=np.round(day.output / step) * step) for day in days], config) == []


@pytest.mark.parametrize(("by", "hour"), [(0.2, 10), (-0.5, 10), (0.5, 0)])
def test_a_jump_that_stays(by, hour):
    days, config = sound(15)
    jump = only_item(the_one(raised(days, 12, hour, by), config, "jump", when=slice(12, 13)))
    assert jump["change"] == pytest.approx(by, abs=0.05)
    assert jump["time"][:2] in (f"{hour:02d}", f"{max(hour - 1, 0):02d}")


def test_a_spike():
    days, config = sound(15)
    spike = only_item(the_one(raised(days, 12, 7, -100.0, samples=3), config, "spike", when=slice(12, 13)))
    assert (spike["time"], spike["last"]) == ("06:59", "07:03") and spike["value"] == pytest.approx(
        29.5, abs=1
    )


def test_a_gate_that_moves_much_makes_no_jump():
    """In a pool of Saint-Venant the level at the dam falls at once, by a decimetre."""
    days, config = sound(12, "hydraulic_short")
    assert max(float(np.abs(np.diff(day.output)).max()) for day in days) > 0.08
    assert check_days(days, config) == []


def test_copies_of_a_day_of_a_week_and_of_a_level():
    days, config = sound(22)
    copy = with_day(days, 7, inflow=days[3].inflow, outflow=days[3].outflow, output=days[3].output)
    pair = the_one(copy, config, "copy.two", first="2008-01-04", second="2008-01-08")
    assert [*pair.days] == [days[3].date, days[7].date] and str(pair).startswith("2008-01-04, 2008-01-08 (2")
    the_one(with_day(days, 7, output=days[3].output), config, "copy.two")
    week = [replace(days[k - 7], date=day.date) if 14 <= k < 21 else day for k, day in enumerate(days)]
    finding = the_one(week, config, "copy.many", when=slice(7, 21))
    assert finding.days[days[15].date]["other"] == "2008-01-09"


def test_a_programme_that_repeats_itself_is_no_copy():
    days, config = sound(6)
    rng = np.random.default_rng(1)
    noise = 0.01 * rng.integers(0, 2, (6, len(days[0].output)))
    same = [
        replace(days[0], date=d.date, output=days[0].output + x) for d, x in zip(days, noise, strict=True)
    ]
    assert check_days(same, config) == []


def test_constant_flows():
    days, config = sound(5)
    still = [replace(day, outflow=np.full_like(day.outflow, 285.0)) for day in days]
    the_one(still, config, "constant.outflow_always", flow=[285, 285])
    still = with_day(days, 2, inflow=np.full_like(days[2].inflow, 300.0))
    the_one(still, config, "constant.inflow", wrong=False, when=slice(2, 3))


def test_a_command_with_a_lost_digit_is_a_remark():
    days, config = sound(5)
    odd = days[2].inflow.copy()
    odd[[100, 300, 301]] /= 1000
    finding = the_one(with_day(days, 2, inflow=odd), config, "moment", wrong=False)
    assert [item["time"] for item in finding.days[days[2].date]["items"]] == ["03:42", "11:05"]


def test_flows_below_zero_are_a_remark_at_times_and_wrong_on_average():
    days, config = sound(5)
    pumped = [replace(day, outflow=day.outflow - 300.0 * (np.arange(650) < 20)) for day in days]
    (remark,) = (finding for finding in check_days(pumped, config) if finding.kind == "negative")
    assert remark.code == "negative.some" and remark.values["lowest"] < 0 and not remark.wrong
    negative = with_day(days, 2, inflow=-days[2].inflow)
    (finding,) = (found for found in check_days(negative, config) if found.kind == "negative")
    assert finding.code == "negative.mean" and finding.wrong and list(finding.days) == [days[2].date]
