"""Whitened sums against the columns themselves."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rivid.core.posterior.noise import daily_sine, river_noises, whitened_sums


@pytest.mark.parametrize("seed", range(3))
def test_sums_are_those_of_the_lagged_columns(seed):
    rng = np.random.default_rng(seed)
    u, y = 100 + np.cumsum(rng.normal(size=(2, 200)), axis=1), np.cumsum(rng.normal(size=200))
    warm, n_lags = 30, 25
    sums = whitened_sums(u, y, daily_sine(200, 96), warm, n_lags, river_noises())
    rows = np.arange(warm, 200)
    for b, (a, c) in enumerate(river_noises()):
        Z = np.column_stack([np.ones(170), *(lfilter(a, c, x)[rows] for x in daily_sine(200, 96))])
        Q = np.linalg.qr(Z)[0]
        z = lfilter(a, c, y - y[0])[rows]
        for i in range(2):
            white = lfilter(a, c, u[i] - u[i, 0])
            X = np.stack([white[rows - k] for k in range(n_lags + 1)], axis=1)
            size = np.abs(X.T @ X).max()
            assert np.allclose(sums.uu[i, b], X.T @ X, atol=1e-10 * size)
            assert np.allclose(sums.uy[i, b], X.T @ z, atol=1e-10 * np.sqrt(size * (z @ z)))
            assert np.allclose(abs(sums.uz[i, b]), abs(X.T @ Q), atol=1e-8 * np.sqrt(size))
        assert sums.yy[b] == pytest.approx(z @ z)
        assert np.allclose(abs(sums.yz[b]), abs(Q.T @ z), atol=1e-8 * np.sqrt(z @ z))


@pytest.mark.parametrize("which", range(len(river_noises())))
def test_a_kind_of_noise_is_whitened_by_its_filter(which):
    a, c = river_noises()[which]
    e = np.random.default_rng(which).normal(size=500)
    assert np.allclose(lfilter(a, c, lfilter(c, a, e)), e, atol=1e-6)
    assert (np.abs(np.roots(c)) < 1).all()
    assert a[0] == c[0] == 1.0
