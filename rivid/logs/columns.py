"""What all readers of files return, and what they share: columns, numbers in texts, and column names."""

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from rivid.errors import DataError, printable
from rivid.logs.spec import Spec
from rivid.types import Floats, Ints

NAN = float("nan")
FLAG = "\0"
"""Prefix in `Columns.why` where a flag, not the cell's own text, is the reason for a missing value."""


class UndeclaredError(DataError):
    """The log is not of the kind that the configuration declares; the message gives the key to set."""


class ColumnError(UndeclaredError):
    """A required column is missing or doubled."""


class Fault(NamedTuple):
    """What makes a row, or the day of a time, unusable."""

    at: int  # number of usable rows before it, or its time [us]
    text: str  # where it is, what is wrong, and what to do
    cut: bool = False  # whether it is the end of a log that is still being written, or was cut off


@dataclass(frozen=True)
class Columns:
    """The required columns of a log, in the order of its rows."""

    times: Ints  # (n,) [us]: of UTC where `aware`, else of the local clock
    aware: bool  # whether the times carry offsets
    offset: int | None  # the one offset of all times [s]; None where they are many, or unaware
    numbers: dict[str, Floats]  # (n,) per column of the log, in its unit; NaN where nothing is measured
    first_line: int = 1
    lines: Ints | None = None  # (n,) line of each row; None where rows are consecutive from `first_line`
    bad: list[Fault] = field(default_factory=list)  # rows that cannot be used
    # per kind of row that was left out on purpose: number of usable rows before each
    dropped: dict[str, list[int]] = field(default_factory=dict)
    zone: str | None = None  # name of the zone that the log itself states (Parquet can)
    unit: str = "line"  # "line" or "row", for messages
    # per column: of rows without a number, the status text, or the flag after :data:`FLAG`
    why: dict[str, dict[int, str]] = field(default_factory=dict)
    flags: Counter[str] = field(default_factory=Counter)  # flags for which values were dropped

    def place(self, row: int) -> str:
        """Where a row is in its file."""
        return f"{self.unit} {self.first_line + row if self.lines is None else self.lines[row]}"


@dataclass
class Table:
    """A file, read."""

    parts: list[Columns]  # one of the wide layout, one per tag of the long; empty where no row can be used
    lacking: str = ""  # the reason where `parts` is empty
    rows: int = 0  # rows of data, usable or not; without headers, comments and empty lines
    comments: int = 0  # lines that hold no data, and headers beyond the first
    headers: int = 0
    empty: int = 0
    footers: int = 0
    others: Counter[str] = field(default_factory=Counter)  # rows of tags that are not read
    units: dict[str, str] = field(default_factory=dict)  # unit of each source, as the file states it
    # different texts of each column that is not read; None where these are many
    cells: dict[str, set[str] | None] = field(default_factory=dict)
    name: str = ""  # file name for messages
    digest: str = ""  # SHA-256 of the file


class NumberReader:
    """Reads numbers in texts exactly as declared: texts of `missing` values and marks."""

    def __init__(self, missing: Iterable[str], decimal: str = ".", thousands: str = "") -> None:
        self.missing = frozenset(missing)
        self.decimal, self.thousands = decimal, thousands
        self._plain, self._grouped = _patterns(decimal, thousands)

    def read(self, text: str) -> float | None:
        """The number in a cell; NaN where it is declared missing, None where it is no number."""
        text = text.strip()
        if text in self.missing:
            return NAN
        if not self._plain.fullmatch(text):
            if self._grouped is None or not self._grouped.fullmatch(text):
                return None
            text = text.replace(self.thousands, "").replace("\u00a0", "").replace("\u202f", "")
        return float(text.replace(self.decimal, ".") if self.decimal != "." else text)

    def refusal(self, column: str, text: str) -> str:
        """The message for a cell that is no number, with the key to set."""
        return f"column {column!r} holds {text[:40]!r}, which is no number: {self._hint(text.strip())}"

    def _hint(self, text: str) -> str:
        if text.lower().lstrip("+-") in ("inf", "infinity", "nan"):
            return f'if it means "not measured", add "{text}" to [input] missing'
        if re.fullmatch(r"[+-]?\d+,\d+", text) and self.decimal == ".":
            decimal = 'if the comma is the decimal mark, set [input] decimal = ","'
            grouped = re.fullmatch(r"[+-]?\d{1,3},\d{3}", text)
            return decimal + ('; if it separates thousands, thousands = ","' if grouped else "")
        if re.fullmatch(r"[+-]?\d+\.\d+", text) and self.decimal == ",":
            return '[input] decimal is ",", and the cell has a point'
        if match := re.fullmatch(r"[+-]?\d{1,3}([ .,'\u00a0\u202f])\d{3}(?:\1\d{3})*(?:[.,]\d+)?", text):
            mark = match[1] if match[1] not in "\u00a0\u202f" else " "
            return f'if "{mark}" separates thousands, set [input] thousands = "{mark}"'
        return f'if it means "not measured", add "{text[:40]}" to [input] missing'


