"""What every reader hands on: the columns of one log as arrays, and the rows that could not be read."""

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
