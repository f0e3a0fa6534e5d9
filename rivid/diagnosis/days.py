"""From a directory of logs to a record: the days that can be read, and why the others cannot."""

import datetime as dt
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rivid.config import Config
from rivid.core.hydraulics import propose_delays
from rivid.diagnosis.data import Record, as_record
from rivid.errors import DataError, NoDataError
from rivid.logs.find import find_days
from rivid.logs.read import read_window
from rivid.types import DAY


@dataclass(frozen=True)
class Logs:
    """What a directory gave.

    Attributes
    ----------
    record : Record
        The days that can be used.
    failed : tuple of (datetime.date or None, str)
        What could not be used, and why; a file that speaks of no day has no date.
    """

    record: Record
    failed: tuple[tuple[dt.date | None, str], ...]


def read_record(
    root: Path,
    config: Config,
    *,
    first: dt.date | None = None,
    last: dt.date | None = None,
    today: dt.date | dt.datetime | None = None,
) -> Logs:
    """Read the days of DATA_DIR that a diagnosis can use.

    Parameters
    ----------
    root : Path
        DATA_DIR, or one file.
    config : Config
    first, last : datetime.date, optional
        Only days from and until these.
    today : datetime.date or datetime.datetime, optional
        A log of this day may be unfinished.

    Raises
    ------
    NoDataError
        Where no day can be used.
    """
    catalog = find_days(root, config)
    failed: list[tuple[dt.date | None, str]] = [(None, f"{name}: {why}") for name, why in catalog.bad_files]
    days = []
    for source in catalog.days:
        if (first and source.date < first) or (last and source.date > last):
            continue
        try:
            days.append(read_window(root, [source], config, today=today))
        except DataError as error:
            failed.append((source.date, str(error)))
        except (OSError, ValueError, MemoryError) as error:
            failed.append((source.date, f"cannot be read: {type(error).__name__}: {error}"))
    if not days:
        raise NoDataError(_no_day(root, failed, [source.date for source in catalog.days], first, last))
    reach = config.reach
    proposal = propose_delays(
        reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth,
        sample_time=reach.sample_time, kind=reach.kind,
    )  # fmt: skip
    seconds = np.arange(0.0, DAY, reach.sample_time)
    whole = [day for day in days if len(day.inflow) == len(seconds)]
    failed += [
        (day.date, f"has {len(day.inflow)} samples: expected {len(seconds)}; a clock change")
        for day in days
        if len(day.inflow) != len(seconds)
    ]
    if not whole:
        raise NoDataError(
            f"{root}: no day has its {len(seconds)} samples of {reach.sample_time:g} s; the first reason: "
            f"{failed[0][1]}: look at `rivid check`"
        )
    outflow = None
    if reach.kind == "pool":
        missing = [day.date for day in whole if day.outflow is None]
        if missing:
            raise DataError(
                f"{root}: the outflow is not logged on {missing[0]}: a diagnosis of a pool needs u_Qo"
            )
        outflow = np.array([day.outflow for day in whole])
    record = as_record(
        [day.date for day in whole], seconds, np.array([day.inflow for day in whole]), outflow,
        np.array([day.output for day in whole]), sample_time=reach.sample_time, delay=proposal.d_max // 2,
        kind=reach.kind,
    )  # fmt: skip
    return Logs(record, tuple(failed))


def _no_day(
    root: Path,
    failed: list[tuple[dt.date | None, str]],
    dates: list[dt.date],
    first: dt.date | None,
    last: dt.date | None,
) -> str:
    """Why no day can be used: none is asked for, or each failed."""
    if not any(date for date, _ in failed) and dates:
        return (
            f"no day from {first or 'the first'} to {last or 'the last'}: "
            f"{root} has them from {min(dates)} to {max(dates)}"
        )
    return (
        f"{root}: none of {len(failed)} days or files can be used; the first, {failed[0][0] or 'a file'}: "
        f"{failed[0][1]}: `rivid check` says more"
    )
