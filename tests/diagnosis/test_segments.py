"""Test segments of daily scores against enumeration, planted dates, and seasons without effects."""

from itertools import product

import numpy as np
import pytest

from rivid.diagnosis.noise.model import block_inflation
from rivid.diagnosis.segments import partition, segment
from tests.diagnosis import sizes

DAYS, BLOCK = 60, 3


def windows(found):
    """Return the first and last day of each segment with the effect."""
    ends = zip(found.bounds[:-1], found.bounds[1:], found.on, strict=True)
    return [(int(a), int(b) - 1) for a, b, on in ends if on]


def season(seed, correlation, days=DAYS):
    """Return scores of unit variance, correlated within blocks."""
    rng = np.random.default_rng(seed)
    block = np.arange(days) // BLOCK
    shared = rng.standard_normal(days)[block]
    own = rng.standard_normal(days)
    return np.sqrt(correlation) * shared + np.sqrt(1 - correlation) * own, block


def every_cut(n, shortest, rest):
    """Yield all bounds, with on or off for each segment; no two neighbours are both off."""
    for cuts in product([False, True], repeat=n - 1):
        bounds = [0, *(i + 1 for i, cut in enumerate(cuts) if cut), n]
        for on in product([True] if rest == "free" else [False, True], repeat=len(bounds) - 1):
            lengths = np.diff(bounds)
            if all(length >= shortest for length, o in zip(lengths, on, strict=True) if o) and not any(
                not a and not b for a, b in zip(on, on[1:], strict=False)
            ):
                yield bounds, on


def worth(g, q, bounds, on, sign, penalty, edge=0.0):
    total = 0.0
    for a, b, there in zip(bounds[:-1], bounds[1:], on, strict=True):
        s, information = g[a:b].sum(), q[a:b].sum()
        if there:
            total -= penalty + edge * (int(a > 0) + int(b < len(g)))
            if information > 0 and (sign == 0 or s * sign > 0):
                total += s * s / (2 * information)
    return total


@sizes("most", 7, 9)
@pytest.mark.parametrize("rest", ["zero", "free"])
@pytest.mark.parametrize("sign", [0, -1])
@pytest.mark.parametrize("shortest", [1, 2])
def test_the_partition_is_the_best_of_all_there_are(rest, sign, shortest, most):
    rng = np.random.default_rng(3)
    for n, penalty in ((most - 2, 0.5), (most - 1, 1.5), (most, 3.0)):
        for _ in range(3):
            q = rng.uniform(0.2, 2.0, n) * (rng.random(n) > 0.2)
            g = np.sqrt(q) * rng.standard_normal(n) + q * rng.choice([0.0, -2.0, 2.0], n)
            edge = 0.6 if rest == "zero" else 0.0
            bounds, on, gain = partition(g, q, penalty, rest=rest, sign=sign, shortest=shortest, edge=edge)
            best = max(worth(g, q, b, o, sign, penalty, edge) for b, o in every_cut(n, shortest, rest))
            none = 0.0 if rest == "zero" else worth(g, q, [0, n], [True], sign, penalty)
            assert gain == pytest.approx(best - none, abs=1e-9)
            assert worth(g, q, bounds, on, sign, penalty, edge) == pytest.approx(best, abs=1e-9)
            assert (np.diff(bounds)[on] >= shortest).all()


@sizes("seasons", 25, 100)
@pytest.mark.parametrize(("rest", "correlation"), [("zero", 0.5), ("free", 0.5), ("free", 0.0)])
def test_a_season_with_nothing_is_cut_as_often_as_its_level(rest, correlation, seasons):
    for level in (0.01, 0.1):
        cut = 0
        for seed in range(seasons):
            x, block = season(seed, correlation)
            found = segment(x, np.ones(DAYS), block, rest=rest, level=level, draws=99, seed=seed + 10_000)
            cut += found.found
        # With an estimated correlation the level is approximate: up to half as much again.
        error = np.sqrt(level * (1 - level) / seasons)
        assert 0.5 * level - 3 * error <= cut / seasons <= 1.5 * level + 3 * error


