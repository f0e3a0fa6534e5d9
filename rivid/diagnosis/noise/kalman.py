"""Kalman filter of one day's noise: gains, innovations, likelihood and smoothing.

The state is (x, w, s): level error, unknown inflow, level-type noise. A reading is z = x + s + e, and

    x_{k+1} = rho x_k + c w_k + v_k,    w_{k+1} = phi w_k + ...,    s_{k+1} = psi s_k + ...,

with w and s stationary from the first sample on. The innovation of w enters s as well, `wave` times. The
variance of v is that of the walk plus the response's misfit times the activity of the flows. In a pool rho is
1, and x has an exact diffuse start: the first sample present sets x = z - s - e, does not count, and has the
innovation 0 (Durbin and Koopman, Time series analysis by state space methods, ch. 5). In a river reach x is
w after its way to the gauge, stationary as well, and s has the misfit.

A sample depends on the one before it; days are independent. The innermost loops of all compiled functions
here therefore run over days or columns. Arrays along which they run have a row for each sample: (n, days).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from rivid.errors import RividError
from rivid.types import Bools, Floats


class System(NamedTuple):
    """Entries of the matrices: c [s/m2], memories phi and psi per sample, variances of v, w, s and e.

    `misfit` is the variance of v per unit of the activity of the flows, `wave` [m per m3/s] the share of s in
    the innovation of w, `rho` the memory of x per sample; `diffuse` is whether x is unknown at the start.
    """

    c: float
    phi: float
    psi: float
    walk: float
    inflow: float
    level: float
    gauge: float
    misfit: float
    wave: float
    rho: float
    diffuse: bool


def gather(residual: ArrayLike) -> tuple[Floats, Bools]:
    """Return a residual (days, n) with zeros for missing samples (NaN), and which samples are present."""
    z = np.asarray(residual, float)
    there = ~np.isnan(z)
    values = np.where(there, z, 0.0)
    if not np.isfinite(values).all():
        raise RividError("residual is infinite somewhere: expected numbers, and NaN for missing samples")
    return values, there


@njit(cache=True, error_model="numpy")
def innovation(
    phi: float, psi: float, inflow: float, level: float, wave: float
) -> tuple[float, float, float, float, float]:
    """Return the covariances ww, ws and ss of a sample's innovations, and the stationary ws and ss."""
    new_w = (1.0 - phi * phi) * inflow
    new_ws, new_s = wave * new_w, (1.0 - psi * psi) * level + wave * wave * new_w
    return new_w, new_ws, new_s, new_ws / (1.0 - phi * psi), new_s / (1.0 - psi * psi)


@njit(cache=True, error_model="numpy")
def start_of(c: float, phi: float, rho: float, inflow: float, diffuse: bool) -> tuple[float, float]:
    """Return the variance of x at the start, stationary or before its first sample, and its covariance xw."""
    if diffuse:
        return 0.0, 0.0
    xw = phi * c * inflow / (1.0 - phi * rho)
    return c * (2.0 * rho * xw + c * inflow) / (1.0 - rho * rho), xw


