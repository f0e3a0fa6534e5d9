"""Test the season's chain against the enumeration of all paths, and its properties: steps, missing days."""

from itertools import product

import numpy as np
import pytest
from scipy.linalg import expm

from rivid.core.season import PARTS, SeasonSettings, drift_kernel, independent_likelihood, season
from rivid.errors import RividError
from tests import examples


def some_days(n, D, seed, sharpness=1.0):
    """Draw arbitrary probabilities, with one day missing."""
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.full(D, sharpness), n)
    if n > 2:
        p[1] = np.nan
    return p, rng.random(n), rng.uniform(50.0, 400.0, n)


def drifting_days(rng, n=60, D=10, hit=0.7, start=5.5, sd=0.08, step_at=None, step=3.0):
    """Return days that give their delay, or a neighbour's, with the stated frequency; and the delay."""
    x = np.empty(n)
    x[0] = start
    for t in range(1, n):
        x[t] = np.clip(x[t - 1] + sd * rng.normal() + (step if t == step_at else 0.0), 1.05, D + 0.95)
    return sensed(rng, np.floor(x).astype(int), D, hit), np.floor(x).astype(int)


def sensed(rng, d, D, hit=0.7):
    """Return a sensor of the delay with an exact likelihood: right with `hit`, otherwise any other delay."""
    likelihood = np.full((D, D), (1.0 - hit) / (D - 1)) + np.eye(D) * (hit - (1.0 - hit) / (D - 1))
    seen = np.array([rng.choice(D, p=likelihood[k - 1]) for k in d])
    return likelihood[:, seen].T


def by_paths(p, link, flow, d_min, s, both_ways):
    """Sum over every path of every model; independent of the module except for the definition."""
    n, D = p.shape
    K = PARTS * D
    known = np.isfinite(p).all(axis=1)
    own = np.where(known[:, None], p, 1.0 / D)
    trust = np.where(known, s.trust * link, 0.0)
    likely = [[trust[t] * own[t, j] + (1 - trust[t]) / D for j in range(D)] for t in range(n)]
    laplacian = np.diag(np.full(K - 1, 1.0), 1) + np.diag(np.full(K - 1, 1.0), -1)
    laplacian -= np.diag(laplacian.sum(axis=1))
    exponents = (0.0,) if flow is None else s.exponents
    flow = np.ones(n) if flow is None else flow
    edges = d_min + np.arange(K + 1) / PARTS

    def emission(t, b):
        """Return the share of each point of the grid in each delay."""
        c = (flow[t] / flow[0]) ** -b
        share = np.zeros((K, D))
        for k in range(K):
            fine = np.linspace(edges[k] * c, edges[k + 1] * c, 4001)
            cell = np.clip(np.floor(0.5 * (fine[1:] + fine[:-1])).astype(int) - d_min, 0, D - 1)
            share[k] = np.bincount(cell, minlength=D) / 4000
        return share

    def drawn(t, b):
        middle = 0.5 * (edges[1:] + edges[:-1]) * (flow[t] / flow[0]) ** -b
        inside = ((middle > d_min) & (middle < d_min + D)).astype(float)
        return inside / inside.sum()

    def joint(last):
        """Return the mass of (day, delay) of all paths up to the day `last`, and of independence."""
        found = np.zeros((last, D))
        for b, drift in product(exponents, s.drifts):
            E = [emission(t, b) for t in range(last)]
            A = [
                (1 - s.jump) * expm(0.5 * (PARTS * drift) ** 2 * laplacian) + s.jump * drawn(t, b)
                for t in range(last)
            ]
            for path in product(range(K), repeat=last):
                mass = (1 - s.independent) / (len(exponents) * len(s.drifts) * K)
                for t in range(1, last):
                    mass *= A[t][path[t - 1], path[t]]
                each = [E[t][path[t]] * likely[t] for t in range(last)]
                total = mass * np.prod([part.sum() for part in each])
                for t in range(last):
                    found[t] += total * each[t] / each[t].sum()
        alone, seen = s.independent, np.full(D, 2.0 / D)
        for t in range(last):
            both = seen / seen.sum() * likely[t]
            alone *= both.sum()
            seen = seen + both / both.sum() * known[t]
        related = found[0].sum()
        return found + alone * own[:last], alone / (alone + related)

    if both_ways:
        found, independent = joint(n)
        return found / found.sum(axis=1, keepdims=True), np.full(n, independent)
    each = [joint(t + 1) for t in range(n)]
    last = np.stack([found[-1] for found, _ in each])
    return last / last.sum(axis=1, keepdims=True), np.array([independent for _, independent in each])


@pytest.mark.parametrize("both_ways", [False, True], ids=["forward", "both ways"])
@pytest.mark.parametrize("seed", range(examples(3, 1)))
def test_the_chain_is_the_sum_over_all_of_its_paths(seed, both_ways):
    p, link, flow = some_days(3, 2, seed)
    s = SeasonSettings(drifts=(0.1, 0.5), exponents=(0.0, 0.3), jump=0.1, trust=0.8, independent=0.3)
    for discharge in (None, flow):
        got = season(p, link, discharge, d_min=2, both_ways=both_ways, settings=s)
        want, independent = by_paths(p, link, discharge, 2, s, both_ways)
        np.testing.assert_allclose(got.probability, want, atol=5e-4 if discharge is not None else 1e-9)
        np.testing.assert_allclose(got.independent, independent, atol=5e-4)


