"""The days in DATA_DIR, and data sets of consecutive days: samples on the regular grid.

Files hold a day or many days; changes are found by content. The grid has its instants at k T_s from local
midnight: commands are held, measurements interpolated, gaps counted.
"""

import datetime as dt
import os
import stat
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import NoReturn
from zoneinfo import ZoneInfo

import numpy as np

from rivid.config import Config
from rivid.errors import ConfigError, DataError, NoDataError, PendingError, RividError
from rivid.logs import SUFFIXES, suffix_of
from rivid.logs.log import Log, load
from rivid.logs.spec import (
    DAY,
    MICRO,
    CutError,
    Signal,
    Spec,
    clock,
    day_bounds,
    is_day_file,
    local,
    shown,
    spec_of,
)
from rivid.logs.text import ColumnError
from rivid.text import day_range
from rivid.types import ONE_DAY, Bools, Floats, Ints

TimedValues = dict[str, tuple[Ints, Floats]]
"""Times [us UTC] and values by canonical column."""
Part = tuple[str, str, str]
"""Relative path of a file that holds a part of a day; SHA-256 (hex) of what matters for that day: the file,
or that day's rows in a file of many days; and SHA-256 of the file as it was listed."""


@dataclass(frozen=True)
class DaySource:
    """A day and the files that hold a part of it."""

    date: dt.date
    parts: tuple[Part, ...]

    def closing(self, path: str) -> bool:
        """Whether a file is the next day's, of which only the rows that close this day count."""
        return is_day_file(path) and path[:10] != self.date.isoformat()


@dataclass(frozen=True)
class FileFacts:
    """Facts about a file; stored, so that it is not hashed and opened again."""

    size: int
    mtime_ns: int
    ctime_ns: int  # it cannot be set: it finds a file with a restored modification time
    digest: str  # SHA-256 (hex) of the file
    # of a file of many days: digest of each, by ISO date. Empty for a day's file that holds no more than the
    # row at its midnight
    days: dict[str, str] | None = None
    settings: str = ""  # digest of the settings that this was found with
    # of `days`, those of which the file holds no more than the row at one of their midnights
    edges: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Catalog:
    """The content of DATA_DIR."""

    days: list[DaySource]  # in date order
    bad_files: list[tuple[str, str]]  # relative path, printable, and reason, of files of no day
    files: dict[str, FileFacts]  # by relative path


# a day's file of more rows or bytes holds more than the single row at its midnight, and is not opened
FEW_ROWS, FEW_BYTES = 4, 8192


def find_days(
    root: Path, config: Config, known: Mapping[str, FileFacts] | None = None, *, verify: bool = False
) -> Catalog:
    """List the days in DATA_DIR, or in one file; hidden files and files that are no logs are ignored.

    `known` are the `files` of an earlier catalog; with `verify`, files of known size and times are hashed
    again too. NoDataError where there is no log, ConfigError where the configuration is for exports.
    """
    key = 'layout = "long"' if config.input.layout == "long" else "hold" if config.input.hold else ""
    if key:
        raise ConfigError(
            f"[input] {key} is for exports: make daily logs of them with `rivid ingest` first, and use the "
            "configuration that it writes with these"
        )
    place = shown(str(root))
    paths = _candidates(root, place)
    within = None if root.is_file() else os.path.realpath(root)
    spec = spec_of(config)
    known = {} if verify or known is None else known
    bad: list[tuple[str, str]] = []
    files: dict[str, FileFacts] = {}
    # of each day: the parts that make it; those of a row at its midnights alone; the next day's file
    parts, edges, next_files = (defaultdict[dt.date, list[Part]](list) for _ in range(3))
    for path in paths:
        name = path.name
        try:
            files[name] = facts = _look(path, within, spec, known.get(name))
        except DataError as error:
            reason = str(error).removeprefix(shown(name)).lstrip(" ,:")  # both are shown together
            bad.append((shown(name), reason or str(error)))
            continue
        for iso, digest in ({name[:10]: facts.digest} if facts.days is None else facts.days).items():
            of_kind = edges if iso in facts.edges else parts
            of_kind[dt.date.fromisoformat(iso)].append((name, digest, facts.digest))
        if spec.latest and is_day_file(name):
            next_files[_date_of(name) - ONE_DAY].append((name, facts.digest, facts.digest))
    for date in parts:  # a row at midnight alone makes no day; with others it may complete one
        parts[date] += edges[date] + next_files[date]
    if not parts:
        names = ", YYYY-MM-DD".join(SUFFIXES)
        why = f"no logs in {place}: looked for YYYY-MM-DD{names}, or files of many days with these suffixes"
        if more := below(root):
            why = f"no logs in {place} itself: {more}"
        if bad:
            why = f"no log in {place} can be used: {bad[0][0]}: {bad[0][1]}"
        if files:
            why = f"no log in {place} holds more of a day than the row at its midnight"
        raise NoDataError(why)
    return Catalog([DaySource(date, tuple(parts[date])) for date in sorted(parts)], bad, files)