@njit(cache=True, error_model="numpy")
def gains(there: Bools, activity: Floats, m: System, keep: bool) -> tuple[Floats, Floats, Floats]:
    """Compute the gains of each day; `there` (n, days) marks samples present, `activity` (n, days) [m2].

    Returns the gains K of x, w and s (3, n, days); the innovation variances S (n, days), 0 where a sample is
    missing or only sets the start; and, with `keep`, the filtered covariances P xx, xw, xs, ww, ws and ss
    (6, n, days), else (6, 0, days).
    """
    n, days = there.shape
    c, phi, psi, rho, gauge = m.c, m.phi, m.psi, m.rho, m.gauge
    new_w, new_ws, new_s, start_ws, start_s = innovation(phi, psi, m.inflow, m.level, m.wave)
    of_x, of_s = (m.misfit, 0.0) if m.diffuse else (0.0, m.misfit)
    start_xx, start_xw = start_of(c, phi, rho, m.inflow, m.diffuse)
    xx, xw, xs, ws = np.full(days, start_xx), np.full(days, start_xw), np.zeros(days), np.full(days, start_ws)
    ww, ss, started = np.full(days, m.inflow), np.full(days, start_s), np.full(days, not m.diffuse)
    K, S, kept = np.empty((3, n, days)), np.empty((n, days)), np.empty((6, n if keep else 0, days))
    for k in range(n):
        for i in range(days):
            here = there[k, i]
            update, start = here and started[i], here and not started[i]
            h0, h1, h2 = xx[i] + xs[i], xw[i] + ws[i], xs[i] + ss[i]
            V = h0 + h2 + gauge
            g0, g1, g2 = h0 / V, h1 / V, h2 / V
            K[0, k, i] = g0 if update else (1.0 if start else 0.0)
            K[1, k, i] = g1 if update else 0.0
            K[2, k, i] = g2 if update else 0.0
            S[k, i] = V if update else 0.0
            a = xx[i] - g0 * h0 if update else (ss[i] + gauge if start else xx[i])
            b = xw[i] - g0 * h1 if update else (-ws[i] if start else xw[i])
            d = xs[i] - g0 * h2 if update else (-ss[i] if start else xs[i])
            e = ww[i] - g1 * h1 if update else ww[i]
            f = ws[i] - g1 * h2 if update else ws[i]
            g = ss[i] - g2 * h2 if update else ss[i]
            if keep:
                kept[0, k, i], kept[1, k, i], kept[2, k, i] = a, b, d
                kept[3, k, i], kept[4, k, i], kept[5, k, i] = e, f, g
            started[i] = started[i] or here
            # F P F' + Q, F = [[rho, c, 0], [0, phi, 0], [0, 0, psi]]
            xx[i] = rho * rho * a + c * (2.0 * rho * b + c * e) + m.walk + of_x * activity[k, i]
            xw[i] = phi * (rho * b + c * e)
            xs[i] = psi * (rho * d + c * f)
            ww[i] = phi * phi * e + new_w
            ws[i] = phi * psi * f + new_ws
            ss[i] = psi * psi * g + new_s + of_s * activity[k, i]
    return K, S, kept


LOG_2PI = float(np.log(2.0 * np.pi))
FACTORS = 8  # innovation variances multiplied before a logarithm is taken: each may be 1e38 times the gauge's


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc"}, nogil=True)
def log_likelihoods(values: Floats, activity: Floats, systems: Floats, diffuse: bool) -> Floats:
    """Compute the log-likelihood of each system and day (q, days), without the sample that sets x.

    `values` (n, days) is NaN where a sample is missing; `systems` (q, 10) has the first ten fields of a
    :class:`System` in each row. Gains and states are computed in one loop over the days, which compiles to
    vector instructions: nothing is stored for each sample.
    """
    n, days = values.shape
    out = np.empty((len(systems), days))
    xx, xw, xs, ww, ws, ss = (
        np.empty(days), np.empty(days), np.empty(days), np.empty(days), np.empty(days), np.empty(days)
    )  # fmt: skip
    x, w, s, started = np.empty(days), np.empty(days), np.empty(days), np.empty(days)
    total, size, count = np.empty(days), np.empty(days), np.empty(days)
    for i in range(len(systems)):
        c, phi, psi, walk, inflow, level, gauge, misfit, wave, rho = systems[i]
        of_x, of_s = (misfit, 0.0) if diffuse else (0.0, misfit)
        new_w, new_ws, new_s, start_ws, start_s = innovation(phi, psi, inflow, level, wave)
        start_xx, start_xw = start_of(c, phi, rho, inflow, diffuse)
        scale = 1.0 / gauge
        xx[:], xw[:], xs[:], ww[:], ws[:], ss[:] = start_xx, start_xw, 0.0, inflow, start_ws, start_s
        x[:], w[:], s[:], started[:] = 0.0, 0.0, 0.0, 0.0 if diffuse else 1.0
        total[:], size[:], count[:] = 0.0, 1.0, 0.0
        for k in range(n):
            z, moved = values[k], activity[k]
            for d in range(days):
                seen = 1.0 if z[d] == z[d] else 0.0
                read = z[d] if seen > 0.0 else 0.0
                update, start = seen * started[d], seen * (1.0 - started[d])
                h0, h1, h2 = xx[d] + xs[d], xw[d] + ws[d], xs[d] + ss[d]
                V = h0 + h2 + gauge
                f, v = update / V, read - x[d] - s[d]
                total[d] += v * v * f
                size[d] *= 1.0 + update * (V * scale - 1.0)
                count[d] += update
                a = (1.0 - start) * (xx[d] - f * h0 * h0) + start * (start_s + gauge)
                b = (1.0 - start) * (xw[d] - f * h0 * h1) - start * ws[d]
                g = (1.0 - start) * (xs[d] - f * h0 * h2) - start * ss[d]
                e, j, t = ww[d] - f * h1 * h1, ws[d] - f * h1 * h2, ss[d] - f * h2 * h2
                started[d] = max(started[d], seen)
                flow = w[d] + f * h1 * v
                x[d] = rho * (x[d] + (f * h0 + start) * v) + c * flow
                w[d] = phi * flow
                s[d] = psi * (s[d] + f * h2 * v)
                xx[d] = rho * rho * a + c * (2.0 * rho * b + c * e) + walk + of_x * moved[d]
                xw[d] = phi * (rho * b + c * e)
                xs[d] = psi * (rho * g + c * j)
                ww[d] = phi * phi * e + new_w
                ws[d] = phi * psi * j + new_ws
                ss[d] = psi * psi * t + new_s + of_s * moved[d]
            if k % FACTORS == FACTORS - 1 or k == n - 1:
                for d in range(days):
                    total[d] += np.log(size[d])
                    size[d] = 1.0
        for d in range(days):
            out[i, d] = -0.5 * (total[d] + count[d] * (LOG_2PI - np.log(scale)))
    return out


