"""Test a seiche in innovations against slow sums, with planted oscillations, machines and neither."""

import numpy as np
import pytest

from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.seiche import (
    FEWEST_DAYS,
    LEAST_DAMPING,
    fit_seiche,
    highest_peak,
    periodograms,
    spectrum_of,
    through_filter,
)
from rivid.effects import CATALOGUE
from rivid.effects.level import covariance
from tests.diagnosis import sizes

SEICHE = CATALOGUE["seiche"]
T, N = 133.0, 650
NOISE = NoiseModel(0.003, 0.0005, 1.5, 20_000.0, 0.0, 3600.0, T, 6.7e5)


def residual(rng, days, swing=None):
    """Return a level that stores an unknown inflow, gauge noise, and an oscillation of the gauge."""
    rho = np.exp(-T / NOISE.inflow_memory)
    w = np.empty((days, N))
    w[:, 0] = NOISE.inflow_sd * rng.standard_normal(days)
    for k in range(1, N):
        w[:, k] = rho * w[:, k - 1] + NOISE.inflow_sd * np.sqrt(1 - rho**2) * rng.standard_normal(days)
    z = np.cumsum(w, axis=1) * T / NOISE.surface_area
    z += np.cumsum(NOISE.walk_sd * rng.standard_normal((days, N)), axis=1)
    z += NOISE.gauge_sd * rng.standard_normal((days, N))
    return z if swing is None else z + swing


def wandering(rng, days, period, damping, amplitude):
    """Return the damped oscillation, drawn step by step from its stationary start."""
    (a1, a2), innovation = SEICHE(period=period, damping=damping, amplitude=amplitude).autoregression(T)
    x = np.zeros((days, N + 400))
    for k in range(2, x.shape[1]):
        x[:, k] = a1 * x[:, k - 1] + a2 * x[:, k - 2] + innovation * rng.standard_normal(days)
    return x[:, 400:]


def found(z, fit=None):
    r = NOISE.whiten(z)
    power = periodograms(r, np.ones(r.shape, bool))
    days = np.ones(len(z), bool) if fit is None else fit
    return fit_seiche(power, through_filter(NOISE, N), days, SEICHE, T, N)


def test_the_power_of_a_seiche_is_the_transform_of_its_covariance():
    one = SEICHE(period=2700.0, damping=4e-4, amplitude=0.01)
    law = one.autoregression(T)
    (a1, a2), _ = law
    c = [*covariance(law)]
    while len(c) < N:
        c.append(a1 * c[-1] + a2 * c[-2])
    k = np.arange(1, (N - 1) // 2 + 1)
    dense = np.array(c)[np.abs(np.subtract.outer(np.arange(N), np.arange(N)))]
    waves = np.exp(2j * np.pi * np.outer(k, np.arange(N)) / N)
    slow = np.einsum("ki,ij,kj->k", waves, dense, waves.conj(), optimize=True).real / N
    np.testing.assert_allclose(spectrum_of(one, N, T), slow, rtol=1e-6, atol=1e-12)


def test_the_filter_passes_a_swing_by_its_gain():
    gain = through_filter(NOISE, N)
    for k in (20, 200):
        t = np.arange(6 * N)
        waves = np.stack([np.cos(2 * np.pi * k * t / N), np.sin(2 * np.pi * k * t / N)])
        out = NOISE.whiten(waves)[:, 3 * N :]
        assert (out**2).mean() == pytest.approx(0.5 * gain[k - 1], rel=2e-2)


@sizes("seed", 0, 1)
def test_a_swing_is_found_with_its_period_damping_and_size(seed):
    rng = np.random.default_rng(seed)
    true = {"period": 2700.0, "damping": 1.5e-4, "amplitude": 0.012}
    seiche, gains, _, contrast = found(residual(rng, 40, wandering(rng, 40, **true)))
    for name, off in zip(true, (0.033, 0.27, 0.107), strict=True):  # 4 standard errors and 2 %
        assert abs(np.log(getattr(seiche, name) / true[name])) < off, name
    assert contrast > 5.0 and gains.mean() > 20.0


@pytest.mark.parametrize(
    ("period", "damping", "amplitude"), [(1740.0, 1.1e-4, 0.014), (3940.0, 1.3e-4, 0.014)]
)
def test_a_narrow_line_is_not_taken_for_a_steady_one(period, damping, amplitude):
    """Some starts of the fit end at a steady oscillation, 60 nats worse."""
    for seed in range(3):
        rng = np.random.default_rng([seed, 2])
        one, *_ = found(residual(rng, 23, wandering(rng, 23, period, damping, amplitude)))
        assert abs(np.log(one.damping / damping)) < 0.5 and abs(np.log(one.amplitude / amplitude)) < 0.3


@sizes("seasons", 3, 8)
def test_where_nothing_swings_days_that_were_not_fitted_gain_nothing(seasons):
    gains = []
    for seed in range(seasons):
        rng = np.random.default_rng(100 + seed)
        fit = np.arange(20) % 2 == 0
        gains.append(found(residual(rng, 20), fit)[1][~fit].mean())
    assert np.mean(gains) < 3.0 * np.std(gains) / np.sqrt(len(gains))
    assert max(gains) < 0.5


def test_a_steady_oscillation_has_no_damping():
    rng = np.random.default_rng(7)
    t = np.arange(30)[:, None] * 86_400.0 + T * np.arange(N)
    swing, *_ = found(residual(rng, 30, 0.01 * np.sin(2 * np.pi * t / 2400.0)))
    assert swing.damping < LEAST_DAMPING and swing.period == pytest.approx(2400.0, rel=0.02)


def white(seed, days=20, n=240):
    """Return white innovations with gaps, and the mask of used samples."""
    rng = np.random.default_rng(seed)
    used = np.ones((days, n), bool)
    used[:, :15] = False
    used[-1, 3 * n // 5 :] = False
    return rng.standard_normal((days, n)), used


def test_a_swing_of_twenty_minutes_with_a_new_phase_each_day_is_the_highest_peak():
    rng = np.random.default_rng(1)
    for seed in range(2):
        r, used = white(seed, days=60, n=600)
        phase = rng.uniform(0, 2 * np.pi, (60, 1))
        r += 0.3 * np.cos(2 * np.pi * np.arange(600) * T / 1200.0 + phase)
        period, height = highest_peak(r, used, np.ones(60), T)
        assert period == pytest.approx(1200.0, rel=0.01)
        assert height > 4.0


@sizes("seasons", 40, 400)
def test_white_innovations_seldom_have_a_peak_three_times_as_high_as_its_surroundings(seasons):
    weights = np.ones(FEWEST_DAYS)
    high = sum(highest_peak(*white(seed, FEWEST_DAYS, 650), weights, T)[1] > 3.0 for seed in range(seasons))
    assert high <= 0.01 * seasons + 3.0 * np.sqrt(0.01 * seasons)


def test_scale_and_days_without_weight_do_not_change_the_highest_peak():
    r, used = white(3)
    weights = np.ones(20)
    weights[4] = 0.0
    once = highest_peak(r, used, weights, T)
    r[4] = 1e6 * np.cos(np.arange(240))
    assert highest_peak(7.0 * r, used, weights, T) == pytest.approx(once)


def test_too_few_days_or_samples_have_no_peak():
    r, used = white(0)
    few = np.arange(20) < FEWEST_DAYS - 1
    assert highest_peak(r, used, few.astype(float), T) is None
    used[:, :-29] = False
    assert highest_peak(r, used, np.ones(20), T) is None
