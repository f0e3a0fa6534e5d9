"""Evidence of every response of a river window: gain integrated out, noise variance at its best.

For one kind of noise and one response h the whitened window is ``y = Z c + g x + e``, ``x = U h``: c is
profiled, at the price of half ln n for each column, so that the unit of the flow does not matter; the gain g
has a normal prior and is positive; e is white of variance s2.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import inf

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import log_ndtr, ndtr

from rivid.core.fir import as_days
from rivid.core.posterior.daily import TOLERANCE, PosteriorResult, normalised, smallest_set
from rivid.core.posterior.noise import SINE, Sums, daily_sine, river_noises, whitened_sums
from rivid.core.posterior.response import ResponseGrid, hastened, response_grids
from rivid.core.settings import RiverSettings
from rivid.types import Floats

SURE_T = 7.0
"""Standard errors above zero from which a gain counts as positive."""

FLOOR = 1e-9
"""Smallest share of noise in the output's variance."""


Evidence = tuple[Floats, Floats, Floats]
"""Log evidence, the noise variance at its best; mean and variance of the gain before it is cut at zero."""


def marginal(yy: Floats, xy: Floats, xx: Floats, m: int, gain: float, gain_sd: float) -> Evidence:
    """ln p(y | h) with the gain integrated out and s2 where the evidence is nearly highest.

    The sums of products have shapes that broadcast, `m` is the number of rows; `gain` and `gain_sd` are the
    prior of the gain, cut at zero. s2 is found by three steps of expectation and maximisation from the
    least-squares fit with a gain that is not negative.
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
    return log - log_ndtr(gain / gain_sd), g, variance


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
    sums: Sums, grid: ResponseGrid, n_rows: int, gain: float, gain_sd: float, within: float = inf,
    best: float = -inf,
) -> Evidence:  # fmt: skip
    """Evidence of all responses, shape (C, B, 2, shapes, T): without and with the daily sine.

    Responses that cannot come `within` so much of the best one's log evidence, or of the `best` already
    known, have minus infinity.
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
    found = []
    yy = sums.yy
    for columns in (slice(0, 1), slice(1, SINE)):  # the mean first, then the sine as well
        part = xz[..., columns]
        yz = sums.yz[:, columns]
        xx = xx - np.einsum("...z,...z->...", part, part)
        xy = xy - np.matmul(part, yz[:, None, :, None])[..., 0]
        yy = yy - np.einsum("bz,bz->b", yz, yz)
        price = 0.5 * columns.stop * np.log(n_rows)
        every = np.broadcast_to(yy[:, None, None], xy.shape)
        log, *of_gain = _worth(every, xy, xx, n_rows, gain, gain_sd, best + price - within, within)
        found.append((log - price, *of_gain))
    log, mean, variance = (np.stack(x, axis=2) for x in zip(*found, strict=True))
    return log, mean, variance


def _worth(
    yy: Floats, xy: Floats, xx: Floats, m: int, gain: float, gain_sd: float, least: float, within: float
) -> Evidence:
    """:func:`marginal` of the responses that count; no evidence is above its highest likelihood."""
    best_fit = np.maximum(yy - np.maximum(xy, 0.0) ** 2 / np.maximum(xx, 1e-300), FLOOR * yy + 1e-300)
    bound = -0.5 * m * (np.log(2.0 * np.pi * best_fit / m) + 1.0)
    top = np.unravel_index(np.argmax(bound), bound.shape)
    a, b, c = (np.array([x[top]]) for x in (yy, xy, xx))
    likeliest, _, _ = marginal(a, b, c, m, gain, gain_sd)
    keep = bound >= max(likeliest[0] - within, least)
    found = marginal(yy[keep], xy[keep], xx[keep], m, gain, gain_sd)
    out = np.full(xy.shape, -inf), np.zeros(xy.shape), np.zeros(xy.shape)
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
        price = 0.5 * columns.stop * np.log(n_rows)
        out.append(-0.5 * n_rows * np.log(2.0 * np.pi * s2) - 0.5 * n_rows - price)
    return np.stack(out, axis=1)


