"""How long a river needs to pass half of a step, t50, over the record: numbers, and sentences from them."""

from dataclasses import dataclass

import numpy as np

from rivid.results.read import EstimatorResults, Results
from rivid.text import (
    count,
    delays,
    duration,
    listed,
    number,
    share,
    statuses,
)
from rivid.types import Bools

MOST = 0.8
"""The share of days that a range holds: four days in five."""

FEW = 9
"""With fewer days, no thirds and no range of four days in five."""

CLEAR = 0.7
"""t50 falls with the flow where a day of low flow has the longer t50 in this share of pairs of days."""


@dataclass(frozen=True)
class Thirds:
    """t50 by thirds of the mean inflow.

    Attributes
    ----------
    edges : tuple of float
        Mean inflows [m3/s]: lowest, end of the lower third, begin of the upper third, highest.
    medians : tuple of float
        Median t50 [samples] of the lower, middle and upper third.
    longer : float
        Share of pairs of a day of the lower and a day of the upper third in which the lower has the longer
        t50; 0.5 where the flow does not matter.
    """

    edges: tuple[float, float, float, float]
    medians: tuple[float, float, float]
    longer: float


@dataclass(frozen=True)
class Passage:
    """t50 over the record.

    Attributes
    ----------
    days, with_t50 : int
        Rows; those with a t50.
    median, low, high : float
        Median, and the range of four days in five (of all days, where they are few) [samples].
    thirds : Thirds or None
        None where too few days have a mean inflow, or all the same.
    bounded, between : int
        Days with both bounds (5), and those of them whose t50 lies between them.
    """

    days: int
    with_t50: int
    median: float
    low: float
    high: float
    thirds: Thirds | None
    bounded: int
    between: int


def has_t50(estimator: EstimatorResults) -> Bools:
    """Days with a t50, shape (n,)."""
    return np.isfinite(estimator.t50) & estimator.answered


def leading_response(results: Results) -> EstimatorResults | None:
    """The estimator whose t50 speaks for a river: map, jmap or ml, or else the first; None in a pool."""
    if results.output_unit == "m":
        return None
    having = [e for e in results.estimators if e.dates]
    first = [e for name in ("map", "jmap", "ml") for e in having if e.estimator == name]
    with_t50 = [e for e in first + having if has_t50(e).any()]
    return next(iter(with_t50 + first + having), None)


def passage(results: Results, estimator: EstimatorResults) -> Passage:
    """Condense the t50 of one estimator; NaN where no day has one."""
    e, days = estimator, has_t50(estimator)
    t50 = e.t50[days]
    tails = (1 - MOST) / 2 if t50.size > FEW else 0.0
    low, median, high = (
        (float(q) for q in np.quantile(t50, (tails, 0.5, 1 - tails))) if t50.size else (np.nan,) * 3
    )
    seconds = e.t50 * results.sample_time
    bounded = days & np.isfinite(e.bound_gravity_s) & np.isfinite(e.bound_kinematic_s)
    inside = bounded & (seconds >= e.bound_gravity_s) & (seconds <= e.bound_kinematic_s)
    return Passage(
        days=len(e.dates),
        with_t50=int(days.sum()),
        median=median,
        low=low,
        high=high,
        thirds=thirds(e),
        bounded=int(bounded.sum()),
        between=int(inside.sum()),
    )


def thirds(estimator: EstimatorResults) -> Thirds | None:
    """t50 by thirds of the mean inflow of the days that have both."""
    e = estimator
    days = has_t50(e) & np.isfinite(e.mean_inflow)
    Q, t50 = e.mean_inflow[days], e.t50[days]
    if Q.size < FEW or Q.min() == Q.max():
        return None
    edges = np.quantile(Q, (0, 1 / 3, 2 / 3, 1))
    third = np.searchsorted(edges[1:3], Q)
    parts = [t50[third == k] for k in range(3)]
    if min(part.size for part in parts) < FEW // 3:
        return None
    lower, upper = parts[0], np.sort(parts[2])
    # Mann and Whitney's count of pairs, equal ones by halves
    shorter = np.searchsorted(upper, lower, "left") + np.searchsorted(upper, lower, "right")
    first, second, third_, last = (float(q) for q in edges)
    low, middle, high = (float(np.median(part)) for part in parts)
    return Thirds((first, second, third_, last), (low, middle, high), float(shorter.mean() / 2 / upper.size))


