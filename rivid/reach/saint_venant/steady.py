"""The start: the profile at which the discrete equations of the kernel stand still.

Importing this module loads numba.
"""

import numpy as np
from numba import njit

from rivid.core.hydraulics import GRAVITY
from rivid.reach.saint_venant.channel import Sections
from rivid.reach.saint_venant.kernel import extend, in_cell
from rivid.types import Floats

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
