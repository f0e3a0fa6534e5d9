"""Days that fit, select and confirm, and blocks of days that flip their signs together.

Whole days go in blocks, and blocks are dealt in the cycle fit, fit, select, fit, sealed: the three roles are
separate days, spread over the same season. Days of one block are flipped together in the score test, so a
block must be longer than the correlation of the residual.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.errors import RividError
from rivid.types import Bools, Floats, Ints

SHORT, LONG, SEASON = 3, 7, 90
"""Days in a block: 3 up to 90 days of data, else 7."""

MOST_ACROSS = 0.1
"""Share of a score's variance that may come from pairs of days in different blocks: flips do not see it, and
at a tenth a test at 5 % has a true size of 6.3 %."""

FEWEST_BLOCKS = 8
"""Blocks are not merged below this many: their flips give no p under 1/128, and fewer blocks less still."""


class Role(IntEnum):
    """Role of a day."""

    FIT = 0
    SELECT = 1
    SEALED = 2


CYCLE = (Role.FIT, Role.FIT, Role.SELECT, Role.FIT, Role.SEALED)


@dataclass(frozen=True)
class Split:
    """Days dealt into roles."""

    day: Ints  # (days,): days since the first one; gaps of the calendar included
    role: Ints  # (days,): a :class:`Role` each
    block: Ints  # (days,): number of the day's block, 0, 1, ... without holes

    @property
    def fit(self) -> Bools:
        """Days that fit, shape (days,)."""
        return np.asarray(self.role == Role.FIT)

    @property
    def select(self) -> Bools:
        """Days that select, shape (days,)."""
        return np.asarray(self.role == Role.SELECT)

    @property
    def sealed(self) -> Bools:
        """Days that confirm and are used once, shape (days,)."""
        return np.asarray(self.role == Role.SEALED)

    @property
    def complete(self) -> bool:
        """Whether there are days of every role."""
        return set(self.role.tolist()) == {int(role) for role in Role}


def split(days: int | Sequence[object] | NDArray[np.datetime64], block_days: int | None = None) -> Split:
    """Deal whole days into blocks and roles.

    Parameters
    ----------
    days : int or sequence of dates, shape (days,)
        How many consecutive days, or their dates in order; a block never reaches across a gap in the
        calendar that is longer than itself.
    block_days : int, optional
        Length of a block. Default: 3 for up to 90 days, else 7.

    Raises
    ------
    RividError
        Where there are no days, or dates are not in order.

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
    length = block_days if block_days is not None else SHORT if len(day) <= SEASON else LONG
    if length < 1:
        raise RividError(f"block_days is {length}: expected 1 or more")
    block = np.unique(day // length, return_inverse=True)[1].astype(np.int64)
    return Split(day, np.array(CYCLE, np.int64)[block % len(CYCLE)], block)


def memory(scores: ArrayLike, day: ArrayLike) -> Floats:
    """Autocorrelation of day scores at lags of 1, 2, ... days, shape (lags,), as far as it is significant.

    `scores` (days,) or (scores, days) have mean 0 if nothing is missing; several are averaged, each with its
    own variance. Cut before the first lag with a correlation below its standard error, 1 / sqrt(pairs).
    """
    s = np.atleast_2d(np.asarray(scores, float))
    days = np.asarray(day, np.int64)
    if s.shape[1] != len(days):
        raise RividError(f"scores have shape {s.shape} for {len(days)} days: expected one a day")
    dense = np.full((len(s), days[-1] - days[0] + 1), np.nan)
    dense[:, days - days[0]] = s / np.maximum(np.sqrt((s * s).mean(1, keepdims=True)), 1e-300)
    found: list[float] = []
    for lag in range(1, dense.shape[1] // 2):
        product = dense[:, lag:] * dense[:, :-lag]
        pairs = int(np.isfinite(product[0]).sum())
        if pairs < 3 or np.nanmean(product) < 1.0 / np.sqrt(pairs):
            break
        found.append(float(np.nanmean(product)))
    return np.array(found)


def across(correlation: ArrayLike, length: float) -> float:
    """Share of the variance of a long sum of days that lies between blocks of a length, not within them."""
    rho = np.asarray(correlation, float)
    lag = np.arange(1, len(rho) + 1)
    total = length * (1.0 + 2.0 * rho.sum())
    return float(2.0 * (np.minimum(lag, length) * rho).sum() / total)


def flip_blocks(scores: ArrayLike, split: Split, used: ArrayLike | None = None) -> Ints:
    """Blocks for sign flips, shape (days,): those of the split, merged until longer than the correlation.

    `scores` (days,) or (scores, days) have mean 0 if nothing is missing; `used` are the days to count, by
    default those not sealed. The shortest merged blocks that leave at most :data:`MOST_ACROSS` of the
    variance to pairs of days in different blocks, as long as :data:`FEWEST_BLOCKS` remain among the used
    days.
    """
    use = ~split.sealed if used is None else np.asarray(used, bool)
    s = np.atleast_2d(np.asarray(scores, float))
    if s.shape[1] != len(use):
        raise RividError(f"scores have shape {s.shape} for {len(use)} days: expected one a day")
    if not use.any():
        raise RividError("no day is used: nothing to flip")
    rho = memory(s[:, use], split.day[use])
    length = float(np.median(np.bincount(split.block)))
    merged, label = 1, split.block
    while across(rho, merged * length) > MOST_ACROSS:
        merged += 1
        wider = split.block // merged
        if len(np.unique(wider[use])) < FEWEST_BLOCKS:
            break
        label = wider
    return label
