"""Texts to numbers, exactly as declared: nothing is guessed, and a refusal says what to declare."""

import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rivid.errors import DataError
from rivid.logs.header import (
    LINE,
    BadRow,
    Columns,
    Header,
    Micros,
    Seen,
    UndeclaredError,
    footer_lines,
    not_utf8,
    split_cells,
)
from rivid.logs.spec import MICRO, Spec
from rivid.logs.times import read_text
from rivid.types import Floats

NAN = float("nan")
LARGEST = 1e6
"""No river carries more m3/s, no gauge reads more m: beyond this a number is damage."""


class NumberReader:
    """Reads the cells of one log.

    Parameters
    ----------
    missing : iterable of str
        Markers of values that are not there.
    decimal, thousands : str
        Marks; an empty `thousands` allows none.
    """

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

    def hint(self, text: str) -> str:
        """What to declare so that a refused cell could be read."""
        text = text.strip()
        if text.lower().lstrip("+-") in ("inf", "infinity", "nan"):
            return f'if it means "not measured", add "{text}" to [input] missing'
        if re.fullmatch(r"[+-]?\d+,\d+", text) and self.decimal == ".":
            return 'if the comma is the decimal mark, set [input] decimal = ","'
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


MANY_TEXTS = 20
"""Texts of a column that is not read: with more of them it holds no flags."""
ENDLESS = 10**9


