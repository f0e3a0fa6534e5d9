"""Test the summary of a run: its numbers and codes by hand, and the test for a change by simulation."""

import dataclasses
import datetime as dt
import json

import numpy as np
import pytest
from scipy import stats

from rivid.config import Config
from rivid.report.summary import (
    LEVEL,
    LIMITS,
    WEEKS,
    facts,
    impossible,
    last_week,
    leading,
    missing,
    step,
    trend,
    weeks_ago,
)
from rivid.results.store import assumed, describe
from rivid.text import spans
from tests.diagnosis import sizes
from tests.plots.synthetic import dates_of, results, river, without_answers
from tests.report.runs import STEADY, among, combined, passing, simple, summary_of, with_travel, write

AGO = np.repeat(np.arange(WEEKS, -1, -1), 7)
"""Weeks before the last one, for nine weeks day by day."""
NAN = np.nan


def days(rng, *, correlation=0.0, whole=True, middle=6.7, outliers=0.0):
    """Return nine weeks about one delay, with correlated days and outliers."""
    noise = rng.standard_normal(AGO.size + 20)
    x = np.zeros(noise.size)
    for i in range(1, x.size):
        x[i] = correlation * x[i - 1] + np.sqrt(1 - correlation**2) * noise[i]
    x = middle + 0.6 * x[20:]
    x = np.round(x) if whole else x
    return np.where(rng.random(x.size) < outliers, rng.integers(1, 16, x.size), x)


def test_the_limits_are_those_of_students_t():
    assert {k: round(float(stats.t.ppf(1 - LEVEL / 2, k - 1)), 3) for k in LIMITS} == LIMITS
    assert set(LIMITS) == set(range(4, WEEKS + 1))


def test_t_equals_that_of_a_regression_on_the_last_week():
    rng = np.random.default_rng(1)
    for _ in range(5):
        means = rng.normal(20, 5, WEEKS + 1)  # much more scatter of weeks than their days explain
        values = means[WEEKS - AGO] + 0.01 * rng.standard_normal(AGO.size)
        got = trend(values, AGO)
        each = np.array([np.sort(values[AGO == w])[1:-1].mean() for w in range(WEEKS + 1)])
        X = np.column_stack([np.ones(WEEKS + 1), np.arange(WEEKS + 1) == 0])
        beta, rss, *_ = np.linalg.lstsq(X, each, rcond=None)
        variance = rss[0] / (WEEKS - 1) * np.linalg.inv(X.T @ X)[1, 1]
        assert got["t"] == pytest.approx(beta[1] / np.sqrt(variance), rel=1e-9)
        p = 2 * stats.t.sf(abs(got["t"]), WEEKS - 1)
        assert got["moved"] == (p < LEVEL and not got["low"] <= got["now"] <= got["high"])


@pytest.mark.parametrize(
    ("most", "how", "missing"),
    [
        (0.01, {"outliers": 0.03}, 0.3),
        (0.012, {"correlation": 0.5, "outliers": 0.03}, 0.0),
        pytest.param(0.01, {"outliers": 0.03}, 0.0, marks=pytest.mark.long),
        pytest.param(0.01, {"whole": False}, 0.0, marks=pytest.mark.long),
        pytest.param(0.02, {"correlation": 0.8, "outliers": 0.03}, 0.0, marks=pytest.mark.long),
        pytest.param(0.02, {"correlation": 0.8, "outliers": 0.03}, 0.3, marks=pytest.mark.long),
        pytest.param(0.03, {"correlation": 0.8, "whole": False}, 0.0, marks=pytest.mark.long),
    ],
)
def test_the_size_of_the_test_is_as_stated_within_its_monte_carlo_error(most, how, missing):
    rng = np.random.default_rng(1)
    n, moves = 1200, 0
    for _ in range(n):
        there = rng.random(AGO.size) >= missing
        t = trend(days(rng, **how)[there], AGO[there])
        moves += t is not None and t["moved"]
    assert moves / n < most + 3 * np.sqrt(most * (1 - most) / n)