def test_yesterdays_answer_never_changes_when_later_days_come():
    p, link, flow = some_days(40, 8, 1)
    flow[[0, 7]] = np.nan
    whole = season(p, link, flow)
    for n in (1, 2, 7, 23):
        part = season(p[:n], link[:n], flow[:n])
        for name in ("probability", "delay", "sure", "independent"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[:n])


def test_the_drift_lets_an_even_distribution_even_and_is_the_exponential_of_the_walk():
    for K, sd in ((5, 0.1), (24, 1.3), (60, 9.0)):
        walk = np.diag(np.ones(K - 1), 1) + np.diag(np.ones(K - 1), -1)
        walk -= np.diag(walk.sum(axis=1))
        got = drift_kernel(K, sd)
        np.testing.assert_allclose(got, expm(0.5 * sd**2 * walk), atol=1e-12)
        np.testing.assert_allclose(got.sum(axis=0), 1.0)


def test_a_surely_wrong_day_is_overruled_by_its_neighbours_and_one_without_a_link_by_none():
    p = np.full((41, 8), 0.1 / 7)
    p[np.arange(41), np.where(np.arange(41) < 20, 3, 5)] = 0.9
    p[10] = 0.0
    p[10, 7] = 1.0
    found = season(p, both_ways=True)
    assert found.delay.tolist() == [4.0] * 20 + [6.0] * 21
    assert found.independent[10] < 0.01
    link, missing = np.where(np.arange(41) == 10, 0.0, 1.0), np.where(np.arange(41)[:, None] == 10, np.nan, p)
    s = SeasonSettings(independent=0.0)
    one, other = season(p, link, settings=s), season(missing, settings=s)
    np.testing.assert_allclose(one.probability, other.probability, atol=1e-12)
    assert other.observed.tolist() == [k != 10 for k in range(41)]


def test_a_step_is_followed_on_the_second_day_after_it():
    late = []
    for seed in range(examples(20)):
        p, d = drifting_days(np.random.default_rng(seed), 40, hit=0.97, sd=0.0, step_at=20)
        late.append(np.argmax(season(p).probability[21]) + 1 != d[21])
    assert np.mean(late) <= 0.15  # two days, both right with probability 0.97


def test_where_the_model_holds_the_probabilities_hold_and_neighbours_help():
    alone, forward, both, tops = [], [], [], []
    for seed in range(examples(24, 12)):
        rng = np.random.default_rng([seed, 1])
        p, d = drifting_days(rng, start=rng.uniform(3, 8), sd=rng.choice([0.03, 0.1, 0.3]))
        rows = np.arange(len(d))
        alone.append(p[rows, d - 1])
        for found, way in ((forward, False), (both, True)):
            q = season(p, both_ways=way).probability
            found.append(q[rows, d - 1])
            tops.append((q.max(axis=1), np.argmax(q, axis=1) + 1 == d))
    means = [np.log(np.concatenate(part)).mean() for part in (alone, forward, both)]
    assert means[1] > means[0] + 0.3 and means[2] > means[1] + 0.1
    # the scatter of seasons, not of days: days of one season are correlated
    gap = np.array([right.mean() - top.mean() for top, right in tops])
    assert abs(gap.mean()) < 3.0 * gap.std(ddof=1) / np.sqrt(len(gap)) + 0.01


def test_independent_days_are_found_to_be_and_lose_next_to_nothing():
    lost = []
    for seed in range(examples(8, 4)):
        rng = np.random.default_rng([seed, 2])
        d = rng.integers(1, 11, 60)
        p = sensed(rng, d, 10, 0.9)
        found = season(p)
        rows = np.arange(60)
        lost.append(np.mean(np.log(p[rows, d - 1]) - np.log(found.probability[rows, d - 1])))
        assert found.independent[-1] > 0.99
        np.testing.assert_allclose(season(p, both_ways=True).probability, p, atol=0.01)
    assert np.mean(lost) < 0.03


def test_the_discharge_explains_what_else_would_be_a_drift():
    rng = np.random.default_rng(7)
    flow = 200.0 * np.exp(0.5 * rng.normal(size=80))
    for b in (0.1, 0.3):
        d = np.floor(7.5 * (flow / 200.0) ** -b).astype(int)
        p = sensed(rng, d, 15, 0.9)
        plain, law = season(p, both_ways=True), season(p, None, flow, both_ways=True)
        rows = np.arange(80)
        assert np.log(law.probability[rows, d - 1]).mean() > np.log(plain.probability[rows, d - 1]).mean()


def test_days_that_share_a_distribution_are_foretold_by_it():
    likely = np.tile([0.7, 0.2, 0.1], (50, 1))
    found = independent_likelihood(likely, np.ones(50, bool))
    assert found[0] == pytest.approx(1 / 3) and 0.65 < found[-1] < 0.7
    np.testing.assert_allclose(independent_likelihood(likely, np.zeros(50, bool)), 1 / 3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([0.5, 0.5],), "expected \\(days, D\\)"),
        (([[0.5, 0.4]],), "row 0 is no distribution"),
        (([[1.5, -0.5]],), "row 0 is no distribution"),
        (([[0.5, 0.5]], [0.5, 0.5]), "link has shape"),
        (([[0.5, 0.5]], [1.5]), "expected 0 to 1"),
        (([[0.5, 0.5]], None, [0.0]), "expected it positive"),
        (([[0.5, 0.5]], None, [1.0, 2.0]), "discharge has shape"),
    ],
)
def test_what_is_no_season_is_refused(arguments, words):
    with pytest.raises(RividError, match=words):
        season(*arguments)
