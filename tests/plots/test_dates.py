"""Ticks of dates: readable from a day to a century."""

import datetime as dt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rivid.plots.dates import date_ticks


def test_a_week_names_each_day_and_the_year_once():
    labels = date_ticks(dt.date(2008, 3, 28), dt.date(2008, 4, 3)).labels
    assert labels == ["28 Mar\n2008", "29 Mar", "30 Mar", "31 Mar", "1 Apr", "2 Apr", "3 Apr"]


def test_a_year_has_its_months_between_lines_at_their_first_days():
    ticks = date_ticks(dt.date(2008, 1, 1), dt.date(2008, 12, 31))
    assert [label.split("\n")[0] for label in ticks.labels[:3]] == ["Jan", "Feb", "Mar"]
    assert len(ticks.labels) == 12
    feb = dt.date(2008, 2, 1).toordinal()
    assert feb - 0.5 in ticks.lines
    assert ticks.places[1] == pytest.approx(feb - 0.5 + 29 / 2)  # the middle of a leap February


def test_a_sliver_of_a_month_has_no_name():
    ticks = date_ticks(dt.date(2008, 1, 30), dt.date(2008, 12, 31))
    assert ticks.labels[0] == "Feb\n2008"


def test_the_new_year_is_named_where_it_begins():
    labels = date_ticks(dt.date(2007, 11, 1), dt.date(2008, 3, 31)).labels
    assert labels == ["Nov\n2007", "Dec", "Jan\n2008", "Feb", "Mar"]


@given(st.dates(dt.date(1800, 1, 1), dt.date(2200, 1, 1)), st.integers(1, 40_000))
def test_ticks_are_few_in_order_and_inside(first, days):
    last = first + dt.timedelta(days=days - 1)
    ticks = date_ticks(first, last)
    low, high = first.toordinal() - 0.5, last.toordinal() + 0.5
    assert 1 <= len(ticks.labels) <= 32
    assert len(ticks.labels) == len(ticks.places) == len(set(ticks.places))
    assert ticks.places == sorted(ticks.places)
    assert all(low <= at <= high for at in ticks.places + ticks.lines)
