"""The spectrum of innovations against slow sums, days of white noise, and planted rhythms."""

import numpy as np
import pytest
from scipy import stats

from rivid.diagnosis.spectrum import _power, spectrum
from rivid.errors import RividError

T = 133.0


def white(seed, days=20, n=240):
    """White innovations with gaps, and what is used of them."""
    rng = np.random.default_rng(seed)
    used = np.ones((days, n), bool)
    used[:, :15] = False
    used[3, n // 4 : n // 2] = used[-1, 5 * n // 6 :] = False
    return rng.standard_normal((days, n)), used


def test_the_average_periodogram_is_the_slow_sum():
    r, used = white(0, days=4, n=40)
    weight = np.array([0.1, 0.2, 0.3, 0.4])
    power = _power(r, used.astype(float), weight)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(40) / 39)
    for k in (1, 7, 33):
        total = 0.0
        for d in range(4):
            z = r[d, used[d]] - r[d, used[d]].mean()
            z /= np.sqrt(np.mean(z**2))
            w, t = window[used[d]], np.flatnonzero(used[d])
            total += weight[d] * abs(np.sum(z * w * np.exp(-2j * np.pi * k * t / 80))) ** 2 / np.sum(w**2)
        assert power[k] == pytest.approx(total, rel=1e-9)


def test_white_innovations_have_power_one_everywhere_gaps_or_not():
    mean = np.mean([spectrum(*white(seed), T, seed=seed).power for seed in range(60)], axis=0)
    error = 1.0 / np.sqrt(20 * 60)  # of a mean of exponential variables, one for each day
    assert np.abs(mean - 1.0).max() < 4.5 * error


def test_white_innovations_exceed_the_limit_as_often_as_it_says():
    seasons = 400
    p = np.array([spectrum(*white(seed), T, draws=99, seed=seed + 1000).p_value for seed in range(seasons)])
    for level in (0.01, 0.1):
        assert abs(np.mean(p <= level) - level) <= 3 * np.sqrt(level * (1 - level) / seasons)


def test_the_p_value_goes_with_the_limit():
    for level in (0.01, 0.1, 0.5):
        for seed in range(20):
            found = spectrum(*white(seed), T, level=level, draws=99, seed=seed)
            assert found.rhythm == (found.p_value <= level)


def test_an_oscillation_of_twenty_minutes_that_starts_anew_each_day_is_seen():
    rng = np.random.default_rng(1)
    for seed in range(10):
        r, used = white(seed, days=60, n=600)
        phase = rng.uniform(0, 2 * np.pi, (60, 1))
        r += 0.3 * np.cos(2 * np.pi * np.arange(600) * T / 1200.0 + phase)
        found = spectrum(r, used, T, draws=99)
        assert found.rhythm
        assert found.peak_period == pytest.approx(1200.0, rel=0.01)
        assert found.peak_ratio > 2 * found.limit


def test_a_daily_and_a_half_daily_line_are_told_with_their_hour():
    n = 650
    for seed in range(5):
        r, used = white(seed, days=60, n=n)
        hour = np.arange(n) * T / 3600.0
        r += 0.1 * np.cos(2 * np.pi * (hour - 15.0) / 24.0) + 0.08 * np.cos(2 * np.pi * (hour - 4.0) / 12.0)
        found = spectrum(r, used, T, draws=99)
        assert found.keeps_hours
        day, half = found.daily
        assert (day.period, half.period) == (86400.0, 43200.0)
        assert day.amplitude == pytest.approx(0.1, abs=0.03)
        assert half.amplitude == pytest.approx(0.08, abs=0.03)
        assert day.hour == pytest.approx(15.0, abs=1.0)
        assert half.hour == pytest.approx(4.0, abs=0.7)


def test_the_p_of_a_daily_line_is_uniform_on_white_innovations():
    p = [line.p_value for seed in range(150) for line in spectrum(*white(seed, 10, 640), T, draws=99).daily]
    assert stats.kstest(p, "uniform").pvalue > 1e-3


def test_a_daily_line_is_the_least_squares_fit_over_all_samples():
    r, used = white(2, days=8, n=640)
    used[:] = True
    r /= np.sqrt(((r - r.mean(1, keepdims=True)) ** 2).mean(1, keepdims=True))
    angle = 2 * np.pi * np.arange(640) * T / 86400.0
    X = np.zeros((8, 640, 10))
    X[..., 0], X[..., 1] = np.cos(angle), np.sin(angle)
    X[np.arange(8), :, 2 + np.arange(8)] = 1.0
    a, b = np.linalg.lstsq(X.reshape(-1, 10), r.ravel(), rcond=None)[0][:2]
    assert spectrum(r, used, T, draws=99).daily[0].amplitude == pytest.approx(np.hypot(a, b), rel=1e-9)


def test_scale_and_days_without_weight_change_nothing():
    r, used = white(3)
    weights = np.ones(20)
    weights[4] = 0.0
    once = spectrum(r, used, T, weights=weights, draws=99)
    r[4] = 1e6 * np.cos(np.arange(240))
    again = spectrum(7.0 * r, used, T, weights=weights, draws=99)
    assert again.peak_ratio == pytest.approx(once.peak_ratio)
    assert again.limit == once.limit


def test_what_cannot_be_used_is_refused():
    r, used = white(0)
    with pytest.raises(RividError, match="expected"):
        spectrum(r, used[:5], T)
    with pytest.raises(RividError, match="expected 100 or more"):
        spectrum(r, used, T, draws=50)
    with pytest.raises(RividError, match="no day has 30 used samples"):
        spectrum(r, np.zeros_like(used), T)
