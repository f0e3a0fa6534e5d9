"""Values that are not measured: a gauge that is stuck or jumps, copies, constant flows, lost digits."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.check import check_days
from tests.check.season import held, raised, sound


def the_one(days, config, code):
    (finding,) = check_days(days, config)
    assert finding.code == code
    return finding


def with_day(days, k, **columns):
    return [replace(day, **columns) if j == k else day for j, day in enumerate(days)]


def test_a_gauge_that_stands_still_for_hours():
    days, config = sound()
    finding = the_one(held(days, 12, 8, 13), config, "stuck")
    assert finding.wrong and list(finding.days) == [days[12].date]
    (spell,) = finding.days[days[12].date]["items"]
    assert "07:30" <= spell["first"] <= "08:05" and "12:58" <= spell["last"] <= "13:30"


def test_a_gauge_that_stands_still_for_days_is_one_finding():
    days, config = sound()
    for k in range(5, 12):
        days = held(days, k, 0, 25)
    finding = the_one(days, config, "stuck")
    assert list(finding.days) == [day.date for day in days[5:12]]
    assert str(finding).startswith("2008-01-06 to 2008-01-12 (7 days): ")


@pytest.mark.parametrize("n", [1, 5])
def test_a_dead_gauge_on_every_day(n):
    days, config = sound(5)
    dead = [replace(day, output=np.full_like(day.output, 130.0)) for day in days[:n]]
    finding = the_one(dead, config, "stuck")
    assert len(finding.days) == n
    assert all(values["items"][0]["value"] == 130 for values in finding.days.values())


@pytest.mark.parametrize("step", [0.02, 0.05, 0.1])
def test_a_coarse_gauge_is_not_stuck(step):
    days, config = sound()
    assert check_days([replace(day, output=np.round(day.output / step) * step) for day in days], config) == []


@pytest.mark.parametrize(("by", "hour"), [(0.2, 10), (-0.5, 10), (3.0, 10), (0.5, 0)])
def test_a_jump_that_stays(by, hour):
    days, config = sound()
    finding = the_one(raised(days, 12, hour, by), config, "jump")
    assert list(finding.days) == [days[12].date]
    (jump,) = finding.days[days[12].date]["items"]
    assert jump["change"] == pytest.approx(by, abs=0.05)
    assert jump["time"][:2] in (f"{hour:02d}", f"{max(hour - 1, 0):02d}")


def test_a_spike():
    days, config = sound()
    finding = the_one(raised(days, 12, 7, -100.0, samples=3), config, "spike")
    (spike,) = finding.days[days[12].date]["items"]
    assert spike["time"] == "06:59" and spike["value"] == pytest.approx(29.5, abs=1)


def test_a_gate_that_moves_much_makes_no_jump():
    """In a pool of Saint-Venant's equations the level at the dam falls at once, by a decimetre."""
    days, config = sound(40, "hydraulic_short")
    assert max(float(np.abs(np.diff(day.output)).max()) for day in days) > 0.08
    assert check_days(days, config) == []


def test_a_copied_day_and_a_copied_week():
    days, config = sound()
    values = the_one(with_day(days, 7, **vars_of(days[3])), config, "copy.two").values
    assert (values["first"], values["second"]) == ("2008-01-04", "2008-01-08")
    copied = [replace(days[k - 7], date=day.date) if 14 <= k < 21 else day for k, day in enumerate(days)]
    finding = the_one(copied, config, "copy.many")
    assert len(finding.days) == 14 and finding.days[days[15].date]["other"] == "2008-01-09"


def vars_of(day):
    return {"inflow": day.inflow, "outflow": day.outflow, "output": day.output}


def test_the_level_of_another_day():
    days, config = sound()
    assert the_one(with_day(days, 7, output=days[3].output), config, "copy.two").wrong


def test_a_programme_that_repeats_itself_is_no_copy():
    days, config = sound(6)
    rng = np.random.default_rng(1)
    same = [
        replace(day, inflow=days[0].inflow, outflow=days[0].outflow,
                output=days[0].output + 0.01 * rng.integers(0, 2, len(day.output)))
        for day in days
    ]  # fmt: skip
    assert check_days(same, config) == []


def test_constant_flows():
    days, config = sound(5)
    still = [replace(day, outflow=np.full_like(day.outflow, 285.0)) for day in days]
    finding = the_one(still, config, "constant.outflow_always")
    assert finding.wrong and finding.values["flow"] == [285, 285]
    finding = the_one(
        with_day(days, 2, inflow=np.full_like(days[2].inflow, 300.0)), config, "constant.inflow"
    )
    assert not finding.wrong and list(finding.days) == [days[2].date]


def test_a_command_with_a_lost_digit_is_a_remark():
    days, config = sound(5)
    odd = days[2].inflow.copy()
    odd[[100, 300, 301]] /= 1000
    finding = the_one(with_day(days, 2, inflow=odd), config, "moment")
    assert not finding.wrong
    assert [item["time"] for item in finding.days[days[2].date]["items"]] == ["03:42", "11:05"]


def test_flows_below_zero_are_a_remark_at_times_and_wrong_on_average():
    days, config = sound(5)
    pumped = [replace(day, outflow=day.outflow - 300.0 * (np.arange(650) < 20)) for day in days]
    (remark,) = (finding for finding in check_days(pumped, config) if finding.kind == "negative")
    assert remark.code == "negative.some" and remark.values["lowest"] < 0 and not remark.wrong
    negative = with_day(days, 2, inflow=-days[2].inflow)
    (finding,) = (found for found in check_days(negative, config) if found.kind == "negative")
    assert finding.code == "negative.mean" and finding.wrong and list(finding.days) == [days[2].date]
