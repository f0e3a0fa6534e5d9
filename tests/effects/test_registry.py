from dataclasses import replace

import numpy as np
import pytest

from rivid.effects import CATALOGUE, changes_of, worlds_of
from rivid.effects.flow import (
    DiurnalInflow,
    GateHeadEffect,
    InflowGainError,
    LateralInflow,
    Leakage,
    OutflowGainError,
    RainInflow,
    StorageAreaSlope,
)
from rivid.effects.level import Seiche, SensorStep, WindSetup
from rivid.effects.timing import ClockOffset, OutflowLag, WaveAttenuation
from rivid.reach.integrator import LinearReach, pool_level
from tests.effects.worlds import world


def test_maps_of_the_inflow_are_applied_in_turn():
    here = world(2)
    clock, gain, wave = ClockOffset(offset=500.0), InflowGainError(error=0.1), WaveAttenuation(spread=400.0)
    inner = clock.changes(here).inflow
    outer = wave.changes(replace(here, inflow=inner * 1.1)).inflow
    real = changes_of([clock, LateralInflow(), gain, wave], here).inflow
    assert real == pytest.approx(outer, rel=1e-13)
    seen = worlds_of([clock, LateralInflow(), gain, wave], here)
    assert [
        np.allclose(w.inflow, q) for w, q in zip(seen, (here.inflow, inner, inner, inner * 1.1), strict=True)
    ]
    assert seen[0].inflow is here.inflow and seen[2].inflow.tolist() == inner.tolist()


def test_changes_of_several_effects_are_joined():
    here = world()
    nothing = changes_of([], here)
    assert nothing.inflow is None and nothing.gate_is_plain and nothing.gauge.tolist() == [0.0]
    assert (nothing.added, nothing.leaks, nothing.ponds) == ((), (), ())
    both = changes_of(
        [LateralInflow(), Leakage(), OutflowGainError(error=0.1), OutflowGainError(error=0.1),
         OutflowLag(lag=60.0), DiurnalInflow(), StorageAreaSlope(slope=0.2),
         GateHeadEffect(gain=0.1), SensorStep(step=0.1)],
        here,
    )  # fmt: skip
    assert both.inflow is None
    assert len(both.added) == 2 and len(both.leaks) == 1
    assert both.gate.factor == pytest.approx(np.full(here.time.shape, 1.21))
    assert (both.gate.lag == 60.0).all() and (both.gate.head == 0.1).all()
    assert (both.area_slope, both.area_reference, both.gate.reference) == (0.2, 128.5, 128.5)
    assert both.gauge.max() == 0.1


def test_the_whole_catalogue_acts_on_a_pool_together():
    here = world(2, days=3)
    readings = []
    for effects in ([], [one() for one in CATALOGUE.values()]):
        changes = changes_of(effects, here)
        level, *_ = pool_level(
            LinearReach(), here.time, here.inflow, np.full(here.time.shape, here.flow), 900.0,
            start=here.level, before=float(here.inflow[0]), changes=changes,
        )  # fmt: skip
        readings.append(level + changes.gauge)
    assert np.isfinite(readings[1]).all() and np.abs(readings[1] - readings[0]).max() > 0.05


def test_other_effects_change_no_draw():
    here = world(days=20)
    wind = changes_of([WindSetup()], here).gauge
    after = changes_of([LateralInflow(), RainInflow(), WindSetup()], here)
    assert after.gauge.tolist() == wind.tolist()


def test_two_of_a_kind_and_two_kinds_are_drawn_apart():
    here = world(days=20)
    twice = [one.events(seen) for one, seen in zip(
        [RainInflow()] * 2, worlds_of([RainInflow()] * 2, here), strict=True
    )]  # fmt: skip
    assert twice[0] and twice[1] and twice[0] != twice[1]
    swing = [Seiche(amplitude=0.1), WindSetup(deviation=0.1 / 2**0.5)]
    x, y = (one.changes(seen).gauge for one, seen in zip(swing, worlds_of(swing, here), strict=True))
    # shared innovations would be visible: independent ones have correlations of about 1 / sqrt(n)
    a, b = (one.autoregression(133.0)[0] for one in swing)
    e = x[2:] - a[0] * x[1:-1] - a[1] * x[:-2]
    f = y[2:] - b[0] * y[1:-1]
    n = len(e)
    for lag in (-2, -1, 0, 1, 2):
        apart = np.corrcoef(e[2 + lag : n - 2 + lag], f[2 : n - 2])[0, 1]
        assert abs(apart) < 4.5 / np.sqrt(n)
