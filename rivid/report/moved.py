"""Whether the delay has moved, in words: the last week beside the weeks before, and their scatter."""

from collections.abc import Sequence

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.report.lately import FEWEST_DAYS, FEWEST_WEEKS, WEEKS, Lately, Trend, weeks_ago
from rivid.results.read import Results
from rivid.text import count, duration, travel_within


def lasting(recent: Lately, values: Sequence[float], sample_time: float) -> str:
    """Values of days or weeks, from lowest to highest, as times."""
    if recent.passage or recent.travel:
        return duration([value * sample_time for value in values])
    return travel_within(values[0], values[-1], sample_time)


def moved(results: Results, recent: Lately) -> tuple[str, str, bool]:
    """Whether it has moved: the answer, what it rests on, and whether it asks for attention."""
    t, T_s, e = recent.trend, results.sample_time, recent.estimator
    if t is None:
        return "Cannot be told", _untold(recent), False
    weeks = weeks_ago(e.dates) <= WEEKS
    apart = bool((weeks & np.isfinite(recent.values) & ~recent.carried).any())
    now, then = (lasting(recent, [value], T_s) for value in (t.now, t.before))
    text = f"Median {now} in the last week, {then} in the {t.weeks} weeks before"
    text += ", on the days that the data decide; " if apart else "; "
    if t.low == t.high:
        text += "each of these has that median."
    else:
        text += f"theirs lie from {lasting(recent, [t.low, t.high], T_s)}."
    if ESTIMATORS[e.estimator].unjudged and not recent.passage:
        text += f" {e.estimator} does not tell on which days the data decide."
    text += _flow(recent)
    if t.moved:
        return f"Yes, {change(t, T_s)}", text, True
    if t.now == t.before:
        return "No", text, False
    return "Not beyond its scatter", f"{change(t, T_s).capitalize()}. {text}", False


def change(t: Trend, sample_time: float) -> str:
    """The size of a move.

    Examples
    --------
    >>> change(Trend(8.0, 7.0, 6.0, 7.0, 7, 8, 4.0, True), 133)
    '2.2 min longer'
    """
    size = (t.now - t.before) * sample_time
    return f"{duration([abs(size)])} {'longer' if size > 0 else 'shorter'}"


def _untold(recent: Lately) -> str:
    """Why nothing is said of a move."""
    if recent.whole:
        return "There are no weeks before to compare with."
    of = "have a t50" if recent.passage else "have a delay that the data decide"
    if ESTIMATORS[recent.estimator.estimator].unchecked and not recent.passage:
        of = "have a delay"
    days = int((recent.week & recent.carried).sum())
    if days < FEWEST_DAYS:
        return f"It takes {FEWEST_DAYS} days that {of}; the last week has {days}."
    ago = weeks_ago(recent.estimator.dates)
    there = min(int(ago.max()), WEEKS)
    good = int((np.bincount(ago[recent.carried], minlength=WEEKS + 1)[1 : WEEKS + 1] >= FEWEST_DAYS).sum())
    text = f"It takes {FEWEST_WEEKS} earlier weeks with {FEWEST_DAYS} days that {of}; "
    if there == WEEKS:
        return f"{text}among the {WEEKS} before the last: {good or 'none'}."
    text += f"the record has {count(there, 'earlier week')}"
    return f"{text}." if good == there else f"{text}, {good or 'none'} with so many."


def _flow(recent: Lately) -> str:
    """The mean inflow of both spans: a delay may well move with the flow."""
    Q, ago = recent.estimator.mean_inflow, weeks_ago(recent.estimator.dates)
    now, before = (Q[np.isfinite(Q) & part] for part in (ago == 0, (ago > 0) & (ago <= WEEKS)))
    if not now.size or not before.size:
        return ""
    return f" Mean inflow {now.mean():,.0f} m³/s, in the weeks before {before.mean():,.0f}."
