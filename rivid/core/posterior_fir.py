"""The inflow's impulse response at a known delay, averaged over the models that carry the most weight."""

import numpy as np
from numpy.typing import NDArray

from rivid.core.posterior_front import SHARES, Structure
from rivid.core.posterior_noise import DRIFT_MEMORY

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

MODELS = 4
"""Models (structure, noise, place of the front) that are averaged for a day."""


def equation(
    s: Structure, with_outflow: bool, delay: int, share: float, n_columns: int
) -> tuple[Floats, Floats, Floats]:
    """A model as a regression on the columns of :func:`rivid.core.posterior_gram.gram`.

    Parameters
    ----------
    s : Structure
    with_outflow : bool
    delay : int
        d of the candidate [samples].
    share : float
        w of the candidate.
    n_columns : int
        K.

    Returns
    -------
    regressors : ndarray, shape (P, K)
        One row each: the front's taps first, then the level's lags, the constant and the outflow's.
    response : ndarray, shape (K,)
    known : ndarray, shape (2,)
        Coefficients of y's lags 1 and 2 that are not estimated.
    """
    o = 2 if with_outflow else 0
    one, y1, y2, y0, first = 0, o + 1, o + 2, o + 3, o + 4

    def unit(**weights: float) -> Floats:
        row = np.zeros(n_columns)
        for name, weight in weights.items():
            row[int(name[1:])] += weight
        return row

    def at(pairs: list[tuple[int, float]]) -> Floats:
        return unit(**{f"c{i}": c for i, c in pairs})

    lag = first + delay  # of u at lag d + 1
    front = [(lag, share), (lag + 1, 1.0 - share)]
    if s.name in ("first order", "second order"):
        second = [(lag + 1, share), (lag + 2, 1.0 - share)]
        rows = [at(front), at(second), at([(y1, 1.0)])]
        rows += [at([(y2, 1.0)])] if s.name == "second order" else []
        rows += [at([(one, 1.0)])] + [at([(k, 1.0)]) for k in range(1, o + 1)]
        return np.array(rows), at([(y0, 1.0)]), np.zeros(2)
    rho = DRIFT_MEMORY if s.name == "drifting store" else 0.0
    front = [(lag, share), (lag + 1, 1.0 - share - rho * share), (lag + 2, -rho * (1.0 - share))]
    rows = [at(front), at([(one, 1.0)])]
    if with_outflow:
        rows.append(at([(1, 1.0), (2, -rho)]))
    return np.array(rows), at([(y0, 1.0), (y1, -1.0 - rho), (y2, rho)]), np.array([1.0, 0.0])


def impulse(a: Floats, b: Floats, covariance: Floats, n_free: int, order: int) -> tuple[Floats, Floats]:
    """Impulse response of ``h[k] = a1 h[k-1] + a2 h[k-2] + b[k]`` and its standard deviation.

    Parameters
    ----------
    a : ndarray, shape (2,)
    b : ndarray, shape (taps, order)
        The contribution of each tap, coefficient included: rows are coefficient times shape.
    covariance : ndarray, shape (taps + n_free, taps + n_free)
        Of the taps' relative coefficients, then of the first `n_free` entries of `a`.
    n_free : int
    order : int
        M.

    Returns
    -------
    h, sd : ndarray, shape (order,)
    """
    taps = len(b)
    inverse = np.zeros(order)
    for k in range(order):
        inverse[k] = (
            (k == 0) + (a[0] * inverse[k - 1] if k else 0.0) + (a[1] * inverse[k - 2] if k > 1 else 0.0)
        )
    answers = np.array([np.convolve(row, inverse)[:order] for row in b])
    h = answers.sum(axis=0)
    again = np.convolve(h, inverse)[:order]
    jacobian = np.zeros((taps + n_free, order))
    jacobian[:taps] = answers
    for k in range(n_free):
        jacobian[taps + k, k + 1 :] = again[: order - k - 1]
    variance = np.einsum("ik,ij,jk->k", jacobian, covariance, jacobian)
    return h, np.sqrt(np.maximum(variance, 0.0))


def averaged_fir(
    G: Floats, weights: Floats, places: list[tuple[int, int, int, int]], kinds: tuple[Structure, ...],
    with_outflow: bool, n_rows: int, order: int,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Mean and standard deviation of h over models of one day.

    Parameters
    ----------
    G : ndarray, shape (K, K, noises)
        Gram matrices of the day.
    weights : ndarray, shape (models,)
    places : list of (structure, noise, delay, share) indices
        The noise counts within the whole bank.
    kinds : tuple of Structure
    with_outflow : bool
    n_rows : int
    order : int
        M; h[0] is lag 0.

    Returns
    -------
    h, sd : ndarray, shape (order,)
    """
    firs, variances = [], []
    for which, noise, delay, share in places:
        s = kinds[which]
        rows, response, known = equation(s, with_outflow, delay, float(SHARES[share]), len(G))
        Z = rows @ G[:, :, noise] @ rows.T
        z = rows @ G[:, :, noise] @ response
        size = np.sqrt(np.maximum(np.diag(Z), 1e-300))
        inverse = np.linalg.pinv(Z / size / size[:, None], rcond=1e-10, hermitian=True) / size / size[:, None]
        theta = inverse @ z
        rss = max(response @ G[:, :, noise] @ response - theta @ z, 0.0)
        n_free = {"first order": 1, "second order": 2}.get(s.name, 0)
        part = slice(0, s.taps + n_free)
        covariance = inverse[part, part] * rss / (n_rows - len(theta))
        a = known.copy()
        a[:n_free] = theta[s.taps : s.taps + n_free]
        w = float(SHARES[share])
        shape = np.zeros((s.taps, order + 3))
        for k in range(s.taps):
            shape[k, delay + 1 + k], shape[k, delay + 2 + k] = w, 1.0 - w
        scale = np.ones(len(covariance))
        scale[: s.taps] = np.where(theta[: s.taps] == 0, 1.0, theta[: s.taps])
        relative = covariance / scale / scale[:, None]
        h, sd = impulse(a, theta[: s.taps, None] * shape[:, :order], relative, n_free, order)
        firs.append(h)
        variances.append(sd**2)
    p = weights / weights.sum()
    H = np.array(firs)
    mean = p @ H
    return mean, np.sqrt(p @ (np.array(variances) + (H - mean) ** 2))
