"""The filter over days: their likelihoods under many systems at once, and innovations of many columns."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rivid.diagnosis.noise.kalman import gains

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
LOG_2PI = float(np.log(2.0 * np.pi))


@njit(cache=True, error_model="numpy")
def log_likelihoods(values: Floats, ends: Ints, there: Bools, systems: Floats, diffuse: bool) -> Floats:
    """Log-likelihood of each system and day, without the sample that sets a day's start.

    Parameters
    ----------
    values : ndarray, shape (n, days)
        0 where a sample is missing; days as :class:`rivid.diagnosis.noise.kalman.Lanes` puts them.
    ends, there
        Of the lanes.
    systems : ndarray, shape (q, 7)
    diffuse : bool

    Returns
    -------
    ndarray, shape (q, days)
    """
    days, many = values.shape[1], there.shape[1]
    K, S, _ = gains(there, systems, diffuse, False)
    weight, constant = _weights(S)
    out = np.empty((len(systems), days))
    for i in range(len(systems)):
        c, phi, psi = systems[i, 0], systems[i, 1], systems[i, 2]
        x, w, s, total = np.zeros(days), np.zeros(days), np.zeros(days), np.zeros(days)
        if many == days:
            _apart(values, K, weight, i * many, x, w, s, total, c, phi, psi)
        else:
            for j in range(many):
                a, b, lane = ends[j], ends[j + 1], i * many + j
                _alike(values, a, b, K, weight, lane, x[a:b], w[a:b], s[a:b], total[a:b], c, phi, psi)
        for j in range(many):
            for d in range(ends[j], ends[j + 1]):
                out[i, d] = -0.5 * (total[d] + constant[i * many + j])
    return out


@njit(cache=True, error_model="numpy")
def _weights(S: Floats) -> tuple[Floats, Floats]:
    """1 / S or 0, like S (n, lanes), and the sum over samples of log S + log 2 pi (lanes,)."""
    weight, constant = np.zeros(S.shape), np.zeros(S.shape[1])
    for k in range(len(S)):
        for i in range(S.shape[1]):
            if S[k, i] > 0.0:
                weight[k, i] = 1.0 / S[k, i]
                constant[i] += np.log(S[k, i]) + LOG_2PI
    return weight, constant


@njit(cache=True, error_model="numpy")
def _alike(
    values: Floats, a: int, b: int, K: Floats, weight: Floats, lane: int,
    x: Floats, w: Floats, s: Floats, total: Floats, c: float, phi: float, psi: float,
) -> None:  # fmt: skip
    """Sum the squares of the innovations of the days from a to b, which share the gains of a lane."""
    for k in range(len(values)):
        z = values[k, a:b]  # of its own, so that the compiler knows that no index is negative
        g0, g1, g2, share = K[0, k, lane], K[1, k, lane], K[2, k, lane], weight[k, lane]
        for d in range(len(z)):
            v = z[d] - x[d] - s[d]
            total[d] += v * v * share
            flow = w[d] + g1 * v
            x[d] += g0 * v + c * flow
            s[d] = psi * (s[d] + g2 * v)
            w[d] = flow * phi


@njit(cache=True, error_model="numpy")
def _apart(
    values: Floats, K: Floats, weight: Floats, lane: int,
    x: Floats, w: Floats, s: Floats, total: Floats, c: float, phi: float, psi: float,
) -> None:  # fmt: skip
    """The same for days that have each their own gains, from a lane on."""
    days = values.shape[1]
    for k in range(len(values)):
        z, share = values[k], weight[k, lane : lane + days]
        g0, g1, g2 = K[0, k, lane : lane + days], K[1, k, lane : lane + days], K[2, k, lane : lane + days]
        for d in range(days):
            v = z[d] - x[d] - s[d]
            total[d] += v * v * share[d]
            flow = w[d] + g1[d] * v
            x[d] += g0[d] * v + c * flow
            s[d] = psi * (s[d] + g2[d] * v)
            w[d] = flow * phi


@njit(cache=True, error_model="numpy")
def innovations(
    columns: Floats, order: Ints, ends: Ints, there: Bools, systems: Floats, diffuse: bool
) -> tuple[Floats, bool]:
    """Innovations over their standard deviation, 0 where a sample is missing or only sets the start.

    Parameters
    ----------
    columns : ndarray, shape (p, days, n)
        Where a sample is missing, whatever they read.
    order, ends, there
        Of the lanes.
    systems : ndarray, shape (1, 7)
    diffuse : bool

    Returns
    -------
    ndarray, shape (p, days, n)
    bool
        Whether all that is there is finite.
    """
    p, _, n = columns.shape
    c, phi, psi = systems[0, 0], systems[0, 1], systems[0, 2]
    K, S, _ = gains(there, systems, diffuse, False)
    scale = np.where(S > 0.0, 1.0 / np.sqrt(np.where(S > 0.0, S, 1.0)), 0.0)
    out = np.empty(columns.shape)
    finite = True
    for j in range(there.shape[1]):
        K0, K1, K2 = K[0, :, j].copy(), K[1, :, j].copy(), K[2, :, j].copy()
        here, root = there[:, j].copy(), scale[:, j].copy()
        many = ends[j + 1] - ends[j]
        rows = many * p
        for a in range(0, rows, 4):  # four rows at once, the last one as often as it takes
            i0, i1, i2, i3 = a, min(a + 1, rows - 1), min(a + 2, rows - 1), min(a + 3, rows - 1)
            d0, d1 = order[ends[j] + i0 % many], order[ends[j] + i1 % many]
            d2, d3 = order[ends[j] + i2 % many], order[ends[j] + i3 % many]
            z0, z1 = columns[i0 // many, d0], columns[i1 // many, d1]
            z2, z3 = columns[i2 // many, d2], columns[i3 // many, d3]
            o0, o1, o2, o3 = (
                out[i0 // many, d0],
                out[i1 // many, d1],
                out[i2 // many, d2],
                out[i3 // many, d3],
            )
            x0 = x1 = x2 = x3 = w0 = w1 = w2 = w3 = s0 = s1 = s2 = s3 = 0.0
            for k in range(n):
                is_there, size, g0, g1, g2 = here[k], root[k], K0[k], K1[k], K2[k]
                v, x0, w0, s0 = _step(z0[k] if is_there else 0.0, x0, w0, s0, g0, g1, g2, c, phi, psi)
                o0[k] = v * size
                v, x1, w1, s1 = _step(z1[k] if is_there else 0.0, x1, w1, s1, g0, g1, g2, c, phi, psi)
                o1[k] = v * size
                v, x2, w2, s2 = _step(z2[k] if is_there else 0.0, x2, w2, s2, g0, g1, g2, c, phi, psi)
                o2[k] = v * size
                v, x3, w3, s3 = _step(z3[k] if is_there else 0.0, x3, w3, s3, g0, g1, g2, c, phi, psi)
                o3[k] = v * size
            finite = finite and np.isfinite(x0 + x1 + x2 + x3)  # what is not never leaves x again
    return out, finite


@njit(cache=True, error_model="numpy")
def _step(
    z: float, x: float, w: float, s: float, g0: float, g1: float, g2: float, c: float, phi: float, psi: float
) -> tuple[float, float, float, float]:
    """The innovation of a sample, and what is expected of x, w and s at the next one."""
    v = z - x - s
    flow = w + g1 * v
    return v, x + (g0 * v + c * flow), flow * phi, psi * (s + g2 * v)
