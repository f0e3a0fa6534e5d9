"""Test the numbers in the panels of estimates: columns, marks, shares, lines and limits."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from rivid.plots import estimates, style
from rivid.results.read import (
    candidates,
    day_numbers,
    estimates_delay,
    found,
    kinds,
    leading_response,
    passage,
    rayleigh,
    thirds,
)
from tests.plots.synthetic import (
    ORDER,
    dates_of,
    estimator,
    probable,
    probable_river,
    response,
    results,
    river,
    without_answers,
)


@pytest.fixture
def ax():
    with style.styled():
        yield style.sheet("title", "note")[1][0]


def legend(ax):
    return list(style.entries(ax))


def segments(ax):
    """Return the ends (x, y) of all lines drawn as collections."""
    paths = [path.vertices for one in ax.collections for path in one.get_paths() if len(path.vertices) == 2]
    return {tuple(np.round(v, 9).ravel()) for v in paths}


# The time-day representation


def test_a_day_without_a_response_is_an_empty_column_in_its_place(ax):
    e = estimator("jmap", dates_of(40, missing=10, seed=3), unanswered=0.1)
    day = day_numbers(e.dates)
    estimates.tdr(ax, day, e.fir)
    (image,) = ax.get_images()
    pixels = image.get_array()
    extent = [day[0] - 0.5, day[-1] + 0.5, -0.5, ORDER - 0.5]
    assert pixels.shape == (ORDER, 50) and image.get_extent() == extent
    filled = {int(day[0]) + k for k in np.flatnonzero(~np.ma.getmaskarray(pixels).all(axis=0))}
    assert filled == {int(d) for d, ok in zip(day, e.answered, strict=True) if ok}
    for i in np.flatnonzero(e.answered):
        np.testing.assert_array_equal(pixels[:, int(day[i] - day[0])], e.fir[i])
    assert legend(ax) == ["no response"]


def test_one_wild_day_does_not_change_the_greys_of_the_others():
    fir = estimator("jmap", dates_of(300), unanswered=0).fir
    calm = estimates.grey_limits(fir)
    fir[17] *= 1e6
    np.testing.assert_allclose(estimates.grey_limits(fir), calm, rtol=0.1)


@pytest.mark.parametrize(
    "fir", [np.empty((0, 30)), np.full((2, 3), np.nan), np.zeros((4, 5)), np.full((4, 5), -3.0)]
)
def test_grey_limits_exist_for_nothing_and_for_a_constant(fir):
    low, high = estimates.grey_limits(fir)
    assert low < high


def test_marks_are_at_lag_d_and_upright_lines_join_the_ends_of_the_set(ax):
    e = probable().estimators[0]
    x = day_numbers(e.dates)
    estimates.tdr(ax, x, e.fir, lag=e.delay, low=e.delay_low, high=e.delay_high, sample_time=133.0)
    drawn = segments(ax)
    days = np.isfinite(e.delay) & np.isfinite(e.fir).any(axis=1)
    assert {
        (a, d, b, d) for a, b, d in zip(x[days] - 0.5, x[days] + 0.5, e.delay[days], strict=True)
    } <= drawn
    wide = days & (e.delay_high > e.delay_low)
    upright = {(a, low, a, high) for a, low, high in zip(x, e.delay_low, e.delay_high, strict=True)}
    assert {s for s in drawn if s[0] == s[2]} == {s for s, w in zip(sorted(upright), wide, strict=True) if w}
    assert legend(ax) == ["delay d", f"90 % set, where wider ({wide.sum()})", "no response"]


# One day


def test_a_response_has_a_band_a_jump_and_t50(ax):
    h = response(7, 0.0, np.random.default_rng(0))
    estimates.response(ax, h, delay=7.0, sd=np.full(ORDER, 1e-5), t50=9.5)
    band = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert band.max() == pytest.approx(h.max() + 2e-5) and band.min() == pytest.approx(h.min() - 2e-5)
    _, curve, jump, half = ax.lines
    assert (curve.get_ydata() == h).all() and (jump.get_ydata() == h[7:9]).all()
    assert half.get_xdata()[0] == 9.5 and ax.patches[0].get_x() == 7 and ax.patches[0].get_width() == 1


# Histograms and maps


def test_each_day_with_a_delay_is_in_one_class_the_gravest():
    e = estimator("jmap", dates_of(300))
    classes = kinds(e)
    np.testing.assert_array_equal(np.sum(list(classes.values()), axis=0), found(e).astype(int))
    np.testing.assert_array_equal(classes["at a bound"], e.at_bound & found(e))
    np.testing.assert_array_equal(classes["data do not decide"], e.prior_only & ~e.at_bound & found(e))


def test_bars_are_shares_of_days_and_the_line_is_the_prior(ax):
    run = results(("jmap",), dates_of(200))
    e = run.estimators[0]
    estimates.histogram(ax, run, e)
    *classes, edge = ax.containers
    height = np.sum([[bar.get_height() for bar in bars] for bars in classes], axis=0)
    expected = [100 * np.mean(e.delay[found(e)] == d) for d in e.candidates]
    assert height == pytest.approx(expected) and height.sum() == pytest.approx(100)
    assert [bar.get_height() for bar in edge] == pytest.approx([expected[0], expected[-1]])
    density = stats.rayleigh(scale=6.5).pdf(e.candidates)
    assert ax.lines[0].get_ydata() == pytest.approx(100 * density / density.sum())
    decided = int((found(e) & ~e.prior_only).sum())
    assert legend(ax)[0] == f"data decide ({decided})"
    assert estimates.shares(estimator("jmap-degenerate", dates_of(99)), e.candidates)["degenerate"].sum() == (
        pytest.approx(100)
    )


def test_the_line_of_an_estimator_with_probabilities_is_their_mean(ax):
    run = probable()
    e = run.estimators[0]
    estimates.histogram(ax, run, e)
    mean = np.nanmean(e.criterion, axis=0)
    assert ax.lines[0].get_ydata() == pytest.approx(100 * mean) and mean.sum() == pytest.approx(1)
    assert legend(ax) == ["delay (26)", "mean probability (29 days)"]


def test_a_prior_far_from_the_candidates_still_has_a_line():
    assert rayleigh(np.array([4000.0, 4001.0]), 1.0).sum() == pytest.approx(1)


def test_cells_of_the_delay_map_are_the_probabilities_in_their_places(ax):
    run = probable()
    e = dataclasses.replace(run.estimators[0], dates=[d for d in dates_of(32) if d.day not in (6, 7)][:30])
    estimates.delay_map(ax, run, e)
    (image,) = ax.get_images()
    alpha, extent = np.asarray(image.get_array())[..., 3], image.get_extent()
    first, last = e.dates[0].toordinal(), e.dates[-1].toordinal()
    assert alpha.shape == (15, last - first + 1) and extent == [first - 0.5, last + 0.5, 0.5, 15.5]
    shown = day_numbers(e.dates).astype(int) - first
    np.testing.assert_allclose(alpha[:, shown], estimates.DARKEST * np.nan_to_num(e.criterion).T)
    assert (np.delete(alpha, shown, axis=1) == 0).all() and alpha.shape[1] - len(shown) == 2
    assert ax.get_ylim()[0] < 0.5 and ax.get_ylim()[1] > 15.5, "the cells do not crop the axis"


def test_marks_of_the_delay_map_are_the_days_of_each_class_and_the_bound_is_a_delay(ax):
    run = results(("jmap",), dates_of(60))
    e = run.estimators[0]
    estimates.delay_map(ax, run, e)
    for kind, label in zip(kinds(e), legend(ax), strict=False):
        days = kinds(e)[kind]
        if days.any():
            assert any(np.array_equal(line.get_ydata(), e.delay[days]) for line in ax.lines), kind
            assert f"{kind} ({days.sum()})" in legend(ax), label
    line = next(line for line in ax.lines if line.get_label() == "gravity wave, as a delay")
    y = line.get_ydata()
    expected = (e.bound_gravity_s / run.sample_time - 1)[np.isfinite(e.bound_gravity_s)]
    assert y[np.isfinite(y)] == pytest.approx(expected)


def test_a_line_breaks_where_days_are_missing():
    x, y = estimates.with_gaps(np.array([1.0, 2.0, 5.0]), np.array([10.0, 11.0, 12.0]))
    np.testing.assert_array_equal(x, [1, 2, np.nan, 5])
    np.testing.assert_array_equal(y, [10, 11, np.nan, 12])


def test_marks_of_one_delay_spread_within_their_sample_and_apart():
    shifts = estimates.spread(400)
    assert np.abs(shifts).max() <= 0.3
    assert np.diff(np.sort(shifts)).min() > 0.6 / 400 / 4


@pytest.mark.parametrize("plot", ["histogram", "delay_map", "delay_discharge", "t50", "t50_discharge"])
@pytest.mark.parametrize("run", [results(("jmap",), dates_of(5)), river(5, ("jmap",))])
def test_a_panel_without_a_day_is_empty_and_explains_itself(plot, run, ax):
    bare = without_answers(run)
    getattr(estimates, plot)(ax, bare, bare.estimators[0])
    assert "None of the 5 days" in ax.texts[0].get_text() and legend(ax) == []


def test_without_answers_there_are_no_candidates_and_yet_it_is_an_estimator_of_delays():
    jmap, ml = without_answers(results(("jmap", "ml"), dates_of(5))).estimators
    assert estimates_delay(jmap) and not estimates_delay(ml)
    assert candidates(jmap).size == 0


# t50 of a river


@pytest.mark.parametrize(
    ("names", "first"),
    [(("ml", "jmap", "map"), "map"), (("jmap-uniform", "ml"), "ml"), (("jmap-uniform",), "jmap-uniform"),
     (("jmap", "map", "posterior"), "posterior")],
)  # fmt: skip
def test_the_leading_response_of_a_river_is_that_of_posterior_before_map_before_jmap_before_ml(names, first):
    assert leading_response(river(12, names)).estimator == first


def test_an_estimator_without_a_t50_leaves_the_lead_to_the_next_and_a_pool_has_none():
    run = river(12, ("map", "jmap"))
    silent = without_answers(run).estimators[0]
    assert (
        leading_response(dataclasses.replace(run, estimators=[silent, run.estimators[1]])).estimator == "jmap"
    )
    assert leading_response(without_answers(run)).estimator == "map"
    assert leading_response(results(("map", "jmap"), dates_of(3))) is None


def test_thirds_hold_equal_numbers_of_days_and_count_pairs_as_a_plain_loop_does(ax):
    rng = np.random.default_rng(3)
    n = 300
    run = river(n)
    Q = rng.uniform(200, 400, n)
    lag = np.round(30 - 0.01 * Q + rng.standard_normal(n), 1)
    e = dataclasses.replace(run.estimators[0], status=["ok"] * n, mean_inflow=Q, t50=lag)
    t = thirds(e)
    low, middle, high = (lag[part] for part in np.split(np.argsort(Q), 3))
    assert t.medians == tuple(float(np.median(part)) for part in (low, middle, high))
    pairs = [(a > b) + (a == b) / 2 for a in low for b in high]
    assert t.longer == pytest.approx(np.mean(pairs), abs=1e-12)
    assert t.edges[0] == Q.min() and t.edges[3] == Q.max()
    estimates.t50_discharge(ax, run, e)
    bars = {s[:2] + s[2:] for s in segments(ax) if s[1] == s[3]}
    assert {
        tuple(np.round((a, m, b, m), 9)) for a, b, m in zip(t.edges, t.edges[1:], t.medians, strict=False)
    } == bars


def test_the_delay_of_a_rivers_posterior_is_drawn_around_it_and_beside_the_waves_themselves(ax):
    """Regression: it was drawn from d to d + 1, and the waves one sample early."""
    run = probable_river(30)
    jmap, posterior = run.estimators
    at = {}
    for e in (jmap, posterior):
        ax.clear()
        estimates.delay_map(ax, run, e)
        (line,) = (one for one in ax.lines if str(one.get_label()).startswith("kinematic"))
        at[e.estimator] = np.nanmedian(np.asarray(line.get_ydata(), float))
    tau = np.nanmedian(jmap.bound_kinematic_s) / 900.0
    assert (at["jmap"], at["posterior"]) == (pytest.approx(tau - 1.0), pytest.approx(tau))
    for rounded, begin in ((False, 26.0), (True, 25.5)):
        ax.clear()
        estimates.response(ax, posterior.fir[0], delay=26.0, rounded=rounded)
        (band,) = ax.patches
        assert (band.get_x(), band.get_width()) == (begin, 1.0)


def test_days_between_the_bounds_are_counted_in_seconds():
    run = river(4)
    e = dataclasses.replace(
        run.estimators[0],
        status=["ok", "ok", "ok", "failed"],
        t50=np.array([7.0, 8.0, 21.0, 9.0]),
        bound_gravity_s=np.full(4, 7200.0),  # eight samples
        bound_kinematic_s=np.full(4, 18_000.0),  # twenty
    )
    p = passage(run, e)
    assert (p.days, p.with_t50, p.bounded, p.between) == (4, 3, 3, 1)
    assert (p.low, p.median, p.high) == (7, 8, 21)


def test_one_wild_day_does_not_squeeze_the_others_and_far_bounds_stay_outside():
    lags = np.r_[np.linspace(24, 30, 50), 1.9]
    low, high = estimates.t50_window(lags, [np.array([22.0, 33.0]), np.array([8.0, 9.0])])
    assert 20 < low < 22 and 33 < high < 35
    low, high = estimates.t50_window(lags, [np.array([60.0, 90.0])])
    assert 22 < low < 24 and 30 < high < 32
    low, high = estimates.t50_window(np.full(5, 26.0), [])
    assert low < 26 < high
