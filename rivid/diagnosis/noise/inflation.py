"""By how much blocks of days scatter more than their information says, whatever effect lasts for many."""

import numpy as np
from numpy.typing import NDArray

from rivid.types import Bools, Floats

FEWEST_BLOCKS = 8
"""Blocks below which the inflation is a guess."""

KEPT = 0.75
"""Share of squared differences, the smallest, that the inflation is taken from: the ends of dates are not."""

_KEPT_MEAN = 0.36852
"""Mean of a chi-square variable of one degree below its 75 % quantile."""


def block_inflation(score: Floats, information: Floats, blocks: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """Variance of blocks' scores over the nominal one, and the correlation of days within blocks.

    From differences of means, of neighbouring blocks and of days within a block, without the largest quarter
    of their squares: an effect that lasts for many blocks cancels, and the ends of its dates are left out.

    Parameters
    ----------
    score : ndarray, shape (draws, days)
    information : ndarray, shape (days,)
    blocks : ndarray of int, shape (days,)

    Returns
    -------
    inflation, correlation : ndarray, shape (draws,)
    """
    used = information > 0.0
    g, q = score[:, used], information[used]
    label = np.unique(blocks[used], return_inverse=True)[1]
    first = np.flatnonzero(np.diff(label, prepend=-1))
    inflation = _squares(np.add.reduceat(g, first, axis=1), np.add.reduceat(q, first))
    same = np.diff(label) == 0
    if same.sum() < FEWEST_BLOCKS:
        return inflation, np.zeros(len(g))
    within = _squares(g, q, same)
    days = len(q) / len(first)
    rho = (inflation - within) / np.maximum(inflation + (days - 1.0) * within, 1e-300)
    # Days of a block are not against each other: a smaller factor than that of days alone is chance.
    return np.maximum(inflation, within), np.clip(rho, 0.0, 0.95)


def _squares(g: Floats, q: Floats, kept: Bools | None = None) -> Floats:
    """Variance of neighbours' means over the nominal one, from differences; g is (draws, k)."""
    squares = np.diff(g / q, axis=1) ** 2 / (1.0 / q[1:] + 1.0 / q[:-1])
    if kept is not None:
        squares = squares[:, kept]
    many = max(1, round(KEPT * squares.shape[1]))
    smallest = np.partition(squares, many - 1, axis=1)[:, :many]
    return np.asarray(np.maximum(smallest.mean(1) / _KEPT_MEAN, 1e-300))
