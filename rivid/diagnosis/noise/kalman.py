"""The Kalman filter of one day's noise: its matrices, days with the same gaps, and their gains.

The state is (x, w, s): level error, unknown inflow, level-type noise. A sample reads z = x + s + e, and

    x_{k+1} = x_k + c w_k + v_k,    w_{k+1} = phi w_k + ...,    s_{k+1} = psi s_k + ...,

w and s stationary from the first sample on. x starts diffuse, exactly: the first sample that is there sets
x = z - s - e, counts nothing, and its innovation is 0 (Durbin and Koopman, Time series analysis by state
space methods, ch. 5). Gains depend on which samples are present, not on their values: days with the same
gaps share them.

A sample depends on the one before it, a day on no other. So the innermost loops of all that is compiled here
go over days, patterns of gaps, or systems. Importing this module loads numba.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from rivid.errors import RividError
from rivid.types import Bools, Floats, Ints


class System(NamedTuple):
    """The matrices' entries: c [s/m2], memories phi and psi a sample, variances of v, w, s and e.

    `diffuse`: whether x is unknown at the start.
    """

    c: float
    phi: float
    psi: float
    walk: float
    inflow: float
    level: float
    gauge: float
    diffuse: bool

    @property
    def matrix(self) -> Floats:
        """All but the last, as a row, shape (1, 7)."""
        return np.array([self[:7]])


class Days(NamedTuple):
    """Residual (days, n) with zeros where a sample is missing, and each day's pattern of what is there."""

    values: Floats
    pattern: Ints
    patterns: Bools

    @property
    def there(self) -> Bools:
        """Which samples are there, shape (days, n)."""
        return np.asarray(self.patterns[self.pattern])


def gather(residual: ArrayLike) -> Days:
    """Days of a residual (days, n), missing samples NaN."""
    z = np.asarray(residual, float)
    if z.ndim != 2 or z.size == 0:
        raise RividError(f"residual has shape {z.shape}: expected (days, n)")
    there = ~np.isnan(z)
    values = np.where(there, z, 0.0)
    if not np.isfinite(values).all():
        raise RividError("residual is infinite somewhere: expected numbers, and NaN for missing samples")
    seen: dict[bytes, int] = {}
    pattern = np.array([seen.setdefault(row.tobytes(), len(seen)) for row in there], np.int64)
    first = np.unique(pattern, return_index=True)[1]
    return Days(values, pattern, there[first])


def lanes(pattern: Ints, patterns: Bools) -> tuple[Ints, Ints, Bools]:
    """Put days in lanes, those with the same gaps next to each other.

    `pattern` (days,) is the index of each day's row in `patterns` (k, n); where nearly all days differ, each
    counts as a pattern.

    Returns
    -------
    order : ndarray of int, shape (days,)
        Day at each place.
    ends : ndarray of int, shape (m + 1,)
        First place of each pattern of gaps, and the number of days.
    there : ndarray of bool, shape (n, m)
        Which samples are present.
    """
    days = len(pattern)
    order = np.argsort(pattern, kind="stable")
    kept, first = np.unique(pattern[order], return_index=True)
    if 2 * len(kept) > days:
        order, kept, first = np.arange(days), pattern, np.arange(days)
    ends = np.append(first, days).astype(np.int64)
    return order.astype(np.int64), ends, np.ascontiguousarray(patterns[kept].T)


