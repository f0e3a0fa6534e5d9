"""Test the free river: a cascade of reservoirs."""

import numpy as np
import pytest

from benchmarks.exam.river import route
from benchmarks.exam.worlds import draw, logs_of, season_of
from rivid.effects.flow import UnloggedUpstreamRelease

SCALE, COUNT, STEPS, DT = 3000.0 * 200.0**0.4, 16, 15, 60.0
NONE = np.zeros((0, 400)), np.zeros(0, np.int64)


def test_a_river_keeps_its_water_and_delays_it():
    inflow, out = np.full(400, 200.0), np.empty(400)
    inflow[96:104] = 300.0
    assert route(inflow, *NONE, STEPS, DT, SCALE, COUNT, out)
    assert out.sum() == pytest.approx(inflow.sum(), rel=1e-4)
    late = (np.arange(400) * (out - 200.0)).sum() / (out - 200.0).sum() - 99.5
    per_reservoir = SCALE * 0.6 * 200.0**-0.4  # dS/dQ
    assert late * STEPS * DT == pytest.approx(COUNT * per_reservoir, rel=0.1)
    assert out.max() < 299.0


@pytest.mark.parametrize("at", [0, 7, 15])
def test_what_enters_on_the_way_arrives_in_full(at):
    out = np.empty(400)
    sides = np.full((1, 400), 5.0)
    assert route(np.full(400, 200.0), sides, np.array([at]), STEPS, DT, SCALE, COUNT, out)
    assert out[-1] == pytest.approx(205.0, rel=1e-6)


def test_a_river_runs_dry():
    assert not route(np.r_[5.0, np.full(399, -50.0)], *NONE, STEPS, DT, 10.0, COUNT, np.empty(400))


def test_a_release_is_in_the_river_and_not_in_its_log():
    world = next(w for seed in range(12) if (w := draw(seed)).kind == "river")
    size = 0.1 * world.scenario.flow.mean
    empty, more = season_of(world), season_of(world, (UnloggedUpstreamRelease(size=size),))
    one, two = logs_of(world, empty), logs_of(world, more)
    np.testing.assert_array_equal(one.inflow, two.inflow)
    assert one.outflow is None and one.settings.reach.kind == "river"
    assert np.mean((two.output - one.output)[2:]) == pytest.approx(size, rel=0.02)
