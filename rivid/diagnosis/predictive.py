"""Prediction of days by a fit without them, and the probabilities of explanations that follow.

Near the fit of an explanation the whitened residual of day d is r_d - X_d x, with x the change of its
parameters. The fit may end a step s from its optimum: G s is the sum of X'r over days minus what the prior
and limits hold back, G = X'X + P summed over days, P the diagonal precision of the prior. Without block b, x
has the precision G - G_b and the mean (G - G_b)^-1 (G s - g_b), g_b = X'r of the block: one Gauss-Newton step
from the full fit. With s = 0, a parameter that one block determines to a hundredth of its prior standard
deviation, and that is one nat from its optimum, would move by 141 prior standard deviations without the
block. The days of b are then predicted with innovations r_d - X_d x and the covariance I + X_d V X_d'. Days
may be noisier than others as a whole: the innovations of a day are a multivariate t variable.

The score of an explanation is the sum over blocks of these log densities. Blocks are resampled (Bayesian
bootstrap), so that a score that depends on a few of them is uncertain: pseudo-BMA+ of Yao, Vehtari, Simpson
and Gelman (2018, Bayesian Analysis 13, 917-1007, section 3.4).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import lsq_linear
from scipy.special import gammaln

from rivid.types import Floats

LOG_2PI = float(np.log(2.0 * np.pi))


def information(r: Floats, X: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute r'r (days,), X'r (days, p) and X'X (days, p, p) of each day, for :func:`held_out`.

    r (days, n) is the whitened residual of the full fit, 0 where a sample is missing; X (p, days, n) are the
    whitened columns, the decrease of the residual per unit of each parameter.
    """
    by_day = X.transpose(1, 0, 2)
    squares = np.einsum("dn,dn->d", r, r)
    return squares, (by_day @ r[..., None])[..., 0], by_day @ by_day.transpose(0, 2, 1)


def held_out(
    r_day: Floats,  # this and the next two: results of :func:`information`
    g_day: Floats,
    G_day: Floats,
    precision: ArrayLike,  # (p,): prior precision of the parameters
    blocks: ArrayLike,  # (days,)
    weights: ArrayLike,  # (days,): of the days in the fit; a day of weight 0 is predicted by all others
    off: ArrayLike = 0.0,  # (p,): end of the fit relative to the prior mean
    within: tuple[ArrayLike, ArrayLike] = (-np.inf, np.inf),  # (p,): limits of the change of each parameter
) -> tuple[Floats, Floats, Floats, Floats]:
    """Predict each day by the fit without its block.

    Returns e' C^-1 e and log |C| of the innovations e of each day (days,), C their covariance; the change of
    the parameters from the full fit to the fit without the block of each day (days, p); and the standard
    errors of the parameters (p,): those of the posterior, or of the jackknife over blocks with weight if
    these are larger, as when a response fits blocks in different ways.
    """
    label, w = np.asarray(blocks), np.asarray(weights, float)
    scale = np.sqrt(np.asarray(precision, float))  # unit: prior standard deviation
    g_day, G_day, p = g_day / scale, G_day / (scale[:, None] * scale), len(scale)
    G = np.tensordot(w, G_day, 1) + np.eye(p)
    low, high = (np.broadcast_to(end * scale, p) for end in within)
    # step to the optimum, given the prior and the limits
    g = G @ step_within(G, np.tensordot(w, g_day, 1) - off * scale, low, high)
    squares, log_det, change = np.empty(len(w)), np.empty(len(w)), np.empty((len(w), p))
    jackknife = []
    for b in np.unique(label):
        days = np.flatnonzero(label == b)
        rest = G - np.tensordot(w[days], G_day[days], 1)
        x = step_within(rest, g - w[days] @ g_day[days], low, high)
        size = np.linalg.slogdet(rest)[1]
        if w[days].any():
            jackknife.append(x)
        for d in days:
            u = g_day[d] - G_day[d] @ x
            both = rest + G_day[d]
            squares[d] = r_day[d] - 2.0 * x @ g_day[d] + x @ G_day[d] @ x - u @ np.linalg.solve(both, u)
            log_det[d] = np.linalg.slogdet(both)[1] - size
            change[d] = x / scale
    many = len(jackknife)
    scatter = np.var(jackknife, axis=0) * (many - 1) if many > 1 else np.zeros(p)
    errors = np.sqrt(np.maximum(np.diag(np.linalg.inv(G)), scatter)) / scale
    return squares, log_det, change, errors


def step_within(G: Floats, g: Floats, low: Floats, high: Floats) -> Floats:
    """Return the step x of least 0.5 x'Gx - g'x with each parameter within its limits, shape (k,)."""
    # If it were clipped afterwards, the step of all other parameters would be wrong.
    x = np.linalg.solve(G, g)
    if ((x >= low) & (x <= high)).all():
        return np.asarray(x)
    root = np.linalg.cholesky(G)
    wide = np.maximum(high, low + 1e-9)  # the library needs low < high
    found = lsq_linear(root.T, np.linalg.solve(root, g), (low, wide), method="bvls")
    return np.asarray(found.x)


def day_densities(squares: Floats, log_det: Floats, scale: Floats, counts: Floats, tails: float) -> Floats:
    """Compute the log density of each day [nats], shape (days,).

    `scale` is the Gaussian log density of innovations of 0 without the parameters' part of the covariance,
    `counts` are the innovations of each day, `tails` the degrees of freedom of the days' common scale.
    """
    half = 0.5 * counts
    gauss = scale + half * LOG_2PI - 0.5 * log_det
    t = gammaln(0.5 * tails + half) - gammaln(0.5 * tails) - half * np.log(tails * np.pi)
    return np.asarray(gauss + t - (0.5 * tails + half) * np.log1p(squares / tails))


def probabilities(
    scores: ArrayLike,
    log_prior: ArrayLike,
    *,
    parts: float = 1.0,
    temper: float = 1.0,
    draws: int = 4000,
) -> Floats:
    """Return the probability of each explanation (k,), from the log densities of blocks (k, blocks).

    Each draw weighs the blocks by a Dirichlet distribution of `parts`, times their number: with the days of a
    block as parts, the bootstrap of days, scores summed in blocks. More parts leave more weight to an effect
    that acts in one block. The score of an explanation is tempered, its prior is not.
    """
    s = np.asarray(scores, float)
    weights = s.shape[1] * np.random.default_rng(0).dirichlet(np.full(s.shape[1], parts), draws)
    total = temper * (weights @ (s - s.max(axis=0)).T) + np.asarray(log_prior, float)
    total -= total.max(axis=1, keepdims=True)
    chance = np.exp(total)
    return np.asarray((chance / chance.sum(axis=1, keepdims=True)).mean(axis=0))
