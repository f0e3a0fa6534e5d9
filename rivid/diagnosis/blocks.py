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

from rivid.types import Bools, Ints

SHORT, LONG, SEASON = 3, 7, 90  # days in a block: 3 for up to 90 days of data, else 7


class Role(IntEnum):
    """Role of a day."""

    FIT = 0
    SELECT = 1
    SEALED = 2


CYCLE = (Role.FIT, Role.FIT, Role.SELECT, Role.FIT, Role.SEALED)


@dataclass(frozen=True)
class Split:
    """Roles and blocks of days."""

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


def split(dates: Sequence[object] | NDArray[np.datetime64], block_days: int | None = None) -> Split:
    """Divide dates, in order and each once, into blocks of `block_days` and roles.

    A block never spans a gap in the calendar that is longer than itself.

    Examples
    --------
    >>> split(np.datetime64("2024-05-01") + np.arange(15)).role.tolist()
    [0, 0, 0, 0, 0, 0, 1, 1, 1, 0, 0, 0, 2, 2, 2]
    """
    days = np.asarray(dates, "datetime64[D]")
    length = block_days or (SHORT if len(days) <= SEASON else LONG)
    block = np.unique((days - days[0]).astype(np.int64) // length, return_inverse=True)[1].astype(np.int64)
    return Split(np.array(CYCLE, np.int64)[block % len(CYCLE)], block)
