"""ML and MAP against scipy's general least squares."""

import numpy as np
import pytest
from scipy.linalg import lstsq

from rivid.core.fir import map_fir, ml, second_difference
from rivid.errors import RividError
from tests.core.transcription import second_differences, toeplitz_matrix


def days(n, N=200, seed=0):
    """Random-walk inputs, and outputs of a decaying response with noise."""
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(size=(n, N)), axis=1)
    u -= u[:, :1]
    h = np.r_[0.0, -(0.9 ** np.arange(40))]
    h[6:] += 0.8 * 0.9 ** np.arange(35)
    y = np.stack([np.convolve(row, h)[:N] for row in u]) + rng.normal(scale=0.3, size=(n, N))
    return u, y - y[:, :1]


def test_second_difference_is_the_toeplitz_matrix_of_20():
    assert np.array_equal(second_difference(7), second_differences(7))


@pytest.mark.parametrize("seed", range(5))
def test_ml_is_least_squares(seed):
    u, y = days(4, seed=seed)
    result = ml(u, y, order=12)
    for i in range(4):
        U = toeplitz_matrix(u[i], 12)
        h, rss, _, singular = lstsq(U, y[i])
        assert np.allclose(result.fir[i], h, rtol=0, atol=1e-9 * np.abs(h).max())
        assert result.noise_variance[i] == pytest.approx(rss / len(y[i]), rel=1e-9)
        assert result.condition[i] == pytest.approx((singular[0] / singular[-1]) ** 2, rel=1e-6)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("alpha", [1e-2, 1.0, 1e4])
def test_map_is_least_squares_with_the_prior_as_rows(seed, alpha):
    u, y = days(3, seed=seed)
    result = map_fir(u, y, order=12, alpha=alpha)
    for i in range(3):
        rows = np.vstack([toeplitz_matrix(u[i], 12), np.sqrt(alpha) * second_differences(12)])
        h = lstsq(rows, np.r_[y[i], np.zeros(12)])[0]
        assert np.allclose(result.fir[i], h, rtol=0, atol=1e-9 * np.abs(h).max())
        rss = np.sum((y[i] - toeplitz_matrix(u[i], 12) @ h) ** 2)
        assert result.noise_variance[i] == pytest.approx(rss / len(y[i]), rel=1e-8)


def test_one_day_comes_without_an_axis_of_days():
    u, y = days(1)
    assert ml(u[0], y[0], order=12).fir.shape == (12,)
    assert ml(u[0], y[0], order=12).status == "ok"


def test_a_constant_input_is_unidentifiable_and_its_neighbours_are_not():
    u, y = days(3)
    u[1] = 0.0
    result = ml(u, y, order=12)
    assert result.status.tolist() == ["ok", "unidentifiable", "ok"]
    assert np.isnan(result.fir[1]).all()
    assert np.isfinite(result.fir[[0, 2]]).all()


@pytest.mark.parametrize(
    ("u", "y", "words"),
    [
        (np.zeros(50), np.zeros(49), "same shape"),
        (np.zeros((2, 2, 50)), np.zeros((2, 2, 50)), "expected"),
        (np.zeros(10), np.zeros(10), "needs more"),
        (np.full(50, np.nan), np.zeros(50), "not finite"),
    ],
)
def test_input_that_does_not_fit_is_told(u, y, words):
    with pytest.raises(RividError, match=words):
        ml(u, y, order=12)
