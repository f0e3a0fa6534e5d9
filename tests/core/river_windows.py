"""Small rivers of known travel time: a gamma response, steps of the flow, drifting springs, noise."""

import numpy as np
from scipy.stats import gamma

WARM = 96


def river_windows(n, seed, days=3, shape=20.0, noise=0.3, gain=1.0, t50=None):
    """Return u, y of shape (n, WARM + 96 days), and t50 [samples]."""
    rng = np.random.default_rng(seed)
    N = 300 + WARM + 96 * days
    t50 = rng.uniform(4.0, 28.0, n) if t50 is None else np.full(n, t50)
    u, y = np.empty((n, N)), np.empty((n, N))
    lag = np.arange(200)
    for i in range(n):
        u[i] = 100 + 30 * np.repeat(rng.normal(size=N // 9 + 1), 9)[:N]
        u[i] = np.maximum(np.convolve(u[i], np.ones(4) / 4, mode="same"), 10)
        scale = t50[i] / gamma.ppf(0.5, shape)
        F = gamma.cdf(np.append(lag - 0.5, lag[-1] + 0.5), shape, scale=scale)
        y[i] = 5 + gain * np.convolve(u[i], np.diff(F))[:N]
        y[i] += np.cumsum(rng.normal(size=N)) * 0.1 + noise * rng.normal(size=N)
    return u[:, 300:], y[:, 300:], t50
