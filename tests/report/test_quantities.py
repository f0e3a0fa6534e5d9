"""Test numbers, dates and hours of a diagnosis as text."""

import datetime as dt
import math

import pytest

from rivid.diagnosis.result import Estimate, NamedEffect, Where
from rivid.report import quantities as q

AMPLITUDE = Estimate("amplitude", 6.0412, "m3/s", 5.83, 6.25)


@pytest.mark.parametrize(
    "function, values",
    [
        (q.name, {("diurnal_inflow",): "diurnal inflow"}),
        (q.clock, {(6.5,): "06:30", (24.0,): "24:00"}),
        (q.p_value, {(0.0002,): "p = 0.0002", (0.0,): "p < 0.0001", (0.0123,): "p = 0.012"}),
        (q.error, {(0.1234, 1000): "123", (0.0043, 1000): "4.3", (math.nan,): "–"}),
        (q.period, {(2700,): "45 min", (43200,): "12 h", (604800,): "7 days"}),
        (
            q.closed,
            {
                (0.974,): "97 % of the gap is closed",
                (-0.2,): "the gap is not smaller",
                (0.999,): "99.9 % of the gap is closed",
            },
        ),
        (
            q.tight,
            {
                (
                    "20 pulses of 14.9 m3/s in 3 h at 298 m3/s",
                ): "20 pulses of 14.9\u00a0m³/s in 3\u00a0h at 298\u00a0m³/s",
                (
                    "in brackets 90 %, 2 samples of 90 s",
                ): "in brackets 90\u00a0%, 2\u00a0samples of 90\u00a0s",
            },
        ),
        (q.percent, {(0.864,): "86 %", (-0.12,): "-12 %", (-0.001,): "0 %", (math.nan,): "–"}),
        (
            q.explanation,
            {((), None): "nothing missing", (("leakage",), "flow"): "leakage and an unknown flow or delay"},
        ),
    ],
)
def test_values_are_worded(function, values):
    assert {given: function(*given) for given in values} == values


def test_an_estimate_has_the_digits_that_its_interval_supports():
    assert q.estimate(AMPLITUDE) == "6.04 m³/s (5.83 to 6.25)"
    assert q.estimate(Estimate("place", 0.5, "-", math.nan, math.nan)) == "0.500 (no interval)"


def test_the_size_of_an_effect_is_its_main_parameter():
    effect = NamedEffect("diurnal_inflow", "flow", 0.0, (), None, None, (AMPLITUDE,), Where(), None, {})
    assert q.size(effect) == "amplitude 6.04 m³/s (5.83 to 6.25)"
    assert q.size(effect, brief=True) == "6.04 m³/s"


def test_an_estimate_has_a_second_form():
    assert q.converted(Estimate("error", -0.1, "-", -0.11, -0.09)) == "-10.0 %"
    assert q.converted(Estimate("offset", 532.0, "s", 520, 544)) == "8.9 min"
    assert q.converted(Estimate("start", 30.5, "h", 30, 31), dt.date(2024, 5, 1)) == "2024-05-02 06:30"


def test_an_effect_has_dates_and_hours():
    assert q.when(Where()) == "on all days, at all hours"
    assert q.when(Where(hours=(22, 6), regime="at low flow")) == "from 22:00 to 06:00, at low flow"
