"""The last week against the weeks before: by hand, against scipy, and how often chance is called a move."""

import dataclasses
import datetime as dt

import numpy as np
import pytest
from scipy import stats

from rivid.report.lately import LIMITS, WEEK, WEEKS, band, lately, trend, weeks_ago
from rivid.report.strip import HEIGHT, WIDTH, strip, svg, ticks
from tests.plots.synthetic import cases, dates_of, estimator, results, without_answers

AGO = np.repeat(np.arange(WEEKS, -1, -1), WEEK)
"""Nine weeks, day by day."""


def days(rng, *, correlation=0.0, whole=True, middle=6.7, outliers=0.0):
    """Nine weeks about one delay, with days that hang together and some that are anything."""
    noise = rng.standard_normal(AGO.size + 20)
    x = np.zeros(noise.size)
    for i in range(1, x.size):
        x[i] = correlation * x[i - 1] + np.sqrt(1 - correlation**2) * noise[i]
    x = middle + 0.5 * x[20:]
    x = np.round(x) if whole else x
    return np.where(rng.random(x.size) < outliers, rng.integers(1, 16, x.size), x)


def test_the_limits_are_students_once_in_a_hundred():
    assert {k: round(float(stats.t.ppf(0.995, k - 1)), 3) for k in LIMITS} == LIMITS
    assert set(LIMITS) == set(range(4, WEEKS + 1))


def test_t_of_calm_weeks_is_that_of_a_new_observation_by_scipy():
    rng = np.random.default_rng(1)
    for _ in range(5):
        means = rng.normal(20, 5, WEEKS + 1)  # far more scatter among weeks than their days explain
        values = means[WEEKS - AGO] + 0.01 * rng.standard_normal(AGO.size)
        got = trend(values, AGO)
        each = np.array([np.sort(values[AGO == w])[1:-1].mean() for w in range(WEEKS + 1)])
        # regress the weeks on a dummy of the last one: its coefficient's t is that of a new observation
        X = np.column_stack([np.ones(WEEKS + 1), np.arange(WEEKS + 1) == 0])
        beta, rss, *_ = np.linalg.lstsq(X, each, rcond=None)
        variance = rss[0] / (WEEKS - 1) * np.linalg.inv(X.T @ X)[1, 1]
        assert got.t == pytest.approx(beta[1] / np.sqrt(variance), rel=1e-9)
        p = 2 * stats.t.sf(abs(got.t), WEEKS - 1)
        outside = not got.low <= got.now <= got.high
        assert got.moved == (p < 0.01 and outside)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("most", "how"),
    [
        (0.01, {}),
        (0.01, {"whole": False}),
        (0.01, {"outliers": 0.05}),
        (0.03, {"correlation": 0.8, "whole": False}),
        (0.03, {"correlation": 0.8, "middle": 6.9}),
    ],
)
def test_chance_is_called_a_move_no_more_often_than_said(seed, most, how):
    rng = np.random.default_rng(seed)
    n = 1500
    moves = sum(trend(days(rng, **how), AGO).moved for _ in range(n))
    assert moves / n < most + 3 * np.sqrt(most * (1 - most) / n)


def test_a_move_of_two_samples_is_nearly_always_seen():
    rng = np.random.default_rng(3)
    seen = [trend(days(rng, outliers=0.03) + 2.0 * (AGO == 0), AGO) for _ in range(300)]
    assert np.mean([t.moved for t in seen]) > 0.9
    assert all(t.t > 0 for t in seen if t.moved)


def test_two_days_at_a_bound_in_the_last_week_are_no_move():
    values = np.full(AGO.size, 7.0)
    values[-2:] = 15.0
    assert not trend(values, AGO).moved
    assert not trend(np.full(AGO.size, 7.0), AGO).moved


def test_weeks_that_differ_beyond_all_scatter_have_moved():
    t = trend(7.0 + (AGO == 0), AGO)
    assert t.moved and t.t == np.inf and (t.now, t.before, t.low, t.high) == (8.0, 7.0, 7.0, 7.0)


