"""Test gate, leaks, ponds and area slope against second-by-second integration, in both kinds of reach."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rivid.errors import ConfigError, RividError
from rivid.reach.changes import NO_CHANGES, AddedFlow, Changes, Gate, Leak, Pond, together
from rivid.reach.gate import GATE, gate_arrays, gate_flow, pond_flow
from rivid.reach.integrator import LinearReach, pool_level
from rivid.reach.saint_venant import Channel, simulate

T_S, N = 133.0, 400
TIME = T_S * np.arange(N)
POOL = LinearReach()
CHANNEL = Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 24, side_slope=1.0)


def commands(seed, n=N):
    rng = np.random.default_rng(seed)
    moves = np.repeat(rng.integers(-25, 26, n // 8 + 1), 8)[:n]
    return 300.0 + moves, 300.0 + np.roll(moves, 7)


def through_gate(gate, command, level=130.0):
    arrays, state = gate_arrays(Changes(gate=gate), (1, len(command))), np.full(GATE, command[0])
    return np.array([gate_flow(arrays, 0, k, c, level, T_S, state) for k, c in enumerate(command)])


GATES = {
    "dead-band": Gate(dead_band=np.full(1, 12.0)),
    "lag": Gate(lag=np.full(1, 700.0)),
    "all": Gate(dead_band=np.full(1, 9.0), rate=np.full(1, 0.1), factor=np.full(1, 1.1)),
}


@pytest.mark.parametrize("gate", GATES.values(), ids=GATES)
def test_the_gates_flow_agrees_with_second_by_second_integration(gate):
    command, _ = commands(1, 40)
    target = position = flow = command[0]
    means = []
    for c in command:
        if abs(c - target) >= gate.dead_band[0]:
            target = c
        passed = []
        for _ in range(1330):  # tenths of a second
            position += np.clip(target - position, -0.1 * gate.rate[0], 0.1 * gate.rate[0])
            flow = position if gate.lag[0] == 0 else flow + 0.1 * (position - flow) / gate.lag[0]
            passed.append(flow)
        means.append(np.mean(passed) * gate.factor[0])
    np.testing.assert_allclose(through_gate(gate, command), means, atol=0.02)
    np.testing.assert_array_equal(through_gate(Gate(), command), command)


@pytest.mark.parametrize("off", [5.0, -11.0, 13.0])
def test_a_gate_starts_where_it_is_and_stays_while_the_command_is_near(off):
    inflow, outflow = commands(2)
    gate = Gate(dead_band=np.full(1, 12.0), start=np.full(1, outflow[0] + off))
    released = simulate(CHANNEL, TIME, inflow, outflow, 5.2, changes=Changes(gate=gate)).released
    at, expected = outflow[0] + off, []
    for command in outflow[:-1]:
        at = command if abs(command - at) >= 12.0 else at
        expected.append(at)
    np.testing.assert_allclose(released[:-1], expected)
    assert len(set(expected)) > 3 and (expected[0] == outflow[0]) == (abs(off) > 12.0)


def test_head_makes_the_flow_grow_with_the_level_and_a_pond_never_overshoots():
    gate = Gate(head=np.full(1, 0.2), reference=129.5)
    np.testing.assert_allclose(through_gate(gate, np.full(3, 100.0), 130.0), 110.0)
    assert pond_flow(130.0, 129.0, 1e6, 1e4, T_S) == pytest.approx(1e4 / T_S)
    assert pond_flow(130.0, 129.0, 50.0, 1e6, T_S) == pytest.approx(50.0, rel=0.01)


def test_the_pool_with_leak_pond_and_area_slope_agrees_with_a_stiff_integrator():
    changes = Changes(
        leaks=(Leak(0.5, np.full(1, 40.0), 129.9),), ponds=(Pond(0.3, 2e5, np.full(1, 80.0)),),
        gate=Gate(head=np.full(1, 0.05), reference=130.0), area_slope=0.4, area_reference=130.0,
    )  # fmt: skip
    time = 5.0 * np.arange(6000)  # short samples: flows that follow the level are held within a sample
    inflow = 300.0 + 30.0 * np.sin(time / 4000.0)
    outflow = np.full(len(time), 300.0)
    got = pool_level(POOL, time, inflow, outflow, 0.0, start=130.1, before=inflow[0], changes=changes)[0]

    def slopes(t, state):
        h, pond = state
        into = 80.0 * (h - pond)
        real = 300.0 * (1.0 + 0.05 * (h - 130.0))
        area = POOL.surface_area * (1.0 + 0.4 * (h - 130.0))
        return [(300.0 + 30.0 * np.sin(t / 4000.0) - real - 40.0 * (h - 129.9) - into) / area, into / 2e5]

    truth = solve_ivp(slopes, (0, time[-1]), [130.1, 130.1], t_eval=time, rtol=1e-10, atol=1e-12)
    assert np.ptp(truth.y[0]) > 0.1
    np.testing.assert_allclose(got, truth.y[0], atol=3e-4)


@pytest.mark.parametrize("slope", [0.0, 0.4])
def test_no_water_is_lost_between_reach_leak_pond_and_gate(slope):
    inflow, outflow = commands(4)
    leak, pond = Leak(0.7, np.full(1, 30.0), 4.9), Pond(0.4, 1.5e5, np.full(1, 60.0))
    gate = Gate(lag=np.full(1, 500.0), factor=np.full(1, 1.02))
    changes = Changes(leaks=(leak,), ponds=(pond,), gate=gate)
    channel = CHANNEL.with_area_slope(slope, 5.2)
    flow = simulate(channel, TIME, inflow, outflow, 5.2, changes=changes, places=(0.7, 0.4))
    lost = leak.loss[0] * (flow.levels[:-1, 0] - leak.reference) * T_S
    stored = flow.end.ponds[0, 0] - flow.levels[0, 1]
    balance = np.sum((inflow[:-1] - flow.released[:-1]) * T_S) - lost.sum() - stored * pond.area
    # gates move in 30 s: the remaining volume at the first and the last sample
    balance += 15.0 * ((inflow[0] - inflow[-2]) - (flow.released[0] - flow.released[-2]))
    balance += 15.0 * (flow.released[0] - outflow[0])
    assert abs(stored) > 0.01
    assert flow.volume[-1] - flow.volume[0] == pytest.approx(balance, abs=1e-3 * np.abs(lost).sum() + 50.0)


def test_area_slope_makes_the_surface_grow_with_the_level():
    sloped = CHANNEL.with_area_slope(0.3, 5.2)
    usual = CHANNEL.width(5.2)
    np.testing.assert_allclose(sloped.width(5.2), usual)
    np.testing.assert_allclose(sloped.width(5.7) - CHANNEL.width(5.7), 0.3 * usual * 0.5)
    np.testing.assert_allclose(sloped.area(5.2), CHANNEL.area(5.2))
    levels = np.array([4.6, 5.0, 5.2, 5.9])[:, None] * np.ones(24)
    np.testing.assert_allclose(sloped.level(sloped.area(levels)), levels, rtol=1e-12)
    fine = np.linspace(5.0, 5.9, 2001)[:, None]
    volume = np.trapezoid(sloped.width(fine), fine, axis=0)
    np.testing.assert_allclose(sloped.area(5.9) - sloped.area(5.0), volume, rtol=1e-9)
    assert CHANNEL.with_area_slope(0.0, 5.2) is CHANNEL
    still = np.zeros(N)
    flow = simulate(sloped, TIME, still, still, 5.6)
    np.testing.assert_allclose(flow.level, 5.6, atol=1e-11)


def test_changes_add_up():
    both = together([
        Changes(gate=Gate(lag=np.full(1, 100.0), factor=np.full(1, 1.1)), gauge=np.full(3, 0.1)),
        Changes(gate=Gate(lag=np.full(1, 50.0), factor=np.full(3, 1.2), rate=np.full(1, 2.0))),
        Changes(inflow=np.ones(3), area_slope=0.2, area_reference=130.0),
        Changes(gauge=np.full(3, 0.2), added=(AddedFlow(0.5, np.ones(3)),)),
    ])  # fmt: skip
    assert both.gate.lag.tolist() == [150.0] and both.gate.rate.tolist() == [2.0]
    np.testing.assert_allclose(both.gate.factor, 1.32)
    np.testing.assert_allclose(both.gauge, 0.3)
    assert both.area_slope == 0.2 and both.area_reference == 130.0 and len(both.added) == 1
    assert together([]).gate_is_plain and together([NO_CHANGES]).inflow is None


def test_changes_that_contradict_each_other_are_refused():
    with pytest.raises(RividError, match=r"refer to levels \[129.0, 130.0\]"):
        together([Changes(area_slope=0.1, area_reference=z) for z in (130.0, 129.0)])
    with pytest.raises(RividError, match="a pond of 0.0 m2"):
        Pond(0.5, 0.0, np.ones(1))
    with pytest.raises(RividError, match="a leak at place -0.1"):
        Leak(-0.1, np.ones(1), 0.0)
    with pytest.raises(RividError, match=r"the gate's lag has shape \(3,\): expected \(1, 400\)"):
        simulate(CHANNEL, TIME, *commands(1), 5.2, changes=Changes(gate=Gate(lag=np.ones(3))))
    with pytest.raises(ConfigError, match="area_reference = 0.5 m: expected a level above the bed"):
        simulate(CHANNEL.with_area_slope(0.3, 0.5), TIME, *commands(1), 5.2)
