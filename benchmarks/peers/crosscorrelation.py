"""Cross-correlation after prewhitening: an autoregression makes the inflow white and filters all signals.

G. E. P. Box and G. M. Jenkins, "Time series analysis" (1976), chapter 11. The rise of the level is taken, for a
pool adds up; what the outflow explains of it, a sample and two samples later, is taken away first.
"""

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from benchmarks.peers.signals import Floats, Ints, deviations, lagged

MOST = 12
"""Highest order of the autoregression; the criterion of Akaike takes one up to it."""


def whitening(x: Floats) -> Floats:
    """Polynomial A of an autoregression ``A(q) x = e``, by the equations of Yule and Walker."""
    x = x - x.mean()
    n = len(x)
    r = np.array([x[lag:] @ x[: n - lag] for lag in range(MOST + 1)]) / n
    best, found = np.inf, np.ones(1)
    if r[0] <= 0.0:
        return found
    r[0] *= 1.0 + 1e-9
    for order in range(1, MOST + 1):
        a = solve_toeplitz(r[:order], r[1 : order + 1])
        score = n * np.log(max(float(r[0] - a @ r[1 : order + 1]), 1e-300)) + 2 * order
        if score < best:
            best, found = score, np.concatenate([[1.0], -a])
    return found


def delays(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """The delay of the highest correlation of the whitened inflow with what the filter leaves of the rise."""
    found = []
    for a, b, c in zip(*deviations(u, y, o), strict=True):
        filtered = [lfilter(whitening(a), 1.0, x) for x in (a, np.diff(b, prepend=b[0]), c)]
        rows = slice(int(candidates[-1]) + 2 + MOST, len(a))
        beside = np.column_stack([lagged(filtered[2], (1, 2), rows), np.ones(rows.stop - rows.start)])
        Q, _ = np.linalg.qr(beside)
        rise = filtered[1][rows] - Q @ (Q.T @ filtered[1][rows])
        inflow = lagged(filtered[0], [int(d) + 1 for d in candidates], rows)
        inflow = inflow - inflow.mean(axis=0)
        size = np.sqrt(np.maximum((inflow**2).sum(axis=0), 1e-300))
        found.append(candidates[int(np.argmax(inflow.T @ rise / size))])
    return np.array(found)
