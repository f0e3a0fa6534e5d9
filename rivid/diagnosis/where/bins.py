"""Where the gap is: a score by hour, weekday, date, flows, level, their rates, shift, and time since a step.

A sample has a score s and an information q, so that the sum of s over the sum of q is a size: with x the
whitened column of a unit inflow and r the whitened residual, s = x r and q = x^2 give it in m3/s; a
reconstructed inflow or an innovation has q = 1. A bin's departure is its size less that of all samples,

    D_b = S_b / Q_b - S / Q = sum over blocks j of psi_jb,
    psi_jb = (s_jb - (S/Q) q_jb) / Q_b - (s_j - (S/Q) q_j) / Q,

and flipping the signs of whole blocks of psi says how large the largest one gets by chance. A bin seen in
one block only cannot be judged that way, so dates come in long parts; their ends are found by segmentation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.diagnosis.search.segments import FEWEST_BLOCKS
from rivid.diagnosis.where.drivers import Driver
from rivid.errors import RividError
from rivid.types import Bools, Floats, Ints

FEWEST = 5
"""Blocks that a bin must be seen in: flips of fewer give no small p."""

KEPT = 0.6
"""Share of blocks, those that say least, that set the scale of a bin."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores ready to be binned; made by :func:`as_scores`.

    Attributes
    ----------
    score, information : ndarray, shape (days, n)
        s and q; 0 where a sample does not count.
    used : ndarray of bool, shape (days, n)
    block : ndarray of int, shape (days,)
        0, 1, ... without holes.
    """

    score: Floats
    information: Floats
    used: Bools
    block: Ints


@dataclass(frozen=True, eq=False)
class Bins:
    """A size in each bin of one driver; arrays of shape (k,) but for the edges.

    Attributes
    ----------
    driver, unit : str
    edges : ndarray, shape (k + 1,)
    labels : tuple of str, length k
    mean, departure : ndarray
        Size, and its difference from that of all samples; NaN where a bin is empty.
    se : ndarray
        Standard error of the departure, from blocks drawn again; NaN where fewer than :data:`FEWEST` have it.
    z : ndarray
        Departure over its standard error.
    samples, blocks : ndarray of int
        How many the bin has.
    p_value : float
        Of the largest bin of this driver, by block sign flips.
    """

    driver: str
    unit: str
    edges: Floats
    labels: tuple[str, ...]
    mean: Floats
    departure: Floats
    se: Floats
    z: Floats
    samples: Ints
    blocks: Ints
    p_value: float


@dataclass(frozen=True, eq=False)
class Tables:
    """Tables of all drivers.

    Attributes
    ----------
    bins : tuple of Bins
    p_value : float
        Of the smallest p of them all, by the same flips.
    """

    bins: tuple[Bins, ...]
    p_value: float


@dataclass(frozen=True, eq=False)
class Map:
    """Sizes over hour and date, for the picture.

    Attributes
    ----------
    hours : ndarray, shape (h + 1,)
        Edges [h].
    days : ndarray of int, shape (c + 1,)
        First row of each column of days, and the number of rows.
    mean : ndarray, shape (h, c)
        Size; NaN where nothing is seen.
    information : ndarray, shape (h, c)
    """

    hours: Floats
    days: Ints
    mean: Floats
    information: Floats


def as_scores(
    score: ArrayLike, used: ArrayLike, blocks: ArrayLike, information: ArrayLike | None = None
) -> Scores:
    """Scores, their samples and their blocks, checked.

    Parameters
    ----------
    score : array_like, shape (days, n)
        s, as above.
    used : array_like of bool, shape (days, n)
        Samples that count.
    blocks : array_like of int, shape (days,)
        Block of each day.
    information : array_like, shape (days, n), optional
        q; 1 by default.

    Raises
    ------
    RividError
        Where arrays do not fit, or there are too few blocks.
    """
    there, s = np.asarray(used, bool), np.asarray(score, float)
    q = np.ones_like(s) if information is None else np.asarray(information, float)
    block = np.asarray(blocks)
    if s.ndim != 2 or not (s.shape == there.shape == q.shape) or block.shape != s.shape[:1]:
        raise RividError(f"score, used, information, blocks have shapes {s.shape}, {there.shape}, "
                         f"{q.shape}, {block.shape}: expected (days, n) and (days,)")  # fmt: skip
    if not (np.isfinite(s[there]).all() and np.isfinite(q[there]).all()):
        raise RividError("a used sample has no score: mark it as not used")
    seen = len(np.unique(block[there.any(1)]))
    if seen < FEWEST_BLOCKS:
        raise RividError(f"{seen} blocks have samples that count: expected {FEWEST_BLOCKS} or more; "
                         "give more days or shorter blocks")  # fmt: skip
    number = np.unique(block, return_inverse=True)[1].astype(np.int64)
    return Scores(np.where(there, s, 0.0), np.where(there, q, 0.0), there, number)


def tables(
    scores: Scores, by: Sequence[Driver], *, draws: int = 1999, resamples: int = 400, seed: int = 0
) -> Tables:
    """A table for each driver, and the p of the most telling one of them all.

    Parameters
    ----------
    scores : Scores
    by : sequence of Driver
    draws, resamples, seed : int
        Sign flips, the same for all drivers; times that blocks are drawn again; their seed.
    """
    rng = np.random.default_rng(seed)
    J = int(scores.block.max()) + 1
    signs = rng.choice(np.array([-1.0, 1.0]), (draws, J))
    weights = rng.multinomial(J, np.full(J, 1.0 / J), resamples).astype(float)
    found, ranks = [], []
    for driver in by:
        S, Q, count = (sums(driver, a, scores.block) for a in (scores.score, scores.information, scores.used))
        psi = influence(S, Q)
        root = _spread(psi)
        seen = (count > 0.0).sum(0)
        tested = (seen >= FEWEST) & (root > 1e-12 * np.abs(S).sum() / max(Q.sum(), 1e-300))
        flipped = np.abs(signs @ (psi[:, tested] / root[tested])).max(1, initial=0.0)
        top = float((np.abs(psi[:, tested].sum(0)) / root[tested]).max(initial=0.0))
        share = _shares(np.append(flipped, top))
        ranks.append(share)
        with np.errstate(invalid="ignore", divide="ignore"):
            again = (weights @ S) / (weights @ Q) - (weights @ S.sum(1) / (weights @ Q.sum(1)))[:, None]
            mean = S.sum(0) / Q.sum(0)
        se = np.full(len(seen), np.nan)
        se[tested] = np.nanstd(again[:, tested], axis=0)
        se[se == 0.0] = np.nan
        departure = np.where(seen > 0, psi.sum(0), np.nan)
        found.append(Bins(
            driver.name, driver.unit, driver.edges, driver.labels, mean=mean, departure=departure, se=se,
            z=departure / se, samples=count.sum(0).astype(np.int64), blocks=seen.astype(np.int64),
            p_value=float(share[-1]),
        ))  # fmt: skip
    # Bins of one driver compare, drivers do not: the smallest p of each flip does (Westfall and Young 1993).
    smallest = np.min(ranks, axis=0)
    return Tables(tuple(found), float(np.mean(smallest <= smallest[-1])))


def hour_map(scores: Scores, hour: ArrayLike, *, days: int = 1, hours: float = 1.0) -> Map:
    """Sizes over the hour of the day, `hour` (days, n) of each sample, and the date, by columns of days."""
    edges = np.arange(0.0, 24.0 + hours / 2.0, hours)
    h = np.clip(np.digitize(np.asarray(hour, float) + 1e-9, edges) - 1, 0, len(edges) - 2)
    columns = np.append(np.arange(0, len(scores.block), days), len(scores.block))
    column = np.repeat(np.arange(len(columns) - 1), np.diff(columns))[:, None]
    c = len(columns) - 1
    cell = np.asarray(h * c + column).ravel()
    S, Q = (np.bincount(cell, a.ravel(), (len(edges) - 1) * c).reshape(-1, c)
            for a in (scores.score, scores.information))  # fmt: skip
    mean = np.where(Q > 0.0, S / np.where(Q > 0.0, Q, 1.0), np.nan)
    return Map(edges, columns.astype(np.int64), mean, np.asarray(Q, float))


def sums(driver: Driver, values: NDArray[np.generic], block: Ints) -> Floats:
    """Sums by block and bin, shape (blocks, k)."""
    k, J = len(driver.labels), int(block.max()) + 1
    inside = driver.bin >= 0
    cell = (block[:, None] * k + driver.bin)[inside]
    return np.asarray(np.bincount(cell, np.asarray(values, float)[inside], J * k).reshape(J, k), float)


def influence(S: Floats, Q: Floats) -> Floats:
    """psi, shape (blocks, k), of sums by block and bin; 0 in bins with nothing."""
    u = S - S.sum() / max(Q.sum(), 1e-300) * Q
    known = Q.sum(0)
    return np.where(known > 0.0, u / np.where(known > 0.0, known, 1.0) - u.sum(1)[:, None] / known.sum(), 0.0)


def _spread(psi: Floats) -> Floats:
    """Scale of each bin's departure, shape (k,), from the smaller contributions of blocks (blocks, k).

    Flips leave it alone, so it cannot spoil the test; and what is there in some weeks only does not hide
    itself by swelling its own scale.
    """
    squares = np.sort(psi**2, axis=0)
    many = (squares > 0.0).sum(0)
    rank = np.arange(len(psi))[:, None] - (len(psi) - many)
    kept = (rank >= 0) & (rank < np.ceil(KEPT * many))
    mean = (squares * kept).sum(0) / np.maximum(kept.sum(0), 1)
    return np.asarray(np.sqrt(mean * many))


def _shares(values: Floats) -> Floats:
    """Share of all values that are as large as each one, itself included, to rounding."""
    rounded = np.round(values, 9)
    return np.asarray(1.0 - np.searchsorted(np.sort(rounded), rounded, side="left") / len(values), float)
