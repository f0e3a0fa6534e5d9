"""Test Saint-Venant against independent solutions: rest, mass, profiles, waves, dam break, box scheme."""

import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded
from scipy.optimize import brentq, fsolve

from rivid.core.hydraulics import GRAVITY
from rivid.reach.changes import AddedFlow, Changes
from rivid.reach.saint_venant import Channel, State, simulate

UNEVEN = {
    "side_slope": 1.5,
    "width_modes": (0.2, -0.1, 0.05),
    "bed_modes": (0.4, 0.2, -0.2),
    "manning_modes": (0.1, 0.1),
}
"""Modes of a reach with variable sections."""


def uneven(cells=32):
    return Channel.smooth(8200.0, 70.0, 1e-4, 0.028, cells, **UNEVEN)


def gate_volume(time, commands, gate_time, start):
    """Return the volume through a gate at each sample: the ramps as trapezia, by hand."""
    position, total = start, [0.0]
    for length, command in zip(np.diff(time), commands, strict=False):
        if gate_time <= length:
            total.append(total[-1] + 0.5 * (position + command) * gate_time + command * (length - gate_time))
            position = command
        else:
            reached = position + (command - position) * length / gate_time
            total.append(total[-1] + 0.5 * (position + reached) * length)
            position = reached
    return np.array(total)


@pytest.mark.long  # compiles the loops: 20 s
def test_the_process_that_compiles_computes_the_same_bits_as_later_ones(tmp_path):
    code = """if True:
        import numpy as np
        from rivid.reach.saint_venant import simulate
        from tests.reach.test_saint_venant import uneven
        flows = 300.0 + np.random.default_rng(0).integers(-40, 41, (2, 650))
        print(simulate(uneven(), 133.0 * np.arange(650), *flows, 5.0).level.tobytes().hex())
    """
    call = {"check": True, "capture_output": True, "env": {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}}
    first, second = (subprocess.run([sys.executable, "-c", code], **call).stdout for _ in range(2))
    assert first == second and len(first) > 650


