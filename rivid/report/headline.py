"""What a run found, in words made from its numbers."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.report.waves import not_compared, too_fast, waves
from rivid.results import passage
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import candidates, estimates_delay, found, rayleigh
from rivid.text import (
    about,
    count,
    listed,
    number,
    output_words,
    probability,
    samples,
    samples_first,
    share,
    statuses,
    travel_first,
    travel_within,
)
from rivid.types import Floats

SPREAD_OUT = 0.5
"""With a smaller share of days at the two most frequent delays, a range says more than these two."""


MOST_REASONS = 3
"""So many reasons for days without an answer are told; the list of days has all."""

LITTLE = 0.25
"""With d the prior's on a larger share of days, a river's jump delay is worth little."""


@dataclass(frozen=True)
class Facts:
    """The numbers of one estimator over the record.

    Attributes
    ----------
    days, answered, with_delay : int
        Rows; those with an answer; those with a delay.
    common : tuple of float
        The two most frequent delays [samples], in order; one or none where there are no two.
    common_days : int
        Days at these delays.
    median : float
        Median delay [samples].
    at_bound, prior_only, degenerate : int
        Days, among those with a delay.
    too_fast : int
        Days of :func:`too_fast`.
    condition, noise_sd, alpha : float
        Medians; noise_sd in the output's unit, alpha in (m3/s)^2.
    probability, least : float
        Median and lowest probability of the delays; NaN where the estimator gives none.
    """

    days: int
    answered: int
    with_delay: int
    common: tuple[float, ...]
    common_days: int
    median: float
    at_bound: int
    prior_only: int
    degenerate: int
    too_fast: int
    condition: float
    noise_sd: float
    alpha: float
    probability: float
    least: float


def facts(results: Results, estimator: EstimatorResults) -> Facts:
    """Count and condense one estimator's rows."""
    e, days = estimator, found(estimator)
    values, times = np.unique(e.delay[days], return_counts=True)
    top = np.argsort(-times, kind="stable")[:2]
    sure = np.empty(0) if e.probability is None else e.probability[days]
    return Facts(
        days=len(e.dates),
        answered=int(e.answered.sum()),
        with_delay=int(days.sum()),
        common=tuple(sorted(float(v) for v in values[top])),
        common_days=int(times[top].sum()),
        median=_median(e.delay[days]),
        at_bound=int((e.at_bound & days).sum()),
        prior_only=int((e.prior_only & days).sum()),
        degenerate=e.status.count("degenerate"),
        too_fast=int((too_fast(results, e) & days).sum()),
        condition=_median(e.condition[e.answered]),
        noise_sd=_median(e.noise_sd[e.answered]),
        alpha=_median(e.alpha[e.answered]),
        probability=_median(sure),
        least=float(sure.min()) if sure.size else float("nan"),
    )


