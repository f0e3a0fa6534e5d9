"""The Kalman filter of one day's noise: its matrices, days with the same gaps, and their gains.

The state is (x, w, s): level error, unknown inflow, level-type noise. A sample reads z = x + s + e, and

    x_{k+1} = x_k + c w_k + v_k,    w_{k+1} = phi w_k + ...,    s_{k+1} = psi s_k + ...,

w and s stationary from the first sample on. x starts diffuse, exactly: the first sample that is there sets
x = z - s - e, counts nothing, and its innovation is 0 (Durbin and Koopman, Time series analysis by state
space methods, ch. 5). Gains depend on which samples are there, not on what they read: days with the same
gaps share them.

A sample waits for the one before it, a day for no other. So the innermost loops of all that is compiled here,
in `kalman_days.py` and in `kalman_smoother.py` go over what does not wait: days, patterns of gaps, systems.
Importing any of the three loads numba.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from rivid.errors import RividError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


class System(NamedTuple):
    """The matrices' entries: c [s/m2], memories phi and psi a sample, variances of v, w, s and e.

    `diffuse` is whether nothing is known of x at the start.
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
    """Days of a residual (days, n) whose missing samples are NaN."""
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


class Lanes(NamedTuple):
    """Days side by side, those with the same gaps as neighbours.

    Attributes
    ----------
    order : ndarray of int, shape (days,)
        Which day stands at each place.
    ends : ndarray of int, shape (m + 1,)
        Places at which each pattern of gaps begins, and the number of days.
    there : ndarray of bool, shape (n, m)
        Which samples are there.
    """

    order: Ints
    ends: Ints
    there: Bools


def lanes(pattern: Ints, patterns: Bools) -> Lanes:
    """Put days side by side.

    Parameters
    ----------
    pattern : ndarray of int, shape (days,)
    patterns : ndarray of bool, shape (k, n)
        One that no day has is left out; where nearly all are different, each day counts as a pattern.
    """
    days = len(pattern)
    order = np.argsort(pattern, kind="stable")
    kept, first = np.unique(pattern[order], return_index=True)
    if 2 * len(kept) > days:
        order, kept, first = np.arange(days), pattern, np.arange(days)
    ends = np.append(first, days).astype(np.int64)
    return Lanes(order.astype(np.int64), ends, np.ascontiguousarray(patterns[kept].T))


@njit(cache=True, error_model="numpy")
def gains(there: Bools, systems: Floats, diffuse: bool, keep: bool) -> tuple[Floats, Floats, Floats]:
    """Gains of each system and pattern of samples that are there.

    Parameters
    ----------
    there : ndarray of bool, shape (n, m)
    systems : ndarray, shape (q, 7)
        The first seven numbers of a :class:`System` each.
    diffuse : bool
    keep : bool
        Whether the filtered covariances are wanted.

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
