"""The report of a fleet: fleet.html, fleet.csv, fleet.parquet and fleet.json in OUT."""

import datetime as dt
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from rivid.atomic import write_text
from rivid.fleet.outcome import Outcome, worst
from rivid.report.attention import BAND_DAYS
from rivid.report.page import write_page
from rivid.report.summary import LEVEL
from rivid.results.read import read_json
from rivid.results.store import described, safe_for_spreadsheets, write_csv, write_parquet

SCHEMA_VERSION = 1

SILENT_AFTER = 2
"""A reach is silent where its last log is so many days older than the fleet's latest, or more."""

FLEET, MEANINGS = described("""
reach | text | | its name: that of its directory of logs
code | whole | | exit code that its run alone would have
error | text | | why it could not be run; empty otherwise
data_sets | whole | | data sets of its logs
failures | whole | | of these, that failed
bad_files | whole | | files that are no logs
first | text | | first day of its record
last | text | | last day of its record
estimator | text | | estimator of the band
quantity | text | | `delay`, or `t50` of a river
sample_time_s | number | s | T_s
answered_last_week | whole | days | of the last seven, with an answer
days_last_week | whole | days | of the last seven, with a row
median | number | samples | of the 365 days before the last week
band_low | number | samples | below it lies a twentieth of that year's days
band_high | number | samples | above it lies a twentieth
median_last_week | number | samples | of the last seven days
above_last_week | whole | days | of the last seven above the band
below_last_week | whole | days | of the last seven below the band
left_band | flag | | the delay has moved, in the last week or by a step before; empty without a test or a step
since | text | | date of a step in the last nine weeks; empty otherwise
doubt | text | | `fast`: the delay is faster than any wave of `[reach]`; `slow`: much slower; empty otherwise
""")
"""A row per reach: fleet.csv and fleet.parquet; the delay, or t50, in samples."""


def write_fleet(out: Path, outcomes: Sequence[Outcome], name: str | None = None) -> dict[str, Any]:
    """Write the files of the fleet of that name and return the content of fleet.json.

    Without a name, the last report keeps its name and, if no reach has changed since, the report that it is
    compared with. RividError where a file cannot be written.
    """
    outcomes = sorted(outcomes, key=lambda outcome: outcome.reach)
    before = read_json(out / "fleet.json")
    if name is None:
        name = str(before.get("name") or out.resolve().name)
        if not summary(outcomes, before)["changed"]:
            before = before.get("before", before)
    table = pa.Table.from_pylist([_row(outcome) for outcome in outcomes], FLEET)
    write_parquet(table, out / "fleet.parquet")
    texts = [field.name for field in FLEET if pa.types.is_string(field.type)]
    write_csv(safe_for_spreadsheets(table, texts), out / "fleet.csv")
    found = {"name": name} | summary(outcomes, before)
    write_page(out / "fleet.html", "fleet", _context(outcomes, found, before))
    write_text(out / "fleet.json", json.dumps(found, indent=1, sort_keys=True) + "\n")
    return found


def summary(outcomes: Sequence[Outcome], before: dict[str, Any]) -> dict[str, Any]:
    """Return the content of fleet.json but its name, compared with that of the report `before`."""
    contents = before.get("contents") or {}
    latest = max((o.last for o in outcomes if o.last), default="")

    def behind(o: Outcome) -> int:
        return (dt.date.fromisoformat(latest) - dt.date.fromisoformat(o.last)).days

    return {
        "schema_version": SCHEMA_VERSION,
        "made": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        "code": worst(o.code for o in outcomes),
        "reaches": len(outcomes),
        "data_sets": sum(o.data_sets for o in outcomes),
        "latest": latest,
        "failing": [o.reach for o in outcomes if o.error or o.recent or o.code],
        "left_band": [o.reach for o in outcomes if o.moved or o.since],
        "untested": [o.reach for o in outcomes if o.last and o.moved is None],
        "doubtful": [o.reach for o in outcomes if o.doubt],
        "unanswered": [o.reach for o in outcomes if o.days_week and not o.answered_week],
        "silent": [o.reach for o in outcomes if o.last and behind(o) >= SILENT_AFTER],
        "changed": [
            o.reach for o in outcomes if contents and o.content and contents.get(o.reach) != o.content
        ],
        "contents": {o.reach: o.content or contents.get(o.reach, "") for o in outcomes},
        "data_sets_of": {o.reach: o.data_sets for o in outcomes},
        "before": {key: before[key] for key in ("made", "contents", "data_sets_of") if key in before},
    }


def _row(o: Outcome) -> dict[str, Any]:
    b = o.band or {}
    return {
        **{name: value for name, value in vars(o).items() if name in FLEET.names},
        "sample_time_s": o.sample_time or None,
        "answered_last_week": o.answered_week, "days_last_week": o.days_week,
        "median": b.get("median"), "band_low": b.get("low"), "band_high": b.get("high"),
        "median_last_week": o.week_median, "above_last_week": b.get("above"),
        "below_last_week": b.get("below"),
        "left_band": True if o.since else o.moved,
    }  # fmt: skip


def _context(outcomes: Sequence[Outcome], found: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    had = before.get("data_sets_of") or {}

    def widths(o: Outcome) -> float:  # the change of the last week, in widths of the band
        return abs(o.change) / (1.0 if o.band is None else max(o.band["high"] - o.band["low"], 1.0))

    of = {o.reach: o for o in outcomes}
    lists = ("failing", "left_band", "doubtful", "unanswered", "silent", "changed")
    chosen = {name: [of[reach] for reach in found[name]] for name in lists}
    return {
        "name": found["name"],
        "found": found,
        "made": minute(found["made"]),
        "since": minute(before.get("made", "")),
        "failing": sorted(chosen["failing"], key=lambda o: (not o.error, o.reach)),
        "moved": sorted(chosen["left_band"], key=widths, reverse=True),
        "doubtful": chosen["doubtful"],
        "tested": sum(o.moved is not None for o in outcomes),
        "level": LEVEL,
        "unanswered": chosen["unanswered"],
        "silent": chosen["silent"],
        "changed": [(o, o.data_sets - had.get(o.reach, 0)) for o in chosen["changed"]],
        "all": outcomes,
        "fewest": BAND_DAYS,
    }


def minute(made: str) -> str:
    """A time of fleet.json, to the minute; empty where there is none."""
    return f"{dt.datetime.fromisoformat(made):%Y-%m-%d %H:%M} UTC" if made else ""
