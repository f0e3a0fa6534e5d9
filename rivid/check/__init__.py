"""Check a directory of logs for faults without estimating anything."""

import datetime as dt
from collections.abc import Iterable
from pathlib import Path

from threadpoolctl import threadpool_limits

from rivid.check.clocks import clocks
from rivid.check.findings import DayReport, Finding, Report
from rivid.check.gauge import gauge, implausible
from rivid.check.record import Fits, Record
from rivid.check.spacing import Spacing
from rivid.check.units import units
from rivid.config import Config
from rivid.errors import DataError, PendingError
from rivid.logs.days import DataSet, DaySource, find_days, read_window, refuse_columns, spans_of
from rivid.types import ONE_DAY

LONGEST = 100_000  # longest span in which days without a log are listed [days]


def check(root: Path, config: Config, today: dt.date | dt.datetime | None = None) -> Report:
    """Read every day of a directory of logs, or of one file, and report its faults.

    A log of `today` or later may be unfinished; see :func:`rivid.logs.days.read_window`. NoDataError if there
    is no log; ConfigError if the configuration names columns that no log has.
    """
    catalog = find_days(root, config)
    refuse_columns(root, catalog.days, config)
    days, record, spacing = [], Record(config.reach), Spacing(root, config)
    for source in catalog.days:
        try:
            if config.run.window:  # units, clocks and gauge are judged by whole days
                days.append(_parts(root, source, config))
                continue
            data = read_window(root, [source], config, today=today)
        except PendingError as error:
            days.append(DayReport(source.date, "pending", str(error)))
            continue
        except DataError as error:
            days.append(DayReport(source.date, "failed", str(error)))
        except (OSError, ValueError, MemoryError) as error:
            days.append(DayReport(source.date, "failed", f"cannot be read: {type(error).__name__}: {error}"))
        else:
            filled = f"{data.n_filled} of {len(data.inflow)} samples filled" if data.n_filled else ""
            notes = [*filter(None, (filled, data.notes))]
            days.append(DayReport(data.date, "ok", "", notes, len(data.inflow), data.n_filled))
            record.add(data)
        spacing.add(source)
    findings = [*spacing.findings(), *_check_record(record, config)]
    if today is not None:  # in the zone of the log it may be tomorrow already
        tomorrow = (today.date() if isinstance(today, dt.datetime) else today) + ONE_DAY
        if ahead := [day.date for day in days if day.date > tomorrow]:
            findings.insert(0, Finding("future", days={date: {} for date in ahead}))
    for day in days:
        day.notes.extend(finding.day_text(day.date) for finding in findings if day.date in finding.days)
    present = {day.date for day in days}
    first, last = min(present), max(present)
    every = (first + k * ONE_DAY for k in range(min((last - first).days, LONGEST)))
    absent = [date for date in every if date not in present]
    return Report(days, catalog.bad_files, absent, findings)


def _parts(root: Path, source: DaySource, config: Config) -> DayReport:
    """Read the data sets of a day that are shorter than it."""
    spans, _ = spans_of(root, source, config)
    sets = [read_window(root, [source], config, span=span) for span in spans]
    note = f"{len(sets)} data sets of {config.run.window}; units, clocks and gauge are not judged"
    samples, filled = sum(len(data.inflow) for data in sets), sum(data.n_filled for data in sets)
    return DayReport(source.date, "ok", "", [note], samples, filled)


def check_days(days: Iterable[DataSet], config: Config) -> list[Finding]:
    """Return the findings on good days, given in order of dates."""
    record = Record(config.reach)
    for day in days:
        record.add(day)
    return _check_record(record, config)


def _check_record(record: Record, config: Config) -> list[Finding]:
    if not record.days:
        return []
    with threadpool_limits(1):  # the matrices are small
        fits = Fits(record)
    shifted = clocks(record, fits)
    doubtful = {date for finding in shifted for date in finding.days or record.days}
    flows = units(record, fits, config, doubtful)
    others = [*flows, *shifted, *implausible(record, config.run.min_motion)]
    return [*others, *gauge(record, fits, others)]
