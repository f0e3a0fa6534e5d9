"""The score test against brute force, its false rate, its power and its estimates."""

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.stats import t as student

from rivid.diagnosis.blocks import split
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.score import MODEL_SHARE, Candidate, scan
from rivid.errors import RividError

DAYS, N = 30, 24
BLOCKS = np.arange(DAYS) // 3


def library(seed, days=DAYS, n=N, k=1, p=3):
    """White residual, and smooth nuisance and candidate columns that have something in common."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(p + k, days, n)).cumsum(-1) / 5
    columns[p:] += 0.5 * columns[:1]
    return rng.normal(size=(days, n)), columns[:p], columns[p:]


def hourly(days=DAYS, n=N, parts=6):
    part = np.arange(n) * parts // n
    return (part == np.arange(parts)[:, None])[:, None] * np.ones((days, 1))


def by_hand(r, X, Z, blocks, weights):
    """Statistic, block scores over the root of V, and estimate, from full projection matrices."""
    root = np.sqrt(np.repeat(weights, r.shape[1]))
    y, X, Z = (
        r.ravel() * root,
        X.reshape(len(X), -1).T * root[:, None],
        Z.reshape(len(Z), -1).T * root[:, None],
    )
    H = X @ np.linalg.pinv(X)
    y, Z = y - H @ y, Z - H @ Z
    label = np.repeat(blocks, r.shape[1])
    label[root == 0.0] = -1
    places = [np.flatnonzero(label == b) for b in np.unique(label[label >= 0])]
    s = np.array([Z[i].T @ y[i] for i in places])
    Q = Z.T @ Z
    kept = Q - sum(Z[i].T @ H[np.ix_(i, i)] @ Z[i] for i in places)
    white = (y @ y) / (root > 0).sum()
    V = MODEL_SHARE * white * kept + (1.0 - MODEL_SHARE) * s.T @ s
    C = np.linalg.cholesky(Q) @ np.linalg.inv(np.linalg.cholesky(kept))
    statistic = s.sum(0) @ np.linalg.solve(C @ V @ C.T, s.sum(0))
    return statistic, s, V, np.linalg.solve(Q, Z.T @ y)


def windows(dates, days=DAYS):
    return {
        "all": [(0, days)],
        "from": [(i, days) for i in range(days)],
        "until": [(0, j) for j in range(1, days + 1)],
        "between": list(itertools.combinations(range(days + 1), 2)),
    }[dates]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("k", [1, 2])
@pytest.mark.parametrize("dates", ["all", "from", "until"])
def test_the_best_window_and_its_p_are_those_of_brute_force(seed, k, dates):
    r, X, Z = library(seed, k=k)
    weights = np.random.default_rng(seed).uniform(0.3, 1.0, DAYS)
    weights[4:6] = 0.0
    used = weights > 0
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (199, 10))
    best, most = None, np.zeros(199)
    for first, end in windows(dates):
        if len(set(BLOCKS[first:end][used[first:end]])) < 3 + k:
            continue
        inside = ((np.arange(DAYS) >= first) & (np.arange(DAYS) < end))[:, None]
        statistic, s, V, estimate = by_hand(r, X, Z * inside, BLOCKS, weights)
        flipped = signs @ s
        most = np.maximum(most, np.einsum("fk,kl,fl->f", flipped, np.linalg.inv(V), flipped))
        if best is None or statistic > best[0]:
            best = statistic, first, end, estimate
    got = scan(r, X, [Candidate("a", Z, dates)], blocks=BLOCKS, weights=weights, flips=199, seed=seed).found[
        0
    ]
    assert got.statistic == pytest.approx(best[0], rel=1e-9)
    assert np.allclose(got.estimate, best[3], rtol=1e-8)
    inside = (np.arange(DAYS) >= best[1]) & (np.arange(DAYS) < best[2]) & used
    assert got.days == (np.flatnonzero(inside)[0], np.flatnonzero(inside)[-1])
    assert got.p_alone == got.p_family == (1 + (most >= best[0]).sum()) / 200


def test_a_window_between_two_dates_is_found_where_it_was_planted():
    r, X, Z = library(1, days=48, n=60)
    r = r + 3.0 * Z[0] * ((np.arange(48) >= 15) & (np.arange(48) < 33))[:, None]
    got = scan(r, X, [Candidate("a", Z, "between")], blocks=np.arange(48) // 3, flips=199).found[0]
    assert abs(got.days[0] - 15) <= 1 and abs(got.days[1] - 32) <= 1


def test_a_run_of_hours_is_the_sum_of_its_columns():
    days = 48  # 16 blocks: the flips of 10, an onset among them, hardly reach 1 %
    blocks, day = np.arange(days) // 3, np.arange(days)
    r, X, _ = library(2, days=days)
    H = hourly(days)
    r = r + 0.6 * H[2:4].sum(0) * (day >= 8)[:, None]
    got = scan(r, X, [Candidate("a", H, "from", hours=True)], blocks=blocks, flips=999).found[0]
    assert got.hours == (2, 4) and abs(got.days[0] - 8) <= 3 and got.p_family <= 0.01

    def alone(i, j, since):
        column = H[i:j].sum(0, keepdims=True) * (day >= since)[:, None]
        return by_hand(r, X, column, blocks, np.ones(days))

    statistic, _, _, estimate = alone(2, 4, got.days[0])
    assert got.statistic == pytest.approx(statistic, rel=1e-9)
    assert np.allclose(got.estimate, estimate)
    every = [alone(i, j, d)[0] for i, j in itertools.combinations(range(7), 2) for d in (0, 5, 8, 20)]
    assert max(every) <= got.statistic * (1 + 1e-9)


def test_the_same_seed_gives_the_same_scan_and_the_order_of_candidates_does_not_matter():
    r, X, Z = library(3, k=4)
    cs = [Candidate(str(i), Z[i : i + 1], "from") for i in range(4)]
    one, two = (scan(r, X, c, blocks=BLOCKS, flips=199, seed=5) for c in (cs, cs[::-1]))
    assert [f.p_family for f in one.found] == [f.p_family for f in two.found[::-1]]
    assert one.p_value == min(f.p_family for f in one.found) == one.ranked[0].p_family
    assert one.n_blocks == 10 and one.n_flips == 199


def test_family_p_is_that_of_the_largest_of_all_candidates_and_never_below_p_alone():
    r, X, Z = library(4, k=6)
    cs = [Candidate(str(i), Z[i : i + 1 + i % 2], "from" if i < 3 else "all") for i in range(5)]
    family = scan(r, X, cs, blocks=BLOCKS, flips=499)
    for candidate, found in zip(cs, family.found, strict=True):
        alone = scan(r, X, [candidate], blocks=BLOCKS, flips=499).found[0]
        assert found.p_alone == alone.p_family and found.statistic == alone.statistic
        assert found.p_family >= found.p_alone


def test_units_of_a_column_change_its_estimate_only():
    r, X, Z = library(5)
    a, b = scan(r, X, [Candidate("a", Z), Candidate("b", 1e-6 * Z)], blocks=BLOCKS, flips=199).found
    assert b.statistic == pytest.approx(a.statistic) and b.p_alone == a.p_alone
    assert b.estimate[0] == pytest.approx(1e6 * a.estimate[0])
    assert b.standard_error[0] == pytest.approx(1e6 * a.standard_error[0])
    assert b.left == pytest.approx(a.left)


def test_a_column_that_the_nuisance_spans_is_not_found_but_said_to_be_gone():
    r, X, _ = library(6)
    Z = (X[0] - 2.0 * X[1])[None]
    got = scan(r + 5.0 * Z[0], X, [Candidate("a", Z, "all")], blocks=BLOCKS, flips=99).found[0]
    assert got.statistic == 0.0 and got.p_alone == got.p_family == 1.0
    assert got.left < 1e-9 and np.isnan(got.estimate).all()


def test_what_is_left_of_a_column_is_the_share_that_projection_leaves():
    r, X, Z = library(7)
    got = scan(r, X, [Candidate("a", Z)], blocks=BLOCKS, flips=99).found[0]
    flat = X.reshape(len(X), -1).T
    z = Z.ravel()
    rest = z - flat @ np.linalg.lstsq(flat, z, rcond=None)[0]
    assert got.left == pytest.approx((rest @ rest) / (z @ z))


def test_nuisance_columns_may_be_none_or_twice_the_same():
    r, X, Z = library(8)
    one, two = (scan(r, x, [Candidate("a", Z)], blocks=BLOCKS, flips=99).found[0] for x in (X, np.r_[X, X]))
    assert two.statistic == pytest.approx(one.statistic, rel=1e-6)
    assert scan(r, X[:0], [Candidate("a", Z)], blocks=BLOCKS, flips=99).found[0].left == pytest.approx(1.0)


def test_days_of_weight_zero_are_not_looked_at():
    r, X, Z = library(9)
    weights = np.where(split(DAYS).sealed, 0.0, 1.0)
    first = scan(r, X, [Candidate("a", Z, "from")], blocks=BLOCKS, weights=weights, flips=99)
    r[weights == 0] = np.nan
    second = scan(r, X, [Candidate("a", Z, "from")], blocks=BLOCKS, weights=weights, flips=99)
    assert first.found[0].statistic == second.found[0].statistic and first.n_blocks == 8


def test_a_candidate_with_a_sign_is_found_with_that_sign_only():
    r, X, Z = library(10)
    r = r + 0.5 * Z[0]
    cs = [Candidate("up", Z, sign=1), Candidate("down", Z, sign=-1), Candidate("any", Z)]
    up, down, free = scan(r, X, cs, blocks=BLOCKS, flips=499).found
    assert up.statistic == free.statistic and up.p_alone <= free.p_alone < 0.02
    assert down.statistic == 0.0 and down.p_alone == 1.0


NOISE = NoiseModel(4e-3, 3e-4, 1.5, 9000.0, 0.0, 1e4, 133.0, 6.7e5)


def ramps(seed, days, n):
    """Level columns as flows make them: what flows bring, summed, not yet whitened."""
    rng = np.random.default_rng(seed)
    flow = np.repeat(rng.normal(size=(6, days, n // 8)), 8, axis=2)
    return flow.cumsum(2) * 133.0 / 6.7e5


def coloured(rng, days, n, columns):
    return NOISE.simulate(days, n, rng)


def heavy_days(rng, days, n, columns):
    size = np.sqrt(3.0 / rng.chisquare(3, (days, 1)))
    return size * NOISE.simulate(days, n, rng)


def day_effects(rng, days, n, columns):
    effect = 0.7 * rng.standard_t(3, (days, 1)) * columns[3] + 0.7 * rng.standard_t(3, (days, 1)) * columns[0]
    return NOISE.simulate(days, n, rng) + effect


def cases(columns, days):
    k = columns.shape[2]
    part = hourly(days, k, 4)
    return [
        Candidate("one", columns[3:4]),
        Candidate("onset", columns[3:4], "from"),
        Candidate("two", columns[4:6]),
        Candidate("hours", NOISE.whiten(part.cumsum(2) * 2e-4), "from", hours=True),
    ]


@pytest.mark.parametrize("null", [coloured, heavy_days, day_effects])
def test_the_false_rate_is_not_above_nominal(null):
    sets, days, n = 400, 36, 40
    raw = ramps(0, days, n)
    columns = NOISE.whiten(raw)
    alone, family = [], []
    for seed in range(sets):
        rng = np.random.default_rng(seed)
        r = NOISE.whiten(null(rng, days, n, raw) + 0.8 * raw[0] - 0.5 * raw[1])
        got = scan(r, columns[:3], cases(columns, days), blocks=np.arange(days) // 3, flips=199, seed=seed)
        family.append(got.p_value)
        alone.append([f.p_alone for f in got.found])
    for level in (0.05, 0.01):
        error = np.sqrt(level * (1.0 - level) / sets)
        assert np.mean(np.array(family) <= level) < level + 3.0 * error
        assert (np.mean(np.array(alone) <= level, axis=0) < level + 3.0 * error).all()


def test_the_test_is_not_idle_p_of_a_null_is_spread_evenly():
    p = []
    for seed in range(300):
        r, X, Z = library(seed)
        p.append(scan(r, X, [Candidate("a", Z)], blocks=BLOCKS, flips=99, seed=seed).p_value)
    p = np.array(p)
    for level in (0.1, 0.5, 0.9):
        assert abs((p <= level).mean() - level) < 3.5 * np.sqrt(level * (1.0 - level) / 300)


def test_power_grows_with_the_size_of_a_planted_column():
    found = []
    for size in (0.0, 0.1, 0.2, 0.4):
        p = []
        for seed in range(60):
            r, X, Z = library(seed, k=3)
            cs = [Candidate("a", Z[:1], "from"), Candidate("b", Z[1:2], "from"), Candidate("c", Z[1:3])]
            r = r + size * Z[0] * (np.arange(DAYS) >= 9)[:, None]
            p.append(scan(r, X, cs, blocks=BLOCKS, flips=199, seed=seed).found[0].p_family)
        found.append(np.mean(np.array(p) <= 0.05))
    assert found[0] <= 0.1 < found[2] < found[3]
    assert found[1] <= found[2] and found[3] > 0.95


@pytest.mark.parametrize("heavy", [False, True])
def test_the_estimate_is_unbiased_and_its_error_is_its_scatter(heavy):
    sets, truth = 300, 0.35
    z, inside = np.empty(sets), np.empty(sets)
    for seed in range(sets):
        r, X, Z = library(seed)
        if heavy:
            r = r * np.random.default_rng(seed).choice([0.5, 1.0, 2.0], 10)[BLOCKS][:, None]
        got = scan(r + truth * Z[0] + 3.0 * X[0], X, [Candidate("a", Z)], blocks=BLOCKS, flips=9).found[0]
        z[seed] = (got.estimate[0] - truth) / got.standard_error[0]
        inside[seed] = abs(z[seed]) < student.ppf(0.975, 9)
    assert abs(z.mean()) < 3.5 * z.std(ddof=1) / np.sqrt(sets)
    assert abs(inside.mean() - 0.95) < 3.5 * np.sqrt(0.95 * 0.05 / sets)


def test_what_cannot_be_tested_is_refused():
    r, X, Z = library(11)
    good = [Candidate("a", Z)]
    with pytest.raises(RividError, match="nuisance"):
        scan(r, X[0], good, blocks=BLOCKS)
    with pytest.raises(RividError, match="one a day"):
        scan(r, X, good, blocks=BLOCKS[:-1])
    with pytest.raises(RividError, match="columns of a"):
        scan(r, X, [Candidate("a", Z[:, 1:])], blocks=BLOCKS)
    with pytest.raises(RividError, match="needs one parameter"):
        scan(r, X, [Candidate("a", np.r_[Z, Z], sign=1)], blocks=BLOCKS)
    with pytest.raises(RividError, match="3 blocks"):
        scan(r, X, good, blocks=np.arange(DAYS) // 10)
    with pytest.raises(RividError, match="negative"):
        scan(r, X, good, blocks=BLOCKS, weights=-np.ones(DAYS))
    with pytest.raises(RividError, match="residual is not finite"):
        scan(np.where(np.arange(DAYS)[:, None] == 3, np.nan, r), X, good, blocks=BLOCKS)


def test_results_are_frozen():
    r, X, Z = library(12)
    got = scan(r, X, [Candidate("a", Z)], blocks=BLOCKS, flips=9)
    with pytest.raises(dataclasses.FrozenInstanceError):
        got.found[0].p_family = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        got.p_value = 0.0