def below(root: Path) -> str:
    """Advice for logs in the directories of a directory; "" where there are none."""
    for folder, folders, names in os.walk(root):
        deep = len(Path(folder).relative_to(root).parts)
        # three levels are year, month and day
        folders[:] = sorted(name for name in folders if not name.startswith(".")) if deep < 3 else []
        if log := next((n for n in sorted(names) if suffix_of(n) and not n.startswith(".")), None):
            pattern = "/".join([shown(str(root)), *["*"] * (deep + 1)]) + str(suffix_of(log))
            made = f"`rivid ingest {pattern} --config CONFIG --out LOGS`"
            return f"make one directory of their logs with {made}, and give that one"
    return ""


def unread(root: Path, known: Mapping[str, FileFacts]) -> list[Path]:
    """Files of many days in a directory that are new or changed since `known` was found."""
    if not root.is_dir():
        return []
    paths = [path for path in _candidates(root, shown(str(root))) if not is_day_file(path.name)]
    return [path for path in paths if path.is_file() and not _is_known(path.stat(), known.get(path.name))]


def look_ahead(path: Path, config: Config) -> FileFacts | None:
    """The facts of a file in DATA_DIR, in a worker; None where :func:`find_days` has to report an error."""
    try:
        spec = spec_of(config)
        return _look(path, os.path.realpath(path.parent), spec, None)
    except (RividError, OSError, ValueError, MemoryError):
        return None


def _is_known(status: os.stat_result, known: FileFacts | None) -> bool:
    """Whether size and times of a file are as they were."""
    stamp = status.st_size, status.st_mtime_ns, status.st_ctime_ns
    return known is not None and (known.size, known.mtime_ns, known.ctime_ns) == stamp


def _candidates(root: Path, name: str) -> list[Path]:
    """Paths that may be logs, in order of name."""
    try:
        if root.is_file():
            if suffix_of(root.name) is None:
                raise NoDataError(
                    f"{name} is no log: expected a directory, or a file ending in {', '.join(SUFFIXES)}"
                )
            return [root]
        names = sorted(os.listdir(root))
    except OSError as error:
        raise NoDataError(f"{name} cannot be read: {error.strerror}; expected a directory of logs") from None
    return [root / name for name in names if suffix_of(name) and not name.startswith(".")]


def _look(path: Path, inside: str | None, spec: Spec, known: FileFacts | None) -> FileFacts:
    """The facts of a file; a link must not lead out of `inside`."""
    try:
        if inside is not None and path.is_symlink():
            if not Path(os.path.realpath(path, strict=True)).is_relative_to(inside):
                raise DataError(
                    "is a link that leads out of the directory of logs: put the file itself there"
                )
        status = path.stat()
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror}") from None
    if not stat.S_ISREG(status.st_mode):
        folder = stat.S_ISDIR(status.st_mode)
        raise DataError("is a directory: expected a file" if folder else "is not a regular file")
    date = _date_of(path.name) if is_day_file(path.name) else None
    if known is not None and _is_known(status, known) and known.settings == spec.digest:
        return known
    stamp = status.st_size, status.st_mtime_ns, status.st_ctime_ns
    if date is not None:
        digest, rows = _hash(path, status.st_size)
        few = rows <= spec.input.skip_rows + spec.input.unit_rows + FEW_ROWS
        edge = spec.latest and few and _is_edge(path, spec, date)
        return FileFacts(*stamp, digest, {} if edge else None, spec.digest)
    log = load(path, spec, fresh=True)
    dates = log.dates()
    if not dates:
        raise DataError("has no values in the required columns")
    days = {date.isoformat(): log.digest_of(date) for date in dates}
    edges = [date.isoformat() for date in dates if log.is_edge(date)]
    return FileFacts(*stamp, log.digest, days, spec.digest, edges)


