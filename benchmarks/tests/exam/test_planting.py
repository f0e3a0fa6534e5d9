"""Planting: two crews on one river, drawn events told as drawn, and a river of reservoirs."""

import numpy as np
import pytest

from benchmarks.exam.answering import record_of
from benchmarks.exam.cases import cases
from benchmarks.exam.planting import plant, sealed
from benchmarks.exam.river import routed
from benchmarks.tests.exam.test_cases import SCENARIOS
from rivid.simulation.scenario import load_scenario
from rivid.simulation.season import DAY

BY_NAME = {case.name: case for case in cases()}


def test_another_crew_takes_over_half_way_on_the_same_river():
    one, two = (plant(BY_NAME[name], 3).logs for name in ("nothing/linear", "people/linear"))
    assert len(two.dates) == len(one.dates) - 1
    np.testing.assert_array_equal(two.outflow[:30], one.outflow[:30])
    np.testing.assert_array_equal(two.inflow[30:], one.inflow[31:])
    assert np.abs(two.outflow[30:] - one.outflow[31:]).max() > 20.0
    assert (two.dates[30] - two.dates[29]).days == 2


def test_the_same_seed_plants_the_same_and_another_one_does_not():
    a, b, c = (sealed(BY_NAME["one/rain_inflow/x2"], seed)[0] for seed in (3, 3, 4))
    np.testing.assert_array_equal(a.output, b.output)
    assert np.abs(a.output - c.output).max() > 0.01


@pytest.mark.parametrize("name", ["one/rain_inflow/planted", "one/unlogged_downstream_release/planted"])
def test_drawn_events_are_told_to_the_floor_as_they_were_drawn(name):
    planted = plant(BY_NAME[name], 5)
    (effect,) = planted.told
    record = record_of(planted.logs)
    drawn = type(effect).from_table(planted.truth["effects"][0])
    flows = []
    for one in (effect, drawn):
        changes = one.changes(record.world())
        flows.append(changes.added[0].flow)
    starts = np.array(effect.starts)
    assert len(starts) > 5 and (np.diff(starts) >= 0).all()
    day = record.time[:, record.lead :]
    events = ((starts * 3600.0 >= 0) & (starts * 3600.0 < 60 * DAY)).sum()
    assert events > 5
    assert flows[0].shape == record.time.shape and np.abs(flows[0][:, -day.shape[1] :]).max() > 1.0


def test_a_river_keeps_its_water_and_delays_it():
    scenario = load_scenario(SCENARIOS / "exam" / "river.toml")
    n = 96 * 4
    inflow = np.full(n, 200.0)
    inflow[96:104] = 300.0
    out = routed(inflow, np.zeros(n), scenario, 15)
    assert out.sum() == pytest.approx(inflow.sum(), rel=1e-4)
    late = (np.arange(n) * (out - 200.0)).sum() / (out - 200.0).sum() - 99.5
    assert 4.0 < late * 900.0 / 3600.0 < 12.0
    assert out.max() < 299.0


def test_a_lateral_inflow_arrives_in_full():
    scenario = load_scenario(SCENARIOS / "exam" / "river.toml")
    out = routed(np.full(300, 200.0), np.full(300, 5.0), scenario, 15)
    assert out[-1] == pytest.approx(205.0, rel=1e-6)


def test_a_bypass_is_in_the_river_and_not_in_its_log():
    planted = plant(BY_NAME["river/bypass"], 3)
    empty = plant(BY_NAME["river/nothing"], 3)
    np.testing.assert_array_equal(planted.logs.inflow, empty.logs.inflow)
    more = planted.logs.output - empty.logs.output
    assert more[:20].max() == 0.0 and more[25:40].mean() == pytest.approx(38.0 * 16 / 24, rel=0.1)
    assert planted.logs.outflow is None and record_of(planted.logs).kind == "river"
