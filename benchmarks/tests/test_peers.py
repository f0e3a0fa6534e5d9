"""Test that the peers are right on easy days, and that each is the method of its name."""

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import multivariate_normal
from threadpoolctl import threadpool_limits

from benchmarks.peers import arx, crosscorrelation, impulse
from benchmarks.peers.__main__ import page
from benchmarks.peers.running import (
    CANDIDATES,
    NEEDS,
    OURS,
    PEERS,
    POSTERIOR,
    Run,
    Tally,
    check,
    errors,
    installed,
    run,
)
from benchmarks.peers.signals import deviations, easy_days, lagged
from benchmarks.posterior.worlds import World
from rivid.errors import RividError

HERE = installed()


@pytest.fixture(autouse=True)
def one_thread():
    """Use one thread: on matrices this small, threads cost a hundred times the computation."""
    with threadpool_limits(1):
        yield


@pytest.mark.parametrize("name", HERE)
def test_a_peer_finds_the_delay_of_easy_days(name):
    for seed in (1, 2):
        for delay in (3, 8, 12):
            for memory in (1.0, 0.9):
                found = HERE[name](*easy_days(4, delay, seed, memory), CANDIDATES)
                assert np.mean(found == delay) >= 0.75 and np.all(np.abs(found - delay) <= 1), (delay, memory)


def test_all_but_what_needs_the_bench_extra_is_here():
    assert set(HERE) >= {name for name, peer in PEERS.items() if peer not in NEEDS}
    assert sorted(NEEDS.values()) == ["ruptures", "sysidentpy"]


def test_the_posterior_finds_the_travel_time_of_easy_days_which_lies_between_two_delays():
    for delay in (3, 8):
        found = OURS[POSTERIOR](*easy_days(4, delay, 1), CANDIDATES)
        assert np.isin(found, (delay - 1, delay)).all()


def test_a_peer_that_is_broken_is_refused():
    good = {"arx": arx.delays}
    assert check(good) == {"arx": 1.0}

    def late(u, y, o, candidates):
        return arx.delays(u, y, o, candidates) + 1

    with pytest.raises(RividError, match="late: right on 0.00 of the easy days"):
        check(good | {"late": late})


def test_the_arx_scan_is_that_of_whole_regressions():
    u, y, o = easy_days(5, 6, 3, noise=0.02)
    rows = slice(18, y.shape[1])
    want = []
    for a, b, c in zip(u, y, o, strict=True):
        left = []
        for d in CANDIDATES:
            X = np.column_stack(
                [lagged(b, (1, 2), rows), lagged(a, (d + 1, d + 2), rows), lagged(c, (1, 2), rows)]
            )
            X = np.column_stack([X, np.ones(len(X))])
            left.append(np.sum((b[rows] - X @ np.linalg.pinv(X) @ b[rows]) ** 2))
        want.append(CANDIDATES[np.argmin(left)])
    np.testing.assert_array_equal(arx.delays(u, y, o, CANDIDATES), want)


@pytest.mark.parametrize("tuned", [False, True], ids=["TC", "DC"])
def test_the_marginal_likelihood_is_that_of_all_samples_at_once_and_its_slopes_are_right(tuned):
    rng = np.random.default_rng(4)
    n, order = 60, 5
    X, y = rng.normal(size=(n, 2 * order)), rng.normal(size=n)
    G, b, yy = X.T @ X, X.T @ y, float(y @ y)

    def cost(theta):
        return impulse.marginal_cost(theta, G, b, yy, n, order, tuned)[0]

    def dense(theta):
        halves = [impulse.kernel(part, order, tuned)[0] for part in np.split(theta, 2)]
        K = np.block([[halves[0], np.zeros((order, order))], [np.zeros((order, order)), halves[1]]])
        R = np.eye(n) + X @ K @ X.T
        variance = float(y @ np.linalg.solve(R, y)) / n
        return -2.0 * multivariate_normal(np.zeros(n), variance * R).logpdf(y)

    one = [-1.0, 1.0, 0.7] if tuned else [-1.0, 1.0]
    first, second = np.array(one * 2), np.array(one * 2) + rng.normal(scale=0.3, size=2 * len(one))
    assert cost(first) - cost(second) == pytest.approx(dense(first) - dense(second), abs=1e-8)
    slopes = impulse.marginal_cost(second, G, b, yy, n, order, tuned)[1]
    np.testing.assert_allclose(slopes, approx_fprime(second, cost, 1e-6), atol=1e-3)


