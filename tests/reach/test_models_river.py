"""The responses of rivers against scipy.stats, convolution by hand and the equation itself."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import solve_banded
from scipy.signal import lsim
from scipy.stats import invgauss

from rivid.reach.models import DiffusiveWave, LagAndReservoir

T_S, N, FINE = 900.0, 200, 20
RIVER = DiffusiveWave(48_000.0, 2.0, 1000.0)
SHAPES = [  # length, celerity, diffusivity: from a sharp front to one that is almost all tail
    (48_000.0, 2.0, 1000.0),
    (48_000.0, 2.0, 1.0),
    (48_000.0, 1.3, 9000.0),
    (5_000.0, 0.4, 4_000.0),
    (200_000.0, 3.0, 4000.0),
    (8_200.0, 7.0, 50.0),
]
every_shape = pytest.mark.parametrize("shape", SHAPES, ids=str)


def inflows(seed, n=N):
    return np.random.default_rng(seed).integers(-40, 41, n).astype(float)


def inverse_gaussian(river):
    """scipy's inverse Gaussian: mean L / C, shape L^2 / (2 D)."""
    shape = river.length**2 / (2.0 * river.diffusivity)
    return invgauss(river.mean_delay / shape, scale=shape)


@every_shape
def test_what_has_arrived_is_the_inverse_gaussian_of_scipy(shape):
    river = DiffusiveWave(*shape)
    time = river.mean_delay * np.concatenate([[0.0], np.geomspace(0.01, 30.0, 500)])
    np.testing.assert_allclose(river.arrived(time), inverse_gaussian(river).cdf(time), rtol=0, atol=2e-12)


@every_shape
def test_what_has_arrived_is_the_integral_of_hayamis_density(shape):
    L, C, D = shape
    river = DiffusiveWave(*shape)

    def density(t):
        return L / (2 * np.sqrt(np.pi * D * t**3)) * np.exp(-((L - C * t) ** 2) / (4 * D * t))

    start = max(river.mean_delay - 12 * river.spread, 1e-9)
    for quantile in (0.03, 0.5, 0.97):
        end = inverse_gaussian(river).ppf(quantile)
        wanted = quad(density, start, end, limit=400, points=[river.mean_delay / 2], epsabs=1e-11)[0]
        assert abs(float(river.arrived(end)) - wanted) < 1e-8


def test_a_front_too_sharp_for_the_textbook_form_does_not_overflow():
    river = DiffusiveWave(48_000.0, 2.0, 1e-3)  # exp(C L / D) would be exp(10^8)
    time = river.mean_delay + river.spread * np.array([-6.0, -1.0, 0.0, 1.0, 6.0])
    share = river.arrived(time)
    assert np.isfinite(share).all()
    np.testing.assert_allclose(share, [0.0, 0.1587, 0.5, 0.8413, 1.0], atol=1e-4)  # a normal front


@every_shape
@pytest.mark.parametrize("T_s", [60.0, 900.0, 3600.0, 86_400.0])
def test_sampling_loses_and_makes_no_water(shape, T_s):
    kernel = DiffusiveWave(*shape).kernel(T_s, 100_000)
    assert (kernel >= 0).all()
    assert abs(kernel.sum() - 1.0) < 1e-13
    assert len(kernel) < 100_000  # it ends where all has arrived


@every_shape
@pytest.mark.parametrize("times_finer", [1, 3])
def test_the_mean_is_l_over_c_and_the_variance_2_d_l_over_c_cubed(shape, times_finer):
    """Those of the density, and of the sample over which an inflow is held: T_s / 2 and T_s^2 / 12."""
    L, C, D = shape
    river = DiffusiveWave(*shape)
    # Sums over samples are integrals as long as both the front and the body are smooth for the sampling.
    T_s = min(np.sqrt(2 * D * L / C**3) / 4, L**2 / (2 * D) / 20) / times_finer
    kernel = river.kernel(T_s, 100_000)
    lag = np.arange(len(kernel)) * T_s
    mean = kernel @ lag
    np.testing.assert_allclose(mean, L / C + T_s / 2, rtol=1e-6)
    np.testing.assert_allclose(kernel @ (lag - mean) ** 2, 2 * D * L / C**3 + T_s**2 / 12, rtol=1e-5)
    assert river.mean_delay == L / C
    np.testing.assert_allclose(river.spread, np.sqrt(2 * D * L / C**3), rtol=1e-14)


@pytest.mark.parametrize("seed", range(6))
def test_the_discharge_is_the_brute_force_sum_over_held_inflows(seed):
    river = DiffusiveWave(*SHAPES[seed % len(SHAPES)], 1.0 - 0.02 * seed)
    inflow = inflows(seed)
    arrived = inverse_gaussian(river).cdf(T_S * np.arange(N + 1))
    wanted = np.zeros(N)
    for n in range(N):
        for k in range(n):
            wanted[n] += river.inflow_gain * inflow[k] * (arrived[n - k] - arrived[n - k - 1])
    np.testing.assert_allclose(river.simulate(T_S, inflow), wanted, rtol=0, atol=1e-9)


