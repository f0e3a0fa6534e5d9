"""Test the law against a random walk, against known laws, with related days or delays in steps; refusals."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student

from rivid.core.law import BULK, SCATTERS, STEEPEST, alike, delay_law
from rivid.errors import RividError
from tests import examples

T0, B, Q0 = 7.5, 0.3, 280.0


def related(rng, n, memory):
    """Return an AR(1) process of unit variance."""
    rho = np.exp(-1.0 / memory) if memory else 0.0
    shocks = rng.standard_normal(n + 200)
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], shocks)[200:]


def river(seed, n=330, memory=8.0, scatter_memory=3.0, own=(0.01, 0.05), wrong=0.0):
    """Return days of a known law: discharge and scatter are correlated between days; some days are wrong."""
    rng = np.random.default_rng(seed)
    Q = Q0 * np.exp(0.5 * related(rng, n, memory))
    sd = rng.uniform(*own, n)
    log_T = np.log(T0) - B * np.log(Q / Q0) + 0.03 * related(rng, n, scatter_memory) + sd * rng.normal(size=n)
    bad = rng.random(n) < wrong
    log_T[bad] += rng.choice([-1.0, 1.0], bad.sum()) * rng.uniform(0.3, 1.0, bad.sum())
    return Q, np.exp(log_T)


@pytest.mark.parametrize("seed", range(examples(4, 1)))
def test_the_moments_are_those_of_a_random_walk_over_the_same_posterior(seed):
    Q, T = river(seed, n=100, scatter_memory=0.0, wrong=0.05)
    law = delay_law(Q, T)
    x, y, rng = np.log(Q / law.Q0), np.log(T), np.random.default_rng(seed)

    def log_p(theta):
        if abs(theta[1]) > STEEPEST or not SCATTERS[0] < np.exp(theta[2]) < SCATTERS[1]:
            return -np.inf
        z = (y - theta[0] + theta[1] * x) / np.exp(theta[2])
        return -2.5 * np.log1p(z * z / 4.0).sum() - len(x) * theta[2]

    at, walk = np.array([np.log(law.T0), law.b, np.log(BULK * law.scatter)]), []
    here, step = log_p(at), np.array([*np.sqrt(np.diag(law.covariance)), 0.1])
    for _ in range(20_000):
        there = at + 0.9 * step * rng.standard_normal(3)
        new = log_p(there)
        if np.log(rng.random()) < new - here:
            at, here = there, new
        walk.append(at)
    walk = np.array(walk)
    sd = walk.std(axis=0)
    assert (np.abs(walk.mean(axis=0)[:2] - [np.log(law.T0), law.b]) < 0.15 * sd[:2]).all()
    assert law.scatter == pytest.approx(np.sqrt(np.mean(np.exp(2.0 * walk[:, 2]))) / BULK, rel=0.02)
    # the blocks may widen it, by chance up to a half for eight of them
    ratio = np.sqrt(np.diag(law.covariance)) / sd[:2]
    assert (0.95 < ratio).all() and (ratio < 1.6).all()


def test_the_scale_of_the_tails_is_that_of_a_normal_bulk():
    z, p = np.polynomial.hermite_e.hermegauss(80)
    assert p @ (5.0 * z**2 / (4.0 * BULK**2 + z**2)) / p.sum() == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize(
    ("n", "scatter_memory", "wrong"),
    [
        pytest.param(330, 0.0, 0.0, marks=pytest.mark.long),
        pytest.param(330, 3.0, 0.0, marks=pytest.mark.long),
        (330, 3.0, 0.05),
        pytest.param(100, 3.0, 0.0, marks=pytest.mark.long),
    ],
    ids=["unrelated days", "related days", "some wrong days", "a hundred days"],
)
def test_a_known_law_is_found_and_its_intervals_hold_it(n, scatter_memory, wrong):
    seeds = examples(40, 16)
    laws = [delay_law(*river([s, n], n, scatter_memory=scatter_memory, wrong=wrong)) for s in range(seeds)]
    powers = np.array([law.b for law in laws])
    assert abs(powers.mean() - B) < 3.5 * powers.std() / np.sqrt(seeds)
    error = np.sqrt(0.9 * 0.1 / seeds)
    at = {"b": [law.b_low <= B <= law.b_high for law in laws]}
    for Q in (120.0, Q0, 600.0):
        truth = T0 * (Q / Q0) ** -B
        bands = [law.delay(Q) for law in laws]
        at[f"{Q:.0f} m3/s"] = [low <= truth <= high for _, low, high in bands]
    for name, held in at.items():
        # within its Monte Carlo error; the loss by few and correlated blocks may be 0.03 at most
        assert 0.9 - 0.03 - 3.0 * error < np.mean(held) < 0.9 + 0.03 + 3.0 * error, (name, np.mean(held))


@pytest.mark.long
def test_the_correlation_time_is_that_of_an_autoregression_and_blocks_grow_with_it():
    short, middle, long = (
        np.mean([delay_law(*river([s, 5], scatter_memory=m, own=(0.005, 0.01))).blocks for s in range(n)])
        for m, n in ((0, 3), (3, 20), (9, 5))
    )
    assert short > 20 > middle > long >= 6
    rho = np.exp(-1.0 / 3.0)
    found = [alike(np.arange(3000), related(np.random.default_rng(k), 3000, 3.0)) for k in range(20)]
    assert np.mean(found) == pytest.approx((1 + rho) / (1 - rho), rel=0.15)


def in_steps(seed, b, median, gate, noise, n=120, d_max=30):
    """Return days of which each fraction of a sample is 0.3, but for waves that pass as the sample ends.

    A gate of 1 shows all fractions. `b` and the median are those of the travel times [samples].
    """
    rng = np.random.default_rng(seed)
    Q = Q0 * np.exp(0.35 * related(rng, n, 8.0))
    T = median * np.exp(-b * np.log(Q / Q0) + 0.006 * rng.normal(size=n))
    whole = np.floor(T)
    left = whole + 1.0 - T
    delay = T if gate == 1.0 else whole + 0.3 + np.maximum(1.0 - left / gate, 0.0)
    delay = delay + noise * rng.normal(size=n)
    edges = np.arange(1.0, d_max + 2.0)
    below = 1.0 / (1.0 + np.exp(-(edges - delay[:, None]) / 0.1))
    p = np.diff(below, axis=1)
    return Q, delay, p / p.sum(axis=1, keepdims=True), edges


def law_in_steps(*given):
    Q, delay, p, edges = in_steps(*given)
    return delay_law(Q, delay, probability=p, edges=edges)


def test_an_interval_is_honest_where_the_delays_do_not_leave_their_sample():
    """The delays scatter by a hundredth of a sample, whatever the power is below 0.3."""
    for seed in range(examples(6, 3)):
        law = law_in_steps(seed, 0.1, 3.45, 0.1, 0.005)
        assert law.b_low < 0.1 < law.b_high and law.b_high - law.b_low > 0.1
        assert law.T0_low < 3.45 < law.T0_high and law.T0 == pytest.approx(3.45, abs=0.2)


@pytest.mark.parametrize(
    "gate",
    [0.05, *(pytest.param(gate, marks=pytest.mark.long) for gate in (0.3, 1.0))],
    ids=["steps", "some fractions", "all fractions"],
)
def test_the_interval_of_b_holds_it_whatever_a_delay_shows_of_its_fraction(gate):
    rng, held, error, wide = np.random.default_rng([7, int(100 * gate)]), [], [], []
    for seed in range(examples(100, 20)):
        b, median = rng.uniform(0.0, 0.4), np.exp(rng.uniform(np.log(1.5), np.log(20.0)))
        law = law_in_steps(seed, b, median, gate, 0.02)
        held.append(law.b_low <= b <= law.b_high)
        if median * b > 2.0:  # the delays pass several samples
            error.append(abs(law.b - b))
            wide.append(law.b_high - law.b_low)
    assert np.mean(held) > 0.9 - 3.0 * np.sqrt(0.09 / len(held))
    assert np.median(error) < 0.01 and np.median(wide) < 0.05


def test_where_the_days_show_their_fractions_the_law_is_as_sharp_as_with_known_travel_times():
    for seed in range(examples(6, 2)):
        Q, delay, p, edges = in_steps(seed, 0.15, 8.0, 1.0, 0.05)
        law, known = delay_law(Q, delay, probability=p, edges=edges), delay_law(Q, delay)
        assert law.b == pytest.approx(known.b, abs=0.003)
        assert law.b_high - law.b_low < 1.1 * (known.b_high - known.b_low)


def test_the_unit_of_the_delays_does_not_matter():
    Q, delay, p, edges = in_steps(1, 0.2, 6.0, 0.2, 0.02)
    law = delay_law(Q, delay, probability=p, edges=edges)
    seconds = delay_law(Q, 120.0 * delay, probability=p, edges=120.0 * edges)
    assert seconds.T0 == pytest.approx(120.0 * law.T0) and seconds.b == pytest.approx(law.b)
    assert seconds.table.high == pytest.approx(120.0 * law.table.high)


def test_the_table_holds_all_days_and_follows_the_law():
    days = river(2)
    law = delay_law(*days)
    table = law.table
    assert table.n.sum() == law.days == 330 and np.ptp(table.n) <= 1
    assert (np.diff(table.discharge) > 0).all() and (np.diff(table.delay) < 0).all()
    assert (table.discharge_low <= table.discharge).all() and (table.discharge <= table.discharge_high).all()
    assert (table.day_low < table.low).all() and (table.low < table.delay).all()
    assert (table.delay < table.high).all() and (table.high < table.day_high).all()
    np.testing.assert_allclose(table.observed, table.delay, rtol=0.05)
    middle, low, high = law.delay(table.discharge)
    for got, want in ((middle, table.delay), (low, table.low), (high, table.high)):
        np.testing.assert_allclose(got, want, rtol=2e-3)  # a median of logarithms is compared with the median


@pytest.mark.long
def test_the_band_of_a_day_holds_the_delays_of_days():
    held = []
    for seed in range(examples(20, 10)):
        rng = np.random.default_rng([seed, 3])
        Q = Q0 * np.exp(0.5 * rng.normal(size=400))
        true = T0 * (Q / Q0) ** -B * np.exp(0.03 * student.rvs(4.0, size=400, random_state=rng))
        table = delay_law(Q, true).table
        row = np.searchsorted(table.discharge_high, Q)
        scale = true * (Q / table.discharge[row]) ** B  # converted to the class's discharge
        held.append(np.mean((table.day_low[row] <= scale) & (scale <= table.day_high[row])))
    assert abs(np.mean(held) - 0.9) < 0.015


def test_days_without_a_delay_do_not_count():
    Q, T = river(4, n=120)
    keep = np.arange(120) % 7 != 3
    T = T.copy()
    T[~keep], Q[5] = np.nan, -1.0
    keep[5] = False
    law = delay_law(Q, T)
    short = delay_law(Q[keep], T[keep], day=np.flatnonzero(keep))
    assert (law.b, law.T0, law.days) == (short.b, short.T0, short.days) == (law.b, law.T0, keep.sum())
    np.testing.assert_array_equal(law.covariance, short.covariance)


def test_too_few_days_and_an_even_discharge_give_no_law():
    few = delay_law(*river(0, n=40))
    assert (few.status, few.blocks, len(few.table.n)) == ("too_few_days", 3, 0) and np.isnan(few.b)
    assert "in 3 blocks" in few.message and "6 blocks are needed" in few.message
    assert "in 1 block of" in delay_law(*river(0, n=7)).message
    _, T = river(0)
    even = delay_law(np.linspace(300.0, 310.0, 330), T)
    assert even.status == "even_discharge" and "300 to 310 m3/s" in even.message
    assert delay_law([], []).status == "too_few_days"


@pytest.mark.parametrize(
    ("Q", "T", "words"),
    [([[1.0]], [[1.0]], "expected .days,"), ([1.0, 2.0], [1.0], "delay has shape"),
     ([1.0, 2.0], [1.0, 1.0], "does not rise")],
)  # fmt: skip
def test_shapes_that_do_not_fit_are_refused(Q, T, words):
    with pytest.raises(RividError, match=words):
        delay_law(Q, T, day=[3, 3] if "rise" in words else None)
