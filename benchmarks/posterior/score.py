"""Score p(d | y) on days of known delay."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.posterior.worlds import World
from rivid.core.posterior.daily import PosteriorResult, posterior
from rivid.core.settings import PosteriorSettings

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LEVEL = 0.9
"""Level of the set of delays; its coverage is computed."""


@dataclass(frozen=True)
class Scores:
    """Scores of the days of one world or of several worlds, one value a day.

    Attributes
    ----------
    answered, exact, within, surely_wrong : ndarray of bool, shape (days,)
        Whether the status is "ok"; and whether the answered delay is right, within one sample, or wrong with
        p above 0.9. If the travel time is within a tenth of a sample of a sampling instant, both neighbours
        are right.
    covered : ndarray, shape (days,)
        Randomised coverage of the 90 % set: the probability that the set contains the true delay, with its
        last member included at random so that the set has exactly 90 %.
    top, top_right : ndarray, shape (days,)
        Probability that the best delay is right, and whether it is; for all days that have a best delay.
    probability, is_true : ndarray, shape (days, D)
        p(d | y) of every candidate, and whether it is the true one.
    in_band, band : ndarray, shape (days,)
        Whether the 90 % band of the travel time contains the true one, and its width [samples].
    front_error, half_error : ndarray, shape (days,)
        Absolute difference of the estimated travel time, and of the estimated half-response, from the true
        half-response [samples]: travel time plus half time of the stilling well.
    known : ndarray of bool, shape (days,)
        Whether the day has probabilities.
    ms : float
        Duration of the estimate [ms per day].
    """

    answered: Bools
    exact: Bools
    within: Bools
    surely_wrong: Bools
    covered: Floats
    top: Floats
    top_right: Bools
    probability: Floats
    is_true: Bools
    in_band: Bools
    band: Floats
    front_error: Floats
    half_error: Floats
    known: Bools
    ms: float


def randomised_coverage(probability: Floats, column: NDArray[np.intp], level: float = LEVEL) -> Floats:
    """Return the probability that a set of exactly `level` contains the true column.

    Parameters
    ----------
    probability : ndarray, shape (days, D)
        Rows that sum to one.
    column : ndarray of int, shape (days,)
        The true column; -1 if there is none.
    level : float

    Returns
    -------
    ndarray, shape (days,)
        Candidates join in the order of falling probability. The one that exceeds `level` joins at random,
        with the probability for which the set has exactly `level`.

    Examples
    --------
    >>> p = np.array([[0.6, 0.4], [0.6, 0.4], [1.0, 0.0]])
    >>> randomised_coverage(p, np.array([0, 1, 0])).round(9).tolist()
    [1.0, 0.75, 0.9]
    """
    rows = np.arange(len(probability))
    own = probability[rows, column]
    before = np.where(probability > own[:, None], probability, 0.0).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip((level - before) / own, 0.0, 1.0)
    return np.where((column >= 0) & (own > 0.0), share, 0.0)


def judge(found: PosteriorResult, world: World, ms: float = np.nan) -> Scores:
    """Score a result on its world."""
    candidates, every = found.candidates, np.arange(len(world.delay))
    known = np.isfinite(found.probability).all(axis=1)
    p = np.where(known[:, None], found.probability, 1.0 / len(candidates))
    best = candidates[np.argmax(p, axis=1)]
    answered = found.status == "ok"
    error = np.minimum(np.abs(best - world.delay), np.abs(best - world.other))
    inside = (world.delay >= candidates[0]) & (world.delay <= candidates[-1])
    column = np.where(inside, world.delay - candidates[0], -1)
    is_true = np.zeros(p.shape, bool)
    is_true[every[inside], column[inside]] = True
    right = np.where(known, found.right, np.nan)
    half = world.travel + np.log(2.0) * world.well
    return Scores(
        answered=answered, exact=answered & (error == 0), within=answered & (error <= 1),
        surely_wrong=answered & (error > 0) & (right > 0.9),
        covered=randomised_coverage(p, column),
        top=right, top_right=error == 0, probability=p, is_true=is_true,
        in_band=(found.place_low <= world.travel) & (world.travel <= found.place_high),
        band=found.place_high - found.place_low,
        front_error=np.abs(found.place - half), half_error=np.abs(found.half - half), known=known, ms=ms,
    )  # fmt: skip


def score(world: World, settings: PosteriorSettings | None = None, shift: int = 0) -> Scores:
    """Estimate and score a world. With `shift`, days have the inflow of another day and contain no delay."""
    u = np.roll(world.u, shift, axis=0)
    began = time.process_time()
    found = posterior(u, world.y, world.o, settings)
    ms = 1000.0 * (time.process_time() - began) / len(u)
    return judge(found, world, ms)


def together(parts: list[Scores]) -> Scores:
    """Join the scores of several worlds."""
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in Scores.__dataclass_fields__
        if name != "ms"
    }
    days = [len(part.answered) for part in parts]
    return Scores(**joined, ms=float(np.average([part.ms for part in parts], weights=days)))


def wilson(k: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share of k in n.

    Examples
    --------
    >>> [round(x, 3) for x in wilson(8, 10)]
    [0.49, 0.943]
    """
    if n == 0:
        return 0.0, 1.0
    share, tail = k / n, z * z / n
    middle, half = share + tail / 2, z * np.sqrt(share * (1 - share) / n + tail / (4 * n))
    low, high = (middle - half) / (1 + tail), (middle + half) / (1 + tail)
    return max(float(low), 0.0), min(float(high), 1.0)
