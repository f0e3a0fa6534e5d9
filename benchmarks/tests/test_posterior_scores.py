"""Test the worlds and scores of docs/accuracy_posterior.md."""

import numpy as np
import pytest

from benchmarks.posterior.accuracy import reliability
from benchmarks.posterior.oracle import likelihood
from benchmarks.posterior.score import judge, randomised_coverage, wilson
from benchmarks.posterior.worlds import World, worlds
from rivid.core.posterior.daily import posterior
from rivid.errors import ConfigError
from tests.core.posterior_days import linear_days


@pytest.mark.parametrize("kind", ["development", "proof"])
def test_the_same_seed_gives_the_same_worlds_and_the_truth_is_its_travel_time(kind):
    first, other = worlds(kind, 5, 12), worlds(kind, 6, 12)
    for a, b in zip(first, other, strict=True):
        assert a.u.shape == a.y.shape == a.o.shape == (12, round(86400 / a.sample_time + 0.49))
        assert (a.delay == np.ceil(a.travel) - 1).all()
        assert not np.array_equal(a.y, b.y)
        edge = np.abs(a.travel - np.round(a.travel)) < 0.1
        assert (np.abs(a.other - a.delay) == edge).all()


def test_an_unknown_kind_of_world_is_refused():
    with pytest.raises(ConfigError, match="development, proof"):
        worlds("other", 1, 6)


@pytest.mark.parametrize("seed", range(3))
def test_randomised_sets_of_true_probabilities_hold_90_percent(seed):
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.full(8, 0.3), size=20_000)
    true = (p.cumsum(axis=1) < rng.random((20_000, 1))).sum(axis=1)
    covered = randomised_coverage(p, np.minimum(true, 7))
    assert covered.mean() == pytest.approx(0.9, abs=4 * covered.std() / np.sqrt(20_000))


def test_the_interval_of_a_share_holds_it_in_95_percent_of_draws():
    k = np.random.default_rng(1).binomial(40, 0.9, 4000)
    held = np.mean([low <= 0.9 <= high for low, high in (wilson(int(x), 40) for x in k)])
    assert held == pytest.approx(0.95, abs=0.02)


def test_bins_of_a_reliability_diagram_count_every_probability_once():
    stated = np.array([0.0, 0.05, 0.1, 0.55, 1.0])
    bins = reliability(stated, np.array([False, True, False, True, True]), np.array([0.0, 0.1, 0.5, 1.01]))
    assert [(b.n, b.true) for b in bins] == [(2, 1), (1, 0), (2, 2)]


def test_a_day_is_judged_by_its_true_delay_and_the_neighbour_near_an_edge():
    u, y, o, _ = linear_days(4, 3, place=5.5, noise=0.001)
    found = posterior(u, y, o)
    for travel, exact, within in (
        (5.5, True, True),
        (6.05, True, True),
        (6.5, False, True),
        (8.5, False, False),
    ):
        truth = np.full(4, travel)
        scores = judge(found, World("here", u, y, o, np.ceil(truth).astype(int) - 1, truth, 133.0))
        assert (scores.exact == exact).all() and (scores.within == within).all()
        assert (scores.surely_wrong == (not exact)).all()
        assert scores.is_true[:, int(np.ceil(travel)) - 2].all()


def test_the_oracles_likelihood_is_highest_at_the_place_of_a_clean_front():
    u, y, o, _ = linear_days(3, 2, place=4.35, noise=1e-4, weather=0.0)
    world = World("here", u, y, o, np.full(3, 4), np.full(3, 4.35), 133.0)
    for day in range(3):
        log = likelihood(world, day, 133.0 / 2e-4, 1e-8, 0.05, 3600.0)
        assert 1.05 + 0.1 * np.argmax(log) == pytest.approx(4.35, abs=0.051)
