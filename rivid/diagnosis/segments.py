"""Dates with and without an effect: exact penalised segmentation of one score per day.

Day d has a score g_d, of variance q_d (its information) if nothing acts; a segment [a, b) in which the effect
has its own size gains

    G(a, b) = (g_a + ... + g_{b-1})^2 / (2 (q_a + ... + q_{b-1}))    [nats],

the Gaussian log-likelihood with known variances. Optimal partitioning (Jackson et al. 2005, IEEE Signal
Processing Letters 12) selects the segments with the largest sum of G minus a penalty for each. Days of a
block are correlated, and the nominal variance of the scores may be wrong: one factor, the inflation, covers
both. It is estimated from differences of neighbouring blocks, in which a lasting effect cancels. The penalty
is that factor times a limit from simulated days. Ends of a window inside the season have an additional price:
otherwise an effect that is always present would lose quiet days at the start of the season.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.noise.model import block_inflation
from rivid.types import Bools, Floats, Ints

Rest = Literal["zero", "free"]
MOST_SEGMENTS = 4  # maximum number of segments in the search for changes on simulated days without one
SHORTEST = 2  # days of the shortest segment with an effect
EDGE = 3.68
"""Price of a window's end inside the season [nats]: the drop of the log-likelihood that contains a change
date with 95 % (Hansen 2000, Econometrica 68)."""


def partition(
    g: Floats, q: Floats, penalty: float, *, rest: Rest, sign: int, shortest: int, edge: float
) -> tuple[Ints, Bools, float]:
    """Find the best segments, by exact dynamic programming over the first day of the last one.

    Returns bounds (k + 1,), on (k,), and the gain over no window or no change [nats]. Scores g and
    informations q (days,) are 0 on a day without data. With `rest` "zero" the effect is absent
    outside windows, and windows have any size; with "free" it is always present, and its size changes. A
    window or a change costs the penalty [nats], an end of a window inside the season `edge` more. Sizes have
    the sign `sign`, any for 0; `shortest` is the number of days of the shortest segment with an effect.
    """
    n = len(g)
    best, begin = np.full(n + 1, -np.inf), np.zeros(n + 1, np.int64)
    best[0] = 0.0
    for t, gain in gains(g[None], q, sign):
        if rest == "zero":
            best[t], begin[t] = best[t - 1], -t  # a day without the effect costs nothing
        if t >= shortest:
            total = best[: t - shortest + 1] + gain[0, : t - shortest + 1] - penalty
            total -= inside(t, n, shortest) * edge
            a = int(np.argmax(total))
            if total[a] > best[t]:
                best[t], begin[t] = total[a], a
    ends, there, t = {0, n}, np.zeros(n, bool), n
    while t > 0:
        a = int(begin[t]) if begin[t] >= 0 else t - 1
        if begin[t] >= 0:
            ends |= {a, t}
            there[a:t] = True
        t = a
    none = 0.0 if rest == "zero" else float(gain[0, 0]) - penalty
    bounds = np.array(sorted(ends), np.int64)
    return bounds, there[bounds[:-1]], float(best[n]) - none


def gains(g: Floats, q: Floats, sign: int) -> Iterator[tuple[int, Floats]]:
    """Yield, for t = 1, ..., n, the gains G(s, t) of all s < t, shape (draws, t)."""
    G = np.concatenate([np.zeros((len(g), 1)), np.cumsum(g, axis=1)], axis=1)
    Q = np.concatenate([[0.0], np.cumsum(q)])
    for t in range(1, len(Q)):
        total, information = G[:, t : t + 1] - G[:, :t], Q[t] - Q[:t]
        if sign:
            total = np.maximum(sign * total, 0.0)
        known = information > 0.0
        yield t, np.where(known, total**2 / np.where(known, 2.0 * information, 1.0), 0.0)


def inside(t: int, n: int, shortest: int) -> Floats:
    """Return the number of ends inside the season of segments [s, t), for all s up to t - shortest."""
    return np.asarray((np.arange(t - shortest + 1) > 0) + float(t < n))


@dataclass(frozen=True, eq=False)
class Segments:
    """Days divided into segments."""

    bounds: Ints  # (k + 1,): first day of each segment, and the number of days
    # (k,): score over information [unit of the effect] and its standard error, inflation included; 0 if off
    size: Floats
    size_se: Floats
    on: Bools  # (k,): whether the effect is present; all True for the rest "free"
    gain: float  # over no window or no change, minus penalties [nats, by nominal variances]

    @property
    def mask(self) -> Bools:
        """Days with the effect, shape (days,)."""
        return np.repeat(self.on, np.diff(self.bounds))

    @property
    def found(self) -> bool:
        """Whether there is a window or a change at all."""
        return len(self.bounds) > 2 or bool(self.on[0] and self.gain > 0.0)


def segment(
    score: ArrayLike,
    information: ArrayLike,
    blocks: ArrayLike,
    *,
    rest: Rest = "zero",
    sign: int = 0,
    level: float = 0.01,
    draws: int = 499,
    seed: int = 0,
) -> Segments:
    """Divide days at dates on which an effect begins, ends or changes; arguments as of :func:`partition`.

    Days of one block are correlated, blocks hardly; :data:`~rivid.diagnosis.noise.model.FEWEST_BLOCKS` with
    data are needed. `level` is the share of seasons without an effect that are divided nevertheless,
    estimated from `draws` simulated ones.
    """
    g, q, block = np.asarray(score, float), np.asarray(information, float), np.asarray(blocks)
    inflation, correlation = block_inflation(g[None], q, block)
    c, rho = float(inflation[0]), float(correlation[0])
    rng = np.random.default_rng(seed)
    shared = rng.standard_normal((draws, int(block.max()) + 1))[:, block]
    quiet = np.sqrt(q) * (np.sqrt(rho) * shared + np.sqrt(1.0 - rho) * rng.standard_normal((draws, len(g))))
    # Each draw has its own inflation, as the data have: the limit includes the error of this estimate.
    edge = EDGE if rest == "zero" else 0.0
    worst = np.sort(_limits(quiet, q, rest, sign, edge, block_inflation(quiet, q, block)[0]))
    rank = max(1, int(level * (draws + 1)))  # the rank-th largest value is exceeded with probability `level`
    penalty = c * float(worst[-rank])
    bounds, on, gain = partition(g, q, penalty, rest=rest, sign=sign, shortest=SHORTEST, edge=edge * c)
    total_g, total_q = np.add.reduceat(g, bounds[:-1]), np.add.reduceat(q, bounds[:-1])
    some, divisor = on & (total_q > 0), np.where(total_q > 0, total_q, 1.0)
    size, se = np.where(some, total_g / divisor, 0.0), np.where(some, np.sqrt(c / divisor), 0.0)
    return Segments(bounds, size, se, on, gain)


def _limits(g: Floats, q: Floats, rest: Rest, sign: int, edge: float, inflation: Floats) -> Floats:
    """Return the lowest penalty at which each draw (draws, days) is not divided [nats over its inflation]."""
    # Several windows gain at most their number times the gain of the best one, which therefore decides. Gains
    # of changes do not add in that way: a temporary shift needs two, and neither may be worth its penalty
    # alone; so the best gain for each number of changes is divided by that number.
    draws, n = g.shape
    scaled = g / np.sqrt(inflation)[:, None]
    if rest == "zero":
        worst = np.zeros(draws)
        for t, gain in gains(scaled, q, sign):
            if t >= SHORTEST:
                paid = gain[:, : t - SHORTEST + 1] - inside(t, n, SHORTEST) * edge
                np.maximum(worst, paid.max(1), out=worst)
        return worst
    best = np.full((MOST_SEGMENTS, draws, n + 1), -np.inf)
    for t, gain in gains(scaled, q, sign):
        if t >= SHORTEST:
            best[0, :, t] = gain[:, 0]
            for k in range(1, MOST_SEGMENTS):
                best[k, :, t] = (best[k - 1, :, : t - SHORTEST + 1] + gain[:, : t - SHORTEST + 1]).max(1)
    changes = np.arange(1, MOST_SEGMENTS)[:, None]
    return np.asarray(np.maximum(((best[1:, :, n] - best[0, :, n]) / changes).max(0), 0.0))
