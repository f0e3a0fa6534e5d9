"""Compiled loops of Saint-Venant (1): the flow in time, and the steady flow that it starts from.

Importing this module loads numba.

Continuity and momentum (1), for any section, without further terms for slope and width:

    dA/dt + dQ/dx = q
    dQ/dt + d(Q^2 / A)/dx + g A dz/dx + g n^2 Q |Q| / (A R^(4/3)) = 0

Areas A stand in the cells at whole time steps, discharges Q on the faces between cells at half steps
(leapfrog): all differences are centred, and a volume changes by what passes its faces and nothing else.
Q on the faces at a whole step is extrapolated from the last two half steps; the momentum flux Q^2 / A is
taken in the cells, Q there from a quadratic that leans upwind. Friction is implicit: Q |Q| is the product
of the new and the old Q, which is second order since they stand half a step on either side.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rivid.core.hydraulics import GRAVITY
from rivid.reach.gate import (
    FLOW,
    MEMORY,
    POSITION,
    TARGET,
    ExchangeArrays,
    GateArrays,
    OperatorArrays,
    gate_flow,
    operate,
    pond_flow,
    start_operators,
)
from rivid.reach.saint_venant.channel import COURANT_LIMIT as LIMIT
from rivid.reach.saint_venant.channel import Sections
from rivid.types import Floats

OK, DRY, UNSTABLE = 0, 1, 2
"""How a day ended."""
MAX_STEPS = 100_000
"""More steps between two samples than this only a flow that blows up asks for."""


@njit(cache=True, error_model="numpy")
def wave_speed(A: Floats, Q: Floats, c: Sections) -> float:
    """Largest |v| + sqrt(g A / B) in the reach [m/s]; NaN where a cell is not wet."""
    fastest = 0.0
    for i in range(len(A)):
        B = np.sqrt(c.b[i] * c.b[i] + 4.0 * c.s[i] * (A[i] - c.a[i]))  # width of the surface
        speed = abs(0.5 * (Q[i] + Q[i + 1])) / A[i] + np.sqrt(GRAVITY * A[i] / B)
        if not speed <= fastest:
            fastest = speed
    return float(fastest)


@njit(cache=True, error_model="numpy")
def ramp(t: float, gate_time: float) -> float:
    """Integral from 0 to t of a gate's way from 0 to 1 [s]."""
    if t < gate_time:
        return 0.5 * t * t / gate_time
    return t - 0.5 * gate_time


@njit(cache=True, error_model="numpy")
def in_cell(Q: Floats, i: int) -> float:
    """Discharge in the middle of cell i, from a quadratic through two faces upstream and one downstream.

    `Q` has one face more at each end than the reach: straight extensions, so that no cell is special.
    """
    mean = 0.5 * (Q[i + 1] + Q[i + 2])
    bend_up = Q[i] - 2.0 * Q[i + 1] + Q[i + 2]
    bend_down = Q[i + 1] - 2.0 * Q[i + 2] + Q[i + 3]
    return float(mean - 0.125 * (bend_up if mean > 0.0 else bend_down))


@njit(cache=True, error_model="numpy")
def extend(Q: Floats) -> None:
    """Fill in the face beyond each end."""
    Q[0], Q[-1] = 2.0 * Q[1] - Q[2], 2.0 * Q[-2] - Q[-3]


@njit(cache=True, error_model="numpy")
def fluxes(A: Floats, Q: Floats, z: Floats, P: Floats, M: Floats, c: Sections) -> None:
    """Level z, wetted perimeter P and momentum flux M = Q^2 / A of each cell."""
    for i in range(len(A)):
        a = A[i] - c.a[i]
        h = 2.0 * a / (c.b[i] + np.sqrt(c.b[i] * c.b[i] + 4.0 * c.s[i] * a))
        z[i] = c.bed[i] + h
        P[i] = c.p[i] + c.w[i] * h
        q = in_cell(Q, i)
        M[i] = q * q / A[i]


@njit(cache=True, error_model="numpy")
def cube_roots(A: Floats, P: Floats, root: Floats) -> None:
    """R^(-1/3) on the inner faces, from the library: the slowest function of the loop, once a sample."""
    for i in range(1, len(A)):
        root[i] = np.cbrt((P[i - 1] + P[i]) / (A[i - 1] + A[i]))


