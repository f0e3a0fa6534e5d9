"""Simulation of the sealed days with the operators in the loop, driven by the logged inflow alone.

An open loop uses the logged outflow and drifts as soon as water is missing. In a closed loop the operators
act on the simulated level: the level is held, and the missing water appears in their outflow.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.decision import Study
from rivid.diagnosis.fit import Model
from rivid.diagnosis.operators import Law, day_flow, identify, validate
from rivid.diagnosis.response.base import Response, cut, gauge_of, lagged, start_level, vector_of
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.result import ClosedLoop, LoopDay, LoopErrors
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.reach.gate import OperatorArrays, exchange_arrays, gate_arrays
from rivid.reach.integrator import LinearReach, hold, supply
from rivid.reach.operators import quantise
from rivid.reach.saint_venant import simulate
from rivid.types import Floats

TURNS = 6
"""Maximum number of runs of a day, each with the front corrections for the outflow of the previous run."""
CONVERGED = 1e-3  # change of the level between runs at which they end [m]
READINGS = 5  # number of readings averaged for a day's initial level
LEAST_R2 = 0.5
"""Least share of the outflow's hourly changes that a law must explain for a closed-loop simulation."""
FEWEST_DAYS = 3  # fewest sealed days simulated to their end for which errors are reported
SHOWN = 0.8  # quantile of the days' outflow errors, without the effects, that selects the day in the figure


def run_day(reach: Response, law: Law, day: Record, changes: Changes) -> tuple[Floats, Floats]:
    """Simulate level [m] and commands [m3/s] of one day with the operators in the loop, shape (n,) each.

    NaN before the first used sample. `day` is a record of one row, `changes` those on it. Raises RividError
    if the pool runs dry.
    """
    first = int(np.argmax(day.used[0]))
    plain = without_fronts(reach)
    outflow = day.outflow.copy()
    level = np.full(day.time.shape[1] - first, np.nan)
    for _ in range(TURNS):
        offset = gauge_of(day, changes) + _fronts(reach, plain, day, changes, outflow)
        before = level
        run = _channel if isinstance(plain, HydraulicResponse) else _pool
        level, commands = run(plain, law, day, changes, offset[0], first)
        outflow[0, first:] = commands
        if plain is reach or np.abs(level - before).max() < CONVERGED:
            break
    unknown = np.full(first, np.nan)
    return np.concatenate([unknown, level]), np.concatenate([unknown, commands])


def _operators(law: Law, day: Record, first: int, offset: Floats, water: float) -> OperatorArrays:
    """Return the operators of a day from sample `first` on, starting from the logged command.

    `offset` (n - first,) is the gauge's reading above the simulated water [m], `water` that water at the
    first sample [m].
    """
    inflow = lagged(day.inflow, law.lag)[0, first:]
    n = len(inflow)
    aim = float(law.set_point.at(day_flow(day))[0])
    off = float(quantise(np.array(water + offset[0]), law.gauge_quantum)) - aim
    error = float(np.copysign(max(abs(off) - law.dead_band, 0.0), off))
    # The loop adds the response to the inflow and to the first error: both are subtracted here.
    start = float(day.outflow[0, first]) - law.level_gain * error
    return OperatorArrays(
        inflow=start + law.feedforward * (inflow - inflow[0]), disturbance=offset, aim=np.full(n, aim),
        feedforward=np.ones(n), level_gain=np.full(n, -law.level_gain), wait=np.full(n, law.look),
        dead_band=law.dead_band, trim_time=law.trim_time,
        notice=law.notice * abs(law.feedforward) if law.feedforward != 0.0 else np.inf,
        quantum=law.quantum, lowest=law.lowest, gauge_quantum=law.gauge_quantum,
    )  # fmt: skip


