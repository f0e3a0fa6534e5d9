"""Test shares, their intervals, and targets."""

import numpy as np
import pytest
from scipy.stats import binomtest

from benchmarks.exam.shares import Target, wilson, written


@pytest.mark.parametrize(("hits", "n"), [(0, 5), (3, 7), (60, 60), (391, 400)])
def test_the_interval_is_that_of_scipy(hits, n):
    ours = wilson(hits, n)
    theirs = binomtest(hits, n).proportion_ci(0.95, "wilson")
    assert ours == pytest.approx((theirs.low, theirs.high), abs=1e-6)


def test_the_interval_covers_about_as_often_as_it_says():
    rng = np.random.default_rng(1)
    for p in (0.1, 0.5, 0.9):
        low, high = np.array([wilson(int(h), 60) for h in rng.binomial(60, p, 4000)]).T
        assert abs(((low <= p) & (p <= high)).mean() - 0.95) < 0.025


@pytest.mark.parametrize(
    ("target", "hits", "n", "verdict"),
    [
        (Target(most=0.01), 0, 400, "reached"),
        (Target(most=0.01), 0, 60, "too few to decide (met so far)"),
        (Target(most=0.01), 2, 60, "too few to decide (above by 0.02 so far)"),
        (Target(most=0.02), 20, 60, "above by 0.31"),
        (Target(least=0.9), 40, 100, "short by 0.50"),
        (Target(least=0.9), 99, 100, "reached"),
        (Target(least=0.92, most=0.97), 950, 1000, "reached"),
        (Target(least=0.92, most=0.97), 998, 1000, "above by 0.03"),
        (Target(least=0.92), 0, 0, "too few to decide"),
    ],
)
def test_a_verdict_needs_the_interval_on_one_side(target, hits, n, verdict):
    assert target.verdict(hits, n) == verdict


def test_a_share_of_nothing_is_a_dash():
    assert written(0, 0) == "-"
    assert written(1, 2).startswith("1/2 = 0.50 (0.09")