def test_too_few_days_or_weeks_give_no_trend():
    values = np.full(AGO.size, 7.0)
    few = (AGO > 0) | (np.arange(AGO.size) >= AGO.size - 2)
    assert trend(values[few], AGO[few]) is None
    assert trend(values[AGO < 4], AGO[AGO < 4]) is None and trend(values[AGO < 5], AGO[AGO < 5]).weeks == 4
    assert trend(np.empty(0), np.empty(0, int)) is None


def test_weeks_are_counted_back_from_the_last_day_over_days_that_are_missing():
    last = dt.date(2008, 3, 31)
    dates = [last - dt.timedelta(days=k) for k in (30, 14, 13, 7, 6, 0)]
    assert weeks_ago(dates).tolist() == [4, 2, 1, 1, 0, 0]


def test_the_last_week_is_that_of_the_record_also_where_its_end_has_no_answer():
    e = estimator("jmap", dates_of(70), unanswered=0)
    status = ["ok"] * 66 + ["failed"] * 4
    delay = np.where(np.arange(70) < 66, 7.0, np.nan)
    run = results(("jmap",), dates_of(1))
    e = dataclasses.replace(e, status=status, delay=delay, prior_only=np.zeros(70, bool))
    recent = lately(dataclasses.replace(run, estimators=[e]))
    assert recent.last == e.dates[-1] and int(recent.week.sum()) == 7 and int(recent.with_value.sum()) == 3
    assert recent.median == 7 and recent.trend.days == 3 and not recent.trend.moved


def test_a_band_takes_thirty_days_and_is_as_wide_as_nine_in_ten():
    assert band(np.full(29, 6.0)) is None
    rng = np.random.default_rng(4)
    values = rng.normal(20, 1, 400)
    got = band(values)
    assert np.mean((values >= got.low) & (values <= got.high)) == pytest.approx(0.9, abs=0.01)
    edge = got.high + (got.high - got.low)
    assert got.far(np.array([edge - 1e-9, edge + 1e-9, np.nan])).tolist() == [False, True, False]


@pytest.mark.parametrize("name", list(cases()))
def test_every_record_can_be_drawn_within_the_drawing(name):
    run = cases()[name]
    recent = lately(run)
    drawn = strip(run, recent, {})
    if drawn is None:
        assert np.isfinite(recent.values[weeks_ago(recent.estimator.dates) <= WEEKS]).sum() < 2
        return
    assert all(0 <= mark.x <= WIDTH and 0 <= mark.y <= HEIGHT for mark in drawn.marks)
    assert all(mark.y < drawn.floor for mark in drawn.marks if mark.look != "none")
    assert 2 <= len(drawn.lags) <= 7 and 1 <= len(drawn.times) <= 7
    assert len(drawn.marks) <= WEEK * (WEEKS + 1)
    assert svg(drawn, "<b>", 0).count("<title>") == len(drawn.marks) and "<b>" not in svg(drawn, "<b>", 0)


def test_both_axes_of_the_drawing_say_the_same():
    run = results(("jmap",), dates_of(63))
    drawn = strip(run, lately(run), {})
    lag = np.polyfit([y for y, _ in drawn.lags], [float(text) for _, text in drawn.lags], 1)
    time = np.polyfit([y for y, _ in drawn.times], [float(text) for _, text in drawn.times], 1)
    middle = (np.polyval(lag, 100) + 0.5) * run.sample_time / 60  # of d to d + 1
    assert np.polyval(time, 100) == pytest.approx(middle, rel=0.01)
    mark = next(mark for mark in drawn.marks if mark.look == "sure")
    said = float(mark.words.split("d = ")[1].split()[0])
    assert np.polyval(lag, mark.y) == pytest.approx(said, abs=0.05)


def test_ticks_are_few_and_inside():
    rng = np.random.default_rng(5)
    for _ in range(200):
        low = rng.uniform(0, 100)
        high = low + 10 ** rng.uniform(-1, 3)
        got = [value for value, _ in ticks(low, high)]
        assert 2 <= len(got) <= 7 and low <= got[0] and got[-1] <= high
        assert np.allclose(np.diff(got), got[1] - got[0])


def test_a_record_without_a_delay_has_nothing_to_draw():
    run = without_answers(results(("jmap",), dates_of(7)))
    assert strip(run, lately(run), {}) is None
    assert lately(dataclasses.replace(run, estimators=[])) is None
