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
TOGETHER = 50
"""Samples that :func:`spread_flow` computes together: fewer take more calls, more a larger matrix. Of 12 to
800 this was the fastest or within the noise of it, for 60 days at 133 and 60 s and for a row of 30,000."""


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


def spread_flow(edges: Floats, flow: Floats, deviation: float) -> Floats:
    """A held flow, each part of it earlier or later by a normal deviate, as means of the samples [m3/s].

    `edges` and `flow` are as of :func:`delayed_flow`; `deviation` is the standard deviation s of the deviates
    [s]. With b_k the beginning of sample k, d_j the change of the flow at b_j and G(x) = x Phi(x) + phi(x),
    the second integral of the normal density, the cumulative volume above that of an earlier flow is

        V(b_k) = s sum_j d_j G((b_k - b_j) / s),

    summed over the changes since then. Those that :data:`KERNEL_WIDTH` excludes have passed, or not begun.
    """
    if deviation == 0.0:
        return flow.copy()
    from scipy.special import ndtr

    edges = grid_of_rows(edges)
    if edges.ndim > 1:
        return np.stack([spread_flow(own, row, deviation) for own, row in zip(edges, flow, strict=True)])
    out, jumps = np.empty(flow.shape), np.diff(flow, axis=-1, prepend=flow[..., :1])
    for k in range(0, flow.shape[-1], TOGETHER):
        own = edges[k : k + TOGETHER + 1]
        near = own[[0, -1]] + KERNEL_WIDTH * deviation * np.array([-1.0, 1.0])
        i, j = np.searchsorted(edges[:-1], near).tolist()
        x = (own - edges[i:j, None]) / deviation
        G = x * ndtr(x) + np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi)
        volume = deviation * (jumps[..., i:j] @ G)
        before = flow[..., max(i - 1, 0), None]
        out[..., k : k + TOGETHER] = before + np.diff(volume, axis=-1) / np.diff(own)
    return out
