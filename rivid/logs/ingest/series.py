"""All files as one series per source, in UTC and in order; of each value, what became of it."""

import datetime as dt
import difflib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rivid.input_config import InputConfig
from rivid.logs.log import LARGEST, in_utc, logged_twice, read_table, too_large, undeclared, zone_of
from rivid.logs.sniff.columns import looks_like_flags, stated_unit
from rivid.logs.spec import MANY, Spec, day_bounds, shown
from rivid.logs.text import FLAG, Columns, Fault, Table, UndeclaredError
from rivid.types import Floats, Ints

EMPTY = frozenset(InputConfig().missing)
"""Marks that no system writes for a state of its instruments."""
_Piece = tuple[str, Columns, Ints, Floats, NDArray[np.int8]]
"""A source in one file: file name, columns, times [us UTC], values and statuses."""


class ValueStatus(IntEnum):
    """What became of a value."""

    USED = 0
    MISSING = 1
    STATUS = 2
    FLAG = 3
    SENTINEL = 4
    TIME = 5
    DUPLICATE = 6
    UNMATCHED = 7
    BETWEEN = 8
    REFUSED = 9
    PENDING = 10
    OUTSIDE = 11
    STANDING = 12
    UNREADABLE = 13


WORDS = {
    ValueStatus.MISSING: "missing",
    ValueStatus.STATUS: "status text",
    ValueStatus.FLAG: "flag",
    ValueStatus.SENTINEL: "sentinel",
    ValueStatus.TIME: "ambiguous or impossible time",
    ValueStatus.DUPLICATE: "duplicate",
    ValueStatus.UNMATCHED: "part of a sum missing",
    ValueStatus.BETWEEN: "between samples",
    ValueStatus.REFUSED: "refused day",
    ValueStatus.PENDING: "unfinished day",
    ValueStatus.OUTSIDE: "not asked for",
    ValueStatus.STANDING: "other log in place",
    ValueStatus.UNREADABLE: "unreadable row",
}
"""Reasons for values that are not used, as the table and the JSON name them."""


@dataclass(eq=False)
class Series:
    """A source: a column of the wide layout, a tag of the long."""

    name: str
    times: Ints  # (n,) ascending [us UTC]; some may repeat
    values: Floats  # (n,) in the source's unit; NaN where the status is a reason
    statuses: NDArray[np.int8]  # (n,) :class:`ValueStatus`; the caller sets what becomes of the days
    unsorted: int = 0
    unreadable: int = 0


@dataclass
class Gathered:
    """The zone of the local days, the series of all files, and the faults of their days in order of time."""

    zone: dt.tzinfo
    series: dict[str, Series]
    faults: list[Fault] = field(default_factory=list)


