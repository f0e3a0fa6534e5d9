"""Compiled loops of Saint-Venant (1): the flow in time, and the steady flow that it starts from.

Importing this module loads numba.

Continuity and momentum (1), for any section, without further terms for slope and width:

    dA/dt + dQ/dx = q
    dQ/dt + d(Q^2 / A)/dx + g A dz/dx + g n^2 Q |Q| / (A R^(4/3)) = 0

Areas A stand in the cells at whole time steps, discharges Q on the faces between cells at half steps
(leapfrog): all differences are centred, and a volume changes by what passes its faces and nothing else. What
fills a cell is corrected for the dispersion of the scheme, without which fronts come late and ripple.
Q on the faces at a whole step is extrapolated from the last two half steps; the momentum flux Q^2 / A is
taken in the cells, Q there from a quadratic that leans upwind. Friction is implicit: Q |Q| is the product
of the new and the old Q, which is second order since they stand half a step on either side.

Divisions and roots would take most of the time. They are computed at each sample, where the state is handed
on; the steps between correct them by short series in the relative change of the areas since, cut where they
are right to 1e-9. A step after which an area has changed by more computes all anew. The arrays of the loops
lie in one buffer at constant distances: the compiler then needs no test for overlap, which costs as much as
the arithmetic of a reach of some 30 cells.
"""

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from rivid.core.hydraulics import GRAVITY
from rivid.reach.gate import (
    MEMORY,
    ExchangeArrays,
    GateArrays,
    OperatorArrays,
    gate_flow,
    gate_start,
    operate,
    pond_flow,
    start_operators,
)
from rivid.reach.saint_venant.channel import COURANT_LIMIT as LIMIT
from rivid.reach.saint_venant.channel import MAX_CELLS, Sections
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.reach.saint_venant.flow import Flow

OK, DRY, UNSTABLE, UNSTEADY = 0, 1, 2, 3
"""How a day ended."""
MAX_STEPS = 100_000
"""More steps between two samples than this only a flow that blows up asks for."""
NUDGE_TIME = 1800.0
"""Time in which a nudge would close the gap between the observed level and the water's [s]."""


STRIDE = MAX_CELLS + 56
"""Distance of two arrays of the buffer; what exceeds a power of two spreads them over the cache."""
(
    A, Z, P, M,  # area, level, wetted perimeter, momentum flux Q^2 / A
    Q, Q_OLD, Q_X,  # discharge half a step ahead and behind; at the step, with one more face at each end
    SIDE, LIFT,  # flow that enters [m2/s]; a nudge's rise of a cell over that at x = L
    BED, A_0, B_0, S, P_0, W_P, FRICTION,  # the sections; 2 g n^2
    PER_A, B, Z_REF, Z_A, BEND, P_REF,  # at the last divide: 1 / A, B, z, A / B, s A / B^2, P
    K_REF, PER_A2, PER_P2,  # and on the faces: K, 1 / (A + A), 1 / (P + P) of the cells on either side
    RATE,  # dA/dt, before it is sharpened
    SCRATCH, FIELDS,
) = range(0, 28 * STRIDE, STRIDE)  # fmt: skip
CHANGE = 0.01
"""Largest relative change of an area that the series take."""
ONE, CENTRE = 0x3FF0000000000000, 0x0000CCCCCCCCCCCC
"""The bits of 1.0, and of a twentieth of an octave, which centres the errors of the first cube roots."""
FAST = {"reassoc", "contract", "arcp", "nsz", "afn"}
"""Freedoms of the compiler in the loops along the cells: NaN and infinity stay what they are.

These loops are inlined by force. Otherwise the process that compiles :func:`advance` calls another version of
them, rounded differently, than those that load it compiled, which can change the names of a diagnosis.
:func:`in_cell` has no freedom, as :func:`settle`, which is also called from outside, needs it.
"""


