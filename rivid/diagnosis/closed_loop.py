"""One day of the reach with its operators in the loop, driven by the inflow alone."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.operators import Law, day_flow, identify, judged, late
from rivid.diagnosis.response.base import Response, gauge_of, start_level, vector_of
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.response.linear import LinearPool
from rivid.diagnosis.result import ClosedLoop, LoopDay, LoopErrors
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.reach.loop import People, exchange_arrays, gate_arrays
from rivid.reach.operators import quantise
from rivid.reach.pool import supply
from rivid.reach.response import LinearReach
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.fit import Model
    from rivid.diagnosis.study import Study


TURNS = 6
"""Times at most that a day is run anew with the corrections of the outflow that it decided."""
SETTLED = 1e-3
"""Change of the level from turn to turn that ends them [m]."""
READINGS = 5
"""Readings whose mean sets a day's first level."""


class Run(NamedTuple):
    """One day in closed loop: from sample `first` of its row on, arrays of shape (n - first,).

    Attributes
    ----------
    first : int
    level : ndarray
        What the gauge would show [m].
    outflow : ndarray
        Commands [m3/s].
    """

    first: int
    level: Floats
    outflow: Floats


def run_day(reach: Response, law: Law, day: Record, changes: Changes) -> Run:
    """One day with the operators in the loop.

    Parameters
    ----------
    reach : Response
        A pool: :class:`HydraulicResponse` or :class:`LinearPool`.
    law : Law
    day : Record
        One row.
    changes : Changes
        On this row.

    Raises
    ------
    RividError
        Where the water runs dry, or the response is of another kind.
    """
    first = int(np.argmax(day.used[0]))
    plain = without_fronts(reach)
    outflow = day.outflow.copy()
    level = np.full(day.time.shape[1] - first, np.nan)
    for _ in range(TURNS):
        beside = gauge_of(day, changes) + _fronts(reach, plain, day, changes, outflow)
        before = level
        if isinstance(plain, HydraulicResponse):
            level, decided = _channel(plain, law, day, changes, beside[0], first)
        elif isinstance(plain, LinearPool):
            level, decided = _pool(plain, law, day, changes, beside[0], first)
        else:
            raise RividError(f"closed loop of {reach.name}: expected a pool, saint-venant or linear")
        outflow[0, first:] = decided
        if plain is reach or np.abs(level - before).max() < SETTLED:
            break
    return Run(first, level, decided)


def people_of(law: Law, day: Record, first: int, beside: Floats, water: float) -> People:
    """The operators of a day from sample `first` on, who begin with the logged command.

    Parameters
    ----------
    law : Law
    day : Record
        One row.
    first : int
    beside : ndarray, shape (n - first,)
        What the gauge gives above the simulated water [m].
    water : float
        That water at the first sample [m].
    """
    inflow = late(day.inflow, law.lag)[0, first:]
    n = len(inflow)
    aim = float(law.set_point.at(day_flow(day))[0])
    off = float(quantise(np.array(water + beside[0]), law.gauge_quantum)) - aim
    error = float(np.copysign(max(abs(off) - law.dead_band, 0.0), off))
    # The loop begins with the inflow let through and all of the first error answered: here neither is so.
    start = float(day.outflow[0, first]) - law.level_gain * error
    return People(
        inflow=start + law.feedforward * (inflow - inflow[0]),
        disturbance=beside,
        aim=np.full(n, aim),
        feedforward=np.ones(n),
        level_gain=np.full(n, -law.level_gain),
        wait=np.full(n, law.look),
        dead_band=law.dead_band,
        trim_time=law.trim_time,
        notice=law.notice * abs(law.feedforward) if law.feedforward != 0.0 else np.inf,
        quantum=law.quantum,
        lowest=law.lowest,
        gauge_quantum=law.gauge_quantum,
    )


