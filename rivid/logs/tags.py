"""Whether a table is of the long layout, and which tags it holds."""

import re
from dataclasses import dataclass
from itertools import pairwise

from rivid.logs.layout import Layout
from rivid.logs.layout_time import TimeLayout
from rivid.logs.longtext import is_unit_column
from rivid.logs.times import read_text

MOST_TAGS = 200
VALUE = re.compile(r"values?|val|wert|messwert|valeurs?|valor|valore|reading|vtq|magnitude", re.I)
_FLAGS = re.compile(r"qual|flag|status|valid|\bqc\b|state|etat|état|güte|remark|tz|zone", re.I)
NUMBER = re.compile(r"[+-]?[\d.,' \u00a0]*\d[\d.,' \u00a0]*([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Tagged:
    """A table of the long layout.

    Attributes
    ----------
    tag : str
        Column of the tags; empty where lines or the file's name tell them.
    value : str
        Column of the values.
    cells : dict of list of str
        Values by tag.
    units : dict of str
        By tag, where the file tells.
    steps : dict of list of int
        Between the values of each tag [us].
    """

    tag: str
    value: str
    cells: dict[str, list[str]]
    units: dict[str, str]
    steps: dict[str, list[int]]

    def usual(self, tag: str) -> int:
        """The median step of a tag [us]; 0 where there is none."""
        steps = sorted(self.steps.get(tag, ()))
        return steps[len(steps) // 2] if steps else 0

    @property
    def shortest(self) -> list[int]:
        """The steps of the tag that comes most often [us]."""
        tags = [tag for tag in self.steps if self.usual(tag)]
        return self.steps[min(tags, key=self.usual)] if tags else []


def by_tag(layout: Layout, time: TimeLayout, file: str) -> Tagged | None:
    """The tags of a long table; None for a wide one.

    Parameters
    ----------
    layout : Layout
    time : TimeLayout
    file : str
        Its name: the tag of a table with one column that is called like a value.
    """
    value_at = _value_column(layout, time)
    if value_at is None:
        return None
    if layout.zrxp is not None:
        return _tagged("", value_at, layout.blocks, layout, time, layout.zrxp.units)
    tag_at = _tag_column(layout, time, value_at)
    if tag_at is not None:
        tags = [row[tag_at] for row in layout.rows]
        unit_at = next((i for i, name in enumerate(layout.names) if is_unit_column(name)), None)
        units = {} if unit_at is None else {row[tag_at]: row[unit_at] for row in layout.rows[::-1]}
        return _tagged(layout.names[tag_at], value_at, tags, layout, time, units)
    if VALUE.fullmatch(layout.names[value_at]):
        plain = file[:-3] if file.lower().endswith(".gz") else file
        stem = plain.rpartition(".")[0] or plain
        return _tagged("", value_at, [stem] * len(layout.rows), layout, time, {})
    return None


def _value_column(layout: Layout, time: TimeLayout) -> int | None:
    """The one column of numbers that is no flag; None where there are several."""
    rest = [
        i for i, name in enumerate(layout.names)
        if i not in time.columns and not _FLAGS.search(name) and _numeric(layout, i)
    ]  # fmt: skip
    named = [i for i in rest if VALUE.fullmatch(layout.names[i])]
    return named[0] if len(named) == 1 else rest[0] if len(rest) == 1 else None


def _tag_column(layout: Layout, time: TimeLayout, value_at: int) -> int | None:
    for i, name in enumerate(layout.names):
        if i == value_at or i in time.columns or _FLAGS.search(name) or is_unit_column(name):
            continue
        texts = {row[i] for row in layout.rows}
        if 2 <= len(texts) <= MOST_TAGS and "" not in texts and not _numeric(layout, i):
            return i
    return None


def _numeric(layout: Layout, at: int) -> bool:
    filled = [row[at] for row in layout.rows if row[at]]
    return 2 * sum(NUMBER.fullmatch(cell) is not None for cell in filled) > len(filled)


def _tagged(
    tag: str, value_at: int, tags: list[str], layout: Layout, time: TimeLayout, units: dict[str, str]
) -> Tagged:
    cells: dict[str, list[str]] = {}
    times: dict[str, list[int]] = {}
    for name, row in zip(tags, layout.rows, strict=True):
        moment = read_text(" ".join(row[i] for i in time.columns), time.time_format)
        cells.setdefault(name, []).append(row[value_at])
        if moment is not None:
            times.setdefault(name, []).append(moment[0])
    steps = {name: [b - a for a, b in pairwise(sorted(set(moments)))] for name, moments in times.items()}
    return Tagged(tag, layout.names[value_at], cells, units, steps)