@njit(cache=True, error_model="numpy", fastmath=FAST, forceinline=True)
def divide(W: Floats, n: int) -> None:
    """All divisions and roots of the areas: level, perimeter, and what the series start from."""
    for i in range(n):
        area, b = W[A + i], W[B_0 + i]
        a = area - W[A_0 + i]
        width = np.sqrt(b * b + 4.0 * W[S + i] * a)
        per = 1.0 / (area * width * (b + width))  # one division for three
        h = 2.0 * a * per * area * width
        per_b = per * area * (b + width)
        W[PER_A + i], W[B + i], W[Z_A + i] = per * width * (b + width), width, area * per_b
        W[BEND + i] = W[S + i] * per_b * (area * per_b)
        W[Z_REF + i] = W[Z + i] = W[BED + i] + h
        W[P_REF + i] = W[P + i] = W[P_0 + i] + W[W_P + i] * h
    for i in range(1, n + 1):
        a, p = W[A + i - 1] + W[A + i], W[P + i - 1] + W[P + i]
        per = 1.0 / (a * p)
        W[PER_A2 + i], W[PER_P2 + i] = per * p, per * a
        W[K_REF + i] = p * (per * p)  # 1 / R
    bits = W.view(np.int64)
    for i in range(1, n + 1):  # (1 / R)^(-1/3) by a third of the exponent
        bits[SCRATCH + i] = ONE - CENTRE - np.int64((1.0 / 3.0) * (bits[K_REF + i] - ONE))
    for i in range(1, n + 1):
        r, y = W[K_REF + i], W[SCRATCH + i]
        for _ in range(2):
            e = 1.0 - r * (y * y) * y
            y += y * (e * ((1.0 / 3.0) + e * ((2.0 / 9.0) + e * (14.0 / 81.0))))
        W[K_REF + i] = W[FRICTION + i] * W[PER_A2 + i] * r * (r * (y * y))  # g n^2 / (A R^(4/3))


@njit(cache=True, error_model="numpy", fastmath=FAST, forceinline=True)
def wave_speed(W: Floats, n: int) -> float:
    """Largest |v| + sqrt(g A / B) in the reach [m/s], all cells wet."""
    for i in range(n):
        speed = abs(0.5 * (W[Q_X + i + 1] + W[Q_X + i + 2])) * W[PER_A + i]
        W[SCRATCH + i] = speed + np.sqrt(GRAVITY * W[Z_A + i])
    bits = W.view(np.int64)  # positive numbers are in the order of their bits
    largest = 0
    for i in range(SCRATCH, SCRATCH + n):
        largest = max(largest, bits[i])
    bits[SCRATCH] = largest
    return float(W[SCRATCH])


@njit(cache=True, error_model="numpy")
def ramp(t: float, gate_time: float) -> float:
    """Integral from 0 to t of a gate's way from 0 to 1 [s]."""
    if t < gate_time:
        return 0.5 * t * t / gate_time
    return t - 0.5 * gate_time


@njit(cache=True, error_model="numpy")
def in_cell(up: float, left: float, right: float, down: float) -> float:
    """Discharge in the middle of a cell, from a quadratic through two faces upstream and one downstream."""
    both = left + right
    return float(0.375 * both + 0.125 * (3.0 * left - up if both > 0.0 else 3.0 * right - down))


@njit(cache=True, error_model="numpy")
def extend(Q: Floats, first: int, last: int) -> None:
    """Fill in the face beyond each end: straight extensions, so that no cell is special."""
    Q[first - 1], Q[last + 1] = 2.0 * Q[first] - Q[first + 1], 2.0 * Q[last] - Q[last - 1]


@njit(cache=True, error_model="numpy", fastmath=FAST, forceinline=True)
def fluxes(W: Floats, n: int) -> None:
    """Momentum flux Q^2 / A of each cell."""
    for i in range(n):
        x = Q_X + i
        q = in_cell(W[x], W[x + 1], W[x + 2], W[x + 3])
        W[M + i] = q * q * W[PER_A + i]


@njit(cache=True, error_model="numpy", fastmath=FAST, forceinline=True)
def accelerate(W: Floats, n: int, since: float, dx: float, ahead: float) -> None:
    """Momentum (1) over `since` [s] on faces, and Q at the next whole step."""
    push_by = since / dx
    for i in range(1, n + 1):
        a = W[A + i - 1] + W[A + i]
        x, y = a * W[PER_A2 + i] - 1.0, (W[P + i - 1] + W[P + i]) * W[PER_P2 + i] - 1.0
        K = W[K_REF + i] * (1.0 + y * (4.0 / 3.0 + y * (2.0 / 9.0)))  # times (1 + y)^(4/3) (1 + x)^(-7/3)
        K *= 1.0 + x * (-7.0 / 3.0 + x * (35.0 / 9.0 + x * (-455.0 / 81.0 + x * (1820.0 / 243.0))))
        push = (W[M + i] - W[M + i - 1]) + 0.5 * GRAVITY * a * (W[Z + i] - W[Z + i - 1])
        old = W[Q + i]
        new = (old - push_by * push) / (1.0 + since * K * abs(old))
        W[Q_OLD + i], W[Q + i], W[Q_X + i + 1] = old, new, new + ahead * (new - old)


