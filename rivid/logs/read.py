"""A data set: the samples of one local day, or of several in a row, on the regular grid."""

import datetime as dt
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from rivid.config import Config
from rivid.errors import ConfigError, DataError, PendingError
from rivid.logs.catalog import DaySource, Part
from rivid.logs.columns import ColumnError
from rivid.logs.files import CutError, is_day_file
from rivid.logs.grid import TrailingGap, make_grid, on_grid, refuse_filled, refuse_supposed
from rivid.logs.log import Log, load
from rivid.logs.spec import Spec, spec_of
from rivid.logs.times import LAST_ZONE, clock, day_bounds, local, zone_named
from rivid.types import ONE_DAY, Floats, Ints

Series = dict[str, tuple[Ints, Floats]]
"""Times [us UTC] and values by canonical column."""
OFFSETS = "have different UTC offsets: set [input] time_zone to the zone whose days are meant"


class ChangedError(DataError):
    """A log that is not what was listed."""


@dataclass(frozen=True)
class DataSet:
    """Samples of consecutive days at T_s.

    Attributes
    ----------
    date : date
        The last day's.
    inflow : ndarray, (N,)
        u_Qi [m3/s].
    outflow : ndarray, (N,), or None
        u_Qo [m3/s]; None where it is not logged, and for a river.
    output : ndarray, (N,)
        Level h_L [m], or a river's discharge Q_L [m3/s].
    n_filled : int
        Samples that bridge a gap in any column.
    notes : str
        What was dropped, masked or sorted, with counts; empty where nothing was.
    """

    date: dt.date
    inflow: Floats
    outflow: Floats | None
    output: Floats
    n_filled: int
    notes: str


def read_window(
    root: Path, sources: Sequence[DaySource], config: Config, *, today: dt.date | dt.datetime | None = None
) -> DataSet:
    """Read consecutive days and put them on one grid.

    Parameters
    ----------
    root : Path
        DATA_DIR, or the one file that was given for it.
    sources : sequence of DaySource
        In date order.
    config : Config
    today : date or aware datetime, optional
        A log of this day may be unfinished; of a moment, the day is that of the log's own zone.

    Returns
    -------
    DataSet

    Raises
    ------
    DataError
        The reason for which these days cannot be used; it names file and, where known, line.
    PendingError
        Where the last day is `today` or later and its log is not finished.
    """
    spec, folder, last = spec_of(config), root if root.is_dir() else root.parent, sources[-1]
    try:
        return _read(folder, sources, spec)
    except TrailingGap as error:
        if _may_grow(folder, last, spec, today):
            raise PendingError(f"the log of {last.date} is not finished: {error}") from None
        raise DataError(str(error)) from None
    except CutError as error:
        torn = any(part.name in str(error) for part in last.parts)
        if torn and _may_grow(folder, last, spec, today):
            raise PendingError(f"the log of {last.date} is being written: {error}") from None
        raise DataError(str(error)) from None


def _may_grow(root: Path, source: DaySource, spec: Spec, today: dt.date | dt.datetime | None) -> bool:
    """Whether a day's log may be unfinished."""
    if not isinstance(today, dt.datetime):
        return today is not None and source.date >= today
    declared = spec.input.time_zone
    zone = zone_named(declared) if declared else LAST_ZONE
    for part in source.parts if not declared else ():
        try:
            zone = load(root / part.path, part.name, spec).zone
        except DataError:
            continue  # not a row of it can be read yet
        break
    return source.date >= today.astimezone(zone).date()


