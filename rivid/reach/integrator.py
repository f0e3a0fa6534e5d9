"""The reach as an integrator with a delay, (7) and (10)."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from rivid.core.hydraulics import GRAVITY
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.gate import (
    GATE,
    MEMORY,
    NO_OPERATORS,
    ExchangeArrays,
    GateArrays,
    OperatorArrays,
    exchange_arrays,
    gate_arrays,
    gate_flow,
    on_grid,
    operate,
    pond_flow,
    start_operators,
)
from rivid.reach.transport import arrived_volume, held_volume
from rivid.types import Floats


@dataclass(frozen=True)
class LinearReach:
    """A pool held by a dam: ``A dh/dt = K_i Q_i(t - tau) - K_o Q_o`` (7), tau a function of the flow."""

    length: float = 8200.0  # L [m]
    width: float = 81.6  # mean width [m]
    depth: float = 4.9  # mean depth of the flow [m]
    wave_depth: float = 4.9  # depth z that carries the wave [m]: tau = L / (v + sqrt(g z))
    surface_area: float = 6.7e5  # A [m2]
    inflow_gain: float = 1.0  # K_i: real flow of the dam over its command
    outflow_gain: float = 1.0  # K_o

    def travel_time(self, flow: ArrayLike) -> Floats:
        """Travel time tau of the gravity wave [s] at a flow [m3/s]: the lower bound in (5)."""
        velocity = np.asarray(flow, float) / (self.width * self.depth)
        return np.asarray(self.length / (velocity + np.sqrt(GRAVITY * self.wave_depth)))


def theoretical_fir(
    order: int, delay: int, alpha_i: float, alpha_o: float, feedforward: float = 1.0,
    level_gain: float = -1000.0,
) -> Floats:  # fmt: skip
    """Impulse response of the regulated reach from inflow to level (10), Fig. 10, (order,) [m per m3/s].

    `delay` is d [samples], `alpha_i` and `alpha_o` are K_i T_s / A and K_o T_s / A [m per m3/s],
    `feedforward` is K_Q [-] and `level_gain` K_h [m2/s], negative: by (9) the outflow grows by ``-K_h`` for
    each metre of level. The sum of two first-order responses: zero at lag 0, a jump at lag 1 and one at lag
    d + 1, a geometric decay after each.

    Examples
    --------
    >>> (theoretical_fir(9, 7, 1e-4, 1.2e-4)[[0, 1, 2, 8]] * 1e4).round(3).tolist()
    [0.0, -1.2, -1.056, 0.51]
    """
    lag = np.arange(order)
    decay = level_gain * alpha_o + 1.0
    first = np.where(lag >= 1, decay ** np.maximum(lag - 1, 0), 0.0)
    second = np.where(lag >= delay + 1, decay ** np.maximum(lag - delay - 1, 0), 0.0)
    return np.asarray(alpha_i * second - feedforward * alpha_o * first)


@njit(cache=True, error_model="numpy", nogil=True)
def hold(
    time: Floats, volume: Floats, outflow: Floats, gate: GateArrays, exchange: ExchangeArrays,
    operators: OperatorArrays, outflow_gain: float, surface_area: float, area_slope: float,
    area_reference: float, start: float, level: Floats, released: Floats,
) -> None:  # fmt: skip
    """Write the level and the real outflow, and the command where operators give it.

    `volume` is what has come to the dam at each sample [m3]; the rest is as in
    :func:`rivid.reach.integrator.pool_level`.
    """
    n = len(time)
    commanded = len(operators.inflow) > 0
    memory, state = np.empty(MEMORY), np.empty(GATE)
    ponds = np.full(len(exchange.area), start)
    gone = 0.0
    high = start - area_reference
    if commanded:
        start_operators(operators, time[0], memory)
    for k in range(n):
        rise = (volume[k] - volume[0] - gone) / surface_area
        h = start + rise
        if area_slope != 0.0:  # A (y + slope y^2 / 2) is the volume above the reference
            v = rise + high + 0.5 * area_slope * high * high
            h = area_reference + 2.0 * v / (1.0 + np.sqrt(1.0 + 2.0 * area_slope * v))
        level[k] = h
        if commanded:
            outflow[k] = operate(operators, k, time[k], h, memory)
        if k == 0:
            state[:] = outflow[0]  # the gate is where its command is
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


def supply(
    reach: LinearReach, time: Floats, inflow: Floats, travel_time: ArrayLike, before: float, changes: Changes
) -> Floats:
    """Volume that has come to the downstream dam at each sample [m3]: the inflow and all added flows.

    The first term of (7), integrated exactly for a zero-order hold: what departs at t arrives at t + tau(t),
    and no volume is lost or made when tau, `travel_time`, changes. Where tau falls faster than time passes,
    what left late arrives together with what left before, never ahead of it. An added flow at place p has
    ``(1 - p) tau`` to travel. `before` is the inflow before the first sample [m3/s]; of the changes `inflow`
    and `added` are used.
    """
    n = len(time)
    flow = inflow if changes.inflow is None else on_grid("inflow", changes.inflow, (n,))
    tau = np.asarray(travel_time, float)

    def arrived(flow: Floats, tau: Floats, before: float) -> Floats:
        return arrived_volume(time, np.maximum.accumulate(time + tau), held_volume(time, flow), before)

    volume = reach.inflow_gain * arrived(flow, tau, before)
    for extra in changes.added:
        flow = on_grid("an added flow", extra.flow, (n,))
        volume += arrived(flow, (1.0 - extra.place) * tau, float(flow[0]))
    return volume


def pool_level(
    reach: LinearReach, time: Floats, inflow: Floats, outflow: Floats | OperatorArrays,
    travel_time: ArrayLike, *, start: float = 0.0, before: float = 0.0, changes: Changes = NO_CHANGES,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Level of the pool, (7), for known commands or for operators who command the outflow.

    `time` [s] and the commands `inflow` and `outflow` [m3/s] have shape (n,); an outflow is held, or given by
    operators from the level. `travel_time` is tau of what departs at each sample [s], `start` the level at
    the first sample [m], `before` the inflow command before it [m3/s]. The `gauge` of the changes is not
    used: the level is that of the water. All leaks and ponds are at the pool.

    Returns the true level [m], the commands of the outflow, given or decided, and the real outflow, mean of
    each sample [m3/s], the last that before; each of shape (n,). RividError where shapes do not agree, or the
    pool runs dry of surface: `area_slope` and level do not fit.
    """
    n = len(time)
    if isinstance(outflow, OperatorArrays):
        operators, given = outflow, np.zeros(n)
        if len(operators.inflow) != n:
            raise RividError(f"operators for {len(operators.inflow)} samples: expected {n} like the times")
    else:
        operators, given = NO_OPERATORS, np.array(outflow, float)
    for name, values in (("inflow", inflow), ("outflow", given)):
        if np.shape(values) != (n,):
            raise RividError(f"{name} has shape {np.shape(values)}: expected ({n},) like the times")
    level, released = np.empty(n), np.empty(n)
    hold(
        np.asarray(time, float), supply(reach, time, inflow, travel_time, before, changes), given,
        gate_arrays(changes, (1, n)), exchange_arrays(changes, (1, n)), operators, reach.outflow_gain,
        reach.surface_area, changes.area_slope, changes.area_reference, start, level, released,
    )  # fmt: skip
    if not np.isfinite(level).all():
        raise RividError(
            f"area_slope = {changes.area_slope:g} 1/m leaves no water surface at the level reached: "
            "expected a smaller slope, or a level nearer to its reference"
        )
    return level, given, released