def test_a_lake_at_rest_stays_at_rest_over_any_bed_and_width():
    rng = np.random.default_rng(0)
    rough = Channel(
        8200.0, rng.uniform(-1, 2, 40), rng.uniform(30, 120, 40), rng.uniform(0, 3, 40), np.full(40, 0.03)
    )
    time = 133.0 * np.arange(651)
    flow = simulate(rough, time, np.zeros(651), np.zeros(651), 5.0, places=(0.0, 0.3, 1.0))
    np.testing.assert_allclose(flow.levels, 5.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(flow.discharges, 0.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rough.level(flow.end.area[0]), 5.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("gate_time", [0.0, 200.0])
def test_the_volume_changes_by_what_dams_and_lateral_flows_bring_and_by_nothing_else(gate_time):
    rng = np.random.default_rng(1)
    time = np.concatenate([133.0 * np.arange(300), 133.0 * 300 + 47.0 + 133.0 * np.arange(300)])
    inflow, outflow = (300.0 + rng.integers(-40, 41, 600) for _ in range(2))
    rain = rng.uniform(0, 5, 600)
    side = AddedFlow(0.37, rain)
    flow = simulate(uneven(), time, inflow, outflow, 5.0, changes=Changes(added=(side,)), gate_time=gate_time)
    brought = gate_volume(time, inflow, gate_time, inflow[0]) - gate_volume(
        time, outflow, gate_time, outflow[0]
    )
    brought += np.concatenate([[0.0], np.cumsum(rain[:-1] * np.diff(time))])
    np.testing.assert_allclose(flow.volume - flow.volume[0], brought, rtol=0, atol=1e-12 * flow.volume[0])
    assert np.ptp(brought) > 1e4
    channel = uneven()
    assert flow.volume[-1] == pytest.approx(flow.end.area.sum() * channel.dx, rel=1e-14)


@pytest.mark.parametrize("discharge", [60.0, 700.0])
def test_the_start_does_not_drift(discharge):
    time = 133.0 * np.arange(651)
    steady = np.full(651, discharge)
    side = AddedFlow(0.5, np.full(1, 7.0))
    flow = simulate(
        uneven(), time, steady, steady + 7.0, 5.0, changes=Changes(added=(side,)), places=(0.0, 0.5)
    )
    np.testing.assert_allclose(flow.level, 5.0, rtol=0, atol=1e-9)
    assert np.ptp(flow.levels, axis=0).max() < 1e-9
    np.testing.assert_allclose(flow.discharges[:, 0], discharge, rtol=0, atol=1e-6)


def test_commands_that_differ_start_an_even_rise_without_a_wave():
    channel = Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 32)
    time = 133.0 * np.arange(28)
    flow = simulate(channel, time, np.full(28, 310.0), np.full(28, 300.0), 5.0)
    rise = np.diff(flow.level)
    assert rise[0] == pytest.approx(10.0 * 133.0 / channel.surface_area(5.0), rel=0.02)
    assert np.abs(np.diff(rise)).max() < 1e-4
    step = simulate(channel, time, np.where(time < 1.0, 300.0, 310.0), np.full(28, 300.0), 5.0)
    assert np.abs(np.diff(np.diff(step.level))).max() > 1e-2  # a step of the inflow alone causes a wave


def test_the_steady_profile_is_the_backwater_curve_to_second_order():
    discharge, end, length = 500.0, 5.5, 8200.0
    fine = uneven(4000)
    x = np.concatenate([[0.0], fine.x, [length]])

    def along(values):
        ends = 1.5 * values[[0, -1]] - 0.5 * values[[1, -2]]
        return np.concatenate([ends[:1], values, ends[1:]])

    bed, width, n = along(fine.bed), along(fine.bottom_width), along(fine.manning)
    fall, widening = np.gradient(bed, x), np.gradient(width, x)
    m = UNEVEN["side_slope"]

    def backwater(at, level):
        """Solve d(Q^2 / A)/dx + g A dz/dx + g A S_f = 0 for dz/dx."""
        b, db, dbed = np.interp(at, x, width), np.interp(at, x, widening), np.interp(at, x, fall)
        h = level[0] - np.interp(at, x, bed)
        A, B, P = (b + m * h) * h, b + 2 * m * h, b + 2 * h * np.hypot(1, m)
        friction = np.interp(at, x, n) ** 2 * (discharge / A) ** 2 / (A / P) ** (4 / 3)
        F2 = discharge**2 * B / (GRAVITY * A**3)
        return [(-friction - F2 * dbed + F2 * db * h / B) / (1 - F2)]

    places = np.linspace(0, 1, 21)
    curve = solve_ivp(backwater, (length, 0.0), [end], rtol=1e-9, atol=1e-10, t_eval=length * places[::-1])
    truth = curve.y[0][::-1]
    assert truth[0] - truth[-1] > 0.5
    errors = []
    for cells in (25, 50, 100):
        commands = [discharge, discharge]
        flow = simulate(uneven(cells), [0.0, 1.0], commands, commands, end, places=places)
        errors.append(np.abs(flow.levels[0] - truth).max())
    assert errors[0] < 0.02
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.7).all(), (errors, orders)


@pytest.mark.parametrize(("side_slope", "discharge"), [(0.0, 0.0), (0.0, 500.0), (2.0, 500.0)])
def test_a_small_wave_runs_at_its_celerity(side_slope, discharge):
    channel = Channel.smooth(8200.0, 80.0, 0.0, 0.0, 300, side_slope=side_slope)
    time = 2.0 * np.arange(500)
    inflow = np.where(time < 10.0, discharge, discharge + 1.0)
    flow = simulate(channel, time, inflow, np.full(500, discharge), 5.0, places=(0.2, 0.8), gate_time=60.0)
    rise = flow.levels - flow.levels[0]
    plateau = rise[np.argmax(rise[:, 1] > 0.9 * rise[:, 1].max()), 1]
    arrivals = []
    for r in rise.T:
        front = slice(0, np.argmax(r > 0.9 * plateau) + 1)
        arrivals.append(np.interp(0.5 * plateau, r[front], time[front]))
    A, B = (80.0 + 5.0 * side_slope) * 5.0, 80.0 + 10.0 * side_slope
    celerity = discharge / A + np.sqrt(GRAVITY * A / B)
    assert 0.6 * 8200.0 / (arrivals[1] - arrivals[0]) == pytest.approx(celerity, rel=0.02)


