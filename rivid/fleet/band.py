"""Has the delay of a reach left its band in the last week? A count against chance."""

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from rivid.types import Floats

WEEK = 7
"""Days at the end of the record that are compared with those before."""

YEAR = 365
"""Days before the week that make the band."""

FEWEST = 30
"""Answered days that a band takes."""

TAILS = 0.05
"""Part of the year's days that may lie beyond each end of the band."""

RARE = 1e-3
"""The week is told where chance alone would do it in fewer reaches than this."""


@dataclass(frozen=True)
class Band:
    """The band of a reach, and where the last week lies.

    Attributes
    ----------
    low, high : float
        Ends of the band [samples].
    median : float
        Of the year before [samples].
    week_median : float
        Of the last week [samples]; NaN without an answered day.
    days : int
        Answered days of the last week.
    above, below : int
        Those of them above and below the band.
    left : bool
        Whether so many are beyond chance.
    """

    low: float
    high: float
    median: float
    week_median: float
    days: int
    above: int
    below: int
    left: bool


def band(days: NDArray[np.int64], values: Floats) -> Band | None:
    """Compare the last week with the year before it.

    The band holds all but a twentieth at each end of the year's answered days. Of the week's answered days as
    many would lie beyond it as of the year's; the week is told where the binomial probability of so many, or
    more, is below :data:`RARE`.

    Parameters
    ----------
    days : ndarray of int, shape (n,)
        Day numbers, ascending, of all days with a row.
    values : ndarray, shape (n,)
        Delay or t50 [samples]; NaN where the data give none.

    Returns
    -------
    Band or None
        None where the year before has fewer than :data:`FEWEST` answered days.
    """
    if not len(days):
        return None
    ago = days[-1] - days
    given = np.isfinite(values)
    year = values[given & (ago >= WEEK) & (ago < WEEK + YEAR)]
    week = values[given & (ago < WEEK)]
    if len(year) < FEWEST:
        return None
    low = float(np.quantile(year, TAILS, method="lower"))
    high = float(np.quantile(year, 1 - TAILS, method="higher"))
    beyond = (np.count_nonzero((year < low) | (year > high)) + 1) / (len(year) + 2)
    above, below = int(np.count_nonzero(week > high)), int(np.count_nonzero(week < low))
    return Band(
        low=low,
        high=high,
        median=float(np.median(year)),
        week_median=float(np.median(week)) if len(week) else float("nan"),
        days=len(week),
        above=above,
        below=below,
        left=above + below > 0 and at_least(above + below, len(week), float(beyond)) < RARE,
    )


def at_least(k: int, n: int, p: float) -> float:
    """Probability of k or more of n, each with probability p.

    Examples
    --------
    >>> round(at_least(4, 7, 0.05), 6)
    0.000194
    """
    return sum(comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(k, n + 1))