class RowReader(ABC):
    """The rows read so far; what is kept of each is left to :meth:`keep`.

    Parameters
    ----------
    header : Header
    spec : Spec
    used : list of str
        Columns that are read besides the time.
    watch : bool
        Whether to look at the other columns too.
    """

    def __init__(self, header: Header, spec: Spec, used: list[str], watch: bool) -> None:
        self.names, self.spec = header.names, spec
        self.time_at = [self.names.index(n) for n in spec.time]
        self.number_at = {n: self.names.index(n) for n in used}
        self.reader = NumberReader(spec.missing, spec.decimal, spec.thousands)
        dialect = spec.dialect
        self.good = frozenset(dialect.good)
        self.zone_at = self.names.index(dialect.zone_column) if dialect.zone_column else -1
        self.zones = dict(dialect.zones)
        self.seen = Seen()
        self.bad: list[BadRow] = []
        self.repeated: list[int] = []
        self.empty: list[int] = []
        self.shortest = ENDLESS
        self.last: tuple[int, list[str]] = (0, [])
        self.count = 0
        self.footer = ENDLESS, 0
        """The line from which on none holds a time, and how many these are with those declared."""
        self.watched = self._unread() if watch else {}

    def _unread(self) -> dict[int, set[str] | None]:
        dialect = self.spec.dialect
        read = {*self.spec.time, *self.number_at, dialect.zone_column, dialect.value, *dialect.tag}
        read |= {flag for _, flag in dialect.quality}
        return {i: set() for i, name in enumerate(self.names) if name and name not in read}

    def add(self, number: int, line: str) -> None:
        """Read a line."""
        cells = split_cells(line, self.spec.separator)
        if cells is None:
            self.seen.rows += 1
            return self.refuse(number, "a quotation mark is not closed")
        self.shortest = min(self.shortest, len(self.last[1][-1]) if self.last[1] else ENDLESS)
        if not any(cells):
            self.last = (0, [])
            return self.empty.append(self.count)  # spreadsheets leave such rows at the end
        self.last = (number, cells)
        if tuple(cells) == self.names:
            if self.spec.repeated_header == "drop":
                return self.repeated.append(self.count)
            advice = 'several exports in one file? If so, set [input] repeated_header = "drop"'
            return self.refuse(number, f"the header again: {advice}")
        self.seen.rows += 1
        if len(cells) != len(self.names):
            return self.refuse(number, self._of_footer(number, cells) or self._ragged(cells))
        self.row(number, cells)

    def remark(self, line: str) -> None:
        """Pass over a comment."""
        self.seen.comments += 1

    def row(self, number: int, cells: list[str]) -> None:
        """Read the cells of a row of data."""
        for i, texts in self.watched.items():
            if texts is not None and cells[i] not in texts:
                texts.add(cells[i])
                if len(texts) > MANY_TEXTS:
                    self.watched[i] = None
        time = read_text(" ".join(cells[i] for i in self.time_at), self.spec.time_format)
        if time is None:
            return self.refuse(number, self._of_footer(number, cells) or self._no_time(cells))
        if self.zone_at >= 0:
            zone = cells[self.zone_at]
            if zone not in self.zones:
                given = f"its zone {zone[:20]!r} is unknown"
                return self.refuse(number, f'{given}: add it to [input.zones], like {zone[:20]} = "-07:00"')
            if time[1] is not None:
                return self.refuse(number, "its time has an offset already: leave out [input] zone_column")
            time = time[0] - self.zones[zone] * MICRO, self.zones[zone]
        self.keep(number, cells, time)

    @abstractmethod
    def keep(self, number: int, cells: list[str], time: tuple[int, int | None]) -> None:
        """Take the values of a row."""

    @abstractmethod
    def drop_last(self, number: int) -> None:
        """Forget the row of a line, if it was kept: it proves to be cut off."""

    def refuse(self, number: int, reason: str, cut: bool = False) -> None:
        """Note a row that cannot be used."""
        self.bad.append(BadRow(self.count, f"line {number}: {reason}", cut))

    def no_number(self, number: int, column: str, text: str) -> None:
        """Note a row with a cell that is neither a number nor declared missing."""
        where = f"column {column!r} holds {text[:40]!r}, which is no number"
        self.refuse(number, f"{where}: {self.reader.hint(text)}")

    def _of_footer(self, number: int, cells: list[str]) -> str:
        """What to say of one of the last lines, below the data, that hold none; else empty."""
        begin, count = self.footer
        if number < begin or not self.count:  # without a row of data, another time_format is needed
            return ""
        lines = "the last line is" if count == 1 else f"the last {count} lines are"
        text = self.spec.separator.join(cells).strip()
        return f"{text[:40]!r}: {lines} no data: set [input] footer_rows = {count}"

    def _ragged(self, cells: list[str]) -> str:
        count = len(cells)
        reason = f"{count} field{'s' * (count != 1)} where the header has {len(self.names)}"
        if self.spec.separator == "," and count > len(self.names):
            reason += ' (decimal commas? The cells must then be quoted, and [input] decimal = ",")'
        if cells[0][:1] in ("#", "!", "%", "*"):
            mark = cells[0][0]
            reason += f': if lines that begin with "{mark}" hold no data, set [input] comment = "{mark}"'
        return reason

    def _no_time(self, cells: list[str]) -> str:
        text = " ".join(cells[i] for i in self.time_at)
        first = not self.count and not self.bad
        if first and all(self.reader.read(cells[i]) is None for i in self.number_at.values()):
            return f"{', '.join(cells)[:80]!r} looks like a row of units: set [input] unit_rows = 1"
        expected = f"the format {self.spec.time_format!r}" if self.spec.time_format else "ISO 8601"
        return f"{text[:40]!r} is no time of {expected}: set [input] time_format"

    def doubt_last(self, line: str) -> None:
        """The log does not end with a line break: is its last line whole?

        It is taken as cut where fields are missing, or where its last cell is shorter than that of every
        other row. A last cell that lost digits and is still as long as another row's cannot be told from a
        whole one.
        """
        number, cells = self.last
        if not cells:
            return
        too_few, too_short = len(cells) < len(self.names), len(cells[-1]) < self.shortest
        if self.bad and self.bad[-1].text.startswith(f"line {number}:"):
            self.bad[-1] = self.bad[-1]._replace(cut=True)
        elif not (too_few or (too_short and self.shortest < ENDLESS)):
            return
        else:
            self.drop_last(number)
            self.refuse(number, f"{line[-40:]!r} is cut off: the log does not end with a line break", True)

    def account(self) -> Seen:
        """What else the file holds."""
        seen = self.seen
        seen.headers, seen.empty = len(self.repeated), len(self.empty)
        seen.cells = {self.names[i]: texts for i, texts in self.watched.items()}
        return seen