def stoker(x, t, high, low):
    """Return the depths of a dam break over a wet, flat, frictionless bed (Stoker 1957)."""
    c = np.sqrt(GRAVITY * high)

    def mismatch(h):
        u = 2 * (c - np.sqrt(GRAVITY * h))
        return u - (h - low) * np.sqrt(0.5 * GRAVITY * (h + low) / (h * low))

    middle = brentq(mismatch, low, high)
    u = 2 * (c - np.sqrt(GRAVITY * middle))
    shock = middle * u / (middle - low)
    fan = (2 * c - x / t) ** 2 / (9 * GRAVITY)
    tail = (u - np.sqrt(GRAVITY * middle)) * t
    return np.select([x < -c * t, x < tail, x < shock * t], [high, fan, middle], low)


def test_a_dam_break_takes_stokers_shape():
    errors = []
    for cells in (100, 200, 400):
        channel = Channel.smooth(4000.0, 50.0, 0.0, 0.0, cells)
        area = 50.0 * np.where(channel.x < 2000.0, 5.0, 2.0)[None]
        still = State(
            area, np.zeros((1, 2, cells + 1)), np.zeros((1, 2)), *np.zeros((2, 1, 3)), np.zeros((1, 0))
        )
        flow = simulate(channel, [0.0, 180.0], [0.0, 0.0], [0.0, 0.0], still, courant=0.4)
        depth = flow.end.area[0] / 50.0
        errors.append(np.abs(depth - stoker(channel.x - 2000.0, 180.0, 5.0, 2.0)).mean())
        assert depth.max() < 5.05 and depth.min() > 1.95
        assert flow.volume[1] == pytest.approx(flow.volume[0], rel=1e-14)
    assert errors[0] < 0.03
    assert errors[1] < 0.6 * errors[0] and errors[2] < 0.6 * errors[1], errors


@pytest.mark.parametrize(("cells_a_wave", "off"), [(5, 2e-3), (8, 4e-3), (20, 1e-3)])
def test_standing_waves_swing_in_their_time(cells_a_wave, off):
    """The reach is between two closed gates, without friction. Leapfrog is 5.9, 2.4 and 0.3 % too slow."""
    length, cells = 4000.0, 40
    waves = cells // cells_a_wave
    channel = Channel.smooth(length, 50.0, 0.0, 0.0, cells)
    height = 1e-4 * np.cos(2.0 * np.pi * waves * channel.x / length)
    flows = np.zeros((1, 2, cells + 1)), np.zeros((1, 2)), *np.zeros((2, 1, 3)), np.zeros((1, 0))
    omega = 2.0 * np.pi * waves / length * np.sqrt(GRAVITY * 5.0)
    time = np.arange(400) * (2.0 * np.pi / omega / 16.0)
    still = np.zeros(len(time))
    level = simulate(channel, time, still, still, State(50.0 * (5.0 + height)[None], *flows)).level - 5.0

    def left(w):
        columns = np.stack([np.cos(w * time), np.sin(w * time)])
        return np.linalg.lstsq(columns.T, level)[1][0]

    tried = omega * np.linspace(0.9, 1.1, 2001)
    assert tried[np.argmin([left(w) for w in tried])] == pytest.approx(omega, rel=off)


