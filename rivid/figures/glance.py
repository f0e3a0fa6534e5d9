"""What a reader with one minute has to know: the delay now, its trend, days to look at, whose word it is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rivid.figures.attention import Attention
from rivid.figures.headline import facts, leading
from rivid.figures.lately import FEWEST_DAYS, WEEK, WEEKS, Lately, Trend, weeks_ago
from rivid.figures.looking import looking
from rivid.figures.selection import candidates, estimates_delay
from rivid.figures.words import (
    PROBABLE,
    RAYLEIGH,
    UNJUDGED,
    count,
    day_range,
    duration,
    minutes_first,
    probability,
    share,
    statuses,
)
from rivid.results import EstimatorResults, Results

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
        Of :func:`rivid.figures.lately.lately`.
    rows : sequence of Attention
        Of :func:`rivid.figures.looking.to_look_at`; a link is an index into it.
    """
    lines = [_now(results, recent)]
    if np.isfinite(recent.values).any():
        lines.append(_moved(results, recent))
    lines.append(_look(results, recent, rows))
    return Glance(_headline(results, recent), (*lines, *_word(results, recent)))


def _headline(results: Results, recent: Lately) -> str:
    e, T_s, t = recent.estimator, results.sample_time, recent.trend
    what = "t50" if recent.passage else "delay"
    if set(e.status) == {"pending"}:
        return f"No day is finished yet: {count(len(e.dates), 'day is', 'days are')} pending."
    if not np.isfinite(recent.values).any():
        return f"None of {count(len(e.dates), 'day')} has a {what}{_why(e, np.ones(len(e.dates), bool))}."
    if not np.isfinite(recent.median):
        return f"No day of the last week has a {what}{_why(e, recent.week)}."
    words = minutes_first(recent.median, T_s)
    said = f"Half of a step arrives after {words}" if recent.passage else f"The delay is {words}"
    if len(e.dates) == 1:
        said = f"On {e.dates[0]} {said[0].lower()}{said[1:]}"
    if t is not None and t.moved:
        return f"{said}: {_change(t, T_s)} than in the weeks before."
    if 2 * recent.by_prior > int(recent.with_value.sum()):
        whose = "the prior says so more than the data" if e.estimator in RAYLEIGH else "it may be chance"
        return f"{said}, but {whose}."
    if t is None:
        return f"{said}."
    return f"{said}, {'as in' if t.now == t.before else 'within the scatter of'} the weeks before."


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
            value = minutes_first(float(recent.values[days[-1]]), T_s)
            before = f"; the last one is of {e.dates[days[-1]]}: {value}."
        return Line("Now", "not known", f"No {what} on {when}{before}", doubt=True)
    values = recent.values[given]
    low, high = float(values.min()), float(values.max())
    span = f"from {duration([low * T_s, high * T_s])}" if low < high else "all the same"
    text = f"The median of {day_range(max(recent.first, e.dates[0]), recent.last)}"
    text += f": {values.size} of {count(int(recent.week.sum()), 'day')} with a {what}"
    text += f", {span}." if values.size > 1 else "."
    if len(e.dates) == 1:
        text = "One day alone."
    edge = not recent.passage and recent.median in _ends(e)
    if edge:
        text += " It is an end of what was tried: the true delay may lie outside."
    return Line("Now", minutes_first(recent.median, T_s), text, doubt=edge)


def _ends(e: EstimatorResults) -> tuple[float, ...]:
    """The shortest and the longest delay tried [samples]."""
    tried = candidates(e)
    return (float(tried[0]), float(tried[-1])) if tried.size > 2 else ()


