"""What is wrong with a directory of logs, in words, without estimating anything."""

import datetime as dt
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rivid.config import Config
from rivid.errors import DataError, PendingError
from rivid.logs.find import find_days
from rivid.logs.read import DataSet, read_window

Status = Literal["ok", "pending", "failed"]

UNIT_FACTORS = {35.3147: "cfs", 1000.0: "L/s", 3600.0: "m3/h"}
"""How many times too large a discharge in m3/s looks when the log holds another unit."""
FACTOR_MARGIN = 0.15
RANGE_MARGIN = 10.0
LEVEL_RANGE = 20.0
"""No forebay moves by more in the record of one reach [m]."""


@dataclass(frozen=True)
class DayReport:
    """One day.

    Attributes
    ----------
    date : date
    status : {"ok", "pending", "failed"}
    reason : str
        Why it cannot be used; empty where it can.
    notes : list of str
        What was filled, dropped or masked, and what looks odd.
    n_samples, n_filled : int
    """

    date: dt.date
    status: Status
    reason: str = ""
    notes: list[str] = field(default_factory=list)
    n_samples: int = 0
    n_filled: int = 0


@dataclass(frozen=True)
class Report:
    """All days, the files that speak of none, the days without a log, and what looks wrong as a whole."""

    days: list[DayReport]
    bad_files: list[tuple[str, str]]
    absent: list[dt.date]
    warnings: list[str]

    @property
    def failed(self) -> int:
        """Days that cannot be used."""
        return sum(day.status == "failed" for day in self.days)

    @property
    def exit_code(self) -> int:
        """0 where all is fine, 3 where a day failed or a file cannot be used."""
        return 3 if self.failed or self.bad_files else 0

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it, dates as text."""
        return {
            "days": [asdict(day) | {"date": str(day.date)} for day in self.days],
            "bad_files": [list(bad) for bad in self.bad_files],
            "absent": [str(day) for day in self.absent],
            "warnings": self.warnings,
            "failed": self.failed,
        }


@dataclass
class _Record:
    """What is kept of each good day, for a look at the whole."""

    inflow: list[float] = field(default_factory=list)
    outflow: list[float] = field(default_factory=list)
    output: list[float] = field(default_factory=list)
    lowest: float = np.inf
    highest: float = -np.inf


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
    """
    catalog = find_days(root, config)
    days, record = [], _Record()
    for source in catalog.days:
        try:
            data = read_window(root, [source], config, today=today)
        except PendingError as error:
            days.append(DayReport(source.date, "pending", str(error)))
        except DataError as error:
            days.append(DayReport(source.date, "failed", str(error)))
        except (OSError, ValueError, MemoryError) as error:
            days.append(DayReport(source.date, "failed", f"cannot be read: {type(error).__name__}: {error}"))
        else:
            days.append(_good_day(data, config))
            _remember(data, record)
    present = {day.date for day in days}
    span = (max(present) - min(present)).days if len(present) > 1 else 0
    absent = [
        day for k in range(min(span, 100_000)) if (day := min(present) + dt.timedelta(days=k)) not in present
    ]
    return Report(days, catalog.bad_files, absent, _warnings(record, config))


def _good_day(data: DataSet, config: Config) -> DayReport:
    notes = [data.notes] if data.notes else []
    if data.n_filled:
        notes.insert(0, f"{data.n_filled} of {len(data.inflow)} samples filled")
    if np.ptp(data.inflow) <= config.run.min_motion * np.abs(data.inflow).max():
        notes.append("the inflow is constant: no delay can be told")
    if np.ptp(data.output) == 0:
        notes.append(f"{config.reach.output} is constant: is the gauge stuck?")
    if (data.inflow < 0).any() or (data.outflow is not None and (data.outflow < 0).any()):
        notes.append("negative discharge")
    return DayReport(data.date, "ok", "", notes, len(data.inflow), data.n_filled)


def _remember(data: DataSet, record: _Record) -> None:
    record.inflow.append(float(data.inflow.mean()))
    record.output.append(float(data.output.mean()))
    if data.outflow is not None:
        record.outflow.append(float(data.outflow.mean()))
    record.lowest = min(record.lowest, float(data.output.min()))
    record.highest = max(record.highest, float(data.output.max()))


def _warnings(record: _Record, config: Config) -> list[str]:
    """Units and water balance: what no single day can tell."""
    if not record.inflow:
        return []
    found = []
    means = {"u_Qi": float(np.median(record.inflow))}
    if record.outflow:
        means["u_Qo"] = float(np.median(record.outflow))
    if config.reach.kind == "river":
        means["Q_L"] = float(np.median(record.output))
    (_, inflow), *others = means.items()
    for name, flow in others:
        found += _balance(inflow, name, flow)
    low, high = config.reach.discharge_range
    for name, flow in means.items():
        if flow > high * RANGE_MARGIN or abs(flow) < low / RANGE_MARGIN:
            said = (
                f"median {name} is {flow:.4g} m3/s, far outside [reach] discharge_range {low:g} to {high:g}"
            )
            found.append(f"{said}: check [input.units]" + _unit_that_fits(flow, low, high))
    if config.reach.kind == "pool" and record.highest - record.lowest > LEVEL_RANGE:
        said = f"h_L moves by {record.highest - record.lowest:.4g} m over the record"
        found.append(f"{said}: more than {LEVEL_RANGE:g} m; check [input.units] h_L and [input] sentinels")
    return found


def _balance(inflow: float, name: str, flow: float) -> list[str]:
    if inflow <= 0 or flow <= 0:
        return []
    ratio = max(inflow / flow, flow / inflow)
    large, small = (name, "u_Qi") if flow > inflow else ("u_Qi", name)
    for factor, unit in UNIT_FACTORS.items():
        if abs(np.log(ratio / factor)) < FACTOR_MARGIN:
            said = f"{large} is {ratio:.3g} times {small}: is {large} in {unit}, or {small} converted twice?"
            return [f"{said} Set [input.units]"]
    if ratio > 1.5:
        return [f"the water balance does not close: {large} is {ratio:.3g} times {small} over the record"]
    return []


def _unit_that_fits(flow: float, low: float, high: float) -> str:
    """The unit, if any, that brings a discharge into the usual range."""
    for factor, unit in UNIT_FACTORS.items():
        if low <= flow / factor <= high:
            return f' ("{unit}" would give {flow / factor:.4g} m3/s)'
    return ""
