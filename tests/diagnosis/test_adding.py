"""Effects in the model: dropped when others make them needless, kept when they are not."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.diagnosis.adding import dropped, patched
from rivid.diagnosis.candidates import Proposal
from rivid.diagnosis.fit import calibrate, evaluate
from rivid.diagnosis.selection import Round
from rivid.effects import CATALOGUE
from tests.diagnosis.pools import fitted, season

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
    return both, about, evaluate(about), rounds, record.take(linear.split.fit)


def test_a_release_that_stood_in_for_a_wave_goes_when_the_wave_is_in():
    record = season(21, effects=(WAVE,))
    stand_in = CATALOGUE["unlogged_upstream_release"](size=5.0, hours=(11.0, 19.0))
    model, _, after, rounds = dropped(*_five(with_both(record, stand_in)))
    assert [e.name for e in model.effects] == ["diurnal_inflow"]
    assert [r.proposal.name for r in rounds] == ["diurnal_inflow"]
    assert model.effects[0].amplitude == pytest.approx(6.0, abs=1.0)
    assert after.likelihood.shape == (40,)


def test_a_release_that_is_there_stays():
    there = CATALOGUE["unlogged_upstream_release"](size=9.0, hours=(2.0, 5.0))
    record = season(22, effects=(WAVE, there))
    model, _, _, rounds = dropped(*_five(with_both(record, there)))
    assert [e.name for e in model.effects] == ["unlogged_upstream_release", "diurnal_inflow"]
    assert len(rounds) == 2


def _five(given):
    model, linear, after, rounds, fit = given
    return model, linear, after, rounds, fit, lambda _: None


def test_two_daily_schedules_are_a_patch():
    record = season(21, effects=(WAVE,))
    _, _, evaluation = fitted(record)
    release = CATALOGUE["unlogged_upstream_release"]
    early = turn(release(size=5.0, hours=(2.0, 6.0)), evaluation, (None, (2.0, 6.0)))
    late = turn(release(size=5.0, hours=(12.0, 16.0)), evaluation, (None, (12.0, 16.0)))
    dated = turn(release(size=5.0), evaluation, (record.dates[:2], (12.0, 16.0)))
    assert patched([early, late]) and not patched([early]) and not patched([early, dated])
