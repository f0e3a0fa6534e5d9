"""Estimate the delay by cross-correlation after prewhitening by an autoregression of the inflow.

Source: G. E. P. Box and G. M. Jenkins, "Time series analysis" (1976), chapter 11. All signals are filtered.
The rise of the level is used, since a pool integrates. The part of it explained by the outflow, one and two
samples later, is removed before the correlation.
"""

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from benchmarks.peers.signals import Floats, Ints, deviations, lagged

MOST = 12
"""Highest order of the autoregression. Akaike's criterion selects one up to it."""


def whitening(x: Floats) -> Floats:
    """Return the polynomial A of an autoregression ``A(q) x = e``, by the Yule-Walker equations."""
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
    """Return the delay of the highest correlation of the whitened inflow with the filtered rise."""
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