def cut(changes: Changes, shape: tuple[int, int], part: Any) -> Changes:
    """Changes on a part of the grid: `part` is an index of it that keeps whole rows or samples."""

    def of(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value if value.size == 1 else np.broadcast_to(value, shape)[part]
        if isinstance(value, tuple):
            return tuple(of(each) for each in value)
        if is_dataclass(value) and not isinstance(value, type):
            return replace(value, **{f.name: of(getattr(value, f.name)) for f in fields(value)})
        return value

    return cast(Changes, of(changes))


def _channel(
    reach: HydraulicResponse, law: Law, day: Record, changes: Changes, beside: Floats, first: int
) -> tuple[Floats, Floats]:
    from rivid.reach.saint_venant import simulate

    channel = reach.channel.with_area_slope(changes.area_slope, changes.area_reference)
    shape, time, inflow = day.time.shape, day.time[0], day.inflow[0]
    past = simulate(
        channel, time[: first + 1], inflow[: first + 1], day.outflow[0, : first + 1],
        start_level(day.output - gauge_of(day, changes), reach.level),
        changes=cut(changes, shape, np.s_[:, : first + 1]), gate_time=reach.gate_time,
    )  # fmt: skip
    seen = beside[first:] + first_level(day, past.level + beside[: first + 1])
    people = people_of(law, day, first, seen, float(past.level[-1]))
    flow = simulate(
        channel, time[first:], inflow[first:], people, past.end,
        changes=cut(changes, shape, np.s_[:, first:]), gate_time=reach.gate_time,
    )  # fmt: skip
    return flow.level + seen, flow.outflow


def _pool(
    reach: LinearPool, law: Law, day: Record, changes: Changes, beside: Floats, first: int
) -> tuple[Floats, Floats]:
    from rivid.reach.pool import hold

    area, delay, gain = (p.natural for p in reach.parameters[:3])
    shape, time, inflow = day.time.shape, day.time[0], day.inflow[0]
    whole = cut(changes, shape, np.s_[0])
    came = supply(LinearReach(surface_area=area, inflow_gain=gain), time, inflow, delay, inflow[0], whole)
    start = first_level(day, np.zeros(first + 1)) - gauge_of(day, changes)[0, first]
    seen = beside[first:] - beside[first] + gauge_of(day, changes)[0, first]
    people = people_of(law, day, first, seen, start)
    later = cut(changes, shape, np.s_[:, first:])
    n = len(time) - first
    level, decided, released = np.empty(n), np.zeros(n), np.empty(n)
    hold(
        time[first:], came[first:], decided, gate_arrays(later, (1, n)), exchange_arrays(later, (1, n)),
        people, 1.0, area, changes.area_slope, changes.area_reference, start, level, released,
    )  # fmt: skip
    if not np.isfinite(level).all():
        raise RividError("the pool runs out of surface in closed loop: check area_slope")
    return level + seen, decided


def without_fronts(reach: Response) -> Response:
    """The same reach without what is a plain sum of lagged flows, which no loop over time contains."""
    if isinstance(reach, LinearPool):
        if reach.fronts == "none":
            return reach
        return replace(reach, parameters=reach.parameters[:3], fronts="none", lags=())
    values = vector_of(reach)
    lagged = [i for i, p in enumerate(reach.parameters) if p.name.startswith(("outflow_lag", "inflow_lag"))]
    if not values[lagged].any():
        return reach
    values[lagged] = 0.0
    return reach.with_parameters(values)


def _fronts(reach: Response, plain: Response, day: Record, changes: Changes, outflow: Floats) -> Floats:
    """What those lagged flows add to the level, shape (1, n) [m]."""
    if plain is reach:
        return np.zeros(day.time.shape)
    decided = replace(day, outflow=outflow)
    added = reach.simulate(decided, changes) - plain.simulate(decided, changes)
    if not np.isfinite(added).all():
        raise RividError("the water does not follow the decided outflow to the day's end")
    return added


def first_level(day: Record, simulated: Floats) -> float:
    """Measured less simulated level over the last readings up to a day's first sample that counts [m]."""
    end = len(simulated)
    off = (day.output[0, :end] - simulated)[max(end - READINGS, 0) :]
    return float(np.mean(off[np.isfinite(off)]))


LEAST_R2 = 0.5
"""A law that explains less of the hourly changes of the outflow is not put into a loop."""
FEWEST_DAYS = 3
"""Sealed days to its end, below which nothing is told of them."""
SHOWN = 0.8
"""Of the days, this share was simulated better than the one that is shown, before anything was added."""


def closed_loop(study: "Study") -> ClosedLoop | None:
    """Level and outflow of the sealed days with the operators in the loop, beside the measured ones.

    Parameters
    ----------
    study : Study

    Returns
    -------
    ClosedLoop or None
        None for a river reach. Without errors, but with a reason, where the logs show no operators that a
        law could stand for.

    Notes
    -----
    Each day starts from the water that the logs before its first sample that counts have made, with the
    level set to the measured one and the command to the logged one; from there only the inflow is logged.
    """
    record = study.record
    if record.kind != "pool":
        return None
    law = identify(record.take(study.split.fit))
    if law is None:
        return ClosedLoop(None, "The outflow hardly moves: how it is commanded cannot be seen.")
    told = judged(law, record.take(study.split.select))
    if told.r2 < LEAST_R2:
        return ClosedLoop(
            told,
            f"Inflow and level explain {100 * max(told.r2, 0.0):.0f} % of the hourly changes of the outflow: "
            f"expected {100 * LEAST_R2:.0f} % or more to put the operators into the loop.",
        )
    rows = np.flatnonzero(study.split.sealed & record.used.any(axis=1))
    models = (study.first, study.last)
    changes = [cut(model.changes(record), record.time.shape, rows) for model in models]
    sealed = record.take(rows)
    runs = [
        [
            _tried(model, law, sealed.take([i]), cut(change, sealed.time.shape, np.s_[i : i + 1]))
            for i in range(sealed.days)
        ]
        for model, change in zip(models, changes, strict=True)
    ]
    whole = np.array([a is not None and b is not None for a, b in zip(*runs, strict=True)])
    if whole.sum() < FEWEST_DAYS:
        return ClosedLoop(
            told, f"With these operators the simulated water goes to the end of {whole.sum()} days only."
        )
    kept, errors, levels, outflows = sealed.take(whole), [], [sealed.output[whole]], [sealed.outflow[whole]]
    for model, change, of in zip(models, changes, runs, strict=True):
        done = [run for run, goes in zip(of, whole, strict=True) if run is not None and goes]
        levels.append(_rows(done, kept, "level"))
        outflows.append(_rows(done, kept, "outflow"))
        opened = _opened(model, kept, cut(change, sealed.time.shape, whole))
        errors.append(
            LoopErrors(
                _rms(opened - kept.output, kept), _rms(levels[-1] - kept.output, kept),
                _rms(outflows[-1] - kept.outflow, kept), _spread(levels[-1], kept),
            )
        )  # fmt: skip
    return ClosedLoop(
        told, "", kept.days, _spread(kept.output, kept), errors[0], errors[1],
        _shown(kept, levels, outflows),
    )  # fmt: skip


def _tried(model: "Model", law: Law, day: Record, changes: Changes) -> Run | None:
    try:
        return run_day(model.reach, law, day, changes)
    except RividError:
        return None


def _rows(runs: list[Run], record: Record, what: str) -> Floats:
    """Runs as rows of the record, NaN before their first sample; shape (days, n)."""
    rows = np.full(record.time.shape, np.nan)
    for row, run in zip(rows, runs, strict=True):
        row[run.first :] = getattr(run, what)
    return rows


def _opened(model: "Model", sealed: Record, changes: Changes) -> Floats:
    """The level with the logged outflow, set to the measured one as the closed loop is, shape (days, n)."""
    level = model.reach.simulate(sealed, changes)
    for i, row in enumerate(level):
        first = int(np.argmax(sealed.used[i]))
        row += first_level(sealed.take([i]), row[: first + 1])
    return level


def _rms(off: Floats, record: Record) -> float:
    kept = off[record.used & np.isfinite(off)]
    return float(np.sqrt(np.mean(kept**2))) if kept.size else np.nan


def _spread(level: Floats, record: Record) -> float:
    """Standard deviation about each day's mean."""
    there = np.where(record.used, level, np.nan)
    return _rms(there - np.nanmean(there, axis=1, keepdims=True), record)


def _shown(sealed: Record, level: Sequence[Floats], outflow: Sequence[Floats]) -> LoopDay:
    """The day at :data:`SHOWN` of the errors of the outflow, without the effects."""
    off = np.where(sealed.used, outflow[1] - outflow[0], np.nan)
    order = np.argsort(np.nanmean(off**2, axis=1), kind="stable")
    i = int(order[round(SHOWN * (len(order) - 1))])
    kept = sealed.used[i, sealed.lead :]

    def told(values: Floats) -> tuple[float, ...]:
        return tuple(np.where(kept, values[i, sealed.lead :], np.nan).tolist())

    return LoopDay(
        sealed.dates[i], tuple(sealed.hour[i, sealed.lead :].tolist()), told(sealed.inflow),
        tuple(told(v) for v in level), tuple(told(v) for v in outflow),
    )  # fmt: skip
