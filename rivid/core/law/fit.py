"""A robust line through points that err in both variables, and how sure it is: neighbours are related."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROUNDS = 200
"""Most rounds; a dozen are usual."""

CONVERGED = 1e-8
"""Change of the slope and of the scatter that ends them."""

LEAST_FIRMNESS = 0.2
"""Where most points lie far off it means nothing; it is 0.71 under Student's t of 4, 1 without tails."""

STEPS = 38
"""Of the search for the scatter, golden section: to 1e-8 of its range."""


class Fit(NamedTuple):
    """``y = offset + slope x``.

    Attributes
    ----------
    offset, slope : float
    scatter : float
        Standard deviation of the bulk's scatter about the line, beyond each point's own uncertainty.
    weight : ndarray, shape (n,)
        1 / variance of each point's distance, times its weight by Student's t.
    firmness : float
        Mean slope of Student's pull over mean weight, below 1: the line is held less firmly than the weights
        say, for they follow it.
    instrument : ndarray, shape (n,)
        x as far as it may be believed; with it the line solves ``sum weight (1, instrument) residual = 0``.
    """

    offset: float
    slope: float
    scatter: float
    weight: Floats
    firmness: float
    instrument: Floats


def fit_line(x: Floats, y: Floats, own: Floats, x_error: float, tails: float) -> Fit:
    """Robust line.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
    own : ndarray, shape (n,)
        Standard deviation of each y's own error.
    x_error : float
        Standard deviation of the error of every x.
    tails : float
        Degrees of freedom of Student's t.

    Returns
    -------
    Fit
    """
    width = bulk(tails)
    own, x_error = width * own, width * x_error
    slope, offset = 0.0, float(np.median(y))
    scatter = float(1.4826 * np.median(np.abs(y - offset)))
    weight, variance, believed = np.ones(len(x)), own**2, x
    for _ in range(ROUNDS):
        before = slope, scatter
        residual = y - offset - slope * x
        variance = own**2 + scatter**2 + (slope * x_error) ** 2
        weight = (tails + 1.0) / (tails + residual**2 / variance) / variance
        believed = _believed(x, y, weight, own**2 + scatter**2, x_error, slope)
        offset, slope = _solved(x, y, weight, believed)
        scatter = _scatter(y - offset - slope * x, np.hypot(own, slope * x_error), tails)
        if abs(slope - before[0]) + abs(scatter - before[1]) < CONVERGED:
            break
    square = (y - offset - slope * x) ** 2 / variance
    pull = (tails + 1.0) * (tails - square) / (tails + square) ** 2 / variance
    firmness = max(float(pull.sum() / weight.sum()), LEAST_FIRMNESS)
    return Fit(offset, slope, scatter / width, weight, firmness, believed)


@lru_cache(maxsize=8)
def bulk(tails: float) -> float:
    """Scale of Student's t that fits a normal variable of unit variance best.

    What is known of errors are standard deviations of a normal bulk; the tails are for days that are wrong.

    Examples
    --------
    >>> round(bulk(4.0), 3), round(bulk(1e6), 3)
    (0.831, 1.0)
    """
    z, p = np.polynomial.hermite_e.hermegauss(80)
    p = p / p.sum()
    low, high = 0.0, 1.0
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        pull = float(p @ ((tails + 1.0) * z**2 / (tails * middle**2 + z**2)))
        low, high = (middle, high) if pull > 1.0 else (low, middle)
    return 0.5 * (low + high)


def _believed(x: Floats, y: Floats, w: Floats, y_variance: Floats, x_error: float, slope: float) -> Floats:
    """Where the true x lies, given the line: between what is read and what y says (York, 13b)."""
    middle, height = np.average(x, weights=w), np.average(y, weights=w)
    variance = y_variance + (slope * x_error) ** 2
    moved = (y_variance * (x - middle) + slope * x_error**2 * (y - height)) / variance
    return np.asarray(middle + moved)


def _solved(x: Floats, y: Floats, w: Floats, z: Floats) -> tuple[float, float]:
    """Offset and slope with ``sum w (1, z) (y - offset - slope x) = 0``."""
    middle, height = np.average(x, weights=w), np.average(y, weights=w)
    centred = w * (z - np.average(z, weights=w))
    slope = float(centred @ (y - height) / (centred @ (x - middle)))
    return float(height - slope * middle), slope


def _scatter(residual: Floats, known: Floats, tails: float) -> float:
    """Most likely scatter beside known scales, under Student's t."""

    def log_likelihood(scatter: Floats) -> Floats:
        variance = known**2 + scatter[:, None] ** 2
        far = np.log1p(residual**2 / (tails * variance))
        return np.asarray(-0.5 * (np.log(variance) + (tails + 1.0) * far).sum(axis=1))

    top = 2.0 * float(np.sqrt(np.mean(residual**2))) + 1e-12
    grid = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 12) * top])
    best = int(np.argmax(log_likelihood(grid)))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    for _ in range(STEPS):
        inner = np.array([high - golden * (high - low), low + golden * (high - low)])
        left, right = log_likelihood(inner)
        low, high = (low, inner[1]) if left >= right else (inner[0], high)
    return float(0.5 * (low + high))


def alike(days: NDArray[np.intp], x: Floats, y: Floats, fit: Fit) -> float:
    """For how many days their pulls on the line stay alike: 1 for unrelated days.

    One and twice the sum of the correlations between days so far apart, up to the first that is not positive.
    """
    pull = np.full(int(days[-1] - days[0]) + 1, np.nan)
    pull[days - days[0]] = np.sqrt(fit.weight) * (y - fit.offset - fit.slope * x)
    known = np.isfinite(pull)
    pull = np.where(known, pull, 0.0)
    size, total = float((pull**2).sum() / known.sum()), 1.0
    for lag in range(1, len(pull) // 4):
        pairs = int((known[lag:] & known[:-lag]).sum())
        related = float(pull[lag:] @ pull[:-lag]) / (size * pairs) if pairs and size > 0.0 else 0.0
        if related <= 0.0:
            break
        total += 2.0 * related
    return total


def block_covariance(x: Floats, y: Floats, fit: Fit, block: NDArray[np.intp]) -> Floats:
    """Covariance of offset and slope by leaving out one block of neighbours at a time, shape (2, 2).

    The weights stay, so that each line without a block is one small solve; that they would have changed
    makes the line move further, by 1 / `firmness`.
    """
    Z = np.stack([np.ones_like(x), fit.instrument])
    X = np.stack([np.ones_like(x), x])
    blocks = int(block.max()) + 1
    A, c = np.zeros((blocks, 2, 2)), np.zeros((blocks, 2))
    np.add.at(A, block, np.einsum("in,jn,n->nij", Z, X, fit.weight))
    np.add.at(c, block, (Z * fit.weight * y).T)
    without = np.linalg.solve(A.sum(axis=0) - A, (c.sum(axis=0) - c)[..., None])[..., 0]
    away = (without - np.array([fit.offset, fit.slope])) / fit.firmness
    return np.asarray((blocks - 1) / blocks * away.T @ away)