def read_tolerant(content: bytes, header: Header, spec: Spec, name: str, *, watch: bool = False) -> Columns:
    """The columns of a log, and a reason for each row that cannot be used.

    Parameters
    ----------
    content : bytes
        The log in UTF-8.
    header : Header
    spec : Spec
    name : str
        How messages call the log.
    watch : bool
        Whether to look at columns that are not read.

    Returns
    -------
    Columns

    Raises
    ------
    DataError
        For bytes that are not text.
    """
    rows = WideReader(header, spec, watch)
    feed(rows, content, header, spec, name)
    return rows.columns()


def feed(rows: RowReader, content: bytes, header: Header, spec: Spec, name: str) -> None:
    """Give a reader all lines below the header.

    Raises
    ------
    DataError
        For bytes that are not text.
    """
    try:
        text = content[header.body :].decode("utf-8")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, header.body + error.start) + 1
        raise UndeclaredError(not_utf8(name, place)) from None
    lines = LINE.split(text)
    whole = lines[-1] == ""
    comment = spec.dialect.comment
    first = header.line + spec.unit_rows + 1
    footer = footer_lines(lines, rows.time_at, spec.separator, spec.time_format, comment)
    if footer:
        rows.footer = first + footer[0], len(footer) + spec.footer_rows
    for number, row in enumerate(lines, first):
        if not row.strip():
            continue
        if comment and row.startswith(comment):
            rows.remark(row)
        else:
            rows.add(number, row)
    if not whole:
        rows.doubt_last(lines[-1])


class WideReader(RowReader):
    """A row has a value of each column."""

    def __init__(self, header: Header, spec: Spec, watch: bool) -> None:
        used = [source for source in spec.sources if source in header.names]
        super().__init__(header, spec, used, watch)
        flags = dict(spec.dialect.quality)
        self.flag_at = {
            source: self.names.index(flags.get(source, flags.get("", "")))
            for source in used
            if source in flags or "" in flags
        }
        self.times: list[int] = []
        self.offsets: list[int | None] = []
        self.numbers: dict[str, list[float]] = {n: [] for n in used}
        self.lines: list[int] = []
        self.why: dict[str, dict[int, str]] = {n: {} for n in used}
        self.flags: Counter[str] = Counter()
        self.flagged: list[int] = []

    def keep(self, number: int, cells: list[str], time: tuple[int, int | None]) -> None:
        """Take the values of a row."""
        values = {}
        why = []
        for column, i in self.number_at.items():
            value = self.reader.read(cells[i])
            if value is None:
                return self.no_number(number, column, cells[i])
            if value != value:
                why.append((column, cells[i]))
            elif column in self.flag_at and (flag := cells[self.flag_at[column]]) not in self.good:
                value = float("nan")
                why.append((column, FLAG + flag))
            values[column] = value
        for column, text in why:
            self.why[column][self.count] = text
            if text.startswith(FLAG):
                self.flags[text[1:]] += 1
                self.flagged.append(self.count + 1)
        self.times.append(time[0])
        self.offsets.append(time[1])
        self.lines.append(number)
        for column, value in values.items():
            self.numbers[column].append(value)
        self.count += 1

    def drop_last(self, number: int) -> None:
        """Forget the row of a line, if it was kept: it proves to be cut off."""
        if not self.lines or self.lines[-1] != number:
            return
        for column in (self.times, self.offsets, self.lines, *self.numbers.values()):
            column.pop()  # type: ignore[attr-defined]
        self.count -= 1
        for why in self.why.values():
            why.pop(self.count, None)

    def columns(self) -> Columns:
        """All rows as arrays."""
        times: Micros = np.array(self.times, np.int64)
        numbers: dict[str, Floats] = {n: np.array(v, np.float64) for n, v in self.numbers.items()}
        dropped = {
            "repeated headers": self.repeated,
            "empty rows": self.empty,
            "flagged values": self.flagged,
        }
        return Columns(
            times,
            one_kind(self.offsets, self.lines),
            the_offset(self.offsets),
            numbers,
            lines=np.array(self.lines, np.int64),
            bad=self.bad,
            dropped={kind: rows for kind, rows in dropped.items() if rows},
            why=self.why,
            flags=self.flags,
            seen=self.account(),
        )


