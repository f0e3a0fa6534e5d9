"""The account: of each source, how many values were read, how many are used, and why the others are not."""

import datetime as dt
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rivid.input_config import InputConfig
from rivid.logs.header import Columns, Micros, UndeclaredError
from rivid.logs.ingest.export import Export
from rivid.logs.log import Fault, undeclared, zone_of
from rivid.logs.spec import Spec
from rivid.logs.text import FLAG, LARGEST
from rivid.logs.times import clock, day_bounds, to_utc
from rivid.types import Floats


class Fate(IntEnum):
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
    Fate.MISSING: "missing",
    Fate.STATUS: "status text",
    Fate.FLAG: "flag",
    Fate.SENTINEL: "sentinel",
    Fate.TIME: "ambiguous or impossible time",
    Fate.DUPLICATE: "duplicate",
    Fate.UNMATCHED: "part of a sum missing",
    Fate.BETWEEN: "between samples",
    Fate.REFUSED: "refused day",
    Fate.PENDING: "unfinished day",
    Fate.OUTSIDE: "not asked for",
    Fate.STANDING: "other log in place",
    Fate.UNREADABLE: "unreadable row",
}
"""Reasons as the table and the JSON call them."""


@dataclass
class FileCount:
    """What one file held.

    Attributes
    ----------
    name : str
    rows, unreadable : int
        Of data; and of these, such as cannot be read.
    comments, headers, empty, footers : int
        Lines without data.
    others : Counter
        Rows of tags that are not asked for.
    """

    name: str
    rows: int
    unreadable: int
    comments: int
    headers: int
    empty: int
    others: Counter[str]
    footers: int = 0

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        named = {"file": self.name, "rows": self.rows, "unreadable_rows": self.unreadable}
        lines = {"comment_lines": self.comments, "repeated_headers": self.headers, "empty_lines": self.empty}
        lines["footer_lines"] = self.footers
        return named | lines | {"rows_of_other_tags": dict(self.others)}


