"""Canonical columns of the sources, and their days: which could `rivid run` use, and why not the others."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rivid.errors import DataError
from rivid.logs.days import Grid, TrailingGap, make_grid, on_grid, refuse_filled, refuse_supposed
from rivid.logs.ingest.series import Gathered, Series, ValueStatus
from rivid.logs.log import days_of
from rivid.logs.spec import MICRO, Signal, Spec, day_bounds
from rivid.logs.text import Fault
from rivid.types import ONE_DAY, Floats, Ints

Origins = list[tuple[Series, Ints]]
"""Rows of sources from which values come."""


@dataclass(frozen=True, eq=False)
class Canonical:
    """A canonical column, logged regularly."""

    signal: Signal
    times: Ints  # (n,) from which the values count [us UTC]: the stamp's shift is subtracted
    values: Floats  # (n,) [m3/s] or [m]
    origins: Origins  # per source: the row of each value in it

    @property
    def judged(self) -> Signal:
        """The signal for the grid."""
        return self.signal

    @property
    def stamps(self) -> Ints:
        """Times as they are in the export, ascending [us UTC]."""
        return self.times + self.signal.shift

    def of_day(self, grid: Grid, early: int) -> tuple[Ints, Floats, Origins]:
        """Times and values of a local day, and their origins."""
        low, high = self.times.searchsorted((grid.start - early, grid.end - early)).tolist()
        origins = [(series, rows[low:high]) for series, rows in self.origins]
        return self.times[low:high], self.values[low:high], origins


@dataclass(frozen=True, eq=False)
class Held:
    """A canonical column whose sources are logged when they change: sampled on the grid, held till then."""

    signal: Signal
    sources: list[Series]
    period: int  # T_s [us]

    @property
    def judged(self) -> Signal:
        """The signal for the grid, on which it comes every T_s."""
        return replace(self.signal, spacing=self.period, shift=0)

    @property
    def stamps(self) -> Ints:
        """Times of the reports, ascending [us UTC]."""
        return np.unique(np.concatenate([_reports(series)[0] for series in self.sources]))

    def of_day(self, grid: Grid, early: int) -> tuple[Ints, Floats, Origins]:
        """The samples of a local day, and the reports that they come from."""
        total = np.zeros(len(grid.times))
        origins: Origins = []
        for series in self.sources:
            times, rows = _reports(series)
            if not len(rows):
                total[:] = np.nan
                continue
            at = times.searchsorted(grid.times + early, side="right") - 1
            last = rows[np.maximum(at, 0)]
            age = grid.times - series.times[last]
            held = (at >= 0) & (age <= self.signal.hold)
            total += np.where(held, series.values[last], np.nan)
            picked = np.unique(last[held])
            origins.append((series, picked[np.isfinite(series.values[picked])]))
        there = np.isfinite(total)
        return grid.times[there], total[there] * self.signal.factor, origins

    def reports_within(self, grid: Grid) -> Origins:
        """The reports of a local day, sampled or not."""
        found: Origins = []
        for series in self.sources:
            low, high = series.times.searchsorted((grid.start, grid.end)).tolist()
            found.append((series, low + np.flatnonzero(np.isfinite(series.values[low:high]))))
        return found


def _reports(series: Series) -> tuple[Ints, Ints]:
    """Reports in order of time: a flag, sentinel or status ends what was held before."""
    rows = np.flatnonzero((series.statuses != ValueStatus.DUPLICATE) & (series.statuses != ValueStatus.TIME))
    return series.times[rows], rows


def canonical(series: dict[str, Series], spec: Spec) -> list[Canonical | Held]:
    """The canonical columns; statuses of values that lack a partner in every sum are set."""
    matched = {name: np.zeros(len(s.times), bool) for name, s in series.items()}
    columns: list[Canonical | Held] = []
    for signal in spec.signals:
        parts = [series[name] for name in signal.sources]
        if signal.hold:
            columns.append(Held(signal, parts, round(spec.period * MICRO)))
            for part in parts:
                matched[part.name][:] = True
            continue
        rows = [np.flatnonzero(part.statuses == ValueStatus.USED) for part in parts]
        common = parts[0].times[rows[0]]
        for part, there in zip(parts[1:], rows[1:], strict=True):
            common = np.intersect1d(common, part.times[there], assume_unique=True)
        kept = [there[np.isin(part.times[there], common)] for part, there in zip(parts, rows, strict=True)]
        total = parts[0].values[kept[0]]
        for part, there in zip(parts[1:], kept[1:], strict=True):
            total = total + part.values[there]
        for part, there in zip(parts, kept, strict=True):
            matched[part.name][there] = True
        values = total * signal.factor if signal.factor != 1.0 else total
        origins = list(zip(parts, kept, strict=True))
        columns.append(Canonical(signal, common - signal.shift, values, origins))
    for name, found in matched.items():
        alone = ~found & (series[name].statuses == ValueStatus.USED)
        series[name].statuses[alone] = ValueStatus.UNMATCHED
    return columns


@dataclass(eq=False)
class DayLog:
    """A day, judged."""

    date: dt.date
    times: Ints  # (n,) of its rows, ascending [us UTC]
    columns: dict[str, Floats]  # (n,) canonical columns; NaN where a row has no value of one
    origins: Origins  # rows of the sources that the values come from
    unsampled: Origins  # reports of the day, between its samples or sampled
    status: str = "good"  # "good", "refused" or "pending"
    reason: str = ""  # why it is not good
    n_filled: int = 0  # samples of the grid that lie in gaps

    def settle(self, status: ValueStatus) -> None:
        """Set the status of the day's values."""
        for series, rows in self.unsampled:
            series.statuses[rows[series.statuses[rows] == ValueStatus.OUTSIDE]] = ValueStatus.BETWEEN
        for series, rows in self.origins:
            series.statuses[rows[series.statuses[rows] != ValueStatus.USED]] = (
                status  # one held into a second day stays used
            )


