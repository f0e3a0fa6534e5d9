"""One log file in memory: sorted columns in UTC and SI units, what was masked or dropped, and its faults."""

import datetime as dt
from collections import OrderedDict
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import numpy as np

from rivid.errors import DataError
from rivid.logs.arrow import read_fast, read_parquet
from rivid.logs.columns import Columns, Fault, Table, UndeclaredError
from rivid.logs.files import Limits, limits_of, read_bytes, refuse_rows, stem_of
from rivid.logs.spec import MICRO, Signal, Spec
from rivid.logs.text import LINE, Header, cut_footer, read_header, read_lines, split_cells, to_utf8
from rivid.logs.times import clock, day_bounds, fixed_zone, local, to_utc, zone_named
from rivid.types import Floats, Ints

LARGEST = 1e6
"""Largest flow [m3/s] or level [m]: beyond any river or gauge, so a larger number is damage."""

PLAIN = (
    *(-999.0, -999.9, -999.99, -999.999, -9999.0, -9999.9, -9999.99, -99999.0, -999999.0),
    *(-7777.0, -7999.0, -8888.0, -6999.0, -32767.0, -32768.0, 6999.0, 7999.0, 9999.0, 9999.9, 9999.99),
    *(32767.0, 65535.0, 99999.0, 99999.9, 99999.99, 999999.0),
)
"""Numbers that loggers write where nothing was measured, and that no flow or dam is set to."""
ROUND = (-99.0, -99.9, -99.99, -777.0, -1000.0)
"""Others, which a pump may be set to: they must lie farther off, and among values that are all positive."""
SENTINELS = (*PLAIN, *ROUND)
NEAR = 0.1
"""A number that is off by less than the range of the values and this part of the largest is taken as data."""
FARTHER = 2.0
"""Number of such distances by which a number of :data:`ROUND` must be off."""
_NEGATIVE = frozenset(s for s in SENTINELS if s < 0)
_POSITIVE = frozenset(s for s in SENTINELS if s > 0)
_HOUR = 3600 * MICRO
_LONGEST_DAY = 26 * _HOUR

_kept: OrderedDict[tuple[object, ...], "Log"] = OrderedDict()
KEPT_FILES, KEPT_ROWS = 40, 1_000_000
"""Files and rows that a process keeps in memory, as windows share days; two files are kept in any case."""


@dataclass(frozen=True, eq=False)
class Log:
    """A log file, read."""

    name: str  # file name for messages
    spec: Spec
    zone: dt.tzinfo  # of the local days
    times: Ints  # (n,) distinct times of its rows, ascending [us UTC]
    values: dict[str, Floats]  # (n,) per canonical column, m3/s or m; NaN where nothing is measured
    faults: tuple[Fault, ...]  # in order of time
    events: dict[str, Ints]  # times [us], ascending, of what was masked, dropped or sorted, per kind
    digest: str  # SHA-256 of the file

    @cached_property
    def series(self) -> dict[str, tuple[Ints, Floats]]:
        """Per canonical column: times from which its values count [us], and the values that are there."""
        series = {}
        for signal in self.spec.signals:
            values = self.values[signal.name]
            there = np.isfinite(values)
            times = self.times - signal.shift if signal.shift else self.times
            series[signal.name] = (times, values) if there.all() else (times[there], values[there])
        return series

    def bounds(self, date: dt.date) -> tuple[int, int]:
        """A local day's rows are those from the first instant on, before the second [us]."""
        start, end = day_bounds(date, self.zone)
        early = self.spec.tolerance
        return start - early, end - early

    def of_day(self, date: dt.date) -> dict[str, tuple[Ints, Floats]]:
        """The part of each series that belongs to a local day."""
        start, end = self.bounds(date)
        part = {}
        for name, (times, values) in self.series.items():
            low, high = times.searchsorted((start, end)).tolist()
            part[name] = (times, values) if high - low == len(times) else (times[low:high], values[low:high])
        return part

    def closing(self, end: int) -> dict[str, tuple[Ints, Floats]]:
        """The part of each series that is stamped from `end` on, but belongs before it [us]."""
        part = {}
        for signal in self.spec.signals:
            times, values = self.series[signal.name]
            low, high = times.searchsorted((end - signal.shift, end)).tolist()
            part[signal.name] = times[low:high], values[low:high]
        return part

    def is_edge(self, date: dt.date) -> bool:
        """Whether a local day has no row but such as begin or end another day, at its midnights."""
        start, end = self.bounds(date)
        if 2 * max(signal.spacing for signal in self.spec.signals) > end - start:
            return False  # a row is much of a day
        if any(start <= fault.at < end for fault in self.faults):
            return False
        first = start + max(2 * self.spec.tolerance + 1, self.spec.latest)
        low, high = self.times.searchsorted((first, end))
        return bool(low == high)

    def faults_of(self, date: dt.date) -> list[Fault]:
        """The faults of a local day, those of the rows that close it included."""
        start, end = self.bounds(date)
        end += self.spec.latest
        return [fault for fault in self.faults if start <= fault.at < end]

    def events_of(self, date: dt.date) -> dict[str, int]:
        """How much was masked, dropped or sorted on a local day."""
        start, end = self.bounds(date)
        counts = {k: int(np.diff(t.searchsorted((start, end)))[0]) for k, t in self.events.items()}
        return {kind: count for kind, count in counts.items() if count}

    def digest_of(self, date: dt.date) -> str:
        """Digest of a local day: changes when, and only when, what is read of that day changes."""
        digest = sha256()
        for name, (times, values) in self.of_day(date).items():
            digest.update(f"{name} {len(times)};".encode())
            digest.update(times.tobytes())
            digest.update(values.tobytes())
        digest.update(repr((self.faults_of(date), sorted(self.events_of(date).items()))).encode())
        return digest.hexdigest()

    def dates(self) -> list[dt.date]:
        """Local days of which the log has values or faults, ascending."""
        parts = [times for times, _ in self.series.values()]
        parts.append(np.array([fault.at for fault in self.faults], np.int64))
        return days_of(np.concatenate(parts), self.zone, self.spec.tolerance)


