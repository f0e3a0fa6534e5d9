"""The inflow's impulse response at a known delay, averaged over the models that carry the most weight."""

import numpy as np

from rivid.core.posterior.front import SHARES, Structure
from rivid.core.posterior.noise import DRIFT_MEMORY, O_LAGS, Y_LAGS
from rivid.types import Bools, Floats, Ints

MODELS = 4
"""Models (equation, noise, place of the front) that are averaged for a day."""

RIDGE = 1e-11
"""Added to the diagonal of the scaled normal equations: columns that are the same share their coefficient."""


def averaged_fir(
    G: Floats, n_rows: int, fronts: list[Floats], belongs: list[Bools], kinds: tuple[Structure, ...],
    first: int, temperature: float, order: int, with_outflow: bool,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Mean and standard deviation of h over the likeliest models of each day's delay.

    Parameters
    ----------
    G : ndarray, shape (K, K, kinds, days)
        From :func:`rivid.core.posterior.noise.gram`.
    n_rows : int
    fronts : list of ndarray
        From :func:`rivid.core.posterior.front.log_evidence`.
    belongs : list of ndarray of bool, shape (candidates, shares, days)
        For each equation, the places of the front that mean the day's delay.
    kinds : tuple of Structure
    first : int
        The first candidate.
    temperature : float
        By which the log evidence is divided.
    order : int
        M; h[0] is lag 0.
    with_outflow : bool

    Returns
    -------
    h, sd : ndarray, shape (days, M)
        The spread holds that of the coefficients and that between the models.
    """
    days = G.shape[-1]
    parts = [np.where(b, f, -np.inf) for f, b in zip(fronts, belongs, strict=True)]
    flat = np.concatenate([part.reshape(-1, days) for part in parts])
    chosen = np.argpartition(-flat, MODELS, axis=0)[:MODELS]
    chosen = np.sort(chosen, axis=0)  # an order of summation that knows no ties
    logs = np.take_along_axis(flat, chosen, axis=0)
    with np.errstate(invalid="ignore"):
        weight = np.exp((logs - logs.max(axis=0)) / temperature)
        weight /= weight.sum(axis=0)
    H, V = np.zeros((MODELS, days, order)), np.zeros((MODELS, days, order))
    start = 0
    for part, s in zip(parts, kinds, strict=True):
        stop = start + part.size // days
        rank, day = np.nonzero((chosen >= start) & (chosen < stop) & np.isfinite(weight))
        if len(rank):
            noise, d, w = np.unravel_index(chosen[rank, day] - start, part.shape[:3])
            matrices = np.moveaxis(G[:, :, noise + s.noises.start, day], 2, 0)
            h, variance = _responses(matrices, s, d + first, SHARES[w], n_rows, order, with_outflow)
            H[rank, day], V[rank, day] = h, variance
        start = stop
    mean = np.einsum("md,mdk->dk", weight, H)
    spread = np.einsum("md,mdk->dk", weight, V + (H - mean) ** 2)
    return mean, np.sqrt(spread)


def _regressors(
    s: Structure, d: Ints, w: Floats, n_columns: int, with_outflow: bool
) -> tuple[Floats, Floats]:
    """Regressors (models, P, K) on the columns of the Gram matrix, and the response (K,).

    The front's taps come first, then the level's lags, the constant and the outflow's lags.
    """
    o, every = O_LAGS if with_outflow else 0, np.arange(len(d))
    y1, y0 = o + 1, o + 1 + Y_LAGS
    rho = DRIFT_MEMORY if s.name == "drifting store" else 0.0
    outflows = (1 if s.is_store else O_LAGS) if with_outflow else 0
    X = np.zeros((len(d), s.taps + s.order + 1 + outflows, n_columns))
    for tap in range(s.taps):
        lag = y0 + 1 + d + tap  # u at lag d + 1 + tap
        X[every, tap, lag] += w
        X[every, tap, lag + 1] += 1.0 - w - rho * w
        X[every, tap, lag + 2] -= rho * (1.0 - w)
    for k in range(s.order):
        X[:, s.taps + k, y1 + k] = 1.0
    X[:, s.taps + s.order, 0] = 1.0
    for k in range(outflows):
        X[:, s.taps + s.order + 1 + k, 1 + k] = 1.0
        if s.is_store:
            X[:, s.taps + s.order + 1 + k, 2 + k] = -rho
    response = np.zeros(n_columns)
    response[y0] = 1.0
    if s.is_store:
        response[[y1, y1 + 1]] = -1.0 - rho, rho
    return X, response


def _responses(
    G: Floats, s: Structure, d: Ints, w: Floats, n_rows: int, order: int, with_outflow: bool
) -> tuple[Floats, Floats]:
    """h and its variance, shape (models, M), of models of one equation; `G` has shape (models, K, K)."""
    X, response = _regressors(s, d, w, G.shape[-1], with_outflow)
    G = np.ascontiguousarray(G)
    half = np.matmul(X, G)
    Z, z = np.matmul(half, X.swapaxes(1, 2)), np.matmul(half, response[:, None])[..., 0]
    P = Z.shape[1]
    size = np.sqrt(np.maximum(np.diagonal(Z, axis1=1, axis2=2), 1e-300))
    scaled = Z / size[:, None] / size[..., None] + RIDGE * np.eye(P)
    inverse = np.linalg.inv(scaled) / size[:, None] / size[..., None]
    theta = np.matmul(inverse, z[..., None])[..., 0]
    total = np.matmul(np.matmul(response[None, None], G), response[:, None])[:, 0, 0]
    rss = np.maximum(total - np.sum(theta * z, axis=1), 0.0)
    free = s.taps + s.order
    covariance = inverse[:, :free, :free] * (rss / (n_rows - P))[:, None, None]
    a = np.zeros((len(d), 2))
    a[:, : s.order] = theta[:, s.taps : free]
    if s.is_store:
        a[:, 0] = 1.0

    every = np.arange(len(d))
    gradient = np.zeros((len(d), free, order + 3))
    for tap in range(s.taps):  # by each tap: v's lags through 1 / A
        gradient[every, tap, d + 1 + tap] = w
        gradient[every, tap, d + 2 + tap] += 1.0 - w
    gradient = gradient[:, :, :order]
    _recur(gradient[:, : s.taps], a)
    h = np.sum(theta[:, : s.taps, None] * gradient[:, : s.taps], axis=1)
    for k in range(s.order):  # by each lag of the level: h, later by the lag, through 1 / A
        gradient[:, s.taps + k, k + 1 :] = h[:, : order - k - 1]
    _recur(gradient[:, s.taps :], a)
    variance = np.sum(np.matmul(covariance, gradient) * gradient, axis=1)
    return h, np.maximum(variance, 0.0)


def _recur(x: Floats, a: Floats) -> None:
    """In place, ``x[k] += a1 x[k-1] + a2 x[k-2]`` along the last axis of (models, rows, M)."""
    for k in range(1, x.shape[-1]):
        x[..., k] += a[:, :1] * x[..., k - 1]
        if k > 1:
            x[..., k] += a[:, 1:] * x[..., k - 2]
