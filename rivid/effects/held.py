"""Flows that are held over each sample: their edges, their volume, moved and spread in time.

All maps keep the volume: what they take from one sample they give to others. Along a row of the time grid
the flow before the first sample is that of the first, the flow after the last that of the last.
"""

from collections.abc import Callable

import numpy as np

from rivid.effects.base import World
from rivid.types import DAY, Floats

REACH = 7.0
"""How far the kernel of :func:`spread` goes, in standard deviations."""


def edges(world: World) -> Floats:
    """Beginning of each sample and end of the last [s]; shape (..., n + 1).

    The last sample is as long as all others, but ends at midnight, where the grid begins anew.
    """
    last = world.time[..., -1:]
    midnight = (np.floor(last / DAY) + 1.0) * DAY
    return np.concatenate([world.time, np.minimum(last + world.sample_time, midnight)], axis=-1)


def mean_of(volume: Callable[[Floats], Floats], world: World) -> Floats:
    """Mean over each sample of a flow whose volume up to a time is known [m3/s]."""
    ends = edges(world)
    return np.asarray(np.diff(volume(ends), axis=-1) / np.diff(ends, axis=-1))


def moved(flow: Floats, world: World, delay: float) -> Floats:
    """The held flow, `delay` later (earlier where negative), as means of the samples.

    Parameters
    ----------
    flow : ndarray, shape of the time grid
        [m3/s].
    world : World
    delay : float
        [s].

    Returns
    -------
    ndarray, shape of the time grid
    """
    ends = edges(world)
    passed = np.concatenate(
        [np.zeros((*flow.shape[:-1], 1)), np.cumsum(flow * np.diff(ends), axis=-1)], axis=-1
    )
    result = np.empty(flow.shape)
    for row in np.ndindex(flow.shape[:-1]):
        at, held = ends[row], flow[row]
        asked = at - delay
        volume = np.interp(asked, at, passed[row])
        volume += held[0] * np.minimum(asked - at[0], 0.0) + held[-1] * np.maximum(asked - at[-1], 0.0)
        result[row] = volume[1:] - volume[:-1]
    return np.asarray(result / np.diff(ends))


def spread(flow: Floats, world: World, deviation: float) -> Floats:
    """The held flow, each drop of it earlier or later by a normal deviate, as means of the samples.

    Parameters
    ----------
    flow : ndarray, shape of the time grid
        [m3/s].
    world : World
    deviation : float
        Standard deviation s of the deviates [s].

    Returns
    -------
    ndarray, shape of the time grid

    Notes
    -----
    With b_k the beginning of sample k and G(x) = x Phi(x) + phi(x), the second integral of the normal
    density, the volume of sample k takes of the flow of sample j = k - m

        s (g[m+1, k+1] - g[m, k+1] - g[m, k] + g[m-1, k]),   g[m, i] = G((b_i - b_i-m) / s).
    """
    if deviation == 0.0:
        return flow.copy()
    from scipy.special import ndtr

    ends = edges(world)
    steps = np.diff(ends, axis=-1)
    n = flow.shape[-1]
    more = int(np.ceil(REACH * deviation / steps.min())) + 2
    aside = world.sample_time * np.arange(1, more + 1)
    b = np.concatenate([ends[..., :1] - aside[::-1], ends, ends[..., -1:] + aside], axis=-1)
    base = flow[..., :1]
    rest = np.concatenate(
        [np.zeros((*flow.shape[:-1], more)), flow - base, np.repeat(flow[..., -1:] - base, more, axis=-1)],
        axis=-1,
    )

    def g(m: int) -> Floats:
        x = (ends - b[..., more - m : more - m + n + 1]) / deviation
        return np.asarray(x * ndtr(x) + np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))

    volume = np.zeros(flow.shape)
    less, now = g(-more), g(1 - more)
    for m in range(1 - more, more):
        following = g(m + 1)
        share = following[..., 1:] - now[..., 1:] - now[..., :-1] + less[..., :-1]
        volume += share * rest[..., more - m : more - m + n]
        less, now = now, following
    return np.asarray(base + deviation * volume / steps)