@sizes("seasons", 8, 40)
def test_planted_windows_are_found_where_they_are(seasons):
    overlap = []
    for seed in range(seasons):
        x, block = season(seed, 0.3)
        first = int(np.random.default_rng(seed).integers(3, 35))
        there = np.zeros(DAYS, bool)
        there[first : first + 20] = True
        found = segment(x + 3.0 * there, np.ones(DAYS), block, seed=seed)
        overlap.append((found.mask & there).sum() / (found.mask | there).sum() if found.found else 0.0)
    assert np.mean(overlap) >= 0.9
    assert np.mean(np.array(overlap) >= 0.8) >= 0.9


@sizes("seasons", 30, 60)
def test_a_window_has_its_size_within_its_error(seasons):
    deviation = []
    for seed in range(seasons):
        x, block = season(seed, 0.4)
        q = np.random.default_rng(seed).uniform(0.5, 2.0, DAYS)
        there = (np.arange(DAYS) >= 12) & (np.arange(DAYS) < 42)
        found = segment(np.sqrt(q) * x + 4.0 * q * there, q, block, seed=seed)
        longest = int(np.argmax(np.diff(found.bounds) * found.on))
        deviation.append((found.size[longest] - 4.0) / found.size_se[longest])
    assert np.abs(np.mean(deviation)) < 0.5
    assert 0.7 < np.std(deviation) < 1.5  # a season gives the inflation to about 40 %


def test_a_window_has_one_sign_and_any_scale():
    x, block = season(2, 0.0)
    there = (np.arange(DAYS) >= 20) & (np.arange(DAYS) < 45)
    one, ten = (segment(s * (x - 4.0 * there), np.ones(DAYS), block) for s in (1.0, 10.0))
    assert windows(one) == windows(ten) == [(20, 44)]
    assert ten.gain == pytest.approx(100.0 * one.gain)
    assert not segment(x - 4.0 * there, np.ones(DAYS), block, sign=1).found


def test_an_onset_and_a_bump_change_a_size_that_is_never_zero():
    x, block = season(1, 0.2)
    onset = segment(x + 8.0 + 4.0 * (np.arange(DAYS) >= 31), np.ones(DAYS), block, rest="free")
    assert onset.bounds.tolist() == pytest.approx([0, 31, DAYS], abs=1)
    assert onset.on.all()
    there = (np.arange(DAYS) >= 20) & (np.arange(DAYS) < 40)
    bump = segment(x - 8.0 + 4.0 * there, np.ones(DAYS), block, rest="free")
    assert bump.bounds.tolist() == pytest.approx([0, 20, 40, DAYS], abs=1)


def test_the_inflation_is_that_of_the_blocks_with_and_without_an_effect():
    draws, correlation = 2000, 0.5
    rng = np.random.default_rng(0)
    block = np.arange(DAYS) // BLOCK
    shared = rng.standard_normal((draws, DAYS))[:, block]
    x = np.sqrt(correlation) * shared + np.sqrt(1 - correlation) * rng.standard_normal((draws, DAYS))
    there = (np.arange(DAYS) >= 15) & (np.arange(DAYS) < 39)
    for effect in (0.0, 5.0):
        inflation, rho = block_inflation(x + effect * there, np.ones(DAYS), block)
        assert np.median(inflation) == pytest.approx(1 + (BLOCK - 1) * correlation, rel=0.15 + 0.05 * effect)
        assert np.median(rho) == pytest.approx(correlation, abs=0.1 + 0.02 * effect)


def test_days_without_data_belong_to_no_side():
    x, block = season(4, 0.0)
    q = np.ones(DAYS)
    q[24:33] = 0.0
    there = np.arange(DAYS) >= 30
    found = segment((x + 4.0 * there) * q, q, block)
    assert len(windows(found)) == 1 and windows(found)[0][1] == DAYS - 1
    assert 23 <= found.bounds[1] <= 33  # a large score on day 23 may count as the effect
