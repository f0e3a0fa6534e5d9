"""The compiled loop of the linear pool; importing this module loads numba."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.loop import (
    FLOW,
    GATE,
    MIND,
    NOBODY,
    POSITION,
    TARGET,
    ExchangeArrays,
    GateArrays,
    People,
    exchange_arrays,
    gate_arrays,
    gate_flow,
    look,
    on_grid,
    pond_flow,
    prepare,
)
from rivid.reach.response import LinearReach
from rivid.reach.transport import arrived_volume, held_volume
from rivid.types import Floats


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


class PoolFlow(NamedTuple):
    """What the water did, at the sample times; arrays of shape (n,).

    Attributes
    ----------
    level : ndarray
        True level [m].
    outflow : ndarray
        Commands u_Qo [m3/s], given or decided.
    released : ndarray
        Real outflow, mean of each sample [m3/s]; the last is that before.
    """

    level: Floats
    outflow: Floats
    released: Floats


def supply(
    reach: LinearReach,
    time: Floats,
    inflow: Floats,
    travel_time: ArrayLike,
    before: float,
    changes: Changes = NO_CHANGES,
) -> Floats:
    """Volume that has come to the downstream dam at each sample [m3]: the inflow and all added flows.

    Parameters
    ----------
    reach : LinearReach
    time, inflow : ndarray, shape (n,)
        Sample times [s] and inflow commands u_Qi [m3/s].
    travel_time : float or ndarray, shape (n,)
        tau of what departs at each sample [s]; where it falls faster than time passes, what left late
        arrives together with what left before, never ahead of it. An added flow at place p has
        ``(1 - p) tau`` to travel.
    before : float
        Inflow before the first sample [m3/s].
    changes : Changes
        Its `inflow` and `added` are used.

    Notes
    -----
    Source: the first term of (7), integrated exactly for a zero-order hold: what departs at t arrives at
    t + tau(t), and no volume is lost or made when tau changes.
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
    reach: LinearReach,
    time: Floats,
    inflow: Floats,
    outflow: Floats | People,
    travel_time: ArrayLike,
    *,
    start: float = 0.0,
    before: float = 0.0,
    changes: Changes = NO_CHANGES,
) -> PoolFlow:
    """Level of the pool, (7), for known commands or for people who command the outflow.

    Parameters
    ----------
    reach : LinearReach
    time, inflow : ndarray, shape (n,)
        Sample times [s]; commands u_Qi [m3/s], held.
    outflow : ndarray of shape (n,), or People
        Commands u_Qo [m3/s], held, or who gives them as they see the level.
    travel_time : float or ndarray, shape (n,)
        tau of what departs at each sample [s].
    start : float
        Level at the first sample [m].
    before : float
        Inflow command before the first sample [m3/s].
    changes : Changes
        Its `gauge` is not used: this is the water, not what is read of it. All places of leaks and ponds
        are the pool.

    Returns
    -------
    PoolFlow

    Raises
    ------
    RividError
        Where shapes do not agree, or the pool runs dry of surface: `area_slope` and level do not fit.
    """
    from rivid.reach.pool import hold

    n = len(time)
    people = outflow if isinstance(outflow, People) else NOBODY
    given = np.zeros(n) if isinstance(outflow, People) else np.array(outflow, float)
    for name, values in (("inflow", inflow), ("outflow", given)):
        if np.shape(values) != (n,):
            raise RividError(f"{name} has shape {np.shape(values)}: expected ({n},) like the times")
    if isinstance(outflow, People) and len(people.inflow) != n:
        raise RividError(f"people for {len(people.inflow)} samples: expected {n} like the times")
    level, released = np.empty(n), np.empty(n)
    hold(
        np.asarray(time, float), supply(reach, time, inflow, travel_time, before, changes), given,
        gate_arrays(changes, (1, n)), exchange_arrays(changes, (1, n)), people, reach.outflow_gain,
        reach.surface_area, changes.area_slope, changes.area_reference, start, level, released,
    )  # fmt: skip
    if not np.isfinite(level).all():
        raise RividError(
            f"area_slope = {changes.area_slope:g} 1/m leaves no water surface at the level reached: "
            "expected a smaller slope, or a level nearer to its reference"
        )
    return PoolFlow(level, given, released)
