"""The hidden parts of days: as known at each sample, and given the whole day."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rivid.diagnosis.noise.kalman import System

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def filtered(Z: Floats, pattern: Ints, K: Floats, m: System) -> tuple[Floats, Floats]:
    """Filtered states and innovations.

    Parameters
    ----------
    Z : ndarray, shape (days, n)
        0 where a sample is missing.
    pattern : ndarray of int, shape (days,)
        The lane of K for each day.
    K : ndarray, shape (3, n, lanes)
        From :func:`rivid.diagnosis.noise.kalman.gains`.
    m : System

    Returns
    -------
    states : ndarray, shape (days, n, 3)
    v : ndarray, shape (days, n)
        Innovations [m or m3/s].
    """
    days, n = Z.shape
    states, v = np.empty((days, n, 3)), np.empty((days, n))
    for d in range(days):
        j = pattern[d]
        x = w = s = 0.0
        for k in range(n):
            v[d, k] = Z[d, k] - x - s
            x += K[0, k, j] * v[d, k]
            w += K[1, k, j] * v[d, k]
            s += K[2, k, j] * v[d, k]
            states[d, k, 0], states[d, k, 1], states[d, k, 2] = x, w, s
            x += m.c * w
            w *= m.phi
            s *= m.psi
    return states, v


@njit(cache=True, error_model="numpy")
def smoothed(
    states: Floats, v: Floats, pattern: Ints, there: Bools, K: Floats, S: Floats, P: Floats, m: System
) -> tuple[Floats, Floats]:
    """States given the whole day (days, n, 3), and the variances of each (days, n, 3).

    The Rauch-Tung-Striebel smoother in the form that inverts no covariance: with r and N gathered backwards
    from the innovations, the mean is the filtered one + P F' r and the covariance P - P F' N F P. Before
    the first sample x is as unknown as its start, and only the memories of w and s run backwards; the
    variance of x is not followed there (NaN).

    Parameters
    ----------
    states, v
        From :func:`filtered`.
    pattern : ndarray of int, shape (days,)
    there : ndarray of bool, shape (n, lanes)
    K, S, P
        From :func:`rivid.diagnosis.noise.kalman.gains`.
    m : System
    """
    (days, n), many = v.shape, there.shape[1]
    spread, begins = np.empty((many, n, 3)), np.zeros(many, np.int64)
    for j in range(many):
        if m.diffuse:
            while begins[j] < n and not there[begins[j], j]:
                begins[j] += 1
        _variances(spread[j], begins[j], K[:, :, j], S[:, j], P[:, :, j], m)
    mean, variance = np.empty((days, n, 3)), np.empty((days, n, 3))
    for d in range(days):
        j = pattern[d]
        variance[d] = spread[j]
        _means(mean[d], states[d], v[d], begins[j], K[:, :, j], S[:, j], P[:, :, j], m)
    return mean, variance


@njit(cache=True, error_model="numpy")
def _means(
    mean: Floats, states: Floats, v: Floats, first: int, K: Floats, S: Floats, P: Floats, m: System
) -> None:
    """States of one day (n, 3) given all of it."""
    n = len(v)
    if first == n:
        mean[:, 0], mean[:, 1], mean[:, 2] = np.nan, 0.0, 0.0
        return
    r0 = r1 = r2 = 0.0
    for k in range(n - 1, first - 1, -1):
        r0, r1, r2 = r0, m.c * r0 + m.phi * r1, m.psi * r2  # F' r
        xx, xw, xs, ww, ws, ss = P[0, k], P[1, k], P[2, k], P[3, k], P[4, k], P[5, k]
        mean[k, 0] = states[k, 0] + (xx * r0 + xw * r1 + xs * r2)
        mean[k, 1] = states[k, 1] + (xw * r0 + ww * r1 + ws * r2)
        mean[k, 2] = states[k, 2] + (xs * r0 + ws * r1 + ss * r2)
        if S[k] > 0.0:
            read = v[k] / S[k] - (K[0, k] * r0 + K[1, k] * r1 + K[2, k] * r2)
            r0, r2 = r0 + read, r2 + read
    for k in range(first - 1, -1, -1):
        mean[k, 1] = m.phi * mean[k + 1, 1]
        mean[k, 2] = m.psi * mean[k + 1, 2]
        mean[k, 0] = mean[k + 1, 0] - m.c * mean[k, 1]


@njit(cache=True, error_model="numpy")
def _variances(out: Floats, first: int, K: Floats, S: Floats, P: Floats, m: System) -> None:
    """Their variances (n, 3), which the gaps alone decide."""
    n = len(S)
    if first == n:
        out[:, 0], out[:, 1], out[:, 2] = np.nan, m.inflow, m.level
        return
    F = np.array([[1.0, m.c, 0.0], [0.0, m.phi, 0.0], [0.0, 0.0, m.psi]])
    H = np.array([1.0, 0.0, 1.0])
    N = np.zeros((3, 3))
    V = np.empty((3, 3))
    for k in range(n - 1, first - 1, -1):
        V[0, 0], V[1, 1], V[2, 2] = P[0, k], P[3, k], P[5, k]
        V[0, 1] = V[1, 0] = P[1, k]
        V[0, 2] = V[2, 0] = P[2, k]
        V[1, 2] = V[2, 1] = P[4, k]
        back = F @ V  # its transpose is P F'
        given = V - back.T @ N @ back
        for i in range(3):
            out[k, i] = max(given[i, i], 0.0)
        N = F.T @ N @ F
        if S[k] > 0.0:
            L = np.eye(3) - np.outer(K[:, k].copy(), H)
            N = L.T @ N @ L + np.outer(H, H) / S[k]
    for k in range(first - 1, -1, -1):
        out[k, 0] = np.nan
        out[k, 1] = m.phi**2 * out[k + 1, 1] + (1.0 - m.phi**2) * m.inflow
        out[k, 2] = m.psi**2 * out[k + 1, 2] + (1.0 - m.psi**2) * m.level
