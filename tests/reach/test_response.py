"""Test the reach against slow, independent integrations of (7), (8) and (10)."""

import numpy as np
import pytest

from rivid.core.hydraulics import travel_bounds
from rivid.errors import RividError
from rivid.reach import transport
from rivid.reach.changes import AddedFlow, Changes, Gate
from rivid.reach.integrator import LinearReach, pool_level, theoretical_fir
from rivid.reach.transport import (
    arrived_volume,
    delayed_flow,
    delayed_volume,
    held_volume,
    spread_flow,
)
from tests.reach.equations import difference_equation

T_S = 133.0
REACH = LinearReach()


def level_response(*given, **rest):
    return pool_level(*given, **rest)[0]


def came(time, flow, travel_time):
    """Return the volume at the dam of a flow, with a travel time for the departure of each sample."""
    return arrived_volume(time, np.maximum.accumulate(time + travel_time), held_volume(time, flow), 0.0)


def commands(seed, n=400):
    rng = np.random.default_rng(seed)
    return rng.integers(-40, 41, n).astype(float), rng.integers(-40, 41, n).astype(float)


def a_step(n, at, height=30.0):
    return np.where(np.arange(n) >= at, height, 0.0)


@pytest.mark.parametrize("delay", [1, 7])
def test_whole_delays_give_the_difference_equation(delay):
    inflow, outflow = commands(delay)
    reach = LinearReach(inflow_gain=0.9, outflow_gain=1.1)
    alpha = T_S / reach.surface_area
    continuous = level_response(reach, T_S * np.arange(400), inflow, outflow, delay * T_S)
    discrete = difference_equation(inflow, outflow, delay, 0.9 * alpha, 1.1 * alpha)
    np.testing.assert_allclose(continuous, discrete, rtol=0, atol=1e-12)


def test_fractional_delays_agree_with_second_by_second_integration():
    inflow, outflow = commands(1, 80)
    tau, fine = 941, np.arange(80 * 133)
    held_in = np.concatenate([np.zeros(tau), np.repeat(inflow, 133)])[: len(fine)]
    volume = np.concatenate([[0.0], np.cumsum(held_in - np.repeat(outflow, 133))])
    got = level_response(REACH, T_S * np.arange(80), inflow, outflow, float(tau))
    np.testing.assert_allclose(got, volume[:-1:133] / REACH.surface_area, atol=1e-12)


def test_uneven_steps_agree_with_second_by_second_integration():
    steps = np.array([133, 133, 83, 133, 133, 83, 133, 133])
    time = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    flow = np.arange(1.0, 9.0)
    fine = np.concatenate([np.zeros(200), np.repeat(flow, steps)])
    expected = np.concatenate([[0.0], np.cumsum(fine)])[time.astype(int)]
    np.testing.assert_allclose(came(time, flow, 200.0), expected, atol=1e-9)


def test_no_volume_is_lost_and_no_water_overtakes_when_the_travel_time_changes():
    time = T_S * np.arange(600)
    flow = np.where(time < 300 * T_S, 50.0, 0.0)
    travel = 900 + 300 * np.sin(time / 9000)
    assert came(time, flow, travel)[-1] == pytest.approx(50 * 300 * T_S, rel=1e-12)
    volume = came(time[:50], np.ones(50), np.where(np.arange(50) < 20, 2000.0, 100.0))
    assert (np.diff(volume) >= 0).all()
    assert volume[-1] == pytest.approx(time[49] - 100.0)


@pytest.mark.parametrize(("tau", "lag"), [(6.3, 7), (6.9, 7), (7.2, 8)])
def test_a_change_is_first_seen_at_the_sample_after_its_arrival(tau, lag):
    level = level_response(REACH, T_S * np.arange(40), a_step(40, 10), np.zeros(40), tau * T_S)
    assert np.flatnonzero(level)[0] == 10 + lag


def test_travel_time_is_the_gravity_wave_of_section_ii():
    flow = np.array([100.0, 300.0, 800.0])
    bounds = travel_bounds(flow, length=8200, width=81.6, depth=4.9)
    np.testing.assert_allclose(REACH.travel_time(flow), bounds.gravity, rtol=1e-12)