def refuse_columns(root: Path, days: Sequence[DaySource], config: Config) -> None:
    """Refuse, before any work, a configuration that names columns which the logs do not have.

    Parameters
    ----------
    root : Path
    days : sequence of DaySource
        All days; the first, the middle and the last are read.
    config : Config

    Raises
    ------
    ConfigError
        Where a column is missing or doubled in each of these; one odd log among others fails its day only.
    """
    folder, spec = root if root.is_dir() else root.parent, spec_of(config)
    reasons = []
    for at in {0, len(days) // 2, len(days) - 1}:
        part = days[at].parts[0]
        try:
            load(folder / part.path, part.name, spec)
        except ColumnError as error:
            reasons.append(str(error))
        except DataError:
            return  # the day's own fault
        else:
            return
    if reasons:
        raise ConfigError(min(reasons))


def _read(root: Path, sources: Sequence[DaySource], spec: Spec) -> DataSet:
    notes: Counter[str] = Counter()
    days = [_day(root, source, spec, notes) for source in sources]
    bounds = [day_bounds(source.date, zone) for source, (_, zone) in zip(sources, days, strict=True)]
    for k, ((_, end), (start, _)) in enumerate(pairwise(bounds)):
        if end != start:
            a, b = sources[k].date, sources[k + 1].date
            if b - a == ONE_DAY:
                raise DataError(f"{a} and {b} {OFFSETS}")
            raise DataError(f"{a} and {b} are not consecutive days")
    series = days[0][0]
    if len(days) > 1:
        series = {name: _join([day[name] for day, _ in days]) for name in series}
    grid = make_grid(bounds[0][0], bounds[-1][1], spec.period, days[0][1], len(sources))
    samples: dict[str, Floats] = {}
    all_filled = None
    for signal in spec.signals:
        if signal.supposed:
            refuse_supposed(series[signal.name][0], signal, spec)
        samples[signal.name], filled = on_grid(*series[signal.name], grid, signal, spec)
        if filled is not None:
            all_filled = filled if all_filled is None else all_filled | filled
    if all_filled is not None:
        refuse_filled(all_filled, series, spec)
    return DataSet(
        date=sources[-1].date,
        inflow=samples["u_Qi"],
        outflow=samples.get("u_Qo"),
        output=samples[spec.output],
        n_filled=0 if all_filled is None else int(all_filled.sum()),
        notes=", ".join(f"{count} {kind}" for kind, count in sorted(notes.items())),
    )


def _day(root: Path, source: DaySource, spec: Spec, notes: Counter[str]) -> tuple[Series, dt.tzinfo]:
    """The series of a day from all its files."""
    date = source.date
    own = [part for part in source.parts if not part.closes(date)]
    logs = []
    for part in own:
        log = _as_listed(root, part, date, spec)
        faults = log.faults if is_day_file(part.path) else log.faults_of(date)
        if faults:
            more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
            kind = CutError if all(fault.cut for fault in faults) else DataError
            raise kind(f"{part.name}, {faults[0].text}{more}")
        notes.update(log.events_of(date))
        if is_day_file(part.path):
            _count_outside(log, part, date, notes)
        logs.append(log)
    series, zone = logs[0].of_day(date), logs[0].zone
    if len(logs) > 1:
        if len({day_bounds(date, log.zone) for log in logs}) > 1:
            raise DataError(f"the logs of {date} {OFFSETS}")
        parts = [log.of_day(date) for log in logs]
        paths = " and ".join(part.name for part in own)
        series = {name: _merge([p[name] for p in parts], name, paths, zone, notes) for name in series}
    for part in source.parts:
        if part.closes(date):
            series = _closed(series, root, part, date, logs[0].bounds(date)[1], spec)
    return series, zone


def _join(parts: list[tuple[Ints, Floats]]) -> tuple[Ints, Floats]:
    return np.concatenate([t for t, _ in parts]), np.concatenate([v for _, v in parts])


def _merge(
    parts: list[tuple[Ints, Floats]], name: str, paths: str, zone: dt.tzinfo, notes: Counter[str]
) -> tuple[Ints, Floats]:
    """One column of a day from several files; where they overlap they must agree."""
    times, values = _join(parts)
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    repeated = np.r_[False, np.diff(times) == 0][: len(times)]
    conflict = np.flatnonzero(repeated & (values != np.roll(values, 1)))
    if len(conflict):
        i = int(conflict[0])
        moment = clock(int(times[i]), zone, with_date=True)
        raise DataError(f"{paths} disagree about {name} at {moment}: {values[i - 1]:.6g} and {values[i]:.6g}")
    if repeated.any():
        notes[f"values of {name} in two files"] += int(repeated.sum())
    return times[~repeated], values[~repeated]


def _closed(series: Series, root: Path, part: Part, date: dt.date, end: int, spec: Spec) -> Series:
    """A day with the rows of the next day's file that belong to it; its own file's come first."""
    try:
        log = _as_listed(root, part, date, spec)
    except ChangedError:
        raise
    except DataError:
        return series  # the next day's fault: without its row, the gap at the end decides
    closed = {}
    for name, (times, values) in log.closing(end).items():
        own = series[name]
        new = times > own[0][-1] + spec.tolerance if len(own[0]) else np.ones(len(times), bool)
        closed[name] = _join([own, (times[new], values[new])]) if new.any() else own
    if any(closed[name] is not series[name] for name in closed):
        for fault in log.faults:
            if fault.at < end + spec.latest:
                raise DataError(f"{part.name}, {fault.text}")
    return closed


def _as_listed(root: Path, part: Part, date: dt.date, spec: Spec) -> Log:
    """The log of a part. Results are stored under the digest of what was listed: refuse anything else."""
    for fresh in (False, True):
        log = load(root / part.path, part.name, spec, fresh=fresh)
        if (log.digest if is_day_file(part.path) else log.digest_of(date)) == part.digest:
            return log
    raise ChangedError(f"{part.name} is not what it was when it was listed: run again, with --verify")


def _count_outside(log: Log, part: Part, date: dt.date, notes: Counter[str]) -> None:
    """Count the rows of a day's file that are of other days."""
    start, end = log.bounds(date)
    if log.times[0] >= start and log.times[-1] < end:
        return
    # a row of the first midnight may close the day before
    low, high = log.times.searchsorted((start, end + log.spec.latest)).tolist()
    outside = len(log.times) - (high - low)
    if outside == len(log.times):
        held = sorted({local(int(t), log.zone).date() for t in (log.times[0], log.times[-1])})
        span = " to ".join(str(day) for day in held)
        raise DataError(
            f"{part.name} holds {span} and nothing of {date}: check its name and [input] time_zone"
        )
    if outside:
        notes["rows of other days dropped"] += outside
