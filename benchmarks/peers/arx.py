"""Estimate the delay by ARX(2,2) models with both inputs, one for each delay, as MATLAB's `delayest`."""

import numpy as np

from benchmarks.peers.signals import Floats, Ints, deviations, lagged


def delays(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """Return the delay of the model with the smallest residual.

    The model is ``y[k] = a1 y[k-1] + a2 y[k-2] + b1 u[k-d-1] + b2 u[k-d-2] + c1 o[k-1] + c2 o[k-2] + c``,
    with the same rows for every delay.
    """
    found = []
    rows = slice(int(candidates[-1]) + 3, y.shape[1])
    for a, b, c in zip(*deviations(u, y, o), strict=True):
        beside = np.column_stack(
            [lagged(b, (1, 2), rows), lagged(c, (1, 2), rows), np.ones(rows.stop - rows.start)]
        )
        Q, _ = np.linalg.qr(beside)
        target = b[rows] - Q @ (Q.T @ b[rows])
        inflow = lagged(a, range(int(candidates[0]) + 1, int(candidates[-1]) + 3), rows)
        inflow -= Q @ (Q.T @ inflow)
        left = [np.linalg.lstsq(inflow[:, i : i + 2], target)[1].sum() for i in range(len(candidates))]
        found.append(candidates[int(np.argmin(left))])
    return np.array(found)
