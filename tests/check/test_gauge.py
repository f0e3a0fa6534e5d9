"""A gauge that stands still or jumps is told with times of day; one that is only coarse or calm is not."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.check.look import look
from tests.check.season import held, raised, sound


def test_a_gauge_that_stands_still_for_hours():
    days, config = sound()
    (finding,) = look(held(days, 12, 8, 13), config)
    assert finding.kind == "stuck" and list(finding.days) == [days[12].date]
    words = finding.text
    assert (
        words.startswith("h_L stands still from 0") and "while the flows move: is the gauge stuck?" in words
    )
    first, last = words.split(" from ")[1].split(" (")[0].split(" to ")
    assert "07:30" <= first <= "08:05" and "12:58" <= last <= "13:30"


def test_a_gauge_that_stands_still_for_days_is_told_once():
    days, config = sound()
    for k in range(5, 12):
        days = held(days, k, 0, 25)
    (finding,) = look(days, config)
    assert list(finding.days) == [day.date for day in days[5:12]] and "all day" in finding.text
    assert str(finding).startswith("2008-01-06 to 2008-01-12 (7 days): h_L stands still")
    assert all(words.endswith(" m all day") for words in finding.days.values())


def test_a_dead_gauge_on_every_day():
    days, config = sound(5)
    dead = [replace(day, output=np.full_like(day.output, 130.0)) for day in days]
    (finding,) = look(dead, config)
    assert finding.kind == "stuck" and len(finding.days) == 5
    (finding,) = look(dead[:1], config)
    assert finding.text == "h_L is 130 m all day while the flows move: is the gauge stuck?"


@pytest.mark.parametrize("step", [0.02, 0.05, 0.1])
def test_a_coarse_gauge_is_not_stuck(step):
    """Its steps are larger than what the flows do to the level for hours."""
    days, config = sound()
    assert look([replace(day, output=np.round(day.output / step) * step) for day in days], config) == []


@pytest.mark.parametrize("by", [0.2, -0.5, 3.0])
def test_a_jump_that_stays_is_told_with_its_size(by):
    days, config = sound()
    (finding,) = look(raised(days, 12, 10, by), config)
    assert finding.kind == "jump" and list(finding.days) == [days[12].date]
    size, at = finding.text.removeprefix("h_L jumps by ").split(":")[0].split(" m at ")
    assert abs(float(size) - by) < 0.05 and at in ("10", "09")
    assert "was the gauge moved, or its datum?" in finding.text


def test_a_jump_between_two_days_is_told():
    days, config = sound()
    (finding,) = look(raised(days, 12, 0, 0.5), config)
    assert finding.kind == "jump" and "at 00:00" in finding.text and list(finding.days) == [days[12].date]


def test_a_spike_is_told_with_its_reading():
    days, config = sound()
    (finding,) = look(raised(days, 12, 7, -100.0, samples=3), config)
    assert finding.kind == "spike" and "leaps away and back at 06:59 (29." in finding.text
    assert list(finding.days) == [days[12].date]


def test_a_gate_that_moves_much_makes_no_jump():
    """In a pool of Saint-Venant's equations the level at the dam falls at once, by a decimetre."""
    days, config = sound(40, "hydraulic_short")
    assert max(float(np.abs(np.diff(day.output)).max()) for day in days) > 0.08
    assert look(days, config) == []
