"""Exports of other systems to daily logs: only what is declared, and every value accounted for.

The files are joined to one series per source, the sources make canonical columns, and each day is judged as
`rivid run` would; then the days are written, and the configuration for them.
"""

import datetime as dt
import difflib
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import reduce
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from rivid.atomic import replacing, write_text
from rivid.config import Config, parse
from rivid.database import queried
from rivid.errors import ConfigError, DataError, NoDataError
from rivid.input_config import UNITS, InputConfig
from rivid.logs import SUFFIXES, suffix_of
from rivid.logs.days import OFFSETS, Grid, TimedValues, TrailingGap, make_grid, sampled
from rivid.logs.log import (
    at_midnights,
    days_of,
    in_utc,
    read_table,
    repeated,
    suspect,
    table_of,
    zone_of,
)
from rivid.logs.sniff.columns import bracketed, looks_like_flags, stated_unit
from rivid.logs.spec import MANY, MICRO, Signal, Spec, clocks_change, day_bounds, is_day_file, shown, spec_of
from rivid.logs.text import FLAG, Columns, Fault, Table, UndeclaredError
from rivid.logs.write import Format, rows_as_bytes
from rivid.types import ONE_DAY, Floats, Ints

EMPTY = frozenset(InputConfig().missing)  # marks that no system writes for a state of its instruments
_Piece = tuple[str, Columns, Ints, Floats, NDArray[np.int8]]
"""A source in one file: file name, columns, times [us UTC], values and statuses."""


class ValueStatus(IntEnum):
    """Whether a value is used, or why not; :data:`REASONS` are the names of the reasons."""

    USED, MISSING, STATUS, FLAG, SENTINEL, TIME, DUPLICATE = range(7)
    UNMATCHED, BETWEEN, REFUSED, PENDING, OUTSIDE, STANDING, UNREADABLE = range(7, 14)


REASONS = (
    *("missing", "status text", "flag", "sentinel", "ambiguous or impossible time", "duplicate"),
    *("part of a sum missing", "between samples", "refused day", "unfinished day", "not asked for"),
    *("other log in place", "unreadable row"),
)
"""Why values are not used: in the table and the JSON, in the order of :class:`ValueStatus` from 1 on."""


@dataclass(eq=False)
class Series:
    """A source: a column of the wide layout, a tag of the long."""

    name: str
    times: Ints  # (n,) ascending [us UTC]; some may repeat
    values: Floats  # (n,) in the source's unit; NaN where the status is a reason
    statuses: NDArray[np.int8]  # (n,) :class:`ValueStatus`; the caller sets what becomes of the days
    unsorted: int = 0
    unreadable: int = 0


def read_exports(paths: Sequence[Path], spec: Spec, rows: bytes = b"") -> list[Table]:
    """Read all files, and the rows of a query; UndeclaredError for what none of them holds or declares."""
    tables = [read_table(path, spec, export=True) for path in dict.fromkeys(paths)]
    if rows:
        tables.append(table_of(rows, spec, "the query", MANY, "", export=True))
    for table in tables:
        _refuse_flags(table, spec)
        _refuse_units(table, spec)
    found = {name for table in tables for columns in table.parts for name in columns.numbers}
    for table in tables:
        # a file of other tags only is no fault; a file of these without a usable row is
        if table.lacking and (not found or not table.others):
            raise UndeclaredError(f"{table.name}, {table.lacking}")
    for role, source in ((signal.name, source) for signal in spec.signals for source in signal.sources):
        if source not in found:
            unread = {name for table in tables for name in (*table.others, *table.cells)}
            near = difflib.get_close_matches(source, unread, n=1, cutoff=0.3)
            nearest = f"; nearest is {near[0]!r}" if near else ""
            raise UndeclaredError(
                f"no export holds {source!r} for {role}{nearest}: set [input] {role} to the export's own name"
            )
    return tables


