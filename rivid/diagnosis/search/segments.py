"""Dates with and without an effect: exact penalised segmentation of one score a day.

Day d has a score g_d, of variance q_d (its information) where nothing is there; a segment [a, b) in which the
effect has a size of its own is worth

    G(a, b) = (g_a + ... + g_{b-1})^2 / (2 (q_a + ... + q_{b-1}))    [nats],

the Gaussian log-likelihood it gains with known variances. Optimal partitioning (Jackson et al. 2005) takes
the segments with the largest sum of G less a penalty each. The days of a block are correlated, and the
scores' own variance may be off: both are one factor, the inflation, taken from differences of neighbouring
blocks, in which an effect that lasts cancels. The penalty is that factor times a limit from simulated days.
A window's ends inside the season have a price of their own: what is always there is not to lose its first
days because they were quiet.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.noise.inflation import FEWEST_BLOCKS, block_inflation
from rivid.diagnosis.search.partition import Rest, gains, inside, partition
from rivid.errors import RividError
from rivid.types import Bools, Floats, Ints

__all__ = ["FEWEST_BLOCKS", "Rest", "Segments", "block_inflation", "partition", "segment"]


MOST_SEGMENTS = 4
"""Segments up to which simulated days without a change are searched for one, where the rest is free."""

EDGE = 3.68
"""Drop of the log-likelihood that holds a change date with 95 % [nats] (Hansen 2000, Econometrica 68); also
the price of a window's end."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Days cut into segments.

    Attributes
    ----------
    bounds : ndarray of int, shape (k + 1,)
        First day of each segment, and the number of days.
    earliest, latest : ndarray of int, shape (k - 1,)
        Where the first day of each segment but the first may lie, each with about 95 %.
    size, size_se : ndarray, shape (k,)
        Score by information [unit of the effect] and its standard error, inflation included; 0 and 0 where
        the effect is off.
    on : ndarray of bool, shape (k,)
        Whether the effect is there; where the rest is free, all are.
    gain : float
        Over no window or no change, penalties paid [nats, by nominal variances].
    penalty : float
        Price of a window without its ends, or of a change [nats].
    inflation : float
        Variance of a block's score over its nominal one.
    """

    bounds: Ints
    earliest: Ints
    latest: Ints
    size: Floats
    size_se: Floats
    on: Bools
    gain: float
    penalty: float
    inflation: float

    @property
    def mask(self) -> Bools:
        """Days with the effect, shape (days,)."""
        return np.repeat(self.on, np.diff(self.bounds))

    @property
    def found(self) -> bool:
        """Whether there is a window or a change at all."""
        return len(self.bounds) > 2 or bool(self.on[0] and self.gain > 0.0)

    @property
    def windows(self) -> tuple[tuple[int, int], ...]:
        """First and last day of each segment with the effect."""
        ends = zip(self.bounds[:-1], self.bounds[1:], self.on, strict=True)
        return tuple((int(a), int(b) - 1) for a, b, on in ends if on)


def segment(
    score: ArrayLike,
    information: ArrayLike,
    blocks: ArrayLike,
    *,
    rest: Rest = "zero",
    sign: int = 0,
    shortest: int = 2,
    level: float = 0.01,
    draws: int = 499,
    seed: int = 0,
) -> Segments:
    """Cut days where an effect begins, ends or changes; seasons without one are left whole but for `level`.

    Parameters
    ----------
    score, information : array_like, shape (days,)
        g and q, as above: of a candidate's whitened column x and residual r, x'r and x'x of each day.
    blocks : array_like of int, shape (days,)
        Block of each day; the days of one are correlated, blocks hardly.
    rest, sign, shortest
        As for :func:`partition`.
    level : float
        Share of seasons with nothing in them that are cut all the same.
    draws, seed : int
        Simulated seasons without an effect, and their seed.

    Raises
    ------
    RividError
        Where there are too few blocks, or arrays do not fit.
    """
    g, q, block = np.asarray(score, float), np.asarray(information, float), np.asarray(blocks)
    if not (g.shape == q.shape == block.shape and g.ndim == 1):
        raise RividError(f"score, information and blocks have shapes {g.shape}, {q.shape}, {block.shape}: "
                         "expected one number a day in each")  # fmt: skip
    if not (np.isfinite(g).all() and np.isfinite(q).all() and (q >= 0.0).all()):
        raise RividError("scores are not finite or information is negative: give days without data 0 and 0")
    there = np.unique(block[q > 0.0])
    if len(there) < FEWEST_BLOCKS:
        raise RividError(f"{len(there)} blocks have data: expected {FEWEST_BLOCKS} or more; "
                         "give more days or shorter blocks")  # fmt: skip
    inflation, correlation = block_inflation(g[None], q, block)
    c, rho = float(inflation[0]), float(correlation[0])
    rng = np.random.default_rng(seed)
    shared = rng.standard_normal((draws, int(block.max()) + 1))[:, block]
    quiet = np.sqrt(q) * (np.sqrt(rho) * shared + np.sqrt(1.0 - rho) * rng.standard_normal((draws, len(g))))
    # By its own inflation, as the data are: what the estimate of the factor adds is in the limit.
    edge = EDGE if rest == "zero" else 0.0
    worst = np.sort(_dearest(quiet, q, rest, sign, shortest, edge, block_inflation(quiet, q, block)[0]))
    rank = max(1, int(level * (draws + 1)))  # this one from the top is exceeded at `level`, exactly
    penalty = c * float(worst[-rank])
    bounds, on, gain = partition(g, q, penalty, rest=rest, sign=sign, shortest=shortest, edge=edge * c)
    total_g, total_q = np.add.reduceat(g, bounds[:-1]), np.add.reduceat(q, bounds[:-1])
    size = np.where(on & (total_q > 0), total_g / np.where(total_q > 0, total_q, 1.0), 0.0)
    se = np.where(on & (total_q > 0), np.sqrt(c / np.where(total_q > 0, total_q, 1.0)), 0.0)
    edges = [_edge(g, q, bounds, on, i, sign, EDGE * c) for i in range(1, len(bounds) - 1)]
    earliest, latest = np.array(edges, np.int64).reshape(-1, 2).T
    return Segments(bounds, earliest, latest, size, se, on, gain, penalty, c)


def _dearest(
    g: Floats, q: Floats, rest: Rest, sign: int, shortest: int, edge: float, inflation: Floats
) -> Floats:
    """The lowest penalty at which each draw (draws, days) is left whole [nats over its inflation].

    Several windows gain at most their number times the best one's, so that one decides. Changes do not
    add up that way: a bump takes two, and neither may pay alone; so the best gain for each number of changes
    is divided by it.
    """
    draws, n = g.shape
    scaled = g / np.sqrt(inflation)[:, None]
    if rest == "zero":
        worst = np.zeros(draws)
        for t, gain in gains(scaled, q, sign):
            if t >= shortest:
                paid = gain[:, : t - shortest + 1] - inside(t, n, shortest) * edge
                np.maximum(worst, paid.max(1), out=worst)
        return worst
    best = np.full((MOST_SEGMENTS, draws, n + 1), -np.inf)
    for t, gain in gains(scaled, q, sign):
        if t >= shortest:
            best[0, :, t] = gain[:, 0]
            for k in range(1, MOST_SEGMENTS):
                best[k, :, t] = (best[k - 1, :, : t - shortest + 1] + gain[:, : t - shortest + 1]).max(1)
    changes = np.arange(1, MOST_SEGMENTS)[:, None]
    return np.asarray(np.maximum(((best[1:, :, n] - best[0, :, n]) / changes).max(0), 0.0))


def _edge(g: Floats, q: Floats, bounds: Ints, on: Bools, i: int, sign: int, drop: float) -> tuple[int, int]:
    """First and last position of one bound that costs less than `drop`, its neighbours where they are."""
    a, b = int(bounds[i - 1]), int(bounds[i + 1])

    def worth(score: Floats, information: Floats) -> Floats:
        total = np.maximum(sign * np.cumsum(score), 0.0) if sign else np.cumsum(score)
        known = np.cumsum(information)
        return np.where(known > 0.0, total**2 / np.where(known > 0.0, 2.0 * known, 1.0), 0.0)

    left = worth(g[a:b], q[a:b])[:-1] * on[i - 1]
    right = worth(g[a:b][::-1], q[a:b][::-1])[::-1][1:] * on[i]
    near = np.flatnonzero(left + right >= (left + right)[bounds[i] - a - 1] - drop)
    return a + 1 + int(near[0]), a + 1 + int(near[-1])
