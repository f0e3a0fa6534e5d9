"""Estimate a batch of days, and map batches over an engine.

:func:`estimate_batch` is a pure function: the same batch gives the same rows, and a day the same row in any
batch. A worker writes the segment of its batch itself, so that rows never travel between processes and
finished batches are kept. A killed worker costs only its batch, which is halved until the day that kills is
alone and failed.
"""

import datetime as dt
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
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
from rivid.results.tables import SEGMENT, lists, to_table, whole_numbers
from rivid.run.workers import Engine, each
from rivid.types import Bools, Floats

Done = Callable[[int], None]
Refused = tuple[int, int, str, DataError]
"""A row without an estimate: number of its window and of its estimator, status, and reason."""


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
    config, names = batch.config, batch.config.run.estimators
    alike: dict[tuple[int, bool], list[tuple[int, DataSet]]] = defaultdict(list)
    refused: list[Refused] = []
    order: list[int] = []  # of the rows, those that are refused last
    for at, window in enumerate(batch.windows):
        try:
            data = _read(batch, window)
        except DataError as error:
            status = "pending" if isinstance(error, PendingError) else "failed"
            refused += [(at, k, status, error) for k in range(len(names))]
        else:
            alike[len(data.inflow), data.outflow is None].append((at, data))
    tables = []
    with threadpool_limits(1):
        for group in alike.values():
            places = [at for at, _ in group]
            sets = [data for _, data in group]
            days, shared, notes = _measured([batch.windows[at] for at in places], sets, config)
            for k, (name, estimator) in enumerate(estimators.build(config).items()):
                if len(sets[0].inflow) < estimator.min_samples:
                    reason = DataError(
                        f"{len(sets[0].inflow)} samples are too few for {estimator.needed_for}: "
                        f"lower {estimator.key}, or raise [run] window_days"
                    )
                    refused += [(at, k, "failed", reason) for at in places]
                    continue
                order += [at * len(names) + k for at in places]
                tables.append(_rows(days, shared, notes, config, name, estimator))
    order += [at * len(names) + k for at, k, _, _ in refused]
    tables.append(_refused(batch, refused))
    return pa.concat_tables(tables).take(whole_numbers(np.argsort(order))).combine_chunks()


def _read(batch: Batch, window: Window) -> DataSet:
    if window.missing:
        days = ", ".join(str(day) for day in window.missing)
        raise DataError(f"a data set of {batch.config.run.window_days} days needs {days}: no log of that day")
    try:
        return read_window(batch.root, window.sources, batch.config, today=batch.now)
    except (OSError, MemoryError, ValueError) as error:
        raise DataError(f"cannot be read: {type(error).__name__}: {error}") from error


def _refused(batch: Batch, refused: Sequence[Refused]) -> pa.Table:
    """Rows without an estimate, and the reason."""
    windows, reach = [batch.windows[at] for at, _, _, _ in refused], batch.config.reach
    columns: dict[str, list[Any]] = {
        "key": [window.key for window in windows],
        "date": [window.date for window in windows],
        "reach": [reach.name] * len(windows),
        "estimator": [batch.config.run.estimators[k] for _, k, _, _ in refused],
        "status": [status for _, _, status, _ in refused],
        "output_unit": [reach.output_unit] * len(windows),
        "message": [printable(" ".join(str(reason).split())[:500]) for _, _, _, reason in refused],
    }
    return to_table(columns, SEGMENT)


def _measured(
    windows: list[Window], sets: list[DataSet], config: Config
) -> tuple[Days, dict[str, list[Any]], list[list[str]]]:
    """Data sets of one length: what estimators need, the columns they share, and remarks on each."""
    reach = config.reach
    inflow = np.stack([data.inflow for data in sets])
    output = np.stack([data.output for data in sets])
    outflow = [data.outflow for data in sets if data.outflow is not None]  # all of a group, or none
    days = Days.of(inflow, output, np.stack(outflow) if outflow else None, config.run.min_motion)
    notes = [[data.notes] if data.notes else [] for data in sets]
    mean_inflow = inflow.mean(axis=1)
    level = output.mean(axis=1) if reach.kind == "pool" else np.full(len(sets), np.nan)
    depth = np.full(len(sets), reach.depth)
    if reach.bed_level is not None and reach.kind == "pool":
        depth = level - reach.bed_level
        for i in np.flatnonzero(depth <= 0):
            notes[i].append(
                f"mean level {level[i]:.2f} m is not above [reach] bed_level: depth of [reach] taken"
            )
            depth[i] = reach.depth
    bounds = travel_bounds(mean_inflow, length=reach.length, width=reach.width, depth=depth)
    return days, {
        "key": [window.key for window in windows],
        "date": [window.date for window in windows],
        "reach": [reach.name] * len(sets),
        "output_unit": [reach.output_unit] * len(sets),
        "n_samples": [len(data.inflow) for data in sets],
        "n_filled": [data.n_filled for data in sets],
        "mean_inflow_m3s": mean_inflow.tolist(),
        "mean_level_m": level.tolist(),
        "froude": bounds.froude.tolist(),
        "bound_gravity_s": bounds.gravity.tolist(),
        "bound_kinematic_s": bounds.kinematic.tolist(),
    }, notes  # fmt: skip


