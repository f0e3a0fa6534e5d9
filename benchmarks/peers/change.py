"""Estimate the delay by a change point of the maximum-likelihood FIR, found by `ruptures`.

The FIR (17) is that of the rise of the level to both flows. In a store it is a pulse at lag d + 1; with waves
it is a front and what follows it. Its running sum is the step response, with a change of mean at the front.
The delay is at the larger upward change of the two found by `ruptures.Dynp`. Of a dozen variants, this one
was best on the development worlds.
"""

import numpy as np

from benchmarks.peers.signals import Floats, Ints, deviations, lagged

ORDER = 30
"""Lags of each response."""


def ml_fir(u: Floats, y: Floats, o: Floats, order: int) -> Floats:
    """Return h_u over lags 1 to `order`, by least squares on both flows and a constant."""
    rows = slice(order + 1, len(y))
    X = np.column_stack(
        [
            lagged(u, range(1, order + 1), rows),
            lagged(o, range(1, order + 1), rows),
            np.ones(rows.stop - rows.start),
        ]
    )
    return np.asarray(np.linalg.lstsq(X, np.diff(y)[rows.start - 1 :])[0][:order])


def delays(u: Floats, y: Floats, o: Floats, candidates: Ints) -> Ints:
    """Return the delay at the larger upward change of the step response, clipped to the candidates."""
    import ruptures

    order = max(ORDER, int(candidates[-1]) + 5)
    found = []
    for a, b, c in zip(*deviations(u, y, o), strict=True):
        step = np.cumsum(ml_fir(a, b, c, order))
        ends = ruptures.Dynp(model="l2", min_size=1, jump=1).fit(step).predict(n_bkps=2)
        means = [part.mean() for part in np.split(step, ends[:-1])]
        found.append(ends[int(np.argmax(np.diff(means)))])
    return np.asarray(np.clip(found, candidates[0], candidates[-1]), np.intp)