@njit(cache=True, error_model="numpy", nogil=True)
def innovations(columns: Floats, there: Bools, activity: Floats, m: System) -> tuple[Floats, bool]:
    """Compute innovations over their standard deviation, 0 where a sample is missing or only sets the start.

    `columns` (p, days, n) may have any value where a sample is missing; `there` and `activity` are (n, days).
    Also returns whether all samples present are finite.
    """
    p, days, n = columns.shape
    K, S, _ = gains(there, activity, m, False)
    c, phi, psi, rho = m.c, m.phi, m.psi, m.rho
    K0, K1, K2, root, here = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.bool_)
    out = np.empty(columns.shape)
    finite = True
    for d in range(days):
        for k in range(n):
            K0[k], K1[k], K2[k], here[k] = K[0, k, d], K[1, k, d], K[2, k, d], there[k, d]
            root[k] = 1.0 / np.sqrt(S[k, d]) if S[k, d] > 0.0 else 0.0
        for a in range(0, p, 4):  # four columns at once, the last one repeated
            i1, i2, i3 = min(a + 1, p - 1), min(a + 2, p - 1), min(a + 3, p - 1)
            z0, z1, z2, z3 = columns[a, d], columns[i1, d], columns[i2, d], columns[i3, d]
            o0, o1, o2, o3 = out[a, d], out[i1, d], out[i2, d], out[i3, d]
            x0 = x1 = x2 = x3 = w0 = w1 = w2 = w3 = s0 = s1 = s2 = s3 = 0.0
            for k in range(n):
                is_there, size, g0, g1, g2 = here[k], root[k], K0[k], K1[k], K2[k]
                v, x0, w0, s0 = _step(z0[k] if is_there else 0.0, x0, w0, s0, g0, g1, g2, c, phi, psi, rho)
                o0[k] = v * size
                v, x1, w1, s1 = _step(z1[k] if is_there else 0.0, x1, w1, s1, g0, g1, g2, c, phi, psi, rho)
                o1[k] = v * size
                v, x2, w2, s2 = _step(z2[k] if is_there else 0.0, x2, w2, s2, g0, g1, g2, c, phi, psi, rho)
                o2[k] = v * size
                v, x3, w3, s3 = _step(z3[k] if is_there else 0.0, x3, w3, s3, g0, g1, g2, c, phi, psi, rho)
                o3[k] = v * size
            finite = finite and np.isfinite(x0 + x1 + x2 + x3)  # a non-finite value stays in x
    return out, finite