WAVE = 5.0
"""Cells of the waves that travel at their speed; longer ones are up to a quarter as wrong as without this."""


@njit(cache=True, error_model="numpy")
def sharpening(courant: float) -> float:
    """Part of the second difference along the cells by which dA/dt is lessened, at a Courant number.

    Leapfrog has ``sin(omega dt / 2) = C sin(k dx / 2)``: waves come late, shorter ones later. The factor
    1 + 4 a sin^2(k dx / 2) that this part a adds makes omega = C k for waves of :data:`WAVE` cells.
    """
    half = np.pi / WAVE
    s = np.sin(half)
    return float(((np.sin(courant * half) / (courant * s)) ** 2 - 1.0) / (4.0 * s * s))


@njit(cache=True, error_model="numpy", fastmath=FAST, forceinline=True)
def fill(W: Floats, n: int, dt: float, dx: float, rise: float, sharp: float, rectangular: bool) -> int:
    """Continuity (1) over a step; level and momentum flux of the cells at its end.

    What fills the cells is sharpened along them by :func:`sharpening`, so that no volume is made or lost and
    a steady flow stays steady, with sources too. Returns how many cells have changed by more than the series
    take, or are not wet: the caller then computes all anew.
    """
    per_dx = 1.0 / dx
    large = 0
    for i in range(n):
        width = W[B + i]
        if not rectangular:
            width += 2.0 * W[S + i] * (W[Z + i] - W[Z_REF + i])
        W[RATE + i] = (W[Q + i] - W[Q + i + 1]) * per_dx + W[SIDE + i] + rise * W[LIFT + i] * width
    W[RATE - 1], W[RATE + n] = W[RATE], W[RATE + n - 1]
    for i in range(n):
        r = RATE + i
        area = W[A + i] + dt * (W[r] - sharp * ((W[r + 1] - W[r]) - (W[r] - W[r - 1])))
        x = area * W[PER_A + i] - 1.0
        large += not abs(x) < CHANGE
        dz = x * W[Z_A + i]
        if not rectangular:
            u = x * W[BEND + i]
            dz -= dz * (u * (1.0 - 2.0 * u))
        W[A + i], W[Z + i], W[P + i] = area, W[Z_REF + i] + dz, W[P_REF + i] + W[W_P + i] * dz
        j = Q_X + i
        q = in_cell(W[j], W[j + 1], W[j + 2], W[j + 3])
        W[M + i] = q * q * (W[PER_A + i] * (1.0 - x * (1.0 - x * (1.0 - x * (1.0 - x)))))
    return large


@njit(cache=True, error_model="numpy", fastmath=FAST, forceinline=True)
def total(W: Floats, n: int) -> float:
    """Sum of the areas; NaN where one is."""
    sum_ = 0.0
    for i in range(n):
        sum_ += W[A + i]
    return float(sum_)


@njit(cache=True, error_model="numpy")
def level_at(W: Floats, share: Floats, apart: float) -> float:
    """Level at a place between cells, if that at x = L were higher by `apart`."""
    level = 0.0
    for i in range(len(share)):
        level += share[i] * (W[Z + i] + W[LIFT + i] * apart)
    return float(level)


@njit(cache=True, error_model="numpy")
def between(at: float, last: int) -> tuple[int, float]:
    """The point before a place among points 0 to `last`, and the weight of the next; both extrapolate."""
    before = min(max(int(np.floor(at)), 0), last - 1)
    return before, at - before


