"""Test a shifted rating: its effect on a river's reading, that no inflow replaces it; a pool has none."""

import dataclasses

import numpy as np
import pytest

from rivid.config import Config, parse
from rivid.diagnosis.choice import responses_of
from rivid.diagnosis.response.base import real_flows
from rivid.diagnosis.response.river import RiverResponse
from rivid.diagnosis.workflow import find_effects
from rivid.effects import CATALOGUE, changes_of
from rivid.errors import ConfigError, RividError
from rivid.simulation.season import simulate
from tests.diagnosis.answers import record_of
from tests.simulation.test_season import FEW

RIVER = {"name": "river", "kind": "river", "length": 25_000, "width": 100, "depth": 5, "sample_time": 1800.0}
SETTINGS = parse({"reach": RIVER}, Config, "test")
SHIFT = CATALOGUE["rating_shift"]


def test_the_reading_is_in_proportion_and_off_by_a_constant_within_the_dates():
    record = record_of(kind="river")
    response = RiverResponse.nominal(7200.0, 1800.0, 300.0)
    effect = SHIFT(error=0.03, offset=0.02, dates=(record.dates[5], record.dates[8]))
    plain, read = (response.baseline(record, changes_of(e, record.world())) for e in ((), (effect,)))
    inside = effect.active(record.world()) > 0.0
    assert inside.any() and not inside.all()
    np.testing.assert_allclose(
        read, np.where(inside, 1.03 * plain + 0.02 * record.world().flow, plain), rtol=1e-12
    )


@pytest.mark.long  # a whole diagnosis: 30 s
def test_a_shifted_rating_is_not_taken_for_an_inflow():
    record = record_of(kind="river", days=40, n=48)
    later = np.array([day >= record.dates[20] for day in record.dates])
    off = dataclasses.replace(record, output=record.output * (1.0 + 0.04 * later[:, None]))
    names = ("inflow_gain_error", "lateral_inflow", "rating_shift")
    study = find_effects(off, responses_of(SETTINGS, off), {name: CATALOGUE[name] for name in names}, most=2)
    assert not study.sure and "rating_shift" in study.group  # tied with other shifts of the balance
    # beside an unknown daily flow, which leads: the reading of this record is no wave of the response
    shift = next(one.effects[0] for one, _ in study.ranking if one.names == ("rating_shift",))
    before = shift.dates[0] == record.dates[0]  # the response may be that of the days after
    assert shift.dates[1 if before else 0] == record.dates[19 if before else 20]
    assert shift.error + shift.offset == pytest.approx(-0.04 if before else 0.04, abs=0.01)


def test_a_pool_has_no_rating():
    record = record_of()
    with pytest.raises(RividError, match="a rating in a pool"):
        real_flows(record, changes_of([SHIFT()], record.world()))
    with pytest.raises(ConfigError, match="rating_shift acts on rivers alone"):
        simulate(FEW, effects=[SHIFT()])
    assert not SHIFT.acts_on("pool") and SHIFT.acts_on("river")
