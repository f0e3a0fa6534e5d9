"""Test JMAP against the transcription of Tables V and VI, and its properties for any data."""

import numpy as np
import pytest

from rivid.core.fir import BLOCK, jmap
from rivid.core.settings import JmapSettings
from rivid.simulation import simulate
from rivid.simulation.scenario import Scenario
from tests import examples
from tests.core import transcription
from tests.core.transcription import table_v, table_vi, toeplitz_matrix

N = 649
PER_DAY = ("delay", "fir", "alpha", "noise_variance", "roughness_variance", "criterion")


def season(n, seed=0, noise=0.003):
    """Return held commands, a response with two jumps (10), drift and gauge noise; and the true delays."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(n, N)) * (rng.random((n, N)) < 0.1) * 15
    u = np.cumsum(steps, axis=1).round()
    u -= u[:, :1]
    delays = rng.integers(3, 13, n)
    y = np.empty_like(u)
    for i, d in enumerate(delays):
        h = np.r_[0.0, -1.2e-4 * 0.95 ** np.arange(59)]
        h[d + 1 :] += 1e-4 * 0.95 ** np.arange(59 - d)
        drift = np.cumsum(rng.normal(size=N)) * 2e-4
        y[i] = np.convolve(u[i], h)[:N] + drift + rng.normal(size=N) * noise
    return u, y - y[:, :1], delays


@pytest.mark.parametrize("seed", range(examples(3, 1)))
@pytest.mark.parametrize(
    ("settings", "slow"),
    [
        (JmapSettings(), {}),
        (JmapSettings(prior="uniform"), {"sigma_d": None}),
        (JmapSettings(delay_scale=10.0, d_init=4), {"sigma_d": 10.0, "d_init": 4}),
        (JmapSettings(order=20, d_min=2, d_max=17), {}),
        (JmapSettings(order=50, d_max=30, delay_scale=9.0), {"sigma_d": 9.0}),
    ],
)
def test_table_vi_as_transcribed(seed, settings, slow):
    u, y, _ = season(8, seed)
    result = jmap(u, y, settings)
    delays = list(range(settings.d_min, settings.d_max + 1))
    assert result.candidates.tolist() == delays
    for i in range(len(u)):
        d, h, criterion, s_w, s_h, iterations = table_vi(u[i], y[i], settings.order, delays, **slow)
        assert result.delay[i] == d
        assert result.iterations[i] == iterations
        assert np.allclose(result.fir[i], h, rtol=0, atol=1e-9 * np.abs(h).max())
        assert np.allclose(result.criterion[i], criterion, rtol=1e-9, atol=1e-6)
        assert result.noise_variance[i] == pytest.approx(s_w, rel=1e-8)
        assert result.roughness_variance[i] == pytest.approx(s_h, rel=1e-7)
        assert result.alpha[i] == pytest.approx(s_w / s_h, rel=1e-7)


@pytest.mark.parametrize("alpha", [10.0, 1e3, 1e4])
def test_table_v_as_transcribed(alpha):
    u, y, _ = season(6, 3)
    result = jmap(u, y, prior="uniform", alpha=alpha)
    for i in range(len(u)):
        d, h, criterion = table_v(u[i], y[i], 30, range(1, 16), alpha)
        assert result.delay[i] == d
        assert np.allclose(result.fir[i], h, rtol=0, atol=1e-9 * np.abs(h).max())
        assert np.allclose(result.criterion[i], criterion, rtol=1e-8)
    assert (result.iterations == 1).all()
    assert np.allclose(result.alpha, alpha)


def test_a_free_start_is_table_vi_on_the_full_rows_less_their_means(monkeypatch):
    u, y, _ = season(8, 2)
    result = jmap(u, y + 0.3, free_start=True)

    def full_rows(u, order):
        U = toeplitz_matrix(u, order)[order - 1 :]
        return U - U.mean(axis=0)

    monkeypatch.setattr(transcription, "toeplitz_matrix", full_rows)
    for i in range(len(u)):
        rows = y[i][29:]
        d, h, criterion, s_w, _, iterations = table_vi(u[i], rows - rows.mean(), 30, list(range(1, 16)))
        assert (result.delay[i], result.iterations[i]) == (d, iterations)
        assert np.allclose(result.fir[i], h, rtol=0, atol=1e-8 * np.abs(h).max())
        assert np.allclose(result.criterion[i], criterion, rtol=1e-9, atol=1e-6)
        assert result.noise_variance[i] == pytest.approx(s_w, rel=1e-8)


def test_jumps_at_the_delay_alone_as_transcribed(monkeypatch):
    def free_at_the_delay(order, d):
        D = transcription.second_differences(order)
        D[d + 1 : d + 3] = 0.0
        return D

    monkeypatch.setattr(transcription, "jump_matrix", free_at_the_delay)
    u, y, _ = season(8, 4)
    for changes in ({}, {"inverse_gamma": False, "max_iterations": 4}):
        result = jmap(u, y, jumps="delay", **changes)
        for i in range(len(u)):
            slow = {"inverse_gamma": False, "most": 4} if changes else {}
            d, h, _, s_w, s_h, iterations = table_vi(u[i], y[i], 30, list(range(1, 16)), **slow)
            if s_w / s_h < 1e8:
                assert (result.delay[i], result.iterations[i]) == (d, iterations)
                assert np.allclose(result.fir[i], h, rtol=0, atol=1e-6 * np.abs(h).max())
    fixed = jmap(u, y, prior="uniform", alpha=1e4, jumps="delay")
    assert fixed.delay.tolist() == [
        table_v(a, b, 30, range(1, 16), 1e4)[0] for a, b in zip(u, y, strict=True)
    ]


def test_the_priors_parameters_enter_37_38_and_35():
    u, y, _ = season(6, 9)
    given = {"alpha_h": 4.0, "beta_h": 3e-9, "alpha_w": 50.0, "beta_w": 0.02}
    result = jmap(u, y, tolerance=1e-7, **given)
    D = [transcription.jump_matrix(30, int(d)) for d in result.delay]
    for i, h in enumerate(result.fir):
        fidelity = np.sum((y[i] - toeplitz_matrix(u[i], 30) @ h) ** 2)
        rough = np.sum((D[i] @ h) ** 2)
        s_w, s_h = (fidelity + 2 * 0.02) / (N + 2 * 51.0), (rough + 2 * 3e-9) / (30 + 2 * 5.0)
        assert result.noise_variance[i] == pytest.approx(s_w, rel=1e-5)
        assert result.roughness_variance[i] == pytest.approx(s_h, rel=1e-4)
        d = result.delay[i]
        J = (fidelity + 0.04) / s_w + (rough + 6e-9) / s_h + (N + 102.0) * np.log(s_w) + 40.0 * np.log(s_h)
        assert result.criterion[i, int(d) - 1] == pytest.approx(J + d**2 / 6.5**2 - 2 * np.log(d), rel=1e-6)
    paper = jmap(u, y, alpha_h=15.0)
    assert np.array_equal(paper.criterion, jmap(u, y).criterion)


def test_a_trace_holds_the_variances_of_every_iteration_and_an_unsettled_day_is_no_ok():
    u, y, _ = season(6, 2)
    result = jmap(u, y, trace=True)
    assert result.trace.shape == (6, result.iterations.max(), 2)
    for i, last in enumerate(result.iterations):
        assert np.isfinite(result.trace[i, :last]).all() and np.isnan(result.trace[i, last:]).all()
        assert result.trace[i, last - 1].tolist() == [result.noise_variance[i], result.roughness_variance[i]]
        moved = np.abs(result.trace[i, last - 1] / result.trace[i, last - 2] - 1)
        assert (moved < 1e-3).all()
    assert jmap(u[0], y[0], trace=True).trace.tolist() == result.trace[0, : result.iterations[0]].tolist()
    assert jmap(u, y).trace is None
    assert set(jmap(u, y, max_iterations=2).status) == {"degenerate"}


def test_without_the_inverse_gamma_prior_alpha_runs_away_as_transcribed():
    u, y, _ = season(12, 4)
    result = jmap(u, y, inverse_gamma=False, max_iterations=4)
    compared = 0
    for i in range(len(u)):
        d, _, _, s_w, s_h, _ = table_vi(u[i], y[i], 30, range(1, 16), inverse_gamma=False, most=4)
        if s_w / s_h < 1e8:  # above this ratio the plain solution has too few digits for a comparison
            assert result.alpha[i] == pytest.approx(s_w / s_h, rel=1e-3)
            assert result.delay[i] == d
            compared += 1
    assert compared >= 6
    ran = jmap(u, y, inverse_gamma=False)
    assert (ran.alpha > 100 * jmap(u, y).alpha).all()
    assert set(ran.status) <= {"ok", "degenerate"}
    assert (ran.status == "degenerate").any()
    assert np.isfinite(ran.fir).all()


@pytest.mark.parametrize(
    "settings",
    [
        JmapSettings(),
        JmapSettings(prior="uniform", alpha=1e4),
        JmapSettings(inverse_gamma=False),
        JmapSettings(free_start=True),
    ],
)
def test_a_days_bits_do_not_depend_on_its_batch(settings):
    u, y, _ = season(BLOCK + 5, 5)
    whole = jmap(u, y, settings)
    order = np.random.default_rng(0).permutation(len(u))
    permuted = jmap(u[order], y[order], settings)
    sevens = [jmap(u[i : i + 7], y[i : i + 7], settings) for i in range(0, 35, 7)]
    ones = [jmap(u[i], y[i], settings) for i in range(0, BLOCK, 20)]
    for name in PER_DAY:
        column = getattr(whole, name)
        assert np.array_equal(getattr(permuted, name), column[order])
        assert np.array_equal(np.concatenate([getattr(part, name) for part in sevens]), column[:35])
        assert np.array_equal(np.stack([getattr(part, name) for part in ones]), column[:BLOCK:20])


def test_unrelated_output_is_the_priors_answer_and_says_so():
    season_ = simulate(Scenario(days=150), 3)
    u, y = (x - x[:, :1] for x in (season_.inflow, season_.level))
    matched, shuffled = jmap(u, y), jmap(np.roll(u, 50, axis=0), y)
    assert shuffled.prior_only.mean() > 0.9
    assert np.isin(shuffled.delay, [6, 7]).mean() > 0.95
    assert matched.prior_only.mean() < 0.6
    sure = ~matched.prior_only
    error = np.minimum(abs(matched.delay - season_.delay), abs(matched.delay - season_.delay_other))
    assert (error[sure] <= 1).mean() > 0.93


def test_motionless_days_are_unidentifiable_and_leave_the_others_alone():
    u, y, _ = season(6, 9)
    alone = jmap(u[[0, 3]], y[[0, 3]])
    u[1] = 0.0
    y[2] = 0.0
    u[4], u[4, -5:] = 0.0, 3.0  # one step at the very end: U'U has rank 5
    result = jmap(u, y)
    assert result.status.tolist() == ["ok", "unidentifiable", "unidentifiable", "ok", "unidentifiable", "ok"]
    for name in PER_DAY:
        assert np.isnan(getattr(result, name)[[1, 2, 4]]).all()
        assert np.array_equal(getattr(result, name)[[0, 3]], getattr(alone, name))
