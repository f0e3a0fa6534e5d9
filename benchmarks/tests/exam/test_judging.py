"""Answers made by hand are judged as a reader would."""

import datetime as dt

import numpy as np
import pytest

from benchmarks.exam.cases import ALLOWED
from benchmarks.exam.judging import covering, described, hours_on, judge, overlap_of
from benchmarks.tests.exam.answers import answer, effect, gap, truth

NONE = frozenset()
FIRST = dt.date(2008, 1, 1)
LAG = {"name": "outflow_lag", "lag": 300.0}


def judged(said, planted=(LAG,), expected=("outflow_lag",), allowed=NONE, floor=None):
    return judge(said, truth(*planted), expected, allowed, floor)


def test_the_expected_name_alone_is_first_and_alone():
    j = judged(answer(effect("outflow_lag")))
    assert (j.first, j.alone, j.wrong, j.extra, j.all_named) == (True, True, False, False, True)


def test_the_expected_name_second_is_wrong():
    j = judged(answer(effect("clock_offset"), effect("outflow_lag")))
    assert (j.first, j.alone, j.wrong, j.extra) == (False, False, True, True)


def test_a_tie_with_the_expected_name_is_neither_first_nor_wrong():
    j = judged(answer(effect("clock_offset", tied=["outflow_lag"])))
    assert (j.first, j.wrong) == (False, False)


def test_no_name_is_an_abstention():
    j = judged(answer())
    assert (j.first, j.wrong, j.false) == (False, False, False)


def test_what_an_uneven_reach_lacks_is_not_counted_unless_it_was_planted():
    said = answer(effect("wave_attenuation"), effect("outflow_lag"))
    assert judged(said, allowed=ALLOWED).alone
    assert judged(said, allowed=NONE).wrong
    spread = {"name": "wave_attenuation", "spread": 600.0}
    assert judged(said, (spread,), ("wave_attenuation",), ALLOWED).first


def test_any_name_is_false_where_nothing_is_missing():
    assert judged(answer(effect("leakage")), (), (), ALLOWED).false
    assert not judged(answer(effect("wave_attenuation")), (), (), ALLOWED).false


def test_a_diagnosis_that_failed_is_wrong_and_false():
    j = judged({"error": "RividError: no", "seconds": 1.0})
    assert (j.wrong, j.false, j.verdict, j.growth) == (True, True, "error", None)


def test_a_pair_needs_both_names_and_the_breaker():
    pair = ("inflow_gain_error", "outflow_gain_error")
    planted = tuple({"name": name, "error": 0.03} for name in pair)
    tied = effect(pair[0], tied=[pair[1]], breaker="gauge one dam")
    assert judged(answer(tied), planted, pair).group
    assert not judged(answer(effect(pair[0], tied=[pair[1]])), planted, pair).group
    assert not judged(answer(effect(pair[0])), planted, pair).group
    assert judged(answer(effect(pair[0]), effect(pair[1])), planted, pair).group


def test_of_twins_only_the_planted_one_is_first():
    drift = {"name": "sensor_drift", "drift": 0.004}
    expected = ("sensor_drift", "lateral_inflow")
    assert not judged(answer(effect("lateral_inflow")), (drift,), expected).first
    assert judged(answer(effect("sensor_drift")), (drift,), expected).first


def test_unknown_needs_a_place_and_no_name():
    there = {"where": {"dates": ["2008-01-01", "2008-01-09"]}, "drivers": []}
    nowhere = {"where": {}, "drivers": []}
    assert judged(answer(verdict="unknown", unknown=there), (), ()).unknown
    assert not judged(answer(verdict="unknown", unknown=nowhere), (), ()).unknown
    assert not judged(answer(effect("leakage"), unknown=there), (), ()).unknown


@pytest.mark.parametrize("window", [(22.0, 6.0), (5.0, 13.0), (0.0, 24.0)])
def test_hours_of_a_window_are_counted_as_by_hand(window):
    a, b = window
    expected = [h for h in range(24) if (a <= h < b if a < b else h >= a or h < b)]
    on = hours_on({"hours": window}, FIRST, 3)
    assert on.sum() == 3 * 10 * len(expected)
    assert on.reshape(3, 24, 10).all(axis=2)[0].nonzero()[0].tolist() == expected


