"""The compiled Kalman filter of one day's noise; importing this module loads numba.

The state is (x, w, s): level error, unknown inflow, level-type noise. A sample reads z = x + s + e, and

    x_{k+1} = x_k + c w_k + v_k,    w_{k+1} = phi w_k + ...,    s_{k+1} = psi s_k + ...,

w and s stationary from the first sample on. x starts diffuse, exactly: the first sample that is there sets
x = z - s - e, counts nothing, and its innovation is 0 (Durbin and Koopman, Time series analysis by state
space methods, ch. 5). Gains depend on which samples are there, not on what they read: days with the same
gaps share them.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from rivid.errors import RividError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
LOG_2PI = float(np.log(2.0 * np.pi))


class System(NamedTuple):
    """The matrices' entries: c [s/m2], memories phi and psi a sample, variances of v, w, s and e."""

    c: float
    phi: float
    psi: float
    walk: float
    inflow: float
    level: float
    gauge: float
    diffuse: bool


class Days(NamedTuple):
    """Residual (days, n) with zeros where a sample is missing, and each day's pattern of what is there."""

    values: Floats
    pattern: Ints
    patterns: Bools


def gather(residual: ArrayLike) -> Days:
    """Days of a residual (days, n) whose missing samples are NaN."""
    z = np.asarray(residual, float)
    if z.ndim != 2 or z.size == 0:
        raise RividError(f"residual has shape {z.shape}: expected (days, n)")
    there = ~np.isnan(z)
    values = np.where(there, z, 0.0)
    if not np.isfinite(values).all():
        raise RividError("residual is infinite somewhere: expected numbers, and NaN for missing samples")
    if there.all():  # sorting the rows would cost more than the filter
        return Days(values, np.zeros(len(z), np.int64), there[:1])
    patterns, pattern = np.unique(there, axis=0, return_inverse=True)
    return Days(values, pattern.reshape(-1).astype(np.int64), np.ascontiguousarray(patterns))


@njit(cache=True, error_model="numpy")
def step(P: Floats, m: System) -> None:
    """P = F P F' + Q in place, P symmetric; F = [[1, c, 0], [0, phi, 0], [0, 0, psi]]."""
    xx, xw, xs, ww, ws, ss = P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]
    P[0, 0] = xx + m.c * (2.0 * xw + m.c * ww) + m.walk
    P[0, 1] = P[1, 0] = m.phi * (xw + m.c * ww)
    P[0, 2] = P[2, 0] = m.psi * (xs + m.c * ws)
    P[1, 1] = m.phi * m.phi * ww + (1.0 - m.phi * m.phi) * m.inflow
    P[1, 2] = P[2, 1] = m.phi * m.psi * ws
    P[2, 2] = m.psi * m.psi * ss + (1.0 - m.psi * m.psi) * m.level


@njit(cache=True, error_model="numpy")
def gains(there: Bools, m: System, K: Floats, S: Floats, kept: Floats) -> None:
    """Gains K (n, 3) and innovation variances S (n,) of one pattern of samples that are there.

    S is 0 where a sample is missing or only sets the start. `kept` is (n, 3, 3) for the filtered
    covariances, or empty.
    """
    P = np.zeros((3, 3))
    P[1, 1], P[2, 2] = m.inflow, m.level
    started = not m.diffuse
    for k in range(len(there)):
        K[k] = 0.0
        S[k] = 0.0
        if there[k] and not started:
            started = True
            K[k, 0] = 1.0
            P[0, 0] = P[2, 2] + m.gauge
            P[0, 1] = P[1, 0] = -P[1, 2]
            P[0, 2] = P[2, 0] = -P[2, 2]
        elif there[k]:
            h0, h1, h2 = P[0, 0] + P[0, 2], P[1, 0] + P[1, 2], P[2, 0] + P[2, 2]
            S[k] = h0 + h2 + m.gauge
            K[k, 0], K[k, 1], K[k, 2] = h0 / S[k], h1 / S[k], h2 / S[k]
            P[0, 0] -= K[k, 0] * h0
            P[0, 1] -= K[k, 0] * h1
            P[0, 2] -= K[k, 0] * h2
            P[1, 1] -= K[k, 1] * h1
            P[1, 2] -= K[k, 1] * h2
            P[2, 2] -= K[k, 2] * h2
            P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]
        if len(kept):
            kept[k] = P
        step(P, m)


@njit(cache=True, error_model="numpy")
def all_gains(patterns: Bools, m: System, keep: bool) -> tuple[Floats, Floats, Floats]:
    """Gains (m, n, 3), variances (m, n) and, if kept, filtered covariances (m, n, 3, 3) of each pattern."""
    many, n = patterns.shape
    K, S = np.empty((many, n, 3)), np.empty((many, n))
    kept = np.empty((many, n if keep else 0, 3, 3))
    for j in range(many):
        gains(patterns[j], m, K[j], S[j], kept[j])
    return K, S, kept


