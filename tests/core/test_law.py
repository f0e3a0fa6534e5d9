"""Test the law against scipy, against known laws with correlated days, and its refusals."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import lfilter
from scipy.stats import t as student

from rivid.core.law import BULK, OWN, alike, block_covariance, delay_law, fit_line
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
def test_the_robust_line_and_its_scatter_are_the_most_likely_ones_under_students_t(seed):
    Q, T = river(seed, wrong=0.05)
    law = delay_law(Q, T)
    x, y = np.log(Q / law.Q0), np.log(T)

    def cost(theta):
        scale = np.hypot(OWN, BULK * np.exp(theta[2]))
        return -student.logpdf((y - theta[0] - theta[1] * x) / scale, 4.0).sum() + len(x) * np.log(scale)

    best = minimize(
        cost, [2.0, -0.1, -3.0], method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-9, "maxiter": 4000}
    )
    np.testing.assert_allclose(
        [np.log(law.T0), -law.b, law.scatter], [best.x[0], best.x[1], np.exp(best.x[2])], atol=2e-5
    )


def test_the_scale_of_the_tails_is_that_of_a_normal_bulk():
    z, p = np.polynomial.hermite_e.hermegauss(80)
    assert p @ (5.0 * z**2 / (4.0 * BULK**2 + z**2)) / p.sum() == pytest.approx(1.0, abs=1e-10)


def test_the_blocks_left_out_one_by_one_are_lines_fitted_without_them():
    Q, T = river(3, n=95)
    x, y = np.log(Q / Q0), np.log(T)
    fit = fit_line(x, y)
    block = np.arange(95) // 10
    assert 0.5 < fit.firmness < 1.0
    lines = [
        np.polyfit(x[block != g], y[block != g], 1, w=np.sqrt(fit.weight[block != g]))[::-1]
        for g in range(10)
    ]
    away = np.array(lines) - [fit.offset, fit.slope]
    np.testing.assert_allclose(
        block_covariance(x, y, fit, block), 0.9 * away.T @ away / fit.firmness**2, rtol=1e-6
    )


@pytest.mark.parametrize(
    ("n", "scatter_memory", "wrong"),
    [(330, 0.0, 0.0), (330, 3.0, 0.0), (330, 3.0, 0.05), (100, 3.0, 0.0)],
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


def test_the_correlation_time_is_that_of_an_autoregression_and_blocks_grow_with_it():
    short, middle, long = (
        np.mean([delay_law(*river([s, 5], scatter_memory=m, own=(0.005, 0.01))).blocks for s in range(10)])
        for m in (0, 3, 9)
    )
    assert short > 20 > middle > long >= 6
    x, rho = np.linspace(-1.0, 1.0, 3000), np.exp(-1.0 / 3.0)
    found = []
    for seed in range(20):
        y = 1.0 - x + related(np.random.default_rng(seed), 3000, 3.0)
        found.append(alike(np.arange(3000), x, y, fit_line(x, y)))
    assert np.mean(found) == pytest.approx((1 + rho) / (1 - rho), rel=0.15)


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
