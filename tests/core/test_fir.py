"""Test ML and MAP against scipy's general least squares."""

import numpy as np
import pytest
from scipy.linalg import lstsq

from rivid.core.fir import half_time, map_fir, ml
from tests.core.transcription import second_differences, toeplitz_matrix


def days(n, N=200, seed=0):
    """Return random-walk inputs, and outputs of a decaying response with noise."""
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(size=(n, N)), axis=1)
    u -= u[:, :1]
    h = np.r_[0.0, -(0.9 ** np.arange(40))]
    h[6:] += 0.8 * 0.9 ** np.arange(35)
    y = np.stack([np.convolve(row, h)[:N] for row in u]) + rng.normal(scale=0.3, size=(n, N))
    return u, y - y[:, :1]


@pytest.mark.parametrize("free_start", [False, True])
@pytest.mark.parametrize("alpha", [0.0, 1e-2, 1.0, 1e4])
def test_the_fir_is_least_squares_with_the_prior_as_rows_and_a_free_start_as_a_constant(alpha, free_start):
    M, (u, y) = 12, days(12)
    y += 7.0 * free_start  # a state before the first sample
    found = map_fir(u, y, M, alpha, free_start=free_start) if alpha else ml(u, y, M, free_start=free_start)
    for i in range(12):
        U, z = toeplitz_matrix(u[i], M), y[i]
        if free_start:
            U, z = np.c_[U[M - 1 :], np.ones(len(z) - M + 1)], z[M - 1 :]
        prior = np.c_[np.sqrt(alpha) * second_differences(M), np.zeros((M, U.shape[1] - M))]
        solution = lstsq(np.vstack([U, prior]), np.r_[z, np.zeros(M)])[0]
        assert np.allclose(found.fir[i], solution[:M], rtol=0, atol=1e-9 * np.abs(solution[:M]).max())
        assert found.noise_variance[i] == pytest.approx(np.sum((z - U @ solution) ** 2) / len(z), rel=1e-8)
        X = U[:, :M] - U[:, :M].mean(axis=0) if free_start else U
        assert found.condition[i] == pytest.approx(np.linalg.cond(X.T @ X), rel=1e-6)


def test_a_free_start_is_exact_where_a_rest_start_is_not():
    rng = np.random.default_rng(3)
    u = np.cumsum(rng.normal(size=300))
    h = np.zeros(40)
    h[20:27] = 1 / 7
    y = np.convolve(u, h)[:300]
    u, y = u[60:] - u[60], y[60:] - y[60]
    free, rest = ml(u, y, 40, free_start=True).fir, ml(u, y, 40).fir
    assert np.abs(free - h).max() < 1e-9
    assert np.abs(rest - h).max() > 0.1 * h.max()
    assert half_time(free[None])[0] == pytest.approx(23.0, abs=1e-6)


@pytest.mark.parametrize("lag", [0.0, 3.0, 7.25, 12.5])
def test_half_time_of_a_pure_lag_is_the_lag(lag):
    k, part = int(lag), lag % 1
    h = np.zeros((1, 20))
    h[0, k], h[0, k + 1] = 1 - part, part
    assert half_time(3.0 * h)[0] == pytest.approx(lag, abs=0.5 * part + 1e-12)
    assert np.isnan(half_time(-h)[0])


def test_a_constant_input_is_unidentifiable_and_its_neighbours_are_not():
    u, y = days(3)
    u[1] = 0.0
    result = ml(u, y, order=12)
    assert result.status.tolist() == ["ok", "unidentifiable", "ok"]
    assert ml(u[0], y[0], order=12).fir.shape == (12,)
    assert np.isnan(result.fir[1]).all()
    assert np.isfinite(result.fir[[0, 2]]).all()