def _channel(
    reach: Any, law: Law, day: Record, changes: Changes, offset: Floats, first: int
) -> tuple[Floats, Floats]:
    """Run the channel of a Saint-Venant response."""
    channel = reach.channel.with_area_slope(changes.area_slope, changes.area_reference)
    shape, time, inflow = day.time.shape, day.time[0], day.inflow[0]
    past = simulate(
        channel, time[: first + 1], inflow[: first + 1], day.outflow[0, : first + 1],
        start_level(day.output - gauge_of(day, changes), reach.level),
        changes=cut(changes, shape, np.s_[:, : first + 1]), gate_time=reach.gate_time,
        speed=reach.pace * channel.length,
    )  # fmt: skip
    seen = offset[first:] + first_level(day, past.level + offset[: first + 1])
    operators = _operators(law, day, first, seen, float(past.level[-1]))
    flow = simulate(
        channel, time[first:], inflow[first:], operators, past.end,
        changes=cut(changes, shape, np.s_[:, first:]), gate_time=reach.gate_time,
    )  # fmt: skip
    return flow.level + seen, flow.outflow


def _pool(
    reach: Any, law: Law, day: Record, changes: Changes, offset: Floats, first: int
) -> tuple[Floats, Floats]:
    """Run the integrator with delay of a linear response."""
    area, _, gain = (p.natural for p in reach.parameters[:3])
    delay = float(reach.delay(day)[0, 0])
    shape, time, inflow = day.time.shape, day.time[0], day.inflow[0]
    whole = cut(changes, shape, np.s_[0])
    came = supply(LinearReach(surface_area=area, inflow_gain=gain), time, inflow, delay, inflow[0], whole)
    start = first_level(day, np.zeros(first + 1)) - gauge_of(day, changes)[0, first]
    seen = offset[first:] - offset[first] + gauge_of(day, changes)[0, first]
    operators = _operators(law, day, first, seen, start)
    later = cut(changes, shape, np.s_[:, first:])
    n = len(time) - first
    level, commands, released = np.empty(n), np.zeros(n), np.empty(n)
    hold(
        time[first:], came[first:], commands, gate_arrays(later, (1, n)), exchange_arrays(later, (1, n)),
        operators, 1.0, area, changes.area_slope, changes.area_reference, start, level, released,
    )  # fmt: skip
    if not np.isfinite(level).all():
        raise RividError("the pool runs out of surface in closed loop: check area_slope")
    return level + seen, commands


def without_fronts(reach: Response) -> Response:
    """Return the reach without its sums of lagged flows, which the time loop does not include."""
    values = vector_of(reach)
    lagged = [i for i, p in enumerate(reach.parameters) if p.name.startswith(("outflow_lag", "inflow_lag"))]
    if not values[lagged].any():
        return reach
    values[lagged] = 0.0
    return reach.with_parameters(values)


def _fronts(reach: Response, plain: Response, day: Record, changes: Changes, outflow: Floats) -> Floats:
    """Return the contribution of those lagged flows to the level, shape (1, n) [m]."""
    if plain is reach:
        return np.zeros(day.time.shape)
    commanded = replace(day, outflow=outflow)
    added = reach.simulate(commanded, changes) - plain.simulate(commanded, changes)
    if not np.isfinite(added).all():
        raise RividError("the water cannot follow the commanded outflow to the day's end")
    return added


def first_level(day: Record, simulated: Floats) -> float:
    """Return measured minus simulated level over the last readings up to a day's first used sample [m]."""
    end = len(simulated)
    off = (day.output[0, :end] - simulated)[max(end - READINGS, 0) :]
    return float(np.mean(off[np.isfinite(off)]))


