"""Test that hand-made answers are judged as a reader would judge them."""

import pytest

from benchmarks.exam.judging import AHEAD, chances, covering, judge, kind_of
from benchmarks.tests.exam.answers import answer, effect, gap, ranked, truth

LAG = {"name": "outflow_lag", "lag": 300.0}
CLOCK = {"name": "clock_offset", "offset": 500.0}


def judged(given, *planted, floor=None, **more):
    return judge(given, truth(*planted, **more), floor)


def test_the_planted_name_alone_is_first_and_alone():
    j = judged(answer(effect("outflow_lag")), LAG)
    assert (j.first, j.alone, j.wrong, j.extra, j.every, j.held, j.close) == (
        True, True, False, False, True, True, True,
    )  # fmt: skip


def test_the_planted_name_second_is_wrong():
    j = judged(answer(effect("clock_offset"), effect("outflow_lag")), LAG)
    assert (j.first, j.found, j.alone, j.wrong, j.extra) == (False, False, False, True, True)


def test_a_tie_with_the_planted_name_is_found_and_neither_first_nor_wrong():
    j = judged(answer(effect("clock_offset", tied=["outflow_lag"])), LAG)
    assert (j.first, j.found, j.wrong, j.held) == (False, True, False, True)
    assert not judged(answer(effect("outflow_lag", tied=["clock_offset"])), LAG).alone


def test_no_name_is_an_abstention():
    j = judged(answer(), LAG)
    assert (j.first, j.found, j.wrong, j.extra) == (False, False, False, False)


def test_what_is_true_of_the_water_is_not_counted_unless_it_was_planted():
    given = answer(effect("storage_area_slope"), effect("outflow_lag"))
    assert judged(given, LAG, allowed=["storage_area_slope"]).alone
    assert judged(given, LAG).wrong
    slope = {"name": "storage_area_slope", "slope": 0.3}
    assert judged(answer(effect("storage_area_slope")), slope, allowed=["storage_area_slope"]).first


def test_a_diagnosis_that_failed_is_wrong():
    j = judged({"error": "RividError: no", "seconds": 1.0}, LAG)
    assert (j.wrong, j.verdict, j.growth) == (True, "error", None)


@pytest.mark.parametrize(("nats", "near"), [(AHEAD - 0.1, True), (AHEAD, False)])
def test_effects_are_as_separable_as_their_nearest_rival_lets_them_be(nats, near):
    rivals = {"side_storage": nats, "gate_rate_limit": 50.0}
    assert kind_of(truth(LAG, rivals=rivals)) == ("confounded" if near else "separable")
    assert kind_of(truth(LAG, CLOCK, rivals=rivals)) == ("two_close" if near else "two")
    assert (kind_of(truth(LAG)), kind_of(truth())) == ("separable", "nothing")


def test_a_group_holds_the_planted_name_and_none_but_its_rivals():
    rivals = {"clock_offset": 1.0, "gate_rate_limit": 40.0}
    tied = answer(effect("clock_offset", tied=["outflow_lag"]), verdict="cannot_tell")
    j = judged(tied, LAG, rivals=rivals)
    assert (j.held, j.close) == (True, True)
    wide = answer(effect("outflow_lag", tied=["clock_offset", "gate_rate_limit"]), verdict="cannot_tell")
    j = judged(wide, LAG, rivals=rivals)
    assert (j.held, j.close) == (True, False)
    assert not judged(answer(effect("clock_offset")), LAG, rivals=rivals).held


def test_a_right_name_that_did_not_hold_is_not_found_and_a_wrong_one_is_wrong():
    j = judged(answer(effect("outflow_lag"), verdict="did_not_hold"), LAG)
    assert (j.first, j.found, j.held, j.every, j.wrong) == (False, False, False, False, False)
    assert judged(answer(effect("leakage"), verdict="did_not_hold"), LAG).wrong


def test_two_effects_need_both_and_no_third():
    j = judged(answer(effect("outflow_lag"), effect("clock_offset")), LAG, CLOCK)
    assert (j.every, j.extra) == (True, False)
    j = judged(answer(effect("outflow_lag"), effect("leakage")), LAG, CLOCK)
    assert (j.every, j.extra, j.wrong) == (False, True, False)