def sentences(results: Results, estimator: EstimatorResults) -> list[str]:
    """t50 of a river in words, the first of them the headline of the report."""
    e, T_s = estimator, results.sample_time
    p = passage(results, e)
    if not p.with_t50:
        return [f"None of {count(p.days, 'day')} has a t50: {_without(e)}."]
    said = [_main(e, p, T_s)]
    if p.thirds is not None:
        said.append(_flow(p.thirds, T_s))
    said += _hydraulics(e, p, T_s)
    without = p.days - p.with_t50
    if without:
        said.append(f"{count(without, 'day')} {'has' if without == 1 else 'have'} no t50 ({_without(e)}).")
    return said


def _main(e: EstimatorResults, p: Passage, T_s: float) -> str:
    text = f"alf of a step has arrived after {delays([p.median], T_s)}"
    if p.days == 1:
        return f"On {e.dates[0]} h{text}."
    low, high = (f"{number(round(t, 1))} ({duration([t * T_s])})" for t in (p.low, p.high))
    if low == high or p.with_t50 == 1:
        return f"H{text}, on {count(p.with_t50, 'day')}."
    most = "four days in five" if p.with_t50 > FEW else f"all {p.with_t50} days"
    return f"H{text} on the median day; between {low} and {high} on {most}."


def _flow(t: Thirds, T_s: float) -> str:
    low, high = (duration([t.medians[k] * T_s]) for k in (0, 2))
    below, above = (flow(q) for q in t.edges[1:3])
    how = "does not follow the flow"
    if t.longer >= CLEAR:
        how = "falls as the flow rises"
    elif t.longer <= 1 - CLEAR:
        how = "grows as the flow rises"
    return (
        f"It {how}: {low} below a mean inflow of {below} m³/s, {high} above {above} "
        "(medians of the lower and the upper third of days)."
    )


def _hydraulics(e: EstimatorResults, p: Passage, T_s: float) -> list[str]:
    """The bounds (5) beside t50: both are travel times and compare directly."""
    waves = []
    for name, seconds in (("gravity", e.bound_gravity_s), ("kinematic", e.bound_kinematic_s)):
        finite = seconds[has_t50(e) & np.isfinite(seconds)]
        if finite.size:
            span = list(dict.fromkeys([float(finite.min()), float(finite.max())]))
            waves.append(f"a {name} wave takes {duration(span)}")
    if not waves:
        return []
    text = (
        "This lag, t50, is a travel time at the middle of the response. By the hydraulics of the reach, "
        f"{listed(waves)}"
    )
    if p.bounded:
        one = "it lies between them" if p.between else "it does not lie between them"
        many = f"t50 lies between them on {p.between:,} of {count(p.bounded, 'day')}"
        text += f"; {one if p.bounded == 1 else many}"
    return [text + "."]


def _without(e: EstimatorResults) -> str:
    """Why days have no t50."""
    silent = int((e.answered & ~np.isfinite(e.t50)).sum())
    parts = [statuses(e.status)] if statuses(e.status) else []
    if silent:
        parts.append(f"{silent:,} with a response that does not sum to anything positive")
    return listed(parts)


def flow(value: float) -> str:
    """A discharge [m3/s] to three digits or to whole units.

    Examples
    --------
    >>> flow(279.1), flow(12.345), flow(1315.4)
    ('279', '12.3', '1,315')
    """
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def of_days(part: int, whole: int) -> str:
    """Some of the days, with their share.

    Examples
    --------
    >>> of_days(207, 424)
    '207 of 424 days (49 %)'
    """
    return f"{part:,} of {count(whole, 'day')} ({share(part, whole)})"