def closed_loop(study: Study) -> ClosedLoop | None:
    """Compare level and outflow with the operators in the loop with the measured ones of the sealed days."""
    # Each day starts from the state simulated from the logs before its first used sample, with the measured
    # level and the logged command; from there on only the inflow is logged. Returns None for a river reach,
    # and a reason without errors if the logs do not follow a law.
    record = study.record
    if record.kind != "pool":
        return None
    law = identify(record.take(study.split.fit))
    if law is None:
        return ClosedLoop(None, "The outflow hardly moves: how it is commanded cannot be seen.")
    operators = validate(law, record.take(study.split.select))
    if operators.r2 < LEAST_R2:
        return ClosedLoop(
            operators,
            f"Inflow and level explain {100 * max(operators.r2, 0.0):.0f} % of the hourly changes of the "
            f"outflow: expected {100 * LEAST_R2:.0f} % or more to put the operators into the loop.",
        )
    rows = np.flatnonzero(study.split.sealed & record.used.any(axis=1))
    models = (study.first.whole, study.last.whole)
    changes = [cut(model.changes(record), record.time.shape, rows) for model in models]
    sealed = record.take(rows)
    runs = np.full((2, sealed.days, 2, sealed.time.shape[1]), np.nan)
    whole = np.ones(sealed.days, bool)
    for m, (model, change) in enumerate(zip(models, changes, strict=True)):
        for i in range(sealed.days):
            part = cut(change, sealed.time.shape, np.s_[i : i + 1])
            try:
                runs[m, i] = run_day(model.reach, law, sealed.take([i]), part)
            except RividError:
                whole[i] = False
    if whole.sum() < FEWEST_DAYS:
        return ClosedLoop(
            operators,
            f"With these operators the simulated water goes to the end of {whole.sum()} days only.",
        )
    kept = sealed.take(whole)
    levels = [kept.output, *runs[:, whole, 0]]
    outflows = [kept.outflow, *runs[:, whole, 1]]
    errors = []
    for m, (model, change) in enumerate(zip(models, changes, strict=True), start=1):
        opened = _opened(model, kept, cut(change, sealed.time.shape, whole))
        errors.append(
            LoopErrors(
                _rms(opened - kept.output, kept), _rms(levels[m] - kept.output, kept),
                _rms(outflows[m] - kept.outflow, kept), _spread(levels[m], kept),
            )
        )  # fmt: skip
    return ClosedLoop(
        operators, "", kept.days, _spread(kept.output, kept), errors[0], errors[1],
        _shown(kept, levels, outflows),
    )  # fmt: skip


def _opened(model: Model, sealed: Record, changes: Changes) -> Floats:
    """Simulate the level with the logged outflow, started as the closed loop, shape (days, n)."""
    level = model.reach.simulate(sealed, changes)
    for i, row in enumerate(level):
        first = int(np.argmax(sealed.used[i]))
        row += first_level(sealed.take([i]), row[: first + 1])
    return level


def _rms(off: Floats, record: Record) -> float:
    kept = off[record.used & np.isfinite(off)]
    return float(np.sqrt(np.mean(kept**2))) if kept.size else np.nan


def _spread(level: Floats, record: Record) -> float:
    """Return the standard deviation about each day's mean."""
    there = np.where(record.used, level, np.nan)
    return _rms(there - np.nanmean(there, axis=1, keepdims=True), record)


def _shown(sealed: Record, level: Sequence[Floats], outflow: Sequence[Floats]) -> LoopDay:
    """Return the day at the quantile :data:`SHOWN` of the outflow errors without the effects."""
    off = np.where(sealed.used, outflow[1] - outflow[0], np.nan)
    order = np.argsort(np.nanmean(off**2, axis=1), kind="stable")
    i = int(order[round(SHOWN * (len(order) - 1))])
    kept = sealed.used[i, sealed.lead :]

    def row(values: Floats) -> tuple[float, ...]:
        return tuple(np.where(kept, values[i, sealed.lead :], np.nan).tolist())

    return LoopDay(
        sealed.dates[i], tuple(sealed.hour[i, sealed.lead :].tolist()), row(sealed.inflow),
        tuple(row(v) for v in level), tuple(row(v) for v in outflow),
    )  # fmt: skip