def test_the_tc_kernel_is_the_later_of_two_lags():
    K = impulse.kernel(np.array([0.3, 1.2]), 6, False)[0]
    decay = 1.0 / (1.0 + np.exp(-1.2))
    lag = np.arange(1, 7)
    np.testing.assert_allclose(K, np.exp(0.3) * decay ** np.maximum(lag[:, None], lag))


def test_the_regularised_response_is_the_true_one_on_easy_days():
    u, y, o = easy_days(1, 5, 0, 0.7, n=3000, noise=1e-5)
    h = impulse.response(*(x[0] for x in deviations(u, y, o)), tuned=True)
    true = np.zeros(30)
    true[5:] = 2e-4 * 0.7 ** np.arange(25)
    true[6:] -= 2e-4 * 0.7 ** np.arange(24)
    np.testing.assert_allclose(h, true, atol=2e-6)


def test_the_jump_is_that_of_trying_all_pairs_of_changes():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        step = np.cumsum(rng.normal(size=14)) + 3.0 * (np.arange(14) >= rng.integers(2, 12))
        parts = {pair: np.split(step, pair) for pair in combinations(range(1, 14), 2)}
        best = min(parts, key=lambda pair: sum(np.sum((x - x.mean()) ** 2) for x in parts[pair]))
        means = [x.mean() for x in parts[best]]
        assert impulse.jump(step) == best[int(np.argmax(np.diff(means)))]


def test_whitening_finds_an_autoregression():
    rng = np.random.default_rng(5)
    x = np.zeros(20000)
    for k in range(2, len(x)):
        x[k] = 1.2 * x[k - 1] - 0.5 * x[k - 2] + rng.normal()
    np.testing.assert_allclose(crosscorrelation.whitening(x)[:3], [1.0, -1.2, 0.5], atol=0.03)
    np.testing.assert_array_equal(crosscorrelation.whitening(np.zeros(50)), [1.0])


def test_either_neighbour_of_an_edge_is_right():
    nothing = np.zeros((3, 2))
    world = World("", nothing, nothing, nothing, np.array([6, 6, 6]), np.array([6.5, 6.95, 6.05]), 133.0)
    assert errors(np.array([7, 7, 5]), world).tolist() == [1, 0, 0]
    assert errors(np.array([6, 6, 6]), world).tolist() == [0, 0, 0]


def test_a_run_counts_the_days_of_every_world_and_the_page_holds_them():
    def always_six(u, y, o, candidates):
        return np.full(len(u), 6)

    found = run({POSTERIOR: OURS[POSTERIOR], "six": always_six}, "proof", range(1), 4)
    six = found.tallies["six"]
    n_linear, n_other = len(six.of(True)), len(six.of(False))
    assert n_linear == 4 * sum(name.startswith("linear") for name in six.world) > 0
    assert n_other > 0 and n_linear + n_other == 4 * len(six.world) == len(found.answered)
    assert found.constant[True] >= np.mean(six.of(True) == 0)
    text = page(found, {"six": 1.0}, "a machine", "tables")
    assert f"Linear worlds: {n_linear} days" in text and f"Hydraulic worlds: {n_other} days" in text


def test_the_page_counts_what_is_exact_and_within_one():
    tally = Tally(["linear", "other"], [np.array([0, 1, 2, 0]), np.array([0, 0])], [1.0, 3.0])
    text = page(
        Run({POSTERIOR: tally}, np.array([1, 0, 0, 1, 1, 1], bool), {True: 0.25, False: 0.5}), {}, "", ""
    )
    assert "| posterior | 0.500 (0.150-0.850) | 0.750 (0.301-0.954) | 1.00 |" in text
    assert "the 50% that it answers | 1.000" in text
    assert "| posterior | 1.000 (0.342-1.000) | 1.000 (0.342-1.000) | 3.00 |" in text
