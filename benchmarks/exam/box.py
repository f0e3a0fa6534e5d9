"""Solve Saint-Venant by an implicit box scheme in compound sections, without the hydraulics of `rivid.reach`.

The scheme is Preissmann's. Levels z and discharges Q are at the nodes, both at the same times. A box of
length dx and time step dt has the weight `THETA` in time and one half in space. A section is a main channel
with sloping banks and, above the bankfull depth, a floodplain; the conveyances of the two add. Newton's steps
are solved by a double sweep, since the discharge is given at both ends.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.reach.gate import (
    FLOW,
    GATE,
    MEMORY,
    NO_OPERATORS,
    POSITION,
    TARGET,
    ExchangeArrays,
    GateArrays,
    OperatorArrays,
    exchange_arrays,
    gate_arrays,
    gate_flow,
    operate,
    pond_flow,
    start_operators,
)
from rivid.types import Floats

G = 9.80665
THETA = 0.505
"""Weight of the new time level: 0.5 is of second order and oscillates, 1 is dissipative."""
STEADY = 40
"""Fixed-point iterations of the steady momentum equation of a box. Each one gains a digit or more."""
NEWTON, ENOUGH = 4, 1e-6
"""Largest number of Newton steps in a time step, and the largest level change [m] after which they stop. The
next change would be of the order of its square."""


class Nodes(NamedTuple):
    """Sections at the nodes; arrays of shape (nodes,)."""

    bed: Floats  # [m]
    bottom: Floats  # width of the main channel's bottom [m]
    bank: Floats  # run of its banks for each metre up [-]
    bankfull: Floats  # depth from which the floodplain is flooded [m]
    plain: Floats  # width of the floodplain [m]
    manning: Floats  # [s/m^(1/3)]
    usual: Floats  # depth above which the surface grows in addition to the section [m]
    growth: Floats  # additional growth of the surface width [m per metre of level]


@njit(cache=True, error_model="numpy")
def section(h: float, n: Nodes, i: int) -> tuple[float, float, float, float]:
    """Return area, surface width, conveyance and its derivative by the depth h of node i."""
    b, s, hb, f, m = n.bottom[i], n.bank[i], n.bankfull[i], n.plain[i], n.manning[i]
    slant = 2.0 * np.sqrt(1.0 + s * s)
    A, B, P = (b + s * h) * h, b + 2.0 * s * h, b + slant * h
    more, y = n.growth[i], h - n.usual[i]
    A, B = A + 0.5 * more * y * y, B + more * y
    K = A * (A / P) ** (2.0 / 3.0) / m
    dK = K * (5.0 / 3.0 * B / A - 2.0 / 3.0 * slant / P)
    over = h - hb
    if over > 0.0 and f > 0.0:  # Manning's coefficient is larger by half on overgrown land
        Kf = f * over ** (5.0 / 3.0) / (1.5 * m)
        return A + f * over, B + f, K + Kf, dK + 5.0 / 3.0 * Kf / over
    return A, B, K, dK


@njit(cache=True, error_model="numpy")
def step(
    z: Floats, Q: Floats, up: float, down: float, q: Floats, dt: float, dx: float, n: Nodes, work: Floats,
    theta: float,
) -> bool:  # fmt: skip
    """Advance z and Q (nodes,) in place by one time step; q (nodes - 1,) enters each box [m2/s].

    `up` and `down` are the discharges at the ends at the new time. Return False if a node runs dry or the
    iteration diverges.
    """
    nodes = len(z)
    z0, Q0, A0, M0, K0 = work[0], work[1], work[2], work[3], work[4]
    E, F, R, S, T = work[5], work[6], work[7], work[8], work[9]
    z0[:], Q0[:] = z, Q
    for i in range(nodes):
        if not z[i] > n.bed[i]:
            return False
        A, _, K, _ = section(z[i] - n.bed[i], n, i)
        A0[i], M0[i], K0[i] = A, Q[i] * Q[i] / A, K
    for _ in range(NEWTON):
        E[0], F[0] = 0.0, up - Q[0]  # dQ_i = E_i dz_i + F_i
        if not z[0] > n.bed[0]:
            return False
        Ai, Bi, Ki, dKi = section(z[0] - n.bed[0], n, 0)
        for j in range(nodes - 1):
            i, k = j, j + 1
            if not z[k] > n.bed[k]:
                return False
            Ak, Bk, Kk, dKk = section(z[k] - n.bed[k], n, k)
            # continuity
            r1 = 0.5 * (Ai + Ak - A0[i] - A0[k]) / dt
            r1 += (theta * (Q[k] - Q[i]) + (1.0 - theta) * (Q0[k] - Q0[i])) / dx - q[j]
            a1, b1, c1, d1 = 0.5 * Bi / dt, -theta / dx, 0.5 * Bk / dt, theta / dx
            # momentum
            Am = 0.5 * (theta * (Ai + Ak) + (1.0 - theta) * (A0[i] + A0[k]))
            slope = (theta * (z[k] - z[i]) + (1.0 - theta) * (z0[k] - z0[i])) / dx
            fi, fk = Q[i] * abs(Q[i]) / (Ki * Ki), Q[k] * abs(Q[k]) / (Kk * Kk)
            old = Q0[i] * abs(Q0[i]) / (K0[i] * K0[i]) + Q0[k] * abs(Q0[k]) / (K0[k] * K0[k])
            drag = 0.5 * (theta * (fi + fk) + (1.0 - theta) * old)
            Mi, Mk = Q[i] * Q[i] / Ai, Q[k] * Q[k] / Ak
            r2 = 0.5 * (Q[i] + Q[k] - Q0[i] - Q0[k]) / dt
            r2 += (theta * (Mk - Mi) + (1.0 - theta) * (M0[k] - M0[i])) / dx + G * Am * (slope + drag)
            a2 = theta * Mi * Bi / Ai / dx + G * 0.5 * theta * Bi * (slope + drag)
            a2 += G * Am * theta * (-1.0 / dx - fi * dKi / Ki)
            c2 = -theta * Mk * Bk / Ak / dx + G * 0.5 * theta * Bk * (slope + drag)
            c2 += G * Am * theta * (1.0 / dx - fk * dKk / Kk)
            b2 = 0.5 / dt - theta * 2.0 * Q[i] / Ai / dx + G * Am * theta * abs(Q[i]) / (Ki * Ki)
            d2 = 0.5 / dt + theta * 2.0 * Q[k] / Ak / dx + G * Am * theta * abs(Q[k]) / (Kk * Kk)
            # eliminate dQ_i from both equations, dz_i by continuity, dQ_k by momentum
            e1, e2 = a1 + b1 * E[i], a2 + b2 * E[i]
            r1, r2 = -r1 - b1 * F[i], -r2 - b2 * F[i]
            R[j], S[j], T[j] = r1 / e1, -c1 / e1, -d1 / e1  # dz_i = R + S dz_k + T dQ_k
            den = d2 + e2 * T[j]
            E[k], F[k] = -(c2 + e2 * S[j]) / den, (r2 - e2 * R[j]) / den
            Ai, Bi, Ki, dKi = Ak, Bk, Kk, dKk
        dQ = down - Q[nodes - 1]
        dz = (dQ - F[nodes - 1]) / E[nodes - 1]
        most = abs(dz)
        for k in range(nodes - 1, -1, -1):
            z[k] += dz
            Q[k] += dQ
            if k > 0:
                dz = R[k - 1] + S[k - 1] * dz + T[k - 1] * dQ
                dQ = E[k - 1] * dz + F[k - 1]
                most = max(most, abs(dz))
        if not most < 1e3:
            return False
        if most < ENOUGH:
            break
    return True


@njit(cache=True, error_model="numpy")
def steady(level: float, flow: float, dx: float, n: Nodes, z: Floats) -> bool:
    """Write the levels (nodes,) of a steady flow [m3/s] with a given level [m] at the lower end.

    Return False if a node runs dry.
    """
    z[:] = level
    for i in range(len(z) - 2, -1, -1):
        k = i + 1
        if not z[k] > n.bed[k]:
            return False
        Ak, _, Kk, _ = section(z[k] - n.bed[k], n, k)
        z[i] = max(z[k], n.bed[i] + 0.1)
        for _ in range(STEADY):
            Ai, _, Ki, _ = section(z[i] - n.bed[i], n, i)
            drag = 0.5 * flow * flow * (1.0 / (Ki * Ki) + 1.0 / (Kk * Kk))
            rise = dx * drag + 2.0 * flow * flow * (1.0 / Ak - 1.0 / Ai) / (G * (Ai + Ak))
            z[i] = max(z[k] + rise, n.bed[i] + 0.1)
    return True


@njit(cache=True, error_model="numpy")
def run(
    time: Floats, inflow: Floats, outflow: Floats, sides: Floats, share: Floats, gate: GateArrays,
    exchange: ExchangeArrays, leak_box: NDArray[np.int64], pond_box: NDArray[np.int64],
    operators: OperatorArrays,
    nodes: Nodes, dx: float, gate_time: float, z: Floats, level: Floats, released: Floats,
    theta: float, longest: float,
) -> int:  # fmt: skip
    """Simulate all samples and write the operators' outflow; return the sample that failed, or -1."""
    n, boxes = len(time), len(nodes.bed) - 1
    Q, q, work = np.full(boxes + 1, inflow[0]), np.zeros(boxes), np.empty((10, boxes + 1))
    memory, state = np.empty(MEMORY), np.empty(GATE)
    commanded = len(operators.inflow) > 0
    if commanded:
        start_operators(operators, time[0], memory)
    if not steady(z[boxes], inflow[0], dx, nodes, z):
        return 0
    ponds = np.array([z[b] for b in pond_box])
    up = down = inflow[0]
    for k in range(n):
        level[k] = z[boxes]
        if commanded:
            outflow[k] = operate(operators, k, time[k], level[k], memory)
        if k == 0:
            state[TARGET] = state[POSITION] = state[FLOW] = outflow[0]
        if k == n - 1:
            released[k] = released[k - 1]
            return -1
        interval = time[k + 1] - time[k]
        released[k] = gate_flow(gate, 0, k, outflow[k], level[k], interval, state)
        q[:] = 0.0
        for j in range(len(share)):
            q += share[j] * sides[j, k] / dx
        for j in range(len(leak_box)):
            b = leak_box[j]
            q[b] -= exchange.loss[j, 0, k] * (0.5 * (z[b] + z[b + 1]) - exchange.reference[j]) / dx
        for j in range(len(pond_box)):
            b = pond_box[j]
            into = pond_flow(z[b], ponds[j], exchange.exchange[j, 0, k], exchange.area[j], interval)
            ponds[j] += into * interval / exchange.area[j]
            q[b] -= into / dx
        many = int(np.ceil(interval / longest - 1e-9))
        dt, from_up, from_down = interval / many, up, down
        for m in range(many):
            way = min(1.0, (m + 1) * dt / gate_time) if gate_time > 0.0 else 1.0
            up = from_up + way * (inflow[k] - from_up)
            down = from_down + way * (released[k] - from_down)
            if not step(z, Q, up, down, q, dt, dx, nodes, work, theta):
                return k
    return -1