def test_overlap_is_hours_in_both_over_hours_in_either():
    given = {"dates": ["2008-01-01", "2008-01-20"], "hours": [22, 6]}
    planted = {"dates": ["2008-01-11", "2008-01-30"], "hours": [22, 4]}
    assert overlap_of(given, planted, FIRST, 60) == pytest.approx(10 * 6 / (20 * 8 + 20 * 6 - 10 * 6))
    assert overlap_of({}, {}, FIRST, 60) == 1.0


def test_windows_of_several_parts_of_one_name_are_taken_together():
    planted = {"name": "lateral_inflow", "inflow": 5.0, "dates": ["2008-01-11", "2008-01-20"]}
    parts = [
        effect("lateral_inflow", dates=dates)
        for dates in (["2008-01-11", "2008-01-15"], ["2008-01-16", "2008-01-20"])
    ]
    assert judged(answer(*parts), (planted,), ("lateral_inflow",)).overlap == 1.0
    assert judged(answer(parts[0]), (planted,), ("lateral_inflow",)).overlap == pytest.approx(0.5)
    assert judged(answer(effect("leakage")), (planted,), ("lateral_inflow",)).overlap is None


def test_gap_closed_is_against_the_floor_and_only_where_there_is_a_gap():
    j = judged(answer(effect("outflow_lag"), errors=gap()), floor=[2.0, 4.0, 19.9])
    assert j.closed[:2] == (pytest.approx(1.0), pytest.approx(1.0))
    assert j.closed[2] is None
    assert j.gap_closed == pytest.approx(1.0)
    half = (16.0 - 9.0) / (16.0 - 4.0)
    assert judged(
        answer(effect("outflow_lag"), errors=gap(end=(3.0, 8.0, 20.0))), floor=[2.0, 8.0, 20.0]
    ).gap_closed == pytest.approx(half)


def test_events_are_taken_as_described_where_they_come_last():
    steps = [{"rmse_described": None}, {"rmse_described": [1.0, 2.0, 3.0]}]
    assert described(gap(steps=steps)) == [1.0, 2.0, 3.0]
    assert described(gap(steps=steps[::-1])) == [2.0, 4.0, 10.0]


def test_growth_is_of_the_worst_horizon():
    assert judged(answer(errors=gap(end=(3.9, 8.4, 20.0)))).growth == pytest.approx(0.05)


@pytest.mark.parametrize(("low", "high", "inside"), [(250.0, 350.0, True), (310.0, 350.0, False)])
def test_an_interval_covers_the_planted_value_or_not(low, high, inside):
    said = effect("outflow_lag", parameters=[("lag", 330.0, low, high, "s")])
    assert covering([said], truth(LAG)) == [("outflow_lag.lag", inside)]


def test_parameters_without_an_interval_and_events_are_left_out():
    bare = effect("outflow_lag", parameters=[("lag", 330.0, None, None, "s")])
    rain = effect("rain_inflow", parameters=[("peak", 8.0, 1.0, 20.0, "m3/s")], events=4)
    assert covering([bare, rain], truth(LAG, {"name": "rain_inflow", "peak": 8.0})) == []


def test_an_hour_is_covered_round_the_clock():
    said = effect("diurnal_inflow", parameters=[("hour", 0.2, -0.3, 0.7, "h")])
    assert covering([said], truth({"name": "diurnal_inflow", "hour": 23.9})) == [
        ("diurnal_inflow.hour", True)
    ]


def test_a_size_that_varies_is_compared_at_the_date_of_its_knot():
    planted = {
        "name": "unlogged_upstream_release", "size": [10.0, 30.0], "dates": ["2008-01-11", "2008-01-30"],
    }  # fmt: skip
    rng = np.random.default_rng(3)
    for knots in (2, 3, 5):
        true = np.linspace(10.0, 30.0, knots)
        off = rng.uniform(-0.9, 0.9, knots)
        said = effect(
            "unlogged_upstream_release", dates=["2008-01-11", "2008-01-30"],
            parameters=[(f"size[{k}]", v + d, v + d - 1, v + d + 1, "m3/s")
                        for k, (v, d) in enumerate(zip(true, off, strict=True))],
        )  # fmt: skip
        found = covering([said], truth(planted))
        assert found == [("unlogged_upstream_release.size", True)] * knots
