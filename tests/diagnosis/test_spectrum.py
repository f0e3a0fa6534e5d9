"""Test the spectrum of innovations against slow sums, days of white noise, and planted oscillations."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rivid.diagnosis.spectrum import _power, rhythm, spectrum
from tests.diagnosis import sizes

T = 133.0
ALIKE = np.ones(20)


def white(seed, days=20, n=240):
    """Return white innovations with gaps, and the mask of used samples."""
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


@sizes("seasons", 20, 200)
def test_white_innovations_exceed_the_limit_at_its_level(seasons):
    level = 0.1
    above = 0
    for seed in range(seasons):
        _, ratio, limit = spectrum(*white(seed), T, ALIKE, level=level, draws=99, seed=seed + 1000)
        above += ratio > limit
    assert abs(above / seasons - level) <= 3 * np.sqrt(level * (1 - level) / seasons)


def test_an_oscillation_of_twenty_minutes_with_a_new_phase_each_day_is_found():
    rng = np.random.default_rng(1)
    for seed in range(2):
        r, used = white(seed, days=60, n=600)
        phase = rng.uniform(0, 2 * np.pi, (60, 1))
        r += 0.3 * np.cos(2 * np.pi * np.arange(600) * T / 1200.0 + phase)
        period, ratio, limit = spectrum(r, used, T, np.ones(60), draws=99)
        assert period == pytest.approx(1200.0, rel=0.01)
        assert ratio > 2 * limit


def test_scale_and_days_without_weight_change_nothing():
    r, used = white(3)
    weights = ALIKE.copy()
    weights[4] = 0.0
    once = spectrum(r, used, T, weights, draws=99)
    r[4] = 1e6 * np.cos(np.arange(240))
    again = spectrum(7.0 * r, used, T, weights, draws=99)
    assert again == pytest.approx(once)


def test_days_with_few_samples_or_no_weight_have_no_spectrum():
    r, used = white(0)
    assert spectrum(r, used, T, 0.0 * ALIKE) is None
    used[:, :-29] = False
    assert spectrum(r, used, T, ALIKE) is None


# Rhythms of a whole record

RECORD = (np.arange(60.0 * 96) * 900.0).reshape(60, 96)


def colored(seed):
    """Return weather of 5 m3/s with a memory of 3 h, with every ninth day missing."""
    rng = np.random.default_rng(seed)
    phi = np.exp(-900.0 / 10_800.0)
    steps = 5.0 * np.sqrt(1.0 - phi**2) * rng.standard_normal(RECORD.size)
    used = np.ones(RECORD.shape, bool)
    used[4::9] = False
    return lfilter([1.0], [1.0, -phi], steps).reshape(RECORD.shape), used


@pytest.mark.parametrize("hours", [3.0, 6.21, 12.42, 24.0])
@sizes("seeds", 4, 40)
def test_a_rhythm_is_found_well_within_its_resolution(hours, seeds):
    off = []
    for seed in range(seeds):
        series, used = colored(seed)
        found = rhythm(series + 5.0 * np.cos(2.0 * np.pi * RECORD / (3600.0 * hours) + seed), used, RECORD)
        assert found is not None
        assert found.resolution < 0.03 * hours * 3600.0
        off.append(abs(found.period - 3600.0 * hours) / found.resolution)
    assert np.median(off) < 0.1 and max(off) < 0.5


def test_a_rhythm_is_found_in_samples_of_an_hour():
    """Averages shorter than a sample would be empty every other time, and nothing would have a spectrum."""
    series, used = colored(0)
    hourly = np.s_[:, ::4]
    found = rhythm(
        (series + 5.0 * np.cos(2.0 * np.pi * RECORD / 44_712.0))[hourly], used[hourly], RECORD[hourly]
    )
    assert found.period == pytest.approx(44_712.0, abs=0.5 * found.resolution)


def test_a_rhythm_of_short_pulses_is_that_of_its_fundamental():
    series, used = colored(3)
    pulses = 40.0 * (np.mod(RECORD, 86_400.0) < 7200.0)
    found = rhythm(series + pulses, used, RECORD)
    assert found.period == pytest.approx(86_400.0, abs=found.resolution)


@pytest.mark.parametrize("period", [927.3, 1033.1, 7000.0])
def test_a_rhythm_of_minutes_is_found_though_the_samples_of_days_are_out_of_step(period):
    """A sample time of 421 s is no part of a day, and the shortest of these periods has 2.2 samples."""
    clock = 86_400.0 * np.arange(30)[:, None] + 421.0 * np.arange(205)
    series = np.random.default_rng(0).standard_normal(clock.shape) + 0.5 * np.sin(
        2.0 * np.pi * clock / period
    )
    found = rhythm(series, np.ones(clock.shape, bool), clock)
    assert found.period == pytest.approx(period, abs=0.1 * found.resolution)


@sizes("seasons", 5, 100)
def test_a_damped_oscillation_is_no_rhythm(seasons):
    """One of 75 min that loses its phase within half a day, three times as large as the noise."""
    false = 0
    for seed in range(seasons):
        rng = np.random.default_rng(seed)
        turn = np.exp((-1.0 / 14_400.0 + 2.0j * np.pi / 4500.0) * 900.0)
        pushed = rng.standard_normal(RECORD.size) + 1.0j * rng.standard_normal(RECORD.size)
        swing = lfilter([np.sqrt(1.0 - abs(turn) ** 2)], [1.0, -turn], pushed).real
        series = rng.standard_normal(RECORD.size) + 3.0 * swing
        false += rhythm(series.reshape(RECORD.shape), np.ones(RECORD.shape, bool), RECORD) is not None
    assert false <= 0.01 * seasons + 3.0 * np.sqrt(0.01 * seasons)


@sizes("seasons", 10, 300)
def test_weather_has_a_rhythm_no_more_often_than_by_chance(seasons):
    false = sum(rhythm(*colored(seed), RECORD) is not None for seed in range(seasons))
    assert false <= 0.01 * seasons + 3.0 * np.sqrt(0.01 * seasons)
    assert rhythm(np.zeros((2, 96)), np.zeros((2, 96), bool), RECORD[:2]) is None