def test_a_move_of_two_samples_is_nearly_always_found():
    rng = np.random.default_rng(3)
    seen = [trend(days(rng, outliers=0.03) + 2.0 * (AGO == 0), AGO) for _ in range(300)]
    assert np.mean([t["moved"] for t in seen]) > 0.9
    assert all(t["t"] > 0 for t in seen if t["moved"])


def test_two_days_at_a_bound_are_no_move_and_weeks_without_scatter_move_at_any_difference():
    values = np.full(AGO.size, 7.0)
    assert not trend(values, AGO)["moved"]
    values[-2:] = 15.0
    assert not trend(values, AGO)["moved"]
    t = trend(7.0 + (AGO == 0), AGO)
    assert (
        t["moved"]
        and t["t"] == np.inf
        and (t["now"], t["before"], t["low"], t["high"]) == (8.0, 7.0, 7.0, 7.0)
    )


def test_too_few_days_or_weeks_give_no_test():
    values = np.full(AGO.size, 7.0)
    few = (AGO > 0) | (np.arange(AGO.size) >= AGO.size - 2)
    assert trend(values[few], AGO[few]) is None and trend(np.empty(0), np.empty(0, int)) is None
    assert trend(values[AGO < 4], AGO[AGO < 4]) is None and trend(values[AGO < 5], AGO[AGO < 5])["weeks"] == 4


def test_weeks_are_counted_back_from_the_last_day_across_missing_days():
    last = dt.date(2008, 3, 31)
    days = [last - dt.timedelta(days=k) for k in (30, 14, 13, 7, 6, 0)]
    assert weeks_ago(days).tolist() == [4, 2, 1, 1, 0, 0]


def test_the_last_week_ends_with_the_record_even_without_an_answer():
    recent = last_week(simple([7] * 66 + [NAN] * 4, ["ok"] * 66 + ["failed"] * 4))
    assert recent.last == recent.estimator.dates[-1]
    assert (int(recent.week.sum()), int(recent.given.sum()), recent.median) == (7, 3, 7)
    assert recent.trend["days"] == 3 and not recent.trend["moved"]
    assert last_week(dataclasses.replace(simple([7]), estimators=[])) is None


def test_degenerate_days_take_no_part_unless_by_construction():
    status = ["ok"] * 60 + ["degenerate"] * 3
    assert int(last_week(simple(STEADY, status)).decided.sum()) == 60
    assert int(last_week(simple(STEADY, status, name="jmap-degenerate")).decided.sum()) == 63


def test_facts_are_counted_by_hand():
    run = simple(
        [6, 7, 7, 15, NAN],
        ["ok", "ok", "ok", "ok", "failed"],
        condition=np.array([1e4, 2e4, 3e4, 4e4, NAN]),
        prior_only=np.array([True, False, False, True, True]),
    )
    f = facts(run, run.estimators[0])
    assert (f["days"], f["answered"], f["with_delay"], f["at_bound"], f["prior_only"]) == (5, 4, 4, 1, 2)
    assert (f["common"], f["common_days"], f["median"], f["condition"]) == ((6, 7), 3, 7, 2.5e4)


@pytest.mark.parametrize(
    ("names", "first"),
    [
        (("jmap", "direct", "posterior"), "posterior"),
        (("direct", "jmap-uniform"), "jmap-uniform"),
        (("cusum-ml", "direct", "jmap-uniform"), "jmap-uniform"),
        (("ml", "direct"), "direct"),
    ],
)
def test_the_estimator_with_the_best_known_reliability_represents_the_record(names, first):
    assert leading(results(names, dates_of(30))).estimator == first


@pytest.mark.parametrize(
    ("week", "prior", "code"),
    [
        ([7, 7, 6, 7, 7, 6, 7], 0, "same"),
        ([9, 9, 8, 9, 9, 9, 8], 0, "moved"),
        ([9] * 7, 5, "few_days"),
        ([7, 7, 6, 7, 12, 12, 12], 3, "same"),
    ],
)
def test_the_last_week_is_compared_on_days_that_the_data_decide(week, prior, code):
    s = summary_of(simple(STEADY[:-7] + week, prior_only=among(63, prior)))
    moved = s["moved"]
    assert (moved["code"], moved["days"], moved["decided_only"]) == (code, 7 - prior, prior > 0)
    if code == "moved":
        assert (moved["trend"]["now"], moved["trend"]["before"]) == (9, 7)
    assert (s["now"]["by_prior"], s["now"]["given"]) == (prior, 7)


