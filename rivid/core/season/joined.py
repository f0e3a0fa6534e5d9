"""p(d | all days): what each day says of its delay, joined over a season that may change slowly.

Beyond the paper. The travel time x is a hidden Markov chain over the days: it drifts a little, now and then
it jumps anywhere, and where the day's discharge Q is known it moves as ``x = x0 (Q / Q0)^-b``. How fast it
drifts and how strongly it follows the discharge are not given but averaged, and beside all chains stands that
the days have nothing to do with each other: each is believed as far as it foretold the days.

A day's probability may be surely wrong. So a day counts as what it says with the probability `trust` (times
that of its link), and as nothing at all otherwise. But the days must not all be wrong in the same way: where
the outflow is not logged (:mod:`rivid.core.posterior.blind`) they are, and joined they are surer than right.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core.season.chain import Chain, Days, chain_of, foretold_alike
from rivid.core.season.settings import SeasonSettings
from rivid.errors import RividError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

HELD = 0.9
"""Probability that a day's set of delays holds."""


@dataclass(frozen=True)
class SeasonResult:
    """What the days of a season say together; a leading axis of days.

    Attributes
    ----------
    candidates : ndarray of int, shape (D,)
        The delays [samples].
    probability : ndarray, shape (days, D)
        p(d | days up to this one), or with `both_ways` p(d | all days). A missing day has one too.
    delay : ndarray, shape (days,)
        The delay of highest probability [samples]; NaN where that is below `answer_above`.
    sure : ndarray, shape (days,)
        The highest probability.
    in_set : ndarray of bool, shape (days, D)
        The smallest set of delays that holds 90 %.
    observed : ndarray of bool, shape (days,)
        The day had a probability of its own.
    independent : ndarray, shape (days,)
        Probability that the days have nothing to do with each other.
    exponent : ndarray, shape (days,)
        Mean of b, the power by which the travel time falls as the discharge grows, given that the days are
        related; 0 without a discharge.
    drift : ndarray, shape (days,)
        Mean of the travel time's drift [samples per day, standard deviation], given that they are related.
    """

    candidates: NDArray[np.intp]
    probability: Floats
    delay: Floats
    sure: Floats
    in_set: Bools
    observed: Bools
    independent: Floats
    exponent: Floats
    drift: Floats


class _Belief(NamedTuple):
    """Unnormalised masses: of the chains, shape (B, S, K), and of independent days."""

    chains: Floats
    alone: float


def season(
    probability: ArrayLike,
    link: ArrayLike | None = None,
    discharge: ArrayLike | None = None,
    *,
    d_min: int = 1,
    both_ways: bool = False,
    settings: SeasonSettings | None = None,
) -> SeasonResult:
    """Probability of every delay on every day, given the other days too.

    Parameters
    ----------
    probability : array_like, shape (days, D)
        p(d | y) of each calendar day for ``d = d_min ... d_min + D - 1``, made with a prior that is even:
        the day's likelihood. NaN on a day that is missing or says nothing.
    link : array_like, shape (days,), optional
        Probability that a front is seen at all; 1 where not given.
    discharge : array_like, shape (days,), optional
        Median discharge of the day [m3/s], positive; NaN where it is not known, and the last one known holds.
    d_min : int
        The first delay [samples].
    both_ways : bool
        False: a day knows the days before it only, so that no answer changes when later days come. True: it
        knows all of them.
    settings : SeasonSettings, optional

    Returns
    -------
    SeasonResult

    Raises
    ------
    RividError
        For shapes that do not fit, or values that are no probabilities or no discharges.

    Notes
    -----
    Source: L. R. Rabiner, "A tutorial on hidden Markov models", Proc. IEEE 77 (1989), 257-286, (18)-(27).

    Examples
    --------
    >>> vague = [0.5, 0.3, 0.2]
    >>> days = season([[0.8, 0.1, 0.1], vague, vague, [np.nan] * 3], d_min=4)
    >>> days.candidates.tolist(), days.observed.tolist()
    ([4, 5, 6], [True, True, True, False])
    >>> bool(days.probability[2, 0] > 0.5)
    True
    """
    s = settings or SeasonSettings()
    days, chain = _checked(probability, link, discharge, d_min, s)
    answers, beliefs = _forward(days, chain)
    if both_ways:
        answers, beliefs = _backward(days, chain, beliefs)
    return _result(answers, beliefs, days, chain, d_min, s)


