"""p(d | y) where the outflow is not logged: the mean of two models of the day.

One is a first- or second-order equation or a store with a front (:mod:`rivid.core.posterior.front`), as in
:func:`rivid.core.posterior.daily.posterior`. The other is a smooth response with a jump,
``y[k] = sum_l (f(l) + theta s(l)) u[k-l] + c + n``: f is a Gaussian process over the lag, smooth and fading,
for the water, the operators who follow the inflow, and the feedback of the level; s is a jump at lag d + 1
that decays, theta > 0 its size; n is noise of one of a few kinds. f and theta are integrated out; the noise
variance s2, the unit of both priors, is taken at its maximum.

The probabilities are averaged, not the evidence: without the outflow both models are wrong in some way, and
evidence would select the one that is wrong with more confidence.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr

from rivid.core.posterior.daily import (
    PosteriorResult,
    candidates_of,
    fir_of,
    fold,
    in_blocks,
    likeliest,
    meant,
    weighted_fronts,
)
from rivid.core.posterior.front import LEAST_T, SHARES, SMALLEST_PIVOT, SURE_T
from rivid.core.posterior.noise import Noises, Sums, spectral_factor, whitened_sums
from rivid.core.settings import GUARD, PosteriorSettings
from rivid.types import Floats

NOISES = ((0.0, (0.3, 0.03)), (0.5, (0.3, 0.03)), (0.8, (0.3, 0.03, 0.003)))
"""r of the random walk, ``A = (1 - q^-1)(1 - r q^-1)``, and the ratios of its variance to the gauge's."""

LENGTHS = (3.0, 8.0)
"""Correlation lengths of f [lags]."""
FADING = 0.9
"""Ratio of f's variance from one lag to the next."""
STRENGTHS = (1.0, 10.0, 100.0, 1e3, 1e4)
"""Variance of f's part in the level, summed over the rows, for each lag, over s2."""
DECAYS = (0.6, 0.85, 1.0)
"""Ratio of the jump from one lag to the next."""

KEPT = 1e-7
"""Directions of f with less of its variance are left out."""

BEHIND = 19
"""Lags behind the last candidate."""

MODELS = 4
"""Models of which the response is averaged."""


@lru_cache(maxsize=1)
def blind_noises() -> Noises:
    """(A, C) of every kind of noise."""
    wander = [(np.convolve([1.0, -1.0], [1.0, -r]), ratios) for r, ratios in NOISES]
    return tuple((a, spectral_factor(a, ratio)) for a, ratios in wander for ratio in ratios)


@lru_cache(maxsize=4)
def smooth_roots(n_lags: int) -> Floats:
    """Square roots of f's covariance at lags 1 to `n_lags`, shape (lengths, n_lags, rank)."""
    lag = np.arange(1, n_lags + 1)
    roots = []
    for length in LENGTHS:
        K = FADING ** (0.5 * (lag[:, None] + lag))
        K *= np.exp(-0.5 * ((lag[:, None] - lag) / length) ** 2)
        value, vector = np.linalg.eigh(K)
        roots.append(vector * np.sqrt(np.maximum(value, 0.0)))
    rank = max(int((np.sum(root**2, axis=0) > KEPT * n_lags).sum()) for root in roots)
    return np.stack([root[:, -rank:] for root in roots])


@lru_cache(maxsize=4)
def jumps(first: int, last: int, n_lags: int) -> Floats:
    """s at lags 1 to `n_lags`, its jump at lag ``first + 1`` to ``last + 2``: (decays, jumps, n_lags)."""
    since = np.arange(1, n_lags + 1) - np.arange(first + 1, last + 3)[:, None]
    decay = np.array(DECAYS)[:, None, None]
    return np.where(since >= 0, decay ** np.maximum(since, 0), 0.0)


