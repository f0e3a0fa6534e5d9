"""Days to look at, with reasons: those without an answer, and answers to doubt."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass

from rivid.estimators import ESTIMATORS
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import candidates, found
from rivid.text import NO_ANSWER, day_range, number, samples_first, share

SHOWN = 25
"""Rows of days to look at that are open on the page; the others unfold."""

CROWD = 0.25
"""Days at a bound are one row where they are more than this share, and more than the page shows open."""


@dataclass(frozen=True)
class Attention:
    """Consecutive days with the same thing to look at.

    Attributes
    ----------
    first, last : datetime.date
    days : int
    kind : str
        failed, unidentifiable, pending, degenerate or at a bound.
    estimators : tuple of str
        Who says so.
    reason : str
    """

    first: dt.date
    last: dt.date
    days: int
    kind: str
    estimators: tuple[str, ...]
    reason: str

    @property
    def when(self) -> str:
        """The day, or the days from first to last."""
        return day_range(self.first, self.last)


def attention(results: Results) -> list[Attention]:
    """Days to look at, in date order, with reasons.

    An estimator that is degenerate by its making (jmap-degenerate) is left out where it answers; one that
    piles up at its bounds has one row for all these days.
    """
    said: dict[tuple[dt.date, str, str], list[str]] = {}
    runs: list[Attention] = []
    piles: list[Attention] = []
    for e in results.estimators:
        doubts = _doubts(e, results.sample_time)
        edges = [date for date, kind, _ in doubts if kind == "at a bound"]
        if len(edges) > max(SHOWN, CROWD * len(e.dates)):
            piles.append(_pile(e, edges))
            doubts = [doubt for doubt in doubts if doubt[1] != "at a bound"]
        for date, kind, reason in doubts:
            said.setdefault((date, kind, reason), []).append(e.estimator)
    open_runs: dict[tuple[str, str, tuple[str, ...]], int] = {}
    for (date, kind, reason), names in sorted(said.items()):
        same = (kind, reason, tuple(names))
        at = open_runs.get(same)
        if at is not None and (date - runs[at].last).days == 1:
            runs[at] = Attention(runs[at].first, date, runs[at].days + 1, kind, same[2], reason)
        else:
            open_runs[same] = len(runs)
            runs.append(Attention(date, date, 1, kind, same[2], reason))
    return sorted(piles + runs, key=lambda row: row.first)


def _pile(e: EstimatorResults, edges: list[dt.date]) -> Attention:
    """Many days at the bounds of one estimator as one row."""
    low, high = (number(float(candidates(e)[k])) for k in (0, -1))
    reason = (
        f"the delay is {low} or {high}, the edges of what was tried, on {share(len(edges), len(e.dates))}"
    )
    return Attention(
        edges[0],
        edges[-1],
        len(edges),
        "at a bound",
        (e.estimator,),
        f"{reason} of days: listed in delays.csv",
    )


def _doubts(e: EstimatorResults, sample_time: float) -> list[tuple[dt.date, str, str]]:
    by_making = ESTIMATORS[e.estimator].degenerates
    with_delay = found(e)
    doubts = []
    for i, (date, status, message) in enumerate(zip(e.dates, e.status, e.messages, strict=True)):
        if status in NO_ANSWER:
            doubts.append((date, status, message))
        elif status == "degenerate" and not by_making:
            doubts.append((date, status, message or "alpha ran away: the data do not hold the response"))
        elif with_delay[i] and e.at_bound[i] and not by_making:
            words = samples_first([float(e.delay[i])], sample_time)
            doubts.append((date, "at a bound", f"the delay is {words}, the edge of what was tried"))
    return doubts


def missing(dates: Sequence[dt.date]) -> list[dt.date]:
    """Days between the first and the last that have no row: there is no log of them.

    Examples
    --------
    >>> missing([dt.date(2024, 6, 10), dt.date(2024, 6, 11), dt.date(2024, 6, 13)])
    [datetime.date(2024, 6, 12)]
    """
    if not dates or (dates[-1] - dates[0]).days + 1 == len(dates):
        return []
    there = set(dates)
    every = (dates[0] + dt.timedelta(days=k) for k in range((dates[-1] - dates[0]).days))
    return [day for day in every if day not in there]


def spans(days: Sequence[dt.date]) -> list[str]:
    """Days in order, with neighbours joined.

    Examples
    --------
    >>> spans([dt.date(2024, 6, 12), dt.date(2024, 6, 14), dt.date(2024, 6, 15)])
    ['2024-06-12', '2024-06-14 to 2024-06-15']
    """
    runs: list[list[dt.date]] = []
    for day in days:
        if runs and (day - runs[-1][1]).days == 1:
            runs[-1][1] = day
        else:
            runs.append([day, day])
    return [day_range(first, last) for first, last in runs]
