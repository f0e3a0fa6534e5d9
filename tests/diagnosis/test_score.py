"""The score test against brute force, its false rate and its power."""

import itertools

import numpy as np
import pytest

from rivid.diagnosis.blocks import split
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.score import MODEL_SHARE, Candidate, scan
from rivid.errors import RividError
from tests.diagnosis import sizes

DAYS, N = 30, 24
BLOCKS = np.arange(DAYS) // 3


def library(seed, days=DAYS, n=N, k=1, p=3):
    """White residual, and smooth nuisance and candidate columns that are correlated."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(p + k, days, n)).cumsum(-1) / 5
    columns[p:] += 0.5 * columns[:1]
    return rng.normal(size=(days, n)), columns[:p], columns[p:]


def hourly(days=DAYS, n=N, parts=6):
    part = np.arange(n) * parts // n
    return (part == np.arange(parts)[:, None])[:, None] * np.ones((days, 1))


def by_hand(r, X, Z, blocks, weights):
    """Statistic, block scores and V from full projection matrices."""
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
    return s.sum(0) @ np.linalg.solve(C @ V @ C.T, s.sum(0)), s, V


def p_by_hand(r, X, columns, blocks, weights, signs):
    """p of the largest statistic of some columns, each a window."""
    best, most = 0.0, np.zeros(len(signs))
    for Z in columns:
        statistic, s, V = by_hand(r, X, Z, blocks, weights)
        flipped = signs @ s
        most = np.maximum(most, np.einsum("fk,kl,fl->f", flipped, np.linalg.inv(V), flipped))
        best = max(best, statistic)
    return (1 + (most >= best).sum()) / (1 + len(signs))


@sizes("k", 1, 2)
@pytest.mark.parametrize("dates", ["all", "from", "until", "between"])
def test_p_of_the_best_window_is_that_of_brute_force(k, dates):
    pairs = {
        "all": [(0, DAYS)],
        "from": [(i, DAYS) for i in range(DAYS)],
        "until": [(0, j) for j in range(1, DAYS + 1)],
        "between": list(itertools.combinations(range(0, DAYS + 1), 2)),
    }[dates]
    for seed in range(k):
        r, X, Z = library(seed, k=k)
        r = r + 0.1 * Z[0]
        weights = np.random.default_rng(seed).uniform(0.3, 1.0, DAYS)
        weights[4:6] = 0.0
        windows = [(a, b) for a, b in pairs if len(set(BLOCKS[a:b][weights[a:b] > 0])) >= 3 + k]
        day = np.arange(DAYS)
        columns = [Z * ((day >= a) & (day < b))[:, None] for a, b in windows]
        signs = np.random.default_rng(seed).choice([-1.0, 1.0], (199, 10))
        (p,) = scan(r, X, [Candidate("a", Z, dates)], blocks=BLOCKS, weights=weights, flips=199, seed=seed)
        assert p == p_by_hand(r, X, columns, BLOCKS, weights, signs)


def test_p_of_a_run_of_hours_is_that_of_brute_force():
    r, X, _ = library(2)
    H = hourly()
    r = r + 0.2 * H[2:4].sum(0)
    (p,) = scan(r, X, [Candidate("a", H, hours=True)], blocks=BLOCKS, flips=199, seed=4)
    columns = [H[i:j].sum(0, keepdims=True) for i, j in itertools.combinations(range(7), 2)]
    signs = np.random.default_rng(4).choice([-1.0, 1.0], (199, 10))
    assert p == p_by_hand(r, X, columns, BLOCKS, np.ones(DAYS), signs)


def test_the_order_of_candidates_does_not_matter_and_more_candidates_raise_p():
    r, X, Z = library(3, k=4)
    candidates = [Candidate(str(i), Z[i : i + 1 + i % 2], "from") for i in range(4)]
    one, two = (scan(r, X, c, blocks=BLOCKS, flips=199, seed=5) for c in (candidates, candidates[::-1]))
    assert one.tolist() == two[::-1].tolist()
    for candidate, p in zip(candidates, one, strict=True):
        assert p >= scan(r, X, [candidate], blocks=BLOCKS, flips=199, seed=5)[0]


def test_units_of_a_column_and_repeated_nuisance_columns_change_nothing():
    r, X, Z = library(5)
    a, b = scan(r, X, [Candidate("a", Z), Candidate("b", 1e-6 * Z)], blocks=BLOCKS, flips=199)
    assert a == b
    assert scan(r, np.r_[X, X], [Candidate("a", Z)], blocks=BLOCKS, flips=199)[0] == a
    assert len(scan(r, X[:0], [Candidate("a", Z)], blocks=BLOCKS, flips=99)) == 1


def test_a_column_in_the_span_of_the_nuisance_has_p_one():
    r, X, _ = library(6)
    Z = (X[0] - 2.0 * X[1])[None]
    assert scan(r + 5.0 * Z[0], X, [Candidate("a", Z, "all")], blocks=BLOCKS, flips=99) == [1.0]


def test_days_of_weight_zero_are_left_out():
    r, X, Z = library(9)
    weights = np.where(split(DAYS).sealed, 0.0, 1.0)
    first = scan(r, X, [Candidate("a", Z, "from")], blocks=BLOCKS, weights=weights, flips=99)
    r[weights == 0] = np.nan
    assert scan(r, X, [Candidate("a", Z, "from")], blocks=BLOCKS, weights=weights, flips=99) == first


def test_a_candidate_with_a_sign_is_found_with_that_sign_only():
    r, X, Z = library(10)
    signs = [Candidate("up", Z, sign=1), Candidate("down", Z, sign=-1)]
    up, down = scan(r + 0.5 * Z[0], X, signs, blocks=BLOCKS, flips=499)
    assert up < 0.02 and down == 1.0


NOISE = NoiseModel(4e-3, 3e-4, 1.5, 9000.0, 0.0, 1e4, 133.0, 6.7e5)


def ramps(seed, days, n):
    """Level columns as flows make them: integrated flows, not whitened."""
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


@sizes("sets", 30, 120)
@pytest.mark.parametrize("null", [coloured, heavy_days, day_effects])
def test_the_false_rate_is_not_above_nominal(null, sets):
    days, n = 36, 40
    raw = ramps(0, days, n)
    columns = NOISE.whiten(raw)
    candidates = [
        Candidate("one", columns[3:4]),
        Candidate("onset", columns[3:4], "from"),
        Candidate("two", columns[4:6]),
        Candidate("hours", NOISE.whiten(hourly(days, n, 4).cumsum(2) * 2e-4), "from", hours=True),
    ]
    smallest = []
    for seed in range(sets):
        rng = np.random.default_rng(seed)
        r = NOISE.whiten(null(rng, days, n, raw) + 0.8 * raw[0] - 0.5 * raw[1])
        p = scan(r, columns[:3], candidates, blocks=np.arange(days) // 3, flips=199, seed=seed)
        smallest.append(p.min())
    for level in (0.05, 0.01):
        error = np.sqrt(level * (1.0 - level) / sets)
        assert np.mean(np.array(smallest) <= level) < level + 3.0 * error


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