@njit(cache=True, error_model="numpy")
def resistance(A: Floats, P: Floats, friction: Floats, root: Floats, K: Floats) -> None:
    """K = g n^2 / (A R^(4/3)) on the inner faces, R = A / P; `friction` is g n^2 there.

    The cube roots follow from those of the last step by two of Halley's steps: to rounding where 1 / R
    changes by less than a tenth from step to step, and three times as fast.
    """
    for i in range(1, len(A)):
        a = 0.5 * (A[i - 1] + A[i])
        r = 0.5 * (P[i - 1] + P[i]) / a
        y = root[i]
        y *= (y * y * y + 2.0 * r) / (2.0 * y * y * y + r)
        y *= (y * y * y + 2.0 * r) / (2.0 * y * y * y + r)
        root[i] = y
        K[i] = friction[i] / a * r * y


@njit(cache=True, error_model="numpy")
def level_at(z: Floats, share: Floats) -> float:
    """Level at a place between cells."""
    level = 0.0
    for i in range(len(z)):
        level += share[i] * z[i]
    return float(level)


@njit(cache=True, error_model="numpy", nogil=True)
def advance(
    time: Floats,
    inflow: Floats,
    outflow: Floats,
    lateral: Floats,
    share: Floats,
    gate: GateArrays,
    exchange: ExchangeArrays,
    leak_share: Floats,
    pond_share: Floats,
    operators: OperatorArrays,
    observed: Floats,
    nudge_time: float,
    sections: Sections,
    dx: float,
    gate_time: float,
    courant: float,
    longest: float,
    area: Floats,
    discharge: Floats,
    gates: Floats,
    clock: Floats,
    gate_state: Floats,
    ponds: Floats,
    at_cell: NDArray[np.int64],
    cell_weight: Floats,
    at_face: NDArray[np.int64],
    face_weight: Floats,
    level: Floats,
    released: Floats,
    levels: Floats,
    discharges: Floats,
    volume: Floats,
    nudge: Floats,
) -> tuple[int, int, int, int, float]:
    """Go through all days; arrays have a row per day; the state arrays and the last six are written.

    Where there are operators, `outflow` is written too. What leaks and ponds take follows the level at each
    sample and is held to the next.

    Returns
    -------
    how, day, sample, cell, value
        OK; or DRY and the cell; or UNSTABLE and the step that would do [s].
    """
    days, n = inflow.shape
    c = len(sections.bed)
    Qx = np.empty(c + 3)  # Q on the faces at the whole step, with one more face at each end
    z, P, M, K, root = np.empty(c), np.empty(c), np.empty(c), np.empty(c), np.empty(c)
    q, memory = np.empty(c), np.empty(MEMORY)
    commanded = len(operators.inflow) > 0
    for day in range(days):
        A, Q, Q_old = area[day], discharge[day, 0], discharge[day, 1]
        dt_1, dt_2, usual = clock[day, 0], clock[day, 1], clock[day, 2]
        fresh = usual == 0.0
        if fresh:
            usual = wave_speed(A, Q, sections)
            clock[day, 2] = usual
        if commanded:
            start_operators(operators, time[day, 0], memory)
        for k in range(n):
            ahead = dt_1 / (dt_1 + dt_2) if dt_1 > 0.0 else 0.0
            for i in range(1, c):
                Qx[i + 1] = Q[i] + ahead * (Q[i] - Q_old[i])
            Qx[1], Qx[c + 1] = gates[day, 0], gates[day, 1]
            extend(Qx)
            fluxes(A, Qx, z, P, M, sections)

            level[day, k] = 1.5 * z[c - 1] - 0.5 * z[c - 2]  # the gauge is at x = L
            for j in range(len(at_cell)):
                i, w = at_cell[j], cell_weight[j]
                levels[day, k, j] = (1.0 - w) * z[i] + w * z[i + 1]
                i, w = at_face[j], face_weight[j]
                discharges[day, k, j] = (1.0 - w) * Qx[i + 1] + w * Qx[i + 2]
            total = 0.0
            for i in range(c):
                total += A[i]
            volume[day, k] = total * dx
            rise = 0.0
            if nudge_time > 0.0 and np.isfinite(observed[day, k]):
                rise = (observed[day, k] - level[day, k]) / nudge_time
            nudge[day, k] = rise
            if commanded:
                outflow[day, k] = operate(operators, k, time[day, k], level[day, k], memory)
            if k == 0 and fresh:
                gate_state[day, TARGET] = gate_state[day, POSITION] = gate_state[day, FLOW] = outflow[day, 0]
                for j in range(len(pond_share)):
                    ponds[day, j] = level_at(z, pond_share[j])
            if k == n - 1:
                released[day, k] = released[day, k - 1] if n > 1 else outflow[day, k]
                break

            interval = time[day, k + 1] - time[day, k]
            speed = wave_speed(A, Qx[1:], sections)
            if not speed * interval / (LIMIT * dx) < MAX_STEPS:
                return UNSTABLE, day, k, 0, 0.0
            if longest > 0.0:
                steps = int(np.ceil(interval / longest * (1.0 - 1e-12)))
                if speed * interval > LIMIT * dx * steps:
                    return UNSTABLE, day, k, 0, LIMIT * dx / speed
            else:  # as many as at the start, so that small changes of the reach make small changes
                steps = int(np.ceil(usual * interval / (courant * dx)))
                steps = max(steps, int(np.ceil(speed * interval / (LIMIT * dx))))
            dt = interval / steps

            for i in range(c):
                q[i] = 0.0
                for j in range(len(share)):
                    q[i] += share[j, i] * lateral[j, day, k] / dx
            for j in range(len(leak_share)):
                above = level_at(z, leak_share[j]) - exchange.reference[j]
                for i in range(c):
                    q[i] -= leak_share[j, i] * exchange.loss[j, day, k] * above / dx
            for j in range(len(pond_share)):
                into = pond_flow(
                    level_at(z, pond_share[j]), ponds[day, j], exchange.exchange[j, day, k],
                    exchange.area[j], interval,
                )  # fmt: skip
                ponds[day, j] += into * interval / exchange.area[j]
                for i in range(c):
                    q[i] -= pond_share[j, i] * into / dx
            up, down = gates[day, 0], gates[day, 1]
            given = gate_flow(gate, day, k, outflow[day, k], level[day, k], interval, gate_state[day])
            released[day, k] = given
            to_up, to_down = inflow[day, k] - up, given - down
            cube_roots(A, P, root)
            moved = 0.0
            dry = 0
            for step in range(steps):
                if step > 0:
                    ahead = dt_1 / (dt_1 + dt_2) if dt_1 > 0.0 else 0.0
                    way = min(1.0, step * dt / gate_time) if gate_time > 0.0 else 1.0
                    for i in range(1, c):
                        Qx[i + 1] = Q[i] + ahead * (Q[i] - Q_old[i])
                    Qx[1], Qx[c + 1] = up + way * to_up, down + way * to_down
                    extend(Qx)
                    fluxes(A, Qx, z, P, M, sections)
                resistance(A, P, sections.friction, root, K)

                since = 0.5 * (dt_1 + dt)  # from half step to half step
                for i in range(1, c):  # momentum (1)
                    push = (M[i] - M[i - 1]) + GRAVITY * 0.5 * (A[i - 1] + A[i]) * (z[i] - z[i - 1])
                    old = Q[i]
                    Q[i] = (old - since / dx * push) / (1.0 + since * K[i] * abs(old))
                    Q_old[i] = old
                passed = ramp((step + 1) * dt, gate_time)
                Q[0] = up + to_up * (passed - moved) / dt  # the mean over the step
                Q[c] = down + to_down * (passed - moved) / dt
                moved = passed
                for i in range(c):  # continuity (1)
                    B = np.sqrt(sections.b[i] * sections.b[i] + 4.0 * sections.s[i] * (A[i] - sections.a[i]))
                    A[i] += dt * ((Q[i] - Q[i + 1]) / dx + q[i] + rise * B)
                    dry += not A[i] > 0.0
                dt_1, dt_2 = dt, dt_1
                if dry > 0:
                    for i in range(c):
                        if not A[i] > 0.0:
                            return DRY, day, k, i, A[i]
            way = min(1.0, interval / gate_time) if gate_time > 0.0 else 1.0
            gates[day, 0] = inflow[day, k] if way == 1.0 else up + way * to_up
            gates[day, 1] = given if way == 1.0 else down + way * to_down
        clock[day, 0], clock[day, 1] = dt_1, dt_2
    return OK, 0, 0, 0, 0.0


