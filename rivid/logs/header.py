"""What every reader hands on: the columns of one log as arrays, and the rows that could not be read."""

import csv
import difflib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rivid.errors import DataError
from rivid.logs.files import CutError
from rivid.logs.spec import Spec
from rivid.logs.times import read_text
from rivid.types import Floats

Micros = NDArray[np.int64]


class BadRow(NamedTuple):
    """A row that cannot be used.

    Attributes
    ----------
    row : int
        How many good rows stand before it.
    text : str
        Where it is and what is wrong, with what to do.
    cut : bool
        Whether it is the end of a log that is still being written, or was cut off.
    """

    row: int
    text: str
    cut: bool = False


@dataclass
class Seen:
    """What else a file holds, for whoever wants the whole account.

    Attributes
    ----------
    rows : int
        Rows of data, good or bad; not headers, comments and empty ones.
    comments, headers, empty, footers : int
        Lines that hold no data, and headers beyond the first.
    others : Counter
        Rows of tags that are not asked for.
    units : dict of str
        Per source: what the file says of its unit.
    cells : dict of set, or None
        Per column that is not read: its different texts; None where these are many.
    """

    rows: int = 0
    comments: int = 0
    headers: int = 0
    empty: int = 0
    footers: int = 0
    others: Counter[str] = field(default_factory=Counter)
    units: dict[str, str] = field(default_factory=dict)
    cells: dict[str, set[str] | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Columns:
    """The columns of a log that are asked for, in the order of its rows.

    Attributes
    ----------
    times : ndarray, (n,)
        [us]: of UTC where `aware`, else of the local clock.
    aware : bool
        Whether the times carry offsets.
    offset : int or None
        The one offset of all times [s]; None where they are many, or unaware.
    numbers : dict of ndarray, (n,)
        Per column of the log, in its unit; NaN where nothing is measured.
    lines : ndarray, (n,), or None
        Line of each row; None where rows are consecutive from `first_line`.
    bad : list of BadRow
    dropped : dict of list of int
        Per kind of row that was left out on purpose: how many good rows stand before each.
    zone : str or None
        Name of the zone that the log itself states (Parquet can).
    unit : str
        How messages call a row: line or row.
    why : dict of dict
        Per column: of rows without a number, the status text or flag for which there is none.
    flags : Counter
        Flags for which values were dropped.
    seen : Seen
    """

    times: Micros
    aware: bool
    offset: int | None
    numbers: dict[str, Floats]
    first_line: int = 1
    lines: NDArray[np.int64] | None = None
    bad: list[BadRow] = field(default_factory=list)
    dropped: dict[str, list[int]] = field(default_factory=dict)
    zone: str | None = None
    unit: str = "line"
    why: dict[str, dict[int, str]] = field(default_factory=dict)
    flags: Counter[str] = field(default_factory=Counter)
    seen: "Seen" = field(default_factory=lambda: Seen())

    def place(self, row: int) -> str:
        """Where a row stands in its file."""
        return f"{self.unit} {self.first_line + row if self.lines is None else self.lines[row]}"


UTF8_BOM = b"\xef\xbb\xbf"
UTF16_BOMS = (b"\xff\xfe", b"\xfe\xff")
OTHERS = {
    b"\x1f\x8b": "gzip, though its name does not say so: let it end in .csv.gz",
    b"PK\x03\x04": "a workbook or an archive, not text: save it as CSV, or unpack it",
    b"PAR1": "Parquet, though its name does not say so: let it end in .parquet",
    b"%PDF": "a PDF, not text: ask for the numbers as CSV",
}
"""How files begin that are no text, and what to do with them."""


class UndeclaredError(DataError):
    """The log is not of the kind that the configuration declares; the message says what to declare."""


class ColumnError(UndeclaredError):
    """A column that is asked for is missing or doubled."""


@dataclass(frozen=True)
class Header:
    """Column names of a CSV log and where its rows begin.

    Attributes
    ----------
    names : tuple of str
    body : int
        Bytes before the first row.
    line : int
        Number of the header's line.
    """

    names: tuple[str, ...]
    body: int
    line: int


def plain_bytes(content: bytes, spec: Spec, name: str) -> bytes:
    """The log in UTF-8 without a byte order mark.

    Raises
    ------
    DataError
        Where the bytes are not of the declared encoding, or no text at all.
    """
    for start, said in OTHERS.items():
        if content.startswith(start):
            raise DataError(f"{name} is {said}")
    if spec.encoding.lower().replace("_", "-") in ("utf-8", "utf8", "ascii", "utf-8-sig"):
        if content.startswith(UTF16_BOMS):
            raise UndeclaredError(f'{name} is UTF-16, not {spec.encoding}: set [input] encoding = "utf-16"')
        return content[3:] if content.startswith(UTF8_BOM) else content
    try:
        text = content.decode(spec.encoding)
    except (UnicodeError, LookupError) as error:
        raise UndeclaredError(f"{name} is not {spec.encoding}: {error}; set [input] encoding") from None
    return text.lstrip("\ufeff").encode("utf-8", "replace")


def read_header(content: bytes, spec: Spec, name: str) -> Header:
    """Find and read the header of a log in UTF-8.

    Raises
    ------
    ColumnError
        Where a column that is asked for is missing or doubled.
    """
    start, line = 0, spec.skip_rows + 1
    for _ in range(spec.skip_rows):
        start = _end_of_line(content, start)
    end = body = _end_of_line(content, start)
    if not content[start:end].strip():
        raise CutError(f"{name} has no header on line {line}")
    for _ in range(spec.unit_rows):
        body = _end_of_line(content, body)
    try:
        text = content[start:end].decode("utf-8")
        names = next(csv.reader([text.strip("\r\n")], delimiter=spec.separator, strict=True))
    except UnicodeDecodeError:
        raise UndeclaredError(not_utf8(name, line)) from None
    except csv.Error as error:
        raise DataError(f"{name}, line {line}: the header cannot be read: {error}") from None
    header = Header(tuple(n.strip() for n in names), body, line)
    check_names(header.names, spec, f"{name}, line {line}", text)
    return header


def read_odd_header(content: bytes, spec: Spec, name: str, *, some: bool = False) -> Header:
    """The header of an export: below comments, of several rows, or none at all.

    Parameters
    ----------
    content : bytes
        In UTF-8.
    spec : Spec
    name : str
        How messages call it.
    some : bool
        Whether some of the columns asked for are enough, as others stand in another file.

    Raises
    ------
    ColumnError
        Where a column that is asked for is missing or doubled.
    """
    dialect, start, line = spec.dialect, 0, spec.skip_rows + 1
    for _ in range(spec.skip_rows):
        start = _end_of_line(content, start)
    comment = dialect.comment.encode()
    if dialect.columns:
        for _ in range(spec.unit_rows):
            start = _end_of_line(content, start)
        check_names(dialect.columns, spec, "[input] columns", some=some)
        return Header(dialect.columns, start, line - 1)
    rows: list[list[str]] = []
    text = ""
    while len(rows) < dialect.header_rows:
        end = _end_of_line(content, start)
        if start >= len(content):
            raise CutError(f"{name} has no header below line {spec.skip_rows}")
        try:
            text = content[start:end].decode("utf-8")
        except UnicodeDecodeError:
            raise UndeclaredError(not_utf8(name, line)) from None
        if text.strip() and not (comment and content.startswith(comment, start)):
            rows.append(split_cells(text.strip("\r\n"), spec.separator) or [])
        start, line = end, line + 1
    width = max(map(len, rows))
    filled = [row + [""] * (width - len(row)) for row in rows]
    names = tuple(" ".join(filter(None, cells)) for cells in zip(*filled, strict=True))
    check_names(names, spec, f"{name}, line {line - 1}", text, some=some)
    for _ in range(spec.unit_rows):
        start = _end_of_line(content, start)
    return Header(names, start, line - 1)


def split_cells(line: str, separator: str) -> list[str] | None:
    """The cells of a line; None where a quotation mark is not closed. One blank is as good as several."""
    if '"' not in line:
        return line.split() if separator == " " else [cell.strip() for cell in line.split(separator)]
    try:
        cells = next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=separator == " "))
    except csv.Error:
        return None
    return [cell.strip() for cell in cells]


