"""Gate and ponds that see a given level, compiled; importing this module loads numba."""

import numpy as np
from numba import njit

from rivid.reach.loop import FLOW, GATE, POSITION, TARGET, GateArrays, gate_flow, pond_flow
from rivid.types import Floats


@njit(cache=True, error_model="numpy")
def follow(
    steps: Floats,
    command: Floats,
    level: Floats,
    gate: GateArrays,
    exchange: Floats,
    area: Floats,
    outflow: Floats,
    into: Floats,
) -> None:
    """Write the gate's real flow (days, n) and what flows into each pond (ponds, days, n) [m3/s]."""
    days, n = command.shape
    ponds = len(area)
    state, height = np.empty(GATE), np.empty(ponds)
    for day in range(days):
        state[TARGET] = state[POSITION] = state[FLOW] = command[day, 0]
        height[:] = level[day, 0]
        for k in range(n):
            dt = steps[day, k]
            outflow[day, k] = gate_flow(gate, day, k, command[day, k], level[day, k], dt, state)
            for j in range(ponds):
                flow = pond_flow(level[day, k], height[j], exchange[j, day, k], area[j], dt)
                height[j] += flow * dt / area[j]
                into[j, day, k] = flow