STEPS = 60
"""Newton steps before a profile is given up; five are usual."""


@njit(cache=True, error_model="numpy")
def section(z: float, c: Sections, i: int) -> tuple[float, float, float]:
    """Area, width of the surface and wetted perimeter of cell i at a level."""
    h = z - c.bed[i]
    return c.a[i] + (c.b[i] + c.s[i] * h) * h, c.b[i] + 2.0 * c.s[i] * h, c.p[i] + c.w[i] * h


@njit(cache=True, error_model="numpy")
def backwater(
    Q: Floats,
    q: Floats,
    z_end: float,
    sections: Sections,
    dx: float,
    z: Floats,
) -> bool:
    """Levels upstream of `z_end`, the level of the last cell, face by face; momentum (1) without d/dt.

    Parameters
    ----------
    Q, q : ndarray, shape (cells + 1,), (cells,)
        Discharge on the faces, and what the kernel takes for it in the cells [m3/s].

    Returns
    -------
    bool
        False where the flow would be dry or not subcritical.
    """
    bed, friction = sections.bed, sections.friction
    c = len(bed)
    z[c - 1] = z_end
    for i in range(c - 1, 0, -1):
        A_1, B_1, P_1 = section(z[i], sections, i)
        if not (A_1 > 0.0 and q[i] * q[i] * B_1 < GRAVITY * A_1**3):
            return False
        level = max(z[i], bed[i - 1] + 0.5 * (z[i] - bed[i]))
        small = False
        for _ in range(STEPS):
            A_0, B_0, P_0 = section(level, sections, i - 1)
            a, p = 0.5 * (A_0 + A_1), 0.5 * (P_0 + P_1)
            r = p / a
            drag = friction[i] * Q[i] * abs(Q[i]) / a * r * np.cbrt(r) * dx
            M_0 = q[i - 1] * q[i - 1] / A_0
            excess = q[i] * q[i] / A_1 - M_0 + GRAVITY * a * (z[i] - level) + drag
            widening = 0.5 * sections.w[i - 1]
            slope = M_0 * B_0 / A_0 + GRAVITY * (0.5 * B_0 * (z[i] - level) - a)
            slope += drag * (4.0 / 3.0 * widening / p - 7.0 / 6.0 * B_0 / a)
            if not slope < 0.0:  # beyond critical flow
                return False
            move = -excess / slope
            if level + move <= bed[i - 1]:  # never below the bed on the way
                move = 0.5 * (bed[i - 1] - level)
            level += move
            if small:  # one step more than needed: to rounding
                break
            small = abs(move) < 1e-9
        if not small:
            return False
        z[i - 1] = level
    return True


