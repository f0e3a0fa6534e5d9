"""Test days without outflow: evidence against dense likelihoods, calibration, refusals."""

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.signal import lfilter
from scipy.stats import norm

from rivid.core.posterior.blind import (
    DECAYS,
    FADING,
    LENGTHS,
    STRENGTHS,
    TEMPERATURE,
    blind_evidence,
    blind_fir,
    blind_noises,
    posterior_blind,
    smooth_weights,
)
from rivid.core.posterior.front import SHARES
from rivid.core.settings import PosteriorSettings
from rivid.errors import RividError
from tests import examples
from tests.core.posterior_days import linear_days, wave_days

LAGS, FIRST, LAST = 20, 1, 6


def dense(u, y, model):
    """Return ln p(y) at the best s2 with f and theta in the covariance, and the mean of f and theta."""
    b, length, strength, decay, d, w = model
    a, c = blind_noises()[b]
    n = len(y) - LAGS
    white = lfilter(a, c, u - u[0])
    X = np.stack([white[LAGS - k : len(u) - k] for k in range(1, LAGS + 1)], axis=1)
    centred = np.linalg.qr(np.column_stack([np.ones(n), np.eye(n)[:, :-1]]))[0][:, 1:]
    X, z = centred.T @ X, centred.T @ lfilter(a, c, y - y[0])[LAGS:]
    m = n - 1
    lag = np.arange(1, LAGS + 1)
    K = np.sqrt(FADING) ** (lag[:, None] + lag) * toeplitz(np.exp(-0.5 * ((lag - 1) / LENGTHS[length]) ** 2))
    K *= STRENGTHS[strength] * LAGS / np.trace(X.T @ X)

    def jump(at):
        return np.where(lag >= at, DECAYS[decay] ** np.maximum(lag - at, 0.0), 0.0)

    share = SHARES[w]
    s = share * jump(FIRST + d + 1) + (1 - share) * jump(FIRST + d + 2)
    cov = np.eye(m) + X @ K @ X.T
    x = X @ s
    prior = m / (x @ np.linalg.solve(cov, x))
    both = cov + prior * np.outer(x, x)
    factor = cho_factor(both, lower=True)
    solved = cho_solve(factor, z)
    rss = z @ solved
    log_det = 2 * np.log(np.diag(factor[0])).sum()
    theta, variance = prior * (x @ solved), prior - prior**2 * (x @ cho_solve(factor, x))
    log = -0.5 * m * np.log(rss) - 0.5 * log_det - 0.5 * np.log(m)
    log += np.log(2) + norm.logcdf(max(theta / np.sqrt(variance * rss / m), -30))
    h = K @ X.T @ solved + s * theta
    spread = K + prior * np.outer(s, s)
    spread = spread - spread @ X.T @ cho_solve(factor, X @ spread)
    none = -0.5 * m * np.log(z @ np.linalg.solve(cov, z)) - 0.5 * np.linalg.slogdet(cov)[1] - 0.5 * np.log(m)
    return log, none, h, np.sqrt(np.diag(spread) * rss / m)


@pytest.mark.parametrize("days", [linear_days, wave_days])
@pytest.mark.parametrize("seed", range(examples(3, 1)))
def test_evidence_is_the_dense_likelihood_with_the_response_integrated_out(days, seed):
    u, y, _, _ = days(1, seed, 150)
    fronts, nothing, _ = blind_evidence(u[0], y[0], FIRST, LAST, LAGS)
    assert fronts.shape[-2:] == (LAST - FIRST + 1, len(SHARES))
    rng = np.random.default_rng(seed)
    for _ in range(15):
        model = tuple(int(rng.integers(k)) for k in fronts.shape)
        log, none, _, _ = dense(u[0], y[0], model)
        assert fronts[model] == pytest.approx(log, abs=2e-3)
        assert nothing[model[:3]] == pytest.approx(none, abs=2e-3)