@njit(cache=True, error_model="numpy", nogil=True)
def advance(
    start: Floats, entering: Floats, time: Floats, inflow: Floats, flow: "Flow",
    lateral: Floats, share: Floats, leak_share: Floats, pond_share: Floats, gate: GateArrays,
    exchange: ExchangeArrays, operators: OperatorArrays, observed: Floats, lift: Floats,
    sections: Sections, dx: float, gate_time: float, courant: float, longest: float, places: Floats,
    first: int, last: int,
) -> tuple[int, int, int, int, float]:  # fmt: skip
    """Go through the days `first` to `last` - 1; arrays have a row per day.

    A day begins with the steady flow for a level `start` at x = L while `entering` (days, cells) [m3/s] comes
    in along the reach, or, where `start` is empty, with the state given. `flow` is written; its outflow only
    where there are operators. What leaks and ponds take and the gate lets through follows the level at each
    sample, where the water is nudged the observed one, and is held to the next.

    Returns how it ended, with the day, sample, cell and value: OK; or DRY and the cell; or UNSTABLE and the
    step that would do [s]; or UNSTEADY: no steady flow.
    """
    outflow, released, level = flow.outflow, flow.released, flow.level
    area, discharge, gates, clock, gate_state, ponds = flow.end
    n = inflow.shape[1]
    c = len(sections.bed)
    W, memory = np.zeros(FIELDS), np.empty(MEMORY)
    W[BED : BED + c], W[A_0 : A_0 + c], W[B_0 : B_0 + c] = sections.bed, sections.a, sections.b
    W[S : S + c], W[P_0 : P_0 + c], W[W_P : W_P + c] = sections.s, sections.p, sections.w
    W[FRICTION : FRICTION + c], W[LIFT : LIFT + c] = 2.0 * sections.friction[:c], lift
    W[A + c] = W[P + c] = 1.0  # a dummy behind the last cell; its face is overwritten
    rectangular = not (sections.s.any() or sections.a.any())
    commanded = len(operators.inflow) > 0
    for day in range(first, last):
        if len(start) > 0:
            Q_0 = discharge[day, 0]
            known = inflow[day, 0], gate_start(gate, day, outflow[day, 0])
            if not settle(*known, entering[day], start[day], sections, dx, area[day], Q_0):
                return UNSTEADY, day, 0, 0, 0.0
            discharge[day, 1] = Q_0
            gates[day, 0], gates[day, 1] = known
        dt_1, dt_2, usual = clock[day, 0], clock[day, 1], clock[day, 2]
        fresh = dt_1 == 0.0
        W[A : A + c] = area[day]
        W[Q : Q + c + 1], W[Q_OLD : Q_OLD + c + 1] = discharge[day, 0], discharge[day, 1]
        if commanded:
            start_operators(operators, time[day, 0], memory)
        for k in range(n):
            ahead = dt_1 / (dt_1 + dt_2) if dt_1 > 0.0 else 0.0
            for i in range(1, c):
                W[Q_X + i + 1] = W[Q + i] + ahead * (W[Q + i] - W[Q_OLD + i])
            W[Q_X + 1], W[Q_X + c + 1] = gates[day, 0], gates[day, 1]
            extend(W, Q_X + 1, Q_X + c + 1)
            divide(W, c)
            fluxes(W, c)

            level[day, k] = 1.5 * W[Z + c - 1] - 0.5 * W[Z + c - 2]  # the gauge is at x = L
            for j in range(len(places)):
                i, w = between(places[j] * c - 0.5, c - 1)  # middles of cells
                flow.levels[day, k, j] = (1.0 - w) * W[Z + i] + w * W[Z + i + 1]
                i, w = between(places[j] * c, c)  # faces
                flow.discharges[day, k, j] = (1.0 - w) * W[Q_X + i + 1] + w * W[Q_X + i + 2]
            volume = flow.volume[day, k] = total(W, c) * dx
            apart = observed[day, k] - level[day, k] if np.isfinite(observed[day, k]) else 0.0
            rise = flow.nudge[day, k] = apart / NUDGE_TIME
            if commanded:
                outflow[day, k] = operate(operators, k, time[day, k], level[day, k], memory)
            speed = wave_speed(W, c) if np.isfinite(volume) else np.nan
            if k == 0 and fresh:
                if usual == 0.0:
                    usual = clock[day, 2] = speed
                gate_state[day, :] = gate_start(gate, day, outflow[day, 0])
                for j in range(len(pond_share)):
                    ponds[day, j] = level_at(W, pond_share[j], 0.0)
            if k == n - 1:
                released[day, k] = released[day, k - 1] if n > 1 else outflow[day, k]
                break

            interval = time[day, k + 1] - time[day, k]
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
            sharp = sharpening(speed * dt / dx)

            W[SIDE : SIDE + c] = 0.0
            for j in range(len(share)):
                add(W, c, share[j], lateral[j, day, k] / dx)
            for j in range(len(leak_share)):
                above = level_at(W, leak_share[j], apart) - exchange.reference[j]
                add(W, c, leak_share[j], -exchange.loss[j, day, k] * above / dx)
            for j in range(len(pond_share)):
                into = pond_flow(
                    level_at(W, pond_share[j], apart), ponds[day, j], exchange.exchange[j, day, k],
                    exchange.area[j], interval,
                )  # fmt: skip
                ponds[day, j] += into * interval / exchange.area[j]
                add(W, c, pond_share[j], -into / dx)
            up, down = gates[day, 0], gates[day, 1]
            given = released[day, k] = gate_flow(
                gate, day, k, outflow[day, k], level[day, k] + apart, interval, gate_state[day]
            )
            to_up, to_down = inflow[day, k] - up, given - down
            moved = 0.0
            for step in range(1, steps + 1):
                ahead = dt / (dt + dt_1)
                since = 0.5 * (dt_1 + dt)  # from half step to half step
                passed = ramp(step * dt, gate_time)
                mean = (passed - moved) / dt
                moved = passed
                way = min(1.0, step * dt / gate_time) if gate_time > 0.0 else 1.0
                accelerate(W, c, since, dx, ahead)
                W[Q], W[Q_X + 1] = up + mean * to_up, up + way * to_up
                W[Q + c], W[Q_X + c + 1] = down + mean * to_down, down + way * to_down
                extend(W, Q_X + 1, Q_X + c + 1)
                if fill(W, c, dt, dx, rise, sharp, rectangular) > 0:
                    for i in range(c):
                        if not W[A + i] > 0.0:
                            return DRY, day, k, i, W[A + i]
                    divide(W, c)
                    fluxes(W, c)
                dt_1, dt_2 = dt, dt_1
            way = min(1.0, interval / gate_time) if gate_time > 0.0 else 1.0
            gates[day, 0] = inflow[day, k] if way == 1.0 else up + way * to_up
            gates[day, 1] = given if way == 1.0 else down + way * to_down
        clock[day, 0], clock[day, 1] = dt_1, dt_2
        area[day] = W[A : A + c]
        discharge[day, 0], discharge[day, 1] = W[Q : Q + c + 1], W[Q_OLD : Q_OLD + c + 1]
    return OK, 0, 0, 0, 0.0


