"""Signals of the peers: deviations of a day, lagged copies, and easy days that each peer must get right."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Peer = Callable[[Floats, Floats, Floats, Ints], Ints]
"""``(u, y, o, candidates) -> delay``: arrays of shape (days, N), (D,) and (days,)."""


def deviations(*signals: Floats) -> list[Floats]:
    """Return each signal of shape (days, N) less its first sample."""
    return [np.asarray(x, float) - np.asarray(x, float)[:, :1] for x in signals]


def lagged(x: Floats, lags: Sequence[int] | range, rows: slice) -> Floats:
    """Return the columns x[k - lag], shape (rows, lags). `rows` starts at the longest lag or later."""
    return np.stack([x[rows.start - lag : rows.stop - lag] for lag in lags], axis=1)


def easy_days(
    days: int, delay: int, seed: int, memory: float = 1.0, n: int = 600, noise: float = 1e-3
) -> tuple[Floats, Floats, Floats]:
    """Simulate days in open loop that any method should estimate exactly: u, y and o of shape (days, n).

    Both commands are independent random steps. The level responds to the inflow ``delay + 1`` samples earlier
    and to the outflow one sample earlier. `memory` is the pole of the level: 1 is a store. All of the inflow
    acts in that one sample, so the travel time is `delay` samples up to its end: for `posterior`, the edge of
    two delays.
    """
    rng = np.random.default_rng([seed, delay])
    moves = (rng.random((2, days, n)) < 0.2) * rng.normal(scale=20.0, size=(2, days, n))
    for k in range(1, n):  # commands return to their mean, which keeps the level bounded
        moves[:, :, k] += 0.9 * moves[:, :, k - 1]
    u, o = 300.0 + np.round(moves)
    y = np.zeros((days, n))
    for k in range(1, n):
        inflow = u[:, max(k - delay - 1, 0)] - 300.0
        y[:, k] = memory * y[:, k - 1] + 2e-4 * (inflow - (o[:, k - 1] - 300.0))
    return u, 130.0 + y + noise * rng.normal(size=y.shape), o