FLAG = "\0"
"""Stands before the reason where a flag, not the cell's own text, says that there is no value."""


def one_kind(offsets: list[int | None], lines: list[int]) -> bool:
    """Whether the times carry offsets; rows with and without in one log are not comparable.

    Raises
    ------
    DataError
    """
    aware = [o is not None for o in offsets]
    if any(aware) and not all(aware):
        odd = aware.index(not aware[0])
        said = "has an offset" if aware[odd] else "has no offset"
        raise DataError(f"line {lines[odd]}: its time {said}, unlike line {lines[0]}'s: expected one kind")
    return bool(aware) and aware[0]


def the_offset(offsets: list[int | None]) -> int | None:
    """The one offset of all times; None where they are many."""
    return offsets[0] if len(set(offsets)) == 1 else None


_UNIT = re.compile(r"CUNIT([^|*]+)")
"""ZRXP says the unit of a block in a comment."""


def is_unit_column(name: str) -> bool:
    """Whether a column holds the units of the values beside it."""
    return name.lower() in ("unit", "units", "einheit", "unité", "unite", "uom", "unidad", "eu", "eng units")


class Long(NamedTuple):
    """What a file of the long layout holds.

    Attributes
    ----------
    tags : list of Columns
        One per tag that is asked for and occurs, each with one column of numbers.
    seen : Seen
    lacking : str
        What to say where no tag is that is asked for.
    """

    tags: list[Columns]
    seen: Seen
    lacking: str


def read_long(
    content: bytes, header: Header, spec: Spec, name: str, stem: str, *, watch: bool = False
) -> Long:
    """The values of each tag that is asked for.

    Parameters
    ----------
    content : bytes
        The export in UTF-8.
    header : Header
    spec : Spec
    name, stem : str
        How messages call it; the tag of its rows where neither a column nor a line tells one.
    watch : bool
        Whether to look at columns that are not read.

    Returns
    -------
    Long

    Raises
    ------
    DataError
        For bytes that are not text.
    """
    rows = LongReader(header, spec, stem, watch)
    if spec.dialect.tag_pattern:
        for line in LINE.split(content[: header.body].decode("utf-8", "replace")):
            rows.look_for_tag(line)
    feed(rows, content, header, spec, name)
    return rows.told()


