"""Evidence of every response of a river window: gain integrated out, noise variance at its best.

For one kind of noise and one response h the whitened window is ``y = Z c + g x + e``, ``x = U h``: c is
profiled, at the price of half ln n for each column, so that the unit of the flow does not matter; the gain g
has a normal prior and is positive; e is white of variance s2.
"""

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from rivid.core.river.noise import SINE
from rivid.core.river.response import ResponseGrid
from rivid.core.river.sums import Sums

Floats = NDArray[np.float64]

SURE_T = 7.0
"""Beyond so many standard errors a gain is positive."""

FLOOR = 1e-9
"""Least share of the output's variance that is noise."""


class Evidence(NamedTuple):
    """Log evidence with the posterior of the gain.

    Attributes
    ----------
    log : ndarray
        Log of the marginal likelihood, noise variance at its best.
    gain, gain_variance : ndarray
        Mean and variance of the gain before it is cut at zero.
    """

    log: Floats
    gain: Floats
    gain_variance: Floats


def marginal(yy: Floats, xy: Floats, xx: Floats, m: int, gain: float, gain_sd: float) -> Evidence:
    """ln p(y | h) with the gain integrated out and s2 where the evidence is nearly highest.

    Parameters
    ----------
    yy, xy, xx : ndarray
        Sums of products, shapes that broadcast.
    m : int
        Rows.
    gain, gain_sd : float
        Prior of the gain, cut at zero.

    Returns
    -------
    Evidence

    Notes
    -----
    s2 is found by three steps of expectation and maximisation from the least-squares fit with a gain that is
    not negative.
    """
    precision0 = 1.0 / gain_sd**2
    xx = np.maximum(xx, 1e-300)
    floor = FLOOR * yy / m + 1e-300
    s2 = np.maximum((yy - xy * np.maximum(xy, 0.0) / xx) / m, floor)
    for _ in range(3):
        g, variance = _gain(xy, xx, s2, gain, precision0)
        mean, square = _positive(g, variance)
        s2 = np.maximum((yy - 2.0 * mean * xy + square * xx) / m, floor)
    g, variance = _gain(xy, xx, s2, gain, precision0)
    log = -0.5 * m * np.log(2.0 * np.pi * s2) - 0.5 * (yy - 2.0 * g * xy + g * g * xx) / s2
    log += 0.5 * np.log(variance * precision0) - 0.5 * (g - gain) ** 2 * precision0
    t = g / np.sqrt(variance)
    doubtful = t < SURE_T
    log[doubtful] += log_ndtr(t[doubtful])
    return Evidence(log - log_ndtr(gain / gain_sd), g, variance)


def _gain(xy: Floats, xx: Floats, s2: Floats, gain: float, precision0: float) -> tuple[Floats, Floats]:
    """Mean and variance of the gain where it may be negative."""
    precision = xx + precision0 * s2
    return (xy + gain * precision0 * s2) / precision, s2 / precision


def _positive(g: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """Mean and mean square of the gain where it may not."""
    mean, square = g.copy(), g * g + variance
    doubtful = g * g < SURE_T**2 * variance
    doubtful |= g < 0.0
    part, sd = g[doubtful], np.sqrt(variance[doubtful])
    t = part / sd
    pushed = sd * np.exp(-0.5 * t * t - log_ndtr(t)) / np.sqrt(2.0 * np.pi)
    mean[doubtful] += pushed
    square[doubtful] += part * pushed
    return mean, square


def evidence(
    sums: Sums, grid: ResponseGrid, n_rows: int, gain: float, gain_sd: float, within: float = inf
) -> Evidence:
    """Evidence of all responses, shape (C, B, 2, shapes, T): without and with the daily sine.

    Responses that cannot come `within` so much of the best one's log evidence have minus infinity.
    """
    C, B, n, _ = sums.uu.shape
    shapes, T, _ = grid.h.shape
    xx = np.empty((C, B, shapes, T))
    for shape, part, lags in grid.blocks:
        h = grid.h[shape, part, lags]
        xx[:, :, shape, part] = np.einsum("cbtl,tl->cbt", np.matmul(h, sums.uu[:, :, lags, lags]), h)
    flat = grid.h.reshape(-1, n)
    xy = np.matmul(sums.uy, flat.T).reshape(C, B, shapes, T)
    xz = np.matmul(flat, sums.uz).reshape(C, B, shapes, T, SINE)
    logs, gains, variances = [], [], []
    yy = sums.yy
    for columns in (slice(0, 1), slice(1, SINE)):  # the level first, then the sine besides
        part = xz[..., columns]
        yz = sums.yz[:, columns]
        xx = xx - np.einsum("...z,...z->...", part, part)
        xy = xy - np.matmul(part, yz[:, None, :, None])[..., 0]
        yy = yy - np.einsum("bz,bz->b", yz, yz)
        found = _worth(np.broadcast_to(yy[:, None, None], xy.shape), xy, xx, n_rows, gain, gain_sd, within)
        logs.append(found.log - 0.5 * columns.stop * np.log(n_rows))
        gains.append(found.gain)
        variances.append(found.gain_variance)
    return Evidence(*(np.stack(x, axis=2) for x in (logs, gains, variances)))


def _worth(
    yy: Floats, xy: Floats, xx: Floats, m: int, gain: float, gain_sd: float, within: float
) -> Evidence:
    """:func:`marginal` of the responses that count; no evidence is above its highest likelihood."""
    best_fit = np.maximum(yy - np.maximum(xy, 0.0) ** 2 / np.maximum(xx, 1e-300), FLOOR * yy + 1e-300)
    bound = -0.5 * m * (np.log(2.0 * np.pi * best_fit / m) + 1.0)
    top = np.unravel_index(np.argmax(bound), bound.shape)
    likeliest = marginal(
        np.array([yy[top]]), np.array([xy[top]]), np.array([xx[top]]), m, gain, gain_sd
    )  # fmt: skip
    keep = bound >= likeliest.log[0] - within
    found = marginal(yy[keep], xy[keep], xx[keep], m, gain, gain_sd)
    out = Evidence(np.full(xy.shape, -inf), np.zeros(xy.shape), np.zeros(xy.shape))
    for whole, part in zip(out, found, strict=True):
        whole[keep] = part
    return out


def nothing(sums: Sums, n_rows: int) -> Floats:
    """Log evidence without any response, shape (B, 2)."""
    out = []
    yy = sums.yy
    for columns in (slice(0, 1), slice(1, SINE)):
        yz = sums.yz[:, columns]
        yy = yy - np.einsum("bz,bz->b", yz, yz)
        s2 = np.maximum(yy / n_rows, 1e-300)
        out.append(
            -0.5 * n_rows * np.log(2.0 * np.pi * s2) - 0.5 * n_rows - 0.5 * columns.stop * np.log(n_rows)
        )
    return np.stack(out, axis=1)
