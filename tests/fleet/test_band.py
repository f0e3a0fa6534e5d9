"""The band of a reach, and when its last week has left it."""

import numpy as np
import pytest
from scipy.stats import binom

from rivid.fleet.band import FEWEST, RARE, WEEK, at_least, band


@pytest.mark.parametrize("seed", range(4))
def test_the_tail_of_the_binomial_is_scipys(seed):
    rng = np.random.default_rng(seed)
    for _ in range(20):
        n, p = int(rng.integers(1, 8)), float(rng.random())
        k = int(rng.integers(0, n + 1))
        assert at_least(k, n, p) == pytest.approx(binom.sf(k - 1, n, p), rel=1e-9)


def test_the_band_is_of_the_year_before_the_week_and_gaps_do_not_count():
    days = np.arange(1000, 1400)
    values = np.full(400, 6.0)
    values[:30] = 99.0  # more than a year before the week
    values[-WEEK:] = 9.0
    values[100:150] = np.nan
    found = band(days, values)
    assert (found.low, found.high, found.median) == (6, 6, 6)
    assert (found.days, found.above, found.below, found.left, found.week_median) == (7, 7, 0, True, 9)
    late = band(np.append(days, 1500), np.append(values, 6.0))
    assert (late.days, late.left) == (1, False)


def test_few_days_make_no_band():
    days = np.arange(FEWEST + WEEK)
    values = np.full(len(days), 5.0)
    assert band(days, values) is not None
    values[0] = np.nan
    assert band(days, values) is None
    assert band(np.zeros(0, int), np.zeros(0)) is None


def test_a_week_without_answer_has_not_left():
    values = np.full(100, 5.0)
    values[-WEEK:] = np.nan
    found = band(np.arange(100), values)
    assert found.days == 0 and not found.left and np.isnan(found.week_median)


@pytest.mark.parametrize("seed", range(3))
def test_of_reaches_that_do_not_change_about_one_in_a_thousand_or_fewer_is_told(seed):
    rng = np.random.default_rng(seed)
    n, told = 4000, 0
    for _ in range(n):
        values = rng.choice([5.0, 6.0, 7.0, 8.0, 9.0], size=120, p=[0.03, 0.4, 0.4, 0.14, 0.03])
        told += band(np.arange(120), values).left
    # the band is estimated from 113 days, so that the share is not exact: allow its own error twice over
    assert told <= n * 2 * RARE + 3 * np.sqrt(n * 2 * RARE)


@pytest.mark.parametrize("seed", range(3))
def test_a_delay_two_samples_longer_is_told_within_the_week(seed):
    rng = np.random.default_rng(seed)
    values = rng.choice([5.0, 6.0, 7.0], size=200, p=[0.2, 0.6, 0.2])
    values[-5:] += 3
    assert band(np.arange(200), values).left