class _Tag:
    """The values of one tag so far."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self.offsets: list[int | None] = []
        self.values: list[float] = []
        self.lines: list[int] = []
        self.why: dict[int, str] = {}
        self.flags: Counter[str] = Counter()
        self.flagged: list[int] = []
        self.bad: list[BadRow] = []


class LongReader(RowReader):
    """A row has one value."""

    def __init__(self, header: Header, spec: Spec, stem: str, watch: bool) -> None:
        dialect = spec.dialect
        super().__init__(header, spec, [dialect.value], watch)
        self.tag_at = [self.names.index(n) for n in dialect.tag]
        self.value_at = self.names.index(dialect.value)
        self.flag_at = self.names.index(dialect.quality[0][1]) if dialect.quality else -1
        self.pattern = re.compile(dialect.tag_pattern) if dialect.tag_pattern else None
        self.current = stem if not dialect.tag and self.pattern is None else ""
        self.found: dict[str, _Tag] = {source: _Tag() for source in spec.sources}
        self.latest = ""
        self.unit_at = next((i for i, name in enumerate(self.names) if is_unit_column(name)), -1)
        self.unit = ""

    def look_for_tag(self, line: str) -> bool:
        """Whether a line tells the tag of the rows below it."""
        match = self.pattern.search(line) if self.pattern else None
        if match is None:
            return False
        self.current = (match[1] or "").strip()
        return True

    def remark(self, line: str) -> None:
        """Pass over a comment, unless it tells a tag."""
        self.look_for_tag(line)
        if match := _UNIT.search(line):
            self.unit = match[1]
        super().remark(line)

    def add(self, number: int, line: str) -> None:
        """Read a line."""
        if self.pattern is not None and not self.spec.dialect.comment and self.look_for_tag(line):
            return super().remark(line)
        super().add(number, line)

    def row(self, number: int, cells: list[str]) -> None:
        """Read the cells of a row of data; rows of other tags are only counted."""
        tag = " ".join(cells[i] for i in self.tag_at) if self.tag_at else self.current
        if tag not in self.found:
            self.seen.others[tag] += 1
            return
        self.latest = tag
        super().row(number, cells)

    def keep(self, number: int, cells: list[str], time: tuple[int, int | None]) -> None:
        """Take the value of a row."""
        text = cells[self.value_at]
        value = self.reader.read(text)
        if value is None:
            return self.no_number(number, self.spec.dialect.value, text)
        tag = self.found[self.latest]
        if value != value:
            tag.why[len(tag.times)] = text
        elif self.flag_at >= 0 and (flag := cells[self.flag_at]) not in self.good:
            value = float("nan")
            tag.why[len(tag.times)] = FLAG + flag
            tag.flags[flag] += 1
            tag.flagged.append(len(tag.times) + 1)
        if not tag.times:
            self.seen.units[self.latest] = cells[self.unit_at] if self.unit_at >= 0 else self.unit
        tag.times.append(time[0])
        tag.offsets.append(time[1])
        tag.values.append(value)
        tag.lines.append(number)
        self.count += 1

    def refuse(self, number: int, reason: str, cut: bool = False) -> None:
        """Note a row that cannot be used, with the tag it is of, or was last read."""
        super().refuse(number, reason, cut)
        for name in [self.latest] if self.latest else self.found:  # above all tags it may be of any
            tag = self.found[name]
            tag.bad.append(BadRow(len(tag.times), self.bad[-1].text, cut))

    def drop_last(self, number: int) -> None:
        """Forget the row of a line, if it was kept: it proves to be cut off."""
        for tag in self.found.values():
            if tag.lines and tag.lines[-1] == number:
                for column in (tag.times, tag.offsets, tag.values, tag.lines):
                    column.pop()
                tag.why.pop(len(tag.times), None)
                self.count -= 1

    def told(self) -> Long:
        """The rows of each tag that occurs."""
        seen, tags = self.account(), []
        for name, tag in self.found.items():
            if not tag.times:
                continue
            tags.append(
                Columns(
                    np.array(tag.times, np.int64),
                    one_kind(tag.offsets, tag.lines),
                    the_offset(tag.offsets),
                    {name: np.array(tag.values, np.float64)},
                    lines=np.array(tag.lines, np.int64),
                    bad=tag.bad,
                    why={name: tag.why},
                    flags=tag.flags,
                    seen=seen,
                )
            )
        return Long(tags, seen, "" if tags else self._lacking())

    def _lacking(self) -> str:
        if self.bad:
            return self.bad[0].text
        wanted = ", ".join(self.found)
        there = ", ".join(repr(tag[:40]) for tag in list(self.seen.others)[:12]) or "none"
        where = "in column " + " ".join(self.spec.dialect.tag) if self.tag_at else "above the rows"
        if not self.tag_at and self.pattern is None:
            where = "from the file's name (no [input] tag or tag_pattern is set)"
        return f"no row of {wanted}; tags {where}: {there}: set [input] u_Qi and the like to these"
