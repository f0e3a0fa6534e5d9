"""Flags of logged values, by the findings of a check, for a historian or another quality control."""

import datetime as dt
from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from rivid.check.findings import Finding, Report
from rivid.config import Config
from rivid.errors import ConfigError
from rivid.logs.days import find_days, read_series
from rivid.logs.spec import MICRO, day_bounds
from rivid.results.store import described, safe_for_spreadsheets, to_table
from rivid.types import Bools, Ints

SCHEMA, MEANINGS = described("""
time | moment | | of the value; of a day that cannot be read, its midnight
column | text | | u_Qi, u_Qo, h_L or Q_L; empty for a whole day that cannot be read
flag | text | | `fault`: needs action; `remark`; `failed`: the day cannot be used
rule | text | | code of the finding, such as `jump` or `unit.factor`
reason | text | | the finding for this day, in words
""")
"""flags.csv and flags.parquet: a row for each flagged value and rule."""
NAMED = {"constant.inflow": ("u_Qi",), "constant.outflow": ("u_Qo",), "swapped": ("u_Qi", "u_Qo")}
"""Columns of findings that do not name theirs, by code or kind."""


def columns_of(finding: Finding, date: dt.date, every: Collection[str]) -> tuple[str, ...]:
    """Columns that a finding is about on a day."""
    values = {**finding.values, **finding.days.get(date, {})}
    for key in ("column", "output", "small"):
        if values.get(key) in every:
            return (str(values[key]),)
    named = NAMED.get(finding.code.removesuffix("_always")) or NAMED.get(finding.kind)
    return tuple(name for name in named or every if name in every)


def flags(report: Report, root: Path, config: Config) -> pa.Table:
    """Return the table of flags, of :data:`SCHEMA`, in order of days; `root` is DATA_DIR, or one file."""
    rows: list[tuple[dt.datetime, str, str, str, str]] = []
    failed = {day.date: day.reason for day in report.days if day.status == "failed"}
    for source in find_days(root, config).days:
        date = source.date
        if date in failed:
            midnight = dt.datetime.combine(date, dt.time(), dt.UTC)
            rows.append((midnight, "", "failed", "failed", failed[date]))
        found = [finding for finding in report.findings if date in finding.days or not finding.days]
        if not found:
            continue
        series, zone, _ = read_series(root, [source], config)
        if zone is None:
            continue
        for finding in found:
            level = "fault" if finding.wrong else "remark"
            reason = finding.day_text(date) if finding.days else finding.text
            for name in columns_of(finding, date, series):
                times = series[name][0]
                flagged = chosen(finding, date, times - day_bounds(date, zone)[0], config.reach.sample_time)
                rows += [
                    (dt.datetime.fromtimestamp(t / MICRO, dt.UTC), name, level, finding.code, reason)
                    for t in times[flagged].tolist()
                ]
    columns = {name: [row[i] for row in rows] for i, name in enumerate(SCHEMA.names)}
    return safe_for_spreadsheets(to_table(columns, SCHEMA), ("reason",))


def chosen(finding: Finding, date: dt.date, since: Ints, sample: float) -> Bools:
    """Values of a day (n,) that a finding flags: those of its events, or all; `since` midnight [us]."""
    items = finding.days.get(date, {}).get("items")
    if not items:
        return np.ones(len(since), bool)
    found = np.zeros(len(since), bool)
    for item in items:  # their times are HH:MM
        clocks = (item.get(key, item.get("time")).split(":") for key in ("first", "last"))
        first, last = (3600.0 * int(hours) + 60.0 * int(minutes) for hours, minutes in clocks)
        found |= (since >= (first - 30.0) * MICRO) & (since < (last + 30.0 + sample) * MICRO)
    return found


def read_maintenance(path: Path) -> list[dt.date]:
    """Dates of maintenance: lines of a file that begin with one, as 2008-03-14; other lines are comments.

    ConfigError where the file cannot be read, or holds no date.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({type(error).__name__}): expected a text file") from None
    found = []
    for line in lines:
        with suppress(ValueError):
            found.append(dt.date.fromisoformat(line.strip()[:10]))
    if not found:
        raise ConfigError(f"{path}: no line begins with a date: expected such as 2008-03-14 gauge moved")
    return found


def explained(report: Report, dates: Iterable[dt.date]) -> Report:
    """A report without the jumps of the gauge on days of its maintenance."""
    known, found = set(dates), []
    for finding in report.findings:
        if finding.kind in ("jump", "spike"):
            left = {date: values for date, values in finding.days.items() if date not in known}
            finding = replace(finding, days=left)
            if not left:
                continue
        found.append(finding)
    return replace(report, findings=found)