def not_utf8(name: str, line: int) -> str:
    """What to say of bytes that are not UTF-8."""
    return f'{name}, line {line}: not UTF-8: set [input] encoding, for example "latin-1" or "cp1252"'


def check_names(
    names: Sequence[str], spec: Spec, where: str, header: str = "", *, some: bool = False
) -> None:
    """Refuse a log in which a column that is asked for is missing or doubled.

    Parameters
    ----------
    names : sequence of str
    spec : Spec
    where : str
        How messages call the header.
    header : str
        Its text.
    some : bool
        Whether some of the sources, and the flags of these, are enough.

    Raises
    ------
    ColumnError
        Names the nearest column.
    """
    wanted, optional = _wanted(spec)
    if some and any(column in names for column, _ in optional):
        flags = dict(spec.dialect.quality)
        optional = [(column, role) for column, role in optional if column in names]
        optional += [(flags[column], "quality") for column, _ in optional if column in flags]
    else:
        optional += [(flag, "quality") for source, flag in spec.dialect.quality if source]
    for column, role in [*wanted, *optional]:
        count = names.count(column)
        if count == 1:
            continue
        if count > 1:
            several = "; where two rows make one name, set [input] header_rows = 2"
            raise ColumnError(f"{where}: {count} columns are named {column!r}: expected one{several}")
        raise ColumnError(
            f"{where}: no column {column!r} for {role}; {_advice(column, role, names, spec, header)}"
        )