def test_the_step_response_solves_the_advection_diffusion_equation():
    """Crank-Nicolson on a channel four times as long, second order in both steps."""
    L, C, D, dx, dt = 10_000.0, 2.0, 2000.0, 50.0, 10.0
    nodes, steps = int(4 * L / dx), 1500
    here = int(L / dx) - 1  # nodes start at dx
    down, diag, up = D / dx**2 + C / (2 * dx), -2 * D / dx**2, D / dx**2 - C / (2 * dx)
    banded = np.zeros((3, nodes))
    banded[0, 1:], banded[1], banded[2, :-1] = -dt / 2 * up, 1 - dt / 2 * diag, -dt / 2 * down
    Q, at_gauge = np.zeros(nodes), [0.0]
    for _ in range(steps):
        push = diag * Q + up * np.append(Q[1:], 0.0) + down * np.insert(Q[:-1], 0, 1.0)
        rest = Q + dt / 2 * push
        rest[0] += dt / 2 * down
        Q = solve_banded((1, 1), banded, rest)
        at_gauge.append(Q[here])
    share = DiffusiveWave(L, C, D).arrived(dt * np.arange(steps + 1))
    assert share[-1] > 0.9
    assert np.abs(share - at_gauge).max() < 2e-3


def test_diffusivity_zero_is_a_pure_delay_and_little_is_near_it():
    inflow = inflows(3)
    pure = DiffusiveWave(2.0 * T_S * 10.4, 2.0, 0.0).simulate(T_S, inflow)
    np.testing.assert_array_equal(pure, np.concatenate([np.zeros(11), inflow])[:N])
    on_a_sample = DiffusiveWave(2.0 * T_S * 10, 2.0, 0.0).simulate(T_S, inflow)
    np.testing.assert_array_equal(on_a_sample, np.concatenate([np.zeros(10), inflow])[:N])
    rounded = DiffusiveWave(10.0, 3.0, 0.0).simulate(10.0 / 21.0, inflow)  # 7 samples, but for rounding
    np.testing.assert_array_equal(rounded, np.concatenate([np.zeros(7), inflow])[:N])
    little = DiffusiveWave(2.0 * T_S * 10.4, 2.0, 0.1).simulate(T_S, inflow)
    np.testing.assert_allclose(little, pure, rtol=0, atol=1e-12)
    gaps = [
        np.abs(DiffusiveWave(2.0 * T_S * 10.4, 2.0, D).simulate(T_S, inflow) - pure).max()
        for D in (3000.0, 300.0, 30.0)
    ]
    assert gaps[0] > gaps[1] > gaps[2]


def test_two_reaches_in_a_row_are_one_of_their_length():
    """First passages add up; held samples between them spread the front by T_s / sqrt(12) at most."""
    step = np.ones(400)
    half = dataclasses.replace(RIVER, length=24_000.0)
    row = half.simulate(60.0, half.simulate(60.0, np.ones(1200)))
    whole = RIVER.simulate(60.0, np.ones(1200))
    # The level between is held for 60 s, so it comes 30 s later on average.
    moved = np.interp(60.0 * np.arange(1200) - 30.0, 60.0 * np.arange(1200), whole)
    assert np.abs(row - moved).max() < 1e-3
    assert RIVER.simulate(T_S, step)[-1] == pytest.approx(1.0, abs=1e-12)


def test_a_long_record_costs_no_more_than_its_kernel():
    river = DiffusiveWave(5_000.0, 1.0, 200.0)
    kernel = river.kernel(T_S, 60_000)
    assert len(kernel) < 100
    assert kernel.sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_lag_and_reservoir_agrees_with_lsim(seed):
    inflow = inflows(seed, 120)
    steps = 3 * FINE + 7 * seed
    K = (300.0, 3600.0, 40_000.0)[seed % 3]
    fine = np.repeat(inflow, FINE)
    late = np.concatenate([np.zeros(steps), fine])[: len(fine)]
    time = np.arange(len(fine)) * (T_S / FINE)
    wanted = lsim(([0.95], [K, 1.0]), late, time, interp=False)[1][::FINE]
    got = LagAndReservoir(steps * T_S / FINE, K, 0.95).simulate(T_S, inflow)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-10)


@pytest.mark.parametrize("lag", [0.0, 450.0, 1800.0, 2000.0])
def test_lag_and_reservoir_answers_a_step_by_an_exponential(lag):
    time = T_S * np.arange(100)
    wanted = np.where(time > lag, -np.expm1(-(time - lag) / 3600.0), 0.0)
    got = LagAndReservoir(lag, 3600.0).simulate(T_S, np.ones(100))
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-13)


def test_lag_and_reservoir_keeps_the_water_and_its_mean_delay():
    river = LagAndReservoir(2000.0, 3600.0)
    pulse = np.zeros(400)
    pulse[0] = 1.0
    answer = river.simulate(T_S, pulse)
    assert answer.sum() == pytest.approx(1.0, abs=1e-12)
    mean = answer @ (T_S * np.arange(400))
    # The pulse is held for T_s and read at samples: the mean is known to within a sample.
    assert abs(mean - river.mean_delay - T_S / 2) < T_S / 2


def test_a_small_reservoir_is_a_pure_delay():
    inflow = inflows(6)
    got = LagAndReservoir(10.4 * T_S, 1.0).simulate(T_S, inflow)
    np.testing.assert_allclose(got, np.concatenate([np.zeros(11), inflow])[:N], rtol=0, atol=1e-12)


@pytest.mark.parametrize("river", [RIVER, LagAndReservoir(20_000.0, 3600.0)], ids=lambda r: r.NAME)
def test_the_gain_is_the_steady_discharge(river):
    lossy = dataclasses.replace(river, inflow_gain=0.8)
    assert lossy.simulate(T_S, np.full(400, 50.0))[-1] == pytest.approx(40.0, abs=1e-9)