def _refuse_flags(table: Table, spec: Spec) -> None:
    """Values that an undeclared flag marks as doubtful would be taken as measured."""
    read = {*spec.sources, spec.input.value}
    for column, texts in table.cells.items():
        if column in spec.input.ignore or not looks_like_flags(column, texts, read):
            continue
        few = ", ".join(repr(text[:20]) for text in sorted(texts or ())[:6])
        more = ", ..." if texts and len(texts) > 6 else ""
        raise UndeclaredError(
            f"{table.name}: column {column!r} ({few}{more}) may hold flags or zones: set [input] quality and "
            f"good, or zone_column; if it is neither, ignore = [{column!r}]"
        )


def _refuse_units(table: Table, spec: Spec) -> None:
    """A unit that the file states and the configuration does not would be a factor in the values."""
    present = {name for columns in table.parts for name in columns.numbers}
    for signal in spec.signals:
        if signal.name in spec.input.units:
            continue
        for source in signal.sources:
            if source not in present:
                continue
            text = table.units.get(source) or bracketed(source)
            unit = stated_unit(source, text, level=signal.name == "h_L")
            if not unit and re.fullmatch(r"[^/ ]{1,8} ?/ ?[a-z]{1,4}", text, re.I):
                raise UndeclaredError(
                    f"{table.name}: {source!r} seems to be in {text}: expected one of "
                    f"{', '.join(UNITS[signal.name])}; convert it, or set [input.units] {signal.name}"
                )
            if unit and unit != spec.input.unit(signal.name):
                raise UndeclaredError(
                    f"{table.name}: {source!r} seems to be in {unit}: set [input.units] "
                    f'{signal.name} = "{unit}", or to what it is'
                )


def gather(tables: Sequence[Table], spec: Spec) -> tuple[dt.tzinfo, dict[str, Series], list[Fault]]:
    """The zone of the local days, the series of all files, and the faults of their days in order of time."""
    parts = [(table.name, columns) for table in tables for columns in table.parts]
    zones = {zone_of(columns, spec, file): file for file, columns in parts}
    zone, *_ = zones
    if len({day_bounds(dt.date(2000, 1, 1), each) for each in zones}) > 1:
        one, other, *_ = zones.values()
        raise UndeclaredError(f'{one} and {other} {OFFSETS}, for example "Europe/Paris"')
    faults: list[Fault] = []
    pieces: dict[str, list[_Piece]] = {source: [] for source in spec.sources}
    for file, columns in parts:
        times, wrong = in_utc(columns, zone, spec)
        rows = [fault.at for fault in wrong]
        wrong += suspect(columns, times, spec, zone)
        # the day of an unreadable row is not known: the row counts for the days of both neighbours
        wrong += [bad._replace(at=bad.at - k) for bad in columns.bad for k in (0, 1)]
        places = [int(times[min(max(fault.at, 0), len(times) - 1)]) for fault in wrong]
        faults += {f._replace(at=at, text=f"{file}, {f.text}") for at, f in zip(places, wrong, strict=True)}
        for name in columns.numbers:
            piece = _piece(name, columns, times, file, spec)
            piece[-1][rows] = ValueStatus.TIME
            pieces[name].append(piece)
    series = {name: _join(name, found, zone, faults) for name, found in pieces.items()}
    return zone, series, sorted(faults)


def _piece(name: str, columns: Columns, times: Ints, file: str, spec: Spec) -> _Piece:
    values = columns.numbers[name]
    statuses = np.where(np.isfinite(values), ValueStatus.USED, ValueStatus.MISSING).astype(np.int8)
    for row, text in columns.why.get(name, {}).items():
        of_text = ValueStatus.MISSING if text in EMPTY else ValueStatus.STATUS
        statuses[row] = ValueStatus.FLAG if text.startswith(FLAG) else of_text
    statuses[np.isin(values, spec.input.sentinels)] = ValueStatus.SENTINEL
    return file, columns, times, np.where(statuses == ValueStatus.USED, values, np.nan), statuses


