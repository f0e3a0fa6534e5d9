"""The gate and the people, compiled; importing this module loads numba.

The people act in steps. At each look they see the inflow command and the gauge, and may change the outflow:

    wanted += K_Q (inflow - inflow at the last look) - K_h (error - error at the last look) + trim,

the increments of (9), so that a new shift with other gains starts without a jump. The error is the reading
less the set-point, its part inside the dead-band taken away.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rivid.reach.loop import GateArrays, People

Floats = NDArray[np.float64]
WANTED, SEEN, ERROR, SINCE, UNTIL, COMMAND, MIND = 0, 1, 2, 3, 4, 5, 6
"""What the people keep in mind, and how much that is."""
TARGET, POSITION, FLOW, GATE = 0, 1, 2, 3
"""What the gate keeps, and how much that is."""


@njit(cache=True, error_model="numpy")
def prepare(people: People, t: float, mind: Floats) -> None:
    """Before the first look."""
    mind[:] = 0.0
    mind[WANTED] = mind[SEEN] = people.inflow[0]
    mind[SINCE] = t
    mind[UNTIL] = -np.inf


@njit(cache=True, error_model="numpy")
def look(people: People, k: int, t: float, level: float, mind: Floats) -> float:
    """The outflow command of sample k, changed if it is time for a look."""
    q = people.inflow[k]
    if t < mind[UNTIL] and abs(q - mind[SEEN]) <= people.notice:
        return float(mind[COMMAND])
    reading = level + people.disturbance[k]
    if people.gauge_quantum > 0.0:
        reading = np.rint(reading / people.gauge_quantum) * people.gauge_quantum
    error = reading - people.aim[k]
    error = np.copysign(max(abs(error) - people.dead_band, 0.0), error)
    wanted = mind[WANTED] + people.feedforward[k] * (q - mind[SEEN])
    wanted -= people.level_gain[k] * (error - mind[ERROR])
    wanted -= people.level_gain[k] * error * (t - mind[SINCE]) / people.trim_time
    wanted = max(wanted, people.lowest)  # no wind-up below the limit
    given = wanted
    if people.quantum > 0.0:
        given = max(np.rint(wanted / people.quantum), np.ceil(people.lowest / people.quantum))
        given *= people.quantum
    mind[WANTED], mind[SEEN], mind[ERROR], mind[SINCE] = wanted, q, error, t
    mind[UNTIL] = t + people.wait[k]
    mind[COMMAND] = given
    return float(given)


@njit(cache=True, error_model="numpy")
def gate_flow(
    gate: GateArrays, day: int, k: int, command: float, level: float, dt: float, state: Floats
) -> float:
    """Mean real flow of a sample of length dt [m3/s]; the gate's state goes to the sample's end."""
    if gate.plain:
        return command
    if abs(command - state[TARGET]) >= gate.dead_band[day, k]:
        state[TARGET] = command
    way, rate = state[TARGET] - state[POSITION], gate.rate[day, k]
    if abs(way) <= rate * dt:
        mean = state[TARGET] if np.isinf(rate) else state[TARGET] - 0.5 * way * abs(way) / (rate * dt)
        state[POSITION] = state[TARGET]
    else:
        step = np.copysign(rate * dt, way)
        mean = state[POSITION] + 0.5 * step
        state[POSITION] += step
    lag = gate.lag[day, k]
    if lag > 0.0:
        left = np.exp(-dt / lag)
        behind = state[FLOW] - mean
        state[FLOW] = mean + behind * left
        mean += behind * lag / dt * (1.0 - left)
    else:
        state[FLOW] = state[POSITION]
    return float(mean * gate.factor[day, k] * (1.0 + gate.head[day, k] * (level - gate.reference)))


@njit(cache=True, error_model="numpy")
def pond_flow(level: float, pond: float, exchange: float, area: float, dt: float) -> float:
    """Mean flow into a pond over a sample [m3/s], exact for a level that stays; never overshoots."""
    return float(area / dt * (level - pond) * -np.expm1(-exchange * dt / area))