def days_of(times: Ints, zone: dt.tzinfo, early: int) -> list[dt.date]:
    """Local days of times [us UTC], ascending; up to `early` [us] before midnight counts for the next day."""
    days, at = [], 0
    times = np.unique(times) + early
    while at < len(times):
        date = local(int(times[at]), zone).date()
        days.append(date)
        at = int(times.searchsorted(day_bounds(date, zone)[1]))
    return days


def load(path: Path, name: str, spec: Spec, *, fresh: bool = False) -> Log:
    """Read a log of one day or of many, or return it as read before, unless `fresh`.

    `fresh` reads in any case: within the clock's tick a changed file may look unchanged. Raises DataError
    where nothing of the file can be used; CutError where it ends too early.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise DataError(f"{name} cannot be read: {error.strerror}") from None
    key = (path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns, spec)
    log = None if fresh else _kept.get(key)
    if log is None:
        log = _kept[key] = make_log(read_table(path, name, spec, limits_of(path.name)), spec)
        while len(_kept) > KEPT_FILES or (
            len(_kept) > 2 and sum(len(kept.times) for kept in _kept.values()) > KEPT_ROWS
        ):
            _kept.popitem(last=False)
    else:
        _kept.move_to_end(key)
    return log


def read_table(path: Path, name: str, spec: Spec, limits: Limits, *, export: bool = False) -> Table:
    """Read a file: text or Parquet, wide or long.

    With `export`, the columns that are not read matter too, some of the sources are enough, and any suffix is
    allowed. Raises UndeclaredError where the file is not as declared, DataError where nothing of it can be
    used, CutError where it ends too early.
    """
    content, digest = read_bytes(path, name, limits)
    stem = stem_of(path.name)
    if content[:4] == b"PAR1" if export else path.name.lower().endswith(".parquet"):
        table = read_parquet(content, spec, name, limits, stem, watch=export)
    else:
        content = to_utf8(content, spec, name)
        refuse_rows(name, content.count(b"\n"), limits)
        header = read_header(content, spec, name, some=export)
        content, footers = cut_footer(content, header, spec)
        table = _read_text(content, header, spec, name, stem, export)
        table.footers = footers
        for columns in table.parts if footers else ():
            columns.dropped["footer rows"] = [len(columns.times)] * footers
    table.name, table.digest = name, digest
    return table


def _read_text(content: bytes, header: Header, spec: Spec, name: str, stem: str, export: bool) -> Table:
    """The fast reader where it returns as much: of an export, all columns are read and no cell is empty."""
    columns = None
    if not export or set(header.names) == {*spec.time, *spec.sources}:
        columns = read_fast(content, header, spec)
    if columns is None or (export and any(np.isnan(v).any() for v in columns.numbers.values())):
        table = read_lines(content, header, spec, name, stem, watch=export)
    else:
        table = Table([columns], rows=len(columns.times))
    if export and not spec.long and spec.input.unit_rows:
        above = LINE.split(content[: header.body].decode("utf-8", "replace").rstrip("\r\n"))
        rows = [split_cells(line, spec.input.separator) or [] for line in above[-spec.input.unit_rows :]]
        for source in set(spec.sources) & set(header.names):
            at = header.names.index(source)
            table.units[source] = next((row[at] for row in rows if at < len(row) and row[at]), "")
    return table


def make_log(table: Table, spec: Spec) -> Log:
    """Bring the columns to UTC, SI units and order; DataError without any row or zone of local days."""
    if not table.parts:
        raise DataError(f"{table.name}, {table.lacking}")
    (columns,) = table.parts
    zone = zone_of(columns, spec, table.name)
    events: dict[str, list[int]] = {}
    faults: list[Fault] = []  # at a row
    times, wrong = in_utc(columns, zone, spec)
    faults += wrong
    values = {}
    for signal in spec.signals:
        values[signal.name] = _total(signal, columns, spec, events, faults)
    faults += undeclared(columns, times, spec, zone)
    last = len(times) - 1
    faults += [Fault(min(max(bad.at - 1, 0), last), bad.text, bad.cut) for bad in columns.bad]
    for kind, rows in columns.dropped.items():
        events.setdefault(f"{kind} dropped", []).extend(min(max(row - 1, 0), last) for row in rows)

    steps = np.diff(times)
    order = None
    if (steps < 0).any():
        late = np.flatnonzero(times < np.maximum.accumulate(times))
        events["rows out of order sorted"] = late.tolist()
        order = np.argsort(times, kind="stable")
    timed = {kind: np.sort(times[rows]) for kind, rows in events.items() if rows}
    dated = [Fault(int(times[fault.at]), fault.text, fault.cut) for fault in faults]
    if order is not None:
        times, values = times[order], {k: v[order] for k, v in values.items()}
        steps = np.diff(times)
    if (steps == 0).any():
        first = np.r_[True, steps > 0]
        timed["duplicates dropped"] = times[~first]
        group = np.cumsum(first) - 1
        for name in values:
            values[name] = _merged(name, values[name], group, times, columns, order, zone, dated)
        times = times[first]
    return Log(table.name, spec, zone, times, values, tuple(sorted(dated)), timed, table.digest)


def zone_of(columns: Columns, spec: Spec, name: str) -> dt.tzinfo:
    """The zone whose midnight begins a day; UndeclaredError where neither log nor configuration states it."""
    if spec.input.time_zone:
        return zone_named(spec.input.time_zone)
    example = 'for example [input] time_zone = "Europe/Paris" or "America/Los_Angeles"'
    example += ' ("Etc/GMT+8" is 8 h behind UTC)'
    if not columns.aware:
        raise UndeclaredError(
            f"{name}: its times have no UTC offset: set the zone of the log's clock, {example}"
        )
    if columns.zone is not None:
        try:
            return zone_named(columns.zone)
        except (OSError, ValueError, KeyError):
            raise UndeclaredError(
                f"{name}: its time zone {columns.zone[:40]!r} is unknown: set {example}"
            ) from None
    if columns.offset is None:
        raise UndeclaredError(
            f"{name}: its times have several UTC offsets: set the zone whose days are meant, {example}"
        )
    return fixed_zone(columns.offset)


def in_utc(columns: Columns, zone: dt.tzinfo, spec: Spec) -> tuple[Ints, list[Fault]]:
    """Times in UTC [us], and the rows whose time does not exist, or occurs twice and may not."""
    if columns.aware:
        return columns.times, []
    times, refused = to_utc(columns.times, zone, spec.input.ambiguous)
    return times, [Fault(row, f"{columns.place(row)}: {reason}") for row, reason in refused]


def _total(
    signal: Signal, columns: Columns, spec: Spec, events: dict[str, list[int]], faults: list[Fault]
) -> Floats:
    """A canonical column from those of the log: sentinels masked, summed, in SI units."""
    total: Floats | None = None
    for source in signal.sources:
        values = columns.numbers[source]
        if spec.input.sentinels:
            masked = np.isin(values, spec.input.sentinels)
            if masked.any():
                events.setdefault("sentinels masked", []).extend(np.flatnonzero(masked).tolist())
                values = np.where(masked, np.nan, values)
        total = values if total is None else total + values
    assert total is not None
    if signal.factor != 1.0:
        total = total * signal.factor
    if np.nanmax(np.abs(total), initial=0.0) > LARGEST:
        total = total.copy()
        for row in np.flatnonzero(np.abs(total) > LARGEST).tolist():
            faults.append(Fault(row, too_large(signal.name, signal, columns, row, float(total[row]))))
            total[row] = np.nan
    return total


def too_large(name: str, signal: Signal, columns: Columns, row: int, value: float) -> str:
    """The message for a value beyond :data:`LARGEST`."""
    unit = "m" if signal.name == "h_L" else "m3/s"
    return (
        f"{columns.place(row)}: {name} = {value:.3g} {unit} is beyond any river: check [input.units], "
        "or add the value to [input] sentinels"
    )


def logged_twice(name: str, time: int, zone: dt.tzinfo, old: float, new: float) -> str:
    """The message for two values of one time."""
    moment = clock(time, zone, with_date=True)
    return f"{moment} is logged twice with different {name}: {old:.6g} and {new:.6g}"


def _merged(
    name: str,
    values: Floats,
    group: Ints,
    times: Ints,
    columns: Columns,
    order: Ints | None,
    zone: dt.tzinfo,
    faults: list[Fault],
) -> Floats:
    """One value per time: values that agree, or are there only once, are joined; others are faults."""
    there = np.flatnonzero(np.isfinite(values))
    repeated = np.r_[False, group[there][1:] == group[there][:-1]] if len(there) else np.zeros(0, bool)
    for at in np.flatnonzero(repeated):
        old, new = there[at - 1], there[at]
        if values[old] != values[new]:
            places = [columns.place(int(i if order is None else order[i])) for i in (new, old)]
            text = logged_twice(name, int(times[new]), zone, values[old], values[new])
            faults.append(Fault(int(times[new]), f"{places[0]}: {text} ({places[1]})"))
    merged = np.full(int(group[-1]) + 1, np.nan)
    merged[group[there[~repeated]]] = values[there[~repeated]]
    return merged


def may_hold(values: Floats) -> bool:
    """Whether sentinels may be among the values; fast, as every column of every log is checked.

    A sentinel far from all other values is the least or the greatest of them.
    """
    return float(np.fmin.reduce(values)) in _NEGATIVE or float(np.fmax.reduce(values)) in _POSITIVE


def sentinels_in(values: Floats) -> list[float]:
    """Well-known sentinels, ascending, among values (n,) of a day, far from all others; NaN is no value."""
    known = np.isin(values, SENTINELS)
    if not known.any():
        return []
    others = values[~known & np.isfinite(values)]
    return [s for s in np.unique(values[known]).tolist() if _is_far(s, others)]


def _is_far(sentinel: float, others: Floats) -> bool:
    if not len(others):
        return sentinel in PLAIN
    low, high = float(others.min()), float(others.max())
    span = high - low + NEAR * max(abs(low), abs(high))
    off = max(low - sentinel, sentinel - high)
    if sentinel in ROUND:
        return low > 0 and off > FARTHER * span
    return off > span or (low >= 0 > sentinel)


def undeclared(columns: Columns, times: Ints, spec: Spec, zone: dt.tzinfo) -> list[Fault]:
    """A fault for each day with undeclared sentinels, at its first such row; times (n,) [us UTC]."""
    many_days = int(times.max()) - int(times.min()) > _LONGEST_DAY
    given, found = spec.input, []
    for source in spec.sources:
        if source not in columns.numbers:
            continue  # it is in another file
        values = columns.numbers[source]
        if not many_days and not may_hold(values):
            continue
        there = ~np.isin(values, given.sentinels)
        suspects = there & np.isin(values, SENTINELS)
        hours = np.unique(times[suspects] // _HOUR) * _HOUR
        for date in sorted({local(int(hour), zone).date() for hour in hours}):
            start, end = day_bounds(date, zone)
            rows = np.flatnonzero(there & (times >= start) & (times < end))
            known = sentinels_in(values[rows])
            found += [(source, rows, sentinel) for sentinel in known if sentinel not in given.not_sentinels]
    declare = ", ".join(f"{s:.10g}" for s in dict.fromkeys([*given.sentinels, *(s for *_, s in found)]))
    faults = []
    for source, rows, sentinel in found:
        values = columns.numbers[source][rows]
        at = rows[values == sentinel]
        others = values[np.isfinite(values) & ~np.isin(values, SENTINELS)]
        count = f" {len(at)} times" if len(at) > 1 else ""
        apart = f", far from the day's {others.min():g} to {others.max():g}" if len(others) else ""
        text = (
            f"{columns.place(int(at[0]))}: column {source!r} holds {sentinel:.10g}{count}{apart}: if that "
            f'means "not measured", set [input] sentinels = [{declare}]; if it is measured, not_sentinels'
        )
        faults.append(Fault(int(at[0]), text))
    return faults
