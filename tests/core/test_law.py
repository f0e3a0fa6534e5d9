"""The law against scipy, against known laws with related days, and what it refuses."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import lfilter
from scipy.stats import t as student

from rivid.core.law import BAND_SD, LawSettings, alike, block_covariance, bulk, delay_law, fit_line
from rivid.errors import RividError
from tests import examples

T0, B, Q0 = 7.5, 0.3, 280.0


def related(rng, n, memory):
    """An AR(1) of unit variance."""
    rho = np.exp(-1.0 / memory) if memory else 0.0
    shocks = rng.standard_normal(n + 200)
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], shocks)[200:]


def river(seed, n=330, b=B, memory=8.0, scatter_memory=3.0, scatter=0.03, own=(0.01, 0.05), wrong=0.0):
    """Days of a known law: discharge and scatter are related from day to day; some days are wrong."""
    rng = np.random.default_rng(seed)
    Q = Q0 * np.exp(0.5 * related(rng, n, memory))
    sd = rng.uniform(*own, n)
    log_T = (
        np.log(T0) - b * np.log(Q / Q0) + scatter * related(rng, n, scatter_memory) + sd * rng.normal(size=n)
    )
    bad = rng.random(n) < wrong
    log_T[bad] += rng.choice([-1.0, 1.0], bad.sum()) * rng.uniform(0.3, 1.0, bad.sum())
    half = 0.5 * BAND_SD * sd
    return Q, np.exp(log_T), np.exp(log_T - half), np.exp(log_T + half)


@pytest.mark.parametrize("seed", range(examples(4, 1)))
def test_the_robust_line_and_its_scatter_are_the_most_likely_ones_under_students_t(seed):
    Q, T, low, high = river(seed, wrong=0.05)
    law = delay_law(Q, T, low, high)
    x, y, own = np.log(Q / law.Q0), np.log(T), np.log(high / low) / BAND_SD

    def cost(theta):
        scale = bulk(4.0) * np.hypot(own, np.exp(theta[2]))
        return -student.logpdf((y - theta[0] - theta[1] * x) / scale, 4.0).sum() + np.log(scale).sum()

    best = minimize(
        cost, [2.0, -0.1, -3.0], method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-9, "maxiter": 4000}
    )
    np.testing.assert_allclose(
        [np.log(law.T0), -law.b, law.scatter], [best.x[0], best.x[1], np.exp(best.x[2])], atol=2e-5
    )


@pytest.mark.parametrize("seed", range(examples(3, 1)))
def test_with_errors_in_both_variables_it_is_the_line_of_orthogonal_distances(seed):
    rng = np.random.default_rng(seed)
    true = rng.normal(size=200)
    own = rng.uniform(0.1, 0.3, 200)
    x, y = true + 0.3 * rng.normal(size=200), 1.0 - 0.7 * true + own * rng.normal(size=200)
    fit = fit_line(x, y, np.hypot(own, 0.05), 0.3, 1e9)
    sy = np.hypot(np.hypot(own, 0.05), fit.scatter)

    def far(theta):  # every true x free, and taken at its best: the distances from the line
        return np.sum((y - theta[0] - theta[1] * x) ** 2 / (sy**2 + (0.3 * theta[1]) ** 2))

    best = minimize(far, [1.0, -0.5], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-10})
    np.testing.assert_allclose([fit.offset, fit.slope], best.x, atol=1e-6)


def test_errors_of_the_discharge_do_not_flatten_the_law_where_they_are_known():
    plain, known = [], []
    for seed in range(10):
        Q, T, low, high = river(seed, scatter_memory=0.0)
        read = Q * np.exp(0.2 * np.random.default_rng([seed, 1]).normal(size=len(Q)))
        plain.append(delay_law(read, T, low, high).b)
        known.append(delay_law(read, T, low, high, settings=LawSettings(discharge_error=0.2)).b)
    assert abs(np.mean(known) - B) < 3.0 * np.std(known) / np.sqrt(10)
    assert np.mean(plain) < B - 3.0 * np.std(plain) / np.sqrt(10)


def test_the_blocks_left_out_one_by_one_are_lines_fitted_without_them():
    Q, T, low, high = river(3, n=95)
    x, y = np.log(Q / Q0), np.log(T)
    fit = fit_line(x, y, np.log(high / low) / BAND_SD, 0.0, 4.0)
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
        # within its Monte Carlo error; what few and related blocks cost may not pass 0.03
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
        found.append(alike(np.arange(3000), x, y, fit_line(x, y, np.full(3000, 1e-4), 0.0, 1e9)))
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
        np.testing.assert_allclose(got, want, rtol=2e-3)  # of a median of logarithms, and of the median


def test_the_band_of_a_day_holds_the_delays_of_days():
    held = []
    for seed in range(examples(20, 10)):
        rng = np.random.default_rng([seed, 3])
        Q = Q0 * np.exp(0.5 * rng.normal(size=400))
        true = T0 * (Q / Q0) ** -B * np.exp(0.03 * student.rvs(4.0, size=400, random_state=rng))
        read = true * np.exp(0.02 * rng.normal(size=400))
        table = delay_law(
            Q, read, read * np.exp(-0.0329), read * np.exp(0.0329), settings=LawSettings(classes=40)
        ).table
        row = np.searchsorted(table.discharge_high, Q)
        scale = true * (Q / table.discharge[row]) ** B  # brought to the class's discharge
        held.append(np.mean((table.day_low[row] <= scale) & (scale <= table.day_high[row])))
    assert abs(np.mean(held) - 0.9) < 0.015


def test_days_without_a_place_do_not_count():
    Q, T, low, high = river(4, n=120)
    keep = np.arange(120) % 7 != 3
    T, low = T.copy(), low.copy()
    T[~keep], Q[5] = np.nan, -1.0
    keep[5] = False
    law = delay_law(Q, T, low, high)
    short = delay_law(Q[keep], T[keep], low[keep], high[keep], day=np.flatnonzero(keep))
    assert (law.b, law.T0, law.days) == (short.b, short.T0, short.days) == (law.b, law.T0, keep.sum())
    np.testing.assert_array_equal(law.covariance, short.covariance)


def test_too_few_days_and_an_even_discharge_give_no_law():
    few = delay_law(*river(0, n=40))
    assert (few.status, few.blocks, len(few.table.n)) == ("too_few_days", 3, 0) and np.isnan(few.b)
    assert "in 3 blocks" in few.message and "6 blocks are needed" in few.message
    assert "in 1 block of" in delay_law(*river(0, n=7)).message
    _, T, low, high = river(0)
    even = delay_law(np.linspace(300.0, 310.0, 330), T, low, high)
    assert even.status == "even_discharge" and "300 to 310 m3/s" in even.message
    assert delay_law([], [], [], []).status == "too_few_days"


@pytest.mark.parametrize(
    ("Q", "place", "high", "words"),
    [([[1.0]], [[1.0]], [[1.0]], "expected .days,"), ([1.0, 2.0], [1.0], [1.0], "place has shape"),
     ([1.0, 2.0], [1.0, 1.0], [1.0], "place_high has shape"), ([1.0, 2.0], [1.0, 1.0], [1.0, 1.0],
      "does not rise")],
)  # fmt: skip
def test_shapes_that_do_not_fit_are_refused(Q, place, high, words):
    with pytest.raises(RividError, match=words):
        delay_law(Q, place, place, high, day=[3, 3] if "rise" in words else None)
