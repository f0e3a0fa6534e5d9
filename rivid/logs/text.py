"""Columns of a file, numbers in texts, and text files of any dialect that `[input]` can declare.

Clean CSV logs are read by :mod:`rivid.logs.log`; the reader here, cell by cell, is for all others, and
reports each fault with its line and a remedy.
"""

import csv
import difflib
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from rivid.errors import DataError, printable
from rivid.logs.spec import MICRO, CutError, Spec, read_text, seconds_of
from rivid.types import Floats, Ints

NAN = float("nan")
# prefix in `Columns.why` where a flag, not the cell's own text, is the reason for a missing value
FLAG = "\0"


class UndeclaredError(DataError):
    """The log is not of the kind that the configuration declares; the message gives the key to set."""


class ColumnError(UndeclaredError):
    """A required column is missing or doubled."""


class Fault(NamedTuple):
    """The reason why a row, or the day of a time, is unusable."""

    at: int  # number of usable rows before it, or its time [us]
    text: str  # where it is, what is wrong, and what to do
    cut: bool = False  # whether it is the end of a log that is still being written, or was cut off
    twice: bool = False  # whether it is a second value of the same time


@dataclass(frozen=True)
class Columns:
    """The required columns of a log, in the order of its rows."""

    times: Ints  # (n,) [us]: of UTC where `aware`, else of the local clock
    aware: bool  # whether the times carry offsets
    offset: int | None  # the one offset of all times [s]; None where they are many, or unaware
    numbers: dict[str, Floats]  # (n,) per column of the log, in its unit; NaN where nothing is measured
    lines: Sequence[int]  # (n,) line of each row
    bad: list[Fault] = field(default_factory=list)  # rows that cannot be used
    # per kind of row that was left out on purpose: number of usable rows before each
    dropped: dict[str, list[int]] = field(default_factory=dict)
    zone: str | None = None  # name of the zone that the log itself states (Parquet can)
    unit: str = "line"  # "line" or "row", for messages
    # per column: of rows without a number, the status text, or the flag after :data:`FLAG`
    why: dict[str, dict[int, str]] = field(default_factory=dict)

    @property
    def flagged(self) -> list[tuple[int, str]]:
        """Row and flag of each value that was dropped for its flag."""
        whys = [(row, text) for texts in self.why.values() for row, text in texts.items()]
        return [(row, text[1:]) for row, text in whys if text.startswith(FLAG)]

    def place(self, row: int) -> str:
        """The place of a row in its file."""
        return f"{self.unit} {self.lines[row]}"


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
        point = re.escape(decimal)
        number = rf"[+-]?(?:[0-9]+(?:{point}[0-9]*)?|{point}[0-9]+)(?:[eE][+-]?[0-9]{{1,3}})?"
        # spreadsheets write a no-break space where a space is meant
        mark = "[ \u00a0\u202f]" if thousands == " " else re.escape(thousands)
        grouped = rf"[+-]?[0-9]{{1,3}}(?:{mark}[0-9]{{3}})+(?:{point}[0-9]*)?"
        self._plain, self._grouped = re.compile(number), re.compile(grouped) if thousands else None

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
        hint = f'if it means "not measured", add "{text[:40]}" to [input] missing'
        if re.fullmatch(r"[+-]?\d+,\d+", text) and self.decimal == ".":
            hint = 'if the comma is the decimal mark, set [input] decimal = ","'
            if re.fullmatch(r"[+-]?\d{1,3},\d{3}", text):
                hint += '; if it separates thousands, thousands = ","'
        elif re.fullmatch(r"[+-]?\d+\.\d+", text) and self.decimal == ",":
            hint = '[input] decimal is ",", and the cell has a point'
        elif match := re.fullmatch(r"[+-]?\d{1,3}([ .,'\u00a0\u202f])\d{3}(?:\1\d{3})*(?:[.,]\d+)?", text):
            mark = match[1] if match[1] not in "\u00a0\u202f" else " "
            hint = f'if "{mark}" separates thousands, set [input] thousands = "{mark}"'
        return f"column {column!r} holds {text[:40]!r}, which is no number: {hint}"