def _join(name: str, pieces: list[_Piece], zone: dt.tzinfo, faults: list[Fault]) -> Series:
    files, all_columns, all_times, all_values, all_statuses = zip(*pieces, strict=True)
    starts = np.cumsum([0, *map(len, all_times)])

    def place(row: int) -> str:
        piece = int(starts.searchsorted(order[row], "right")) - 1
        return f"{files[piece]}, {all_columns[piece].place(int(order[row] - starts[piece]))}"

    times, values, statuses = map(np.concatenate, (all_times, all_values, all_statuses))
    unsorted = sum(int((part < np.maximum.accumulate(part)).sum()) for part in all_times)
    order = np.argsort(times, kind="stable")
    times, values, statuses = times[order], values[order], statuses[order]
    there = np.flatnonzero(statuses == ValueStatus.USED)
    again, found = repeated(name, times, values, there, zone, place)
    faults += found
    statuses[there[again]] = ValueStatus.DUPLICATE
    return Series(name, times, values, statuses, unsorted, sum(len(columns.bad) for columns in all_columns))


def ledger_of(tables: Sequence[Table], series: Iterable[Series]) -> dict[str, Any]:
    """The account as JSON holds it: values read = values used + values dropped, by reason."""
    sources = {}
    for one in series:
        used, *dropped = np.bincount(one.statuses, minlength=len(ValueStatus)).tolist()
        dropped[-1] += one.unreadable  # of rows, once per source
        sources[one.name] = {
            "read": used + sum(dropped),
            "used": used,
            "dropped": {reason: count for reason, count in zip(REASONS, dropped, strict=True) if count},
            "sorted": one.unsorted,
        }
    files = [
        {
            "file": table.name,
            "rows": table.rows,
            "unreadable_rows": table.rows - table.others.total() - sum(len(c.times) for c in table.parts),
            "comment_lines": table.comments,
            "repeated_headers": table.headers,
            "empty_lines": table.empty,
            "footer_lines": table.footers,
            "rows_of_other_tags": dict(table.others),
        }
        for table in tables
    ]
    flags = Counter(flag for table in tables for columns in table.parts for _, flag in columns.flagged)
    return {"sources": sources, "flags": dict(flags), "files": files}


def ledger_lines(ledger: dict[str, Any]) -> Iterable[str]:
    """The account as a table."""
    names, sources = [name[:24] for name in ledger["sources"]], list(ledger["sources"].values())
    widths = [max(len(name), 9) for name in names]
    yield "  ".join([f"{'values':28s}", *(f"{n:>{w}s}" for n, w in zip(names, widths, strict=True))])
    for word in ("read", *REASONS, "used", "sorted"):
        counts = [source.get(word, source["dropped"].get(word, 0)) for source in sources]
        if word in ("read", "used") or any(counts):
            label = "out of order, sorted" if word == "sorted" else word
            yield "  ".join([f"{label:28s}", *(f"{n:>{w},d}" for n, w in zip(counts, widths, strict=True))])


Origins = list[tuple[Series, Ints]]
"""Rows of sources from which values come."""


@dataclass(frozen=True, eq=False)
class Canonical:
    """A canonical column: its values, or the reports of sources that are logged when they change.

    Reports (`[input.hold]`) are sampled on the grid of each day and hold until the next one.
    """

    signal: Signal  # for the grid: with reports, the column comes every T_s
    times: Ints  # (n,) from which the values count [us UTC]: the stamp's shift is subtracted; no reports
    values: Floats  # (n,) [m3/s] or [m]
    origins: Origins  # per source: the row of each value, or report, in it

    @property
    def stamps(self) -> Ints:
        """Times as they are in the export, ascending [us UTC]."""
        if not self.signal.hold:
            return self.times + self.signal.shift
        return np.unique(np.concatenate([series.times[rows] for series, rows in self.origins]))

    def of_day(self, grid: Grid, early: int) -> tuple[Ints, Floats, Origins]:
        """Times and values of a local day, and their origins."""
        if self.signal.hold:
            return self._sampled(grid, early)
        low, high = self.times.searchsorted((grid.start - early, grid.end - early)).tolist()
        origins = [(series, rows[low:high]) for series, rows in self.origins]
        return self.times[low:high], self.values[low:high], origins

    def _sampled(self, grid: Grid, early: int) -> tuple[Ints, Floats, Origins]:
        total = np.zeros(len(grid.times))
        origins: Origins = []
        for series, rows in self.origins:
            if not len(rows):
                total[:] = np.nan
                continue
            at = series.times[rows].searchsorted(grid.times + early, side="right") - 1
            last = rows[np.maximum(at, 0)]
            age = grid.times - series.times[last]
            held = (at >= 0) & (age <= self.signal.hold)
            total += np.where(held, series.values[last], np.nan)
            picked = np.unique(last[held])
            origins.append((series, picked[np.isfinite(series.values[picked])]))
        there = np.isfinite(total)
        return grid.times[there], converted(total[there], self.signal), origins

    def reports_within(self, grid: Grid) -> Origins:
        """The reports of a local day, sampled or not."""
        found: Origins = []
        for series, _ in self.origins if self.signal.hold else ():
            low, high = series.times.searchsorted((grid.start, grid.end)).tolist()
            found.append((series, low + np.flatnonzero(np.isfinite(series.values[low:high]))))
        return found


