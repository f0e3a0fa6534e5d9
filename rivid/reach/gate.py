"""Compiled downstream gate and operators; importing this module loads numba.

The operators act in steps: at each look they read the inflow command and the gauge and may change the
outflow:

    wanted += K_Q (inflow - inflow at the last look) - K_h (error - error at the last look) + trim,

the increments of (9), so that a new shift with other gains starts without a jump. The error is the reading
less the set-point, its part inside the dead-band taken away.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.types import Floats


class GateArrays(NamedTuple):
    """:class:`rivid.reach.changes.Gate` on the time grid; arrays of shape (days, n)."""

    plain: bool
    dead_band: Floats
    rate: Floats
    lag: Floats
    factor: Floats
    head: Floats
    reference: float
    start: Floats


class ExchangeArrays(NamedTuple):
    """Leaks and ponds on the time grid."""

    loss: Floats  # (leaks, days, n)
    reference: Floats  # (leaks,)
    exchange: Floats  # (ponds, days, n)
    area: Floats  # (ponds,)


class OperatorArrays(NamedTuple):
    """Operators who command the outflow; arrays of shape (n,).

    Scalars without a comment are those of :class:`rivid.reach.operators.OperatorSettings`.
    """

    inflow: Floats  # announced command [m3/s]
    disturbance: Floats  # reading of the gauge minus level [m]: noise and effects
    aim: Floats  # level that the operator on duty aims at [m]
    feedforward: Floats  # K_Q of the operator on duty [-]
    level_gain: Floats  # K_h of the operator on duty [m2/s]
    wait: Floats  # longest time to the next look after a look at this sample [s]
    dead_band: float
    trim_time: float
    notice: float
    quantum: float
    lowest: float
    gauge_quantum: float  # step of the reading [m]; 0 for none


NO_OPERATORS = OperatorArrays(*(np.empty(0),) * 6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The outflow commands are given."""


def on_grid(what: str, values: ArrayLike, shape: tuple[int, ...], *, infinite: bool = False) -> Floats:
    """Values for every sample of a (n,) or (days, n) grid, an array of its own.

    RividError where they do not fit it, are NaN, or infinite where that is not allowed.
    """
    given = np.asarray(values, float)
    try:
        rows = np.array(np.broadcast_to(given, shape), order="C")
    except ValueError:
        raise RividError(f"{what} has shape {given.shape}: expected {shape} like the inflow") from None
    wrong = np.isnan(rows) if infinite else ~np.isfinite(rows)
    if wrong.any():
        *day, k = np.argwhere(wrong)[0]
        where = f"row {day[0]}, " if day else ""
        raise RividError(f"{what} is {rows[*day, k]} in {where}sample {k}: expected a number")
    return rows


def gate_arrays(changes: Changes, shape: tuple[int, ...]) -> GateArrays:
    """The changes' gate on a (days, n) grid."""
    gate = changes.gate
    if changes.gate_is_plain:  # one row, which the loops do not read
        return GateArrays(True, *(np.zeros((1, 1)),) * 5, 0.0, np.zeros((1, 1)))

    def rows(name: str, values: Floats) -> Floats:
        return on_grid(f"the gate's {name}", values, shape, infinite=True)

    return GateArrays(
        False, rows("dead-band", gate.dead_band), rows("rate", gate.rate), rows("lag", gate.lag),
        rows("factor", gate.factor), rows("head gain", gate.head), float(gate.reference),
        rows("start", gate.start),
    )  # fmt: skip


def exchange_arrays(changes: Changes, shape: tuple[int, ...]) -> ExchangeArrays:
    """The changes' leaks and ponds on a (days, n) grid."""
    leaks, ponds = changes.leaks, changes.ponds
    loss = np.array([on_grid("a leak's loss", leak.loss, shape) for leak in leaks])
    exchange = np.array([on_grid("a pond's exchange", pond.exchange, shape) for pond in ponds])
    references, areas = np.array([a.reference for a in leaks]), np.array([a.area for a in ponds], float)
    return ExchangeArrays(loss.reshape(-1, *shape), references, exchange.reshape(-1, *shape), areas)


WANTED, SEEN, ERROR, SINCE, UNTIL, COMMAND, MEMORY = 0, 1, 2, 3, 4, 5, 6
"""Entries of the operators' memory, and their number."""
TARGET, POSITION, FLOW, GATE = 0, 1, 2, 3
"""Entries of the gate's state, and their number."""


@njit(cache=True, error_model="numpy")
def start_operators(operators: OperatorArrays, t: float, memory: Floats) -> None:
    """Set the memory before the first look."""
    memory[:] = 0.0
    memory[WANTED] = memory[SEEN] = operators.inflow[0]
    memory[SINCE] = t
    memory[UNTIL] = -np.inf


@njit(cache=True, error_model="numpy")
def operate(operators: OperatorArrays, k: int, t: float, level: float, memory: Floats) -> float:
    """The outflow command of sample k, changed if it is time for a look."""
    q = operators.inflow[k]
    if t < memory[UNTIL] and abs(q - memory[SEEN]) <= operators.notice:
        return float(memory[COMMAND])
    reading = level + operators.disturbance[k]
    if operators.gauge_quantum > 0.0:
        reading = np.rint(reading / operators.gauge_quantum) * operators.gauge_quantum
    error = reading - operators.aim[k]
    error = np.copysign(max(abs(error) - operators.dead_band, 0.0), error)
    wanted = memory[WANTED] + operators.feedforward[k] * (q - memory[SEEN])
    wanted -= operators.level_gain[k] * (error - memory[ERROR])
    wanted -= operators.level_gain[k] * error * (t - memory[SINCE]) / operators.trim_time
    wanted = max(wanted, operators.lowest)  # no wind-up below the limit
    given = wanted
    if operators.quantum > 0.0:
        given = max(np.rint(wanted / operators.quantum), np.ceil(operators.lowest / operators.quantum))
        given *= operators.quantum
    memory[WANTED], memory[SEEN], memory[ERROR], memory[SINCE] = wanted, q, error, t
    memory[UNTIL] = t + operators.wait[k]
    memory[COMMAND] = given
    return float(given)


@njit(cache=True, error_model="numpy")
def gate_start(gate: GateArrays, day: int, command: float) -> float:
    """Position of the gate at the first sample of a row [m3/s]."""
    if gate.plain or np.isinf(gate.start[day, 0]):
        return command
    return float(gate.start[day, 0])


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
        mean = state[TARGET] - 0.5 * way * abs(way) / (rate * dt)
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