def read_exports(paths: Sequence[Path], spec: Spec) -> list[Table]:
    """Read all files; UndeclaredError, before any work, for what none of them holds or declares."""
    tables = []
    for path in dict.fromkeys(paths):
        table = read_table(path, shown(path.name), spec, MANY, export=True)
        _refuse_flags(table, spec)
        _refuse_units(table, spec)
        tables.append(table)
    found = {name for table in tables for columns in table.parts for name in columns.numbers}
    for table in tables:
        # an export of other tags is no fault; one that was to be read, and of which no row can be, is
        if table.lacking and (not found or not table.others):
            raise UndeclaredError(f"{table.name}, {table.lacking}")
    for signal in spec.signals:
        for source in signal.sources:
            if source not in found:
                unread = {name for table in tables for name in (*table.others, *table.cells)}
                near = difflib.get_close_matches(source, unread, n=1, cutoff=0.3)
                nearest = f"; nearest is {near[0]!r}" if near else ""
                raise UndeclaredError(
                    f"no export holds {source!r} for {signal.name}{nearest}: "
                    f"set [input] {signal.name} to the export's own name"
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
        level = signal.name == "h_L"
        for source in signal.sources:
            unit = stated_unit(source, table.units.get(source, ""), level=level)
            if source in present and unit and unit != ("m" if level else "m3/s"):
                raise UndeclaredError(
                    f"{table.name}: {source!r} seems to be in {unit}: set [input.units] "
                    f'{signal.name} = "{unit}", or to what it is'
                )


def gather(tables: Sequence[Table], spec: Spec) -> Gathered:
    """Join the files; UndeclaredError where the zone of local days is unknown or differs between files."""
    zone = _one_zone(tables, spec)
    faults: list[Fault] = []
    pieces: dict[str, list[_Piece]] = {source: [] for source in spec.sources}
    for table in tables:
        for columns in table.parts:
            times, wrong = in_utc(columns, zone, spec)
            rows = [fault.at for fault in wrong]
            wrong += _faults(columns, times, spec, zone)
            # of a row that cannot be read the day is not known: it counts for those of both neighbours
            wrong += [bad._replace(at=bad.at - k) for bad in columns.bad for k in (0, 1)]
            last = len(times) - 1
            dated = {(int(times[min(max(f.at, 0), last)]), f"{table.name}, {f.text}", f.cut) for f in wrong}
            faults += [Fault(*fault) for fault in dated]
            for name in columns.numbers:
                piece = _piece(name, columns, times, table.name, spec)
                piece[-1][rows] = ValueStatus.TIME
                pieces[name].append(piece)
    series = {name: _join(name, found, zone, faults) for name, found in pieces.items() if found}
    return Gathered(zone, series, sorted(faults))


def _one_zone(tables: Sequence[Table], spec: Spec) -> dt.tzinfo:
    zones = {zone_of(columns, spec, table.name): table.name for table in tables for columns in table.parts}
    if len({day_bounds(dt.date(2000, 1, 1), zone) for zone in zones}) > 1:
        one, other = list(zones.values())[:2]
        raise UndeclaredError(
            f"{one} and {other} have different UTC offsets: set [input] time_zone to the zone whose days are "
            'meant, for example "Europe/Paris"'
        )
    return next(iter(zones))


def _piece(name: str, columns: Columns, times: Ints, file: str, spec: Spec) -> _Piece:
    values = columns.numbers[name]
    statuses = np.where(np.isfinite(values), ValueStatus.USED, ValueStatus.MISSING).astype(np.int8)
    for row, text in columns.why.get(name, {}).items():
        statuses[row] = (
            ValueStatus.FLAG
            if text.startswith(FLAG)
            else ValueStatus.MISSING
            if text in EMPTY
            else ValueStatus.STATUS
        )
    if spec.input.sentinels:
        statuses[np.isin(values, spec.input.sentinels)] = ValueStatus.SENTINEL
    return file, columns, times, np.where(statuses == ValueStatus.USED, values, np.nan), statuses


def _faults(columns: Columns, times: Ints, spec: Spec, zone: dt.tzinfo) -> list[Fault]:
    """Undeclared sentinels and values beyond any river, at their rows."""
    faults = undeclared(columns, times, spec, zone)
    for signal in spec.signals:
        for source in set(signal.sources) & set(columns.numbers):
            values = columns.numbers[source] * signal.factor
            beyond = (np.abs(values) > LARGEST) & ~np.isin(columns.numbers[source], spec.input.sentinels)
            for row in np.flatnonzero(beyond).tolist():
                faults.append(Fault(row, too_large(source, signal, columns, row, abs(float(values[row])))))
    return faults


def _join(name: str, pieces: list[_Piece], zone: dt.tzinfo, faults: list[Fault]) -> Series:
    _, all_columns, all_times, all_values, all_statuses = zip(*pieces, strict=True)
    times, values, statuses = map(np.concatenate, (all_times, all_values, all_statuses))
    unsorted = sum(int((part < np.maximum.accumulate(part)).sum()) for part in all_times)
    order = np.argsort(times, kind="stable")
    times, values, statuses = times[order], values[order], statuses[order]
    there = np.flatnonzero(statuses == ValueStatus.USED)
    again = np.flatnonzero(np.diff(times[there]) == 0) + 1
    for at in again.tolist():
        old, new = there[at - 1], there[at]
        if values[old] != values[new]:
            text = logged_twice(name, int(times[new]), zone, values[old], values[new])
            places = [_place(pieces, int(order[i])) for i in (new, old)]
            faults.append(Fault(int(times[new]), f"{places[0]}: {text} ({places[1]})"))
    statuses[there[again]] = ValueStatus.DUPLICATE
    unreadable = sum(len(columns.bad) for columns in all_columns)
    return Series(name, times, values, statuses, unsorted, unreadable)


def _place(pieces: list[_Piece], row: int) -> str:
    for file, columns, times, _, _ in pieces:
        if row < len(times):
            return f"{file}, {columns.place(row)}"
        row -= len(times)
    raise IndexError(row)


@dataclass(frozen=True)
class Ledger:
    """The account of an ingest: values read = values used + values dropped, by reason."""

    # per source, statuses of its values; those of unreadable rows are counted once per source
    sources: dict[str, Counter[ValueStatus]]
    unsorted: dict[str, int]  # per source, values behind a later one, which were sorted and not lost
    flags: Counter[str]  # flags for which values were dropped
    files: list[dict[str, Any]]  # counts of each file, as JSON holds them

    @property
    def reasons(self) -> list[ValueStatus]:
        """Reasons that occur, in their order."""
        return [status for status in WORDS if any(entry[status] for entry in self.sources.values())]

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        sources = {}
        for name, entry in self.sources.items():
            dropped = {WORDS[status]: entry[status] for status in WORDS if entry[status]}
            sources[name] = {
                "read": entry.total(),
                "used": entry[ValueStatus.USED],
                "dropped": dropped,
                "sorted": self.unsorted[name],
            }
        return {"sources": sources, "flags": dict(self.flags), "files": self.files}

    def lines(self) -> Iterable[str]:
        """As a table."""
        names = [name[:24] for name in self.sources]
        widths = [max(len(name), 9) for name in names]
        yield "  ".join([f"{'values':28s}", *(f"{n:>{w}s}" for n, w in zip(names, widths, strict=True))])
        rows: list[tuple[str, list[int]]] = [("read", [entry.total() for entry in self.sources.values()])]
        rows += [
            (WORDS[status], [entry[status] for entry in self.sources.values()]) for status in self.reasons
        ]
        rows.append(("used", [entry[ValueStatus.USED] for entry in self.sources.values()]))
        if any(self.unsorted.values()):
            rows.append(("out of order, sorted", list(self.unsorted.values())))
        for word, counts in rows:
            yield "  ".join([f"{word:28s}", *(f"{n:>{w},d}" for n, w in zip(counts, widths, strict=True))])


def ledger_of(tables: Sequence[Table], gathered: Gathered) -> Ledger:
    """The account of the files, once the statuses of all values are set."""
    sources = {}
    for name, series in gathered.series.items():
        kinds, counts = np.unique(series.statuses, return_counts=True)
        entry = Counter(
            {ValueStatus(k): int(n) for k, n in zip(kinds.tolist(), counts.tolist(), strict=True)}
        )
        entry[ValueStatus.UNREADABLE] += series.unreadable
        sources[name] = +entry
    flags: Counter[str] = Counter()
    files = []
    for table in tables:
        for columns in table.parts:
            flags += columns.flags
        good = sum(len(columns.times) for columns in table.parts)
        files.append(
            {
                "file": table.name,
                "rows": table.rows,
                "unreadable_rows": table.rows - table.others.total() - good,
                "comment_lines": table.comments,
                "repeated_headers": table.headers,
                "empty_lines": table.empty,
                "footer_lines": table.footers,
                "rows_of_other_tags": dict(table.others),
            }
        )
    return Ledger(sources, {name: s.unsorted for name, s in gathered.series.items()}, flags, files)
