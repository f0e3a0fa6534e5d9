"""Numbers that loggers write where nothing was measured, and whether a day's values hold one."""

import datetime as dt
from collections import OrderedDict
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rivid.errors import DataError
from rivid.logs import arrow as csvfast
from rivid.logs import text as csvtext
from rivid.logs.files import Limits, read_bytes, refuse_rows, suffix_of
from rivid.logs.header import (
    Columns,
    Micros,
    UndeclaredError,
    cut_footer,
    plain_bytes,
    read_header,
    read_odd_header,
)
from rivid.logs.spec import MICRO, Signal, Spec
from rivid.logs.text import LARGEST
from rivid.logs.times import clock, day_bounds, fixed_zone, local, to_utc, zone_named
from rivid.types import Floats

PLAIN = (
    *(-999.0, -999.9, -999.99, -999.999, -9999.0, -9999.9, -9999.99, -99999.0, -999999.0),
    *(-7777.0, -7999.0, -8888.0, -6999.0, -32767.0, -32768.0, 6999.0, 7999.0, 9999.0, 9999.9, 9999.99),
    *(32767.0, 65535.0, 99999.0, 99999.9, 99999.99, 999999.0),
)
"""Nobody sets a flow or builds a dam to these."""
ROUND = (-99.0, -99.9, -99.99, -777.0, -1000.0)
"""A pump may be set to these: they must lie farther off, and among values that are all above zero."""
SENTINELS = (*PLAIN, *ROUND)
NEAR = 0.1
"""What is off by less than the range of the values and this part of the largest may be one of them."""
FARTHER = 2.0
_NEGATIVE = frozenset(s for s in SENTINELS if s < 0)
_POSITIVE = frozenset(s for s in SENTINELS if s > 0)
_HOUR = 3600 * MICRO
_LONGEST_DAY = 26 * _HOUR


def may_hold(values: Floats) -> bool:
    """Whether sentinels may be among the values: quick, as every column of every log is asked.

    A sentinel far from all other values is the least or the greatest of them.
    """
    return float(np.fmin.reduce(values)) in _NEGATIVE or float(np.fmax.reduce(values)) in _POSITIVE


def sentinels_in(values: Floats) -> list[float]:
    """Well-known sentinels among the values of a column that lie far from all the others.

    Parameters
    ----------
    values : ndarray, (n,)
        Of one day, in the log's unit; NaN where nothing is there.

    Returns
    -------
    list of float
        Ascending.
    """
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