def _rows(
    days: Days,
    shared: dict[str, list[Any]],
    notes: list[list[str]],
    config: Config,
    name: str,
    estimator: Prepared,
) -> pa.Table:
    """The rows of one estimator on data sets of one length."""
    answer, reach, n = estimator.estimate(days), config.reach, len(days.u)
    none = np.full(n, np.nan)

    def given(values: Floats | None) -> Floats:
        return none if values is None else values

    delay = given(answer.delay)
    identified: Bools = np.asarray(answer.status != "unidentifiable")
    searched: Bools = np.zeros(n, bool)
    if answer.candidates is not None and answer.curve is not None:
        searched = identified | np.isfinite(given(answer.probability))
    outside: Bools = np.zeros(n, bool) if answer.outside is None else answer.outside
    columns: dict[str, Any] = shared | {
        "estimator": [name] * n,
        "status": answer.status.tolist(),
        "delay_samples": delay.tolist(),
        "delay_s": ((delay if answer.travel is None else answer.travel) * reach.sample_time).tolist(),
        "noise_sd": np.sqrt(given(answer.noise_variance)).tolist(),
        "roughness_sd": np.sqrt(given(answer.roughness_variance)).tolist(),
        "iterations": [0] * n if answer.iterations is None else answer.iterations.tolist(),
        "message": ["; ".join(_notes(i, notes[i], answer, days, config, name, estimator)) for i in range(n)],
    }
    for column in ("probability", "delay_low", "delay_high", "alpha", "condition"):
        columns[column] = given(getattr(answer, column)).tolist()
    if answer.fir is not None:
        columns["fir"] = lists(answer.fir, identified)
        if answer.fir_sd is not None:
            columns["fir_sd"] = lists(answer.fir_sd, identified)
        if reach.kind == "river":
            columns["t50_samples"] = np.where(identified, half_time(answer.fir), np.nan).tolist()
    at_bound: Bools = np.zeros(n, bool)
    if answer.candidates is not None and answer.curve is not None:
        at_bound = np.isin(delay, answer.candidates[[0, -1]])
        columns["first_candidate"] = [int(answer.candidates[0]) if s else None for s in searched]
        columns["curve"] = lists(answer.curve, searched)
        if answer.prior_only is not None:
            columns["prior_only"] = _flags(answer.prior_only, searched)
        if answer.criterion is not None:
            columns["criterion"] = np.where(searched, answer.criterion.min(axis=1), np.nan).tolist()
    columns["at_bound"] = _flags(at_bound | outside, searched | outside)
    return to_table(columns, SEGMENT)


def _flags(flags: Bools, known: Bools) -> list[bool | None]:
    """Flags as cells, empty where they are not known."""
    return [flag if is_known else None for flag, is_known in zip(flags.tolist(), known, strict=True)]


def _notes(
    i: int, notes: list[str], answer: Answer, days: Days, config: Config, name: str, estimator: Prepared
) -> list[str]:
    """All remarks on day `i`, those on its data (`notes`) last."""
    first = []
    if answer.status[i] == "unidentifiable":
        first.append(_why(answer, i, days, config))
    elif ESTIMATORS[name].notes_bound and answer.candidates is not None and answer.delay is not None:
        first.append(_edge(answer.delay[i], answer.candidates))
    if answer.iterations is not None and estimator.max_iterations is not None:
        if answer.iterations[i] >= estimator.max_iterations:
            first.append(f"not settled after {estimator.max_iterations} rounds ([jmap] tolerance)")
    return [note for note in (*first, *notes) if note]


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
    number = np.nan if answer.condition is None else answer.condition[i]
    condition = f"condition number of U'U is {number:.1e}"
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
            reason = DataError("the worker process died on this day (out of memory?)")
            rows: list[Refused] = [(0, k, "failed", reason) for k in range(len(batch.config.run.estimators))]
            write_segment(segments, _refused(batch, rows))
            done(1)
            return
        middle = len(batch.windows) // 2
        for windows in (batch.windows[:middle], batch.windows[middle:]):
            _alone(replace(batch, windows=windows), segments, engine, done)