@dataclass
class Ledger:
    """The account of an ingest.

    Attributes
    ----------
    sources : dict of Counter
        Per source, fates of its values; those of rows that cannot be read are counted once per source.
    unsorted : dict of int
        Per source, values that stood behind a later one and were sorted; they are not lost.
    flags : Counter
        Flags for which values were dropped.
    files : list of FileCount
    """

    sources: dict[str, Counter[Fate]] = field(default_factory=dict)
    unsorted: dict[str, int] = field(default_factory=dict)
    flags: Counter[str] = field(default_factory=Counter)
    files: list[FileCount] = field(default_factory=list)

    def count(self, source: str, fates: NDArray[np.int8], unreadable: int, unsorted: int) -> None:
        """Enter a source."""
        kinds, counts = np.unique(fates, return_counts=True)
        entry = Counter({Fate(k): int(n) for k, n in zip(kinds.tolist(), counts.tolist(), strict=True)})
        entry[Fate.UNREADABLE] += unreadable
        self.sources[source] = +entry
        self.unsorted[source] = unsorted

    @property
    def reasons(self) -> list[Fate]:
        """Reasons that occur, in their order."""
        return [fate for fate in WORDS if any(entry[fate] for entry in self.sources.values())]

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it: read = used + all that is dropped."""
        return {
            "sources": {
                name: told(entry) | {"sorted": self.unsorted[name]} for name, entry in self.sources.items()
            },
            "flags": dict(self.flags),
            "files": [file.to_json() for file in self.files],
        }

    def lines(self) -> Iterable[str]:
        """As a table."""
        names = [name[:24] for name in self.sources]
        widths = [max(len(name), 9) for name in names]
        yield "  ".join([f"{'values':28s}", *(f"{n:>{w}s}" for n, w in zip(names, widths, strict=True))])
        rows: list[tuple[str, list[int]]] = [("read", [entry.total() for entry in self.sources.values()])]
        rows += [(WORDS[fate], [entry[fate] for entry in self.sources.values()]) for fate in self.reasons]
        rows.append(("used", [entry[Fate.USED] for entry in self.sources.values()]))
        if any(self.unsorted.values()):
            rows.append(("out of order, sorted", list(self.unsorted.values())))
        for word, counts in rows:
            yield "  ".join([f"{word:28s}", *(f"{n:>{w},d}" for n, w in zip(counts, widths, strict=True))])


def told(entry: Mapping[Fate, int]) -> dict[str, Any]:
    """One source as JSON can hold it."""
    dropped = {WORDS[fate]: entry[fate] for fate in WORDS if entry.get(fate)}
    return {"read": sum(entry.values()), "used": entry.get(Fate.USED, 0), "dropped": dropped}


EMPTY = frozenset(InputConfig().missing)
"""Marks that no system writes for a state of its instruments."""


@dataclass(eq=False)
class Series:
    """A source: a column of the wide layout, a tag of the long.

    Attributes
    ----------
    name : str
    times : ndarray, (n,)
        Ascending [us UTC]; some may repeat.
    values : ndarray, (n,)
        In the source's unit; NaN where the fate is a reason.
    fates : ndarray, (n,)
        :class:`Fate`; the caller sets what becomes of the days.
    unsorted, unreadable : int
    """

    name: str
    times: Micros
    values: Floats
    fates: NDArray[np.int8]
    unsorted: int = 0
    unreadable: int = 0


@dataclass
class Gathered:
    """What all files hold together.

    Attributes
    ----------
    zone : tzinfo
        Of the local days.
    series : dict of Series
    faults : list of Fault
        What makes the day of a time unusable, in order of time.
    """

    zone: dt.tzinfo
    series: dict[str, Series]
    faults: list[Fault] = field(default_factory=list)


@dataclass
class _Piece:
    """A source in one file."""

    file: str
    columns: Columns
    times: Micros
    values: Floats
    fates: NDArray[np.int8]


def gather(exports: Sequence[Export], spec: Spec) -> Gathered:
    """Join the files.

    Parameters
    ----------
    exports : sequence of Export
    spec : Spec

    Returns
    -------
    Gathered

    Raises
    ------
    UndeclaredError
        Where local days cannot be told, or mean different days in different files.
    """
    zone = _one_zone(exports, spec)
    faults: list[Fault] = []
    pieces: dict[str, list[_Piece]] = {source: [] for source in spec.sources}
    for export in exports:
        for columns in export.parts:
            times, wrong = _in_utc(columns, zone, spec, export.name, faults)
            for name in columns.numbers:
                piece = _piece(name, columns, times, export.name, spec)
                piece.fates[wrong] = Fate.TIME
                pieces[name].append(piece)
            _note_faults(columns, times, export.name, spec, zone, faults)
    series = {name: _join(name, found, spec, zone, faults) for name, found in pieces.items() if found}
    return Gathered(zone, series, sorted(faults))


def _one_zone(exports: Sequence[Export], spec: Spec) -> dt.tzinfo:
    zones = {
        zone_of(columns, spec, export.name): export.name for export in exports for columns in export.parts
    }
    if len({day_bounds(dt.date(2000, 1, 1), zone) for zone in zones}) > 1:
        one, other = list(zones.values())[:2]
        raise UndeclaredError(
            f"{one} and {other} have different UTC offsets: set [input] time_zone to the zone whose days are "
            'meant, for example "Europe/Paris"'
        )
    return next(iter(zones))


def _in_utc(
    columns: Columns, zone: dt.tzinfo, spec: Spec, file: str, faults: list[Fault]
) -> tuple[Micros, list[int]]:
    """Times in UTC, and the rows whose time does not exist, or occurs twice and may not."""
    if columns.aware:
        return columns.times, []
    times, refused = to_utc(columns.times, zone, spec.ambiguous)
    faults += [Fault(int(times[r]), f"{file}, {columns.place(r)}: {reason}") for r, reason in refused]
    return times, [row for row, _ in refused]


def _piece(name: str, columns: Columns, times: Micros, file: str, spec: Spec) -> _Piece:
    values = columns.numbers[name]
    fates = np.where(np.isfinite(values), Fate.USED, Fate.MISSING).astype(np.int8)
    for row, text in columns.why.get(name, {}).items():
        fates[row] = Fate.FLAG if text.startswith(FLAG) else Fate.MISSING if text in EMPTY else Fate.STATUS
    if spec.sentinels:
        fates[np.isin(values, spec.sentinels)] = Fate.SENTINEL
    return _Piece(file, columns, times, np.where(fates == Fate.USED, values, np.nan), fates)


def _note_faults(
    columns: Columns, times: Micros, file: str, spec: Spec, zone: dt.tzinfo, faults: list[Fault]
) -> None:
    """Rows that cannot be read count against the days of both neighbours: their own day is not known."""
    for row, text, cut in columns.bad:
        for at in {min(max(row - 1, 0), len(times) - 1), min(row, len(times) - 1)}:
            faults.append(Fault(int(times[at]), f"{file}, {text}", cut))
    for row, text, cut in undeclared(columns, times, spec, zone):
        faults.append(Fault(int(times[row]), f"{file}, {text}", cut))
    for signal in spec.signals:
        for source in set(signal.sources) & set(columns.numbers):
            values = np.abs(columns.numbers[source]) * signal.factor
            beyond = (values > LARGEST) & ~np.isin(columns.numbers[source], spec.sentinels)
            for row in np.flatnonzero(beyond).tolist():
                unit = "m" if signal.name == "h_L" else "m3/s"
                said = f"{source} = {values[row]:.3g} {unit} is beyond any river: check [input.units]"
                place = f"{file}, {columns.place(int(row))}"
                faults.append(
                    Fault(int(times[row]), f"{place}: {said}, or add the value to [input] sentinels")
                )


def _join(name: str, pieces: list[_Piece], spec: Spec, zone: dt.tzinfo, faults: list[Fault]) -> Series:
    times = np.concatenate([piece.times for piece in pieces])
    values = np.concatenate([piece.values for piece in pieces])
    fates = np.concatenate([piece.fates for piece in pieces])
    unsorted = sum(int((p.times < np.maximum.accumulate(p.times)).sum()) for p in pieces)
    order = np.argsort(times, kind="stable")
    times, values, fates = times[order], values[order], fates[order]
    there = np.flatnonzero(fates == Fate.USED)
    again = np.flatnonzero(np.diff(times[there]) == 0) + 1
    for at in again.tolist():
        old, new = there[at - 1], there[at]
        if values[old] != values[new]:
            moment = clock(int(times[new]), zone, with_date=True)
            said = f"{moment} is logged twice with different {name}: {values[old]:.6g} and {values[new]:.6g}"
            places = [_place(pieces, int(order[i])) for i in (new, old)]
            faults.append(Fault(int(times[new]), f"{places[0]}: {said} ({places[1]})"))
    fates[there[again]] = Fate.DUPLICATE
    unreadable = sum(len(piece.columns.bad) for piece in pieces)
    return Series(name, times, values, fates, unsorted, unreadable)


def _place(pieces: list[_Piece], row: int) -> str:
    for piece in pieces:
        if row < len(piece.times):
            return f"{piece.file}, {piece.columns.place(row)}"
        row -= len(piece.times)
    raise IndexError(row)