@njit(cache=True, error_model="numpy")
def add(W: Floats, n: int, share: Floats, flow: float) -> None:
    """Add the cells' shares of a flow per metre."""
    for i in range(n):
        W[SIDE + i] += share[i] * flow


STEPS = 60
"""Newton steps before a profile is given up; five are usual."""


@njit(cache=True, error_model="numpy")
def section(z: float, c: Sections, i: int) -> tuple[float, float, float]:
    """Area, width of the surface and wetted perimeter of cell i at a level."""
    h = z - c.bed[i]
    return c.a[i] + (c.b[i] + c.s[i] * h) * h, c.b[i] + 2.0 * c.s[i] * h, c.p[i] + c.w[i] * h


@njit(cache=True, error_model="numpy")
def backwater(Q: Floats, q: Floats, z_end: float, sections: Sections, dx: float, z: Floats) -> bool:
    """Levels upstream of `z_end`, the level of the last cell, face by face; momentum (1) without d/dt.

    `z` holds levels near them on entry: those of another `z_end`, or one level. `Q`, shape (cells + 1,), is
    the discharge on the faces and `q`, shape (cells,), what the kernel takes for it in the cells [m3/s].
    Returns False where the flow would be dry or not subcritical.
    """
    bed, friction = sections.bed, sections.friction
    c = len(bed)
    shift, z[c - 1] = z_end - z[c - 1], z_end
    for i in range(c - 1, 0, -1):
        A_1, B_1, P_1 = section(z[i], sections, i)
        if not (A_1 > 0.0 and q[i] * q[i] * B_1 < GRAVITY * A_1**3):
            return False
        before = z[i - 1]
        level = max(before + shift, bed[i - 1] + 0.5 * (z[i] - bed[i]))
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
        shift, z[i - 1] = level - before, level
    return True


@njit(cache=True, error_model="numpy")
def settle(
    inflow: float, outflow: float, lateral: Floats, start: float, sections: Sections, dx: float, A: Floats,
    Q: Floats,
) -> bool:  # fmt: skip
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
        extend(padded, 1, c + 1)
        for i in range(c):
            q[i] = in_cell(padded[i], padded[i + 1], padded[i + 2], padded[i + 3])
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