def _is_edge(path: Path, spec: Spec, date: dt.date) -> bool:
    """Whether a day's file holds no more than the row at its midnight: an end of the day before."""
    try:
        log = load(path, spec, fresh=True)
    except DataError:
        return False
    start, end = log.bounds(date)
    return log.is_edge(date) and start <= log.times[0] and log.times[-1] < end


def _date_of(name: str) -> dt.date:
    try:
        return dt.date.fromisoformat(name[:10])
    except ValueError:
        raise DataError(f"{name[:10]} is no date: expected YYYY-MM-DD") from None


def _hash(path: Path, size: int) -> tuple[str, int]:
    """Digest of a day's file, and about how many lines it has, or bytes where they cannot be counted."""
    if size > DAY[0]:  # its data will not be read either
        return sha256(f"too large: {size}".encode()).hexdigest(), size
    try:
        with open(path, "rb", buffering=0) as file:
            content = file.read(size + 1)
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror}") from None
    plain = suffix_of(path.name) == ".csv"
    return sha256(content).hexdigest(), content.count(b"\n") if plain else max(size - FEW_BYTES, 0)


UNLIKE = 0.02  # part of an interval by which the steps of a log may differ from it: clocks are rounded

# a step of this many usual intervals means that a value is missing between; less is an unsteady clock
MISSED = 1.5


class TrailingGap(DataError):
    """The log ends before its day does."""


@dataclass(frozen=True)
class Grid:
    """Regular instants of consecutive local days."""

    start: int  # first local midnight [us UTC]
    end: int  # midnight after the last day [us UTC]
    times: Ints  # (N,) ``start + k T_s``, N = ceil((end - start) / T_s) [us UTC]
    zone: dt.tzinfo  # for messages


