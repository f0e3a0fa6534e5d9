"""The best cut of days into segments with and without an effect, by exact dynamic programming.

Optimal partitioning (Jackson et al. 2005, IEEE Signal Processing Letters 12): the best segments of the first
t days are the best of the first s, and [s, t), for some s.
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rivid.types import Bools, Floats, Ints

Rest = Literal["zero", "free"]


def partition(
    score: ArrayLike,
    information: ArrayLike,
    penalty: float,
    *,
    rest: Rest,
    sign: int = 0,
    shortest: int = 1,
    edge: float = 0.0,
) -> tuple[Ints, Bools, float]:
    """The best segments, by exact dynamic programming over the day on which the last one begins.

    Parameters
    ----------
    score, information : array_like, shape (days,)
        g and q; a day without data has 0 and 0.
    penalty : float
        Price of a window (`rest` "zero") or of a change (`rest` "free") [nats].
    rest : {"zero", "free"}
        "zero": days outside windows have no effect, and windows have any size. "free": all days have one, and
        it changes.
    sign : {-1, 0, 1}
        Sign that sizes must have; 0 for any.
    shortest : int
        Days of the shortest segment with an effect.
    edge : float
        Price of each end of a window inside the season, beside the window's own [nats].

    Returns
    -------
    bounds : ndarray of int, shape (k + 1,)
    on : ndarray of bool, shape (k,)
    gain : float
        Over no window or no change [nats].
    """
    g, q = np.asarray(score, float), np.asarray(information, float)
    n = len(g)
    best, begin = np.full(n + 1, -np.inf), np.zeros(n + 1, np.int64)
    best[0] = 0.0
    for t, gain in gains(g[None], q, sign):
        if rest == "zero":
            best[t], begin[t] = best[t - 1], -t  # a day without the effect, which costs nothing
        if t >= shortest:
            total = best[: t - shortest + 1] + gain[0, : t - shortest + 1] - penalty
            total -= inside(t, n, shortest) * edge
            a = int(np.argmax(total))
            if total[a] > best[t]:
                best[t], begin[t] = total[a], a
    pieces: list[tuple[int, bool]] = []
    t = n
    while t > 0:
        on = begin[t] >= 0
        a = int(begin[t]) if on else t - 1
        if on or not pieces or pieces[-1][1]:
            pieces.append((a, bool(on)))
        else:
            pieces[-1] = (a, False)
        t = a
    pieces.reverse()
    none = 0.0 if rest == "zero" else float(gain[0, 0]) - penalty
    bounds = np.array([a for a, _ in pieces] + [n], np.int64)
    return bounds, np.array([on for _, on in pieces]), float(best[n]) - none


def gains(g: Floats, q: Floats, sign: int) -> Iterator[tuple[int, Floats]]:
    """For t = 1, ..., n the gains G(s, t) of all s < t, shape (draws, t)."""
    G = np.concatenate([np.zeros((len(g), 1)), np.cumsum(g, axis=1)], axis=1)
    Q = np.concatenate([[0.0], np.cumsum(q)])
    for t in range(1, len(Q)):
        total, information = G[:, t : t + 1] - G[:, :t], Q[t] - Q[:t]
        if sign:
            total = np.maximum(sign * total, 0.0)
        yield (
            t,
            np.where(information > 0.0, total**2 / np.where(information > 0.0, 2.0 * information, 1.0), 0.0),
        )


def inside(t: int, n: int, shortest: int) -> Floats:
    """Ends inside the season of the segments [s, t), for all s up to t - shortest."""
    return np.asarray((np.arange(t - shortest + 1) > 0) + float(t < n))
