"""The compiled loop of the linear pool; importing this module loads numba."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rivid.reach.loop import ExchangeArrays, GateArrays, People
from rivid.reach.loop_kernel import FLOW, GATE, MIND, POSITION, TARGET, gate_flow, look, pond_flow, prepare

Floats = NDArray[np.float64]


@njit(cache=True, error_model="numpy", nogil=True)
def hold(
    time: Floats,
    volume: Floats,
    outflow: Floats,
    gate: GateArrays,
    exchange: ExchangeArrays,
    people: People,
    outflow_gain: float,
    surface_area: float,
    area_slope: float,
    area_reference: float,
    start: float,
    level: Floats,
    released: Floats,
) -> None:
    """Write the level and the real outflow, and the command where people give it.

    `volume` is what has come to the dam at each sample [m3]; the rest is as in
    :func:`rivid.reach.pool.pool_level`.
    """
    n = len(time)
    commanded = len(people.inflow) > 0
    mind, state = np.empty(MIND), np.empty(GATE)
    ponds = np.full(len(exchange.area), start)
    gone = 0.0
    high = start - area_reference
    if commanded:
        prepare(people, time[0], mind)
    for k in range(n):
        rise = (volume[k] - volume[0] - gone) / surface_area
        h = start + rise
        if area_slope != 0.0:  # A (y + slope y^2 / 2) is the volume above the reference
            v = rise + high + 0.5 * area_slope * high * high
            h = area_reference + 2.0 * v / (1.0 + np.sqrt(1.0 + 2.0 * area_slope * v))
        level[k] = h
        if commanded:
            outflow[k] = look(people, k, time[k], h, mind)
        if k == 0:
            state[TARGET] = state[POSITION] = state[FLOW] = outflow[0]
        if k == n - 1:
            released[k] = released[k - 1] if n > 1 else outflow_gain * outflow[k]
            break
        dt = time[k + 1] - time[k]
        released[k] = outflow_gain * gate_flow(gate, 0, k, outflow[k], h, dt, state)
        gone += released[k] * dt
        for j in range(len(exchange.loss)):
            gone += exchange.loss[j, 0, k] * (h - exchange.reference[j]) * dt
        for j in range(len(ponds)):
            into = pond_flow(h, ponds[j], exchange.exchange[j, 0, k], exchange.area[j], dt)
            ponds[j] += into * dt / exchange.area[j]
            gone += into * dt