def make_grid(start: int, end: int, period: float, zone: dt.tzinfo) -> Grid:
    """The grid of the local days from `start` to `end` [us UTC] at `period` T_s [s].

    >>> len(make_grid(0, 86_400_000_000, 133.0, dt.timezone.utc).times)
    650
    """
    count = -int(-(end - start) // (period * MICRO))
    return Grid(start, end, start + np.rint(np.arange(count) * (period * MICRO)).astype(np.int64), zone)


def sampled(
    series: TimedValues, grid: Grid, signals: Sequence[Signal], spec: Spec
) -> tuple[dict[str, Floats], int]:
    """Samples (N,) of each signal, and how many instants lie in a gap of any; DataError for too many."""
    samples, filled = {}, np.zeros(len(grid.times), bool)
    for signal in signals:
        times, values = series[signal.name]
        if signal.supposed:
            _refuse_supposed(times, signal, spec)
        samples[signal.name], bridged = on_grid(times, values, grid, signal, spec)
        filled |= bridged
    if filled.mean() > spec.input.max_filled:
        _refuse_filled(float(filled.mean()), series, spec)
    return samples, int(filled.sum())


def on_grid(times: Ints, values: Floats, grid: Grid, signal: Signal, spec: Spec) -> tuple[Floats, Bools]:
    """Samples (N,) of ascending times [us UTC] and values, and where a gap was bridged.

    DataError for a gap longer than `[input] max_gap`; TrailingGap where it is at the end.
    """
    late = spec.tolerance
    if len(times) == len(grid.times) and np.abs(times - grid.times).max() <= late:
        return values, np.zeros(len(times), bool)
    if not len(times):
        raise TrailingGap(f"no {signal.name} at all ({_limit(spec)})")
    _refuse_gaps(times, grid, signal, spec)
    after = times.searchsorted(grid.times + late, side="right")
    before = np.maximum(after - 1, 0)  # ahead of the first value, that one
    # means keep the volume: the last value before an instant would shift a flow with stamps between the
    # instants by up to a sample
    edges = np.append(grid.times, grid.end)
    samples = held_means(times, values, edges) if signal.held else np.interp(grid.times, times, values)
    # where a value is missing, what comes later than one interval after the last is not measured but bridged
    bounded = np.append(times, max(grid.end, int(times[-1])))
    missed = np.diff(bounded) > MISSED * signal.spacing
    age = grid.times - times[before]
    filled = (missed[before] & (age >= signal.spacing - late)) | (age < -late)
    if not signal.held:
        exact = np.minimum(np.abs(age), np.abs(bounded[before + 1] - grid.times)) <= late
        filled |= missed[before] & (age > late)
        filled &= ~exact | (age < -late)
    return samples, filled


def held_means(times: Ints, values: Floats, edges: Ints) -> Floats:
    """Means of held values between each two edges (N + 1,) [us UTC]; the first value holds before it, too."""
    every = np.union1d(times, edges)
    every = every[every.searchsorted(edges[0]) : every.searchsorted(edges[-1]) + 1]
    held = values[np.maximum(times.searchsorted(every[:-1], side="right") - 1, 0)]
    first = every.searchsorted(edges[:-1])
    means = np.add.reduceat(held * np.diff(every), first) / np.diff(edges)
    low, high = np.minimum.reduceat(held, first), np.maximum.reduceat(held, first)
    return np.where(low == high, low, means)  # what rests, rests to the last bit


def _refuse_gaps(times: Ints, grid: Grid, signal: Signal, spec: Spec) -> None:
    """A gap is the time without a value: it begins one interval after the last one before it."""
    spacing = signal.spacing
    ends = np.append(times, grid.end)
    begins = np.append(grid.start, times + spacing)
    gaps = np.where(ends - begins > (MISSED - 1) * spacing, ends - begins, 0)
    gaps[0] = ends[0] - begins[0] if ends[0] - begins[0] > spacing + spec.tolerance else 0
    allowed = spec.max_gap + spec.tolerance
    if gaps.max() <= allowed:
        return
    worst = int(np.argmax(gaps))
    begin = clock(int(begins[worst]), grid.zone, grid.end - grid.start > 25 * 3600 * MICRO)
    text = f"gap of {_span(int(gaps[worst]))} from {begin} in {signal.name}"
    usual = int(np.median(np.diff(times))) if len(times) > 2 else 0
    if usual > MISSED * spacing:
        raise DataError(f"{text}: {_coarse(signal, usual, spec)}")
    if gaps[:-1].max() > allowed:
        held, day = int(times[-1] - times[0]), grid.end - grid.start
        whole = 2 * held < day and gaps[1:-1].max(initial=0) <= allowed < gaps[-1]
        part = f"; for a log of {_span(held)}, shorter than a day, set [run] window" if whole else ""
        raise DataError(f"{text} ({_limit(spec)}){part}")
    if gaps[-1] <= signal.shift + spec.tolerance:
        text += ": the row that closes the day is the first of the next one's log, and is not there"
    raise TrailingGap(f"{text} ({_limit(spec)})")


def _refuse_supposed(times: Ints, signal: Signal, spec: Spec) -> None:
    """Raise DataError where stamps were moved by T_s but the intervals differ: the shift decides d."""
    usual = int(np.median(np.diff(times))) if len(times) > 2 else signal.spacing
    if abs(usual - signal.spacing) > max(UNLIKE * signal.spacing, spec.tolerance):
        raise DataError(
            f'{signal.name} is stamped at the end of its interval ([input.stamp] "end") and comes every '
            f"{usual / MICRO:g} s, not every {signal.spacing / MICRO:g} s as [reach] sample_time: "
            f"set [input.interval] {signal.name} = {usual / MICRO:g}"
        )


def _refuse_filled(share: float, series: TimedValues, spec: Spec) -> NoReturn:
    """Raise DataError for a data set of which too much was bridged."""
    text = f"{share:.0%} of the samples lie in gaps (limit {spec.input.max_filled:.0%}, [input] max_filled)"
    steps = {
        signal.name: int(np.median(np.diff(times))) if len(times := series[signal.name][0]) > 1 else 0
        for signal in spec.signals
    }
    coarse = [signal for signal in spec.signals if steps[signal.name] > MISSED * signal.spacing]
    if coarse:
        finest = min(steps.values()) if len(coarse) == len(spec.signals) else 0
        text += f"; {_coarse(coarse[0], steps[coarse[0].name], spec, finest)}"
    raise DataError(text)


def _coarse(signal: Signal, usual: int, spec: Spec, finest: int | None = None) -> str:
    """Advice for a column that comes less often than it should.

    `finest` is the step of the column that comes most often: 0 where one of them comes often enough, None
    where the others are not known.
    """
    declare = f"set [input.interval] {signal.name} = {usual / MICRO:g}"
    every = f"{signal.name} comes every {_span(usual)}"
    if finest == 0 or signal.spacing != round(spec.period * MICRO):
        return f"{every}: if that is its interval, {declare}"
    declared = f"[reach] sample_time = {spec.period:g} s, but"
    period = declared if spec.period_set else "[reach] sample_time is not set:"
    sample_time = f"set [reach] sample_time = {(finest or usual) / MICRO:g}"
    if finest:
        only = f"or, where that is the interval of one column only, {declare}"
        return f"{period} the log comes every {finest / MICRO:g} s: {sample_time}; {only}"
    return f"{period} {every}: {sample_time} if all columns do; if that is its interval, {declare}"


def _limit(spec: Spec) -> str:
    return f"limit {_span(spec.max_gap)}, [input] max_gap"


def _span(micros: int) -> str:
    seconds = micros / MICRO
    if seconds < 120:
        return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.3g} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


