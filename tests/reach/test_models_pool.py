"""The responses of pools against fine integration, step responses and waves followed by hand."""

import dataclasses
from decimal import Decimal, localcontext

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import cont2discrete, lsim

from rivid.errors import ConfigError
from rivid.reach.models import Fir, IntegratorDelay, IntegratorDelayZero, IntegratorResonance
from rivid.reach.pool import pool_level
from rivid.reach.response import LinearReach, integrator_delay

T_S, N, FINE = 133.0, 160, 20
A = 6.7e5
POOL = IntegratorDelay(A, 980.0, 0.93, 1.07)
ZERO = IntegratorDelayZero(A, 980.0, 1.1e-3, 1.9e-3, 0.93, 1.07)
WAVE = IntegratorResonance(A, 2370.0, 0.12, 1.3, 0.93, 1.07)


def flows(seed, n=N):
    rng = np.random.default_rng(seed)
    return rng.integers(-40, 41, n).astype(float), rng.integers(-40, 41, n).astype(float)


def slow(numerator, denominator, flow, delay_in_fine_steps=0):
    """A transfer function by lsim on a grid 20 times finer, the held flow moved by whole fine steps."""
    fine = np.repeat(flow, FINE)
    late = np.concatenate([np.zeros(delay_in_fine_steps), fine])[: len(fine)]
    time = np.arange(len(fine)) * (T_S / FINE)
    return lsim((numerator, denominator), late, time, interp=False)[1][::FINE]


@pytest.mark.parametrize("seed", range(6))
def test_integrator_delay_agrees_with_lsim_and_with_the_linear_reach(seed):
    inflow, outflow = flows(seed)
    steps = 7 * FINE + 3 * seed
    model = IntegratorDelay(A, steps * T_S / FINE, 0.93, 1.07)
    wanted = slow([0.93 / A], [1, 0], inflow, steps) - slow([1.07 / A], [1, 0], outflow)
    got = model.simulate(T_S, inflow, outflow)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-12)
    reach = LinearReach(surface_area=A, inflow_gain=0.93, outflow_gain=1.07)
    exact, *_ = pool_level(reach, T_S * np.arange(N), inflow, outflow, model.delay)
    np.testing.assert_allclose(got, exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 7, 15])
def test_whole_delays_are_the_difference_equation(delay):
    inflow, outflow = flows(delay)
    got = IntegratorDelay(A, delay * T_S).simulate(T_S, inflow, outflow)
    wanted = integrator_delay(inflow, outflow, delay, T_S / A, T_S / A)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-13)


@pytest.mark.parametrize("seed", range(6))
def test_integrator_delay_zero_agrees_with_lsim(seed):
    inflow, outflow = flows(seed)
    steps = 7 * FINE + 3 * seed
    model = dataclasses.replace(ZERO, delay=steps * T_S / FINE)
    b_i, b_o = model.inflow_jump, model.outflow_jump
    wanted = 0.93 * slow([b_i, 1 / A], [1, 0], inflow, steps) - 1.07 * slow([b_o, 1 / A], [1, 0], outflow)
    np.testing.assert_allclose(model.simulate(T_S, inflow, outflow), wanted, rtol=0, atol=1e-12)


def test_without_jumps_the_zero_is_gone_to_the_bit():
    inflow, outflow = flows(1)
    model = dataclasses.replace(ZERO, inflow_jump=0.0, outflow_jump=0.0)
    wanted = POOL.simulate(T_S, inflow, outflow)
    np.testing.assert_array_equal(model.simulate(T_S, inflow, outflow), wanted)


def test_a_step_of_inflow_jumps_by_b_when_it_arrives_then_rises_with_the_volume():
    model = IntegratorDelayZero(A, 2.5 * T_S, 1.1e-3, 0.0)
    level = model.simulate(T_S, 10.0 * np.ones(6))
    wanted = [0, 0, 0, *(11e-3 + 10.0 * T_S / A * np.array([0.5, 1.5, 2.5]))]
    np.testing.assert_allclose(level, wanted, rtol=0, atol=1e-15)


def test_an_outflow_of_the_same_size_leaves_what_the_delay_and_the_jumps_leave():
    step = np.full(400, 25.0)
    model = IntegratorDelayZero(A, 980.0, 1.1e-3, 1.9e-3)
    level = model.simulate(T_S, step, step)
    np.testing.assert_allclose(level[-1], 25.0 * (1.1e-3 - 1.9e-3 - 980.0 / A), rtol=1e-10)