def check_names(
    names: Sequence[str], spec: Spec, where: str, header: str = "", *, some: bool = False
) -> None:
    """ColumnError where a required column is missing or doubled; with `some`, some sources are enough."""
    given = spec.input
    sources = [(column, signal.name) for signal in spec.signals for column in signal.sources]
    if spec.long:
        sources = [*((column, "tag") for column in spec.tags), (given.value, "value")]
    elif some and any(column in names for column, _ in sources):
        sources = [(column, role) for column, role in sources if column in names]
    read = {"", *(column for column, _ in sources)}
    wanted = [(column, "time") for column in spec.time]
    wanted += [(given.zone_column, "zone_column")] if given.zone_column else []
    wanted += [*sources, *((flag, "quality") for source, flag in spec.flags.items() if source in read)]
    for column, role in wanted:
        count = names.count(column)
        if count > 1:
            several = "set [input] columns to the names of all, each once, and skip_rows to pass the header"
            rows = "where two rows make one name, set header_rows = 2"
            raise ColumnError(
                f"{where}: {count} columns are named {column!r}: expected one; {several}; {rows}"
            )
        if not count:
            advice = _advice(column, role, names, spec, header)
            raise ColumnError(f"{where}: no column {column!r} for {role}; {advice}")


def _advice(column: str, role: str, names: Sequence[str], spec: Spec, header: str) -> str:
    """Advice for a missing column: the key to set."""
    for mark, shown in ((";", ";"), ("\t", "\\t"), (",", ","), ("|", "|")):
        if len(names) == 1 and mark != spec.input.separator and mark in header:
            return f'the header is separated by "{shown}": set [input] separator = "{shown}"'
    if header.startswith("#") and not spec.input.comment:
        return 'the first line is a comment: set [input] comment = "#", or skip_rows'
    lower = {name.lower(): name for name in names if name and name not in (*spec.sources, *spec.time)}
    near = difflib.get_close_matches(column.lower(), lower, n=1, cutoff=0.3)
    nearest = f"nearest is {lower[near[0]]!r}; " if near else ""
    listed = ", ".join(printable(name[:40]) for name in names[:12]) + (", ..." if len(names) > 12 else "")
    none = ', or u_Qo = "" where the outflow is not logged' if role == "u_Qo" else ""
    own = "; for an export of another system `rivid sniff FILE` proposes [input]"
    if {"time", "u_Qi"} <= set(names):
        own = "; of logs that `rivid ingest` wrote, the configuration is next to them"
    return f"{nearest}there are: {listed}. Set [input] {role} to the log's own name{none}{own}"


LINE = re.compile(r"\r\n|\n|\r")
_LINE_END = re.compile(rb"\r\n|\n|\r")
MANY_TEXTS = 20  # different texts of an unread column; with more of them it holds no flags
MOST_FOOTERS = 20  # lines at the end of a file that are checked; more without a time are no footer
TAIL = 64 << 10  # bytes at the end of a file that hold these lines
_ENDLESS = 10**9
_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d|\d{8}")
ZRXP_UNIT = re.compile(r"CUNIT([^|*]+)")  # unit of a block in a comment of a ZRXP file
_UTF16_BOMS = (b"\xff\xfe", b"\xfe\xff")
_NO_TEXT = {
    b"\x1f\x8b": "gzip, though its name does not end in .gz: let it end in .csv.gz",
    b"PK\x03\x04": "a workbook or an archive, not text: save it as CSV, or unpack it",
    b"PAR1": "Parquet, though its name does not end in .parquet: let it end in .parquet",
    b"%PDF": "a PDF, not text: export the numbers as CSV",
}
"""First bytes of files that are no text, and what to do with them."""


Header = tuple[tuple[str, ...], int, int]
"""Column names of a text file, the bytes before its first row, and the line number of the names."""


def is_unit_column(name: str) -> bool:
    """Whether a column holds the units of the values next to it."""
    return name.lower() in ("unit", "units", "einheit", "unité", "unite", "uom", "unidad", "eu", "eng units")


def unmarked_utf16(content: bytes) -> str:
    """The UTF-16 encoding of a text without byte order mark; empty for another encoding."""
    start = content[:2000]
    if content.startswith(_UTF16_BOMS) or start.count(b"\0") <= len(start) // 4:
        return ""
    return "utf-16-le" if content[1:2] == b"\0" else "utf-16-be"


