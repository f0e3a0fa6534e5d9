"""Estimate a batch of days, and map batches over an engine.

:func:`estimate_batch` is a pure function: the same batch gives the same rows, and a day the same row in any
batch. A worker writes the segment of its batch itself, so that rows never travel between processes and
finished batches are kept. A killed worker costs only its batch, which is halved until the day that kills is
alone and failed.
"""

import datetime as dt
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from platform import node
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from rivid import estimators
from rivid.config import Config
from rivid.core.fir import half_time
from rivid.core.hydraulics import travel_bounds
from rivid.errors import DataError, PendingError, RividError, printable
from rivid.estimators import ESTIMATORS, Answer, Days, Prepared
from rivid.logs.days import DataSet, DaySource, read_window
from rivid.results.store import write_segment
from rivid.results.tables import SEGMENT, to_table
from rivid.run.workers import Engine, each
from rivid.types import Floats

Row = dict[str, Any]
Done = Callable[[int], None]


@dataclass(frozen=True)
class Window:
    """A data set to read: last date, logs, key of content and settings, missing days, key of content."""

    date: dt.date
    sources: tuple[DaySource, ...]
    key: str
    missing: tuple[dt.date, ...] = ()
    content: str = ""


@dataclass(frozen=True)
class Batch:
    """Windows to estimate together, with all that a worker needs."""

    root: Path
    config: Config
    windows: tuple[Window, ...]
    now: dt.date | dt.datetime


def estimate_batch(batch: Batch) -> pa.Table:
    """Read and estimate every window of a batch: a row of schema SEGMENT per window and estimator."""
    config = batch.config
    answers: dict[str, list[Row]] = {}
    names = config.run.estimators
    alike: dict[tuple[int, bool], list[tuple[Window, DataSet]]] = defaultdict(list)
    for window in batch.windows:
        try:
            data = _read(batch, window)
        except DataError as error:
            status = "pending" if isinstance(error, PendingError) else "failed"
            answers[window.key] = [_unread(window, config, name, status, error) for name in names]
        else:
            alike[len(data.inflow), data.outflow is None].append((window, data))
    with threadpool_limits(1):
        for group in alike.values():
            for window, rows in _estimate(group, config):
                answers[window.key] = rows
    return _table([row for window in batch.windows for row in answers[window.key]])


def _table(rows: list[Row]) -> pa.Table:
    return to_table({name: [row.get(name) for row in rows] for name in SEGMENT.names}, SEGMENT)


def _read(batch: Batch, window: Window) -> DataSet:
    if window.missing:
        days = ", ".join(str(day) for day in window.missing)
        raise DataError(f"a data set of {batch.config.run.window_days} days needs {days}: no log of that day")
    try:
        return read_window(batch.root, window.sources, batch.config, today=batch.now)
    except (OSError, MemoryError, ValueError) as error:
        raise DataError(f"cannot be read: {type(error).__name__}: {error}") from error


def _unread(window: Window, config: Config, name: str, status: str, error: DataError) -> Row:
    return {
        "key": window.key,
        "date": window.date,
        "reach": config.reach.name,
        "estimator": name,
        "status": status,
        "output_unit": config.reach.output_unit,
        "message": printable(" ".join(str(error).split())[:500]),
    }


def _estimate(group: list[tuple[Window, DataSet]], config: Config) -> list[tuple[Window, list[Row]]]:
    """All estimators on data sets of one length."""
    inflow = np.stack([data.inflow for _, data in group])
    output = np.stack([data.output for _, data in group])
    outflow = [data.outflow for _, data in group if data.outflow is not None]  # all of a group, or none
    days = Days.of(inflow, output, np.stack(outflow) if outflow else None, config.run.min_motion)
    answers: list[tuple[Window, list[Row]]] = [(window, []) for window, _ in group]
    for name, estimator in estimators.build(config).items():
        if days.u.shape[1] < estimator.min_samples:
            for (window, rows), (_, data) in zip(answers, group, strict=True):
                reason = DataError(
                    f"{len(data.inflow)} samples are too few for {estimator.needed_for}: "
                    f"lower {estimator.key}, or raise [run] window_days"
                )
                rows.append(_unread(window, config, name, "failed", reason))
            continue
        answer = estimator.estimate(days)
        for i, (window, data) in enumerate(group):
            answers[i][1].append(_row(window, data, config, name, estimator, answer, i, days))
    return answers


