"""Test the days to inspect: which they are, and how they share rows."""

import datetime as dt

import numpy as np
import pytest

from rivid.report.attention import attention, band, dates_of, outside
from tests.plots.synthetic import searched
from tests.report.runs import STEADY, combined, simple, summary_of

NAN = np.nan


def rows(run):
    return [(row["first"].day, row["days"], row["kind"]) for row in attention(run, None)]


def test_neighbours_with_one_reason_are_one_row_the_latest_first():
    run = simple(
        [6, NAN, NAN, NAN, 15, 15, 15, 6],
        ["ok", "failed", "failed", "failed", "ok", "ok", "ok", "ok"],
        ["", "no file", "no file", "too short", "", "", "", ""],
    )
    assert rows(run) == [(5, 3, "at_bound"), (4, 1, "failed"), (2, 2, "failed")]
    got = attention(run, None)
    assert got[0]["value"] == 15 and [row["message"] for row in got[1:]] == ["too short", "no file"]


def test_the_same_reason_of_several_estimators_is_one_row():
    run = combined(
        simple([NAN, 6], ["failed", "ok"], ["no file", ""]),
        simple([NAN, 15], ["failed", "ok"], ["no file", ""], name="jmap-uniform"),
    )
    assert [row["estimators"] for row in attention(run, None)] == [
        ("jmap-uniform",),
        ("jmap", "jmap-uniform"),
    ]


def test_estimators_that_degenerate_by_construction_are_not_listed():
    assert rows(simple([1, 6, 7], ["degenerate"] * 3, name="jmap-degenerate")) == []
    assert rows(simple([6, 7], ["degenerate", "ok"])) == [(1, 1, "degenerate")]


def test_many_days_at_the_bounds_share_a_row_and_a_few_do_not():
    run = searched()
    e = run.estimators[0]
    (row,) = attention(run, None)
    assert (row["kind"], row["days"], row["of"], row["band"]) == (
        "at_bound",
        int(e.at_bound.sum()),
        120,
        (1, 15),
    )
    assert dates_of(row, run) == {date for date, edge in zip(e.dates, e.at_bound, strict=True) if edge}
    assert [row["days"] for row in attention(simple([6] * 80 + [15] * 25), None)] == [25]
    assert len(attention(simple([6, 15] * 13), None)) == 13
    assert len(attention(simple(([6] * 4 + [15]) * 30), None)) == 30, "a fifth of the days"


def test_a_band_needs_thirty_days_and_holds_nine_tenths():
    assert band(np.full(29, 6.0)) is None
    values = np.random.default_rng(4).normal(20, 1, 400)
    low, high = band(values)
    assert np.mean((values >= low) & (values <= high)) == pytest.approx(0.9, abs=0.01)
    edge = high + (high - low)
    assert outside(np.array([edge - 1e-9, edge + 1e-9, NAN]), (low, high)).tolist() == [False, True, False]


def test_days_far_outside_the_band_are_rows_unless_at_a_bound():
    s = summary_of(simple(STEADY[:-3] + [12, 6, 15]))
    assert [(row["first"], row["kind"]) for row in s["rows"]] == [
        (dt.date(2008, 3, 3), "at_bound"),
        (dt.date(2008, 3, 1), "far"),
    ]
    assert s["rows"][1]["value"] == 12 and s["rows"][1]["band"] == (6, 7) and s["rows"][1]["decided"]
    assert [link[2:] for link in s["look"]["links"]] == [("at_bound", 0), ("far", 1)]


def test_days_are_counted_by_week_and_by_estimator():
    run = simple([15] + STEADY[1:-7] + [NAN] * 7, ["ok"] * 56 + ["failed"] * 6 + ["pending"])
    look = summary_of(run)["look"]
    assert (look["days"], look["earlier"], look["latest"], look["others"]) == (7, 1, dt.date(2008, 1, 1), 0)
    day = dt.date(2008, 3, 3)
    assert look["links"][0] == (day, day, "pending", 0)
    other = combined(simple(STEADY), simple([15] * 2 + STEADY[2:], name="jmap-uniform"))
    look = summary_of(other)["look"]
    assert (look["days"], look["others"], look["links"]) == (0, 2, [])


@pytest.mark.parametrize(("gone", "late"), [((4, 11, 12), False), ((4, 19), True)])
def test_a_day_of_the_last_week_without_a_log_is_marked(gone, late):
    dates = [dt.date(2008, 3, 1) + dt.timedelta(days=k) for k in range(21) if k not in gone]
    s = summary_of(simple([7] * len(dates), dates=dates))
    assert (s["missing"], s["look"]["no_log"]) == (len(gone), late)
    assert s["no_log"][0] == (dt.date(2008, 3, 5), dt.date(2008, 3, 5))


def test_all_estimators_and_dates_stay_in_order():
    run = combined(simple([6, NAN, 6], ["ok", "failed", "ok"], ["", "no file", ""]), searched())
    got = attention(run, None)
    assert [row["last"] for row in got] == sorted((row["last"] for row in got), reverse=True) and len(
        got
    ) == 2
