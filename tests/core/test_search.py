"""Test Table IV against plain loops with numpy's least squares, and against reaches of known delay."""

import itertools
from dataclasses import fields

import numpy as np
import pytest
from scipy.signal import lfilter

from rivid.core.search import BLOCK, direct, indirect
from rivid.reach.integrator import theoretical_fir
from rivid.simulation import simulate
from rivid.simulation.scenario import Scenario
from tests import examples
from tests.reach.equations import difference_equation

ALPHA_I, ALPHA_O, K_Q, K_H = 2.0e-4, 2.2e-4, 0.9, -800.0


def programme(rng, shape):
    """Return flows with occasional steps, as in hydropeaking [m3/s]."""
    moves = (rng.random(shape) < 0.15) * rng.normal(scale=12.0, size=shape)
    return 300.0 + np.cumsum(moves, axis=-1)


def open_loop(d, seed, noise, n=3, N=300):
    """Simulate (8) with an outflow independent of the level."""
    rng = np.random.default_rng([seed, d])
    u, o = programme(rng, (n, N)), programme(rng, (n, N))
    h = difference_equation(u - u[:, :1], o - o[:, :1], d, ALPHA_I, ALPHA_O)
    v = noise * rng.normal(size=(n, N))
    return u, o, 118.0 + h + v - v[:, :1]


def regulated(d, seed, noise, n=3, N=300):
    """Simulate (10): reach and operators together, with v shaped as in (10)."""
    rng = np.random.default_rng([seed, d])
    u = programme(rng, (n, N))
    h = theoretical_fir(N, d, ALPHA_I, ALPHA_O, K_Q, K_H)
    level = np.stack([np.convolve(row, h)[:N] for row in u - u[:, :1]])
    v = noise * rng.normal(size=(n, N))
    v[:, 0] = 0.0
    return u, 118.0 + level + lfilter([1.0, -1.0], [1.0, -(K_H * ALPHA_O + 1.0)], v)


def before(x, k):
    """Return x[k] of a signal that is zero before its first sample."""
    return x[k] if k >= 0 else 0.0


def integrated(x):
    """Return x^f, sample by sample."""
    x_f, total = [], 0.0
    for value in x:
        total += value - x[0]
        x_f.append(total)
    return x_f


def plain(target, phi, N, delays):
    """Compute Table IV: J and theta of every candidate; phi(k, d) returns the row."""
    J, theta = [], []
    for d in delays:
        rows = np.array([phi(k, d) for k in range(N)])
        scale = np.sqrt((rows**2).sum(axis=0))
        solution = np.linalg.lstsq(rows / scale, np.array(target))[0] / scale
        J.append(np.mean([0.5 * (target[k] - rows[k] @ solution) ** 2 for k in range(N)]))
        theta.append(solution)
    return np.array(J), np.array(theta)


def plain_direct(u, o, h, delays):
    u_f, o_f = integrated(u), integrated(o)
    return plain(h - h[0], lambda k, d: [before(u_f, k - 1 - d), -before(o_f, k - 1)], len(h), delays)


def plain_indirect(u, h, delays):
    u_f, h_f = integrated(u), integrated(h)
    return plain(
        h_f, lambda k, d: [before(h_f, k - 1), before(u_f, k - 1), before(u_f, k - d - 1)], len(h), delays
    )


@pytest.fixture(scope="module")
def season():
    return simulate(Scenario(days=40, seed=3))


def agree(found, loops, i, rtol, theta_rtol):
    """Check that day i of a result equals the plain loops."""
    J, theta = loops
    np.testing.assert_allclose(found.criterion[i], J, rtol=rtol)
    assert found.delay[i] == found.candidates[np.argmin(J)]
    np.testing.assert_allclose(found.parameters[i], theta[np.argmin(J)], rtol=theta_rtol)
    assert found.noise_variance[i] == pytest.approx(2 * J.min(), rel=rtol)


@pytest.mark.parametrize("seed", range(examples(3, 1)))
def test_both_searches_are_the_plain_loops_with_least_squares(seed):
    d = 3 + 2 * seed
    u, o, h = open_loop(d, seed, noise=0.003, n=2, N=200)
    found, delays = direct(u, o, h, d_max=12), range(1, 13)
    for i in range(2):
        agree(found, plain_direct(u[i], o[i], h[i], delays), i, 1e-8, 1e-8)
    u, h = regulated(d, seed, noise=0.003, n=2, N=200)
    found = indirect(u, h, d_max=12)
    for i in range(2):
        agree(found, plain_indirect(u[i], h[i], delays), i, 1e-7, 1e-6)


@pytest.mark.parametrize("noise", [0.0, 0.0005])
@pytest.mark.parametrize(
    ("search", "reach", "theta"),
    [
        (direct, open_loop, [ALPHA_I, ALPHA_O]),
        (indirect, regulated, [K_H * ALPHA_O + 1, -K_Q * ALPHA_O, ALPHA_I]),
    ],
)
def test_a_search_finds_every_delay_of_its_own_model(search, reach, theta, noise):
    for d, seed in itertools.product(range(2, 15), range(examples(3, 1))):
        found = search(*reach(d, seed, noise))
        assert found.delay.tolist() == [d] * 3, (d, seed)
        if noise == 0.0:
            np.testing.assert_allclose(found.parameters, [theta] * 3, rtol=1e-7)
            assert (found.noise_variance < 1e-18).all()


@pytest.mark.parametrize("size", [1, 7, BLOCK + 4])
def test_a_days_bits_do_not_depend_on_its_neighbours(size, season):
    u, o, h = (np.tile(x, (5, 1)) for x in (season.inflow, season.outflow, season.level))
    days = np.random.default_rng(size).permutation(len(u))[:size]
    for search, series in ((direct, (u, o, h)), (indirect, (u, h))):
        whole, part = search(*series), search(*(x[days] for x in series))
        for f in fields(whole):
            if f.name not in ("candidates", "names"):
                np.testing.assert_array_equal(getattr(part, f.name), getattr(whole, f.name)[days])


def test_days_without_motion_have_a_reason_and_leave_the_others_alone():
    u, o, h = open_loop(5, 1, 0.001, n=6)
    alone = direct(u[5], o[5], h[5])
    h[0], u[1], o[2] = 118.0, 300.0, 250.0
    u[3, :-16] = 300.0
    o[4] = 300.0 + 0.7 * np.r_[np.full(3, u[4, 0]), u[4, :-3]]
    found = direct(u, o, h)
    words = ["level never", "inflow never", "outflow never", "last d_max + 1 = 16 samples", "move as one", ""]
    assert all(w in reason for w, reason in zip(words, found.reason, strict=True)), found.reason
    assert found.status.tolist() == ["unidentifiable"] * 5 + ["ok"]
    for values in (found.delay, found.criterion, found.parameters, found.noise_variance):
        assert np.isnan(values[:5]).all() and np.isfinite(values[5]).all()
    assert found.delay[5] == alone.delay
    reasons = indirect(u, h).reason
    assert [bool(r) for r in reasons] == [True, True, False, True, False, False]


def test_one_day_comes_without_an_axis_of_days_and_deviations_are_as_good_as_readings():
    u, o, h = open_loop(4, 3, 0.0005)
    found, days = direct(u[0] - u[0, 0], o[0] - o[0, 0], h[0] - h[0, 0]), direct(u, o, h)
    assert found.delay.shape == () and found.criterion.shape == (15,) and found.parameters.shape == (2,)
    assert found.status == "ok" and found.identifiable
    np.testing.assert_array_equal(found.criterion, days.criterion[0])
    assert indirect(u[0], h[0]).parameters.shape == (3,)