def to_utf8(content: bytes, spec: Spec, name: str) -> bytes:
    """The text in UTF-8 without a byte order mark; DataError where it is not of the declared encoding."""
    for start, kind in _NO_TEXT.items():
        if content.startswith(start):
            raise DataError(f"{name} is {kind}")
    encoding = spec.input.encoding
    if encoding.lower().replace("_", "-") in ("utf-8", "utf8", "ascii", "utf-8-sig"):
        wide = "utf-16" if content.startswith(_UTF16_BOMS) else unmarked_utf16(content)
        if wide:
            raise UndeclaredError(f'{name} is UTF-16, not {encoding}: set [input] encoding = "{wide}"')
        return content.removeprefix(b"\xef\xbb\xbf")
    try:
        text = content.decode(encoding)
    except (UnicodeError, LookupError) as error:
        raise UndeclaredError(f"{name} is not {encoding}: {error}; set [input] encoding") from None
    return text.lstrip("\ufeff").encode("utf-8", "replace")


def read_header(content: bytes, spec: Spec, name: str, *, some: bool = False) -> Header:
    """Read the names of the columns of a text in UTF-8; `some` as of :func:`check_names`."""
    given = spec.input
    start, line, text = end_of_lines(content, 0, given.skip_rows), given.skip_rows, ""
    rows: list[list[str]] = []
    while len(rows) < given.header_rows and not given.columns:
        end, line = end_of_lines(content, start), line + 1
        if start >= len(content):
            raise CutError(f"{name} has no header below line {given.skip_rows}")
        try:
            text = content[start:end].decode("utf-8")
        except UnicodeDecodeError:
            raise UndeclaredError(_not_utf8(name, line)) from None
        if text.strip() and not (given.comment and text.startswith(given.comment)):
            cells = split_cells(text.strip("\r\n"), given.separator)
            if cells is None:
                raise DataError(f"{name}, line {line}: the header has a quotation mark that is not closed")
            rows.append(cells)
        start = end
    names, place = tuple(given.columns), "[input] columns"
    if rows:
        cells_of = zip_longest(*rows, fillvalue="")
        names, place = tuple(" ".join(filter(None, cells)) for cells in cells_of), f"{name}, line {line}"
    check_names(names, spec, place, text, some=some)
    return names, end_of_lines(content, start, given.unit_rows), line


def split_cells(line: str, separator: str) -> list[str] | None:
    """The cells of a line; None where a quotation mark is not closed. One blank is as good as several."""
    if '"' not in line:
        return line.split() if separator == " " else [cell.strip() for cell in line.split(separator)]
    try:
        cells = next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=separator == " "))
    except csv.Error:
        return None
    return [cell.strip() for cell in cells]


def _not_utf8(name: str, line: int) -> str:
    return f'{name}, line {line}: not UTF-8: set [input] encoding, for example "latin-1" or "cp1252"'


def end_of_lines(content: bytes, start: int, lines: int = 1) -> int:
    """Where the text behind some lines begins; lines end with LF, CR LF or CR."""
    for _ in range(lines):
        match = _LINE_END.search(content, start)
        start = match.end() if match else len(content)
    return start


def footer_lines(
    lines: Sequence[str], time_at: Sequence[int], separator: str, time_format: str | None, comment: str = ""
) -> list[int]:
    """Indices, ascending, of the last lines that hold no data: averages, "end of report".

    `lines` are split at each line break (the last one is empty where the text ends with one); `time_at` are
    the cells of the time. A line that has a time, or begins like a date, is no footer; empty lines and
    comments are not counted. Empty where there are more than :data:`MOST_FOOTERS`.
    """
    found: list[int] = []
    for at in range(len(lines) - 1, -1, -1):
        line = lines[at]
        cells = split_cells(line, separator)
        if cells is not None and not any(cells) or (comment and line.startswith(comment)):
            continue
        if at == len(lines) - 1 and line.lstrip(' "')[:1].isdigit():
            break  # without a line break it may be a damaged row
        text = " ".join((cells or [])[i] for i in time_at if i < len(cells or []))
        if _DATE.match(text) or read_text(text, time_format) is not None:
            break
        found.append(at)
        if len(found) > MOST_FOOTERS:
            return []
    return found[::-1]