def test_a_change_within_the_scatter_of_weeks_is_no_move():
    weeks = [5, 9, 6, 8, 7, 5, 9, 6, 8]
    moved = summary_of(simple([d for week in weeks for d in [week] * 7]))["moved"]
    t = moved["trend"]
    assert (moved["code"], t["now"], t["before"], t["low"], t["high"]) == ("scatter", 8, 6.5, 5, 9)


def test_a_week_outside_the_medians_of_the_weeks_before_is_not_within_their_scatter():
    """Regression: 12.3 min was "within the scatter" of weeks from 12.5 to 13.4 min."""
    weeks = [5, 9, 6, 8, 7, 5, 9, 6, 4]
    moved = summary_of(simple([d for week in weeks for d in [week] * 7]))["moved"]
    t = moved["trend"]
    assert (moved["code"], t["now"], t["low"], t["moved"]) == ("outside", 4, 5, False)


def test_weeks_that_are_missing_for_the_test_are_counted():
    for n, weeks, used in ((21, 2, 2), (8, 1, 0)):
        moved = summary_of(simple([7] * n))["moved"]
        assert (moved["code"], moved["weeks"], moved["weeks_used"]) == ("few_weeks", weeks, used)
    moved = summary_of(simple(STEADY, prior_only=~among(63, 21)))["moved"]
    assert (moved["code"], moved["weeks"], moved["weeks_used"]) == ("few_weeks", 8, 2)
    assert summary_of(simple([6]))["moved"]["code"] == "one_week"


def test_a_move_of_a_fraction_of_a_sample_is_found_where_the_fraction_is_known():
    rng = np.random.default_rng(3)
    run = simple([7] * 63, name="posterior", probability=np.full(63, 0.9))
    assert summary_of(run)["moved"]["code"] == "same"
    s = summary_of(with_travel(run, 0.2 + 0.02 * rng.standard_normal(63) + 0.5 * among(63, 7)))
    t = s["moved"]["trend"]
    assert s["now"]["quantity"] == "travel" and s["moved"]["code"] == "moved"
    assert t["now"] - t["before"] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("t50", [False, True])
def test_the_last_week_has_the_ninety_per_cent_of_its_median_day(t50, tmp_path):
    low, high = np.array([4, 6, 6, 6, 7, 7, 7.0]), np.array([7, 7, 7, 7, 8, 8, 9.0])
    run = passing([6.6] * 7, [300.0] * 7) if t50 else with_travel(simple([7] * 7, name="posterior"), 0.25)
    assert summary_of(run)["now"]["interval"] is None
    (e,) = run.estimators[:1]
    e = dataclasses.replace(e, delay_low=low, delay_high=high, probability=np.full(7, 0.9))
    run = dataclasses.replace(run, estimators=[e])
    assert summary_of(run)["now"]["interval"] == ((5.5, 7.5) if t50 else (6.0, 8.0))
    _, page = write(run, tmp_path)
    assert (
        "with 90 % between 82.5 and 112 min" if t50 else "with 90 % between 13.3 and 17.7 min"
    ) in page.words
    if not t50:
        assert "0.90 of the delay, to within a tenth of a sample" in page.words


def test_a_week_without_an_answer_has_its_reasons_and_the_latest_value():
    run = simple(STEADY[:-7] + [NAN] * 7, ["ok"] * 56 + ["failed"] * 6 + ["pending"])
    now = summary_of(run)["now"]
    assert (now["code"], now["statuses"]) == ("none_in_week", {"failed": 6, "pending": 1})
    assert now["latest"] == (dt.date(2008, 2, 25), 7) and now["given"] == 0


