"""What histograms and maps count."""

import numpy as np
import pytest
from scipy import stats

from rivid.plots import delay_map, discharge
from rivid.plots.histogram import shares
from rivid.results.selection import candidates, estimates_delay, found, kinds, rayleigh
from tests.plots.synthetic import dates_of, estimator, results, without_answers


def test_each_day_with_a_delay_is_in_one_class_the_gravest():
    e = estimator("jmap", dates_of(300))
    classes = kinds(e)
    np.testing.assert_array_equal(np.sum(list(classes.values()), axis=0), found(e).astype(int))
    np.testing.assert_array_equal(classes["at a bound"], e.at_bound & found(e))
    np.testing.assert_array_equal(classes["data do not decide"], e.prior_only & ~e.at_bound & found(e))


def test_shares_of_all_bars_make_a_hundred():
    for name in ("jmap", "jmap-degenerate"):
        e = estimator(name, dates_of(200))
        assert np.sum(list(shares(e, e.candidates).values())) == pytest.approx(100)
    by_class = shares(e, e.candidates)
    assert by_class["degenerate"].sum() == pytest.approx(100)


def test_the_prior_line_is_the_rayleigh_density_on_the_candidates():
    d = np.arange(1.0, 16.0)
    density = stats.rayleigh(scale=6.5).pdf(d)
    np.testing.assert_allclose(rayleigh(d, 6.5), density / density.sum(), rtol=1e-12)


def test_a_prior_far_from_the_candidates_still_has_a_line():
    assert rayleigh(np.array([4000.0, 4001.0]), 1.0).sum() == pytest.approx(1)


def test_without_answers_there_are_no_candidates_and_yet_it_is_an_estimator_of_delays():
    jmap, ml = without_answers(results(("jmap", "ml"), dates_of(5))).estimators
    assert estimates_delay(jmap) and not estimates_delay(ml)
    assert candidates(jmap).size == 0


def test_a_line_breaks_where_days_are_missing():
    x, y = delay_map.with_gaps(np.array([1.0, 2.0, 5.0]), np.array([10.0, 11.0, 12.0]))
    np.testing.assert_array_equal(x, [1, 2, np.nan, 5])
    np.testing.assert_array_equal(y, [10, 11, np.nan, 12])


def test_marks_of_one_delay_spread_within_their_sample_and_apart():
    shifts = discharge.spread(400)
    assert np.abs(shifts).max() <= 0.3
    assert np.diff(np.sort(shifts)).min() > 0.6 / 400 / 4