def _moved(results: Results, recent: Lately) -> Line:
    """Whether it has moved: the size of the change beside the scatter of weeks."""
    t, T_s, e = recent.trend, results.sample_time, recent.estimator
    if t is None:
        return Line("Has it moved?", "Cannot be told", _untold(recent))
    before = f"the {t.weeks} weeks before"
    on = ", on the days that the data decide" if recent.by_prior else ""
    text = (
        f"Median {duration([t.now * T_s])} in the last week, {duration([t.before * T_s])} in {before}{on}; "
    )
    low, high = duration([t.low * T_s]), duration([t.high * T_s])
    if low == high:
        text += "each of these has that median."
    else:
        text += f"theirs lie from {duration([t.low * T_s, t.high * T_s])}."
    if e.estimator in UNJUDGED and not recent.passage:
        text += f" {e.estimator} does not tell on which days the data decide."
    text += _flow(recent)
    if t.moved:
        return Line("Has it moved?", f"Yes, {_change(t, T_s)}", text, doubt=True)
    if t.now == t.before:
        return Line("Has it moved?", "No", text)
    return Line("Has it moved?", "Not beyond its scatter", f"{_change(t, T_s).capitalize()}. {text}")


def _change(t: Trend, sample_time: float) -> str:
    """The size of a move.

    Examples
    --------
    >>> _change(Trend(8.0, 7.0, 6.0, 7.0, 7, 8, 4.0, True), 133)
    '2.2 min longer'
    """
    change = (t.now - t.before) * sample_time
    return f"{duration([abs(change)])} {'longer' if change > 0 else 'shorter'}"


def _untold(recent: Lately) -> str:
    """Why nothing is said of a move."""
    if recent.whole:
        return "There are no weeks before to compare with."
    of = "have a t50" if recent.passage else "have a delay that the data decide"
    if recent.estimator.estimator in UNJUDGED | PROBABLE and not recent.passage:
        of = "have a delay"
    days = int((recent.week & recent.carried).sum())
    if days < FEWEST_DAYS:
        return f"It takes {FEWEST_DAYS} days that {of}; the last week has {days}."
    return f"Of the {WEEKS} weeks before, too few have {FEWEST_DAYS} days that {of}."


def _flow(recent: Lately) -> str:
    """The mean inflow of both spans: a delay may well move with the flow."""
    Q, ago = recent.estimator.mean_inflow, weeks_ago(recent.estimator.dates)
    now, before = (Q[np.isfinite(Q) & part] for part in (ago == 0, (ago > 0) & (ago <= WEEKS)))
    if not now.size or not before.size:
        return ""
    return f" Mean inflow {now.mean():,.0f} m³/s, in the weeks before {before.mean():,.0f}."


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
    strong = f"{seen.days:,} {of}" if recent.whole else f"{count(seen.days, 'day')} {of}"
    if not seen.days:
        strong = "No day" if recent.whole else f"No day {of}"
    return Line("To look at", strong, " ".join(said), seen.late[:NAMED], doubt=seen.days > 0)


def _word(results: Results, recent: Lately) -> list[Line]:
    """How much of the answer is the prior's, or chance; or how sure it is."""
    e, given = recent.estimator, recent.with_value
    if recent.passage:
        return [_word_of_response(results, e)]
    f, n = facts(results, e), int(given.sum())
    if not f.with_delay:
        return []
    if e.estimator in UNJUDGED:
        text = f"{e.estimator} does not tell on which days the data single the delay out; jmap does."
        return [Line("The prior's part", "Not told", text)]
    week = "these days" if recent.whole else f"the last {WEEK} days"
    if e.probability is not None:
        sure = e.probability[given] if n else e.probability[np.isfinite(recent.values)]
        of = week if n else "the record"
        text = f"That the delay is right, on the median day of {of}; {probability(float(sure.min()))} on the "
        return [Line("Probability", probability(float(np.median(sure))), f"{text}least sure.")]
    name = "The prior's part" if e.estimator in RAYLEIGH else "Perhaps chance"
    what = "There the data alone favour another delay, or none."
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
        if lead.estimator not in UNJUDGED | PROBABLE:
            days = f"{f.prior_only:,} of {count(f.with_delay, 'day')} ({share(f.prior_only, f.with_delay)})"
            whose = "the prior's" if lead.estimator in RAYLEIGH else "chance"
            said += f" The jump delay of {lead.estimator} is {whose} on {days}."
    return Line("The prior's part", strong, said)
