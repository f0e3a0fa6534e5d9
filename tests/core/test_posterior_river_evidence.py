"""Evidence of a river's response against dense Gaussian likelihoods."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter
from scipy.stats import multivariate_normal, norm

from rivid.core.posterior.noise import SINE, daily_sine, river_noises, whitened_sums
from rivid.core.posterior.response import response_grid
from rivid.core.posterior.river import evidence, marginal, nothing
from rivid.core.settings import RiverSettings
from tests.core.river_windows import river_windows

GAIN, SD = 1.0, 0.35


def dense(y, x, s2):
    """ln p(y) at one noise variance: the gain normal, then what its cut at zero takes and gives."""
    cov = s2 * np.eye(len(y)) + SD**2 * np.outer(x, x)
    log = multivariate_normal.logpdf(y, GAIN * x, cov)
    variance = 1.0 / (x @ x / s2 + 1.0 / SD**2)
    mean = variance * (x @ y / s2 + GAIN / SD**2)
    return log + norm.logsf(0, mean, np.sqrt(variance)) - norm.logsf(0, GAIN, SD)


@pytest.mark.parametrize("true_gain", [1.0, 0.1, -0.5])
@pytest.mark.parametrize("seed", range(3))
def test_marginal_is_the_best_dense_likelihood_over_the_noise_variance(seed, true_gain):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=60)
    y = true_gain * x + rng.normal(size=60) * 0.7
    found = marginal(np.array([y @ y]), np.array([x @ y]), np.array([x @ x]), 60, GAIN, SD)
    best = minimize_scalar(lambda l: -dense(y, x, np.exp(l)), bounds=(-4, 4), method="bounded")
    assert found.log[0] == pytest.approx(-best.fun, abs=0.1)
    assert found.log[0] <= -best.fun + 1e-9


def test_the_dense_likelihood_is_an_integral_over_the_gain():
    rng = np.random.default_rng(7)
    x = rng.normal(size=8)
    y = 0.3 * x + rng.normal(size=8)

    def at(g):
        prior = norm.pdf(g, GAIN, SD) / norm.sf(0, GAIN, SD)
        return prior * np.exp(norm.logpdf(y, g * x, 0.9).sum())

    assert dense(y, x, 0.81) == pytest.approx(np.log(quad(at, 0, 4)[0]), abs=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_evidence_of_a_window_is_that_of_its_whitened_columns(seed):
    s = RiverSettings(d_max=12, warm=40)
    u, y, _ = river_windows(1, seed, days=1)
    u, y = u[0, 56:], y[0, 56:]
    n = len(u) - s.warm
    grid = response_grid(s)
    sums = whitened_sums(u[None], y, daily_sine(len(u), 96), s.warm, s.n_lags, river_noises())
    found, none = evidence(sums, grid, n, GAIN, SD), nothing(sums, n)
    rng = np.random.default_rng(seed)
    for _ in range(20):
        b, shape, place = (int(rng.integers(k)) for k in (len(river_noises()), *grid.h.shape[:2]))
        a, c = river_noises()[b]
        passed = lfilter(a, c, np.convolve(u - u[0], grid.h[shape, place])[: len(u)])[s.warm :]
        seen = lfilter(a, c, y - y[0])[s.warm :]
        beside = [lfilter(a, c, x)[s.warm :] for x in daily_sine(len(u), 96)]
        for sine in (0, 1):
            columns = SINE if sine else 1
            Q = np.linalg.qr(np.column_stack([np.ones(n), *beside])[:, :columns])[0]
            x, z = passed - Q @ (Q.T @ passed), seen - Q @ (Q.T @ seen)
            slow = marginal(np.array([z @ z]), np.array([x @ z]), np.array([x @ x]), n, GAIN, SD)
            penalty = 0.5 * columns * np.log(n)
            assert found.log[0, b, sine, shape, place] == pytest.approx(slow.log[0] - penalty, abs=1e-5)
            best = -0.5 * n * (np.log(2 * np.pi * (z @ z) / n) + 1)
            assert none[b, sine] == pytest.approx(best - penalty, abs=1e-6)


def test_leaving_out_what_cannot_count_changes_nothing_that_does():
    s = RiverSettings(d_max=12, warm=40)
    u, y, _ = river_windows(1, 5, days=1, t50=7.0)
    u, y = u[0, 56:], y[0, 56:]
    n, grid = len(u) - s.warm, response_grid(s)
    sums = whitened_sums(u[None], y, daily_sine(len(u), 96), s.warm, s.n_lags, river_noises())
    every, some = (evidence(sums, grid, n, GAIN, SD, within).log for within in (np.inf, 30.0))
    kept = np.isfinite(some)
    assert 0 < kept.mean() < 0.8
    assert np.array_equal(some[kept], every[kept])
    assert (every[~kept] < every.max() - 25.0).all()
