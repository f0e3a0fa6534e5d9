"""The score test: does a candidate's column explain what the fitted model leaves, and since when?

All arrays are whitened. With nuisance columns X projected out of residual r and column z,

    r~ = r - X b,   z~ = z - X G^-1 X'z,   G = X'X,   b = G^-1 X'r,

block b of days has the score s_b = z~_b' r~_b, and the statistic is s' V^-1 s with s = sum s_b. V is one part
sum s_b s_b', what the blocks show, and four parts what white noise would make of it. p-values come from
flipping the blocks' signs, the same flips for every candidate and window, maximum over all of them: V does
not change with the flips, so p is right whatever V is, and dependence between candidates costs nothing
(sign-flipping of effective scores: Hemerik, Goeman and Finos, JRSS B 82, 2020). V only decides how
candidates compare: the blocks alone are few, and among thousands of windows some V is small by chance
(a column found at 1 % in 84 of 100 sets was found in none), white noise alone lets one misfit drown the rest.

Projecting has taken a share M_b = z~_b' H_bb z~_b of the variance of s_b, H the projection on X, and none of
the variance of s: the data's s is brought to the flips' size by it (De Santis and others, 2022).

A window is part of the candidate: z from a date on, up to a date, between two, or in some hours of the day.
Scores, G and z'z are sums over days, so that cumulative sums give every window at once.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.diagnosis.score.base import FEWEST_BLOCKS, base_of
from rivid.diagnosis.score.estimate import found_at
from rivid.diagnosis.score.flips import flipped, p_of, statistic_of, surprise
from rivid.diagnosis.score.types import Candidate, Dates, Found, Scan
from rivid.diagnosis.score.windows import LEAST_LEFT, MODEL_SHARE, Windows, windows_of

__all__ = [
    "FEWEST_BLOCKS", "LEAST_LEFT", "MODEL_SHARE", "Candidate", "Dates", "Found", "Scan", "scan",
]  # fmt: skip

Floats = NDArray[np.float64]

FLIPS = 4_999
"""Sign flips: the smallest p is 1 / 5,000."""


def scan(
    residual: ArrayLike,
    nuisance: ArrayLike,
    candidates: Sequence[Candidate],
    *,
    blocks: ArrayLike,
    weights: ArrayLike | None = None,
    flips: int = FLIPS,
    seed: int = 0,
) -> Scan:
    """Test a library of candidates, windows included, with one family-wise p for all.

    Parameters
    ----------
    residual : array_like, shape (days, n)
        Whitened residual.
    nuisance : array_like, shape (p, days, n)
        Whitened columns of what is fitted anyway; p may be 0.
    candidates : sequence of Candidate
    blocks : array_like of int, shape (days,)
        Which days flip together: see :func:`rivid.diagnosis.blocks.flip_blocks`.
    weights : array_like, shape (days,), optional
        Weights of days; 0 leaves a day out. Default: 1.
    flips, seed : int
        How many sign flips, and the seed of their generator.

    Raises
    ------
    RividError
        Where shapes do not fit, numbers are missing, or fewer than four blocks are used.
    """
    base = base_of(residual, nuisance, blocks, weights)
    n_blocks = len(base.e)
    signs = np.random.default_rng(seed).choice(np.array([-1.0, 1.0]), (flips, n_blocks))
    best: list[tuple[float, Windows, int]] = []
    chance = np.empty((len(candidates), flips))
    for i, candidate in enumerate(candidates):
        w = windows_of(base, candidate)
        k = w.scores.shape[2]
        observed = statistic_of(np.einsum("wij,wj->wi", w.shrink, w.scores.sum(1)), w.sign)
        top = int(np.argmax(observed)) if len(observed) else -1
        best.append((float(observed[top]) if top >= 0 else 0.0, w, top))
        chance[i] = surprise(flipped(w, signs), k)
    seen = np.array([surprise(np.array([t]), w.scores.shape[2])[0] for t, w, _ in best])
    family = chance.max(0, initial=0.0)
    found = []
    for i, candidate in enumerate(candidates):
        statistic, w, top = best[i]
        p_alone = p_of(chance[i], seen[i])
        p_family = p_of(family, seen[i])
        found.append(found_at(base, candidate, statistic, w, top, p_alone, p_family))
    p_value = min((f.p_family for f in found), default=1.0)
    return Scan(tuple(found), p_value, n_blocks, flips, sum(len(w.place) for _, w, _ in best))
