"""Kinds of noise for the posterior of the delay: moving averages C that whiten by the filter 1 / C.

The level carries the gauge's noise and, as a sum over time, every inflow that no log holds. An equation in
differences of the level then has noise ``C(q) e``: ``C`` is the minimum-phase factor of
``ratio + |a(q)|^2``, where ``a`` turns the level into the equation's noise and ``ratio`` is the variance of
what is added to the flow over that of the gauge.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CHUNK = 25
"""Samples that one product filters at once."""

GAUGE_RATIOS = (2.0, 0.5, 0.15, 0.045, 0.015)
"""Variance of the equation's own noise over that of the gauge, ``a = 1 - q^-1``."""

DRIFT_RATIOS = (0.01, 0.0015, 0.0003, 0.00005)
"""The same where the unlogged inflow drifts, ``a = (1 - q^-1)(1 - rho q^-1)``."""

DRIFT_MEMORY = 0.98
"""rho: what an unlogged inflow keeps from one sample to the next."""


def spectral_factor(a: Floats, ratio: float) -> Floats:
    """Minimum-phase C with ``|C(z)|^2`` proportional to ``ratio + |a(z)|^2`` on the unit circle.

    Parameters
    ----------
    a : ndarray, shape (k,)
        Coefficients of a(q), powers of q^-1 rising.
    ratio : float
        Above zero.

    Returns
    -------
    ndarray, shape (k,)
        Coefficients of C, the first of them one.

    Examples
    --------
    >>> C = spectral_factor(np.array([1.0, -1.0]), 0.5)
    >>> float(((1 + C[1] ** 2) / C[1]).round(9))
    -2.5
    """
    both = np.convolve(a, a[::-1])
    both[len(a) - 1] += ratio
    roots = np.roots(both)
    inside = roots[np.abs(roots) < 1.0]
    return np.asarray(np.real(np.poly(inside)), float)


@lru_cache(maxsize=1)
def noise_bank() -> Floats:
    """The noise polynomials, shape (kinds, 3): white, gauge noise, gauge noise and drifting inflow."""
    gauge, drift = np.array([1.0, -1.0]), np.convolve([1.0, -1.0], [1.0, -DRIFT_MEMORY])
    rows = [np.array([1.0, 0.0, 0.0])]
    rows += [np.append(spectral_factor(gauge, ratio), 0.0) for ratio in GAUGE_RATIOS]
    rows += [spectral_factor(drift, ratio) for ratio in DRIFT_RATIOS]
    return np.array(rows)


N_PLAIN, N_DRIFT = 1 + len(GAUGE_RATIOS), len(DRIFT_RATIOS)
"""How many of the bank are for white noise and the gauge's, and for a drifting inflow beside it."""


def prewhiten(series: Floats, polynomials: Floats) -> Floats:
    """Every series through every 1 / C, at rest before its first sample.

    Parameters
    ----------
    series : ndarray, shape (days, S, N)
    polynomials : ndarray, shape (kinds, 3)
        Each begins with one.

    Returns
    -------
    ndarray, shape (days, kinds, S, N)

    Notes
    -----
    Samples are filtered in chunks as if each began at rest, by one product of a fixed size for each day, so
    that a day's bits do not depend on its neighbours; then the last two samples of a chunk are carried on.
    """
    days, S, N = series.shape
    n_chunks = -(-N // CHUNK)
    padded = np.zeros((days, S, n_chunks * CHUNK))
    padded[..., :N] = series
    chunks = padded.reshape(days, 1, S * n_chunks, CHUNK)
    impulse = np.zeros((len(polynomials), CHUNK + 1))
    impulse[:, 0] = 1.0
    for k in range(1, CHUNK + 1):
        impulse[:, k] = -polynomials[:, 1] * impulse[:, k - 1]
        if k > 1:
            impulse[:, k] -= polynomials[:, 2] * impulse[:, k - 2]
    lag = np.arange(CHUNK)[None, :] - np.arange(CHUNK)[:, None]
    at_rest = np.where(lag >= 0, impulse[:, np.maximum(lag, 0)], 0.0)  # (kinds, from, to)
    filtered = np.matmul(chunks, at_rest).reshape(days, len(polynomials), S, n_chunks, CHUNK)
    last = impulse[:, 1:]  # what f[-1] = 1 leaves behind
    before = -polynomials[:, 2:] * impulse[:, :CHUNK]  # and f[-2] = 1
    for j in range(1, n_chunks):
        ends = filtered[..., j - 1, -2:]
        filtered[..., j, :] += ends[..., 1:] * last[:, None] + ends[..., :1] * before[:, None]
    whole: Floats = filtered.reshape(days, len(polynomials), S, -1)
    return whole[..., :N]