def converted(total: Floats, signal: Signal) -> Floats:
    """A total (n,) of a column's sources in SI units, to 15 digits: what comes after them is not measured.

    A double holds 15 decimal digits, so that 4.1287 L/s are 0.0041287 m3/s, not 0.004128700000000001.
    """
    if signal.factor == 1.0 and len(signal.sources) == 1:
        return total
    return np.array([float(f"{value:.15g}") for value in (total * signal.factor).tolist()])


def canonical(series: dict[str, Series], spec: Spec) -> list[Canonical]:
    """The canonical columns; statuses of values that lack a partner in every sum are set."""
    usable = {name: np.flatnonzero(one.statuses == ValueStatus.USED) for name, one in series.items()}
    for name, rows in usable.items():
        series[name].statuses[rows] = ValueStatus.UNMATCHED
    columns = []
    for signal in spec.signals:
        parts = [(series[name], usable[name]) for name in signal.sources]
        if signal.hold:
            signal = replace(signal, spacing=round(spec.period * MICRO), shift=0)
            # a flag, sentinel or status ends what was held before
            no_report = (ValueStatus.DUPLICATE, ValueStatus.TIME)
            origins = [(part, np.flatnonzero(~np.isin(part.statuses, no_report))) for part, _ in parts]
            columns.append(Canonical(signal, np.empty(0, np.int64), np.empty(0), origins))
        else:
            common = reduce(np.intersect1d, [part.times[rows] for part, rows in parts])
            parts = origins = [(part, rows[np.isin(part.times[rows], common)]) for part, rows in parts]
            total = reduce(np.add, [part.values[rows] for part, rows in origins])
            columns.append(Canonical(signal, common - signal.shift, converted(total, signal), origins))
        for part, rows in parts:
            part.statuses[rows] = ValueStatus.USED
    return columns


@dataclass
class DayResult:
    """A day and its status."""

    date: dt.date
    # good, refused or pending; a good one becomes written, identical, or differs: another log stays in place
    status: str = "good"
    reason: str = ""
    file: str = ""
    rows: int = 0
    filled: int = 0  # samples of the grid that lie in gaps


DayRows = tuple[TimedValues, Origins, Origins]
"""The values of a day; the rows of the sources that they come from; its reports, sampled or not."""


def dates_of(
    columns: Sequence[Canonical], zone: dt.tzinfo, faults: Sequence[Fault], spec: Spec
) -> list[dt.date]:
    """Local days of which the export has rows, ascending; a row at midnight alone makes no day."""
    stamps = np.unique(np.concatenate([column.stamps for column in columns]))
    held = [bool(column.signal.hold) for column in columns]
    found = set(days_of(np.concatenate([column.times for column in columns]), zone, spec.tolerance))
    if any(held):
        found |= set(days_of(stamps, zone, spec.tolerance))
        if found and all(held):  # nothing may change for a whole day
            found = {min(found) + k * ONE_DAY for k in range((max(found) - min(found)).days + 1)}
    kept = []
    for date in sorted(found):
        start, end = (t - spec.tolerance for t in day_bounds(date, zone))
        lasting = all(held) and stamps[0] <= start + 2 * spec.tolerance and end <= stamps[-1]
        if lasting or not at_midnights(stamps, faults, start, end, spec):
            kept.append(date)
    return kept


