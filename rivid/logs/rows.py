"""Rows of an export, line by line: what is a row of data, what its time is, and what is wrong with it."""

from abc import ABC, abstractmethod

from rivid.logs.columns import BadRow, Seen
from rivid.logs.header import Header, split_cells
from rivid.logs.numbers import NumberReader
from rivid.logs.spec import MICRO, Spec
from rivid.logs.times import read_text

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