def dates_of(columns: Sequence[Canonical | Held], gathered: Gathered, spec: Spec) -> list[dt.date]:
    """Local days of which the export has rows, ascending; a row at midnight alone makes no day."""
    stamps = np.unique(np.concatenate([column.stamps for column in columns]))
    all_held = all(isinstance(column, Held) for column in columns)
    times = stamps
    if not all_held:
        times = np.concatenate([column.times for column in columns if isinstance(column, Canonical)])
    found = set(days_of(times, gathered.zone, spec.tolerance))
    if any(isinstance(column, Held) for column in columns):
        found |= set(days_of(stamps, gathered.zone, spec.tolerance))
        if all_held:  # nothing may change for a whole day
            found = {min(found) + k * ONE_DAY for k in range((max(found) - min(found)).days + 1)}
    longest = max(column.judged.spacing for column in columns)
    kept = []
    for date in sorted(found):
        start, end = (t - spec.tolerance for t in day_bounds(date, gathered.zone))
        first = start + max(2 * spec.tolerance + 1, spec.latest)
        low, high = stamps.searchsorted((first, end))
        faulty = any(start <= fault.at < end for fault in gathered.faults)
        held = all_held and stamps[0] <= start + 2 * spec.tolerance and end <= stamps[-1]
        if low < high or faulty or held or 2 * longest > end - start:
            kept.append(date)
    return kept


def judge(
    date: dt.date, columns: Sequence[Canonical | Held], gathered: Gathered, spec: Spec, today: dt.date
) -> DayLog:
    """The rows of a day and their status for `rivid run`; a log of `today` or later may be unfinished."""
    grid = make_grid(*day_bounds(date, gathered.zone), spec.period, gathered.zone)
    parts = [column.of_day(grid, spec.tolerance) for column in columns]
    times = np.unique(np.concatenate([times for times, _, _ in parts]))
    rows = {}
    for column, (at, values, _) in zip(columns, parts, strict=True):
        rows[column.signal.name] = np.full(len(times), np.nan)
        rows[column.signal.name][times.searchsorted(at)] = values
    origins = [origin for _, _, found in parts for origin in found]
    reports = [r for column in columns if isinstance(column, Held) for r in column.reports_within(grid)]
    day = DayLog(date, times, rows, origins, reports)
    faults = _faults_of(gathered.faults, grid, spec)
    if faults:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        day.status, day.reason = "refused", f"{faults[0].text}{more}"
        return day
    try:
        day.n_filled = _filled(columns, [(at, values) for at, values, _ in parts], grid, spec)
    except DataError as error:
        unfinished = isinstance(error, TrailingGap) and date >= today
        day.status = "pending" if unfinished else "refused"
        day.reason = str(error) + _advice(columns, parts, grid)
    return day


def _faults_of(faults: Sequence[Fault], grid: Grid, spec: Spec) -> list[Fault]:
    low, high = grid.start - spec.tolerance, grid.end - spec.tolerance + spec.latest
    return [fault for fault in dict.fromkeys(faults) if low <= fault.at < high]


def _filled(
    columns: Sequence[Canonical | Held], parts: list[tuple[Ints, Floats]], grid: Grid, spec: Spec
) -> int:
    """Number of samples that lie in gaps; raises as reading the day would."""
    filled = np.zeros(len(grid.times), bool)
    for column, (times, values) in zip(columns, parts, strict=True):
        if column.signal.supposed:
            refuse_supposed(times, column.signal, spec)
        bridged = on_grid(times, values, grid, column.judged, spec)[1]
        if bridged is not None:
            filled |= bridged
    if filled.any():
        series = {c.signal.name: part for c, part in zip(columns, parts, strict=True)}
        refuse_filled(filled, series, spec)
    return int(filled.sum())


def _advice(
    columns: Sequence[Canonical | Held], parts: list[tuple[Ints, Floats, Origins]], grid: Grid
) -> str:
    """Advice on irregular values, which may be logged when they change: only the user knows."""
    for column, (times, _, _) in zip(columns, parts, strict=True):
        if isinstance(column, Held) or len(times) < 3:
            continue
        steps = np.diff(times)
        usual = np.median(steps)
        if (np.abs(steps - usual) > 0.1 * usual).mean() > 0.5:
            longest = int(np.ceil(max(steps.max(), grid.end - times[-1]) / MICRO))
            return (
                f"; if {column.signal.name} is logged only when it changes, set [input.hold] "
                f"{column.signal.name} to the longest time that a value holds [s] (here at least {longest})"
            )
    return ""