def test_failing_and_pending_records_have_their_codes():
    now = summary_of(simple([NAN] * 7, ["failed"] * 7))["now"]
    assert (now["code"], now["statuses"], now["latest"]) == ("none", {"failed": 7}, None)
    assert now["reason"] is None
    for times in (7, 4, 3):
        messages = ["too short; remark"] * times + ["other"] * (7 - times)
        now = summary_of(simple([NAN] * 7, ["failed"] * 7, messages))["now"]
        assert now["reason"] == (("other", 4) if times == 3 else ("too short", times))
    s = summary_of(simple([NAN] * 3, ["pending"] * 3))
    assert s["now"]["code"] == "pending" and s["moved"] is None and s["prior"] is None
    s = summary_of(dataclasses.replace(simple([7]), estimators=[]))
    assert (s["days"], s["now"], s["record"]) == (0, None, None)
    assert summary_of(without_answers(river(7)))["now"]["code"] == "none"


def test_a_median_at_an_end_of_the_searched_range_is_marked():
    assert summary_of(simple([15] * 6))["now"]["at_end"]
    assert not summary_of(simple([14] * 6))["now"]["at_end"]


@pytest.mark.parametrize(
    ("part", "decides"),
    [(slice(-2, None), None), (slice(-3, None), ("week", 3, 7)), (slice(7), ("record", 7, 21))],
)
def test_the_prior_is_named_where_it_decides_a_third_of_the_week_or_of_the_record(part, decides):
    prior = np.zeros(21, bool)
    prior[part] = True
    got = summary_of(simple([7] * 21, prior_only=prior))["prior"]
    assert got["decides"] == decides and got["rayleigh"] and got["record"] == (int(prior.sum()), 21)
    uniform = summary_of(simple([7] * 21, prior_only=prior, name="jmap-uniform"))["prior"]
    assert uniform["decides"] == decides and not uniform["rayleigh"]


def test_estimators_without_a_check_and_with_probabilities_have_their_own_codes():
    assert summary_of(simple(STEADY, name="cusum-map"))["prior"]["code"] == "not_judged"
    sure = np.linspace(0.75, 0.95, 63)
    prior = summary_of(simple(STEADY, name="posterior", probability=sure))["prior"]
    assert (prior["code"], prior["of"]) == ("probability", "week")
    assert (prior["median"], prior["least"]) == (np.median(sure[-7:]), sure[-7])


def test_the_record_of_a_pool_by_hand():
    status = ["ok"] * 332 + ["failed", "failed", "unidentifiable"]
    record = summary_of(simple([6] * 200 + [7] * 127 + [5] * 5 + [NAN] * 3, status))["record"]
    f = record["facts"]
    assert (f["common"], f["common_days"], f["with_delay"], f["days"]) == ((6, 7), 327, 332, 335)
    assert record["statuses"] == {"failed": 2, "unidentifiable": 1} and record["gravity"] == (1000, 1000)
    assert record["modes"] == [6, 7] and record["near_prior"] and record["uniform"] is None
    assert not record["piled"] and not record["spread"]


def test_a_delay_far_from_the_mode_of_the_prior_and_a_uniform_prior_are_noted():
    assert not summary_of(simple([11] * 9 + [12] * 9))["record"]["near_prior"]
    both = combined(simple([6] * 9), simple([6] * 5 + [9] * 3 + [3], name="jmap-uniform"))
    name, f = summary_of(both)["record"]["uniform"]
    assert (name, f["common"], f["common_days"], f["with_delay"]) == ("jmap-uniform", (6, 9), 8, 9)


def test_spread_delays_have_a_range_and_delays_at_both_ends_are_piled():
    record = summary_of(simple(np.arange(1, 16).repeat(4)))["record"]
    f = record["facts"]
    assert record["spread"] and (f["median"], f["low"], f["high"]) == (8, 2, 14)
    assert summary_of(simple([1, 15] * 30 + [6] * 10))["record"]["piled"]


def test_reasons_of_unidentifiable_days_are_counted_for_an_estimator_with_several():
    status = ["ok"] * 4 + ["unidentifiable"] * 3
    messages = [""] * 4 + ["no front; more", "no front", "unlikely"]
    run = simple([7] * 4 + [NAN] * 3, status, messages, name="posterior", probability=np.full(7, 0.9))
    assert summary_of(run)["record"]["reasons"] == [("no front", 2), ("unlikely", 1)]


