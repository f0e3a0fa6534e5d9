"""Test held-out days against real refits and dense densities, and probabilities against plain draws."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.special import softmax
from scipy.stats import multivariate_normal, multivariate_t

from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.predictive import LOG_2PI, day_densities, held_out, information, probabilities

DAYS, N, P = 14, 25, 3
BLOCKS = np.repeat(np.arange(5), 3)[:DAYS]
RIVER = NoiseModel(4.0, 0.0, 0.0, 1e4, 9.0, 2000.0, 133.0, None)
DENSE = 81.0 * toeplitz(np.exp(-133.0 * np.arange(N) / 2000.0)) + 16.0 * np.eye(N)


class Problem:
    """Days y of coloured noise and columns, with priors, weights, and the fit to all days."""

    def __init__(self, seed, misfit=0.0):
        rng = np.random.default_rng(seed)
        self.columns = 5.0 * rng.standard_normal((P, DAYS, N))
        self.sd = np.array([0.3, 1.0, 20.0])
        self.weights = rng.choice([1.0, 1.0, 0.4], DAYS)
        self.weights[BLOCKS == 2] = 0.0  # held out
        truth = self.sd * rng.standard_normal(P) + misfit * rng.standard_normal((5, P))[BLOCKS]
        noise = RIVER.simulate(DAYS, N, rng)
        self.y = np.einsum("dp,pdn->dn", np.broadcast_to(truth, (DAYS, P)), self.columns) + noise
        self.again()

    def again(self):
        """Fit all days, and return the problem."""
        self.at, _ = self.refit(self.weights)
        self.left = self.y - np.tensordot(self.at, self.columns, 1)
        return self

    def refit(self, weights):
        """Return the posterior mean and covariance, by dense matrices."""
        A, b = np.diag(self.sd**-2.0), np.zeros(P)
        W = np.linalg.inv(DENSE)
        for day, weight in enumerate(weights):
            X = self.columns[:, day]
            A, b = A + weight * X @ W @ X.T, b + weight * X @ W @ self.y[day]
        return np.linalg.solve(A, b), np.linalg.inv(A)

    def held_out(self, off=0.0):
        """Predict the held-out days from a fit that ended `off` from its optimum."""
        left = self.left - np.tensordot(np.broadcast_to(off, P), self.columns, 1)
        r, X = RIVER.whiten(left), RIVER.whiten(self.columns, like=left)
        return held_out(*information(r, X), self.sd**-2.0, BLOCKS, self.weights, self.at + off)


@pytest.mark.parametrize("seed", range(4))
def test_a_day_is_predicted_by_the_real_refit_without_its_block(seed):
    problem = Problem(seed)
    squares, log_det, change, _ = problem.held_out()
    plain = RIVER.log_likelihood(np.zeros((DAYS, N)))
    density = plain - 0.5 * log_det - 0.5 * squares
    tailed = day_densities(squares, log_det, plain, np.full(DAYS, N), 7.0)
    for day in range(DAYS):
        at, V = problem.refit(np.where(BLOCKS == BLOCKS[day], 0.0, problem.weights))
        X = problem.columns[:, day]
        expected, C = at @ X, DENSE + X.T @ V @ X
        assert change[day] == pytest.approx(at - problem.at, abs=1e-9)
        y = problem.y[day]
        assert density[day] == pytest.approx(multivariate_normal(expected, C).logpdf(y), abs=1e-7)
        assert tailed[day] == pytest.approx(multivariate_t(expected, C, 7.0).logpdf(y), abs=1e-7)


def test_a_fit_that_ended_beside_its_optimum_predicts_as_one_that_reached_it():
    problem = Problem(5)
    inside = BLOCKS == BLOCKS[3]
    problem.columns[2, ~inside] = 0.0  # the last column is determined by one block only
    problem = problem.again()
    reached, beside = problem.held_out(), problem.held_out(np.array([0.01, -0.02, 0.5]))
    for found, expected in zip(beside[:2], reached[:2], strict=True):
        assert found == pytest.approx(expected, rel=1e-9)
    assert beside[2] == pytest.approx(reached[2] - [0.01, -0.02, 0.5], abs=1e-9)
    assert np.abs(problem.at[2] + reached[2][inside, 2]).max() < 1e-9  # only its prior remains


@pytest.mark.parametrize("misfit", [0.0, 3.0])
def test_errors_are_those_of_the_posterior_or_of_the_jackknife_where_it_is_larger(misfit):
    problem = Problem(9, misfit)
    *_, errors = problem.held_out()
    posterior = np.sqrt(np.diag(problem.refit(problem.weights)[1]))
    refits = [
        problem.refit(np.where(BLOCKS == b, 0.0, problem.weights))[0]
        for b in np.unique(BLOCKS[problem.weights > 0.0])
    ]
    off = np.array(refits) - np.mean(refits, axis=0)
    jackknife = np.sqrt((len(refits) - 1) / len(refits) * (off**2).sum(axis=0))
    assert errors == pytest.approx(np.maximum(posterior, jackknife))
    assert (jackknife > 2.0 * posterior).any() == (misfit > 0.0)


def test_days_without_samples_have_a_density_of_one_and_change_nothing():
    rng = np.random.default_rng(1)
    r, X = rng.standard_normal((6, 9)), rng.standard_normal((2, 6, 9))
    r[4], X[:, 4] = 0.0, 0.0
    rest = np.arange(6) != 4
    label = np.array([0, 0, 1, 1, 2, 2])
    squares, log_det, change, errors = held_out(*information(r, X), [1.0, 1.0], label, np.ones(6))
    few = held_out(*information(r[rest], X[:, rest]), [1.0, 1.0], label[rest], np.ones(5))
    for found, expected in zip((squares, log_det, change, errors), few, strict=True):
        assert (found[rest] if len(found) == 6 else found) == pytest.approx(expected)
    assert day_densities(squares[4:5], log_det[4:5], np.zeros(1), np.zeros(1), 5.0) == pytest.approx([0.0])


@pytest.mark.parametrize("tails", [3.0, 50.0])
def test_a_density_of_wide_days_is_the_multivariate_t(tails):
    rng = np.random.default_rng(2)
    A = rng.standard_normal((6, 6))
    S = A @ A.T + np.eye(6)
    e = 3.0 * rng.standard_normal((4, 6))
    scale = np.full(4, -3.0 * LOG_2PI)
    squares = np.einsum("dn,nm,dm->d", e, np.linalg.inv(S), e)
    found = day_densities(squares, np.full(4, np.linalg.slogdet(S)[1]), scale, np.full(4, 6), tails)
    assert found == pytest.approx(multivariate_t(np.zeros(6), S, tails).logpdf(e))


# Probabilities


@pytest.mark.parametrize("seed, parts", [(0, 1.0), (1, 3.0), (2, 7.0)])
def test_probabilities_are_those_of_plain_draws(seed, parts):
    rng = np.random.default_rng([seed, 1])
    scores, prior = 20.0 * rng.standard_normal((4, 12)), rng.standard_normal(4)
    draws = []
    for _ in range(4000):
        weights = rng.gamma(parts, size=12)
        weights *= 12 / weights.sum()
        draws.append(softmax(0.1 * scores @ weights + prior))
    found = probabilities(scores, prior, parts=parts, temper=0.1)
    near = 5.0 * np.std(draws, axis=0) * np.sqrt(2.0 / 4000)
    assert found.sum() == pytest.approx(1.0)
    assert (np.abs(found - np.mean(draws, axis=0)) < near + 1e-12).all()


def test_without_scores_the_prior_remains():
    prior = np.array([0.3, -2.0, 0.0])
    alike = np.tile(np.random.default_rng(3).standard_normal(8), (3, 1))
    for scores, temper in ((alike, 1.0), (np.random.default_rng(4).standard_normal((3, 8)), 0.0)):
        assert probabilities(scores, prior, temper=temper) == pytest.approx(softmax(prior))
    assert probabilities(alike[:1], [-50.0]) == pytest.approx([1.0])


def test_a_gain_that_is_the_same_in_all_blocks_counts_in_full_and_one_of_a_single_block_is_doubted():
    nothing, spread, single = np.zeros((3, 10))
    spread[:], single[4] = 0.5, 5.0
    prior = np.zeros(2)
    sure = probabilities([nothing, spread], prior)
    assert sure == pytest.approx(softmax([0.0, 5.0]))  # all draws are equal
    assert probabilities([nothing, single], prior)[1] < sure[1] - 0.05
    hopeless = probabilities([nothing, spread, spread - 1.0], np.zeros(3))
    assert hopeless[2] == pytest.approx(softmax([0.0, 5.0, -5.0])[2]) and hopeless[2] < hopeless[0]