def judge(
    date: dt.date,
    columns: Sequence[Canonical],
    zone: dt.tzinfo,
    faults: Sequence[Fault],
    spec: Spec,
    today: dt.date,
    whole: bool = True,
) -> tuple[DayResult, DayRows]:
    """A day as `rivid run` would take it, and its rows; where data sets are not `whole` days, with gaps."""
    grid = make_grid(*day_bounds(date, zone), spec.period, zone)
    parts = {column.signal.name: column.of_day(grid, spec.tolerance) for column in columns}
    series = {name: (times, values) for name, (times, values, _) in parts.items()}
    origins = [origin for _, _, found in parts.values() for origin in found]
    rows = series, origins, [r for column in columns for r in column.reports_within(grid)]
    low, high = grid.start - spec.tolerance, grid.end - spec.tolerance + spec.latest
    own, given = [fault for fault in dict.fromkeys(faults) if low <= fault.at < high], spec.input.time_zone
    day = DayResult(date)
    if own:
        more = f" (and {len(own) - 1} more)" if len(own) > 1 else ""
        day.status, day.reason = "refused", f"{own[0].text}{more}"
        # on a longer day the zone sets its own clock back
        still = grid.end == grid.start + 86_400 * MICRO and clocks_change(date)
        if given and still and own[0].twice:
            day.reason += f"; if the clock is set back that night, its [input] time_zone is not {given}"
    elif whole:
        try:
            _, day.filled = sampled(series, grid, [column.signal for column in columns], spec)
        except DataError as error:
            unfinished = isinstance(error, TrailingGap) and date >= today
            day.status = "pending" if unfinished else "refused"
            day.reason = str(error) + _advice(columns, series, grid)
    return day, rows


def _advice(columns: Sequence[Canonical], series: TimedValues, grid: Grid) -> str:
    """Advice on irregular values, which may be logged when they change: only the user knows."""
    for name in (column.signal.name for column in columns if not column.signal.hold):
        times, _ = series[name]
        steps = np.diff(times)
        if len(steps) > 1 and (np.abs(steps - np.median(steps)) > 0.1 * np.median(steps)).mean() > 0.5:
            longest = int(np.ceil(max(steps.max(), grid.end - times[-1]) / MICRO))
            return (
                f"; if {name} is logged only when it changes, set [input.hold] {name} to the longest time "
                f"that a value holds [s] (here at least {longest})"
            )
    return ""


# status of the values of a day that is not used
OF_DAY = {"refused": ValueStatus.REFUSED, "pending": ValueStatus.PENDING, "differs": ValueStatus.STANDING}
# keys of `[input]` on how days are made of values, not on what a file looks like
KEPT = ("time_zone", "max_gap", "max_filled", "not_sentinels")


@dataclass(frozen=True)
class Outcome:
    """The result of an ingest."""

    days: list[DayResult]  # in date order
    ledger: dict[str, Any]  # the account of the values, of :func:`ledger_of`
    run_config: Path
    notes: list[str]  # tags, columns and lines that were not read

    @property
    def counts(self) -> Counter[str]:
        """Days by status."""
        return Counter(day.status for day in self.days)

    @property
    def exit_code(self) -> int:
        """0: all well; 3: a day is refused, or kept out by another log; 10: there is none."""
        if not self.days:
            return NoDataError.exit_code
        return 3 if self.counts["refused"] or self.counts["differs"] else 0

    def to_json(self) -> dict[str, Any]:
        """Return the outcome as JSON values."""
        return {
            "days": [{**vars(day), "date": str(day.date)} for day in self.days],
            "counts": dict(self.counts),
            "values": self.ledger,
            "notes": self.notes,
            "run_config": str(self.run_config),
        }


