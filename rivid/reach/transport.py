"""Transport of held flows: delayed and spread in time, without loss of volume.

A flow is held from each sample to the next, so its cumulative volume consists of straight lines and is exact
at any time. All functions work along the last axis; rows are independent.
"""

import numpy as np
from numpy.typing import ArrayLike

from rivid.types import Floats

SAME = 1e-11
"""Times closer than this share of a row are one: seconds of a century are rounded to 1e-11 days."""
KERNEL_WIDTH = 7.0
"""Half width of the kernel of :func:`spread_flow` in standard deviations; 1e-12 of the volume is beyond."""


def held_volume(time: Floats, flow: Floats) -> Floats:
    """Cumulative volume of a held flow at each time since the first, shape (..., n) [m3].

    `time`, shape (..., n), are the beginnings of the samples [s], with or without the end of the last;
    `flow`, shape (..., n) or (..., n - 1), goes from each time to the next [m3/s].
    """
    passed = np.zeros(time.shape)
    np.cumsum(flow[..., : time.shape[-1] - 1] * np.diff(time, axis=-1), axis=-1, out=passed[..., 1:])
    return passed


def arrived_volume(
    at: Floats, arrival: Floats, passed: Floats, before: ArrayLike, after: ArrayLike = 0.0
) -> Floats:
    """Volume that has arrived at times `at` [s], shape (..., m) [m3].

    `arrival`, shape (..., n), are the times at which the cumulative volumes `passed` (:func:`held_volume`)
    arrive, not decreasing; `before` and `after`, shape (...), the flows that arrive before the first and
    after the last [m3/s]. Volumes are relative to that at the first arrival, so they may start below zero.
    """
    rows = at.shape[:-1]
    before, after = np.broadcast_to(before, rows), np.broadcast_to(after, rows)
    volume = np.empty(at.shape)
    for row in np.ndindex(rows):
        t, known = at[row], arrival[row]
        volume[row] = np.interp(t, known, passed[row])
        volume[row] += before[row] * np.minimum(t - known[0], 0.0)
        volume[row] += after[row] * np.maximum(t - known[-1], 0.0)
    return volume


def delayed_volume(time: Floats, flow: Floats, delay: ArrayLike) -> Floats:
    """Cumulative volume of a held flow that comes `delay` [s] >= 0 later, at its own sample times [m3].

    The first flow of a row holds before it; the volume is zero at the first sample plus `delay`.
    """
    return arrived_volume(time - np.asarray(delay), time, held_volume(time, flow), flow[..., 0])


def delayed_flow(edges: Floats, flow: Floats, delay: float) -> Floats:
    """A held flow that comes `delay` [s] later (earlier where negative), as means of the samples [m3/s].

    `edges`, shape (..., n + 1), are the beginnings of the samples and the end of the last [s]; `flow`, shape
    (..., n): the first flow holds before the row and the last after it.
    """
    passed = held_volume(edges, flow)
    grid = grid_of_rows(edges)
    if grid.ndim > 1:
        volume = arrived_volume(edges - delay, edges, passed, flow[..., 0], flow[..., -1])
    else:  # one search for all rows; the first and last flow go on beyond the ends
        at = grid - delay
        i = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
        volume = passed[..., i] + flow[..., i] * (at - grid[i])
    return np.asarray(np.diff(volume, axis=-1) / np.diff(grid, axis=-1))


def grid_of_rows(edges: Floats) -> Floats:
    """Times since each row's first, shape (..., n); where all rows have the same ones (n,), to rounding."""
    since = edges - edges[..., :1]
    row = since.reshape(-1, since.shape[-1])[0]
    return row if (np.abs(since - row) < SAME * row[-1]).all() else since


def spread_flow(edges: Floats, flow: Floats, deviation: float, sample_time: float) -> Floats:
    """A held flow, each part of it earlier or later by a normal deviate, as means of the samples [m3/s].

    `edges` and `flow` are as of :func:`delayed_flow`; `deviation` is the standard deviation s of the deviates
    [s], `sample_time` the length of the samples before and after the row [s]. With b_k the beginning of
    sample k and G(x) = x Phi(x) + phi(x), the second integral of the normal density, the volume of sample k
    takes of the flow of sample j = k - m

        s (g[m+1, k+1] - g[m, k+1] - g[m, k] + g[m-1, k]),   g[m, i] = G((b_i - b_i-m) / s).
    """
    if deviation == 0.0:
        return flow.copy()
    from scipy.signal import fftconvolve
    from scipy.special import ndtr

    def G(x: Floats) -> Floats:
        return np.asarray(x * ndtr(x) + np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))

    edges = grid_of_rows(edges)
    steps = np.diff(edges, axis=-1)
    n = flow.shape[-1]
    more = int(np.ceil(KERNEL_WIDTH * deviation / steps.min())) + 2
    base = flow[..., :1]
    rest = np.concatenate(
        [np.zeros((*flow.shape[:-1], more)), flow - base, np.repeat(flow[..., -1:] - base, more, axis=-1)],
        axis=-1,
    )
    if edges.ndim == 1 and np.ptp(steps) < 4.0 * SAME * edges[-1]:  # even samples have the same weights
        apart = edges[-1] / n / deviation
        weights = np.diff(G(apart * np.arange(-more - 1, more + 2)), 2) / apart
        weights = weights.reshape(*(1,) * (flow.ndim - 1), -1)
        return np.asarray(base + fftconvolve(rest, weights, mode="valid", axes=-1))
    outside = sample_time * np.arange(1, more + 1)
    b = np.concatenate([edges[..., :1] - outside[::-1], edges, edges[..., -1:] + outside], axis=-1)

    def g(m: int) -> Floats:
        return G((edges - b[..., more - m : more - m + n + 1]) / deviation)

    volume = np.zeros(flow.shape)
    less, now = g(-more), g(1 - more)
    for m in range(1 - more, more):
        following = g(m + 1)
        share = following[..., 1:] - now[..., 1:] - now[..., :-1] + less[..., :-1]
        volume += share * rest[..., more - m : more - m + n]
        less, now = now, following
    return np.asarray(base + deviation * volume / steps)
