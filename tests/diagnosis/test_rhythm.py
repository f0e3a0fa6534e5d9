"""Test rhythms: planted lines, oscillations that lose their phase, and weather."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rivid.diagnosis.rhythm import rhythm
from tests.diagnosis import sizes

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
