"""Windows by ascent, against every window there is."""

import numpy as np
import pytest

from rivid.diagnosis.candidates import best_dates, best_span, chance_of, combined
from tests.diagnosis import sizes


def gains(score, information, sign=0):
    """Gain of every window, the slow way."""
    n, days = score.shape
    found = {}
    for first in range(days):
        for last in range(first, days):
            for start in range(n):
                for length in range(1, n + 1):
                    if length == n and start:
                        continue
                    hours = (start + np.arange(length)) % n
                    s = score[hours, first : last + 1].sum()
                    q = information[np.ix_(hours, hours, range(first, last + 1))].sum()
                    s = max(sign * s, 0.0) if sign else s
                    key = (first, last, None if length == n else (start, (start + length) % n))
                    found[key] = 0.5 * s * s / q
    return found


def days_with(rng, n, days, first, last, hours, size):
    """Whitened columns of hours that are their own, and a residual with an effect in a window."""
    columns = rng.standard_normal((n, days, 40))
    residual = rng.standard_normal((days, 40))
    for h in hours:
        residual[first : last + 1] += size * columns[h, first : last + 1]
    score = np.einsum("hdn,dn->hd", columns, residual)
    return score, np.einsum("hdn,gdn->hgd", columns, columns)


@pytest.mark.parametrize("seed", range(3))
def test_the_ascent_finds_the_best_of_all_windows_where_there_is_an_effect(seed):
    rng = np.random.default_rng(seed)
    score, information = days_with(rng, 6, 9, 2, 6, [5, 0, 1], 0.6)
    every = gains(score, information)
    found = best_span(score, information)
    assert found.gain == pytest.approx(max(every.values()))
    assert every[found.first, found.last, found.hours] == pytest.approx(found.gain)


def test_hours_pass_midnight_and_dates_are_right():
    score, information = days_with(np.random.default_rng(1), 24, 30, 8, 21, [22, 23, 0, 1, 2], 0.7)
    found = best_span(score, information, 1)
    assert (found.first, found.last, found.hours) == (8, 21, (22, 3))
    wrong = best_span(score, information, -1)
    assert wrong.gain < 0.1 * found.gain
    score, information = days_with(np.random.default_rng(3), 1, 20, 5, 12, [0], 0.8)
    found = best_span(score, information)
    assert found.hours is None and (found.first, found.last) == (5, 12)


@pytest.mark.parametrize("seed", range(2))
def test_dates_of_two_columns_are_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    score, information = days_with(rng, 2, 12, 3, 9, [0, 1], 0.4)
    best = 0.0
    for first in range(12):
        for last in range(first, 12):
            s = score[:, first : last + 1].sum(axis=1)
            q = information[:, :, first : last + 1].sum(axis=2)
            best = max(best, 0.5 * s @ np.linalg.solve(q, s))
    found = best_dates(score, information)
    assert found.gain == pytest.approx(best, rel=1e-6)
    one, square = combined(score, information, found)
    inside = slice(found.first, found.last + 1)
    assert 0.5 * one[0, inside].sum() ** 2 / square[0, 0, inside].sum() == pytest.approx(best, rel=1e-6)


@sizes("draws", 40, 200)
def test_the_chance_of_noise_is_seldom_small_and_that_of_an_effect_is(draws):
    small = 0
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        score, information = days_with(rng, 4, 24, 0, 0, [0], 0.0)
        found = best_span(score, information)
        small += chance_of(score, information, found, np.arange(24) // 3, 1, found.gain) < 0.05
    assert small <= 0.05 * draws + 3 * np.sqrt(0.05 * draws)  # at most 5 %, and the error of the count
    score, information = days_with(np.random.default_rng(0), 4, 24, 3, 20, [1, 2], 0.8)
    found = best_span(score, information)
    assert chance_of(score, information, found, np.arange(24) // 3, 1, found.gain) < 1e-6
