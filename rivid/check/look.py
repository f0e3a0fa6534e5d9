"""Read every day of a directory of logs, and look at each and at the whole."""

import datetime as dt
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from rivid.check.clocks import clocks
from rivid.check.findings import DayReport, Finding, Report
from rivid.check.gauge import gauge, same
from rivid.check.record import Fits, Record
from rivid.check.spacing import Spacing
from rivid.check.units import units
from rivid.config import Config
from rivid.errors import DataError, PendingError
from rivid.logs.catalog import find_days
from rivid.logs.read import DataSet, read_window, refuse_columns
from rivid.types import ONE_DAY

LONGEST = 100_000
"""Days between the first and the last among which missing ones are looked for."""


def check(root: Path, config: Config, today: dt.date | dt.datetime | None = None) -> Report:
    """Read every day of a directory of logs and say what is wrong.

    Parameters
    ----------
    root : Path
        DATA_DIR, or one file.
    config : Config
    today : date or aware datetime, optional
        A log of this day may be unfinished; see :func:`rivid.logs.read.read_window`.

    Returns
    -------
    Report

    Raises
    ------
    NoDataError
        Where there is no log.
    ConfigError
        Where the configuration names columns that no log has.
    """
    catalog = find_days(root, config)
    refuse_columns(root, catalog.days, config)
    days, record, spacing = [], Record(config.reach), Spacing(root, config)
    for source in catalog.days:
        try:
            data = read_window(root, [source], config, today=today)
        except PendingError as error:
            days.append(DayReport(source.date, "pending", str(error)))
            continue
        except DataError as error:
            days.append(DayReport(source.date, "failed", str(error)))
        except (OSError, ValueError, MemoryError) as error:
            days.append(DayReport(source.date, "failed", f"cannot be read: {type(error).__name__}: {error}"))
        else:
            days.append(_good_day(data))
            record.add(data)
        spacing.add(source, days[-1].reason)
    findings = [*_future(days, today), *spacing.findings(), *_look(record, config)]
    days = [_noted(day, findings) for day in days]
    present = {day.date for day in days}
    span = min((max(present) - min(present)).days, LONGEST)
    absent = [day for k in range(span) if (day := min(present) + k * ONE_DAY) not in present]
    return Report(days, catalog.bad_files, absent, findings)


def look(days: list[DataSet], config: Config) -> list[Finding]:
    """What looks wrong with good days, in date order, as they were read."""
    record = Record(config.reach)
    for day in days:
        record.add(day)
    return _look(record, config)


def _look(record: Record, config: Config) -> list[Finding]:
    if not record.days:
        return []
    with threadpool_limits(1):  # the matrices are small
        fits = Fits(record)
    times = clocks(record, fits)
    doubtful = {date for finding in times for date in finding.days or record.days}
    flows = units(record, fits, config, doubtful)
    others = [*flows, *times, *same(record, config.run.min_motion)]
    return [*others, *gauge(record, fits, others)]


def _future(days: list[DayReport], today: dt.date | dt.datetime | None) -> list[Finding]:
    """Days that are not yet: it may be tomorrow already where the log is written, not later."""
    if today is None:
        return []
    last = (today.date() if isinstance(today, dt.datetime) else today) + ONE_DAY
    ahead = [day.date for day in days if day.date > last]
    text = "the logs are of days to come: is the date of the logger right, or the name of the file?"
    return [Finding("future", text, dict.fromkeys(ahead, "a day to come"))] if ahead else []


def _good_day(data: DataSet) -> DayReport:
    notes = [data.notes] if data.notes else []
    if data.n_filled:
        notes.insert(0, f"{data.n_filled} of {len(data.inflow)} samples filled")
    return DayReport(data.date, "ok", "", notes, len(data.inflow), data.n_filled)


def _noted(day: DayReport, findings: list[Finding]) -> DayReport:
    """A day with what the findings say of it."""
    said = [finding.days[day.date] for finding in findings if day.date in finding.days]
    return replace(day, notes=[*day.notes, *said]) if said else day
