"""Days to look at, the latest first: those of every estimator, and those far outside the band."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rivid.report.attention import Attention, attention
from rivid.report.headline import leading
from rivid.report.lately import Lately, band
from rivid.results.read import Results
from rivid.results.selection import estimates_delay
from rivid.text import day_range, delays, number, samples_first


def to_look_at(results: Results, recent: Lately | None) -> list[Attention]:
    """Rows of :func:`rivid.report.attention.attention`, with the days far outside the band; newest first.

    Parameters
    ----------
    results : Results
        All of OUT.
    recent : Lately or None
        What speaks for the reach; only its days are measured by a band.

    Returns
    -------
    list of Attention
        By their last day, the latest first.
    """
    rows = attention(results) + (outlying(results, recent) if recent else [])
    return sorted(rows, key=lambda row: (row.last, row.first), reverse=True)


def outlying(results: Results, recent: Lately) -> list[Attention]:
    """Days whose delay or t50 lies further outside the band than the band is wide, a row each.

    A day that is at a bound or degenerate has its row already.
    """
    limits = band(recent.values)
    if limits is None:
        return []
    e, T_s = recent.estimator, results.sample_time
    told = np.array([status == "degenerate" for status in e.status], bool)
    if not recent.passage:
        told |= e.at_bound
    usual = f"nine days in ten lie between {number(round(limits.low, 1))} and {number(round(limits.high, 1))}"
    if limits.low == limits.high:
        usual = f"nine days in ten have {number(limits.low)}"
    what = "t50" if recent.passage else "the travel time" if recent.travel else "the delay"
    rows = []
    for i in np.flatnonzero(limits.far(recent.values) & ~told):
        value = float(recent.values[i])
        words = samples_first([value], T_s)
        if recent.passage or recent.travel:
            words = delays([round(value, 1)], T_s)
        doubt = "" if recent.carried[i] else "; the data alone favour another delay, or none"
        date = e.dates[i]
        rows.append(
            Attention(
                date, date, 1, "far outside", (e.estimator,), f"{what} is {words}: {usual} samples{doubt}"
            )
        )
    return rows


@dataclass(frozen=True)
class Looking:
    """How many days there are to look at, for the estimators that speak for the reach.

    Attributes
    ----------
    late : tuple of (str, int)
        Those of the last week in words, each with its row.
    days, earlier, others : int
        Days of the last week; days before; days that only other estimators doubt.
    latest : str
        The last day before the last week; empty where there is none.
    """

    late: tuple[tuple[str, int], ...]
    days: int
    earlier: int
    others: int
    latest: str


def looking(results: Results, recent: Lately, rows: Sequence[Attention]) -> Looking:
    """Count the days of rows of :func:`to_look_at`."""
    lead = leading(results)
    speaking = {recent.estimator.estimator} | ({lead.estimator} if lead and estimates_delay(lead) else set())
    late, early, others = (set[dt.date]() for _ in range(3))
    named = []
    for k, row in enumerate(rows):
        days = dates_of(row, results)
        if not speaking & set(row.estimators):
            others |= days
            continue
        inside = {day for day in days if day >= recent.first}
        late |= inside
        early |= days - inside
        if inside:
            named.append((f"{day_range(min(inside), max(inside))} {row.kind}", k))
    return Looking(
        late=tuple(named),
        days=len(late),
        earlier=len(early),
        others=len(others - late - early),
        latest=str(max(early)) if early else "",
    )


def dates_of(row: Attention, results: Results) -> set[dt.date]:
    """The days of a row, also where these are not one after the other."""
    if (row.last - row.first).days + 1 == row.days:
        return {row.first + dt.timedelta(days=k) for k in range(row.days)}
    (e,) = (e for e in results.estimators if e.estimator == row.estimators[0])
    return {date for date, edge in zip(e.dates, e.at_bound, strict=True) if edge}
