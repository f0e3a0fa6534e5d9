"""Dates and hours of an effect, to the day and the hour: ascent on the likelihood gain.

With the whitened column of each hour, score and information of a window are sums over its days and hours:

    gain = (sum of scores)^2 / (2 sum of information).

For some dates the best run of hours is looked up, for some hours the best run of days, in turn.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rivid.types import Floats

TURNS = 12
"""Turns before an ascent is stopped; three are usual."""


@dataclass(frozen=True)
class Span:
    """A window.

    Attributes
    ----------
    first, last : int
        Days, both included.
    hours : (int, int) or None
        From and to; (22, 6) passes midnight. None is all day.
    gain : float
        Likelihood gain [nats].
    """

    first: int
    last: int
    hours: tuple[int, int] | None
    gain: float


def chance_of(
    score: Floats, information: Floats, span: Span, blocks: NDArray[np.int64], library: int, gain: float
) -> float:
    """A bound of the chance of a window with as much gain without any effect.

    Sign flips cannot make a small p for a window of few blocks, however large its gain. Here the gain is
    taken as the noise model's, divided by what the blocks scatter more than it says once the effect is taken
    out, and by two for the windows' own choice; all windows of the library count, for the whole season its
    candidates only.

    Parameters
    ----------
    score, information
        As for :func:`best_span`.
    span : Span
    blocks : ndarray of int, shape (days,)
        Blocks of days.
    library : int
        How many candidates are searched like this.
    gain : float
        Likelihood gained with noise and response refitted [nats].

    Returns
    -------
    float
        ``min(1, windows exp(-gain / (2 inflation)))``.
    """
    n, days = score.shape
    hours = (
        np.ones(n, bool)
        if span.hours is None
        else _run(n, span.hours[0], (span.hours[1] - span.hours[0]) % n)
    )
    s, q = score[hours].sum(axis=0), information[np.ix_(hours, hours)].sum(axis=(0, 1))
    inside = np.zeros(days, bool)
    inside[span.first : span.last + 1] = True
    left = s - np.where(inside, s[inside].sum() / q[inside].sum(), 0.0) * q
    labels, block = np.unique(blocks, return_inverse=True)
    sums = np.bincount(block, left, len(labels))
    longest = float(np.bincount(block).max())  # no more than if the days of a block were one
    inflation = float(np.clip((sums**2).sum() / q.sum(), 1.0, 2.0 * longest))
    windows = library * days * (days + 1) / 2 * max(n * (n - 1), 1)
    if span.first == 0 and span.last == days - 1 and span.hours is None:
        windows = library  # the whole season is looked at whatever the search finds
    return float(min(1.0, windows * np.exp(-gain / (2.0 * inflation))))


def best_dates(score: Floats, information: Floats) -> Span:
    """The dates of largest gain for an effect of several columns, all of them in one window.

    Parameters
    ----------
    score : ndarray, shape (k, days)
    information : ndarray, shape (k, k, days)
    """
    s = np.concatenate([np.zeros((len(score), 1)), np.cumsum(score, axis=1)], axis=1)
    q = np.concatenate([np.zeros((*information.shape[:2], 1)), np.cumsum(information, axis=2)], axis=2)
    first, end = np.triu_indices(s.shape[1], 1)
    sums, Q = (s[:, end] - s[:, first]).T, np.moveaxis(q[..., end] - q[..., first], -1, 0)
    Q = (
        Q
        + 1e-9 * np.trace(Q, axis1=1, axis2=2)[:, None, None] * np.eye(len(score))
        + 1e-300 * np.eye(len(score))
    )
    gains = 0.5 * np.einsum("wk,wk->w", sums, np.linalg.solve(Q, sums[..., None])[..., 0])
    best = int(np.argmax(gains))
    return Span(int(first[best]), int(end[best]) - 1, None, float(gains[best]))


def combined(score: Floats, information: Floats, span: Span) -> tuple[Floats, Floats]:
    """Several columns as the one that they are at their estimates in a window; (1, days), (1, 1, days)."""
    inside = slice(span.first, span.last + 1)
    c = np.linalg.lstsq(information[..., inside].sum(axis=2), score[:, inside].sum(axis=1), rcond=None)[0]
    return (c @ score)[None], np.einsum("k,l,kld->d", c, c, information)[None, None]


def best_span(score: Floats, information: Floats, sign: int = 0) -> Span:
    """The window of largest gain.

    Parameters
    ----------
    score : ndarray, shape (hours, days)
        Whitened column of each hour times the residual, summed over each day.
    information : ndarray, shape (hours, hours, days)
        Products of the whitened columns, summed over each day.
    sign : {-1, 0, 1}
        The only sign that counts; 0: any.

    Returns
    -------
    Span
    """
    n = len(score)
    starts = [np.ones(n, bool), *(_run(n, h, 8) for h in range(0, n if n > 1 else 0, 4))]
    found = [_ascend(score, information, hours, sign) for hours in starts]
    return max(found, key=lambda span: span.gain)


def _ascend(score: Floats, information: Floats, hours: np.ndarray, sign: int) -> Span:
    best = Span(0, score.shape[1] - 1, None, -np.inf)
    for _ in range(TURNS):
        s = score[hours].sum(axis=0)
        q = information[np.ix_(hours, hours)].sum(axis=(0, 1))
        first, last, gain = _best_days(s, q, sign)
        days = slice(first, last + 1)
        inside = score[:, days].sum(axis=1), information[:, :, days].sum(axis=2)
        start, length, gain = _best_hours(*inside, sign)
        whole = length == len(score)
        span = Span(first, last, None if whole else (start, (start + length) % len(score)), gain)
        if span.gain <= best.gain + 1e-9:
            break
        best = span
        hours = _run(len(score), start, length)
    return best


def _best_days(score: Floats, information: Floats, sign: int) -> tuple[int, int, float]:
    s = np.concatenate([[0.0], np.cumsum(score)])
    q = np.concatenate([[0.0], np.cumsum(information)])
    sums, weight = s[None, :] - s[:, None], q[None, :] - q[:, None]
    gains = _gain(sums, weight, sign)
    gains[np.tril_indices(len(s))] = -np.inf
    first, end = np.unravel_index(int(np.argmax(gains)), gains.shape)
    return int(first), int(end) - 1, float(gains[first, end])


def _best_hours(score: Floats, information: Floats, sign: int) -> tuple[int, int, float]:
    n = len(score)
    best = (0, n, float(_gain(score.sum(), information.sum(), sign)))
    if n == 1:
        return best
    twice = np.concatenate([np.arange(n), np.arange(n)])
    for start in range(n):
        order = twice[start : start + n]
        s = np.cumsum(score[order])
        part = information[np.ix_(order, order)]
        q = np.cumsum(np.cumsum(part, axis=0), axis=1).diagonal()
        gains = _gain(s, q, sign)
        length = int(np.argmax(gains[:-1])) + 1
        if gains[length - 1] > best[2] + 1e-9:
            best = (start, length, float(gains[length - 1]))
    return best


def _gain(score: Floats, information: Floats, sign: int) -> Floats:
    s = np.maximum(sign * score, 0.0) if sign else score
    safe = np.where(information > 0, information, np.inf)
    return np.asarray(0.5 * s * s / safe)


def _run(n: int, start: int, length: int) -> np.ndarray:
    mask = np.zeros(n, bool)
    mask[(start + np.arange(length)) % n] = True
    return mask