def box_scheme(inflow, outflow, start, until, step=20.0, boxes=200):
    """Return the level at x = L at each step by Preissmann's implicit box scheme, centred in time and space.

    Levels and discharges are at the same nodes; both equations hold in the middle of each box.
    """
    s = np.linspace(0.0, 1.0, boxes + 1)
    dx = 8200.0 / boxes

    def along(name, s):
        return sum(a * np.cos((j + 1) * np.pi * s) for j, a in enumerate(UNEVEN[name]))

    middles = (np.arange(4000) + 0.5) / 4000
    b = 70.0 * np.exp(along("width_modes", s)) / np.exp(along("width_modes", middles)).mean()
    bed = 0.82 * (1.0 - s) + along("bed_modes", s)
    n = 0.028 * np.exp(along("manning_modes", s))
    m = UNEVEN["side_slope"]

    def area(z):
        return (b + m * (z - bed)) * (z - bed)

    def momentum(z, Q):
        """Return all terms of dQ/dt in each box."""
        A = area(z)
        R = A / (b + 2.0 * (z - bed) * np.hypot(1.0, m))
        friction = GRAVITY * n**2 * Q * abs(Q) / (A * R ** (4 / 3))
        slope = GRAVITY * 0.5 * (A[1:] + A[:-1]) * np.diff(z) / dx
        return np.diff(Q**2 / A) / dx + slope + 0.5 * (friction[1:] + friction[:-1])

    steady = np.full(boxes + 1, inflow(0.0))
    z = fsolve(
        lambda z: np.append(momentum(z, steady), z[-1] - start),
        np.full(boxes + 1, start),
        xtol=1e-13,
        band=(1, 1),
    )
    state = np.stack([z, steady], axis=1).ravel()
    levels = [z[-1]]
    for t in step * np.arange(1, round(until / step) + 1):
        z_0, Q_0 = state[::2].copy(), state[1::2].copy()
        A_0, held = area(z_0), momentum(z_0, Q_0)

        def residual(state, t=t, Q_0=Q_0, A_0=A_0, held=held):
            z, Q = state[::2], state[1::2]
            grown, pushed = area(z) - A_0, Q - Q_0
            found = np.empty(len(state))
            found[0], found[-1] = Q[0] - inflow(t), Q[-1] - outflow(t)
            found[1:-1:2] = 0.5 * (grown[1:] + grown[:-1]) / step + 0.5 * np.diff(Q + Q_0) / dx
            found[2:-1:2] = 0.5 * (pushed[1:] + pushed[:-1]) / step + 0.5 * (momentum(z, Q) + held)
            return found

        for iteration in range(4):
            at = residual(state)
            if iteration == 0:  # the Jacobian changes little within a step
                bands = np.zeros((7, len(state)))
            for colour in range(7 if iteration == 0 else 0):  # columns seven apart have no common row
                moved = state.copy()
                moved[colour::7] += 1e-6
                change = (residual(moved) - at) / 1e-6
                for offset in range(-3, 4):
                    columns = np.arange(colour, len(state), 7)
                    columns = columns[(columns + offset >= 0) & (columns + offset < len(state))]
                    bands[3 + offset, columns] = change[columns + offset]
            state = state - solve_banded((3, 3), bands, at)
        levels.append(state[-2])
    return np.array(levels)


def test_an_unsteady_flow_agrees_with_the_implicit_box_scheme():
    def inflow(t):
        return 350.0 + 150.0 * np.sin(np.pi * t / 10_000.0) ** 2

    def outflow(t):
        return 350.0 + 100.0 * np.sin(np.pi * np.maximum(t - 2000.0, 0.0) / 9000.0) ** 2

    time = 20.0 * np.arange(601)
    truth = box_scheme(inflow, outflow, 5.0, time[-1])
    assert np.ptp(truth) > 0.5
    errors = []
    for cells in (25, 50):
        # with commands a sample early and gates that always move, the flows follow the curves
        start = simulate(uneven(cells), time[:1], [350.0], [350.0], 5.0).end
        flow = simulate(uneven(cells), time, inflow(time + 20.0), outflow(time + 20.0), start, gate_time=20.0)
        errors.append(np.abs(flow.level - truth).max())
    assert errors[0] < 0.01
    assert np.log2(errors[0] / errors[1]) > 1.8, errors


@pytest.mark.parametrize("place", [None, 0.61])
def test_halving_cells_and_steps_quarters_the_error_of_an_unsteady_flow(place):
    time = 20.0 * np.arange(1440)  # gate ramps of 20 s give a smooth flow at every step size
    inflow = 350.0 + 100.0 * np.sin(2 * np.pi * time / 7200.0) ** 3
    outflow = 350.0 + 60.0 * np.sin(2 * np.pi * time / 9000.0) ** 3
    side = () if place is None else (AddedFlow(place, 20.0 * np.sin(2 * np.pi * time / 6000.0) ** 2),)
    runs = [
        simulate(
            uneven(cells), time, inflow, outflow, 5.0,
            places=np.linspace(0, 1, 9), changes=Changes(added=side), gate_time=20.0, step=480.0 / cells,
        )
        for cells in (24, 48, 96)
    ]  # fmt: skip
    kinds = [[r.level for r in runs]]
    if place is None:  # the flow has a jump at a lateral inflow
        kinds += [[r.levels for r in runs], [r.discharges for r in runs]]
    for values in kinds:
        apart = [np.sqrt(np.mean((b - a) ** 2)) for a, b in zip(values, values[1:], strict=False)]
        orders = np.log2(np.array(apart[:-1]) / apart[1:])
        assert (orders > 1.9).all(), (apart, orders)