def cut_footer(content: bytes, header: Header, spec: Spec) -> tuple[bytes, int]:
    """The text without the lines that `[input] footer_rows` declares, if they are there, and their number."""
    given, (names, body, _) = spec.input, header
    if not given.footer_rows:
        return content, 0
    begin = max(body, len(content) - TAIL)
    starts = [begin, *(match.end() for match in _LINE_END.finditer(content, begin))]
    lines = [line.decode("utf-8", "replace") for line in _LINE_END.split(content[begin:])]
    known = int(begin > body)  # the first line may be a part of one
    time_at = [names.index(name) for name in spec.time]
    found = footer_lines(lines[known:], time_at, given.separator, given.time_format, given.comment)
    found = found[-given.footer_rows :]
    return (content[: starts[known + found[0]]], len(found)) if found else (content, 0)


def read_lines(
    content: bytes, header: Header, spec: Spec, name: str, stem: str = "", *, watch: bool = False
) -> Table:
    """Read all lines below the header of `content` in UTF-8; arguments as of :class:`RowReader`."""
    names, body, line_of_names = header
    rows = RowReader(names, spec, stem, watch)
    try:
        text = content[body:].decode("utf-8")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, body + error.start) + 1
        raise UndeclaredError(_not_utf8(name, place)) from None
    if rows.pattern:
        for line in LINE.split(content[:body].decode("utf-8", "replace")):
            rows.look_for_tag(line)
    given, lines = spec.input, LINE.split(text)
    first = line_of_names + given.unit_rows + 1
    footer = footer_lines(lines, rows.time_at, given.separator, given.time_format, given.comment)
    if footer:
        rows.footer = first + footer[0], len(footer) + given.footer_rows
    for number, line in enumerate(lines, first):
        rows.unended = number == first + len(lines) - 1
        if line.strip():
            rows.add(number, line)
    return rows.table()


Row = tuple[int, int | None, int, list[float]]
"""Time [us], offset [s], line, and a value for each column."""


