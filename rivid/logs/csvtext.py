"""CSV of any kind that `[input]` can declare, cell by cell; each fault with its line and what to do."""

from collections import Counter

import numpy as np

from rivid.errors import DataError
from rivid.logs.columns import Columns, Micros
from rivid.logs.footer import LINE, footer_lines
from rivid.logs.header import Header, UndeclaredError, not_utf8
from rivid.logs.rows import RowReader
from rivid.logs.spec import Spec
from rivid.types import Floats


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
