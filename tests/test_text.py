"""Travel times in words: the interval that is printed holds the true time."""

import re

import numpy as np
import pytest

from rivid.text import samples_first, step, travel, travel_first, travel_within


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_travel_time_printed_for_a_delay_holds_the_time_that_the_wave_needs(seed):
    rng = np.random.default_rng(seed)
    for _ in range(400):
        T_s = float(rng.choice([60, 133, 300, 900, 3600]))
        time = float(rng.uniform(1.05, 40) * T_s)
        d = int(np.ceil(time / T_s)) - 1  # as of a simulated day
        low, high, unit = re.fullmatch(r"([\d.]+) to ([\d.]+) (min|h)", travel([d], T_s)).groups()
        size = 60 if unit == "min" else 3600
        digit = 0.5 if float(high) >= 100 else 0.05
        assert float(low) - digit <= time / size <= float(high) + digit
        assert (float(high) - float(low)) * size == pytest.approx(T_s, abs=2 * digit * size)


def test_neighbouring_delays_are_one_span_and_others_are_apart():
    assert travel([5, 6, 7], 300) == "25 to 40 min" == travel_within(5, 7, 300)
    assert travel([5, 9], 300) == "25 to 30 or 45 to 50 min"
    assert travel([6.5], 300) == travel([6, 7], 300), "a median between two delays stands for both"
    assert travel_within(6.5, 8.5, 300) == travel_within(6, 9, 300)


def test_samples_have_their_length_and_times_their_unit():
    assert [step(T_s) for T_s in (1, 90, 300, 5400, 7200)] == ["1 s", "90 s", "5 min", "90 min", "2 h"]
    assert travel([24, 25], 900) == "6.0 to 6.5 h"
    assert samples_first([1], 60) == "1 sample (1 to 2 min)"
    assert travel_first([24], 900) == "6.0 to 6.2 h (delay d = 24 samples of 15 min)"