def _checked(
    probability: ArrayLike, link: ArrayLike | None, discharge: ArrayLike | None, d_min: int, s: SeasonSettings
) -> tuple[Days, Chain]:
    p = np.asarray(probability, float)
    if p.ndim != 2 or not p.size:
        raise RividError(f"probability has shape {p.shape}: expected (days, D), a row for each day")
    if d_min < 0:
        raise RividError(f"d_min = {d_min}: expected 0 or more (samples)")
    n, D = p.shape
    observed: Bools = np.asarray(np.isfinite(p).all(axis=1))
    rows = np.where(observed[:, None], p, 1.0 / D)
    wrong = np.flatnonzero((rows < 0.0).any(axis=1) | (np.abs(rows.sum(axis=1) - 1.0) > 1e-6))
    if len(wrong):
        raise RividError(
            f"probability of row {wrong[0]} is no distribution: expected 0 or more, sum 1, or NaN"
        )
    trust = np.full(n, s.trust)
    if link is not None:
        seen = np.asarray(link, float)
        if seen.shape != (n,):
            raise RividError(f"link has shape {seen.shape}: expected ({n},), a value for each row")
        if ((seen < 0.0) | (seen > 1.0)).any():
            raise RividError(f"link goes from {np.nanmin(seen):g} to {np.nanmax(seen):g}: expected 0 to 1")
        trust *= np.where(np.isfinite(seen), seen, 0.0)
    trust[~observed] = 0.0
    flow = None
    if discharge is not None:
        flow = np.asarray(discharge, float)
        if flow.shape != (n,):
            raise RividError(f"discharge has shape {flow.shape}: expected ({n},), a value for each row")
        if (flow <= 0.0).any() or np.isinf(flow).any():
            raise RividError(f"discharge goes down to {np.nanmin(flow):g} m3/s: expected it positive, or NaN")
    likely = trust[:, None] * rows + (1.0 - trust[:, None]) / D
    return Days(rows, likely, foretold_alike(likely, observed), observed), chain_of(d_min, D, flow, n, s)


def _forward(days: Days, chain: Chain) -> tuple[Floats, list[_Belief]]:
    """What each day and those before it say, and what was believed before the day itself spoke."""
    mass, alone = chain.start, chain.alone
    answers, beliefs = np.empty(days.own.shape), []
    for t, (own, likely, alike) in enumerate(zip(days.own, days.likely, days.alike, strict=True)):
        if t:
            mass = chain.step(mass, t)
        beliefs.append(_Belief(mass, alone))
        share = chain.cells(t)
        answers[t] = np.einsum("bsk,bkd->d", mass, share) * likely + alone * alike * own
        mass, alone = mass * (share @ likely)[:, None], alone * alike
        total = mass.sum() + alone
        mass, alone = mass / total, alone / total
    return answers, beliefs


def _backward(days: Days, chain: Chain, before: list[_Belief]) -> tuple[Floats, list[_Belief]]:
    """The same, and what the days after say too."""
    n, D = days.own.shape
    answers, beliefs = np.empty((n, D)), list(before)
    after, after_alone = np.ones_like(chain.start), 1.0
    for t in range(n - 1, -1, -1):
        share = chain.cells(t)
        mass, alone = before[t].chains * after, before[t].alone * after_alone
        beliefs[t] = _Belief(mass, alone)
        answers[t] = (
            np.einsum("bsk,bkd->d", mass, share) * days.likely[t] + alone * days.alike[t] * days.own[t]
        )
        if t:
            after = chain.back(after * (share @ days.likely[t])[:, None], t)
            after_alone *= days.alike[t]
            top = max(float(after.max()), after_alone)
            after, after_alone = after / top, after_alone / top
    return answers, beliefs


def _result(
    answers: Floats, beliefs: list[_Belief], days: Days, chain: Chain, d_min: int, s: SeasonSettings
) -> SeasonResult:
    """Normalised, and what is believed of the season after each day has spoken."""
    n, D = answers.shape
    independent, exponent, drift = np.empty(n), np.empty(n), np.empty(n)
    for t, (mass, alone) in enumerate(beliefs):
        share = chain.cells(t)
        models = (mass * (share @ days.likely[t])[:, None]).sum(axis=2)
        related = float(models.sum())
        alone *= days.alike[t]
        independent[t] = alone / (alone + related)
        exponent[t] = (models.sum(axis=1) @ chain.exponents) / related if related > 0.0 else np.nan
        drift[t] = (models.sum(axis=0) @ chain.drifts) / related if related > 0.0 else np.nan
    p = answers / answers.sum(axis=1, keepdims=True)
    candidates = np.arange(d_min, d_min + D)
    ranked = np.argsort(-p, axis=1, kind="stable")
    sorted_p = np.take_along_axis(p, ranked, axis=1)
    in_set: Bools = np.zeros(p.shape, bool)
    np.put_along_axis(in_set, ranked, np.cumsum(sorted_p, axis=1) - sorted_p < HELD, axis=1)
    sure = sorted_p[:, 0]
    delay = np.where(sure >= s.answer_above, candidates[ranked[:, 0]], np.nan)
    return SeasonResult(candidates, p, delay, sure, in_set, days.observed, independent, exponent, drift)