@dataclass(frozen=True, eq=False)
class Box:
    """A reach of boxes.

    The time step is the time in which the usual wave crosses a box: the scheme then moves small waves
    exactly. With half of it, waves with a length of a few boxes are too fast.
    """

    length: float
    nodes: Nodes
    gate_time: float
    longest: float  # time step [s]
    theta: float = THETA

    def arrival(self, flow: float, level: float) -> float:
        """Return the travel time [s] of a small wave on a steady flow [m3/s] with a level [m] at its end."""
        n, dx = self.nodes, self.length / (len(self.nodes.bed) - 1)
        z = np.empty(len(n.bed))
        steady(level, flow, dx, n, z)
        A, B = np.array([section(h, n, i)[:2] for i, h in enumerate(z - n.bed)]).T
        slow = 1.0 / (flow / A + np.sqrt(G * A / B))
        return float(dx * 0.5 * (slow[1:] + slow[:-1]).sum())

    def simulate(
        self,
        time: Floats,
        inflow: Floats,
        outflow: Floats | OperatorArrays,
        start: float,
        changes: Changes,
    ) -> tuple[Floats, Floats, Floats]:
        """Return level [m], outflow commands and flow through the gate [m3/s], shape (n,) each.

        Raises
        ------
        RividError
            If a node runs dry or the iteration diverges.
        """
        n, boxes = len(time), len(self.nodes.bed) - 1
        operators = outflow if isinstance(outflow, OperatorArrays) else NO_OPERATORS
        given = inflow.copy() if isinstance(outflow, OperatorArrays) else np.array(outflow, float)
        real = inflow if changes.inflow is None else np.asarray(changes.inflow, float)

        def box(place: float) -> int:
            return min(int(place * boxes), boxes - 1)

        share = np.zeros((len(changes.added), boxes))
        for row, extra in zip(share, changes.added, strict=True):
            row[box(extra.place)] = 1.0
        sides = np.array([np.broadcast_to(extra.flow, (n,)) for extra in changes.added]).reshape(-1, n)
        nodes = self.nodes
        if changes.area_slope:
            depth = changes.area_reference - nodes.bed
            width = np.array([section(h, nodes, i)[1] for i, h in enumerate(depth)])
            nodes = nodes._replace(usual=depth, growth=changes.area_slope * width)
        level, released = np.empty(n), np.empty(n)
        failed = run(
            time, np.ascontiguousarray(real), given, sides, share, gate_arrays(changes, (1, n)),
            exchange_arrays(changes, (1, n)), np.array([box(a.place) for a in changes.leaks], np.int64),
            np.array([box(a.place) for a in changes.ponds], np.int64),
            operators, nodes, self.length / boxes, self.gate_time,
            np.full(boxes + 1, float(start)), level, released, self.theta, self.longest,
        )  # fmt: skip
        if failed >= 0:
            raise RividError(f"the boxes run dry or blow up at {time[failed]:g} s")
        return level, given, released
