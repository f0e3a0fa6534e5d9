"""Responses of a river reach: three families, each on a grid of t50.

- Hayami: the diffusive wave, an inverse Gaussian of arrival times with coefficient of variation cv;
- lag and reservoir: a pure delay, then a reservoir with one time constant;
- exchange: a Hayami wave of which a quarter is held for a while (pools, banks, hyporheic flow).

Every member only scales with time, so that its t50, the lag by which half of a step has arrived, is set
exactly. Flow is linear between samples: lag k gets the arrival density weighted by a hat of one sample to
each side, ``h[k] = I(k+1) - 2 I(k) + I(k-1)``, I the integral of the share that has arrived.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from scipy.optimize import brentq, isotonic_regression
from scipy.special import log_ndtr, ndtr

from rivid.core.settings import GUARD, RiverSettings, lags_of
from rivid.types import Floats

STEP = 0.25
"""Between travel times of the grid [samples]."""

HAYAMI_CV = (0.04, 0.1, 0.16, 0.24, 0.34, 0.48, 0.65)
RESERVOIR_SHARE = (0.15, 0.3, 0.5, 0.8)
"""Share of the mean travel time that is the reservoir's."""
EXCHANGE_CV = (0.1, 0.24, 0.4)
EXCHANGED = 0.25
"""Share of the water that is held."""
HELD_FOR = 0.6
"""Mean time for which it is held, in mean travel times of the rest."""

UNIFORM_TO = 48
"""Longest d_max [samples] of a grid with one step."""
OCTAVE = 24
"""End of the first grid of a longer d_max [samples]; each further grid doubles travel time, step and lag."""

BLOCK = 24
"""Travel times that share the lags on which their responses are not zero."""

SMALL = 1e-7
"""A response below this is taken as zero."""


def hayami(t: Floats, cv: float) -> tuple[Floats, Floats]:
    """Share of a step that has arrived at time t, and its integral; mean travel time 1.

    Source: Hayami (1951); moments of the inverse Gaussian in closed form.
    """
    shape = 1.0 / cv**2
    t = np.maximum(t, 1e-12)
    root = np.sqrt(shape / t)
    direct = ndtr(root * (t - 1.0))
    mirrored = np.exp(log_ndtr(-root * (t + 1.0)) + 2.0 * shape)
    arrived = direct + mirrored
    return arrived, t * arrived - (direct - mirrored)


def reservoir(t: Floats, share: float) -> tuple[Floats, Floats]:
    """The same for a lag of ``1 - share`` and a reservoir that empties with time constant `share`."""
    since = np.maximum(t - (1.0 - share), 0.0)
    arrived = -np.expm1(-since / share)
    return arrived, since - share * arrived


def exchange(t: Floats, cv: float) -> tuple[Floats, Floats]:
    """The same for a Hayami wave with a share held for an exponential time.

    The sum of an inverse Gaussian and an exponential time has its distribution in closed form: tilting an
    inverse Gaussian by an exponential gives another.
    """
    rate, shape = 1.0 / HELD_FOR, 1.0 / cv**2
    direct, area = hayami(t, cv)
    slow = sqrt(1.0 - 2.0 * rate / shape)  # the tilted wave has mean 1 / slow
    tilted, _ = hayami(t * slow, cv / sqrt(slow))
    held = direct - np.exp(-rate * t + shape * (1.0 - slow)) * tilted
    share = EXCHANGED
    return (1.0 - share) * direct + share * held, area - share * HELD_FOR * held


Family = Callable[[Floats, float], tuple[Floats, Floats]]

FAMILIES: tuple[tuple[Family, tuple[float, ...]], ...] = (
    (hayami, HAYAMI_CV),
    (reservoir, RESERVOIR_SHARE),
    (exchange, EXCHANGE_CV),
)