def wave_by_lsim(model, inflow, outflow):
    """Both transfer functions of the resonance over their common denominator."""
    w, z, g, area = 2 * np.pi / model.period, model.damping, model.strength, model.surface_area
    below = np.array([1.0, 2 * z * w, w * w, 0.0]) * area
    into, out_of = [1.0 - g, 2 * z * w, w * w], [1.0 + g, 2 * z * w, w * w]
    came = model.inflow_gain * slow(into, below, inflow)
    return came - model.outflow_gain * slow(out_of, below, outflow)


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.3, 1.0, 1.0000001, 2.0, 30.0])
@pytest.mark.parametrize("period", [300.0, 2370.0, 40_000.0])
def test_integrator_resonance_agrees_with_lsim_on_both_flows(damping, period):
    inflow, outflow = flows(int(10 * damping) + int(period))
    model = dataclasses.replace(WAVE, damping=damping, period=period)
    wanted = wave_by_lsim(model, inflow, outflow)
    np.testing.assert_allclose(model.simulate(T_S, inflow, outflow), wanted, rtol=0, atol=2e-9)


@pytest.mark.parametrize("damping", [0.0, 0.02, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize("period", [300.0, 2370.0, 40_000.0])
def test_integrator_resonance_is_exact_beside_a_matrix_exponential(damping, period):
    """A volume and a wave as balanced states, stepped one by one: lsim itself errs by 1e-10 here."""
    inflow, outflow = flows(int(period))
    model = dataclasses.replace(WAVE, damping=damping, period=period)
    w = 2 * np.pi / period
    M = np.zeros((5, 5))
    M[0, 3:] = 0.93, -1.07
    M[1, 2], M[2, 1], M[2, 2] = w, -w, -2 * damping * w
    M[2, 3:] = 0.93, 1.07
    step, x, wanted = expm(M * T_S), np.zeros(5), []
    for x[3], x[4] in zip(inflow, outflow, strict=True):
        wanted.append((x[0] - model.strength * x[2]) / A)
        x = step @ x
    np.testing.assert_allclose(model.simulate(T_S, inflow, outflow), wanted, rtol=0, atol=1e-13)


def test_integrator_resonance_is_the_zero_order_hold_of_control_theory():
    w, z = 2 * np.pi / WAVE.period, WAVE.damping
    tf = ([1.0, 0.0], [1.0, 2 * z * w, w * w])
    numerator, denominator, _ = cont2discrete(tf, T_S, method="zoh")
    step, decay = WAVE._wave(T_S)
    np.testing.assert_allclose([0.0, step, -step], numerator[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose([1.0, *decay], denominator, rtol=1e-10)


def test_the_slow_rate_of_a_heavily_damped_wave_keeps_its_digits():
    """Its difference of two large numbers would lose ten of them; here with fifty digits."""
    with localcontext() as context:
        context.prec = 50
        zeta, omega, T = Decimal(1000), Decimal(2) ** -9, Decimal(2) ** 27
        root = (zeta * zeta - 1).sqrt()
        slow, fast = omega * (zeta - root), omega * (zeta + root)
        wanted = float((-slow * T).exp() / (fast - slow))
    model = IntegratorResonance(A, 2 * np.pi / float(omega), 1000.0)
    np.testing.assert_allclose(model._wave(float(T))[0], wanted, rtol=1e-12)


def test_heavy_damping_or_no_strength_leaves_the_integrator():
    inflow, outflow = flows(4)
    plain = IntegratorDelay(A, 0.0, 0.93, 1.07).simulate(T_S, inflow, outflow)
    none = dataclasses.replace(WAVE, strength=0.0).simulate(T_S, inflow, outflow)
    np.testing.assert_array_equal(none, plain)
    pushed = np.abs(0.93 * inflow + 1.07 * outflow).max()
    omega = 2 * np.pi / WAVE.period
    gaps = []
    for damping in (1.0, 10.0, 100.0, 1000.0):
        level = dataclasses.replace(WAVE, damping=damping).simulate(T_S, inflow, outflow)
        gaps.append(np.abs(level - plain).max())
        # The wave rises to at most 1 / (2 zeta omega) and falls back: twice that for each m3/s, over A.
        assert gaps[-1] <= WAVE.strength / A * pushed / (damping * omega)
    np.testing.assert_allclose(np.array(gaps[1:-1]) / gaps[2:], 10.0, rtol=0.1)


def test_the_wave_dies_and_the_volume_stays():
    pulse = np.zeros(600)
    pulse[:5] = 40.0
    level = IntegratorResonance(A, 2370.0, 0.12).simulate(T_S, pulse)
    np.testing.assert_allclose(level[-50:], 5 * 40.0 * T_S / A, rtol=1e-6)
    missing = IntegratorDelay(A, 0.0).simulate(T_S, pulse) - level
    assert (missing[1:6] > 0.0).all()  # the water is upstream first,
    assert missing.min() < -0.01  # and the wave then brings more than the volume


def test_the_peak_is_the_resonance_peak_that_the_damping_is_read_from():
    """Driven at its period, the level swings by M_r = 1 / (2 zeta omega A) for each m3/s."""
    zeta, omega, T_s = 0.03, 2 * np.pi / 2400.0, 2400.0 / 480
    time = T_s * np.arange(480 * 40)
    level = IntegratorResonance(A, 2400.0, zeta).simulate(T_s, np.sin(omega * time))
    last = level[-480 * 4 :]
    swing = (last.max() - last.min()) / 2.0
    np.testing.assert_allclose(swing, 1 / (2 * zeta * omega * A), rtol=5e-3)


def test_strength_two_is_the_first_wave_of_a_channel_without_friction():
    """A step of inflow runs to and fro: at the dam the level rises by 2 q / (B c) at T, 3 T, 5 T, ...

    Its first Fourier term beside the ramp of the volume is the resonance of strength 2, and the outflow's
    staircase (1 / (B c) at once, then 2 / (B c) every 2 T) has the same wave.
    """
    width, celerity, length = 80.0, 7.0, 8_400.0
    area, T = width * length, length / celerity
    n = 2_000
    time = 2 * T / n * np.arange(2 * n)  # two periods
    jump = 1.0 / (width * celerity)
    rise = 2 * jump * np.floor(time / (2 * T) + 0.5)
    fall = -jump * (1 + 2 * np.floor(time / (2 * T)))
    model = IntegratorResonance(area, 2 * T, 0.0, 2.0)
    one, none = np.ones_like(time), np.zeros_like(time)
    wave = np.exp(-1j * np.pi * time / T) * 2 / len(time)
    for stairs, inflow, outflow, sign in ((rise, one, none, 1), (fall, none, one, -1)):
        got = model.simulate(2 * T / n, inflow, outflow) - sign * time / area
        first = wave @ (stairs - sign * time / area)
        np.testing.assert_allclose(wave @ got, first, rtol=0, atol=3e-3 * abs(first))


def test_the_typical_fir_is_the_integrator_with_seven_samples_of_delay():
    inflow, outflow = flows(2)
    wanted = integrator_delay(inflow, outflow, 7, T_S / A, T_S / A)
    np.testing.assert_allclose(Fir.typical().simulate(T_S, inflow, outflow), wanted, rtol=0, atol=1e-13)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("integrating", [True, False])
def test_the_fir_is_written_out_in_the_loop(seed, integrating):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=11), rng.normal(size=4)
    inflow, outflow = flows(seed, 70)
    wanted = np.zeros(70)
    for n in range(70):
        wanted[n] = sum(a[k] * inflow[n - k] for k in range(11) if k <= n)
        wanted[n] += sum(b[k] * outflow[n - k] for k in range(4) if k <= n)
        if integrating and n:
            wanted[n] += wanted[n - 1]
    model = Fir(tuple(a), tuple(b), T_S, integrating)
    assert model.order == 11
    np.testing.assert_allclose(model.simulate(T_S, inflow, outflow), wanted, rtol=0, atol=1e-9)


def test_an_fir_on_the_inflow_alone_has_no_outflow_coefficients():
    inflow, outflow = flows(2, 40)
    model = Fir((0.0, 0.5, 0.5), (), T_S, integrating=False)
    wanted = np.convolve([0.0, 0.5, 0.5], inflow)[:40]
    np.testing.assert_allclose(model.simulate(T_S, inflow, outflow), wanted, rtol=0, atol=1e-12)


@pytest.mark.parametrize("bad", [(), (0.0,) * 1001, [0.0, 1.0], 3.0])
def test_an_fir_of_no_or_too_many_coefficients_is_refused(bad):
    with pytest.raises(ConfigError, match="inflow_coefficients.*tuple of 1 to 1000"):
        Fir(bad, (), T_S)


def test_the_wave_and_the_zero_differ_from_the_plain_pool():
    inflow, outflow = flows(9)
    plain = POOL.simulate(T_S, inflow, outflow)
    for model in (ZERO, WAVE):
        assert np.abs(model.simulate(T_S, inflow, outflow) - plain).max() > 1e-3
