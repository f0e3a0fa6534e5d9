"""Test the outcome of a reach: its band, and the test for a change, shared with the report."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rivid.cli.fleet import print_summary
from rivid.config import Config
from rivid.fleet.outcome import WEEK, Outcome, band, outcome_of, worst
from rivid.fleet.report import write_fleet
from rivid.report.attention import BAND_DAYS
from rivid.report.summary import doubted, last_week
from tests.pages import Page
from tests.report.runs import STEADY, simple

GIVEN = {"length": 8200.0, "width": 220.0, "depth": 7.0, "discharge_range": [100.0, 900.0]}
"""Geometry, so that the reach has bounds."""


def rows_of(run):
    """Return the columns of a run that are kept in memory."""
    (e,) = run.estimators
    n = len(e.dates)
    return pa.table(
        {
            "date": pa.array(e.dates, pa.date32()),
            "estimator": [e.estimator] * n,
            "status": e.status,
            "message": e.messages,
            "delay_samples": pa.array(e.delay, from_pandas=True),
            "delay_s": pa.array(e.delay * run.sample_time, from_pandas=True),
            "t50_samples": pa.nulls(n, pa.float64()),
            "prior_only": e.prior_only,
            "probability": pa.nulls(n, pa.float64()),
            "at_bound": e.at_bound,
            "bound_gravity_s": pa.array(e.bound_gravity_s, from_pandas=True),
            "bound_kinematic_s": pa.array(e.bound_kinematic_s, from_pandas=True),
            "mean_inflow_m3s": pa.array(e.mean_inflow, from_pandas=True),
        }
    )


def outcome(run):
    summary = SimpleNamespace(rows=rows_of(run), exit_code=0, windows=9, computed=9, dropped=0, failures=0)
    summary.new_failures, summary.bad_files = 0, []
    return outcome_of(
        "a", Config.model_validate({"run": {"estimators": ["jmap"]}, "reach": GIVEN}), summary, "content"
    )


def test_the_band_is_of_the_year_before_the_week_without_gaps():
    days = np.arange(1000, 1400)
    values = np.full(400, 6.0)
    values[:30] = 99.0  # more than a year before the week
    values[-WEEK:] = 9.0
    values[100:150] = np.nan
    found = band(days, values)
    assert [found[key] for key in ("low", "high", "median")] == [6, 6, 6]
    assert [found[key] for key in ("days", "above", "below")] == [7, 7, 0]
    late = band(np.append(days, 1500), np.append(values, 6.0))
    assert (late["days"], late["above"]) == (1, 0)


def test_few_days_make_no_band():
    values = np.full(BAND_DAYS + WEEK, 5.0)
    assert band(np.arange(len(values)), values) is not None
    values[0] = np.nan
    assert band(np.arange(len(values)), values) is None
    assert band(np.zeros(0, int), np.zeros(0)) is None


@pytest.mark.parametrize("days", [14, 60])
def test_a_week_with_answers_has_its_median_with_and_without_a_band(days, tmp_path):
    week = outcome(simple([6] * (days - WEEK) + [9] * WEEK))
    silent = outcome(simple([6] * (days - WEEK) + [np.nan] * WEEK))
    assert (week.week_median, silent.week_median) == (9, None)
    assert (week.band is None) == (days - WEEK < BAND_DAYS)
    write_fleet(tmp_path, [week], "fleet")
    assert pq.read_table(tmp_path / "fleet.parquet")["median_last_week"].to_pylist() == [9]
    band_of_page = "–" if week.band is None else "6 (13.3 to 15.5 min)"
    assert f"{band_of_page} 9 (19.9 to 22.2 min)" in Page((tmp_path / "fleet.html").read_text()).words


@pytest.mark.parametrize("shift", [0, 2])
def test_the_fleet_and_the_report_agree_on_a_move(shift):
    run = simple(STEADY[:-7] + [d + shift for d in STEADY[-7:]])
    got, trend = outcome(run), last_week(run).trend
    assert (got.moved, got.change) == (trend["moved"], trend["now"] - trend["before"]) == (shift > 0, shift)
    assert (got.estimator, got.quantity, got.days_week, got.answered_week) == ("jmap", "delay", 7, 7)
    assert (got.band["low"], got.band["high"], got.band["above"]) == (6, 7, 7 if shift else 0)


def test_a_step_in_the_weeks_before_is_listed_with_its_date(tmp_path):
    got = outcome(simple(STEADY[:-20] + [d + 4 for d in STEADY[-20:]]))
    assert not got.moved and got.change == pytest.approx(4.0, abs=0.6)
    found = write_fleet(tmp_path, [got], "fleet")
    assert got.since and found["left_band"] == ["a"] and got.since in (tmp_path / "fleet.html").read_text()
    row = pq.read_table(tmp_path / "fleet.parquet").to_pylist()[0]
    assert (row["left_band"], row["since"]) == (True, got.since)


def test_reaches_without_a_test_are_counted_apart_from_those_that_rest(tmp_path, capsys):
    found = write_fleet(tmp_path, [outcome(simple(STEADY[:10])), Outcome("c", 2, "broken")], "fleet")
    assert (found["left_band"], found["untested"]) == ([], ["a"])
    words = Page((tmp_path / "fleet.html").read_text()).words
    assert "1 reach has too few answered days for the test of the last week" in words
    print_summary(found, None, tmp_path)
    output = capsys.readouterr().out
    assert "1 with too few answered days for the test of the last week: a" in output
    assert "2 reaches, 9 data sets" in output and "1 failing: c" in output


@pytest.mark.parametrize(
    ("wave", "d", "doubt"), [(1000.0, 7, ""), (1500.0, 7, "fast"), (500.0, 7, "slow"), (np.nan, 7, "")]
)
def test_a_delay_that_the_report_puts_in_doubt_is_listed(wave, d, doubt, tmp_path):
    run = simple([d] * 30, bound_gravity_s=np.full(30, wave))
    got = outcome(run)
    assert got.doubt == doubt == doubted(run, last_week(run))
    found = write_fleet(tmp_path, [got], "fleet")
    assert found["doubtful"] == ["a"] * bool(doubt)
    words = Page((tmp_path / "fleet.html").read_text()).words
    assert ("1 reach has a delay that does not fit the waves" in words) == bool(doubt)


def test_days_that_the_prior_decides_and_failed_days_are_no_answers_of_the_week():
    prior = np.arange(63) >= 61
    status, messages = ["ok"] * 60 + ["failed", "ok", "ok"], [""] * 60 + ["gap", "", ""]
    got = outcome(simple(STEADY[:60] + [np.nan, 7, 7], status, messages, prior_only=prior))
    assert (got.days_week, got.answered_week, got.recent) == (7, 4, [("2008-03-01", "gap")])
    short = outcome(simple([7] * 3))
    assert (short.moved, short.band, short.change) == (None, None, 0)


def test_the_page_lists_what_moved_and_counts_what_was_tested(tmp_path):
    moved = outcome(simple(STEADY[:-7] + [9] * 7))
    still = Outcome("b", 0, content="x", first="2008-01-01", last="2008-03-03", moved=False)
    summary = write_fleet(tmp_path, [moved, still, Outcome("c", 2, "broken")], "fleet")
    assert (summary["left_band"], summary["failing"]) == (["a"], ["c"])
    page = Page((tmp_path / "fleet.html").read_text())
    assert "Of 2 tested" in page.words
    moved_row = "6 to 7 (13.3 to 17.7 min) 9 (19.9 to 22.2 min) +2.0 (4.4 min) 7 above of 7"
    assert moved_row in page.words
    ids = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    links = {attrs["href"] for tag, attrs in page.tags if tag == "a"}
    assert {link[1:] for link in links if link[0] == "#"} <= ids and "a/report.html" in links


def test_the_page_lists_reaches_that_had_days_and_no_answer_in_the_last_week(tmp_path):
    decided = outcome(simple(STEADY))
    prior = Outcome("b", 0, content="x", first="2008-01-01", last="2008-03-03", days_week=7)
    found = write_fleet(tmp_path, [decided, prior, Outcome("c", 10, "no log")], "fleet")
    assert found["unanswered"] == ["b"]
    words = Page((tmp_path / "fleet.html").read_text()).words
    assert "1 reach has no answer in the last week" in words and "No reach is silent" in words


def test_the_exit_code_of_a_fleet_is_the_worst():
    assert worst([0, 3, 10, 0]) == 10 and worst([]) == 0