# where a day ends last: what is not yet over there may not be over at a clock of unknown zone
LAST_ZONE = dt.timezone(dt.timedelta(hours=-12))
OFFSETS = "have different UTC offsets: set [input] time_zone to the zone whose days are meant"


class ChangedError(DataError):
    """A log that is not what was listed."""


@dataclass(frozen=True)
class DataSet:
    """Samples of consecutive days at T_s; each series has the shape (N,)."""

    date: dt.date  # the last day's
    inflow: Floats  # u_Qi [m3/s]
    outflow: Floats | None  # u_Qo [m3/s]; None where it is not logged, and for a river
    output: Floats  # the level h_L [m], or a river's discharge Q_L [m3/s]
    n_filled: int  # samples that bridge a gap in any column
    notes: str  # counts of what was dropped, masked or sorted, or empty


Span = tuple[int, int]
"""Start and end of a data set shorter than a day [us UTC]."""


def spans_of(root: Path, source: DaySource, config: Config) -> tuple[list[Span], dt.tzinfo]:
    """Cut a day's log into data sets of `[run] window`; return them and the zone of the log.

    They follow each other from the first row on, and again from the first row after each pause that no data
    set may hold; the rest of a stretch is left out. DataError where the log cannot be read, or is too short.
    """
    spec, length = spec_of(config), round(config.run.window_s * MICRO)
    series, zone = _day(_folder(root), source, spec, Counter())
    if not all(len(times) for times, _ in series.values()):
        raise DataError(f"the log of {source.date} has an empty column")
    times, begin = series["u_Qi"][0], max(int(times[0]) for times, _ in series.values())
    spacing = spec.signals[0].spacing  # of u_Qi
    pause = spacing + min(spec.max_gap, round(spec.input.max_filled * length))
    spans = []
    for part in np.split(times, np.flatnonzero(np.diff(times) > pause) + 1):
        first = max(int(part[0]), begin)
        for k in range((int(part[-1]) + spacing + spec.tolerance - first) // length):
            spans.append((first + k * length, first + (k + 1) * length))
    if not spans:
        raise DataError(f"the log of {source.date} holds no {config.run.window} in a row ([run] window)")
    return spans, zone


def read_window(
    root: Path,
    sources: Sequence[DaySource],
    config: Config,
    *,
    today: dt.date | dt.datetime | None = None,
    span: Span | None = None,
) -> DataSet:
    """Read consecutive days, in date order, or a span of :func:`spans_of`, and put them on one grid.

    `root` is DATA_DIR, or the one file that was given for it. Of a moment (aware), `today` is the day in the
    log's own zone. DataError with the reason for which these days cannot be used; PendingError where the last
    day is `today` or later and its log is not finished.
    """
    spec, folder, last = spec_of(config), _folder(root), sources[-1]
    try:
        return _read(folder, sources, spec, span)
    except (TrailingGap, CutError) as error:
        cut = isinstance(error, CutError)
        torn = any(shown(path) in str(error) for path, *_ in last.parts)
        if (torn or not cut) and _may_grow(folder, last, spec, today):
            state = "being written" if cut else "not finished"
            raise PendingError(f"the log of {last.date} is {state}: {error}") from None
        raise DataError(str(error)) from None


def now_at(config: Config) -> dt.date | dt.datetime:
    """Today in the time zone of the reach; without one the current time, dated by the offset of a log."""
    moment, zone = dt.datetime.now(dt.UTC), config.input.time_zone
    return moment.astimezone(ZoneInfo(zone)).date() if zone else moment


def _folder(root: Path) -> Path:
    """The directory of the logs: DATA_DIR, or that of the one file that was given for it."""
    return root.parent if suffix_of(root.name) and root.is_file() else root


def _may_grow(root: Path, source: DaySource, spec: Spec, today: dt.date | dt.datetime | None) -> bool:
    """Whether a day's log may be unfinished."""
    if not isinstance(today, dt.datetime):
        return today is not None and source.date >= today
    declared = spec.input.time_zone
    zone: dt.tzinfo = ZoneInfo(declared) if declared else LAST_ZONE
    for path, *_ in source.parts:
        with suppress(DataError):  # where not a row of it can be read yet
            zone = load(root / path, spec).zone
            break
    return source.date >= today.astimezone(zone).date()


def refuse_columns(root: Path, days: Sequence[DaySource], config: Config) -> None:
    """ConfigError, before any work, where the first, the middle and the last day all lack a column.

    One odd log among others fails its day only.
    """
    folder, spec = _folder(root), spec_of(config)
    reasons = []
    for at in {0, len(days) // 2, len(days) - 1}:
        path, *_ = days[at].parts[0]
        try:
            load(folder / path, spec)
            return
        except ColumnError as error:
            reasons.append(str(error))
        except DataError:
            return  # the day's own fault
    raise ConfigError(min(reasons))


def _read(root: Path, sources: Sequence[DaySource], spec: Spec, span: Span | None) -> DataSet:
    notes: Counter[str] = Counter()
    days = [_day(root, source, spec, notes) for source in sources]
    bounds = [day_bounds(source.date, zone) for source, (_, zone) in zip(sources, days, strict=True)]
    for (a, b), ((_, end), (start, _)) in zip(pairwise(sources), pairwise(bounds), strict=True):
        if end != start:
            why = OFFSETS if b.date - a.date == ONE_DAY else "are not consecutive days"
            raise DataError(f"{a.date} and {b.date} {why}")
    series = {name: _join([day[name] for day, _ in days]) for name in days[0][0]}
    start, end = span or (bounds[0][0], bounds[-1][1])
    for name, (times, values) in series.items() if span else ():  # from the last value at its start on
        low = max(int(times.searchsorted(start + spec.tolerance, side="right")) - 1, 0)
        high = int(times.searchsorted(end - spec.tolerance))
        series[name] = times[low:high], values[low:high]
    grid = make_grid(start, end, spec.period, days[0][1])
    samples, n_filled = sampled(series, grid, spec.signals, spec)
    return DataSet(
        date=sources[-1].date,
        inflow=samples["u_Qi"],
        outflow=samples.get("u_Qo"),
        output=samples[spec.output],
        n_filled=n_filled,
        notes=", ".join(f"{count} {kind}" for kind, count in sorted(notes.items())),
    )


def _day(root: Path, source: DaySource, spec: Spec, notes: Counter[str]) -> tuple[TimedValues, dt.tzinfo]:
    """The series of a day from all its files."""
    date, logs = source.date, []
    for part in source.parts:
        if source.closing(path := part[0]):
            continue
        log = _as_listed(root, part, date, spec)
        faults = log.faults if is_day_file(path) else log.faults_of(date)
        if faults:
            more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
            kind = CutError if all(fault.cut for fault in faults) else DataError
            raise kind(f"{log.name}, {faults[0].text}{more}")
        notes.update(log.events_of(date))
        if is_day_file(path):
            _count_outside(log, date, notes)
        logs.append(log)
    series, zone = logs[0].of_day(date), logs[0].zone
    if len(logs) > 1:
        if len({day_bounds(date, log.zone) for log in logs}) > 1:
            raise DataError(f"the logs of {date} {OFFSETS}")
        parts = [log.of_day(date) for log in logs]
        paths = " and ".join(log.name for log in logs)
        series = {name: _merge([p[name] for p in parts], name, paths, zone, notes) for name in series}
    for part in source.parts:
        if not source.closing(part[0]):
            continue
        try:
            log = _as_listed(root, part, date, spec)
        except ChangedError:
            raise
        except DataError:
            continue  # the next day's fault: without its row, the gap at the end decides
        series = _closed(series, log, logs[0].bounds(date)[1])
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
    again = np.flatnonzero(np.diff(times) == 0) + 1
    if len(conflict := again[values[again] != values[again - 1]]):
        i = int(conflict[0])
        moment = clock(int(times[i]), zone, with_date=True)
        raise DataError(f"{paths} disagree about {name} at {moment}: {values[i - 1]:.6g} and {values[i]:.6g}")
    if len(again):
        notes[f"values of {name} in two files"] += len(again)
    return np.delete(times, again), np.delete(values, again)


def _closed(series: TimedValues, log: Log, end: int) -> TimedValues:
    """A day with the rows of the next day's log that belong to it; those of its own come first."""
    closed = dict(series)
    for name, (times, values) in log.closing(end).items():
        own, _ = series[name]
        first = int(times.searchsorted(own[-1] + log.spec.tolerance, side="right")) if len(own) else 0
        if first < len(times):
            closed[name] = _join([series[name], (times[first:], values[first:])])
            if log.faults and log.faults[0].at < end + log.spec.latest:
                raise DataError(f"{log.name}, {log.faults[0].text}")
    return closed


def _as_listed(root: Path, part: Part, date: dt.date, spec: Spec) -> Log:
    """A listed log. Results are stored under the digest of what was listed: refuse anything else."""
    path, digest, of_file = part
    for fresh in (False, True):
        log = load(root / path, spec, fresh=fresh)
        if log.digest == of_file:
            return log
        if not is_day_file(path) and log.digest_of(date) == digest:
            return log  # other days of the file have changed
    raise ChangedError(f"{log.name} is not what it was when it was listed: run again, with --verify")


def _count_outside(log: Log, date: dt.date, notes: Counter[str]) -> None:
    """Count the rows of a day's file that are of other days."""
    start, end = log.bounds(date)
    # a row of the first midnight may close the day before
    low, high = log.times.searchsorted((start, end + log.spec.latest)).tolist()
    if low == high:
        first, last = (local(int(time), log.zone).date() for time in log.times[[0, -1]])
        held = day_range(first, last)
        raise DataError(
            f"{log.name} holds {held} and nothing of {date}: check its name and [input] time_zone"
        )
    if outside := len(log.times) - (high - low):
        notes["rows of other days dropped"] += outside


def read_series(
    root: Path, sources: Sequence[DaySource], config: Config
) -> tuple[TimedValues, dt.tzinfo | None, list[str]]:
    """Values of some days as they are logged, on no grid; the zone of the last day that was read, if any.

    Days that cannot be read are left out; their reasons are returned too.
    """
    spec, folder = spec_of(config), _folder(root)
    parts: list[TimedValues] = []
    zone, refused = None, []
    for source in sources:
        try:
            series, zone = _day(folder, source, spec, Counter())
        except DataError as error:
            refused.append(str(error))
        else:
            parts.append(series)
    none = {signal.name: (np.empty(0, np.int64), np.empty(0)) for signal in spec.signals}
    return {name: _join([part[name] for part in parts or [none]]) for name in none}, zone, refused
