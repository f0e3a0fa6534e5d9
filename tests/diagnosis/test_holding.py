"""The size of a named effect on the days kept apart."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.diagnosis.blocks import split
from rivid.diagnosis.fit import calibrate, evaluate
from rivid.diagnosis.selection import held_share
from rivid.effects import effect_classes
from tests.diagnosis.pools import fresh, nominal, season

SEEDS = range(6)
LATERAL = effect_classes()["lateral_inflow"]
SIZE = 6.0


def share(seed, dates=None):
    """Share and error after an inflow was planted on some dates, and fitted as if it were always there."""
    planted = (
        (LATERAL(inflow=SIZE),) if dates is None else tuple(LATERAL(inflow=SIZE, dates=d) for d in dates)
    )
    record = season(seed, effects=planted)
    dealt = split(record.dates)
    model = replace(fresh(record, nominal(record), (LATERAL(inflow=1.0),)), free=(("inflow",),))
    model = calibrate(model, record.take(dealt.fit))
    linear = model.linear(record, dealt)
    return held_share(model, linear, evaluate(linear), "lateral_inflow")


def open_dates():
    """Runs of days that fit or select."""
    record = season(0)
    closed = split(record.dates).sealed
    edges = np.flatnonzero(np.diff(np.r_[True, closed, True].astype(int)))
    return tuple((record.dates[a], record.dates[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True))


def test_what_is_there_all_season_holds():
    found = np.array([share(seed) for seed in SEEDS])
    assert np.all(found[:, 1] < 0.2)
    z = (found[:, 0] - 1.0) / found[:, 1]
    assert np.abs(z).max() < 4.0
    assert np.all(found[:, 0] + 2.0 * found[:, 1] > 0.8)


def test_what_is_away_on_the_sealed_days_has_no_size_there():
    dates = open_dates()
    found = np.array([share(seed, dates) for seed in SEEDS])
    assert np.all(found[:, 0] + 2.0 * found[:, 1] < 0.5)


def test_an_effect_that_the_model_lacks_has_no_share():
    record = season(0)
    dealt = split(record.dates)
    model = calibrate(fresh(record, nominal(record)), record.take(dealt.fit))
    linear = model.linear(record, dealt)
    assert held_share(model, linear, evaluate(linear), "leakage") is None


@pytest.mark.parametrize("size", [4.0, 7.0])
def test_the_share_is_that_of_the_size_that_the_model_gives(size):
    record = season(1, effects=(LATERAL(inflow=SIZE),))
    dealt = split(record.dates)
    right = calibrate(
        replace(fresh(record, nominal(record), (LATERAL(inflow=1.0),)), free=(("inflow",),)),
        record.take(dealt.fit),
    )  # fmt: skip
    fixed = replace(right, effects=(LATERAL(inflow=size),), free=((),))
    linear = fixed.linear(record, dealt)
    still = np.full(len(linear.prior_sd), 1e-6)
    linear = replace(
        linear, prior_sd=still, deviation=0.0 * still
    )  # a response that stays as it is: a gain's error would take its part
    found = held_share(fixed, linear, evaluate(linear), "lateral_inflow")
    assert found is not None
    given = right.effects[0].inflow
    assert abs(found[0] - given / size) < 4.0 * found[1] + 0.1
