"""Estimate the delay by a regularised FIR, as MATLAB's `impulseest`, and the jump of its step response.

The FIR has kernels TC and DC and maximises the marginal likelihood. The rise of the level is ``y[k] - y[k-1]
= sum h_u(l) u[k-l] + sum h_o(l) o[k-l] + c + e``: a pool integrates, so the response of the level itself
would not end. Each response is Gaussian with covariance ``c lambda^((i+j)/2) rho^|i-j|`` (DC; T. Chen, H.
Ohlsson, L. Ljung, Automatica 48 (2012), 1525-1535); TC is the case ``rho = sqrt(lambda)``. A low-pass filter
of all signals leaves the responses unchanged and reduces the gauge noise that the difference amplifies. The
filter and the detection of the jump were the best variants on the development worlds.
"""

from functools import partial

import numpy as np
from scipy.linalg import block_diag, lu_factor, lu_solve
from scipy.optimize import minimize
from scipy.signal import lfilter

from benchmarks.peers.signals import Floats, Ints, deviations, lagged

ORDER = 30
"""Lags of each response."""

POLE = 0.5
"""Pole of the low-pass filter."""


def kernel(theta: Floats, order: int, tuned: bool) -> tuple[Floats, Floats]:
    """Return the covariance of a response over lags 1 to `order`, and its derivatives by theta.

    The derivatives have shape (len(theta), order, order).

    Theta is ln c, the logit of lambda and, for DC, the inverse hyperbolic tangent of rho, which is positive.
    """
    lag = np.arange(1.0, order + 1.0)
    decay = 1.0 / (1.0 + np.exp(-theta[1]))
    rho = np.tanh(theta[2]) if tuned else np.sqrt(decay)
    apart, together = np.abs(lag[:, None] - lag), 0.5 * (lag[:, None] + lag)
    K = np.exp(theta[0]) * decay**together * rho**apart
    if tuned:
        return K, np.stack([K, K * together * (1.0 - decay), K * apart * (1.0 - rho**2) / rho])
    return K, np.stack([K, K * (together + 0.5 * apart) * (1.0 - decay)])


def marginal_cost(
    theta: Floats, G: Floats, b: Floats, yy: float, n: int, order: int, tuned: bool
) -> tuple[float, Floats]:
    """Return -2 ln p(y | theta) up to a constant, at the best noise variance, and its gradient.

    K is in units of the noise variance.
    """
    halves = [kernel(part, order, tuned) for part in np.split(theta, 2)]
    K = block_diag(halves[0][0], halves[1][0])
    # det(I + G K) and K^-1 + G without the inverse of K
    inner = np.eye(len(G)) + G @ K
    factor = lu_factor(inner)
    log_det = float(np.log(np.abs(np.diag(factor[0]))).sum())
    w, S = lu_solve(factor, b), lu_solve(factor, G)
    left = max(yy - float(b @ K @ w), 1e-12 * yy)
    slope = S - (n / left) * np.outer(w, w)
    parts = (slope[:order, :order], slope[order:, order:])
    slopes = [np.einsum("tij,ij->t", half[1], part) for half, part in zip(halves, parts, strict=True)]
    return n * float(np.log(left / n)) + log_det, np.concatenate(slopes)


def response(u: Floats, y: Floats, o: Floats, tuned: bool, order: int = ORDER) -> Floats:
    """Return h_u over lags 1 to `order` of one day of deviations."""
    rows = slice(order + 1, len(y))
    rise, inflow, outflow = (lfilter([1.0], [1.0, -POLE], x) for x in (np.diff(y, prepend=y[0]), u, o))
    lags = range(1, order + 1)
    X, target = np.column_stack([lagged(inflow, lags, rows), lagged(outflow, lags, rows)]), rise[rows]
    X, target = X - X.mean(axis=0), target - target.mean()
    scale = float(np.std(target)) or 1.0
    size = np.maximum(np.repeat([X[:, :order].std(), X[:, order:].std()], order), 1e-9)
    X, target = X / size, target / scale
    G, b, yy = X.T @ X, X.T @ target, float(target @ target)
    one = np.array([-3.0, 2.0, 1.0][: 3 if tuned else 2])
    best = minimize(
        marginal_cost, np.concatenate([one, one]), args=(G, b, yy, len(target), order, tuned), method="L-BFGS-B",
        jac=True, bounds=[(-12.0, 8.0), (-4.0, 6.0), (0.01, 4.0)][: len(one)] * 2, options={"maxiter": 60},
    )  # fmt: skip
    K = block_diag(*(kernel(part, order, tuned)[0] for part in np.split(best.x, 2)))
    h = K @ np.linalg.solve(np.eye(len(G)) + G @ K, b)
    return np.asarray(h[:order] * scale / size[:order])


def jump(step: Floats) -> int:
    """Return the index of the larger upward change of mean, of the two changes that fit best."""
    n = len(step)
    total = np.concatenate([[0.0], np.cumsum(step)])
    k = np.arange(n + 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        fits = (total[None, :] - total[:, None]) ** 2 / (k[None, :] - k[:, None])  # [begin, end)
    both = np.where((k[:, None] > 0) & (k[:, None] < k[None, :]) & (k[None, :] < n), 1.0, np.nan)
    first, second = np.unravel_index(np.nanargmax(both * (fits[0][:, None] + fits + fits[:, n])), both.shape)
    means = np.diff(total[[0, first, second, n]]) / np.diff([0, first, second, n])
    return int((first, second)[int(np.argmax(np.diff(means)))])


def delays(u: Floats, y: Floats, o: Floats, candidates: Ints, tuned: bool = False) -> Ints:
    """Return the delay before the jump of the step response, clipped to the candidates."""
    order = max(ORDER, int(candidates[-1]) + 5)
    signals = zip(*deviations(u, y, o), strict=True)
    found = [jump(np.cumsum(response(a, b, c, tuned, order))) for a, b, c in signals]
    return np.asarray(np.clip(found, candidates[0], candidates[-1]), np.intp)


tc = delays
dc = partial(delays, tuned=True)