def test_theoretical_fir_is_the_loop_of_8_and_9():
    d, a_i, a_o, K_Q, K_h = 5, 1e-4, 1.3e-4, 0.9, -700.0
    inflow, level, outflow = np.eye(1, 30)[0], np.zeros(30), np.zeros(30)
    for k in range(30):
        level[k] = difference_equation(inflow[: k + 1], outflow[: k + 1], d, a_i, a_o)[k]
        outflow[k] = K_Q * inflow[k] - K_h * level[k]
    np.testing.assert_allclose(theoretical_fir(30, d, a_i, a_o, K_Q, K_h), level, atol=1e-17)


@pytest.mark.parametrize(("place", "first"), [(1.0, 11), (0.5, 14), (0.0, 17)])
def test_an_added_flow_travels_the_rest_of_the_reach(place, first):
    time = T_S * np.arange(60)
    changes = Changes(added=(AddedFlow(place, np.where(time >= 10 * T_S, 20.0, 0.0)),))
    level = level_response(REACH, time, np.zeros(60), np.zeros(60), 6.5 * T_S, changes=changes)
    assert np.flatnonzero(level)[0] == first
    assert level[-1] - level[-2] == pytest.approx(20 * T_S / REACH.surface_area)


def test_changes_act_on_the_flows_and_not_on_the_commands():
    time, (inflow, outflow) = T_S * np.arange(400), commands(5)
    kept = inflow.copy(), outflow.copy()
    changes = Changes(inflow=0.8 * inflow, gate=Gate(factor=1.0 + time / 1e5))
    changed, logged, _ = pool_level(REACH, time, inflow, outflow, 900.0, changes=changes)
    by_hand = level_response(REACH, time, 0.8 * inflow, outflow * (1.0 + time / 1e5), 900.0)
    np.testing.assert_allclose(changed, by_hand, atol=1e-12)
    np.testing.assert_array_equal(logged, outflow)
    np.testing.assert_array_equal((inflow, outflow), kept)


def test_a_volume_some_time_earlier_counts_the_first_flow_before_it():
    time = np.array([[0.0, 100.0, 150.0, 250.0]])
    flow = np.array([[2.0, 4.0, 1.0, 9.0]])
    assert delayed_volume(time, flow, 50.0).tolist() == [[-100.0, 100.0, 200.0, 450.0]]


@pytest.mark.parametrize("delay", [-5000.0, -133.0, 0.0, 40.0, 133.0, 399.0, 7000.0, 2e5])
def test_rows_of_one_grid_are_delayed_and_spread_as_row_by_row(delay):
    rng = np.random.default_rng(5)
    row = np.cumsum(rng.uniform(60.0, 200.0, 151))
    edges = row + 86_400.0 * np.arange(4)[:, None]
    flow = 300.0 + rng.normal(size=(4, 150)).cumsum(axis=1)
    apart = edges + np.cumsum(rng.uniform(0.0, 1e-3, edges.shape), axis=1)  # all rows differ
    np.testing.assert_allclose(delayed_flow(edges, flow, delay), delayed_flow(apart, flow, delay), atol=0.02)
    fine = np.linspace(edges[2, 0], edges[2, -1], 400_001)  # the mean of a sample is that of its instants
    late = flow[2, np.clip(np.searchsorted(edges[2], fine - delay, side="right") - 1, 0, 149)]
    sample = np.clip(np.searchsorted(edges[2], fine, side="right") - 1, 0, 149)
    means = np.bincount(sample, late) / np.bincount(sample)
    np.testing.assert_allclose(delayed_flow(edges, flow, delay)[2], means, atol=0.03)
    spread = abs(delay) % 997.0
    together, each = spread_flow(edges, flow, spread), spread_flow(apart, flow, spread)
    np.testing.assert_allclose(together, each, atol=0.02)


@pytest.mark.parametrize("spread", [20.0, 900.0, 20_000.0])
def test_a_long_row_is_spread_in_parts(monkeypatch, spread):
    rng = np.random.default_rng(6)
    edges = np.cumsum(rng.uniform(60.0, 200.0, 1001))
    flow = 300.0 + rng.normal(size=(2, 1000)).cumsum(axis=1)
    parts = spread_flow(edges, flow, spread)
    monkeypatch.setattr(transport, "TOGETHER", 1000)
    np.testing.assert_allclose(parts, spread_flow(edges, flow, spread), atol=1e-9)


def test_a_real_inflow_that_is_no_number_is_refused():
    time, flow = 133.0 * np.arange(3), np.full(3, 300.0)
    changes = Changes(inflow=np.array([300.0, np.nan, 300.0]))
    with pytest.raises(RividError, match="inflow is nan in sample 1: expected a number"):
        pool_level(REACH, time, flow, flow, 900.0, changes=changes)
