"""What the score test is asked, and what it says."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Dates = Literal["all", "from", "until", "between"]


@dataclass(frozen=True)
class Candidate:
    """An effect to test.

    Attributes
    ----------
    name : str
    columns : ndarray, shape (k, days, n)
        Whitened columns: the residual's change for one unit of each parameter.
    dates : {"all", "from", "until", "between"}
        Windows of days to scan; whole days always are.
    hours : bool
        Whether the k columns are the same thing in k parts of the day, of which a contiguous run acts with
        one size: k (k + 1) / 2 windows a day.
    sign : {-1, 0, 1}
        The only sign its one parameter can have; 0: any.
    """

    name: str
    columns: ArrayLike
    dates: Dates = "all"
    hours: bool = False
    sign: int = 0


@dataclass(frozen=True)
class Found:
    """What the score test says of one candidate at its best window.

    Attributes
    ----------
    name : str
    statistic : float
        s' V^-1 s; 0 where no window can be told from the nuisance columns.
    p_alone : float
        Chance of as much without any effect, its own windows searched.
    p_family : float
        The same, all candidates and all windows searched.
    days : (int, int)
        First and last day of the best window.
    hours : (int, int) or None
        First part of the day of the best window, and the one after its last.
    estimate, standard_error : ndarray, shape (k,)
        Of the parameters at the best window, in their units; (1,) for a run of hours. Right for a window
        fixed beforehand; the best of many windows exaggerates. The error is from the blocks' scatter.
    left : float
        Share of the column's information that the nuisance columns leave.
    """

    name: str
    statistic: float
    p_alone: float
    p_family: float
    days: tuple[int, int]
    hours: tuple[int, int] | None
    estimate: Floats
    standard_error: Floats
    left: float


@dataclass(frozen=True)
class Scan:
    """A whole library tested at once.

    Attributes
    ----------
    found : tuple of Found
        In the order of the candidates.
    p_value : float
        Of the whole library: the smallest p_family.
    n_blocks, n_flips, n_windows : int
        Blocks flipped, flips, and windows searched.
    """

    found: tuple[Found, ...]
    p_value: float
    n_blocks: int
    n_flips: int
    n_windows: int

    @property
    def ranked(self) -> tuple[Found, ...]:
        """The candidates, the least likely to be chance first."""
        return tuple(sorted(self.found, key=lambda f: (f.p_family, f.p_alone, -f.statistic)))