LEADS = (0.0, 2.0, 5.0, 10.0)
"""How much sooner e times as much water arrives [samples]."""

LEAD_SHARE = 0.8
"""No lead is more than this share of t50."""

EDGE_STEP = 0.05
"""Between places at which the distribution of t50 is kept [samples]."""

NEGLIGIBLE = 35.0
"""Flattened log evidence below the best at which a response adds nothing."""

LEAST_ROWS = 24
"""Fewest rows of a window after its history."""


@dataclass(frozen=True)
class RiverPosterior(PosteriorResult):
    """Probabilities of the travel time t50 of a river, with a leading axis of windows.

    `place` is t50, the lag by which half of a step has arrived, at the mean inflow of the window, its history
    included: the inflow that tables have beside it. A delay d stands for the t50 that round to it; `right`
    allows a tenth of a sample more. `link` has a prior of 1/2.
    """

    gain: Floats  # share of the inflow's change that arrives [-]
    lead: Floats  # how much sooner e times as much water arrives [samples], mean


Grids = tuple[ResponseGrid, ...]
_Window = tuple[Floats, float, float, float, Floats, Floats]
"""Distribution of t50 over the grid, link, gain, lead, response and its spread."""


def posterior_river(u: ArrayLike, y: ArrayLike, settings: RiverSettings | None = None) -> RiverPosterior:
    """Probability of the travel time of every window.

    `u` and `y`, shape (windows, N), are the discharge at the upper and the lower end, of the same unit; the
    first ``settings.warm`` samples are history, the others are explained. RividError for shapes that do not
    fit, values that are not finite, or windows too short.
    """
    s = settings or RiverSettings()
    series, least = {"inflow": u, "output": y}, s.warm + LEAST_ROWS
    (inflow, output), _ = as_days(series, least, f"warm = {s.warm}", row="window", one=False)
    grids = response_grids(s)
    still = (np.ptp(inflow, axis=1) <= 0.0) | (np.ptp(output[:, s.warm :], axis=1) <= 0.0)
    windows = [
        None if dead else _window(a, b, grids, s) for a, b, dead in zip(inflow, output, still, strict=True)
    ]
    edges, table = _spread(s)
    no_fir = np.full(s.n_lags + 1, np.nan)
    empty = np.full(len(table), np.nan), 0.0, np.nan, np.nan, no_fir, no_fir
    weight, link, gain, lead, fir, fir_sd = (
        np.stack(part) for part in zip(*(w or empty for w in windows), strict=True)
    )
    below = np.stack([row @ table for row in weight])
    low, t50, high = (
        np.array([np.interp(level, F, edges) if np.isfinite(F[0]) else np.nan for F in below])
        for level in (0.05, 0.5, 0.95)
    )
    reached = np.stack([np.interp(np.arange(s.d_min, s.d_max + 2) - 0.5, edges, F) for F in below])
    beyond = np.stack([reached[:, 0], 1.0 - reached[:, -1]], axis=1)
    probability = normalised(np.diff(reached, axis=1))
    nearest = np.floor(t50 + 0.5)
    before, after = (
        np.array([np.interp(d, edges, F) for d, F in zip(nearest + side, below, strict=True)])
        for side in (-0.5 - TOLERANCE, 0.5 + TOLERANCE)
    )
    wide = high - low > s.widest + 0.5 * t50
    message = np.select(
        [still, ~(link >= s.link_above), beyond[:, 0] > 0.5, beyond[:, 1] > 0.5, wide],
        [
            "inflow or output does not move",
            "the output is not seen to follow the inflow",
            "the travel time lies below d_min",
            "the travel time lies above d_max",
            "the travel time is too uncertain",
        ],
        "",
    )
    outside = (beyond.max(axis=1) > 0.5) & (link >= s.link_above)
    status = np.where(message == "", "ok", np.where(outside, "at_bound", "unidentifiable"))
    return RiverPosterior(
        candidates=np.arange(s.d_min, s.d_max + 1), probability=probability, beyond=beyond,
        delay=np.where(status == "ok", nearest, np.nan), right=after - before,
        in_set=smallest_set(np.nan_to_num(probability), probability) & ~still[:, None],
        place=t50, place_low=low, place_high=high, half=t50, fir=fir, fir_sd=fir_sd, link=link,
        status=status, message=message, gain=gain, lead=lead,
    )  # fmt: skip


