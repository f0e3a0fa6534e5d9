"""Small days of known delay: a store, and a pool with a jump of the level as the wave arrives."""

import numpy as np


def commands(rng, n, N):
    """Draw held steps of the inflow, and an outflow that follows it late and in steps."""
    steps = rng.normal(size=(n, N)) * (rng.random((n, N)) < 0.15) * 15
    u = 300 + np.cumsum(steps, axis=1).round()
    o = np.empty_like(u)
    for i in range(n):
        late = rng.integers(2, 12)
        o[i] = 300 + np.repeat(np.append(np.zeros(late), u[i, :-late] - 300)[:: late + 3], late + 3)[:N]
    return u, o


def shifted(u, place):
    """Return u[t - place], held between samples and averaged over each one; ``place = d + 1 - w``."""
    d = int(np.floor(place))
    w = d + 1 - place
    v = np.empty_like(u)
    for lag, share, begin in ((d + 1, w, True), (d + 2, 1 - w, False)):
        part = share * np.concatenate([np.repeat(u[:, :1], lag, axis=1), u[:, :-lag]], axis=1)
        v = part if begin else v + part
    return v


def linear_days(n, seed, N=600, place=None, noise=0.003, weather=1.0):
    """Simulate (8) with gauge noise and a drifting unlogged inflow; return u, y, o and the travel times."""
    rng = np.random.default_rng(seed)
    u, o = commands(rng, n, N)
    places = rng.uniform(2.0, 7.0, n) if place is None else np.full(n, place)
    drift = np.zeros((n, N))
    for k in range(1, N):
        drift[:, k] = 0.98 * drift[:, k - 1] + weather * 0.2 * rng.normal(size=n)
    y = np.empty_like(u)
    for i in range(n):
        before = np.append(o[i, :1], o[i, :-1])
        y[i] = 130 + np.cumsum(shifted(u[i : i + 1], places[i])[0] - before + drift[i]) * 2e-4
    return u, y + noise * rng.normal(size=y.shape), o, places


def wave_days(n, seed, N=600, place=None, noise=0.002):
    """Simulate a pool of first order with a level that jumps as the front arrives."""
    rng = np.random.default_rng(seed)
    u, o = commands(rng, n, N)
    places = rng.uniform(2.0, 7.0, n) if place is None else np.full(n, place)
    y = np.zeros_like(u)
    for i in range(n):
        v = shifted(u[i : i + 1], places[i])[0] - 300
        for k in range(1, N):
            y[i, k] = 0.9 * y[i, k - 1] + 1e-3 * v[k] - 9e-4 * (o[i, k - 1] - 300) + 5e-4 * rng.normal()
    return u, 130 + y + noise * rng.normal(size=y.shape), o, places
