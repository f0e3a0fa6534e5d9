"""Proposals in the simulator: their gain, their rivals, and effects that another one makes needless."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rivid.diagnosis.adding import (
    WORTH,
    added,
    contradicted,
    dropped,
    exchanged,
    in_simulator,
    patched,
    rivals,
    stepped,
    worth_trying,
)
from rivid.diagnosis.candidates import Proposal, proposals
from rivid.diagnosis.fit import calibrate, evaluate
from rivid.diagnosis.response.base import kernels_of
from rivid.diagnosis.selection import Round
from rivid.effects import CATALOGUE
from rivid.errors import RividError
from tests.diagnosis import sizes
from tests.diagnosis.pools import fitted, made, season


@cache
def found(record, *names):
    """Proposals of some effects about the calibrated model."""
    model, linear, evaluation = fitted(record)
    trials = [t for n in names for t in CATALOGUE[n].trials(record.sample_time)]
    pool = proposals(
        linear, evaluation, trials, lambda more: model.baseline(record, tuple(more)),
        kernels_of(model.reach, record), flips=199,
    )  # fmt: skip
    return model, linear, evaluation, pool


def quiet(_):
    """No report."""


def test_in_the_simulator_an_effect_has_its_size_and_its_likelihood(monkeypatch):
    record = season(31, effects=(CATALOGUE["diurnal_inflow"](amplitude=7.0, hour=9.0),))
    model, linear, evaluation, pool = found(record, "diurnal_inflow")
    fit = record.take(linear.split.fit)
    proposal, larger, _, after = in_simulator(model, linear, evaluation, pool[0], fit, quiet)
    (effect,) = larger.effects
    assert effect.amplitude == pytest.approx(7.0, abs=1.2) and effect.hour == pytest.approx(9.0, abs=0.7)
    gain = after.likelihood - evaluation.likelihood
    assert proposal.gain_select == pytest.approx(gain[linear.split.select].sum(), rel=0.2)
    assert proposal.gain_select > 5.0
    again = evaluate(larger.linear(record, linear.split))
    np.testing.assert_allclose(again.likelihood, after.likelihood)

    def broken(*_args, **_more):
        raise RividError("dry")

    monkeypatch.setattr("rivid.diagnosis.adding.added", broken)
    proposal, same, *_ = in_simulator(model, linear, evaluation, pool[0], record, quiet)
    assert proposal.gain_select == 0.0 and same is model


@sizes("band", 6.0, 3.0)
def test_a_dead_band_is_found_between_two_commands(band):
    """Commands are whole m3/s: any band above one and up to the next does the same."""
    record = season(34, effects=(CATALOGUE["gate_deadband"](band=band),))
    model, linear, evaluation = fitted(record)
    start = replace(model, effects=(CATALOGUE["gate_deadband"](band=4.2),), free=((),))
    found_, spread = stepped(start, "band", record.take(linear.split.fit))
    low, high = (found_.effects[0].band + 1.96 * s * spread for s in (-1, 1))
    assert low <= band <= high + 1e-9 and high - low <= 1.0 + 1e-9
    assert evaluation.likelihood.shape == (40,)


def test_what_acts_in_steps_is_not_left_to_slopes():
    record = season(34, effects=(CATALOGUE["gate_deadband"](band=6.0),))
    model, linear, _, pool = found(record, "gate_deadband")
    larger, spreads = added(model, pool[0], record.take(linear.split.fit), quiet)
    assert larger.free == ((),) and larger.effects[0].band == pytest.approx(5.5, abs=0.51)
    assert spreads["band"] > 0.2
    again = calibrate(larger, record.take(linear.split.fit), steps=2)
    assert again.effects == larger.effects  # a fixed effect stays


def test_rivals_are_near_or_of_the_same_kind():
    lag, clock = made("outflow_lag", 200, 100), made("clock_offset", 60, 20)
    wave, day = made("unlogged_upstream_release", 300, 90), made("diurnal_inflow", 90, 60)
    pool = [lag, clock, wave, day]
    assert [p.name for p in rivals(lag, pool)] == ["unlogged_upstream_release", "clock_offset"]
    assert [p.name for p in rivals(wave, pool)] == ["outflow_lag"]
    assert rivals(day, [day, replace(clock, level_noise=True)]) == []


def test_only_what_is_no_chance_and_gains_a_lot_is_tried_without_standing():
    flow, small = made("lateral_inflow", 300, 60), made("diurnal_inflow", 20, 10)
    chance, lag = made("leakage", 200, 60, p=0.02), made("outflow_lag", 500, 200)
    assert worth_trying([flow, small, chance, lag], (), 0) == [flow]
    assert worth_trying([flow], ("lateral_inflow",), 0) == []


def test_a_proposal_takes_the_place_of_all_its_name_was_tried_at():
    old, other, lag = made("clock_offset", 9, 9), made("clock_offset", 5, 5), made("outflow_lag", 1, 1)
    new, dated = replace(old, gain_fit=3.0), replace(other, window=((None, None), None))
    assert exchanged([old, other, dated, lag], old, new) == [new, dated, lag]


def test_what_gains_only_where_it_was_fitted_is_contradicted():
    record = season(1, days=20)
    _, linear, _ = fitted(record)
    good, bad = made("lateral_inflow", 90, 30), made("diurnal_inflow", 2.0 * WORTH, -4, t=-3.0)
    assert contradicted([good], linear) is None
    assert contradicted([good, bad], linear) is bad
    assert contradicted([replace(bad, p_value=0.2)], linear) is None
    assert contradicted([replace(bad, t=-1.0)], linear) is None  # a loss that may be chance


WAVE = CATALOGUE["diurnal_inflow"](amplitude=6.0, hour=15.0)


def turn(effect, evaluation, window=(None, None)):
    """A round that named an effect."""
    proposal = Proposal(
        effect.name, "", effect, (), window, 1e-4, evaluation, np.empty((0, 1, 1)), 9.0, 9.0, 3.0,
        np.zeros(3), 4,
    )  # fmt: skip
    return Round(evaluation, proposal, (), None, None, evaluation)


def with_both(record, stand_in):
    """A model with a stand-in that was named first, and the wave."""
    model, linear, evaluation = fitted(record)
    both = replace(model, effects=(stand_in, WAVE), free=(("size",), ("amplitude", "hour")))
    both = calibrate(both, record.take(linear.split.fit), steps=3)
    about = both.linear(record, linear.split)
    rounds = [turn(stand_in, evaluation), turn(WAVE, evaluation)]
    return both, about, evaluate(about), rounds, record.take(linear.split.fit), quiet


def test_a_release_that_stood_in_for_a_wave_goes_when_the_wave_is_in():
    record = season(21, effects=(WAVE,))
    stand_in = CATALOGUE["unlogged_upstream_release"](size=5.0, hours=(11.0, 19.0))
    model, _, after, rounds = dropped(*with_both(record, stand_in))
    assert [e.name for e in model.effects] == ["diurnal_inflow"]
    assert [r.proposal.name for r in rounds] == ["diurnal_inflow"]
    assert model.effects[0].amplitude == pytest.approx(6.0, abs=1.0)
    assert after.likelihood.shape == (40,)


def test_a_release_that_is_there_stays():
    there = CATALOGUE["unlogged_upstream_release"](size=9.0, hours=(2.0, 5.0))
    record = season(22, effects=(WAVE, there))
    model, _, _, rounds = dropped(*with_both(record, there))
    assert [e.name for e in model.effects] == ["unlogged_upstream_release", "diurnal_inflow"]
    assert len(rounds) == 2


def test_two_daily_schedules_are_a_patch():
    record = season(21, effects=(WAVE,))
    _, _, evaluation = fitted(record)
    release = CATALOGUE["unlogged_upstream_release"]
    early = turn(release(size=5.0, hours=(2.0, 6.0)), evaluation, (None, (2.0, 6.0)))
    late = turn(release(size=5.0, hours=(12.0, 16.0)), evaluation, (None, (12.0, 16.0)))
    dated = turn(release(size=5.0), evaluation, (record.dates[:2], (12.0, 16.0)))
    assert patched([early, late]) and not patched([early]) and not patched([early, dated])
