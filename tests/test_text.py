"""Test numbers in text, and that the printed interval of a travel time contains the true time."""

import datetime as dt
import re

import numpy as np
import pytest

from rivid import text
from rivid.errors import nearest
from rivid.text import samples_first, step, travel, travel_first, travel_within


def test_a_near_name_is_suggested():
    assert nearest("rnu", ["run", "check"]) == "; did you mean run?"
    assert nearest("xyz", ["run", "check"]) == ""


@pytest.mark.parametrize(
    ("word", "given", "expected"),
    [
        ("count", (1, "day"), "1 day"),
        ("count", (1332, "day"), "1,332 days"),
        ("shown_in", ("m/day",), (1000.0, "mm/day")),
        ("shown_in", ("m or m3/s",), (1000.0, "mm")),
        ("shown_in", ("m or m3/s", True), (1.0, "m3/s")),
        ("listed", (["a", "b", "c"],), "a, b and c"),
        ("listed", (["6", "7"], "or"), "6 or 7"),
        ("number", (6.0,), "6"),
        ("number", (13.3,), "13.3"),
        ("number", (0.0222,), "0.022"),
        ("duration", ([798, 931],), "13.3 to 15.5 min"),
        ("duration", ([3714, 21900],), "61.9 to 365 min"),
        ("duration", ([23400],), "6.5 h"),
        ("duration", ([0.7, 1.5],), "0.7 to 1.5 s"),
        ("samples", ([6, 7],), "6 or 7 samples"),
        ("samples", ([1],), "1 sample"),
        ("delays", ([6, 7], 133), "6 or 7 samples (13.3 to 15.5 min)"),
        ("delays", ([1], 133), "1 sample (2.2 min)"),
        ("delays", ([6, 9], 133), "6 or 9 samples (13.3 or 19.9 min)"),
        ("minutes_first", (7, 133), "15.5 min (7 samples)"),
        ("minutes_first", (14.17, 900), "3.5 h (14.2 samples)"),
        ("minutes_first", (1, 60), "1.0 min (1 sample)"),
        ("probability", (0.8765,), "0.88"),
        ("probability", (0.999,), "above 0.99"),
        ("probability", (0.002,), "below 0.01"),
        ("share", (327, 332), "98 %"),
        ("share", (331, 332), "99.7 %"),
        ("share", (1, 1000), "0.1 %"),
        ("share", (5, 5), "100 %"),
        ("day_range", (dt.date(2008, 1, 1), dt.date(2008, 12, 31)), "2008-01-01 to 2008-12-31"),
        ("statuses", (["ok", "failed", "failed", "pending"],), "2 failed and 1 pending"),
        ("step", (300,), "5 min"),
        ("step", (133,), "133 s"),
        ("step", (3600,), "1 h"),
        ("travel", ([5], 300), "25 to 30 min"),
        ("travel", ([6, 7], 133), "13.3 to 17.7 min"),
        ("travel", ([6, 9], 133), "13.3 to 15.5 or 19.9 to 22.2 min"),
        ("travel", ([5.5], 300), "25 to 35 min"),
        ("travel", ([20], 0.05), "1 to 1.05 s"),
        ("travel", ([19], 900, True), "4.6 to 4.9 h"),
        ("travel", ([18.5], 900, True), "4.4 to 4.9 h"),
        ("travel_within", (5, 9, 133), "11.1 to 22.2 min"),
        ("travel_within", (18, 20, 900, True), "4.4 to 5.1 h"),
        ("samples_first", ([5], 300), "5 samples (25 to 30 min)"),
        ("samples_first", ([5], 300, True), "5 samples (22.5 to 27.5 min)"),
        ("travel_first", ([5], 300), "25 to 30 min (delay d = 5 samples of 5 min)"),
        ("travel_first", ([6, 7], 133), "13.3 to 17.7 min (delay d = 6 or 7 samples of 133 s)"),
        ("flow", (279.1,), "279"),
        ("flow", (12.345,), "12.3"),
        ("flow", (1315.4,), "1,315"),
        ("power", (24877.7,), "2.5 × 10⁴"),
        ("power", (0.0041,), "0.0041"),
        ("power", (12.3,), "12"),
        ("ten_to", (-4,), "10⁻⁴"),
    ],
)
def test_numbers_are_written_like_this(word, given, expected):
    assert getattr(text, word)(*given) == expected


def test_unbroken_sequences_of_days():
    first, second, last = (dt.date(2008, 1, day) for day in (1, 2, 9))
    assert text.spans([first, second, last]) == [(first, second), (last, last)]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_travel_time_printed_for_a_delay_holds_the_time_that_the_wave_needs(seed):
    rng = np.random.default_rng(seed)
    for _ in range(400):
        T_s = float(rng.choice([60, 133, 300, 900, 3600]))
        time = float(rng.uniform(1.05, 40) * T_s)
        d = int(np.ceil(time / T_s)) - 1  # as in a simulated day
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
