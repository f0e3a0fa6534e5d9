"""Each effect acts on the level of a pool as its sentence describes, and all of them together."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.effects import CATALOGUE, changes_of
from rivid.reach.integrator import LinearReach, pool_level
from tests.effects.worlds import total, world

REACH = LinearReach()


def levels(effects, here, start=0.0, more=0.0):
    """Level of the water and reading of the gauge; the outflow is the usual flow, and something more."""
    changes = changes_of(effects, here)
    outflow = np.full(here.time.shape, here.flow) + more
    flow = pool_level(REACH, here.time, here.inflow, outflow, 900.0, start=here.level + start,
                      before=float(here.inflow[0]), changes=changes)  # fmt: skip
    return flow.level, flow.level + changes.gauge


def steady(days=2):
    here = world(days=days)
    return replace(here, inflow=np.full(here.time.shape, here.flow))


@pytest.mark.parametrize(
    "name,sign",
    [("lateral_inflow", 1), ("rain_inflow", 1), ("unlogged_upstream_release", 1),
     ("unlogged_downstream_release", -1), ("inflow_gain_error", 1), ("outflow_gain_error", -1)],
)  # fmt: skip
def test_flows_lift_the_level_or_lower_it_by_their_volume(name, sign):
    here = steady()
    effect = (
        CATALOGUE[name](starts=(0.0, 9.0)) if "starts" in CATALOGUE[name].parameters() else CATALOGUE[name]()
    )
    level, _ = levels([effect], here)
    changes = changes_of([effect], here)
    flow = sum((a.flow for a in changes.added), start=np.zeros(here.time.shape))
    if changes.inflow is not None:
        flow = flow + changes.inflow - here.inflow
    flow = flow - here.flow * (changes.gate.factor - 1.0)
    assert np.sign(level[-1] - here.level) == sign
    # what entered in the last half hour may still be on its way
    volume = (level[-1] - here.level) * REACH.surface_area
    assert volume == pytest.approx(total(here.time, flow, 133.0), abs=1800 * np.abs(flow).max())


@pytest.mark.parametrize("start", [0.5, -0.5])
@pytest.mark.parametrize("name", ["leakage", "gate_head_effect"])
def test_what_depends_on_the_level_draws_it_back(name, start):
    here = steady()
    plain, level = (levels(effects, here, start)[0] for effects in ([], [CATALOGUE[name]()]))
    assert plain == pytest.approx(np.full(here.time.shape, here.level + start))
    assert 0 < (level[-1] - here.level) / start < 0.9


@pytest.mark.parametrize("name", ["side_storage", "storage_area_slope"])
def test_more_storage_lifts_the_level_less(name):
    here = steady()
    rising = replace(here, inflow=here.inflow + np.where(here.time > 0, 5.0, 0.0))
    plain, level = (levels(effects, rising)[0] for effects in ([], [CATALOGUE[name]()]))
    assert here.level < level[-1] < plain[-1]
    assert levels([CATALOGUE[name]()], here)[0] == pytest.approx(np.full(here.time.shape, here.level))


@pytest.mark.parametrize("name", ["sensor_drift", "sensor_step", "wind_setup", "seiche"])
def test_the_gauge_moves_and_the_water_does_not(name):
    here = steady()
    level, reading = levels([CATALOGUE[name]()], here)
    assert level == pytest.approx(np.full(here.time.shape, here.level))
    assert np.abs(reading - level).max() > 0.004


@pytest.mark.parametrize("name", ["flow_dependent_delay", "wave_attenuation", "clock_offset"])
def test_the_inflow_comes_at_other_times_but_all_of_it(name):
    here = world(days=2)
    quiet = (here.time < -40_000) | (here.time > 120_000)
    here = replace(here, inflow=np.where(quiet, here.flow, here.inflow))
    plain, _ = levels([], here)
    level, _ = levels([CATALOGUE[name]()], here)
    assert np.abs(level - plain).max() > 2e-3
    assert level[-1] == pytest.approx(plain[-1], abs=1e-9)


@pytest.mark.parametrize("step", [2.0, -30.0])
@pytest.mark.parametrize("name", ["outflow_lag", "gate_rate_limit", "gate_deadband"])
def test_a_gate_that_comes_late_keeps_water_back(name, step):
    here = steady()
    more = np.where(here.time >= 0.0, step, 0.0)
    effect = CATALOGUE[name]()
    plain, level = (levels(e, here, more=more)[0] for e in ([], [effect]))
    kept = {
        "outflow_lag": lambda: effect.lag * step,
        "gate_rate_limit": lambda: step * abs(step) / (2 * effect.rate),
        "gate_deadband": lambda: step * here.time[-1] if abs(step) < effect.band else 0.0,
    }[name]()
    volume = (level[-1] - plain[-1]) * REACH.surface_area
    assert volume == pytest.approx(kept, rel=1e-9, abs=1e-6)


def test_the_whole_catalogue_goes_together():
    here = world(2, days=3)
    alone = levels([], here)[1]
    together = levels([one() for one in CATALOGUE.values()], here)[1]
    assert np.isfinite(together).all() and np.abs(together - alone).max() > 0.05
