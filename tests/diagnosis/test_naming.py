"""What may be named, and which of those that may, on proposals made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.diagnosis.events import Event, _storms
from rivid.diagnosis.selection import choose, is_material, stands, tied_with
from rivid.effects import CATALOGUE
from tests.diagnosis.pools import fitted, made, season

RECORD = season(1, days=20)
WINDOW = ((RECORD.dates[2], RECORD.dates[8]), None)


@pytest.fixture(scope="module")
def model():
    """The linear model and its evaluation."""
    return fitted(RECORD)[1:]


def named(pool, model, taken=()):
    choice = choose(pool, *model, 0, [CATALOGUE[name]() for name in taken])
    return None if choice is None else choice[0]


def test_a_name_is_unlikely_by_chance_confirmed_and_material(model):
    linear = model[0]
    good = made("lateral_inflow", 60, 20)
    assert stands(good, linear, 0) and is_material(good)
    for less in (
        {"p_value": 0.02}, {"gain_select": -1.0}, {"gain_fit": 0.0}, {"t": 0.9}, {"gain_select": 2.5},
        {"improvement": 0.0 * good.improvement, "p_value": 1e-4},
    ):  # fmt: skip
        assert not stands(replace(good, **less), linear, 0), less


def test_what_takes_much_from_every_error_needs_less_agreement_of_few_blocks(model):
    much = made("lateral_inflow", 120, 19, p=1e-7, t=0.8, improvement=0.3)
    assert stands(much, model[0], 0)
    assert not stands(replace(much, t=0.4), model[0], 0)
    assert not stands(replace(much, improvement=much.improvement * [1.0, 1.0, 0.5]), model[0], 0)


def test_a_weak_flow_is_named_where_it_is_no_chance_and_every_error_falls(model):
    weak = made("leakage", 18, 4, p=2e-4, t=2.0, improvement=0.04)
    assert stands(weak, model[0], 0) and not is_material(weak)
    for less in (
        {"p_value": 0.003}, {"gain_fit": 9.0}, {"gain_select": 2.0}, {"t": 1.2},
        {"effect": CATALOGUE["outflow_lag"]()},
        {"improvement": weak.improvement * [1.0, 3.0, -0.1]}, {"improvement": 0.5 * weak.improvement},
    ):  # fmt: skip
        assert not stands(replace(weak, **less), model[0], 0), less


def test_the_level_of_chance_halves_from_round_to_round(model):
    good = made("lateral_inflow", 60, 20, p=0.004)
    assert stands(good, model[0], 1) and not stands(good, model[0], 2)


def test_what_takes_little_from_the_error_is_named_if_it_is_beyond_doubt(model):
    small = made("diurnal_inflow", 30, 12, p=1e-6, improvement=0.03)
    assert not is_material(small) and stands(small, model[0], 0)
    assert not stands(replace(small, p_value=5e-3), model[0], 0)
    assert not stands(replace(small, improvement=0.1 * small.improvement), model[0], 0)


def test_a_lag_needs_likelihood_on_every_day_for_a_response_takes_it_upon_itself(model):
    lag = made("outflow_lag", 400, 100, improvement=0.0)
    assert stands(lag, model[0], 0) and not stands(replace(lag, gain_select=4.0), model[0], 0)


def test_a_clock_that_was_always_off_is_a_longer_way_unless_it_is_far_off(model):
    clock = made("clock_offset", 400, 100)
    near, far = (replace(clock, effect=CATALOGUE["clock_offset"](offset=s)) for s in (133.0, -400.0))
    assert not stands(near, model[0], 0) and stands(replace(near, window=WINDOW), model[0], 0)
    assert stands(far, model[0], 0)


def test_a_second_lateness_of_the_wave_has_dates_of_its_own_and_is_no_remnant_of_the_first(model):
    taken = ("flow_dependent_delay",)
    dated = made("clock_offset", 400, 100, window=WINDOW)
    remnant, far = (replace(dated, effect=CATALOGUE["clock_offset"](offset=s)) for s in (40.0, 300.0))
    assert named([remnant], model) is remnant and named([remnant], model, taken) is None
    assert named([far], model, taken) is far
    assert named([replace(far, window=(None, None))], model, taken) is None


def test_of_two_windows_the_one_that_takes_more_from_the_error_is_named(model):
    whole = made("lateral_inflow", 80, 25, improvement=0.5)
    part = made("lateral_inflow", 500, 200, improvement=0.1, window=WINDOW)
    assert named([part, whole], model) is whole
    assert named([whole, replace(part, improvement=0.6 + whole.improvement)], model).window == WINDOW


def test_of_two_flows_likelihood_decides_only_where_they_take_as_much_from_the_error(model):
    constant = made("lateral_inflow", 80, 25, improvement=0.5)
    gain = made("outflow_gain_error", 200, 90, improvement=0.1)
    assert named([gain, constant], model) is constant
    assert (
        named([replace(gain, improvement=constant.improvement), constant], model).name == "outflow_gain_error"
    )


def test_where_no_flow_takes_from_the_error_the_one_that_adds_least_is_named(model):
    """A likelihood beyond doubt may go with an error that grows a little in the mean of the horizons."""
    worse = made("lateral_inflow", 400, 100, p=1e-9)
    worse = replace(worse, improvement=worse.improvement * [0.5, -1.0, -1.0])
    assert worse.improvement.mean() < 0.0 and stands(worse, model[0], 0)
    assert named([worse], model) is worse


def test_where_little_is_taken_from_the_error_likelihood_decides(model):
    """A few blocks' errors hours ahead are chance at a few hundredths."""
    swing = made("diurnal_inflow", 25, 8, improvement=0.1)
    release = made("unlogged_upstream_release", 88, 27, improvement=0.07)
    assert named([swing, release], model) is release


def test_what_is_hardly_less_likely_is_tied(model):
    """Six nats on all open days do not tell a gain from a constant inflow."""
    linear, before = model
    release, inflow = (
        made("unlogged_upstream_release", 30, 15, improvement=0.3),
        made("lateral_inflow", 26, 14),
    )
    inflow = replace(inflow, columns=np.random.default_rng(1).normal(size=inflow.columns.shape))
    assert tied_with(release, [inflow], linear, before) == ("lateral_inflow",)
    assert tied_with(release, [replace(inflow, gain_fit=20.0)], linear, before) == ()
    assert tied_with(release, [replace(inflow, gain_select=-1.0)], linear, before) == ()


def test_a_name_is_given_once_but_for_releases(model):
    once = made("lateral_inflow", 80, 25)
    assert named([once], model, ("lateral_inflow",)) is None
    again = made("unlogged_upstream_release", 80, 25)
    assert named([again], model, ("unlogged_upstream_release",)) is again


def test_a_storm_in_several_events_is_one_storm():
    def event(day, hour):
        return Event(day, 3600.0 * hour, 9.0 * 3600.0, 5.0, 0.5, 20.0, False)

    parts = [event(3, 2.0), event(3, 2.5), event(3, 4.9), event(3, 23.0), event(4, 0.5), event(9, 2.0)]
    assert [(e.day, e.start_s / 3600.0) for e in _storms(parts)] == [(3, 2.0), (3, 23.0), (9, 2.0)]