def ingest(
    exports: Sequence[Path],
    out: Path,
    config: Config,
    *,
    format: Format = "csv",
    first: dt.date | None = None,
    last: dt.date | None = None,
    force: bool = False,
    dry_run: bool = False,
    today: dt.date | None = None,
    run_config: Path | None = None,
) -> Outcome:
    """Make daily logs in `out`, DATA_DIR, of exports: files of one dialect, or none with ``[input] query``.

    `first` and `last` are the first and last local day that is written; `force` overwrites what differs,
    `dry_run` writes nothing. From `today` on (default: by the clock), a log may be unfinished. The
    configuration of the logs goes to `run_config` (default: ``<out>_run.toml``). One that this function wrote
    is written again where nothing but that changes; where logs differ, or the file was edited, it stays.
    ConfigError where the exports are not as declared, or something in place must not be overwritten;
    DataError where a file cannot be read.
    """
    spec = spec_of(config)
    run_config = run_config or run_config_of(out)
    text = config_for_logs(config)
    _refuse_place(out, exports)
    there = _standing(run_config, text)
    if there == "other" and not force:
        _refuse_overwriting(run_config)
    try:
        asked = b""
        if not exports and config.input.query and config.input.database:
            asked = queried(config.input.database, config.input.query, first, last)
        tables = read_exports(exports, spec, asked)
        zone, gathered, faults = gather(tables, spec)
    except UndeclaredError as error:
        more = "" if "rivid sniff" in str(error) else "; `rivid sniff` proposes an [input] block"
        raise ConfigError(f"{error}{more}") from None
    columns = canonical(gathered, spec)
    for series in gathered.values():
        series.statuses[series.statuses == ValueStatus.USED] = ValueStatus.OUTSIDE
    dates = [d for d in dates_of(columns, zone, faults, spec) if (first or d) <= d <= (last or d)]
    today = today or dt.datetime.now(zone).date()

    def judged() -> Iterator[tuple[DayResult, DayRows, Path, bytes]]:
        for date in dates:
            (day, rows), data = judge(date, columns, zone, faults, spec, today, not config.run.window), b""
            if day.status == "good":
                data, day.rows = _bytes_of(rows[0], zone, format)
            yield day, rows, out / f"{date}.{format}", data

    if there == "own" and not force:  # it is brought up to date next to logs that stay as they are
        good = ((path, data) for day, _, path, data in judged() if day.status == "good")
        if any(_standing_log(*each)[0] == "differs" for each in good):
            _refuse_overwriting(run_config)
    results = []
    for day, (_, origins, reports), path, data in judged():
        if day.status == "good":
            _write(day, path, data, force=force, dry_run=dry_run)
        for one, at in reports:
            one.statuses[at[one.statuses[at] == ValueStatus.OUTSIDE]] = ValueStatus.BETWEEN
        for one, at in origins:  # a value that is held into a second day stays used
            one.statuses[at[one.statuses[at] != ValueStatus.USED]] = OF_DAY.get(day.status, ValueStatus.USED)
        results.append(day)
    written = any(result.status in ("written", "identical") for result in results)
    if there != "same" and not dry_run and written:
        write_text(run_config, text)
    return Outcome(results, ledger_of(tables, gathered.values()), run_config, _notes(tables))


def _write(day: DayResult, path: Path, data: bytes, *, force: bool, dry_run: bool) -> None:
    """Write a good day, unless another log is in its place."""
    day.status, day.file = "written", path.name
    if dry_run:
        return
    day.status, day.file = _standing_log(path, data)
    plain = path.is_file() and not path.is_symlink()
    if day.status == "differs" and day.file != path.name:
        day.reason = f"{day.file} is there already: take it away, or choose its --format"
    elif day.status == "absent" or (day.status == "differs" and force and plain):
        with replacing(path) as scratch:
            scratch.write_bytes(data)
        day.status = "written"
    elif day.status == "differs":
        day.reason = f"{day.file} is there and differs: --force writes it again"


def _bytes_of(series: TimedValues, zone: dt.tzinfo, format: Format) -> tuple[bytes, int]:
    """The log of a good day as a file, and how many rows it has."""
    times = np.unique(np.concatenate([times for times, _ in series.values()]))
    columns = {name: np.full(len(times), np.nan) for name in series}
    for name, (at, values) in series.items():
        columns[name][times.searchsorted(at)] = values
    return rows_as_bytes(times, columns, zone, format), len(times)