@pytest.mark.parametrize("kind", ["outside", "removed"])
def test_of_an_outsider_any_name_is_wrong_and_unknown_is_right(kind):
    hidden = {"name": "siphon"} if kind == "outside" else LAG
    excluded = [] if kind == "outside" else ["outflow_lag"]
    j = judged(answer(effect("leakage")), hidden, kind=kind, excluded=excluded)
    assert (j.wrong, j.unknown) == (True, False)
    j = judged(answer(verdict="unknown"), hidden, kind=kind, excluded=excluded)
    assert (j.wrong, j.unknown) == (False, True)
    assert not judged(answer(), hidden, kind=kind, excluded=excluded).unknown


def test_the_probability_of_a_name_is_that_of_all_explanations_with_it():
    ranking = ranked(
        (["outflow_lag"], 0.6), (["outflow_lag", "leakage"], 0.3), ([], 0.05), (["seiche"], 0.001)
    )
    found = dict(
        zip(("leakage", "outflow_lag"), chances(answer(ranking=ranking), {"outflow_lag"}, set()), strict=True)
    )
    assert found == {"leakage": (0.3, False), "outflow_lag": (pytest.approx(0.9), True)}
    without = answer(effect("leakage", probability=0.8), effect("seiche"))
    assert chances(without, {"leakage"}, set()) == [(0.8, True)]
    assert chances(without, {"leakage"}, {"leakage"}) == []


def test_gap_closed_is_against_the_floor_and_only_where_there_is_a_gap():
    j = judged(answer(effect("outflow_lag"), errors=gap()), LAG, floor=[2.0, 4.0, 19.9])
    assert j.closed == (pytest.approx(1.0), pytest.approx(1.0), None)
    assert j.gap_closed == pytest.approx(1.0)
    half = (16.0 - 9.0) / (16.0 - 4.0)
    errors = gap(end=(3.0, 8.0, 20.0))
    assert judged(answer(effect("outflow_lag"), errors=errors), LAG, floor=[2.0, 8.0, 20.0]).gap_closed == (
        pytest.approx(half)
    )


def test_growth_is_of_the_worst_horizon_with_events_as_described():
    assert judged(answer(errors=gap(end=(3.9, 8.4, 20.0)))).growth == pytest.approx(0.05)
    assert judged(answer(errors=gap(described=[4.4, 4.0, 10.0]))).growth == pytest.approx(0.1)


def test_growth_to_what_the_true_model_makes_is_no_growth_beyond_it():
    grown = answer(effect("outflow_lag"), errors=gap(end=(4.4, 4.0, 10.0)))
    for floor, beyond in (([4.4, 3.0, 9.0], 0.0), ([2.0, 4.0, 9.0], 0.1), ([4.0, None, None], 0.1)):
        j = judged(grown, LAG, floor=floor)
        assert j.growth == pytest.approx(0.1) and j.beyond == pytest.approx(beyond)
    assert judged(grown, LAG).beyond is None


@pytest.mark.parametrize(("low", "high", "inside"), [(250.0, 350.0, True), (310.0, 350.0, False)])
def test_an_interval_covers_the_planted_value_or_not(low, high, inside):
    given = effect("outflow_lag", parameters=[("lag", 330.0, low, high, "s")])
    assert covering([given], truth(LAG)) == [("outflow_lag.lag", inside)]


def test_parameters_without_an_interval_and_events_are_left_out():
    bare = effect("outflow_lag", parameters=[("lag", 330.0, None, None, "s")])
    rain = effect("rain_inflow", parameters=[("peak", 8.0, 1.0, 20.0, "m3/s")], events=4)
    assert covering([bare, rain], truth(LAG, {"name": "rain_inflow", "peak": 8.0})) == []


def test_an_hour_is_covered_round_the_clock():
    given = effect("diurnal_inflow", parameters=[("hour", 0.2, -0.3, 0.7, "h")])
    assert covering([given], truth({"name": "diurnal_inflow", "hour": 23.9})) == [
        ("diurnal_inflow.hour", True)
    ]