@lru_cache(maxsize=32)
def _patterns(decimal: str, thousands: str) -> tuple[re.Pattern[str], re.Pattern[str] | None]:
    point = re.escape(decimal)
    plain = re.compile(rf"[+-]?(?:[0-9]+(?:{point}[0-9]*)?|{point}[0-9]+)(?:[eE][+-]?[0-9]{{1,3}})?")
    if not thousands:
        return plain, None
    # spreadsheets write a no-break space where a space is meant
    mark = "[ \u00a0\u202f]" if thousands == " " else re.escape(thousands)
    return plain, re.compile(rf"[+-]?[0-9]{{1,3}}(?:{mark}[0-9]{{3}})+(?:{point}[0-9]*)?")


def check_names(
    names: Sequence[str], spec: Spec, where: str, header: str = "", *, some: bool = False
) -> None:
    """Raise ColumnError, with the nearest name, where a required column is missing or doubled.

    With `some`, some of the sources and their flags are enough: others are in another file.
    """
    given = spec.input
    wanted = [(column, "time") for column in spec.time]
    wanted += [(column, "quality") for source, column in spec.flags.items() if not source]
    if given.zone_column:
        wanted.append((given.zone_column, "zone_column"))
    sources = [(column, signal.name) for signal in spec.signals for column in signal.sources]
    if spec.long:
        wanted += [*((column, "tag") for column in spec.tags), (given.value, "value")]
        sources = []
    if some and any(column in names for column, _ in sources):
        sources = [(column, role) for column, role in sources if column in names]
    read = {column for column, _ in sources}
    wanted += [*sources, *((flag, "quality") for source, flag in spec.flags.items() if source in read)]
    for column, role in wanted:
        count = names.count(column)
        if count > 1:
            several = "; where two rows make one name, set [input] header_rows = 2"
            raise ColumnError(f"{where}: {count} columns are named {column!r}: expected one{several}")
        if not count:
            raise ColumnError(
                f"{where}: no column {column!r} for {role}; {_advice(column, role, names, spec, header)}"
            )


def _advice(column: str, role: str, names: Sequence[str], spec: Spec, header: str) -> str:
    """What to set where a column is missing."""
    for mark, shown in ((";", ";"), ("\t", "\\t"), (",", ","), ("|", "|")):
        if len(names) == 1 and mark != spec.input.separator and mark in header:
            return f'the header is separated by "{shown}": set [input] separator = "{shown}"'
    if header.startswith("#") and not spec.input.comment:
        return 'the first line is a comment: set [input] comment = "#", or skip_rows'
    lower = {name.lower(): name for name in names if name}
    near = difflib.get_close_matches(column.lower(), lower, n=1, cutoff=0.3)
    nearest = f"nearest is {lower[near[0]]!r}; " if near else ""
    listed = ", ".join(printable(name[:40]) for name in names[:12]) + (", ..." if len(names) > 12 else "")
    none = ' or "" where it is not logged' if role == "u_Qo" else ""
    own = "; for an export of another system `rivid sniff FILE` proposes [input]"
    if {"time", "u_Qi"} <= set(names):
        own = "; of logs that `rivid ingest` wrote, the configuration is next to them"
    return f"{nearest}there are: {listed}. Set [input] {role} to the log's own name{none}{own}"