@njit(cache=True, error_model="numpy")
def innovations(Z: Floats, pattern: Ints, K: Floats, S: Floats, m: System) -> Floats:
    """Innovations over their standard deviation; Z is (columns, days, n), 0 where a sample is missing."""
    columns, days, n = Z.shape
    root = np.where(S > 0.0, 1.0 / np.sqrt(np.where(S > 0.0, S, 1.0)), 0.0)
    out = np.empty(Z.shape)
    for d in range(days):
        gain, scale = K[pattern[d]], root[pattern[d]]
        for i in range(columns):
            x = w = s = 0.0
            for k in range(n):
                v = Z[i, d, k] - x - s
                out[i, d, k] = v * scale[k]
                w += gain[k, 1] * v
                x += gain[k, 0] * v + m.c * w
                s = m.psi * (s + gain[k, 2] * v)
                w *= m.phi
    return out


@njit(cache=True, error_model="numpy")
def log_likelihoods(Z: Floats, pattern: Ints, patterns: Bools, m: System) -> Floats:
    """Log-likelihood of each day (days,), without the sample that sets the start."""
    K, S, _ = all_gains(patterns, m, False)
    days, n = Z.shape
    constant = np.zeros(len(S))
    weight = np.zeros(S.shape)
    for j in range(len(S)):
        for k in range(n):
            if S[j, k] > 0.0:
                weight[j, k] = 1.0 / S[j, k]
                constant[j] += np.log(S[j, k]) + LOG_2PI
    out = np.empty(days)
    for d in range(days):
        gain, inverse = K[pattern[d]], weight[pattern[d]]
        x = w = s = total = 0.0
        for k in range(n):
            v = Z[d, k] - x - s
            total += v * v * inverse[k]
            w += gain[k, 1] * v
            x += gain[k, 0] * v + m.c * w
            s = m.psi * (s + gain[k, 2] * v)
            w *= m.phi
        out[d] = -0.5 * (total + constant[pattern[d]])
    return out


@njit(cache=True, error_model="numpy")
def filtered(Z: Floats, pattern: Ints, K: Floats, m: System) -> tuple[Floats, Floats]:
    """Filtered states (days, n, 3) and raw innovations (days, n); Z is (days, n), 0 where missing."""
    days, n = Z.shape
    states, v = np.empty((days, n, 3)), np.empty((days, n))
    for d in range(days):
        gain = K[pattern[d]]
        x = w = s = 0.0
        for k in range(n):
            v[d, k] = Z[d, k] - x - s
            x += gain[k, 0] * v[d, k]
            w += gain[k, 1] * v[d, k]
            s += gain[k, 2] * v[d, k]
            states[d, k, 0], states[d, k, 1], states[d, k, 2] = x, w, s
            x += m.c * w
            w *= m.phi
            s *= m.psi
    return states, v


@njit(cache=True, error_model="numpy")
def smoothed(
    states: Floats, v: Floats, pattern: Ints, patterns: Bools, K: Floats, S: Floats, kept: Floats, m: System
) -> tuple[Floats, Floats]:
    """States given the whole day (days, n, 3), and the variances of each (days, n, 3).

    The Rauch-Tung-Striebel smoother in the form that inverts no covariance: with r and N gathered backwards
    from the innovations, the mean is the filtered one + P F' r and the covariance P - P F' N F P. Before
    the first sample x is as unknown as its start, and only the memories of w and s run backwards; the
    variance of x is not followed there (NaN).
    """
    days, n = v.shape
    F = np.array([[1.0, m.c, 0.0], [0.0, m.phi, 0.0], [0.0, 0.0, m.psi]])
    H = np.array([1.0, 0.0, 1.0])
    mean, variance = np.empty((days, n, 3)), np.empty((days, n, 3))
    for d in range(days):
        j = pattern[d]
        first = 0
        if m.diffuse:
            while first < n and not patterns[j, first]:
                first += 1
        if first == n:
            mean[d] = 0.0
            mean[d, :, 0] = np.nan
            variance[d, :, 0], variance[d, :, 1], variance[d, :, 2] = np.nan, m.inflow, m.level
            continue
        r, N = np.zeros(3), np.zeros((3, 3))
        for k in range(n - 1, first - 1, -1):
            P = kept[j, k]
            back = F @ P  # its transpose is P F'
            mean[d, k] = states[d, k] + back.T @ r
            V = P - back.T @ N @ back
            for i in range(3):
                variance[d, k, i] = max(V[i, i], 0.0)
            r = F.T @ r
            N = F.T @ N @ F
            if S[j, k] > 0.0:
                L = np.eye(3) - np.outer(K[j, k], H)
                r = L.T @ r + H * (v[d, k] / S[j, k])
                N = L.T @ N @ L + np.outer(H, H) / S[j, k]
        for k in range(first - 1, -1, -1):
            mean[d, k, 1] = m.phi * mean[d, k + 1, 1]
            mean[d, k, 2] = m.psi * mean[d, k + 1, 2]
            mean[d, k, 0] = mean[d, k + 1, 0] - m.c * mean[d, k, 1]
            variance[d, k, 0] = np.nan
            variance[d, k, 1] = m.phi**2 * variance[d, k + 1, 1] + (1.0 - m.phi**2) * m.inflow
            variance[d, k, 2] = m.psi**2 * variance[d, k + 1, 2] + (1.0 - m.psi**2) * m.level
    return mean, variance
