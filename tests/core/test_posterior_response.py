"""Test the families of responses against numerical integration of their densities."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import invgauss

from rivid.core.posterior.response import (
    EXCHANGE_CV,
    EXCHANGED,
    FAMILIES,
    HAYAMI_CV,
    HELD_FOR,
    RESERVOIR_SHARE,
    STEP,
    exchange,
    hastened,
    hayami,
    reservoir,
    response_grids,
    responses,
)
from rivid.core.settings import RiverSettings


def wave(t, cv):
    """Return the density of an inverse Gaussian time of mean 1."""
    return invgauss.pdf(t, cv**2, scale=1.0 / cv**2)


def step(t, cv):
    return invgauss.cdf(t, cv**2, scale=1.0 / cv**2)


def delayed(t, cv):
    """Return the arrived share of a wave held for an exponential time, by integration over that time."""
    value, _ = quad(lambda a: np.exp(-a / HELD_FOR) / HELD_FOR * step(t - a, cv), 0, t, limit=200)
    return value


@pytest.mark.parametrize("t", [0.3, 0.8, 1.0, 1.7, 3.0])
@pytest.mark.parametrize("cv", HAYAMI_CV)
def test_a_hayami_wave_is_the_integral_of_its_density(cv, t):
    arrived, area = hayami(np.array([t]), cv)
    near = np.clip([1 - 6 * cv, 1.0, 1 + 6 * cv], 0, t)
    assert arrived[0] == pytest.approx(quad(wave, 0, t, args=(cv,), points=near)[0], abs=1e-8)
    assert area[0] == pytest.approx(quad(step, 0, t, args=(cv,), points=near)[0], abs=1e-8)


@pytest.mark.parametrize("t", [0.5, 1.2, 2.0])
@pytest.mark.parametrize("cv", EXCHANGE_CV)
def test_an_exchange_is_a_wave_of_which_a_share_is_held(cv, t):
    arrived, area = exchange(np.array([t]), cv)
    assert arrived[0] == pytest.approx((1 - EXCHANGED) * step(t, cv) + EXCHANGED * delayed(t, cv), abs=1e-7)
    # the integral of `delayed` from 0 to t, with the two integrations interchanged
    both, _ = quad(lambda x: step(x, cv) * (1 - EXCHANGED * np.exp(-(t - x) / HELD_FOR)), 0, t, limit=200)
    assert area[0] == pytest.approx(both, abs=1e-6)


@pytest.mark.parametrize("share", RESERVOIR_SHARE)
def test_a_reservoir_is_the_integral_of_its_density(share):
    for t in (0.1, 0.9, 1.4, 4.0):
        begin = 1 - share
        arrived, area = reservoir(np.array([t]), share)
        wanted = quad(lambda x, b=begin: np.exp(-(x - b) / share) / share, begin, max(t, begin))[0]
        assert arrived[0] == pytest.approx(wanted, abs=1e-9)
        whole = quad(lambda x, b=begin: -np.expm1(-max(x - b, 0) / share), 0, t, points=[begin])[0]
        assert area[0] == pytest.approx(whole, abs=1e-8)


@pytest.mark.parametrize("t50", [3.3, 12.0])
@pytest.mark.parametrize("cv", [0.1, 0.34])
def test_lags_hold_the_density_weighted_by_a_hat(cv, t50):
    h = responses(hayami, cv, np.array([t50]), 60)[0]
    scale = t50 / invgauss.ppf(0.5, cv**2, scale=1.0 / cv**2)
    for k in range(1, 30):
        wanted, _ = quad(
            lambda t, k=k: (1 - abs(t - k)) * wave(t / scale, cv) / scale, k - 1, k + 1, points=[k]
        )
        assert h[k] == pytest.approx(wanted, abs=1e-6)


def test_half_of_every_step_has_arrived_after_t50():
    for family, parameters in FAMILIES:
        for parameter in parameters:
            h = responses(family, parameter, np.array([10.0]), 80)[0]
            fine = responses(family, parameter, np.array([1000.0]), 8000)[0]
            assert np.cumsum(fine)[1000] - 0.5 * fine[1000] == pytest.approx(0.5, abs=2e-3)
            assert h.sum() == pytest.approx(1.0)


def test_blocks_leave_nothing_out():
    (grid,) = response_grids(RiverSettings(d_max=12))
    left = grid.h.copy()
    for shape, part, lags in grid.blocks:
        left[shape, part, lags] = 0.0
    assert left.max() == 0.0
    assert grid.prior.sum() == pytest.approx(1.0)
    assert np.allclose(np.diff(grid.t50), STEP)


def test_high_water_arrives_sooner_by_the_logarithm():
    def flow(t):
        return 60.0 + 25.0 * np.sin(t / 20.0)

    k = np.arange(200.0)
    moved = hastened(flow(k), 50.0, 6.0)
    for at in (30, 77, 130, 160):
        left = brentq(lambda t, at=at: t - 6.0 * np.log(flow(t) / 50.0) - at, at - 20, at + 20)
        assert moved[at] == pytest.approx(flow(left), abs=0.05)
    assert np.array_equal(hastened(flow(k), 50.0, 0.0), flow(k))
    assert np.array_equal(hastened(np.full(50, 70.0), 70.0, 8.0), np.full(50, 70.0))


def test_water_does_not_overtake():
    u = np.full(200, 50.0)
    u[80:120] = 100.0
    moved = hastened(u, 50.0, 6.0)
    assert set(np.flatnonzero(moved > 99.0)) >= set(range(80, 115))
    assert moved[75] == pytest.approx(50.0)
    assert ((moved >= 50.0 - 1e-9) & (moved <= 100.0 + 1e-9)).all()


@pytest.mark.parametrize("low", [80.0, 150.0])
def test_a_front_arrives_at_the_mean_of_the_times_of_its_discharges(low):
    """A kinematic shock; it arrived with the low water, so that a t50 was early by up to 2.7 samples."""
    high, lead, k = 240.0, 8.0, np.arange(400.0)
    moved = hastened(np.interp(k, [198.0, 202.0], [low, high]), 130.0, lead)
    front = np.interp(0.5 * (low + high), moved, k)
    q = np.linspace(low, high, 20_001)
    assert front == pytest.approx(200.0 - lead * np.log(q / 130.0).mean(), abs=0.5)  # a sample
