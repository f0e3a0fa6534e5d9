"""The outcome of one reach, stored in OUT/.rivid/outcomes: shards of a fleet run in other processes."""

import datetime as dt
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rivid.atomic import write_text
from rivid.results.read import read_json
from rivid.types import Floats, Ints

if TYPE_CHECKING:
    from rivid.config import Config
    from rivid.run.run import Summary

WEEK = 7
"""Days of the last week of a record."""

YEAR = 365
"""Days before the last week that make the band: all seasons."""

FOLDER = Path(".rivid", "outcomes")
WORST_FIRST = (1, 2, 11, 10, 3, 0)
"""Exit codes, the worst first: failure, wrong configuration, held by another run, no data, days
failed in this run, all well."""


def band(days: Ints, values: Floats) -> dict[str, Any] | None:
    """Return the band of the year before the last week, and where the week lies.

    `days` are day numbers, ascending, of all days with a row; `values` are delays or t50 [samples], NaN
    where the data give none. 90 % of the year's values lie between `low` and `high`; these and `median` are
    in samples. Of the answered `days` of the week, `above` and `below` lie outside. None where the year has
    too few answered days for a band.
    """
    from rivid.report.attention import band as limits

    ago = days[-1:] - days
    given = np.isfinite(values)
    year = values[given & (ago >= WEEK) & (ago < WEEK + YEAR)]
    week = values[given & (ago < WEEK)]
    if (ends := limits(year)) is None:
        return None
    low, high = ends
    return {
        "low": low, "high": high, "median": float(np.median(year)), "days": len(week),
        "above": int(np.count_nonzero(week > high)), "below": int(np.count_nonzero(week < low)),
    }  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """The outcome of the run of one reach."""

    reach: str
    code: int  # exit code of `rivid run` of this reach alone
    error: str = ""  # why it could not be run
    data_sets: int = 0
    computed: int = 0  # data sets that were estimated in its last run
    dropped: int = 0  # data sets of earlier runs that have no logs any more
    failures: int = 0
    new_failures: int = 0  # of the failures, those reported for the first time
    bad_files: int = 0  # files that are no logs
    content: str = ""  # digest of the results
    first: str = ""  # first and last day of the record, ISO dates
    last: str = ""
    estimator: str = ""  # estimator and quantity (delay or t50) of the band
    quantity: str = ""
    sample_time: float = 0.0  # T_s [s]
    answered_week: int = 0  # of the days with a row, those with an answer
    days_week: int = 0  # days of its last week with a row
    week_median: float | None = None  # of the answers of its last week [samples]
    band: dict[str, Any] | None = None  # see :func:`band`
    # whether the delay has moved in the last week (:func:`rivid.report.summary.trend`); None without a test
    moved: bool | None = None
    # median of the last week less that of the weeks before [samples], 0 without a test; or that of the step
    change: float = 0.0
    since: str = ""  # ISO date of a step in the last nine weeks (:func:`rivid.report.summary.stepped`)
    doubt: str = ""  # "fast" or "slow" (:func:`rivid.report.summary.doubted`)
    # the last five failed days of its last week, and their messages
    recent: list[tuple[str, str]] = field(default_factory=list)


def worst(codes: Iterable[int]) -> int:
    """The exit code of a fleet: the worst of its reaches, in the order of :data:`WORST_FIRST`."""
    return min(codes, key=lambda code: WORST_FIRST.index(code) if code in WORST_FIRST else -1, default=0)


def outcome_of(reach: str, config: "Config", summary: "Summary", content: str) -> Outcome:
    """Summarise the run of a reach."""
    from rivid.report.summary import doubted, last_week, leading, stepped
    from rivid.results.read import day_numbers
    from rivid.results.store import brief_results

    results = brief_results(summary.rows, config)
    recent, lead = last_week(results), leading(results)
    e = recent.estimator if recent else lead
    dates = e.dates if e else []
    days = day_numbers(dates).astype(np.int64)
    t50 = recent is not None and recent.quantity == "t50"
    values = np.full(len(dates), np.nan)
    if recent:
        values = np.where(recent.decided, recent.values if t50 else recent.estimator.delay, np.nan)
    week = days > days[-1:] - WEEK
    answers = values[week & np.isfinite(values)]
    failed: dict[str, str] = {}
    for one in results.estimators:
        for date, status, message in zip(one.dates, one.status, one.messages, strict=True):
            if status == "failed" and date > dates[-1] - dt.timedelta(days=WEEK):
                failed.setdefault(str(date), message)
    trend = recent.trend if recent else None
    change = trend["now"] - trend["before"] if trend else 0.0
    found = stepped(recent) if recent and not (trend and trend["moved"]) else None
    return Outcome(
        reach=reach, code=summary.exit_code, data_sets=summary.windows, computed=summary.computed,
        dropped=summary.dropped, failures=summary.failures, new_failures=summary.new_failures,
        bad_files=len(summary.bad_files), content=content, first=str(dates[0]) if dates else "",
        last=str(dates[-1]) if dates else "", estimator=e.estimator if e else "",
        quantity="t50" if t50 else "delay" if e else "",
        sample_time=config.reach.sample_time, answered_week=len(answers), days_week=int(week.sum()),
        week_median=float(np.median(answers)) if len(answers) else None, band=band(days, values),
        moved=trend["moved"] if trend else None,
        change=found[2] - found[1] if found else change, since=str(found[0]) if found else "",
        doubt=doubted(results, recent) if recent else "", recent=sorted(failed.items())[-5:],
    )  # fmt: skip


def keep(out: Path, outcome: Outcome) -> None:
    """Store an outcome under OUT of the fleet."""
    write_text(out / FOLDER / f"{outcome.reach}.json", json.dumps(asdict(outcome), sort_keys=True) + "\n")


def kept(out: Path) -> list[Outcome]:
    """All stored outcomes, by reach; those that cannot be read are left out."""
    found = []
    for path in sorted((out / FOLDER).glob("*.json")):
        try:
            value = read_json(path)
            found.append(Outcome(**value | {"recent": [tuple(day) for day in value.get("recent", [])]}))
        except TypeError:
            continue  # of another version, or damaged: the next run writes it again
    return found