def _standing_log(path: Path, data: bytes) -> tuple[str, str]:
    """Whether the log of a day is "absent", "identical", or one that "differs"; and its file name."""
    for other in (path.with_name(f"{path.name[:10]}{suffix}") for suffix in SUFFIXES):
        if other != path and (other.exists() or other.is_symlink()):
            return "differs", other.name
    if path.is_file() and not path.is_symlink():
        same = path.stat().st_size == len(data) and path.read_bytes() == data
        return "identical" if same else "differs", path.name
    return "differs" if path.exists() or path.is_symlink() else "absent", path.name


def _refuse_place(out: Path, exports: Sequence[Path]) -> None:
    """Refuse a directory in which the logs would mix with others, or with the exports."""
    if out.exists() and not out.is_dir():
        raise ConfigError(f"--out {shown(str(out))} is a file: expected a directory")
    here = out.resolve()
    for export in exports:
        if export.resolve().parent == here and suffix_of(export.name):
            raise ConfigError(
                f"{shown(str(export))} lies in {shown(str(out))}, where `rivid run` would take it for a log: "
                "choose another --out"
            )
    for path in sorted(out.iterdir()) if out.is_dir() else ():
        if suffix_of(path.name) and not path.name.startswith(".") and not is_day_file(path.name):
            raise ConfigError(
                f"{shown(str(out))} holds {shown(path.name)}, which would mix with the days: choose an empty "
                "directory, or one of daily logs"
            )


def _notes(tables: Sequence[Table]) -> list[str]:
    others = sum((table.others for table in tables), Counter[str]())
    unread = dict.fromkeys(name for table in tables for name in table.cells)
    notes = []
    if unread:
        notes.append(f"columns not read: {', '.join(name[:40] for name in unread)}")
    if footers := sum(table.footers for table in tables):
        notes.append(f"last lines of files that hold no data (footer_rows): {footers:,d} passed over")
    if others:
        tags = [f"{tag[:40]} ({count:,d} rows)" for tag, count in others.most_common(12)]
        notes.append(f"tags not asked for: {', '.join(tags)}{', ...' if len(others) > 12 else ''}")
    return notes


def run_config_of(out: Path) -> Path:
    """The file for the configuration of the logs, unless another is chosen."""
    place = out.resolve()
    return place.with_name(f"{place.name}_run.toml")


def config_for_logs(config: Config) -> str:
    """TOML for the written logs: `[input]` without the exports' keys; ConfigError if the rest disagrees."""
    raw = config.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    given = raw.pop("input", {})
    own = {key: given[key] for key in KEPT if key in given}
    if config.input.u_Qo == "" and config.reach.kind == "pool":
        own["u_Qo"] = ""
    if config.input.interval:
        own["interval"] = dict(config.input.interval)
    raw = {"reach": raw.pop("reach", {}), "input": own} | raw
    parse(raw, Config, "the configuration for the logs")
    body = tomli_w.dumps({section: entries for section, entries in raw.items() if entries})
    return _first_line(body) + body


def _first_line(body: str) -> str:
    """The first line of a configuration that ingest writes; its digest shows whether the rest was edited."""
    mark = sha256(body.encode()).hexdigest()[:12]
    return (
        f"# Written by `rivid ingest` for the logs it made of the exports; it keeps this up to date. {mark}\n"
    )


def _standing(path: Path, text: str) -> str:
    """Whether a configuration is "absent", the "same", ingest's "own" but different, or any "other"."""
    if not path.exists():
        return "absent"
    try:
        there = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return "other"
    first, _, body = there.partition("\n")
    return "same" if there == text else "own" if f"{first}\n" == _first_line(body) else "other"


def _refuse_overwriting(path: Path) -> None:
    """Refuse to overwrite an edited configuration, or one that other logs are read with."""
    raise ConfigError(
        f"{shown(str(path))} exists and differs: --force overwrites it and differing days again, "
        "--run-config writes it elsewhere"
    )
