"""Days to look at, as codes and numbers: days without an answer, and doubtful answers."""

import datetime as dt
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.report.summary import LastWeek, leading
from rivid.results.read import EstimatorResults, Results, candidates, estimates_delay, found
from rivid.text import NO_ANSWER, spans
from rivid.types import Bools, Floats

SHOWN = 25  # rows that are open on the page; the others unfold. More fill more than one screen

CROWD = 0.25  # days at a bound have one row where they are a larger share of the days, and more than SHOWN

BAND_DAYS = 30  # fewest days of a band: with fewer, its ends are the two most extreme days
TAIL = 0.05  # share of the days beyond each end of the band


Row = dict[str, Any]  # consecutive days with the same reason to look at them


def _row(
    first: dt.date, last: dt.date, days: int, kind: str, estimators: tuple[str, ...], **more: Any
) -> Row:
    """A row: `kind` is failed, unidentifiable, pending, degenerate, at_bound or far.

    `value` is the delay, travel time or t50 [samples], NaN where days differ; `band` [samples] is that of the
    record for `far`, or the bounds for many days at them, `of` the days of the record, of which `days` are a
    share.
    """
    row = {"first": first, "last": last, "days": days, "kind": kind, "estimators": estimators}
    return row | {"message": "", "value": float("nan"), "band": None, "of": 0, "decided": True} | more


def attention(results: Results, recent: LastWeek | None) -> list[Row]:
    """Return the days to look at, the latest first.

    Estimators that degenerate by construction are not listed where they have an answer. An estimator with
    many days at its bounds has one row for all of them. Only the days of `recent` are compared with a band.
    """
    rows, alike = list[Row](), dict[tuple[dt.date, str, str, float], list[str]]()
    for e in results.estimators:
        doubts = _doubts(e)
        edges = [doubt[0] for doubt in doubts if doubt[1] == "at_bound"]
        if len(edges) > max(SHOWN, CROWD * len(e.dates)):
            more = {"band": (float(candidates(e)[0]), float(candidates(e)[-1])), "of": len(e.dates)}
            rows.append(_row(edges[0], edges[-1], len(edges), "at_bound", (e.estimator,), **more))
            doubts = [doubt for doubt in doubts if doubt[1] != "at_bound"]
        for doubt in doubts:
            alike.setdefault(doubt, []).append(e.estimator)
    days = defaultdict[tuple[str, str, float, tuple[str, ...]], list[dt.date]](list)
    for (date, kind, message, value), names in sorted(alike.items()):
        days[kind, message, value, tuple(names)].append(date)
    for (kind, message, value, reporting), dates in sorted(days.items()):
        more = {"message": message, "value": float("nan") if value < 0 else value}
        rows += [_row(a, b, (b - a).days + 1, kind, reporting, **more) for a, b in spans(dates)]
    rows += far(recent) if recent else []
    return sorted(rows, key=lambda row: (row["last"], row["first"]), reverse=True)


def _doubts(e: EstimatorResults) -> list[tuple[dt.date, str, str, float]]:
    """Date, kind, message and delay of each day of an estimator; a delay of -1 where it does not matter."""
    by_construction, with_delay = ESTIMATORS[e.estimator].degenerates, found(e)
    doubts = []
    for i, (date, status, message) in enumerate(zip(e.dates, e.status, e.messages, strict=True)):
        if status in NO_ANSWER or (status == "degenerate" and not by_construction):
            doubts.append((date, status, message, -1.0))
        elif with_delay[i] and e.at_bound[i] and not by_construction:
            doubts.append((date, "at_bound", "", float(e.delay[i])))
    return doubts


def band(values: Floats) -> tuple[float, float] | None:
    """Return the band that holds 90 % of the values, shape (n,) with NaN; None with fewer than thirty."""
    given = values[np.isfinite(values)]
    if given.size < BAND_DAYS:
        return None
    low = float(np.quantile(given, TAIL, method="lower"))
    return low, float(np.quantile(given, 1 - TAIL, method="higher"))


def outside(values: Floats, limits: tuple[float, float]) -> Bools:
    """Return the values further from a band than its width and one sample; False for NaN."""
    margin = max(limits[1] - limits[0], 1.0)
    return np.asarray((values < limits[0] - margin) | (values > limits[1] + margin))


def far(recent: LastWeek) -> list[Row]:
    """Return the days far outside the band of the record, a row each, except days that are listed anyway."""
    limits, e = band(recent.values), recent.estimator
    if limits is None:
        return []
    listed = e.degenerate if recent.quantity == "t50" else e.degenerate | e.at_bound
    return [
        _row(
            e.dates[i], e.dates[i], 1, "far", (e.estimator,), value=float(recent.values[i]), band=limits,
            decided=bool(recent.decided[i]),
        )
        for i in np.flatnonzero(outside(recent.values, limits) & ~listed)
    ]  # fmt: skip


def counted(results: Results, recent: LastWeek, rows: Sequence[Row]) -> dict[str, Any]:
    """Count the days of the rows for the estimators that represent the reach."""
    representing, lead = {recent.estimator.estimator}, leading(results)
    if lead and estimates_delay(lead):
        representing.add(lead.estimator)
    late, early, others = (set[dt.date]() for _ in range(3))
    links = []
    for k, row in enumerate(rows):
        days = dates_of(row, results)
        if not representing & set(row["estimators"]):
            others |= days
            continue
        inside = {day for day in days if day >= recent.first}
        late |= inside
        early |= days - inside
        if inside:
            links.append((min(inside), max(inside), row["kind"], k))
    begin = max(recent.first, recent.estimator.dates[0])
    return {
        "links": links,  # first and last day inside the last week, kind, index of the row
        "days": len(late),
        "earlier": len(early),
        "latest": max(early) if early else None,
        "others": len(others - late - early),  # that only other estimators report
        "no_log": int(recent.week.sum()) < (recent.last - begin).days + 1,  # on a day of the last week
    }


def dates_of(row: Row, results: Results) -> set[dt.date]:
    """Return the days of a row, also where they are not consecutive."""
    if (row["last"] - row["first"]).days + 1 == row["days"]:
        return {row["first"] + dt.timedelta(days=k) for k in range(row["days"])}
    e = results.of(row["estimators"][0])
    return {date for date, edge in zip(e.dates, e.at_bound, strict=True) if edge}
