"""Levels from commands, for a season or for many independent days; travel time of a small wave."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from functools import cache, partial
from itertools import pairwise
from multiprocessing import parent_process
from typing import NamedTuple, TypeVar

import numpy as np
from numba import config
from numpy.typing import ArrayLike

from rivid.core.hydraulics import GRAVITY
from rivid.errors import ConfigError, RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.gate import NO_OPERATORS, OperatorArrays, exchange_arrays, gate_arrays, on_grid
from rivid.reach.saint_venant import kernel
from rivid.reach.saint_venant.channel import COURANT_LIMIT, MAX_CELLS, Channel
from rivid.types import Floats

_Given = TypeVar("_Given")
_Made = TypeVar("_Made")
ENOUGH = 200_000
"""Cells times samples from which threads share the rows: about 10 ms of work; they start in 0.2 ms."""
PARTS = 4
"""Parts of the rows for each thread: none waits long for the last."""


class State(NamedTuple):
    """The water between two samples, from which :func:`simulate` can go on; a row for each day."""

    area: Floats  # wetted areas at the last sample [m2], (days, cells)
    discharge: Floats  # on the faces half a step and one and a half before it [m3/s], (days, 2, cells + 1)
    gates: Floats  # flows that the two dams let through at the last sample [m3/s], (days, 2)
    clock: Floats  # the last two time steps [s], and the wave speed [m/s] that sets the usual step, (days, 3)
    gate: Floats  # the downstream gate's target, position, and flow that follows it [m3/s], (days, 3)
    ponds: Floats  # levels of the ponds [m], (days, ponds)


class Flow(NamedTuple):
    """Levels and flows at the sample times; arrays of shape (days, n), or (n,) as the commands."""

    level: Floats  # at x = L [m]
    outflow: Floats  # commands of the downstream dam [m3/s], given or decided
    released: Floats  # real flow of that gate, mean of each sample [m3/s]; the last is that before
    levels: Floats  # at the given places [m], (..., n, places)
    discharges: Floats  # at the given places [m3/s], (..., n, places)
    volume: Floats  # water in the reach [m3]: it changes by what dams and lateral flows bring, to rounding
    nudge: Floats  # rise added to every cell from each sample to the next [m/s]; zero without `observed`
    end: State  # where it ended, to go on from


def simulate(
    channel: Channel, time: ArrayLike, inflow: ArrayLike, outflow: ArrayLike | OperatorArrays,
    start: ArrayLike | State, *, changes: Changes = NO_CHANGES, places: Sequence[float] = (),
    gate_time: float = 30.0, courant: float = 0.5, step: float | None = None, speed: float | None = None,
    observed: ArrayLike | None = None, lift: ArrayLike = 1.0,
) -> Flow:  # fmt: skip
    """Solve Saint-Venant's equations (1), with Manning friction, for known flows at both dams.

    `time` [s], `inflow` and `outflow` [m3/s], held from each sample to the next, have shape (n,) or (days,
    n): each row is then a simulation of its own, with the same result whatever rows stand beside it. Instead
    of an outflow, the operators who command it as they see the level; the inflow is then (n,).

    `start` is the level at x = L at the first sample [m], one or (days,): the flow is then steady for the
    first commands, or, where they differ, fills or empties the reach evenly. Or it is the `end` of an earlier
    flow: `time` then begins with the sample at which that ended. The added flows of `changes` enter without
    momentum of their own along the reach and are part of the steady start; its `gauge` is not used: this is
    the water. `places`, from 0 (upstream) to 1, are where else to give level and discharge.

    A gate takes `gate_time` [s] from one command to the next, linearly; 0 is at once. `courant`, up to 0.6,
    is the Courant number of the usual time step, set by the wave speed at the start, or by `speed` [m/s]:
    channels that differ little then have the same steps, and their levels differ smoothly. The step becomes
    shorter where a later flow would bring it above 0.6. `step` is the longest time step [s] instead; refused
    where it is unstable.

    `observed`, shape of the inflow, is a level to stay near [m]: ``(observed - level) / NUDGE_TIME`` times
    `lift`, one or (cells,), is added to the rise of each cell, nothing where it is NaN. The lift is
    :func:`backwater_lift` where the water is to stay in balance.

    ConfigError where a setting is impossible or unstable; RividError where a cell runs dry or no subcritical
    steady flow has the start level. The first call in a process compiles the loops, or loads them compiled.
    Many rows are shared among as many threads as numba may use (``NUMBA_NUM_THREADS``), but not in a worker
    process.

    Examples
    --------
    >>> pool = Channel.smooth(8200.0, 81.6, 1.2e-4, 0.03, 32)
    >>> flow = simulate(pool, [0.0, 3600.0], [300.0, 300.0], [300.0, 300.0], 5.0)
    >>> flow.level.round(6).tolist()
    [5.0, 5.0]
    """
    _check_settings(gate_time, courant, step, places)
    c = channel.cells
    if c > MAX_CELLS:
        raise ConfigError(f"a channel of {c} cells: expected at most {MAX_CELLS}")
    day = 0 if np.ndim(inflow) < 2 else slice(None)
    days, n = shape = np.shape(np.atleast_2d(np.asarray(inflow, float)))
    clock_time = on_grid("time", time, shape)
    if not (np.diff(clock_time, axis=1) > 0).all():
        raise RividError("time does not increase from sample to sample: expected sample times in order [s]")
    q_in = on_grid("inflow", inflow if changes.inflow is None else changes.inflow, shape)
    if isinstance(outflow, OperatorArrays):
        operators, q_out = outflow, q_in.copy()
        if len(outflow.inflow) != n:
            raise RividError(f"operators for {len(outflow.inflow)} samples: expected {n} like the inflow")
        if days > 1:
            raise RividError(f"operators at {days} reaches at once: expected one row")
    else:
        operators, q_out = NO_OPERATORS, on_grid("outflow", outflow, shape)
    sides = np.array([on_grid("an added flow", extra.flow, shape) for extra in changes.added])
    sides = sides.reshape(-1, *shape)
    share, leak_share, pond_share = (
        _shares(c, [one.place for one in many]) for many in (changes.added, changes.leaks, changes.ponds)
    )
    if isinstance(start, State):
        state, levels_0 = deepcopy(start), np.empty(0)
    else:
        state = State(
            np.empty((days, c)), np.zeros((days, 2, c + 1)), np.zeros((days, 2)), np.zeros((days, 3)),
            np.zeros((days, 3)), np.zeros((days, len(changes.ponds))),
        )  # fmt: skip
        levels_0 = np.array(np.broadcast_to(np.asarray(start, float), (days,)))
        state.clock[:, 2] = 0.0 if speed is None else speed
    if state.area.shape != (days, c):
        raise RividError(
            f"the start has (days, cells) = {state.area.shape}: expected {(days, c)} "
            "as the commands and the channel have"
        )
    target = np.full(shape, np.nan)
    if observed is not None:
        known = ~np.isnan(np.asarray(observed, float))
        target = np.where(known, on_grid("observed", np.where(known, observed, 0.0), shape), np.nan)
    level, released, volume, nudge = np.empty((4, *shape))
    levels, discharges = np.empty((2, *shape, len(places)))
    flow = Flow(level, q_out, released, levels, discharges, volume, nudge, state)
    advance = partial(
        kernel.advance, levels_0, sides[:, :, 0].T @ share, clock_time, q_in, flow, sides, share, leak_share,
        pond_share, gate_arrays(changes, shape), exchange_arrays(changes, shape), operators, target,
        np.array(np.broadcast_to(np.asarray(lift, float), (c,))), channel.sections, channel.dx,
        float(gate_time), float(courant), 0.0 if step is None else float(step), np.array(places, float),
    )  # fmt: skip
    threads = _threads(days, n * c)
    ends = np.linspace(0, days, min(PARTS * threads, days) + 1).astype(int) if threads > 1 else (0, days)
    run = _pool(threads).map if threads > 1 else map
    for how, row, k, cell, value in list(run(lambda part: advance(*part), pairwise(ends))):
        if how == kernel.UNSTEADY:
            raise _unsteady(channel, q_in[:, 0], levels_0, row)
        if how != kernel.OK:
            when = f"at {clock_time[row, k]:g} s{_row(row, days)}"
            raise _failure(channel, when, step, courant, how, cell, value)
    return Flow(
        level[day], q_out[day], released[day], levels[day], discharges[day], volume[day], nudge[day], state
    )


LIFT_BY = 0.05
"""Rise of the level from which the lift is taken [m]."""


def backwater_lift(channel: Channel, flow: float, level: float) -> tuple[Floats, float]:
    """Rise of each cell over that of the level at x = L, (cells,), and its volume for each metre there [m2].

    From a steady state with this flow [m3/s] and level [m] to the next. Far upstream the depth is that of the
    flow alone: there the rise is 0, and the volume is less than the water surface. RividError where no
    subcritical steady flow has the level.
    """
    c, s = channel.cells, channel.sections
    levels, volumes = [], []
    for start in (level, level + LIFT_BY):
        area = np.empty(c)
        if not kernel.settle(flow, flow, np.zeros(c), start, s, channel.dx, area, np.empty(c + 1)):
            raise _unsteady(channel, np.array([flow]), np.array([start]), 0)
        levels.append(channel.level(area))
        volumes.append(float(area.sum()) * channel.dx)
    return np.asarray((levels[1] - levels[0]) / LIFT_BY), (volumes[1] - volumes[0]) / LIFT_BY


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """One pool for all calls: a diagnosis makes thousands, and to start threads takes 1.5 ms each."""
    return ThreadPoolExecutor(threads)


def _threads(rows: int, row: int) -> int:
    """Threads for rows of a size [cells times samples]."""
    return 1 if rows * row < ENOUGH else min(rows, _cores())


def _cores() -> int:
    """Threads that may work at once; one in a worker process: the others use the cores."""
    return 1 if parent_process() is not None else int(config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]


def side_by_side(function: Callable[[_Given], _Made], many: Sequence[_Given]) -> list[_Made]:
    """What a function makes of each of many, computed on all cores; simulations release the GIL."""
    threads = min(len(many), _cores())
    if threads <= 1:
        return [function(one) for one in many]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(function, many))


def _check_settings(gate_time: float, courant: float, step: float | None, places: Sequence[float]) -> None:
    if not (np.isfinite(gate_time) and gate_time >= 0):
        raise ConfigError(f"gate_time = {gate_time} s: expected 0 or more")
    if not 0 < courant <= COURANT_LIMIT:
        raise ConfigError(
            f"courant = {courant}: expected more than 0 and at most {COURANT_LIMIT}, beyond it is unstable"
        )
    if step is not None and not step > 0:
        raise ConfigError(f"step = {step} s: expected more than 0")
    for place in places:
        if not 0.0 <= place <= 1.0:
            raise ConfigError(f"places holds {place}: expected 0 (upstream) to 1 (downstream)")


def _shares(cells: int, places: Sequence[float]) -> Floats:
    """What of a flow at each place enters each cell, shape (places, cells)."""
    share = np.zeros((len(places), cells))
    for row, place in zip(share, places, strict=True):
        cell, weight = kernel.between(place * cells - 0.5, cells - 1)
        weight = min(max(weight, 0.0), 1.0)
        row[cell], row[cell + 1] = 1.0 - weight, weight
    return share


def _unsteady(channel: Channel, inflow: Floats, levels: Floats, day: int) -> RividError:
    return RividError(
        f"no steady flow of {inflow[day]:g} m3/s has the start level {levels[day]:g} m at x = L "
        f"(bed there {channel.bed[-1]:g} m) without a dry or critical place{_row(day, len(levels))}: "
        "raise the start level, or check bed, width and manning"
    )


def _row(day: int, days: int) -> str:
    return f", row {day}" if days > 1 else ""


def _failure(
    channel: Channel, when: str, step: float | None, courant: float, how: int, cell: int, value: float
) -> RividError:
    if how == kernel.UNSTABLE and value > 0.0:
        return ConfigError(
            f"step = {step:g} s is unstable {when} with dx = {channel.dx:.4g} m: expected at most "
            f"{value:.4g} s (a Courant number of {COURANT_LIMIT}), or fewer cells"
        )
    if how == kernel.UNSTABLE:
        return RividError(
            f"the flow blows up {when} (courant = {courant:g}, dx = {channel.dx:.4g} m): "
            "check the commands, or give a smaller courant"
        )
    return RividError(
        f"the reach runs dry {when}, {channel.x[cell]:.0f} m below the upstream dam: check inflow and "
        f"outflow, raise the start level, or give a smaller courant ({courant:g}; dx = {channel.dx:.4g} m)"
    )


def fastest_wave(channel: Channel, flow: float, level: float) -> float:
    """Largest |v| + sqrt(g A / B) of a steady flow with `level` at x = L [m/s]; RividError without any."""
    steady = simulate(channel, [0.0], [flow], [flow], level)
    return float(steady.end.clock[0, 2])


def arrival_time(channel: Channel, flow: ArrayLike, level: ArrayLike) -> Floats:
    """Travel time of a small wave from the upstream dam to the gauge [s], shape (days,).

    ``integral dx / (v + sqrt(g A / B))`` along the steady profile of flows [m3/s] and levels [m] of shape
    (days,): v + c of (3) and (4), with A / B for the depth. RividError where there is no subcritical flow.
    """
    q = np.atleast_1d(np.asarray(flow, float))
    levels = np.broadcast_to(np.asarray(level, float), q.shape)
    steady = simulate(channel, np.zeros((len(q), 1)), q[:, None], q[:, None], levels)
    area = steady.end.area
    width = channel.width(channel.level(area))
    celerity = q[:, None] / area + np.sqrt(GRAVITY * area / width)
    return np.asarray((channel.dx / celerity).sum(axis=1))
