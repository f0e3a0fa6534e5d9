"""Test t50 of small rivers: accuracy, calibration, refusals."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter
from scipy.stats import multivariate_normal, norm

from rivid.core.posterior import response, river
from rivid.core.posterior.noise import SINE, daily_sine, river_noises, whitened_sums
from rivid.core.posterior.response import hastened, hayami, response_grids, responses
from rivid.core.posterior.river import LEAD_SHARE, LEADS, evidence, marginal, nothing, posterior_river
from rivid.core.settings import RiverSettings, lags_of
from rivid.errors import RividError
from tests import examples
from tests.core.river_windows import river_windows


@pytest.mark.parametrize(("days", "seed"), [(1, 1), (3, 2)])
def test_t50_of_rivers_that_are_no_member_of_a_family_is_found(days, seed):
    u, y, t50 = river_windows(examples(8, 5), seed, days)
    p = posterior_river(u, y)
    error = np.abs(p.place - t50)
    assert (p.status == "ok").all()
    assert np.median(error) < 0.3
    assert error.max() < 2.0
    assert ((p.place_low <= t50) & (t50 <= p.place_high)).mean() >= 0.75
    assert np.allclose(p.gain, 1.0, atol=0.25)
    assert (p.link > 0.95).all()


def test_t50_is_that_at_the_mean_inflow_of_the_window():
    """Regression: of an inflow with peaks it was that at the median, longer, beside the mean in tables."""
    rng = np.random.default_rng(1)
    held = np.repeat(80.0 + 140.0 * (rng.random((6, 34)) < 0.2), 12, axis=1)  # the mean is above the median
    u = np.stack([np.convolve(one, np.ones(12) / 12, "valid")[:384] for one in held])
    lead, t50 = LEADS[2], 14.0
    (h,) = responses(hayami, 0.2, np.array([t50]), 90)
    y = np.stack([np.convolve(hastened(one, one.mean(), lead), h)[: len(one)] for one in u])
    p = posterior_river(u, y + rng.normal(0.0, 0.3, y.shape))
    assert (lead * np.log(u.mean(axis=1) / np.median(u, axis=1)) > 0.8).all()
    assert np.median(np.abs(p.place - t50)) < 0.3
    assert ((p.place_low <= t50) & (t50 <= p.place_high)).all()


def test_a_window_has_probabilities_of_sum_one_a_set_of_nine_in_ten_and_a_response():
    u, y, t50 = river_windows(4, 5)
    p = posterior_river(u, y)
    assert np.allclose(p.probability.sum(axis=1), 1.0)
    assert np.array_equal(p.delay, np.floor(p.place + 0.5))
    assert (np.where(p.in_set, p.probability, 0.0).sum(axis=1) >= 0.9).all()
    assert (p.right >= p.probability.max(axis=1) - 1e-6).all()
    assert np.allclose(p.fir.sum(axis=1), p.gain)
    arrived = np.cumsum(p.fir, axis=1) / p.gain[:, None]
    half = [np.interp(0.5, row, np.arange(len(row)) + 0.5) for row in arrived]
    assert np.allclose(half, t50, atol=1.0)
    assert (p.fir_sd >= 0).all() and (p.fir_sd.max(axis=1) > 0.005).all()


def test_weights_are_the_flattened_evidence_of_every_model():
    s = RiverSettings(d_max=10, warm=40)
    u, y, _ = river_windows(1, 4, days=1)
    u, y = u[:, 56:], y[:, 56:]
    p = posterior_river(u, y, s)
    (grid,), n = response_grids(s), u.shape[1] - s.warm
    middle = np.mean(u[0])
    moved = np.stack([hastened(u[0], middle, lead) for lead in LEADS])
    sums = whitened_sums(moved, y[0], daily_sine(u.shape[1], 96), s.warm, s.n_lags, river_noises())
    found, none = evidence(sums, grid, n, s.gain, s.gain_sd)[0], nothing(sums, n)
    T = s.flattening(n)
    places, seen = np.zeros(len(grid.t50)), 0.0
    top = found.max()
    for t, place in enumerate(grid.t50):
        allowed = [i for i, lead in enumerate(LEADS) if lead <= LEAD_SHARE * place]
        for i, b, sine in product(allowed, range(len(river_noises())), (0, 1)):
            share = 1 / len(allowed) / len(river_noises()) / 2 / len(grid.t50)
            places[t] += share * (grid.prior @ np.exp((found[i, b, sine, :, t] - top) / T))
    seen = places.sum()
    link = seen / (seen + np.exp((none - top) / T).mean())
    assert p.link[0] == pytest.approx(link, abs=1e-9)
    rng = np.random.default_rng(0)
    draws = rng.choice(grid.t50, 400_000, p=places / seen)
    draws = draws + rng.normal(size=len(draws)) * (s.spread + s.spread_share * draws)
    wanted = np.quantile(draws, [0.05, 0.5, 0.95])
    assert np.allclose([p.place_low[0], p.place[0], p.place_high[0]], wanted, atol=0.03)
    for d, share in zip(p.candidates, p.probability[0], strict=True):
        inside = (draws >= 0.5) & (draws < s.d_max + 0.5)
        assert share == pytest.approx(np.mean((np.abs(draws - d) < 0.5)[inside]), abs=0.004)


def test_another_rivers_inflow_is_not_answered():
    u, y, _ = river_windows(examples(8, 5), 8, days=2)
    p = posterior_river(np.roll(u, 1, axis=0), y)
    assert (p.status == "unidentifiable").mean() >= 0.85
    assert np.isnan(p.delay[p.status != "ok"]).all()


@pytest.mark.parametrize("t50", [11.0, 12.0, 25.0])
def test_a_travel_time_beyond_the_range_is_no_answer(t50):
    u, y, _ = river_windows(4, 9, t50=t50)
    p = posterior_river(u, y, RiverSettings(d_max=9))
    assert not (p.status == "ok").any()
    assert np.isnan(p.delay).all()
    if t50 < 12.0:  # for a much larger t50, nothing in the range follows the inflow
        assert (p.status == "at_bound").all()
        assert (p.message == "the travel time lies above d_max").all()
        assert (p.beyond[:, 1] > 0.5).all()


def test_a_window_without_any_likely_response_has_a_reason(monkeypatch):
    u, y, _ = river_windows(1, 5, 1)

    def hopeless(*given):
        log, mean, variance = evidence(*given)
        return log - 1e6, mean, variance  # its exponential is 0

    monkeypatch.setattr(river, "evidence", hopeless)
    with np.errstate(divide="raise", invalid="raise"):
        p = posterior_river(u, y)
    assert p.status[0] == "unidentifiable" and p.message[0] == "the output is not seen to follow the inflow"
    assert p.link[0] == 0.0 and np.isnan(p.delay[0])


def test_still_windows_have_a_reason_and_units_and_other_windows_do_not_matter():
    u, y, _ = river_windows(3, 10, days=1)
    flat = u.copy()
    flat[1] = 70.0
    p, alone = posterior_river(flat, y), posterior_river(u[2:], y[2:])
    assert p.message[1] == "inflow or output does not move"
    assert np.isnan(p.place[1]) and np.isnan(p.probability[1]).all() and p.link[1] == 0.0
    assert p.place[2] == alone.place[0]
    assert np.array_equal(p.fir[2], alone.fir[0])
    other = posterior_river(35.3 * u[2:], 35.3 * y[2:] + 400.0)
    assert (other.place, other.gain) == (
        pytest.approx(alone.place, abs=1e-5),
        pytest.approx(alone.gain, abs=1e-5),
    )


def test_wrong_arrays_are_named():
    u, y, _ = river_windows(2, 12, days=1)
    with pytest.raises(RividError, match="output has shape"):
        posterior_river(u, y[:, 1:])
    with pytest.raises(RividError, match="not finite on 1 windows, first on row 1"):
        posterior_river(np.where(np.arange(2)[:, None] == 1, np.nan, u), y)
    with pytest.raises(RividError, match="samples a window"):
        posterior_river(u[:, :100], y[:, :100])


GAIN, SD = 1.0, 0.35


def dense(y, x, s2):
    """Return ln p(y) at one noise variance: a normal gain, then the correction for its truncation at zero."""
    cov = s2 * np.eye(len(y)) + SD**2 * np.outer(x, x)
    log = multivariate_normal.logpdf(y, GAIN * x, cov)
    variance = 1.0 / (x @ x / s2 + 1.0 / SD**2)
    mean = variance * (x @ y / s2 + GAIN / SD**2)
    return log + norm.logsf(0, mean, np.sqrt(variance)) - norm.logsf(0, GAIN, SD)


@pytest.mark.parametrize("true_gain", [1.0, 0.1, -0.5])
@pytest.mark.parametrize("seed", range(examples(3, 1)))
def test_marginal_is_the_best_dense_likelihood_over_the_noise_variance(seed, true_gain):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=60)
    y = true_gain * x + rng.normal(size=60) * 0.7
    found = marginal(np.array([y @ y]), np.array([x @ y]), np.array([x @ x]), 60, GAIN, SD)
    best = minimize_scalar(lambda l: -dense(y, x, np.exp(l)), bounds=(-4, 4), method="bounded")
    assert found[0][0] == pytest.approx(-best.fun, abs=0.1)
    assert found[0][0] <= -best.fun + 1e-9


@pytest.mark.parametrize("seed", range(examples(3, 1)))
def test_evidence_of_a_window_is_that_of_its_whitened_columns(seed):
    s = RiverSettings(d_max=12, warm=40)
    u, y, _ = river_windows(1, seed, days=1)
    u, y = u[0, 56:], y[0, 56:]
    n = len(u) - s.warm
    (grid,) = response_grids(s)
    sums = whitened_sums(u[None], y, daily_sine(len(u), 96), s.warm, s.n_lags, river_noises())
    found, none = evidence(sums, grid, n, GAIN, SD), nothing(sums, n)
    rng = np.random.default_rng(seed)
    for _ in range(20):
        b, shape, place = (int(rng.integers(k)) for k in (len(river_noises()), *grid.h.shape[:2]))
        a, c = river_noises()[b]
        passed = lfilter(a, c, np.convolve(u - u[0], grid.h[shape, place])[: len(u)])[s.warm :]
        seen = lfilter(a, c, y - y[0])[s.warm :]
        extra = [lfilter(a, c, x)[s.warm :] for x in daily_sine(len(u), 96)]
        for sine in (0, 1):
            columns = SINE if sine else 1
            Q = np.linalg.qr(np.column_stack([np.ones(n), *extra])[:, :columns])[0]
            x, z = passed - Q @ (Q.T @ passed), seen - Q @ (Q.T @ seen)
            slow = marginal(np.array([z @ z]), np.array([x @ z]), np.array([x @ x]), n, GAIN, SD)
            penalty = 0.5 * columns * np.log(n)
            assert found[0][0, b, sine, shape, place] == pytest.approx(slow[0][0] - penalty, abs=1e-5)
            best = -0.5 * n * (np.log(2 * np.pi * (z @ z) / n) + 1)
            assert none[b, sine] == pytest.approx(best - penalty, abs=1e-6)


def test_leaving_out_what_cannot_count_changes_nothing_that_does():
    s = RiverSettings(d_max=12, warm=40)
    u, y, _ = river_windows(1, 5, days=1, t50=7.0)
    u, y = u[0, 56:], y[0, 56:]
    n, (grid,) = len(u) - s.warm, response_grids(s)
    sums = whitened_sums(u[None], y, daily_sine(len(u), 96), s.warm, s.n_lags, river_noises())
    every, some = (evidence(sums, grid, n, GAIN, SD, within)[0] for within in (np.inf, 30.0))
    kept = np.isfinite(some)
    assert 0 < kept.mean() < 0.8
    assert np.array_equal(some[kept], every[kept])
    assert (every[~kept] < every.max() - 25.0).all()


@pytest.mark.parametrize("which", range(len(river_noises())))
def test_a_kind_of_noise_is_whitened_by_its_filter(which):
    a, c = river_noises()[which]
    e = np.random.default_rng(which).normal(size=500)
    assert np.allclose(lfilter(a, c, lfilter(c, a, e)), e, atol=1e-6)
    assert (np.abs(np.roots(c)) < 1).all()
    assert a[0] == c[0] == 1.0


def test_a_long_range_of_delays_is_searched_on_coarser_grids_with_the_same_answer(monkeypatch):
    t50, N, d_max = (20.4, 40.3, 57.6), 500, 60
    s = RiverSettings(d_max=d_max, warm=lags_of(d_max))
    rng = np.random.default_rng(3)
    u = 100 + np.cumsum(rng.normal(0, 3, (len(t50), N)), axis=1)
    h = responses(hayami, 0.2, np.array(t50), 150)
    y = np.stack([300 + np.convolve(a - a[0], b)[:N] for a, b in zip(u, h, strict=True)])
    y += rng.normal(0, 1, y.shape)
    coarse = posterior_river(u, y, s)
    assert [grid.stride for grid in response_grids(s)] == [1, 2, 4]
    size = sum(grid.h.size for grid in response_grids(s))
    monkeypatch.setattr(response, "UNIFORM_TO", d_max)
    response_grids.cache_clear()
    river._spread.cache_clear()
    fine = posterior_river(u, y, s)
    (whole,) = response_grids(s)
    assert size < whole.h.size / 3
    response_grids.cache_clear()
    river._spread.cache_clear()
    assert np.allclose(coarse.place, t50, atol=0.8)
    assert np.allclose(coarse.place, fine.place, atol=0.2)
    assert np.allclose(coarse.place_high - coarse.place_low, fine.place_high - fine.place_low, atol=0.4)
    assert np.allclose(coarse.gain, fine.gain, atol=0.01)
    assert np.allclose(coarse.fir.sum(axis=1), coarse.gain, atol=0.01)