def _window(u: Floats, y: Floats, grids: Grids, s: RiverSettings) -> _Window | None:
    """Average over leads, noises, sine, shapes and travel times."""
    n_rows = len(u) - s.warm
    middle = float(np.mean(u))
    hastier = np.stack([hastened(u, middle, lead) for lead in LEADS])
    T, sine = s.flattening(n_rows), daily_sine(len(u), s.day)
    parts: list[Evidence] = []
    top = -inf
    for grid in grids:
        n_lags = grid.h.shape[2] - 1
        sums = whitened_sums(hastier, y, sine, s.warm, n_lags, river_noises(), grid.stride)
        parts.append(evidence(sums, grid, n_rows, s.gain, s.gain_sd, NEGLIGIBLE * T, top))
        top = max(top, float(parts[-1][0].max()))
    log, mean, variance = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    none = nothing(sums, n_rows)  # the same for all grids
    top = max(top, float(none.max()))
    leads, (t50, share) = np.array(LEADS), _places(grids)
    allowed = leads[:, None] <= LEAD_SHARE * t50
    prior = allowed / allowed.sum(axis=0) * share / none.size
    q = np.exp((log - top) / T)
    q *= prior[:, None, None, None, :] * grids[0].prior[:, None]
    seen, unseen = float(q.sum()), float(np.exp((none - top) / T).mean())
    if seen == 0.0:  # no response is as likely as none, to the last bit
        return None
    q /= seen
    weight = q.sum(axis=(0, 1, 2, 3))
    once = np.einsum("cbzst,cbzst->st", q, mean)
    twice = np.einsum("cbzst,cbzst->st", q, mean**2 + variance)
    fir, square = np.zeros((2, s.n_lags + 1))
    begin = 0
    for grid in grids:
        here = slice(begin, begin := begin + len(grid.t50))
        h = grid.h / grid.stride
        fir += grid.at_lags(np.einsum("st,stl->l", once[:, here], h), s.n_lags)
        square += grid.at_lags(np.einsum("st,stl->l", twice[:, here], h**2), s.n_lags)
    # the error that no window can see moves the whole response
    moved = np.gradient(fir) * (s.spread + s.spread_share * float(weight @ t50))
    sd = np.sqrt(np.maximum(square - fir**2, 0.0) + moved**2)
    lead = float(q.sum(axis=(1, 2, 3, 4)) @ leads)
    return weight, seen / (seen + unseen), float(once.sum()), lead, fir, sd


def _places(grids: Grids) -> tuple[Floats, Floats]:
    """All t50 of the grids [samples], and the prior share of each: it is uniform."""
    step = np.concatenate([np.full(len(grid.t50), float(grid.stride)) for grid in grids])
    return np.concatenate([grid.t50 for grid in grids]), step / step.sum()


@lru_cache(maxsize=4)
def _spread(s: RiverSettings) -> tuple[Floats, Floats]:
    """Edges [samples], and the distribution function there of a t50 found at each place of the grid."""
    t50, _ = _places(response_grids(s))
    edges = np.arange(0.0, 1.25 * t50[-1] + 5.0, EDGE_STEP)
    return edges, ndtr((edges - t50[:, None]) / (s.spread + s.spread_share * t50[:, None]))
