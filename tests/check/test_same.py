"""Days that are copies, flows that never move, flows below zero."""

from dataclasses import replace

import numpy as np

from rivid.check.look import look
from tests.check.season import sound


def test_the_same_samples_under_two_dates():
    days, config = sound()
    copied = [replace(days[3], date=day.date) if k == 7 else day for k, day in enumerate(days)]
    (finding,) = look(copied, config)
    assert finding.kind == "copy"
    assert (
        finding.text == "the same samples stand under 2008-01-04 and 2008-01-08: is one a copy of the other?"
    )


def test_a_week_that_was_copied_is_told_once():
    days, config = sound()
    copied = [replace(days[k - 7], date=day.date) if 14 <= k < 21 else day for k, day in enumerate(days)]
    (finding,) = look(copied, config)
    assert "2008-01-08 and 2008-01-15 for one" in finding.text
    assert len(finding.days) == 14 and finding.days[days[15].date] == "all columns as on 2008-01-09"


def test_the_level_of_another_day():
    days, config = sound()
    copied = [replace(day, output=days[3].output) if k == 7 else day for k, day in enumerate(days)]
    kinds = [finding.kind for finding in look(copied, config)]
    assert kinds == ["copy"]


def test_a_programme_that_repeats_itself_is_no_copy():
    """The commands are the same each day; what is measured is not."""
    days, config = sound(6)
    rng = np.random.default_rng(1)
    same = [
        replace(day, inflow=days[0].inflow, outflow=days[0].outflow,
                output=days[0].output + 0.01 * rng.integers(0, 2, len(day.output)))
        for day in days
    ]  # fmt: skip
    assert look(same, config) == []


def test_flows_that_never_move():
    days, config = sound(5)
    still = [replace(day, outflow=np.full_like(day.outflow, 285.0)) for day in days]
    (finding,) = look(still, config)
    assert finding.wrong
    assert finding.text.startswith("the outflow is constant (285 m3/s) on every day while the inflow moves")
    still = [
        replace(day, inflow=np.full_like(day.inflow, 300.0)) if k == 2 else day for k, day in enumerate(days)
    ]
    (finding,) = look(still, config)
    assert not finding.wrong and finding.days == {days[2].date: "the inflow is constant"}


def test_a_command_with_a_lost_digit_is_a_remark():
    days, config = sound(5)
    odd = days[2].inflow.copy()
    odd[[100, 300, 301]] /= 1000  # a point for thousands
    (finding,) = look([replace(d, inflow=odd) if k == 2 else d for k, d in enumerate(days)], config)
    assert not finding.wrong and list(finding.days) == [days[2].date]
    assert finding.text == "u_Qi is far off for a moment at 03:42, 11:05"


def test_flows_below_zero_are_a_remark():
    days, config = sound(5)
    pumped = [replace(day, outflow=day.outflow - 300.0 * (np.arange(650) < 20)) for day in days]
    remarks = [finding for finding in look(pumped, config) if finding.kind == "negative"]
    assert not remarks[0].wrong and "u_Qo is negative, down to -" in remarks[0].text