def undeclared(columns: Columns, times: Micros, spec: Spec, zone: dt.tzinfo) -> list[tuple[int, str, bool]]:
    """Days with numbers that can only mean "not measured", and how to declare them.

    Parameters
    ----------
    columns : Columns
    times : ndarray, (n,)
        Of its rows [us UTC].
    spec : Spec
    zone : tzinfo
        Of the local days.

    Returns
    -------
    list of (int, str, bool)
        The first row of each, what to say, and False: it is no torn end.
    """
    many_days = int(times.max()) - int(times.min()) > _LONGEST_DAY
    found = []
    for source in spec.sources:
        if source not in columns.numbers:
            continue  # it stands in another file
        values = columns.numbers[source]
        if not many_days and not may_hold(values):
            continue
        there = ~np.isin(values, spec.sentinels)
        suspects = there & np.isin(values, SENTINELS)
        hours = np.unique(times[suspects] // _HOUR) * _HOUR
        for date in sorted({local(int(hour), zone).date() for hour in hours}):
            start, end = day_bounds(date, zone)
            rows = np.flatnonzero(there & (times >= start) & (times < end))
            known = sentinels_in(values[rows])
            found += [(source, rows, sentinel) for sentinel in known if sentinel not in spec.not_sentinels]
    declare = ", ".join(f"{s:.10g}" for s in dict.fromkeys([*spec.sentinels, *(s for *_, s in found)]))
    told = []
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
        told.append((int(at[0]), text, False))
    return told


class Fault(NamedTuple):
    """What makes the day of `time` [us] unusable; `cut`: it is the torn end of a log being written."""

    time: int
    text: str
    cut: bool = False


@dataclass(frozen=True, eq=False)
class Log:
    """A log file, read.

    Attributes
    ----------
    name : str
        How messages call it.
    spec : Spec
    zone : tzinfo
        Of the local days.
    times : ndarray, (n,)
        Distinct times of its rows, ascending [us UTC].
    values : dict of ndarray, (n,)
        Per canonical column, m3/s or m; NaN where nothing is measured.
    faults : tuple of Fault
        In order of time.
    events : dict of ndarray
        Times [us], ascending, of what was masked, dropped or sorted, per kind.
    digest : str
        SHA-256 of the file.
    """

    name: str
    spec: Spec
    zone: dt.tzinfo
    times: Micros
    values: dict[str, Floats]
    faults: tuple[Fault, ...]
    events: dict[str, Micros]
    digest: str

    @cached_property
    def series(self) -> dict[str, tuple[Micros, Floats]]:
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

    def of_day(self, date: dt.date) -> dict[str, tuple[Micros, Floats]]:
        """The part of each series that belongs to a local day."""
        start, end = self.bounds(date)
        part = {}
        for name, (times, values) in self.series.items():
            low, high = times.searchsorted((start, end)).tolist()
            part[name] = (times, values) if high - low == len(times) else (times[low:high], values[low:high])
        return part

    def closing(self, end: int) -> dict[str, tuple[Micros, Floats]]:
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
        if any(start <= fault.time < end for fault in self.faults):
            return False
        first = start + max(2 * self.spec.tolerance + 1, self.spec.latest)
        low, high = self.times.searchsorted((first, end))
        return bool(low == high)

    def faults_of(self, date: dt.date) -> list[Fault]:
        """What is wrong with a local day, the rows that close it included."""
        start, end = self.bounds(date)
        end += self.spec.latest
        return [fault for fault in self.faults if start <= fault.time < end]

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
        """Local days that the log says something about, ascending."""
        parts = [times for times, _ in self.series.values()]
        parts.append(np.array([fault.time for fault in self.faults], np.int64))
        times = np.unique(np.concatenate(parts)) + self.spec.tolerance
        found, at = [], 0
        while at < len(times):
            date = local(int(times[at]), self.zone).date()
            found.append(date)
            at = int(times.searchsorted(day_bounds(date, self.zone)[1]))
        return found


def make_log(columns: Columns, spec: Spec, name: str, digest: str) -> Log:
    """Bring the columns of a file to UTC, SI units and order.

    Raises
    ------
    DataError
        Where no row can be used at all, or local days cannot be told.
    """
    if not len(columns.times):
        if columns.bad:
            raise DataError(f"{name}, {columns.bad[0].text}")
        raise DataError(f"{name} has a header and no rows")
    zone = zone_of(columns, spec, name)
    events: dict[str, list[int]] = {}
    faults: list[tuple[int, str, bool]] = []  # (row, ...)
    times = columns.times
    if not columns.aware:
        times, refused = to_utc(times, zone, spec.ambiguous)
        faults += [(row, f"{columns.place(row)}: {reason}", False) for row, reason in refused]
    values = {signal.name: _signal(signal, columns, spec, events, faults) for signal in spec.signals}
    faults += undeclared(columns, times, spec, zone)
    last = len(times) - 1
    faults += [(min(max(row - 1, 0), last), text, cut) for row, text, cut in columns.bad]
    for kind, rows in columns.dropped.items():
        events.setdefault(f"{kind} dropped", []).extend(min(max(row - 1, 0), last) for row in rows)

    steps = np.diff(times)
    order = None
    if (steps < 0).any():
        late = np.flatnonzero(times < np.maximum.accumulate(times))
        events["rows out of order sorted"] = late.tolist()
        order = np.argsort(times, kind="stable")
    timed = {kind: np.sort(times[rows]) for kind, rows in events.items() if rows}
    dated = [Fault(int(times[row]), text, cut) for row, text, cut in faults]
    if order is not None:
        times, values = times[order], {k: v[order] for k, v in values.items()}
        steps = np.diff(times)
    if (steps == 0).any():
        times, values = _merge(times, values, columns, order, zone, timed, dated)
    return Log(name, spec, zone, times, values, tuple(sorted(dated)), timed, digest)


def zone_of(columns: Columns, spec: Spec, name: str) -> dt.tzinfo:
    """Whose midnight begins a day.

    Raises
    ------
    UndeclaredError
        Where neither the log nor the configuration tells.
    """
    if spec.time_zone:
        return zone_named(spec.time_zone)
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


def _signal(
    signal: Signal,
    columns: Columns,
    spec: Spec,
    events: dict[str, list[int]],
    faults: list[tuple[int, str, bool]],
) -> Floats:
    """A canonical column from those of the log: sentinels masked, summed, in SI units."""
    total: Floats | None = None
    for source in signal.sources:
        values = columns.numbers[source]
        if spec.sentinels:
            masked = np.isin(values, spec.sentinels)
            if masked.any():
                events.setdefault("sentinels masked", []).extend(np.flatnonzero(masked).tolist())
                values = np.where(masked, np.nan, values)
        total = values if total is None else total + values
    assert total is not None
    if signal.factor != 1.0:
        total = total * signal.factor
    if np.nanmax(np.abs(total), initial=0.0) > LARGEST:
        total = total.copy()
        for row in np.flatnonzero(np.abs(total) > LARGEST):
            unit = "m" if signal.name == "h_L" else "m3/s"
            said = f"{signal.name} = {total[row]:.3g} {unit} is beyond any river: check [input.units]"
            faults.append(
                (int(row), f"{columns.place(int(row))}: {said}, or add the value to [input] sentinels", False)
            )
            total[row] = np.nan
    return total


def _merge(
    times: Micros,
    values: dict[str, Floats],
    columns: Columns,
    order: np.ndarray | None,
    zone: dt.tzinfo,
    events: dict[str, Micros],
    faults: list[Fault],
) -> tuple[Micros, dict[str, Floats]]:
    """One row per time: values that agree, or are there only once, are joined; others are faults."""
    first = np.r_[True, np.diff(times) > 0]
    group = np.cumsum(first) - 1
    events["duplicates dropped"] = times[~first]
    merged = {}
    for name, column in values.items():
        there = np.flatnonzero(np.isfinite(column))
        repeated = np.r_[False, group[there][1:] == group[there][:-1]] if len(there) else np.zeros(0, bool)
        for at in np.flatnonzero(repeated):
            old, new = there[at - 1], there[at]
            if column[old] != column[new]:
                rows = [int(i if order is None else order[i]) for i in (old, new)]
                moment = clock(int(times[new]), zone, with_date=True)
                said = (
                    f"{moment} is logged twice with different {name}: {column[old]:.6g} and {column[new]:.6g}"
                )
                faults.append(
                    Fault(int(times[new]), f"{columns.place(rows[1])}: {said} ({columns.place(rows[0])})")
                )
        merged[name] = np.full(int(group[-1]) + 1, np.nan)
        merged[name][group[there[~repeated]]] = column[there[~repeated]]
    return times[first], merged


_kept: OrderedDict[tuple[object, ...], Log] = OrderedDict()
KEPT_FILES, KEPT_ROWS = 40, 1_000_000
"""Files and rows that a process keeps read, as windows share days; two files stay in any case."""


def load(path: Path, name: str, spec: Spec, limits: Limits, *, fresh: bool = False) -> Log:
    """Read a file of one day (limits `DAY`) or of many (:data:`MANY`), or give it as read before.

    Parameters
    ----------
    path : Path
    name : str
        How messages call it.
    spec : Spec
    limits : Limits
    fresh : bool
        Read it in any case: within the clock's tick a changed file may look unchanged.

    Returns
    -------
    Log

    Raises
    ------
    DataError
        Where nothing of the file can be used; CutError where it ends too early.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise DataError(f"{name} cannot be read: {error.strerror}") from None
    key = (path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns, spec)
    log = None if fresh else _kept.get(key)
    if log is None:
        log = _kept[key] = _parse(path, name, spec, limits)
        while len(_kept) > KEPT_FILES or (
            len(_kept) > 2 and sum(len(kept.times) for kept in _kept.values()) > KEPT_ROWS
        ):
            _kept.popitem(last=False)
    else:
        _kept.move_to_end(key)
    return log


def _parse(path: Path, name: str, spec: Spec, limits: Limits) -> Log:
    content, digest = read_bytes(path, name, limits)
    if suffix_of(path.name) == ".parquet":
        from rivid.logs.arrow import read_parquet

        if spec.dialect.quality or spec.dialect.zone_column:
            raise DataError(
                f"{name}: flags and zones of Parquet are read by `rivid ingest` only: use that first"
            )

        return make_log(read_parquet(content, spec, name, limits), spec, name, digest)
    content = plain_bytes(content, spec, name)
    refuse_rows(name, content.count(b"\n"), limits)
    header = (read_header if spec.dialect.plain else read_odd_header)(content, spec, name)
    content, footers = cut_footer(content, header, spec)
    columns = csvfast.read_fast(content, header, spec)
    if columns is None:
        columns = csvtext.read_tolerant(content, header, spec, name)
    if footers:
        columns.dropped["footer rows"] = [len(columns.times)] * footers
    return make_log(columns, spec, name, digest)