@njit(cache=True, error_model="numpy")
def settle(
    inflow: float,
    outflow: float,
    lateral: Floats,
    start: float,
    sections: Sections,
    dx: float,
    A: Floats,
    Q: Floats,
) -> bool:
    """Write A and Q of the steady flow with level `start` at x = L.

    Where inflow and outflow differ, the reach fills or empties at one rate everywhere: the flow that
    small differences settle to. `lateral` is the flow that enters each cell [m3/s].
    """
    c = len(sections.bed)
    z, q, padded = np.full(c, start), np.empty(c), np.empty(c + 3)
    gain = inflow - outflow + lateral.sum()
    for outer in range(STEPS):
        surface = 0.0
        for i in range(c):
            surface += section(z[i], sections, i)[1]
        Q[0] = inflow
        for i in range(c):
            Q[i + 1] = Q[i] + lateral[i] - gain * section(z[i], sections, i)[1] / surface
        Q[c] = outflow
        padded[1:-1] = Q
        extend(padded)
        for i in range(c):
            q[i] = in_cell(padded, i)
        end = z[c - 1]
        moved = 0.0
        for _ in range(STEPS):  # the last cell's level that puts the gauge at `start`
            if not backwater(Q, q, end, sections, dx, z):
                return False
            move = start - (1.5 * z[c - 1] - 0.5 * z[c - 2])
            moved += abs(move)
            end += move
            if abs(move) < 1e-13 * (1.0 + abs(start)):
                break
        if outer > 0 and moved < 1e-12 * (1.0 + abs(start)):
            break
    for i in range(c):
        A[i] = section(z[i], sections, i)[0]
    return True