def blind_evidence(u: Floats, y: Floats, first: int, last: int, n_lags: int) -> tuple[Floats, Floats, Sums]:
    """Log evidence of every jump of one day, without the constant; u and y have shape (N,).

    Returns it for B kinds of noise, lengths and strengths of f, decays of the jump, candidates and shares, in
    this order of axes; without a jump, shape (B, lengths, strengths); and the sums it is made of.

    The candidates d run from `first` to `last`; f has `n_lags` lags, above ``last + 2``. With G the Gram
    matrix of the lags and ``k K`` the covariance of f in units of s2, what f explains is projected from every
    product: ``R = G - G (K^-1 / k + G)^-1 G``. One eigenvalue problem of ``F'G F``, ``K = F F'``, serves
    every k. A jump between samples is linear in its share, so that two neighbouring jumps give all shares.
    theta has the prior of one row: its variance is n over s'Rs.
    """
    sums = whitened_sums(u[None], y, np.empty((0, len(u))), n_lags, n_lags, blind_noises())
    n = len(u) - n_lags - 1  # the constant is gone
    G, b, yy = lag_products(sums)
    F, s = smooth_roots(n_lags), jumps(first, last, n_lags)
    GF = np.matmul(G[:, None], F)
    value, V = np.linalg.eigh(np.matmul(F.swapaxes(1, 2), GF))
    value = np.maximum(value, 0.0)
    z = np.matmul(np.matmul(V.swapaxes(-1, -2), F.swapaxes(1, 2)), b[:, None, :, None])[..., 0]
    sGF = np.matmul(s.reshape(-1, n_lags), np.matmul(GF, V))  # (B, lengths, jumps, rank)
    strength = np.array(STRENGTHS) * _unit(G)[:, None]
    k = strength[:, None, :, None]
    shrink = k / (1.0 + k * value[:, :, None])  # (B, lengths, strengths, rank)

    half_log = 0.5 * np.log1p(k * value[:, :, None]).sum(axis=-1)
    left = np.maximum(yy[:, None, None] - np.einsum("blkr,blr->blk", shrink, z**2), 1e-13 * yy[:, None, None])
    with np.errstate(divide="ignore"):  # a level that does not move
        nothing = -0.5 * n * np.log(left) - half_log - 0.5 * np.log(n)

    decays, m, _ = s.shape
    back = shrink.swapaxes(-1, -2)
    Gs = np.matmul(G, s.reshape(-1, n_lags).T).swapaxes(1, 2)
    shape = (len(G), len(LENGTHS), decays, m, len(STRENGTHS))
    same = np.einsum("bjl,jl->bj", Gs, s.reshape(-1, n_lags))[:, None, :, None] - np.matmul(sGF**2, back)
    P = sGF.reshape(*shape[:4], -1)
    pair = np.einsum("bdml,dml->bdm", Gs.reshape(len(G), decays, m, -1)[:, :, :-1], s[:, 1:])
    near = np.matmul((P[..., :-1, :] * P[..., 1:, :]).reshape(*shape[:2], decays * (m - 1), -1), back)
    near = pair[:, None, :, :, None] - near.reshape(*shape[:3], m - 1, -1)
    seen = np.matmul(s.reshape(-1, n_lags), b[..., None])[:, None] - np.matmul(sGF, back * z[..., None])
    same, seen = same.reshape(shape), seen.reshape(shape)

    w = SHARES
    v = 1.0 - w
    a, c, e = same[..., :-1, :, None], same[..., 1:, :, None], near[..., None]
    size = w * w * a + v * v * c + 2.0 * w * v * e
    hit = w * seen[..., :-1, :, None] + v * seen[..., 1:, :, None]
    alive = a > SMALLEST_PIVOT * np.einsum("bjj->b", G)[:, None, None, None, None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        best = hit / size * (n / (n + 1.0))
        rss = np.maximum(left[:, :, None, None, :, None] - best * hit, 1e-13 * yy.reshape(-1, 1, 1, 1, 1, 1))
        t = hit * np.sqrt(n / (n + 1.0) * n / (size * rss))
        log = -0.5 * n * np.log(rss)
        doubtful = t < SURE_T
        log[doubtful] += log_ndtr(np.maximum(t[doubtful], LEAST_T))
    log += np.log(2.0) - 0.5 * np.log(n + 1.0) - 0.5 * np.log(n) - half_log[:, :, None, None, :, None]
    fronts = np.where(alive & np.isfinite(log), log, -np.inf)
    return np.moveaxis(fronts, 4, 2), nothing, sums


def lag_products(sums: Sums) -> tuple[Floats, Floats, Floats]:
    """G, ``U'y`` and ``y'y`` of lags 1 and above, the constant projected out."""
    uz, yz = sums.uz[0, :, 1:, 0], sums.yz[:, 0]
    G = sums.uu[0, :, 1:, 1:] - uz[:, :, None] * uz[:, None]
    return G, sums.uy[0, :, 1:] - uz * yz[:, None], sums.yy - yz**2


def _unit(G: Floats) -> Floats:
    """Variance of f at which its part in the level, summed over the rows, is s2 for each lag."""
    trace = np.einsum("bjj->b", G)
    return np.asarray(G.shape[-1] / np.where(trace > 0.0, trace, np.inf), float)


def blind_fir(
    fronts: Floats, sums: Sums, n_rows: int, first: int, belongs: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Mean and standard deviation of h, shape (n_lags + 1,), over the likeliest models of one day.

    `fronts` and `sums` are those of :func:`blind_evidence`, `n_rows` is the rows but one and `first` the
    first candidate. Only fronts that `belongs` (candidates, shares) marks count.
    """
    logs = np.where(belongs, fronts, -np.inf)
    flat = logs.ravel()
    chosen = np.sort(np.argpartition(-flat, MODELS)[:MODELS])
    chosen = chosen[np.isfinite(flat[chosen])]
    G, b, yy = lag_products(sums)
    n_lags, n = G.shape[-1], n_rows
    if not len(chosen):
        return np.full(n_lags + 1, np.nan), np.full(n_lags + 1, np.nan)
    weight = np.exp((flat[chosen] - flat[chosen].max()) / TEMPERATURE)
    weight /= weight.sum()
    H, variances = np.zeros((2, len(chosen), n_lags + 1))
    last = first + logs.shape[-2] - 1
    for i, model in enumerate(chosen):
        B, length, strength, decay, d, w = np.unravel_index(model, logs.shape)
        F, both = smooth_roots(n_lags)[length], jumps(first, last, n_lags)[decay]
        s = SHARES[w] * both[d] + (1.0 - SHARES[w]) * both[d + 1]
        k = STRENGTHS[strength] * _unit(G)[B]
        root = k * F @ np.linalg.solve(np.eye(F.shape[1]) + k * F.T @ G[B] @ F, F.T)  # var f | theta, over s2
        free = s - root @ (G[B] @ s)  # what a unit of theta adds to h
        theta_variance = n / (n + 1.0) / (s @ G[B] @ free)
        theta = theta_variance * (free @ b[B])
        H[i, 1:] = root @ b[B] + free * theta
        rss = yy[B] - b[B] @ H[i, 1:]
        variances[i, 1:] = (np.diag(root) + free**2 * theta_variance) * max(rss, 0.0) / n
    mean = weight @ H
    return mean, np.sqrt(np.maximum(weight @ (variances + (H - mean) ** 2), 0.0))


TEMPERATURE = 2.0
"""Divisor of the log evidence of the smooth response."""

SHARE = 0.5
"""Weight of the smooth response in the mean of the two models."""

IS_STORE = tuple(length > 5.0 for length in LENGTHS)
"""Whether a jump is that of a store: reflected waves leave no response that is smooth over many lags."""


def posterior_blind(u: ArrayLike, y: ArrayLike, settings: PosteriorSettings | None = None) -> PosteriorResult:
    """Probability of every delay, day by day, from the inflow and the level alone.

    Parameters and errors are those of :func:`rivid.core.posterior.daily.posterior`. The `fir` of the result
    is the response of the level with the operators' feedback, not with the outflow held.
    """
    s = settings or PosteriorSettings()
    return in_blocks({"inflow": u, "level": y}, n_least(s), s, _block)


def n_least(s: PosteriorSettings) -> int:
    """Fewest samples of a day."""
    return 3 * _n_lags(s)


def _n_lags(s: PosteriorSettings) -> int:
    return max(s.d_max + GUARD + BEHIND, s.order - 1)


def _block(u: Floats, y: Floats, _: Floats | None, s: PosteriorSettings) -> tuple[Floats, ...]:
    """The pool of the equations with a front and of the smooth response with a jump."""
    fronts, q, stores, link = weighted_fronts(u, y, None, s)
    n_lags, (first, last) = _n_lags(s), candidates_of(s)
    days = [blind_evidence(a, b, first, last, n_lags) for a, b in zip(u, y, strict=True)]
    smooth, jump = zip(*(smooth_weights(found, none, s) for found, none, _ in days), strict=True)
    pooled = [*((1.0 - SHARE) * part for part in q), *(SHARE * part for part in np.stack(smooth, axis=-1))]
    probability, right, place = fold(pooled, [*stores, *IS_STORE], s)
    delay = likeliest(probability, s)
    fir, sd = fir_of(fronts, delay, s)
    n_rows = u.shape[1] - n_lags - 1
    smooth_fir = [
        blind_fir(found, sums, n_rows, first, meant(s) == d)
        for (found, _, sums), d in zip(days, delay, strict=True)
    ]
    h, h_sd = (np.stack(part)[:, : s.order] for part in zip(*smooth_fir, strict=True))
    mean = (1.0 - SHARE) * fir + SHARE * h
    variance = (1.0 - SHARE) * (sd**2 + (fir - mean) ** 2) + SHARE * (h_sd**2 + (h - mean) ** 2)
    link = (1.0 - SHARE) * link + SHARE * np.array(jump)
    return probability.T, right.T, place.T, mean, np.sqrt(variance), link


def smooth_weights(fronts: Floats, nothing: Floats, s: PosteriorSettings) -> tuple[Floats, float]:
    """Flattened weight of each smoothness of f and place of the jump, and the probability of a jump.

    `fronts` and `nothing` are those of :func:`blind_evidence`; the weights have shape (lengths, candidates,
    shares).
    """
    prior = np.full(len(SHARES), (1.0 - s.sharp) / len(SHARES))
    prior[0] += s.sharp
    top = max(float(fronts.max()), float(nothing.max()))
    if not np.isfinite(top):
        return np.full((len(LENGTHS), *fronts.shape[-2:]), np.nan), 0.0
    weight = np.exp((fronts - top) / TEMPERATURE).mean(axis=(0, 2, 3)) * prior
    none = float(np.exp((nothing - top) / TEMPERATURE).mean())
    total = float(weight.sum())
    if total <= 0.0:
        return np.full_like(weight, np.nan), 0.0
    seen = total / len(LENGTHS) / weight.shape[1]
    return weight / total, seen / (seen + none)
