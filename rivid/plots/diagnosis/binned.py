"""Means of a series by what it may go with, each with an interval that knows that days are alike."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import t as student

from rivid.types import Bools, Floats

BINS = 8
FEWEST = 4
"""Blocks of days that a bin needs for an interval."""


@dataclass(frozen=True, eq=False)
class Means:
    """Means by bin; arrays of shape (k,), NaN where a bin has too few blocks.

    Attributes
    ----------
    centre : ndarray
        Mean of the driver in the bin.
    mean, low, high : ndarray
        Mean of the series and its 95 % interval.
    """

    centre: Floats
    mean: Floats
    low: Floats
    high: Floats


def edges_of(driver: Floats, used: Bools) -> Floats:
    """Edges of :data:`BINS` bins with as many samples each; fewer where values repeat."""
    there = used & np.isfinite(driver)
    if not there.any():
        return np.empty(0)
    return np.unique(np.quantile(driver[there], np.linspace(0.0, 1.0, BINS + 1)))


def means(series: Floats, driver: Floats, used: Bools, block: ArrayLike, edges: Floats) -> Means:
    """Mean of a series in each bin of a driver.

    Parameters
    ----------
    series, driver : ndarray, shape (days, n)
    used : ndarray of bool, shape (days, n)
    block : array_like of int, shape (days,)
        Days of one block may be alike; blocks are taken as independent.
    edges : ndarray, shape (k + 1,)
        The last bin holds its upper edge.

    Returns
    -------
    Means

    Notes
    -----
    The variance of a ratio of sums over blocks, by linearisation, with Student's t on blocks less one.
    """
    k = max(len(edges) - 1, 0)
    there = used & np.isfinite(series) & np.isfinite(driver)
    if k:
        there &= (driver >= edges[0]) & (driver <= edges[-1])
    number = np.unique(np.asarray(block), return_inverse=True)[1]
    J = int(number.max()) + 1 if number.size else 0
    if not k or not there.any():
        return Means(*(np.full(k, np.nan) for _ in range(4)))
    into = np.digitize(driver[there], edges[1:-1])
    cell = (number[:, None] * k + np.zeros(series.shape, np.int64))[there] + into
    S, N, D = (
        np.bincount(cell, weights, J * k).reshape(J, k)
        for weights in (series[there], np.ones(int(there.sum())), driver[there])
    )
    total = N.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean, centre = S.sum(axis=0) / total, D.sum(axis=0) / total
        seen = (N > 0).sum(axis=0)
        enough = seen >= FEWEST
        rest = S - mean * N
        variance = (rest**2).sum(axis=0) / total**2 * seen / (seen - 1)
        half = np.where(enough, student.ppf(0.975, np.maximum(seen - 1, 1)) * np.sqrt(variance), np.nan)
    return Means(centre, mean, mean - half, mean + half)
