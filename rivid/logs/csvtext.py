"""CSV of any kind that `[input]` can declare, cell by cell; each fault with its line and what to do."""

import csv
import re

import numpy as np

from rivid.errors import DataError
from rivid.logs.columns import BadRow, Columns, Floats, Micros
from rivid.logs.header import Header, not_utf8
from rivid.logs.numbers import NumberReader
from rivid.logs.spec import Spec
from rivid.logs.times import read_text

_LINE = re.compile(r"\r\n|\n|\r")


def read_tolerant(content: bytes, header: Header, spec: Spec, name: str) -> Columns:
    """The columns of a log, and a reason for each row that cannot be used.

    Parameters
    ----------
    content : bytes
        The log in UTF-8.
    header : Header
    spec : Spec
    name : str
        How messages call the log.

    Returns
    -------
    Columns

    Raises
    ------
    DataError
        For bytes that are not text.
    """
    try:
        text = content[header.body :].decode("utf-8")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, header.body + error.start) + 1
        raise DataError(not_utf8(name, place)) from None
    rows = _Rows(header, spec)
    lines = _LINE.split(text)
    whole = lines[-1] == ""
    for number, row in enumerate(lines, header.line + spec.unit_rows + 1):
        if row.strip():
            rows.add(number, row)
    if not whole:
        rows.doubt_last(lines[-1])
    return rows.columns()


class _Rows:
    """The rows read so far."""

    def __init__(self, header: Header, spec: Spec) -> None:
        self.names, self.spec = header.names, spec
        self.time_at = [self.names.index(n) for n in spec.time]
        self.number_at = {n: self.names.index(n) for n in spec.sources}
        self.reader = NumberReader(spec.missing, spec.decimal, spec.thousands)
        self.times: list[int] = []
        self.offsets: list[int | None] = []
        self.numbers: dict[str, list[float]] = {n: [] for n in spec.sources}
        self.lines: list[int] = []
        self.bad: list[BadRow] = []
        self.repeated: list[int] = []
        self.empty: list[int] = []
        self.shortest = 10**9
        self.last: tuple[int, list[str]] = (0, [])

    def add(self, number: int, line: str) -> None:
        """Read a line."""
        cells = self._split(line)
        if cells is None:
            return self._refuse(number, "a quotation mark is not closed")
        self.shortest = min(self.shortest, len(self.last[1][-1]) if self.last[1] else 10**9)
        if not any(cells):
            self.last = (0, [])
            return self.empty.append(len(self.times))  # spreadsheets leave such rows at the end
        self.last = (number, cells)
        if tuple(cells) == self.names:
            if self.spec.repeated_header == "drop":
                return self.repeated.append(len(self.times))
            advice = 'several exports in one file? If so, set [input] repeated_header = "drop"'
            return self._refuse(number, f"the header again: {advice}")
        if len(cells) != len(self.names):
            return self._refuse(number, self._ragged(cells))
        time = read_text(" ".join(cells[i] for i in self.time_at), self.spec.time_format)
        if time is None:
            return self._refuse(number, self._no_time(cells))
        values = {}
        for column, i in self.number_at.items():
            value = self.reader.read(cells[i])
            if value is None:
                where = f"column {column!r} holds {cells[i][:40]!r}, which is no number"
                return self._refuse(number, f"{where}: {self.reader.hint(cells[i])}")
            values[column] = value
        self.times.append(time[0])
        self.offsets.append(time[1])
        self.lines.append(number)
        for column, value in values.items():
            self.numbers[column].append(value)

    def _split(self, line: str) -> list[str] | None:
        if '"' not in line:
            return [cell.strip() for cell in line.split(self.spec.separator)]
        try:
            cells = next(csv.reader([line], delimiter=self.spec.separator, strict=True))
        except csv.Error:
            return None
        return [cell.strip() for cell in cells]

    def _refuse(self, number: int, reason: str, cut: bool = False) -> None:
        self.bad.append(BadRow(len(self.times), f"line {number}: {reason}", cut))

    def _ragged(self, cells: list[str]) -> str:
        count = len(cells)
        reason = f"{count} field{'s' * (count != 1)} where the header has {len(self.names)}"
        if self.spec.separator == "," and count > len(self.names):
            reason += ' (decimal commas? The cells must then be quoted, and [input] decimal = ",")'
        return reason

    def _no_time(self, cells: list[str]) -> str:
        text = " ".join(cells[i] for i in self.time_at)
        first = not self.times and not self.bad
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
        elif not (too_few or (too_short and self.shortest < 10**9)):
            return
        else:
            if self.lines and self.lines[-1] == number:
                for column in (self.times, self.offsets, self.lines, *self.numbers.values()):
                    column.pop()  # type: ignore[attr-defined]
            self._refuse(number, f"{line[-40:]!r} is cut off: the log does not end with a line break", True)

    def columns(self) -> Columns:
        """All rows as arrays; rows with and without offset in one log are not comparable."""
        aware = [o is not None for o in self.offsets]
        if any(aware) and not all(aware):
            odd = aware.index(not aware[0])
            said = "has an offset" if aware[odd] else "has no offset"
            raise DataError(
                f"line {self.lines[odd]}: its time {said}, unlike line {self.lines[0]}'s: expected one kind"
            )
        offsets = set(self.offsets)
        times: Micros = np.array(self.times, np.int64)
        numbers: dict[str, Floats] = {n: np.array(v, np.float64) for n, v in self.numbers.items()}
        return Columns(
            times,
            bool(aware) and aware[0],
            self.offsets[0] if len(offsets) == 1 else None,
            numbers,
            lines=np.array(self.lines, np.int64),
            bad=self.bad,
            dropped={k: v for k, v in (("repeated headers", self.repeated), ("empty rows", self.empty)) if v},
        )
