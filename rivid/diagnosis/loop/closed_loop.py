"""The reach with its operators in the loop, driven by the logged inflow alone, on the sealed days.

An open loop is told what was let out, and drifts as soon as water is missing. In a closed loop the operators
see the simulated level and act on it: the level stays, and what is missing shows in what they let out.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.loop.operator_law import Law, identify, judged
from rivid.diagnosis.loop.result import ClosedLoop, LoopDay, LoopErrors
from rivid.diagnosis.loop.run import Run, cut, first_level, run_day
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.model.fit import Model
    from rivid.diagnosis.study import Study

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