def _median(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def leading(results: Results) -> EstimatorResults | None:
    """The estimator the headline speaks of.

    One that gives probabilities, or else jmap, the first that judges its delays, the first with delays, or
    the first at all.
    """
    having = [e for e in results.estimators if e.dates]
    with_delay = [e for e in having if estimates_delay(e)]
    named = [e for e in with_delay if ESTIMATORS[e.estimator].has_probability]
    named += [e for e in with_delay if e.estimator == "jmap"]
    judging = [e for e in with_delay if not ESTIMATORS[e.estimator].unjudged]
    return next(iter(named + judging + with_delay + having), None)


def headline(results: Results) -> list[str]:
    """Sentences about the leading estimator, the first of them the headline.

    A river's begin with t50, of the estimator that :func:`rivid.results.passage.leading_response` names:
    it is what can be estimated there. The jump delay follows, with what it is worth.

    Parameters
    ----------
    results : Results
        All of OUT.

    Returns
    -------
    list of str
        Plain text, at least one sentence.
    """
    e = leading(results)
    if e is None:
        return ["There is no day in these results."]
    f = facts(results, e)
    river = passage.leading_response(results)
    if river is not None:
        said = passage.sentences(results, river)
        if results.assumed:
            said.append(not_compared(results))
        if f.with_delay:
            said += _jump(results, e, f, passage.passage(results, river)) + _doubts(results, e, f)
        return said
    if not estimates_delay(e):
        return [f"{count(f.answered, 'day')} of {f.days:,} have an impulse response ({e.estimator})."]
    if not f.with_delay:
        return [f"None of {count(f.days, 'day')} has a delay: {statuses(e.status)}.", *_reasons(e)]
    said = [_main(results, e, f)]
    if ESTIMATORS[e.estimator].has_probability:
        said += _sure(e, f) + _rest(e, f) + _reasons(e) + ([] if _piled(e, f) else waves(results, e))
    else:
        said += _rest(e, f) + ([] if _piled(e, f) else waves(results, e)) + _prior(results, e, f)
    return said + _doubts(results, e, f)


def _main(results: Results, e: EstimatorResults, f: Facts) -> str:
    T_s = results.sample_time
    reaches = f"the inflow reaches the {output_words(results.output_unit)} after"
    words = f"{reaches} {travel_first(f.common, T_s)}"
    if e.travel_s is not None:
        time = about(float(np.median(e.travel_s[found(e)])))
        middle = "" if f.with_delay == 1 else " on the median day"
        words = f"the delay is {samples(f.common)}; {reaches} {time}{middle}"
    if f.days == 1:
        return f"On {e.dates[0]} {words}."
    if _piled(e, f):
        edges = " or ".join(number(d) for d in f.common)
        return (
            f"On {f.common_days:,} of {f.days:,} days {e.estimator} finds no delay inside what was tried: "
            f"its answer is the edge, d = {edges}."
        )
    if f.common_days < SPREAD_OUT * f.with_delay:
        low, high = (float(q) for q in np.quantile(e.delay[found(e)], (0.1, 0.9), method="inverted_cdf"))
        return (
            f"Over {count(f.with_delay, 'day')} the median delay is {samples_first([f.median], T_s)}; on four"
            f" days of five it is {number(low)} to {number(high)} samples ({travel_within(low, high, T_s)})."
        )
    if f.common_days == f.days:
        return f"On all {f.days:,} days {words}."
    return f"On {f.common_days:,} of {f.days:,} days {words}."


def _piled(e: EstimatorResults, f: Facts) -> bool:
    """Whether most days lie at the two ends of the delays tried."""
    tried = candidates(e)
    ends = (float(tried[0]), float(tried[-1]))
    return f.common == ends and tried.size > 2 and f.common_days >= SPREAD_OUT * f.with_delay


def _rest(e: EstimatorResults, f: Facts) -> list[str]:
    other, without = f.with_delay - f.common_days, f.days - f.with_delay
    parts = []
    if other and f.common_days >= SPREAD_OUT * f.with_delay:
        parts.append(f"{count(other, 'day')} {'says' if other == 1 else 'say'} something else")
    if without:
        reasons = statuses(e.status)
        parts.append(f"{count(without, 'day')} {'has' if without == 1 else 'have'} no answer ({reasons})")
    return [" and ".join(parts) + "."] if parts else []


def _sure(e: EstimatorResults, f: Facts) -> list[str]:
    """How many days are answered, and how sure that is."""
    if f.days == 1:
        return [f"The probability that this is right is {probability(f.probability)}."]
    return [
        f"{e.estimator} answers {f.with_delay:,} of {f.days:,} days ({share(f.with_delay, f.days)}); the "
        f"probability that its delay is right is {probability(f.probability)} on the median day and "
        f"{probability(f.least)} on the least sure one."
    ]


def _reasons(e: EstimatorResults) -> list[str]:
    """Why days are unidentifiable, for an estimator that has several reasons; the most frequent first."""
    if not ESTIMATORS[e.estimator].has_probability:
        return []
    said = Counter(
        text.split("; ")[0]
        for text, status in zip(e.messages, e.status, strict=True)
        if status == "unidentifiable"
    )
    return [f"Unidentifiable on {count(n, 'day')}: {reason}." for reason, n in said.most_common(MOST_REASONS)]


def _jump(results: Results, e: EstimatorResults, f: Facts, p: passage.Passage) -> list[str]:
    """What the jump delay is worth in a river."""
    T_s = results.sample_time
    low, high = (float(q) for q in np.quantile(e.delay[found(e)], (0.1, 0.9), method="inverted_cdf"))
    little = f.prior_only >= LITTLE * f.with_delay or high - low > 2 * (p.high - p.low)
    worth = "is worth little here" if little else "says no more than t50 here"
    whose = "the prior's" if ESTIMATORS[e.estimator].rayleigh else "chance"
    method = ESTIMATORS[e.estimator].method
    text = (
        f"The jump delay d of {e.estimator} {worth}: the {method} looks for a jump, and a dispersive river "
        "has none. "
        f"{'It' if f.with_delay == 1 else 'Its median'} is {samples_first([f.median], T_s)}"
    )
    if f.with_delay > passage.FEW:
        text += f", on four days in five it lies anywhere from {number(low)} to {number(high)}"
    if f.prior_only:
        on = "here" if f.with_delay == 1 else f"on {passage.of_days(f.prior_only, f.with_delay)}"
        text += f"; {on} the data alone favour another delay, or none, and d is {whose} (prior_only)"
    said = [f"{text}."]
    if ESTIMATORS[e.estimator].rayleigh:
        said.append(f"The Rayleigh prior alone, without any data, answers {_of_prior(results, e)[1]}.")
    return said


def _prior(results: Results, e: EstimatorResults, f: Facts) -> list[str]:
    """How much of the answer the prior decides."""
    if ESTIMATORS[e.estimator].unjudged:
        return [f"{e.estimator} does not tell on which days the data single the delay out; jmap does."]
    rayleighs = ESTIMATORS[e.estimator].rayleigh
    cause = "the answer is the prior's" if rayleighs else "the answer may be chance"
    alone = "the data alone favour another delay, or none"
    if f.prior_only == f.with_delay == 1:
        said = f"But {alone}: {cause}."
    elif f.prior_only:
        part = share(f.prior_only, f.with_delay)
        said = f"On {count(f.prior_only, 'day')} ({part} of those with a delay) {alone}: {cause}."
    else:
        said = "On every day with a delay, the data alone say the same, to within a sample."
    if not rayleighs:
        return [said]
    modes, words = _of_prior(results, e)
    prior = f"The Rayleigh prior alone, without any data, answers {words}"
    if min(float(np.abs(modes - d).min()) for d in f.common) > 1:
        return [said, f"{prior}: it is the data that lead elsewhere."]
    return [said, f"{prior}: being near it proves little by itself.{_without_prior(results)}"]


def _of_prior(results: Results, e: EstimatorResults) -> tuple[Floats, str]:
    """The delays the Rayleigh prior favours by itself [samples], and the words for them."""
    tried = candidates(e)
    p = rayleigh(tried, results.delay_scale)
    modes = tried[p > 0.99 * p.max()]  # for 6.5 samples, 6 and 7 differ by less than the paper's digits
    spelt = [number(float(d)) for d in modes]
    words = listed(spelt, "or") if len(spelt) < 3 else f"{spelt[0]} to {spelt[-1]}"
    return modes, f"{words} (sigma_d = {number(results.delay_scale)})"


def _without_prior(results: Results) -> str:
    """What an estimator with a uniform prior says of the same days, or where to get one."""
    for e in results.estimators:
        if e.estimator.startswith("jmap-uniform") and (f := facts(results, e)).with_delay:
            return (
                f" With a uniform prior, {e.estimator} puts {f.common_days:,} of {f.with_delay:,} days on "
                f"{samples_first(f.common, results.sample_time)}."
            )
    return " The estimator jmap-uniform-estimated works without it: run it beside."


def _doubts(results: Results, e: EstimatorResults, f: Facts) -> list[str]:
    said = []
    if f.at_bound:
        low, high = number(float(candidates(e)[0])), number(float(candidates(e)[-1]))
        verb = "is" if f.at_bound == 1 else "are"
        said.append(
            f"{count(f.at_bound, 'day')} {verb} at a bound, d = {low} or {high}"
            + ("." if ESTIMATORS[e.estimator].has_probability else ": the delay may lie outside.")
        )
    if f.too_fast:
        said.append(
            f"On {count(f.too_fast, 'day')} the {output_words(results.output_unit)} would move more than a "
            "sample before a gravity wave can arrive: doubt the answer, or the geometry in the configuration."
        )
    if f.degenerate and not ESTIMATORS[e.estimator].degenerates:
        said.append(f"On {count(f.degenerate, 'day')} the estimate is degenerate: alpha ran away.")
    return said
