"""What a reader with one minute has to know: the delay now, its trend, days to look at, whose word it is."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rivid.estimators import ESTIMATORS
from rivid.report.attention import Attention, missing, spans
from rivid.report.headline import facts, leading
from rivid.report.lately import WEEK, Lately
from rivid.report.looking import looking
from rivid.report.moved import change, lasting, moved
from rivid.report.waves import FASTER, gravity, not_compared, too_fast
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import candidates, estimates_delay
from rivid.text import (
    about,
    count,
    day_range,
    minutes_first,
    number,
    output_words,
    probability,
    samples,
    share,
    statuses,
    step,
    travel,
    travel_first,
)

NAMED = 6
"""So many days to look at are named at the top; the table has all."""


@dataclass(frozen=True)
class Line:
    """One of the things to know.

    Attributes
    ----------
    name, strong, text : str
        What it is about; the answer in a few words; what that rests on.
    links : tuple of (str, int)
        Days, each with its row in the table of days.
    doubt : bool
        Whether it asks for attention.
    """

    name: str
    strong: str
    text: str
    links: tuple[tuple[str, int], ...] = ()
    doubt: bool = False


@dataclass(frozen=True)
class Glance:
    """The top of the page: one sentence, and the lines below it."""

    headline: str
    lines: tuple[Line, ...]


def glance(results: Results, recent: Lately, rows: Sequence[Attention]) -> Glance:
    """Put the last week into words.

    Parameters
    ----------
    results : Results
        All of OUT.
    recent : Lately
        Of :func:`rivid.report.lately.lately`.
    rows : sequence of Attention
        Of :func:`rivid.report.looking.to_look_at`; a link is an index into it.
    """
    lines = [_now(results, recent)]
    if np.isfinite(recent.values).any():
        strong, text, doubt = moved(results, recent)
        lines.append(Line("Has it moved?", strong, text, doubt=doubt))
    lines.append(_look(results, recent, rows))
    return Glance(
        _headline(results, recent), (*lines, *_word(results, recent), *_hydraulics(results, recent))
    )


def _headline(results: Results, recent: Lately) -> str:
    e, T_s, t = recent.estimator, results.sample_time, recent.trend
    what = "t50" if recent.passage else "delay"
    if set(e.status) == {"pending"}:
        return f"No day is finished yet: {count(len(e.dates), 'day is', 'days are')} pending."
    if not np.isfinite(recent.values).any():
        return f"None of {count(len(e.dates), 'day')} has a {what}{_why(e, np.ones(len(e.dates), bool))}."
    if not np.isfinite(recent.median):
        return f"No day of the last week has a {what}{_why(e, recent.week)}."
    if recent.passage:
        said = f"Half of a step arrives after {minutes_first(recent.median, T_s)}"
    else:
        said = f"The inflow reaches the {output_words(results.output_unit)} after {_answer(recent, T_s)}"
    if len(e.dates) == 1:
        said = f"On {e.dates[0]} {said[0].lower()}{said[1:]}"
    given, asked = int(recent.with_value.sum()), int(recent.week.sum())
    if 2 * given < asked:
        said += f", on {given} of {asked} days (the others have no answer)"
    if t is not None and t.moved:
        said += f": {change(t, T_s)} than in the weeks before"
    elif t is not None and 2 * recent.by_prior <= given:
        said += f", {'as in' if t.now == t.before else 'within the scatter of'} the weeks before"
    whose = _whose(results, recent)
    said += f"{whose}." if said.endswith(")") else f"{whose.replace(',', ';', 1)}."
    fast = too_fast(results, e, passage=recent.passage) & recent.with_value
    return f"{said} That is {FASTER}" if 2 * int(fast.sum()) >= given else said


def _answer(recent: Lately, sample_time: float) -> str:
    """The travel time of the last week, and its delay."""
    if not recent.travel:
        return travel_first([recent.delay], sample_time)
    d = f"{samples([recent.delay])} of {step(sample_time)}"
    return f"{about(recent.median * sample_time)} (delay d = {d})"


def _whose(results: Results, recent: Lately) -> str:
    """That the prior, or chance, decides a third of the days or more; of the week, or else of the record."""
    given, by_prior, e = int(recent.with_value.sum()), recent.by_prior, recent.estimator
    word = "by the prior's word" if ESTIMATORS[e.estimator].rayleigh else "perhaps by chance"
    if by_prior and 3 * by_prior >= given:
        if given == 1:
            return f", {word}"
        return (
            f", on all {given} days {word}"
            if by_prior == given
            else f", on {by_prior} of {given} days {word}"
        )
    f = facts(results, e)
    if not recent.passage and f.prior_only and 3 * f.prior_only >= f.with_delay:
        return f", over the record on {f.prior_only:,} of {f.with_delay:,} days {word}"
    return ""


def _why(e: EstimatorResults, days: NDArray[np.bool_]) -> str:
    """Why days have no answer, after a colon; nothing where they are answered without a delay."""
    reasons = statuses([s for s, day in zip(e.status, days, strict=True) if day])
    return f": {reasons}" if reasons else ""


def _now(results: Results, recent: Lately) -> Line:
    e, T_s, given = recent.estimator, results.sample_time, recent.with_value
    what = "t50" if recent.passage else "delay"
    when = day_range(max(recent.first, e.dates[0]), recent.last)
    if not given.any():
        days = np.flatnonzero(np.isfinite(recent.values))
        before = "."
        if days.size:
            value = lasting(recent, [float(recent.values[days[-1]])], T_s)
            before = f"; the last one is of {e.dates[days[-1]]}: {value}."
        return Line("Now", "not known", f"No {what} on {when}{before}", doubt=True)
    values = recent.values[given]
    low, high = float(values.min()), float(values.max())
    span = f"from {lasting(recent, [low, high], T_s)}" if low < high else "all the same"
    text = f"The median of {when}: {values.size} of {count(int(recent.week.sum()), 'day')} with a {what}"
    text += f", {span}." if values.size > 1 else "."
    if len(e.dates) == 1:
        text = "One day alone."
    edge = not recent.passage and recent.delay in _ends(e)
    if edge:
        text += " It is an end of what was tried: the true delay may lie outside."
    now = minutes_first(recent.median, T_s)
    if not recent.passage:
        time = about(recent.median * T_s) if recent.travel else travel([recent.delay], T_s)
        now = f"{time} ({samples([recent.delay])})"
    return Line("Now", now, text, doubt=edge)


def _ends(e: EstimatorResults) -> tuple[float, ...]:
    """The shortest and the longest delay tried [samples]."""
    tried = candidates(e)
    return (float(tried[0]), float(tried[-1])) if tried.size > 2 else ()


def _look(results: Results, recent: Lately, rows: Sequence[Attention]) -> Line:
    seen = looking(results, recent, rows)
    of = f"of {count(len(recent.estimator.dates), 'day')}" if recent.whole else "of the last week"
    said = []
    if len(seen.late) > NAMED:
        said.append(f"and {count(len(seen.late) - NAMED, 'more row')} in the table.")
    if seen.earlier:
        said.append(f"{seen.earlier:,} before it, the latest {seen.latest}.")
    if seen.others:
        said.append(f"{count(seen.others, 'day')} that only other estimators doubt.")
    gone = missing(recent.estimator.dates)
    if gone:
        said.append(_no_log(gone))
    strong = f"{seen.days:,} {of}" if recent.whole else f"{count(seen.days, 'day')} {of}"
    if not seen.days:
        strong = "No day failed or stands out" + ("" if recent.whole else " in the last week")
        if _whose(results, recent):
            said.insert(
                0,
                "But see the prior's part."
                if ESTIMATORS[recent.estimator.estimator].rayleigh
                else "But it may be chance: see below.",
            )
    late = any(day >= recent.first for day in gone)
    return Line("To look at", strong, " ".join(said), seen.late[:NAMED], doubt=seen.days > 0 or late)


def _no_log(gone: Sequence[dt.date]) -> str:
    """Days of which there is no log, the latest named."""
    named = spans(gone)
    text = ", ".join(named[-NAMED:])
    if len(named) > NAMED:
        text = f"the latest {text}"
    return f"No log on {count(len(gone), 'day')} ({text})."


def _hydraulics(results: Results, recent: Lately) -> list[Line]:
    """What the waves of the reach say of the answer; of a river, only where it contradicts them."""
    name, e = "The hydraulics", recent.estimator
    if results.assumed:
        return [Line(name, "Not compared", not_compared(results))]
    given = recent.with_value if recent.with_value.any() else np.isfinite(recent.values)
    wave = gravity(e, given)
    if not wave:
        return []
    text = "for a gravity wave, the fastest of the reach, at the flows of these days."
    if fast := int((too_fast(results, e, passage=recent.passage) & given).sum()):
        asked = (
            FASTER if 2 * fast >= int(given.sum()) else "faster than that by more than a sample: doubt it."
        )
        text += f" On {fast:,} of {count(int(given.sum()), 'day')} the answer is {asked}"
    return [Line(name, wave, text, doubt=fast > 0)] if fast or not recent.passage else []


def _word(results: Results, recent: Lately) -> list[Line]:
    """How much of the answer is the prior's, or chance; or how sure it is."""
    e, given = recent.estimator, recent.with_value
    if recent.passage:
        return [_word_of_response(results, e)]
    f, n = facts(results, e), int(given.sum())
    if not f.with_delay:
        return []
    if ESTIMATORS[e.estimator].unjudged:
        text = f"{e.estimator} does not tell on which days the data single the delay out; jmap does."
        return [Line("The prior's part", "Not told", text)]
    week = "these days" if recent.whole else f"the last {WEEK} days"
    if e.probability is not None:
        sure = e.probability[given] if n else e.probability[np.isfinite(recent.values)]
        of = week if n else "the record"
        text = f"That the delay is right, on the median day of {of}; {probability(float(sure.min()))} on the "
        return [Line("Probability", probability(float(np.median(sure))), f"{text}least sure.")]
    name = "The prior's part" if ESTIMATORS[e.estimator].rayleigh else "Perhaps chance"
    what = "There the data alone favour another delay, or none."
    if ESTIMATORS[e.estimator].rayleigh:
        expected = f"sigma_d = {number(results.delay_scale)} samples"
        if not results.assumed:
            expected = f"the reach's hydraulics let expect before looking at the data, {expected}"
        else:
            expected = f"is expected before looking at the data, here by {expected}"
        what += f" The prior is what {expected}."
    record = f"{f.prior_only:,} of {count(f.with_delay, 'day')} ({share(f.prior_only, f.with_delay)})"
    if recent.whole or not n:
        return [Line(name, record, what, doubt=2 * f.prior_only > f.with_delay)]
    strong = f"{recent.by_prior} of {count(n, 'day')}"
    text = f"{what} In the whole record {record}."
    return [Line(name, strong, text, doubt=2 * recent.by_prior > n)]


def _word_of_response(results: Results, e: EstimatorResults) -> Line:
    """What part the prior on the delay has in t50."""
    lead = leading(results)
    said = f"t50 is read from the response of {e.estimator}"
    strong = "None in t50"
    if estimates_delay(e):
        strong = "In the delay behind t50"
        said += " at its delay"
    said += "."
    if lead is not None and estimates_delay(lead) and (f := facts(results, lead)).with_delay:
        if ESTIMATORS[lead.estimator].unchecked:
            days = f"{f.prior_only:,} of {count(f.with_delay, 'day')} ({share(f.prior_only, f.with_delay)})"
            whose = "the prior's" if ESTIMATORS[lead.estimator].rayleigh else "chance"
            said += f" The jump delay of {lead.estimator} is {whose} on {days}."
    return Line("The prior's part", strong, said)