def _row(
    window: Window,
    data: DataSet,
    config: Config,
    name: str,
    estimator: Prepared,
    answer: Answer,
    i: int,
    days: Days,
) -> Row:
    reach = config.reach
    status, delay = str(answer.status[i]), _at(answer.delay, i)
    iterations = 0 if answer.iterations is None else int(answer.iterations[i])
    mean_inflow = float(data.inflow.mean())
    level = float(data.output.mean()) if reach.kind == "pool" else np.nan
    depth = reach.depth if reach.bed_level is None or np.isnan(level) else level - reach.bed_level
    notes = [data.notes] if data.notes else []
    if estimator.max_iterations is not None and iterations >= estimator.max_iterations:
        notes.insert(0, f"not settled after {estimator.max_iterations} rounds ([jmap] tolerance)")
    if status == "unidentifiable":
        notes.insert(0, _why(answer, i, days, config))
    elif ESTIMATORS[name].notes_bound and answer.candidates is not None:
        notes = [note for note in (_edge(delay, answer.candidates), *notes) if note]
    if depth <= 0:
        notes.append(f"mean level {level:.2f} m is not above [reach] bed_level: depth of [reach] taken")
        depth = reach.depth
    bounds = travel_bounds(mean_inflow, length=reach.length, width=reach.width, depth=depth)
    row: Row = {
        "key": window.key,
        "date": window.date,
        "reach": reach.name,
        "estimator": name,
        "status": status,
        "delay_samples": delay,
        "delay_s": (delay if answer.travel is None else _at(answer.travel, i)) * reach.sample_time,
        "probability": _at(answer.probability, i),
        "delay_low": _at(answer.delay_low, i),
        "delay_high": _at(answer.delay_high, i),
        "alpha": _at(answer.alpha, i),
        "noise_sd": float(np.sqrt(_at(answer.noise_variance, i))),
        "roughness_sd": float(np.sqrt(_at(answer.roughness_variance, i))),
        "output_unit": reach.output_unit,
        "iterations": iterations,
        "condition": _at(answer.condition, i),
        "n_samples": len(data.inflow),
        "n_filled": data.n_filled,
        "mean_inflow_m3s": mean_inflow,
        "mean_level_m": level,
        "froude": float(bounds.froude),
        "bound_gravity_s": float(bounds.gravity),
        "bound_kinematic_s": float(bounds.kinematic),
        "message": "; ".join(notes),
    }
    if status != "unidentifiable":
        if answer.fir is not None:
            row["fir"] = answer.fir[i]
            row["fir_sd"] = None if answer.fir_sd is None else answer.fir_sd[i]
            if reach.kind == "river":
                row["t50_samples"] = float(half_time(answer.fir[i : i + 1])[0])
    if status != "unidentifiable" or np.isfinite(_at(answer.probability, i)):
        if answer.candidates is not None and answer.curve is not None:
            row |= {
                "at_bound": delay in (answer.candidates[0], answer.candidates[-1]),
                "prior_only": None if answer.prior_only is None else bool(answer.prior_only[i]),
                "criterion": None if answer.criterion is None else float(np.min(answer.criterion[i])),
                "first_candidate": int(answer.candidates[0]),
                "curve": answer.curve[i],
            }
    if answer.outside is not None and answer.outside[i]:
        row["at_bound"] = True
    return row


def _at(values: Floats | None, i: int) -> float:
    """A day's value; NaN where the estimator has none."""
    return np.nan if values is None else float(values[i])


def _edge(delay: float, candidates: NDArray[np.intp]) -> str:
    """A remark on a delay at the edge of the candidates; empty elsewhere."""
    if delay == candidates[-1]:
        return f"d = {delay:.0f} is the longest delay tried: the true one may be longer"
    if delay == candidates[0]:
        return f"d = {delay:.0f} is the shortest delay tried: the true one may be shorter"
    return ""


def _why(answer: Answer, i: int, days: Days, config: Config) -> str:
    """Why a day cannot be identified."""
    if not days.u[i].any():
        return "the inflow does not move enough: nothing to identify"
    if not days.y[i].any():
        what = "level" if config.reach.kind == "pool" else "output discharge"
        return f"the {what} does not move: nothing to identify (gauge stuck?)"
    if answer.reason is not None and answer.reason[i]:
        return str(answer.reason[i])
    condition = f"condition number of U'U is {_at(answer.condition, i):.1e}"
    order, n = config.jmap_settings().order, days.u.shape[1]
    if 2 * order > n:  # fewer than two samples for each coefficient
        return (
            f"an FIR of order {order} is too long for {n} samples ({condition}): lower [jmap] order, "
            "or raise [run] window_days"
        )
    return f"the inflow moves too little: {condition}"


def run_batches(batches: Iterable[Batch], segments: Path, engine: Engine, done: Done) -> None:
    """Estimate batches as workers become free and write their segments, in a directory that all workers see.

    `done` is called with the number of windows of each batch that is finished.

    Raises
    ------
    RividError
        If a worker does not see DATA_DIR or OUT.
    """
    for (_, batch, _), _, lost in each(((work, batch, segments) for batch in batches), engine):
        if lost:
            _alone(batch, segments, engine, done)
        else:
            done(len(batch.windows))


def work(batch: Batch, segments: Path) -> None:
    """Estimate a batch and write its segment, in a worker.

    Raises
    ------
    RividError
        If it does not see the directory of the logs or of the segments: a lost disk is no failed day.
    """
    for place in (batch.root, segments):
        if not place.exists():
            raise RividError(
                f"a worker on {node()} does not see {place}: DATA_DIR and OUT must be there, under these "
                "paths, on every machine that works; what is done is kept"
            )
    write_segment(segments, estimate_batch(batch))


def _alone(batch: Batch, segments: Path, engine: Engine, done: Done) -> None:
    """Estimate alone a batch during which a worker died; halve it while it kills its worker."""
    try:
        with engine.one() as single:
            single.submit(work, batch, segments).result()
        done(len(batch.windows))
    except engine.died:
        if len(batch.windows) == 1:
            (window,), config = batch.windows, batch.config
            reason = DataError("the worker process died on this day (out of memory?)")
            rows = [_unread(window, config, name, "failed", reason) for name in config.run.estimators]
            write_segment(segments, _table(rows))
            done(1)
            return
        middle = len(batch.windows) // 2
        for windows in (batch.windows[:middle], batch.windows[middle:]):
            _alone(replace(batch, windows=windows), segments, engine, done)