def _wanted(spec: Spec) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Columns and what for: those of every row, and the sources' (none in the long layout: they are tags)."""
    dialect = spec.dialect
    wanted = [(column, "time") for column in spec.time]
    wanted += [(column, "quality") for source, column in dialect.quality if not source]
    if dialect.zone_column:
        wanted.append((dialect.zone_column, "zone_column"))
    if dialect.long:
        return [*wanted, *((column, "tag") for column in dialect.tag), (dialect.value, "value")], []
    return wanted, [(column, signal.name) for signal in spec.signals for column in signal.sources]


def _advice(column: str, role: str, names: Sequence[str], spec: Spec, header: str) -> str:
    for mark, said in ((";", ";"), ("\t", "\\t"), (",", ","), ("|", "|")):
        if len(names) == 1 and mark != spec.separator and mark in header:
            return f'the header is separated by "{said}": set [input] separator = "{said}"'
    if header.startswith("#") and not spec.dialect.comment:
        return 'the first line is a comment: set [input] comment = "#", or skip_rows'
    lower = {name.lower(): name for name in names if name}
    near = difflib.get_close_matches(column.lower(), lower, n=1, cutoff=0.3)
    nearest = f"nearest is {lower[near[0]]!r}; " if near else ""
    listed = ", ".join(name[:40] for name in names[:12]) + (", ..." if len(names) > 12 else "")
    none = ' or "" where it is not logged' if role == "u_Qo" else ""
    own = "; for an export of another system `rivid sniff FILE` proposes [input]"
    if {"time", "u_Qi"} <= set(names):
        own = "; of logs that `rivid ingest` wrote, the configuration stands beside them"
    return f"{nearest}there are: {listed}. Set [input] {role} to the log's own name{none}{own}"


def _end_of_line(content: bytes, start: int) -> int:
    """Where the next line begins; lines end with LF, CR LF or CR."""
    feed = content.find(b"\n", start)
    end = len(content) if feed < 0 else feed
    back = content.find(b"\r", start, end)
    if back >= 0 and back + 1 != feed:
        return back + 1
    return len(content) if feed < 0 else feed + 1


MOST = 20
"""Lines that are looked at, from the end."""
TAIL = 64 << 10
"""Bytes that are enough for these."""
LINE = re.compile(r"\r\n|\n|\r")
_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d|\d{8}")


def footer_lines(
    lines: Sequence[str], time_at: Sequence[int], separator: str, time_format: str | None, comment: str = ""
) -> list[int]:
    """Which of the last lines hold no data: the cells of the time, at `time_at`, hold none.

    Parameters
    ----------
    lines : sequence of str
        Split at each line break: the last one is empty where the text ends with one.
    time_at : sequence of int
    separator : str
    time_format : str or None
        None is ISO 8601.
    comment : str
        How lines begin that hold no data anyway; empty for none.

    Returns
    -------
    list of int
        Ascending; without empty lines, rows of empty cells and comments. A line whose time begins like a
        date is none of them, nor is one that begins with a digit where no line break follows: it may be a row
        that is damaged or cut off. None at all where there are too many.
    """
    found: list[int] = []
    for at in range(len(lines) - 1, -1, -1):
        line = lines[at]
        if not line.strip() or (comment and line.startswith(comment)):
            continue
        cells = split_cells(line, separator)
        if cells is not None and not any(cells):
            continue
        if at == len(lines) - 1 and line.lstrip(' "')[:1].isdigit():
            break
        text = " ".join((cells or [])[i] for i in time_at if i < len(cells or []))
        if _DATE.match(text) or read_text(text, time_format) is not None:
            break
        found.append(at)
        if len(found) > MOST:
            return []
    return found[::-1]


def cut_footer(content: bytes, header: Header, spec: Spec) -> tuple[bytes, int]:
    """A log without the lines that `[input] footer_rows` declares, and how many these are.

    A line with a time is never one of them, so a file that has no footer, or not yet, loses nothing.

    Parameters
    ----------
    content : bytes
        In UTF-8.
    header : Header
    spec : Spec

    Returns
    -------
    content : bytes
    count : int
        At most `footer_rows`.
    """
    if not spec.footer_rows:
        return content, 0
    begin = max(header.body, len(content) - TAIL)
    tail = content[begin:].decode("utf-8", "surrogateescape")
    lines = LINE.split(tail)
    known = 1 if begin > header.body else 0  # the first line may be a part of one
    time_at = [header.names.index(name) for name in spec.time]
    found = footer_lines(lines[known:], time_at, spec.separator, spec.time_format, spec.dialect.comment)
    found = found[-spec.footer_rows :]
    if not found:
        return content, 0
    behind = known + found[0]
    ends = [match.end() for match in LINE.finditer(tail)]
    kept = tail[: ends[behind - 1] if behind else 0]
    return content[: begin + len(kept.encode("utf-8", "surrogateescape"))], len(found)