@njit(cache=True, error_model="numpy")
def gains(there: Bools, systems: Floats, diffuse: bool, keep: bool) -> tuple[Floats, Floats, Floats]:
    """Gains of each system and pattern of samples that are present.

    `there` has the shape (n, m), `systems` (q, 7): the first seven numbers of a :class:`System` each; `keep`:
    whether to return the filtered covariances.

    Returns
    -------
    K : ndarray, shape (3, n, q m)
        Gains of x, w and s; column i m + j is of system i and pattern j.
    S : ndarray, shape (n, q m)
        Innovation variances; 0 where a sample is missing or only sets the start.
    P : ndarray, shape (6, n, q m) or (6, 0, q m)
        Filtered covariances: xx, xw, xs, ww, ws, ss.
    """
    n, many = there.shape
    lanes = len(systems) * many
    c, phi, psi, walk = np.empty(lanes), np.empty(lanes), np.empty(lanes), np.empty(lanes)
    ww, ss, gauge = np.empty(lanes), np.empty(lanes), np.empty(lanes)
    for i in range(lanes):
        c[i], phi[i], psi[i], walk[i], ww[i], ss[i], gauge[i] = systems[i // many]
    new_w, new_s = (1.0 - phi * phi) * ww, (1.0 - psi * psi) * ss
    xx, xw, xs, ws = np.zeros(lanes), np.zeros(lanes), np.zeros(lanes), np.zeros(lanes)
    started = np.full(lanes, not diffuse)
    K, S, kept = np.empty((3, n, lanes)), np.empty((n, lanes)), np.empty((6, n if keep else 0, lanes))
    for k in range(n):
        for i in range(lanes):
            here = there[k, i % many]
            update, start = here and started[i], here and not started[i]
            h0, h1, h2 = xx[i] + xs[i], xw[i] + ws[i], xs[i] + ss[i]
            V = h0 + h2 + gauge[i]
            g0, g1, g2 = h0 / V, h1 / V, h2 / V
            K[0, k, i] = g0 if update else (1.0 if start else 0.0)
            K[1, k, i] = g1 if update else 0.0
            K[2, k, i] = g2 if update else 0.0
            S[k, i] = V if update else 0.0
            a = xx[i] - g0 * h0 if update else (ss[i] + gauge[i] if start else xx[i])
            b = xw[i] - g0 * h1 if update else (-ws[i] if start else xw[i])
            d = xs[i] - g0 * h2 if update else (-ss[i] if start else xs[i])
            e = ww[i] - g1 * h1 if update else ww[i]
            f = ws[i] - g1 * h2 if update else ws[i]
            g = ss[i] - g2 * h2 if update else ss[i]
            if keep:
                kept[0, k, i], kept[1, k, i], kept[2, k, i] = a, b, d
                kept[3, k, i], kept[4, k, i], kept[5, k, i] = e, f, g
            started[i] = started[i] or here
            # F P F' + Q, F = [[1, c, 0], [0, phi, 0], [0, 0, psi]]
            xx[i] = a + c[i] * (2.0 * b + c[i] * e) + walk[i]
            xw[i] = phi[i] * (b + c[i] * e)
            xs[i] = psi[i] * (d + c[i] * f)
            ww[i] = phi[i] * phi[i] * e + new_w[i]
            ws[i] = phi[i] * psi[i] * f
            ss[i] = psi[i] * psi[i] * g + new_s[i]
    return K, S, kept


LOG_2PI = float(np.log(2.0 * np.pi))


@njit(cache=True, error_model="numpy")
def log_likelihoods(values: Floats, ends: Ints, there: Bools, systems: Floats, diffuse: bool) -> Floats:
    """Log-likelihood of each system and day, shape (q, days), without the sample that sets a day's start.

    `values` (n, days) has 0 where a sample is missing and days in the order of :func:`lanes`, which gives
    `ends` and `there`; `systems` has the shape (q, 7).
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

    `columns` (p, days, n) may hold anything where a sample is missing; `order`, `ends` and `there` are those
    of :func:`lanes`, `systems` has the shape (1, 7). Also whether all samples that are present are finite.
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


@njit(cache=True, error_model="numpy")
def filtered(Z: Floats, pattern: Ints, K: Floats, m: System) -> tuple[Floats, Floats]:
    """Filtered states (days, n, 3) and innovations (days, n) [m or m3/s].

    `Z` (days, n) has 0 where a sample is missing; `pattern` (days,) is the lane of K (3, n, lanes) for each
    day.
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
    variance of x is not followed there (NaN). Arguments as of :func:`filtered` and from :func:`gains`.
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
    """Their variances (n, 3), which depend on the gaps alone."""
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