class RowReader:
    """Reads rows one by one.

    `stem` is the tag of all rows of the long layout where neither a column nor a line holds it; `watch`
    collects the texts of columns that are not read; `unit` is "line" or "row".
    """

    def __init__(
        self, names: tuple[str, ...], spec: Spec, stem: str, watch: bool, unit: str = "line"
    ) -> None:
        given, at = spec.input, names.index
        self.names, self.spec, self.unit = names, spec, unit
        self.time_at = [at(name) for name in spec.time]
        self.reader = NumberReader(given.missing, given.decimal, given.thousands)
        self.zone_at = at(given.zone_column) if given.zone_column else -1
        self.tag_at = [at(name) for name in spec.tags]
        self.pattern = re.compile(given.tag_pattern) if given.tag_pattern else None
        self.tag = stem if spec.long and not spec.tags and self.pattern is None else ""
        flags = {source: at(flag) for source, flag in spec.flags.items() if flag in names}
        self.cells = {
            source: (at(given.value if spec.long else source), flags.get(source, flags.get("", -1)))
            for source in spec.sources
            if spec.long or source in names
        }
        """Places of the value and of its flag, -1 where there is none, by column."""
        self.columns = {name: [name] for name in self.cells} if spec.long else {"": [*self.cells]}
        """Columns by tag; all of the wide layout under "". Rows and faults have the same keys."""
        self.rows: dict[str, list[Row]] = {group: [] for group in self.columns}
        self.bad: dict[str, list[Fault]] = {group: [] for group in self.columns}
        self.why: dict[str, dict[int, str]] = {name: {} for name in self.cells}
        self.group = None if spec.long else ""  # of the row that is read, or was read last
        self.unit_at = next((i for i, name in enumerate(names) if is_unit_column(name)), -1)
        self.block_unit = self.first_fault = ""
        self.counts = Table([])
        self.dropped: dict[str, list[int]] = {"repeated headers": [], "empty rows": []}
        self.count = 0  # of usable rows
        # length of the shortest last cell of a row, and whether only that of this row is so short
        self.shortest, self.shorter = _ENDLESS, False
        self.unended = False  # whether the line that is read is the last one and has no line break
        # first line below the last one with a time, and number of these lines with those declared
        self.footer = _ENDLESS, 0
        read = {*spec.time, *self.cells, given.zone_column, given.value, *spec.tags, *spec.flags.values()}
        unread = [i for i, name in enumerate(names) if watch and name and name not in read]
        self.watched: dict[int, set[str] | None] = {i: set() for i in unread}

    def look_for_tag(self, line: str) -> bool:
        """Whether a line holds the tag of the rows below it."""
        match = self.pattern.search(line) if self.pattern else None
        if match is not None:
            self.tag = (match[1] or "").strip()
        return match is not None

    def add(self, number: int, line: str) -> None:
        """Read a line that is not empty."""
        comment = self.spec.input.comment
        if comment and line.startswith(comment):
            self.look_for_tag(line)
            if match := ZRXP_UNIT.search(line):
                self.block_unit = match[1]
            self.counts.comments += 1
            return
        if not comment and self.look_for_tag(line):
            self.counts.comments += 1
            return
        cells = split_cells(line, self.spec.input.separator)
        if cells is None:
            self.counts.rows += 1
            return self.refuse(number, "a quotation mark is not closed")
        if not any(cells):
            return self.dropped["empty rows"].append(self.count)  # spreadsheets leave such rows at the end
        self.shorter = len(cells[-1]) < self.shortest < _ENDLESS
        self.shortest = min(self.shortest, len(cells[-1]))
        if tuple(cells) == self.names:
            if self.spec.input.repeated_header == "drop":
                return self.dropped["repeated headers"].append(self.count)
            advice = 'several exports in one file? If so, set [input] repeated_header = "drop"'
            return self.refuse(number, f"the header again: {advice}")
        if len(cells) != len(self.names):
            self.counts.rows += 1
            return self.refuse(number, self._of_footer(number, cells) or self._ragged(cells))
        self.row(number, cells)

    def row(self, number: int, cells: list[str]) -> None:
        """Read the cells of a row of data; rows of other tags are only counted."""
        self.counts.rows += 1
        if self.spec.long:
            tag = " ".join(cells[i] for i in self.tag_at) if self.tag_at else self.tag
            if tag not in self.rows:
                self.counts.others[tag] += 1
                return
            self.group = tag
        for i, texts in self.watched.items():
            if texts is not None:
                texts.add(cells[i])
                if len(texts) > MANY_TEXTS:
                    self.watched[i] = None
        time = read_text(" ".join(cells[i] for i in self.time_at), self.spec.input.time_format)
        if time is None:
            return self.refuse(number, self._of_footer(number, cells) or self._no_time(cells))
        if self.zone_at >= 0:
            zone = cells[self.zone_at]
            if zone not in self.spec.input.zones:
                given = f"its zone {zone[:20]!r} is unknown"
                return self.refuse(number, f'{given}: add it to [input.zones], like {zone[:20]} = "-07:00"')
            if time[1] is not None:
                return self.refuse(number, "its time has an offset already: leave out [input] zone_column")
            offset = seconds_of(self.spec.input.zones[zone])
            time = time[0] - offset * MICRO, offset
        self._keep(number, cells, time)

    def _keep(self, number: int, cells: list[str], time: tuple[int, int | None]) -> None:
        """Take the values of a row."""
        given = self.spec.input
        assert self.group is not None
        rows, values, why = self.rows[self.group], [], {}
        for column in self.columns[self.group]:
            at, flag_at = self.cells[column]
            value = self.reader.read(cells[at])
            if value is None:
                name = given.value if self.spec.long else column
                return self.refuse(number, self.reader.refusal(name, cells[at]))
            if value != value:
                why[column] = cells[at]
            elif flag_at >= 0 and cells[flag_at] not in given.good:
                value = NAN
                why[column] = FLAG + cells[flag_at]
            values.append(value)
        # the last line may be cut off: one that is as long as another row looks whole
        if self.unended and self.shorter:
            text = given.separator.join(cells)[-40:]
            return self.refuse(number, f"{text!r} is cut off: the log does not end with a line break")
        for column, text in why.items():
            self.why[column][len(rows)] = text
        if self.spec.long and not rows:
            self.counts.units[self.group] = cells[self.unit_at] if self.unit_at >= 0 else self.block_unit
        rows.append((*time, number, values))
        self.count += 1

    def refuse(self, number: int, reason: str) -> None:
        """Record a row that cannot be used; above all tags it may be of any."""
        text = f"{self.unit} {number}: {reason}"
        self.first_fault = self.first_fault or text
        for group in self.bad if self.group is None else (self.group,):
            self.bad[group].append(Fault(len(self.rows[group]), text, self.unended))

    def _of_footer(self, number: int, cells: list[str]) -> str:
        """The message for one of the last lines, below the data, that hold none; else empty."""
        begin, count = self.footer
        if number < begin or not self.count:  # without a row of data, another time_format is needed
            return ""
        lines = "the last line is" if count == 1 else f"the last {count} lines are"
        text = self.spec.input.separator.join(cells).strip()
        return f"{text[:40]!r}: {lines} no data: set [input] footer_rows = {count}"

    def _ragged(self, cells: list[str]) -> str:
        count, mark = len(cells), cells[0][:1]
        reason = f"{count} field{'s' * (count != 1)} where the header has {len(self.names)}"
        if self.spec.input.separator == "," and count > len(self.names):
            reason += ' (decimal commas? The cells must then be quoted, and [input] decimal = ",")'
        if mark in ("#", "!", "%", "*"):
            reason += f': if lines that begin with "{mark}" hold no data, set [input] comment = "{mark}"'
        return reason

    def _no_time(self, cells: list[str]) -> str:
        text = " ".join(cells[i] for i in self.time_at)
        columns = () if self.group is None else self.columns[self.group]
        numbers = [self.reader.read(cells[self.cells[column][0]]) for column in columns]
        if not self.count and not self.first_fault and all(number is None for number in numbers):
            return f"{', '.join(cells)[:80]!r} looks like a row of units: set [input] unit_rows = 1"
        time_format = self.spec.input.time_format
        expected = f"the format {time_format!r}" if time_format else "ISO 8601"
        return f"{text[:40]!r} is no time of {expected}: set [input] time_format"

    def table(self) -> Table:
        """All rows as arrays; DataError for a mix of times with and without offset."""
        table = self.counts
        table.headers, table.empty = map(len, self.dropped.values())
        table.cells = {self.names[i]: texts for i, texts in self.watched.items()}
        table.parts = [self._part(group) for group, rows in self.rows.items() if rows]
        if not table.parts:
            table.lacking = self.first_fault or self._lacking()
        return table

    def _part(self, group: str) -> Columns:
        times, offsets, lines, values = zip(*self.rows[group], strict=True)
        aware = [offset is not None for offset in offsets]
        if any(aware) and not all(aware):
            odd = aware.index(not aware[0])
            kind = "has an offset" if aware[odd] else "has no offset"
            places = [f"{self.unit} {lines[i]}" for i in (odd, 0)]
            raise DataError(f"{places[0]}: its time {kind}, unlike {places[1]}'s: expected one kind")
        names = self.columns[group]
        return Columns(
            np.array(times, np.int64),
            aware[0],
            offsets[0] if len(set(offsets)) == 1 else None,
            dict(zip(names, np.array(values, np.float64).T.copy(), strict=True)),
            lines,
            bad=self.bad[group],
            dropped=self.dropped,
            unit=self.unit,
            why={name: self.why[name] for name in names},
        )

    def _lacking(self) -> str:
        if not self.spec.long:
            return "a header and no rows"
        where = "in column " + " ".join(self.spec.tags) if self.tag_at else "above the rows"
        if not self.tag_at and self.pattern is None:
            where = "from the file's name (no [input] tag or tag_pattern is set)"
        there = ", ".join(repr(tag[:40]) for tag in list(self.counts.others)[:12]) or "none"
        wanted = ", ".join(self.rows)
        return f"no row of {wanted}; tags {where}: {there}: set [input] u_Qi and the like to these"
