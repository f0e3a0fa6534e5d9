"""Blocks of days, and the choice of open and sealed days.

Blocks of whole days get roles in the cycle fit, fit, select, fit, sealed, over the whole season. Fit and
select days are open: the diagnosis fits and scores on them, one block left out at a time. The law of the
operators is fitted to the first and validated on the second. Sealed days are used once, at the end.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from rivid.errors import RividError
from rivid.types import Bools, Ints

SHORT, LONG, SEASON = 3, 7, 90
"""Days in a block: 3 for up to 90 days of data, else 7."""


class Role(IntEnum):
    """Role of a day."""

    FIT = 0
    SELECT = 1
    SEALED = 2


CYCLE = (Role.FIT, Role.FIT, Role.SELECT, Role.FIT, Role.SEALED)


@dataclass(frozen=True)
class Split:
    """Roles and blocks of days."""

    day: Ints  # (days,): calendar days since the first one
    role: Ints  # (days,): a :class:`Role` each
    block: Ints  # (days,): number of the day's block: 0, 1, ... without gaps

    @property
    def fit(self) -> Bools:
        """Days to fit, shape (days,)."""
        return np.asarray(self.role == Role.FIT)

    @property
    def select(self) -> Bools:
        """Days to select, shape (days,)."""
        return np.asarray(self.role == Role.SELECT)

    @property
    def sealed(self) -> Bools:
        """Days to confirm, used once; shape (days,)."""
        return np.asarray(self.role == Role.SEALED)

    @property
    def complete(self) -> bool:
        """Whether there are days of every role."""
        return set(self.role.tolist()) == {int(role) for role in Role}


def split(days: int | Sequence[object] | NDArray[np.datetime64], block_days: int | None = None) -> Split:
    """Divide whole days (a number of consecutive ones, or dates) into blocks of `block_days` and roles.

    A block never spans a gap in the calendar that is longer than itself.

    Examples
    --------
    >>> split(15).role.tolist()
    [0, 0, 0, 0, 0, 0, 1, 1, 1, 0, 0, 0, 2, 2, 2]
    """
    if isinstance(days, int):
        day = np.arange(days, dtype=np.int64)
    else:
        dates = np.asarray(days, "datetime64[D]")
        day = (dates - dates[:1]).astype(np.int64)
        if (np.diff(day) < 1).any():
            where = int(np.argmax(np.diff(day) < 1)) + 1
            raise RividError(
                f"day {dates[where]} stands after {dates[where - 1]}: expected dates in order, each once"
            )
    if len(day) == 0:
        raise RividError("no days to split: expected at least one")
    length = block_days or (SHORT if len(day) <= SEASON else LONG)
    block = np.unique(day // length, return_inverse=True)[1].astype(np.int64)
    return Split(day, np.array(CYCLE, np.int64)[block % len(CYCLE)], block)
