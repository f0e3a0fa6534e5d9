"""The long layout: a row per value, its tag in a column, in a line above its rows, or in the file's name."""

import re
from collections import Counter
from typing import NamedTuple

import numpy as np

from rivid.logs.columns import BadRow, Columns, Seen
from rivid.logs.csvtext import FLAG, feed, one_kind, the_offset
from rivid.logs.footer import LINE
from rivid.logs.header import Header
from rivid.logs.rows import RowReader
from rivid.logs.spec import Spec

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