@pytest.mark.parametrize("days", [linear_days, wave_days])
def test_the_response_is_the_mean_of_the_likeliest_models(days):
    u, y, _, _ = days(1, 4, 150)
    fronts, _, sums = blind_evidence(u[0], y[0], FIRST, LAST, LAGS)
    belongs = np.ones(fronts.shape[-2:], bool)
    h, sd = blind_fir(fronts, sums, len(u[0]) - LAGS - 1, FIRST, belongs)
    order = np.argsort(-fronts, axis=None)[:4]
    models = [np.unravel_index(i, fronts.shape) for i in order]
    logs = np.array([fronts[m] for m in models])
    weight = np.exp((logs - logs.max()) / TEMPERATURE)
    weight /= weight.sum()
    slow = [dense(u[0], y[0], m)[2:] for m in models]
    H, S = (np.array([part[i] for part in slow]) for i in range(2))
    scale = np.abs(h).max()
    assert h[0] == 0.0
    assert np.allclose(h[1:], weight @ H, atol=2e-3 * scale)
    assert np.allclose(sd[1:] ** 2, weight @ (S**2 + (H - weight @ H) ** 2), atol=2e-3 * scale**2)


def test_weights_are_the_flattened_sum_over_all_models():
    s = PosteriorSettings()
    u, y, _, _ = wave_days(1, 3, 200)
    fronts, nothing, _ = blind_evidence(u[0], y[0], FIRST, LAST, LAGS)
    weight, link = smooth_weights(fronts, nothing, s)
    slow = np.zeros(weight.shape)
    top = fronts.max()
    for model in np.ndindex(fronts.shape):
        w = model[-1]
        prior = (1 - s.sharp) / len(SHARES) + (s.sharp if w == 0 else 0)
        slow[model[1], model[4], model[5]] += prior * np.exp((fronts[model] - top) / TEMPERATURE)
    assert np.allclose(weight, slow / slow.sum())
    per_model = slow.sum() / slow.shape[1] / np.prod(fronts.shape[:4])
    none = np.exp((nothing - top) / TEMPERATURE).mean()
    assert link == pytest.approx(per_model / (per_model + none))


def test_the_front_of_a_wave_is_found_without_the_outflow():
    u, y, _, places = wave_days(24, 5)
    found = posterior_blind(u, y)
    ok = found.status == "ok"
    # a front at place x changes the level at sample ceil(x): half a sample on both sides is right
    assert ok.mean() > 0.3
    assert (np.abs(found.place - places - 0.25)[ok] < 0.9).mean() > 0.9


@pytest.mark.parametrize("days", [linear_days, wave_days])
def test_shuffled_days_are_never_sure(days):
    u, y, _, _ = days(examples(24, 12), 6)
    found = posterior_blind(np.roll(u, 7, axis=0), y)
    assert not (found.status == "ok").any()
    assert np.nanmax(found.right) < 0.6


def test_a_still_day_has_a_reason_and_neighbours_and_units_do_not_matter():
    u, y, _, _ = linear_days(6, 8)
    all_days, one = posterior_blind(u, y), posterior_blind(u[4:5], y[4:5])
    assert np.allclose(all_days.probability.sum(axis=1), 1.0)
    assert all_days.fir.shape == (6, PosteriorSettings().order)
    assert (all_days.fir_sd > 0).any(axis=1).all()
    assert np.array_equal(all_days.probability[4], one.probability[0])
    assert np.array_equal(all_days.fir[4], one.fir[0])
    other = posterior_blind(3.0 * u, 100.0 * y - 7.0)
    assert np.allclose(all_days.probability, other.probability, atol=1e-5)
    u[2] = 250.0
    found = posterior_blind(u, y)
    assert found.message[2] == "inflow or level does not move"
    assert np.isnan(found.probability[2]).all() and found.link[2] == 0.0
    assert np.array_equal(np.delete(found.probability, 2, 0), np.delete(all_days.probability, 2, 0))


@pytest.mark.filterwarnings("error")
def test_a_level_that_does_not_move_makes_no_warning():
    u, y, _, _ = linear_days(2, 8)
    y[1] = 128.0
    assert posterior_blind(u, y).message[1] == "inflow or level does not move"


def test_longer_ranges_need_longer_days():
    u, y, _, _ = wave_days(2, 1, 120)
    assert posterior_blind(u, y, PosteriorSettings(d_max=10, order=20)).candidates[-1] == 10
    with pytest.raises(RividError, match="d_max = 25"):
        posterior_blind(u, y, PosteriorSettings(d_max=25, order=40))
    with pytest.raises(RividError, match="level has shape"):
        posterior_blind(u, y[:, :-1])
