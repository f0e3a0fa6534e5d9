"""Columns beside the values: flags, zones, and what only looks like one."""

import re
from collections import Counter
from dataclasses import dataclass, field

from rivid.logs.ingest.export import looks_like_flags
from rivid.logs.layout import Layout
from rivid.logs.layout_time import TimeLayout
from rivid.logs.longtext import is_unit_column
from rivid.logs.rows import MANY_TEXTS
from rivid.logs.tags import NUMBER, Tagged

GOOD = frozenset(("good", "ok", "valid", "a", "approved", "0", "192", "g", "gut", "bon", "normal"))
"""Flags that mean a good value wherever they are used."""
OFFSETS = {
    "UTC": "+00:00", "GMT": "+00:00", "Z": "+00:00", "WET": "+00:00", "WEST": "+01:00", "BST": "+01:00",
    "CET": "+01:00", "MEZ": "+01:00", "CEST": "+02:00", "MESZ": "+02:00", "EET": "+02:00", "EEST": "+03:00",
    "EST": "-05:00", "EDT": "-04:00", "CST": "-06:00", "CDT": "-05:00", "MST": "-07:00", "MDT": "-06:00",
    "PST": "-08:00", "PDT": "-07:00", "AKST": "-09:00", "AKDT": "-08:00",
}  # fmt: skip
"""What abbreviations of zones usually mean."""


@dataclass(frozen=True)
class Beside:
    """What stands beside the values.

    Attributes
    ----------
    flags : dict of str
        Column of flags by the column it belongs to.
    of_row : str
        The one column of flags for the whole row; may be empty.
    good : list of str
        Flags that are taken as good.
    counted : str
        All flags, with counts.
    zone_column : str
    zones : dict of str
        Offset by zone.
    doubtful : list of str
        Columns that reading asks for, though they are no zone: flags, or to be ignored.
    """

    flags: dict[str, str] = field(default_factory=dict)
    of_row: str = ""
    good: list[str] = field(default_factory=list)
    counted: str = ""
    zone_column: str = ""
    zones: dict[str, str] = field(default_factory=dict)
    doubtful: list[str] = field(default_factory=list)

    @property
    def columns(self) -> set[str]:
        """All columns that hold no values."""
        return {*self.doubtful, self.zone_column}


def look_beside(layout: Layout, time: TimeLayout, tagged: Tagged | None) -> Beside:
    """Find flags and zones.

    Parameters
    ----------
    layout : Layout
    time : TimeLayout
    tagged : Tagged or None
        Of the long layout.
    """
    values = {tagged.tag, tagged.value} if tagged else set()
    names = [n for i, n in enumerate(layout.names) if n and i not in time.columns and n not in values]
    cells = {name: [row[layout.names.index(name)] for row in layout.rows] for name in names}
    texts = {name: set(column) for name, column in cells.items()}
    zone_column, zones = "", {}
    for name in names:
        if texts[name] and texts[name] <= set(OFFSETS):
            zone_column, zones = name, {zone: OFFSETS[zone] for zone in sorted(texts[name])}
            break
    read = {tagged.value} if tagged else {n for n in names if not _is_flag(n) and _numeric(cells[n])}
    doubtful = [
        name
        for name in names
        if name != zone_column
        and not is_unit_column(name)
        and looks_like_flags(name, texts[name] if len(texts[name]) <= MANY_TEXTS else None, read)
    ]
    if doubtful:  # where others are used, an empty one is a column of flags too
        empty = [name for name in names if texts[name] == {""} and _is_flag(name) and _owner(name, read)]
        doubtful = [name for name in names if name in doubtful or name in empty]
    flags = {} if tagged else {o: n for n in doubtful if (o := _owner(n, read))}
    free = [name for name in doubtful if _is_flag(name) and name not in flags.values()]
    of_row = free[0] if len(free) == 1 and not flags else ""
    chosen = [*flags.values()] or ([of_row] if of_row else [])
    counts = Counter(text for name in chosen for text in cells[name])
    common = counts.most_common(1)[0][0] if counts else ""
    good = [flag for flag in counts if flag == common or flag.lower() in GOOD]
    counted = ", ".join(f"{flag!r} {count}" for flag, count in counts.most_common(12))
    return Beside(flags, of_row, good, counted, zone_column, zones, doubtful)


def _numeric(cells: list[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return 2 * sum(NUMBER.fullmatch(cell) is not None for cell in filled) > len(filled)


def _owner(name: str, columns: set[str]) -> str:
    """The column of values that a column of flags is named after."""
    owners = [column for column in columns if name != column and name.startswith(column)]
    return max(owners, key=len, default="")


def _is_flag(name: str) -> bool:
    return re.search(r"qual|flag|status|valid|\bqc\b|state|etat|état|güte|_cd$", name, re.I) is not None