@njit(cache=True, error_model="numpy")
def _step(
    z: float, x: float, w: float, s: float, g0: float, g1: float, g2: float, c: float, phi: float, psi: float,
    rho: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return the innovation of a sample, and the predicted x, w and s of the next one."""
    v = z - x - s
    flow = w + g1 * v
    return v, rho * (x + g0 * v) + c * flow, flow * phi, psi * (s + g2 * v)


@njit(cache=True, error_model="numpy")
def filtered(Z: Floats, K: Floats, m: System) -> tuple[Floats, Floats]:
    """Compute filtered states (days, n, 3) and innovations (days, n) [m or m3/s].

    `Z` (days, n) is 0 where a sample is missing; `K` is from :func:`gains`.
    """
    days, n = Z.shape
    states, v = np.empty((days, n, 3)), np.empty((days, n))
    for d in range(days):
        x = w = s = 0.0
        for k in range(n):
            v[d, k] = Z[d, k] - x - s
            x += K[0, k, d] * v[d, k]
            w += K[1, k, d] * v[d, k]
            s += K[2, k, d] * v[d, k]
            states[d, k, 0], states[d, k, 1], states[d, k, 2] = x, w, s
            x = m.rho * x + m.c * w
            w *= m.phi
            s *= m.psi
    return states, v


@njit(cache=True, error_model="numpy")
def smoothed(
    states: Floats, v: Floats, there: Bools, K: Floats, S: Floats, P: Floats, m: System
) -> tuple[Floats, Floats]:
    """Compute the unknown inflow given the whole day and its variance, (days, n) each.

    It is w, or x + s of a river reach. This is the Rauch-Tung-Striebel smoother in the form that inverts no
    covariance: with r and N accumulated backwards from the innovations, the mean is the filtered one + P F' r
    and the covariance P - P F' N F P. Before the first sample of a pool, only the memory of w runs backwards.
    Arguments as of :func:`filtered` and from :func:`gains`.
    """
    days, n = v.shape
    mean, variance = np.empty((days, n)), np.empty((days, n))
    for d in range(days):
        first = 0
        if m.diffuse:
            while first < n and not there[first, d]:
                first += 1
        _variances(variance[d], first, S[:, d], K[:, :, d], P[:, :, d], m)
        _means(mean[d], states[d], v[d], first, S[:, d], K[:, :, d], P[:, :, d], m)
    return mean, variance


@njit(cache=True, error_model="numpy")
def _means(
    out: Floats, states: Floats, v: Floats, first: int, S: Floats, K: Floats, P: Floats, m: System
) -> None:
    """Write the unknown inflow of one day (n,) given all of it."""
    n = len(v)
    h0, h1 = (0.0, 1.0) if m.diffuse else (1.0, 0.0)  # x + s or w
    r0 = r1 = r2 = 0.0
    for k in range(n - 1, first - 1, -1):
        r0, r1, r2 = m.rho * r0, m.c * r0 + m.phi * r1, m.psi * r2  # F' r
        q0 = h0 * (P[0, k] + P[2, k]) + h1 * P[1, k]
        q1 = h0 * (P[1, k] + P[4, k]) + h1 * P[3, k]
        q2 = h0 * (P[2, k] + P[5, k]) + h1 * P[4, k]
        out[k] = h0 * (states[k, 0] + states[k, 2]) + h1 * states[k, 1] + (q0 * r0 + q1 * r1 + q2 * r2)
        if S[k] > 0.0:
            read = v[k] / S[k] - (K[0, k] * r0 + K[1, k] * r1 + K[2, k] * r2)
            r0, r2 = r0 + read, r2 + read
    # the first sample sets x = z - s - e: what follows shows w and s before it
    _, _, _, ws, _ = innovation(m.phi, m.psi, m.inflow, m.level, m.wave)
    r1, r2 = r1, r2 - r0
    for k in range(first - 1, -1, -1):
        r1, r2 = m.phi * r1, m.psi * r2
        out[k] = m.inflow * r1 + ws * r2


@njit(cache=True, error_model="numpy")
def _variances(out: Floats, first: int, S: Floats, K: Floats, P: Floats, m: System) -> None:
    """Write its variance (n,), which depends on the gaps alone."""
    n = len(S)
    h = np.array([0.0, 1.0, 0.0]) if m.diffuse else np.array([1.0, 0.0, 1.0])
    F = np.array([[m.rho, m.c, 0.0], [0.0, m.phi, 0.0], [0.0, 0.0, m.psi]])
    H = np.array([1.0, 0.0, 1.0])
    N = np.zeros((3, 3))
    V = np.empty((3, 3))
    for k in range(n - 1, first - 1, -1):
        V[0, 0], V[1, 1], V[2, 2] = P[0, k], P[3, k], P[5, k]
        V[0, 1] = V[1, 0] = P[1, k]
        V[0, 2] = V[2, 0] = P[2, k]
        V[1, 2] = V[2, 1] = P[4, k]
        back = F @ V  # its transpose is P F'
        out[k] = max(h @ (V - back.T @ N @ back) @ h, 0.0)
        N = F.T @ N @ F
        if S[k] > 0.0:
            L = np.eye(3) - np.outer(K[:, k].copy(), H)
            N = L.T @ N @ L + np.outer(H, H) / S[k]
    _, _, _, ws, _ = innovation(m.phi, m.psi, m.inflow, m.level, m.wave)
    for k in range(first - 1, -1, -1):
        a, b = m.phi ** (first - k) * m.inflow, m.psi ** (first - k) * ws
        w = np.array([-b, a, b])  # covariance with the state at the first sample, which sets x = z - s - e
        out[k] = max(m.inflow - float(w @ N @ w), 0.0)