def test_a_river_has_its_t50_by_flow_and_between_the_waves():
    s = summary_of(passing([30, 30, 30, 27, 26, 26, 25, 25, 25, 24], range(200, 300, 10)))
    p = s["passage"]["numbers"]
    assert s["now"]["quantity"] == "t50" and p.median == 26 and (p.between, p.bounded) == (7, 10)
    assert p.thirds.medians == (30, 26, 25) and p.thirds.longer == 1
    assert s["passage"]["gravity"] == (7200, 7200) and s["record"]["fir_only"]
    assert s["prior"]["code"] == "response" and not s["prior"]["jump"]


def test_a_river_without_t50_counts_responses_without_a_positive_sum():
    s = summary_of(passing([26.4, NAN, NAN], [300, NAN, 310], status=["ok", "failed", "ok"]))
    assert (s["passage"]["statuses"], s["passage"]["no_sum"]) == ({"failed": 1}, 1)


def test_the_jump_delay_of_a_river_is_of_little_use_where_the_prior_decides():
    run = river(40)
    s, f = summary_of(run), facts(run, run.estimators[1])
    assert s["passage"]["jump_of_little_use"] and s["prior"]["record"] == (f["prior_only"], f["with_delay"])
    assert s["record"]["modes"] == [23, 24, 25, 26, 27]


def test_days_faster_than_the_gravity_wave_are_judged_by_the_best_known_time():
    bound = np.full(4, 9.1 * 133)
    run = simple([7, 8, 9, NAN], ["ok"] * 3 + ["failed"], bound_gravity_s=bound)
    assert impossible(run, run.estimators[0])[0].tolist() == [True, False, False, False]
    exact = with_travel(run, 0.05)
    assert impossible(exact, exact.estimators[0])[0].tolist() == [True, True, False, False]
    water = river(5)
    e = dataclasses.replace(water.estimators[0], bound_gravity_s=(water.estimators[0].t50 + 1.01) * 900)
    fast, _ = impossible(water, e, "t50")
    assert fast.tolist() == np.isfinite(e.t50).tolist() and fast.any()
    s = summary_of(dataclasses.replace(water, estimators=[e]))
    assert s["now"]["fast"] and s["waves"]["fast"] == s["waves"]["days"]


@pytest.mark.parametrize(("bound", "days", "headline"), [(9.1, 21, True), (9.1, 3, False), (8.9, 21, False)])
def test_the_headline_doubts_a_week_that_is_mostly_too_fast(bound, days, headline):
    s = summary_of(simple([7] * 21, bound_gravity_s=np.where(among(21, days), bound * 133, 1000.0)))
    assert s["now"]["fast"] == headline
    assert s["waves"]["fast"] == (min(days, 7) if bound > 9 else 0)


@pytest.mark.parametrize(("bound", "days", "headline"), [(2.9, 21, True), (2.9, 3, False), (3.1, 21, False)])
def test_the_headline_doubts_a_week_that_is_mostly_too_slow(tmp_path, bound, days, headline):
    run = simple([7] * 21, bound_gravity_s=np.where(among(21, days), bound * 133, 1000.0))
    assert (summary_of(run)["now"]["slow"] is not None) == headline
    assert ("the configuration gives 6.4\u00a0min: check length" in write(run, tmp_path)[0]) == headline


def test_a_river_is_too_slow_by_its_kinematic_wave():
    water = river(5)
    (_, slow), (_, sound) = (
        impossible(water, dataclasses.replace(e, bound_kinematic_s=(e.t50 - 1) * 900 / 2 + off), "t50")
        for e in water.estimators[:1]
        for off in (-1, 1)
    )
    assert slow.tolist() == np.isfinite(water.estimators[0].t50).tolist() and not sound.any()


def test_an_assumed_geometry_is_compared_with_nothing():
    for run in (simple(STEADY), river(30)):
        s = summary_of(dataclasses.replace(run, assumed=("width",)))
        assert s["waves"] == {"code": "assumed"} and s["assumed"] == ("width",)


def test_geometry_that_is_not_configured_is_written_into_the_record(tmp_path):
    def keys(**reach):
        return assumed(Config.model_validate({"reach": reach}))

    assert keys(length=8200) == ["width", "depth"], "a given default counts as given"
    assert keys(length=1, width=1, depth=1) == keys(length=1, width=1, bed_level=90.0) == []
    now = dt.datetime(2024, 1, 1, tzinfo=dt.UTC)
    record = json.loads(json.dumps(describe(Config(), tmp_path, now)))
    assert record["assumed"] == ["length", "width", "depth"]