@dataclass(frozen=True)
class ResponseGrid:
    """All responses, by t50 and shape.

    The lags of `h` are multiples of `stride`; between them a response is linear.
    """

    t50: Floats  # travel times [samples], (T,)
    h: Floats  # (shapes, T, lags + 1), each sums to one
    prior: Floats  # of each shape; families have equal mass
    blocks: tuple[tuple[int, slice, slice], ...]  # shape, travel times and lags that are not zero
    stride: int = 1  # samples

    def at_lags(self, h: Floats, n_lags: int) -> Floats:
        """Interpolate a function of the grid's lags to lags of 0 to `n_lags` samples."""
        lags = np.arange(n_lags + 1) / self.stride
        return np.asarray(np.interp(lags, np.arange(len(h)), h, right=0.0))


@lru_cache(maxsize=4)
def response_grids(s: RiverSettings) -> tuple[ResponseGrid, ...]:
    """The grids of :class:`RiverSettings`, made once.

    Up to :data:`UNIFORM_TO` it is one grid. Beyond, the cost would grow with the cube of `d_max`, and the
    resolution of t50 is a share of it: travel times of 24 to 48 samples have a step of two samples' worth,
    those of 48 to 96 of four, and so on.
    """
    grids, stride = [], 1
    low, longest = max(s.d_min - GUARD, STEP), s.d_max + GUARD
    if s.d_max <= UNIFORM_TO:
        return (_grid(low, longest, s.n_lags),)
    while low <= longest:
        high = OCTAVE * stride
        if low < high:
            n_lags = min(lags_of(OCTAVE), s.n_lags // stride)
            last = min(high - STEP * stride, longest)
            grids.append(_grid(low / stride, last / stride, n_lags, stride))
            low = float(high)
        stride *= 2
    return tuple(grids)


def _grid(low: float, high: float, n_lags: int, stride: int = 1) -> ResponseGrid:
    """The grid of travel times from `low` to `high`, both in units of `stride` samples."""
    t50 = np.arange(low, high + 1e-9, STEP)
    h = np.stack([responses(family, one, t50, n_lags) for family, many in FAMILIES for one in many])
    prior = np.array([1.0 / (len(FAMILIES) * len(many)) for _, many in FAMILIES for _ in many])
    blocks = []
    for shape in range(len(h)):
        for begin in range(0, len(t50), BLOCK):
            part = slice(begin, min(begin + BLOCK, len(t50)))
            lags = np.flatnonzero(h[shape, part].max(axis=0) > 0.0)
            blocks.append((shape, part, slice(int(lags[0]), int(lags[-1]) + 1)))
    return ResponseGrid(t50 * stride, h, prior, tuple(blocks), stride)


def responses(family: Family, parameter: float, t50: Floats, n_lags: int) -> Floats:
    """h of one member at several t50, shape (T, n_lags + 1); what comes later is put on the last lag."""
    half = float(brentq(lambda t: float(family(np.array([t]), parameter)[0][0]) - 0.5, 1e-3, 3.0))
    scale = t50[:, None] / half
    lag = np.maximum(np.arange(-1, n_lags + 2), 0.0)
    area = scale * family(lag / scale, parameter)[1]
    area[:, :2] = 0.0  # nothing has arrived at lag 0 or before
    h = area[:, 2:] - 2.0 * area[:, 1:-1] + area[:, :-2]
    h = np.maximum(h, 0.0)
    h[h < SMALL] = 0.0
    late = 1.0 - h.sum(axis=1)
    h[:, -1] += np.where(late > SMALL * h.shape[1], late, 0.0)
    whole: Floats = h / h.sum(axis=1, keepdims=True)
    return whole


def hastened(u: Floats, middle: float, lead: float) -> Floats:
    """u with its high water sooner: u(t) moves to ``t - lead ln(u / middle)``, shape (N,).

    The discharge `middle` keeps its time, e times as much arrives `lead` samples sooner. Water does not
    overtake: a rise steepens into a front, which arrives at the mean of the times of its discharges, so that
    no water is lost.
    """
    if lead == 0.0 or middle <= 0.0:
        return u
    k = np.arange(len(u), dtype=float)
    moved = k - lead * np.log(np.maximum(u, 0.1 * middle) / middle)
    rise = np.abs(np.gradient(u)) + 1e-6 * middle
    moved = isotonic_regression(moved, weights=rise).x + 1e-6 * k
    return np.asarray(np.interp(k, moved, u), float)