@pytest.mark.parametrize("seed", [1, 2])
def test_missing_days_are_those_between_the_first_and_the_last(seed):
    dates = dates_of(40, missing=15, seed=seed)
    gone = missing(dates)
    assert len(gone) == 15 and not set(gone) & set(dates)
    assert sorted([*gone, *dates]) == [dates[0] + dt.timedelta(days=k) for k in range(55)]
    assert missing([]) == missing(dates[:1]) == []
    gaps = spans(gone)
    assert sum((last - first).days + 1 for first, last in gaps) == 15
    assert len(gaps) == sum((b - a).days > 1 for a, b in zip(dates, dates[1:], strict=False))


def test_an_estimator_from_other_software_is_summarised_too():
    run = simple([6, 7], name="theirs")
    assert facts(run, run.estimators[0])["with_delay"] == 2


@sizes("seeds", 60, 600)
@pytest.mark.parametrize(("memory", "size"), [(0.0, 0.01), (0.5, 0.02), (0.8, 0.05)])
def test_days_without_a_step_have_none_and_one_of_eight_deviations_is_found_where_it_is(memory, size, seeds):
    false, found = 0, 0
    day = np.arange(45.0)
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        flow = np.exp(5.0 + np.cumsum(0.1 * rng.normal(size=45)))
        values = rng.normal(size=45)
        for i in range(1, 45):
            values[i] = memory * values[i - 1] + np.sqrt(1.0 - memory**2) * values[i]
        values += 8.0 * (rng.random(45) < 0.05) * rng.normal(size=45)
        values -= 3.0 * np.log(flow)
        false += step(values, flow, day) is not None
        place = step(values + 8.0 * (day >= 36), flow, day)
        found += place is not None and abs(place - 36) <= 1
    assert false <= size * seeds + 3.0 * np.sqrt(size * seeds)
    assert found >= 0.75 * seeds


def test_a_step_within_the_weeks_before_is_reported_with_its_date():
    """Regression: a gauge clock 10 min late from the fourth week on was "within the scatter of weeks"."""
    e = results(("jmap",), dates_of(56)).estimators[0]
    moved = 7.0 + 4.0 * (np.arange(56) >= 43)
    run = results(("jmap",), dates_of(56))
    run.estimators[0] = dataclasses.replace(
        e, delay=moved, status=["ok"] * 56, prior_only=np.zeros(56, bool), mean_inflow=np.full(56, 300.0)
    )
    got = summary_of(run)["moved"]
    assert got["code"] != "moved" and got["since"] == e.dates[43] and got["sides"] == (7.0, 11.0)


def test_a_delay_far_longer_than_the_gravity_wave_puts_the_geometry_in_doubt():
    """Regression: half of the true length gave no warning."""
    run = results(("jmap",), dates_of(14))
    e = run.estimators[0]
    for share, slow in ((1.2, False), (2.0, True)):
        run.estimators[0] = dataclasses.replace(e, bound_gravity_s=(e.delay + 0.5) * run.sample_time / share)
        waves = summary_of(run)["waves"]
        assert waves["ratio"] == pytest.approx(share) and waves["slow"] == slow


@pytest.mark.parametrize("odd", [3, 21])
def test_a_flow_that_is_too_fast_for_the_geometry_is_named(tmp_path, odd):
    """Regression: flows in litres a second left the row of the gravity wave out."""
    wrong = among(21, odd)
    bound, flow = np.where(wrong, NAN, 1000.0), np.where(wrong, 3e5, 300.0)
    run = simple([7] * 21, bound_gravity_s=bound, mean_inflow=flow)
    waves = summary_of(run)["waves"]
    assert (waves["torrents"], waves["flow"]) == (min(odd, 7), 3e5)
    html, _ = write(run, tmp_path)
    text = f"On {min(odd, 7)} of 7 days the mean inflow, 300,000 m³/s, is too fast"
    assert "Gravity wave</dt>" in html and text in html
