"""One log file in memory: sorted columns in SI units, what was masked or dropped, and what is wrong where."""

import datetime as dt
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import NamedTuple

import numpy as np

from rivid.errors import DataError
from rivid.logs.columns import Columns, Micros
from rivid.logs.header import UndeclaredError
from rivid.logs.numbers import LARGEST
from rivid.logs.sentinels import undeclared
from rivid.logs.spec import Signal, Spec
from rivid.logs.times import clock, day_bounds, fixed_zone, local, to_utc, zone_named
from rivid.types import Floats


class Fault(NamedTuple):
    """What makes the day of `time` [us] unusable; `cut`: it is the torn end of a log being written."""

    time: int
    text: str
    cut: bool = False


@dataclass(frozen=True, eq=False)
class Log:
    """A log file, read.

    Attributes
    ----------
    name : str
        How messages call it.
    spec : Spec
    zone : tzinfo
        Of the local days.
    times : ndarray, (n,)
        Distinct times of its rows, ascending [us UTC].
    values : dict of ndarray, (n,)
        Per canonical column, m3/s or m; NaN where nothing is measured.
    faults : tuple of Fault
        In order of time.
    events : dict of ndarray
        Times [us], ascending, of what was masked, dropped or sorted, per kind.
    digest : str
        SHA-256 of the file.
    """

    name: str
    spec: Spec
    zone: dt.tzinfo
    times: Micros
    values: dict[str, Floats]
    faults: tuple[Fault, ...]
    events: dict[str, Micros]
    digest: str

    @cached_property
    def series(self) -> dict[str, tuple[Micros, Floats]]:
        """Per canonical column: times from which its values count [us], and the values that are there."""
        series = {}
        for signal in self.spec.signals:
            values = self.values[signal.name]
            there = np.isfinite(values)
            times = self.times - signal.shift if signal.shift else self.times
            series[signal.name] = (times, values) if there.all() else (times[there], values[there])
        return series

    def bounds(self, date: dt.date) -> tuple[int, int]:
        """A local day's rows are those from the first instant on, before the second [us]."""
        start, end = day_bounds(date, self.zone)
        early = self.spec.tolerance
        return start - early, end - early

    def of_day(self, date: dt.date) -> dict[str, tuple[Micros, Floats]]:
        """The part of each series that belongs to a local day."""
        start, end = self.bounds(date)
        part = {}
        for name, (times, values) in self.series.items():
            low, high = times.searchsorted((start, end)).tolist()
            part[name] = (times, values) if high - low == len(times) else (times[low:high], values[low:high])
        return part

    def closing(self, end: int) -> dict[str, tuple[Micros, Floats]]:
        """The part of each series that is stamped from `end` on, but belongs before it [us]."""
        part = {}
        for signal in self.spec.signals:
            times, values = self.series[signal.name]
            low, high = times.searchsorted((end - signal.shift, end)).tolist()
            part[signal.name] = times[low:high], values[low:high]
        return part

    def is_edge(self, date: dt.date) -> bool:
        """Whether a local day has no row but such as begin or end another day, at its midnights."""
        start, end = self.bounds(date)
        if 2 * max(signal.spacing for signal in self.spec.signals) > end - start:
            return False  # a row is much of a day
        if any(start <= fault.time < end for fault in self.faults):
            return False
        first = start + max(2 * self.spec.tolerance + 1, self.spec.latest)
        low, high = self.times.searchsorted((first, end))
        return bool(low == high)

    def faults_of(self, date: dt.date) -> list[Fault]:
        """What is wrong with a local day, the rows that close it included."""
        start, end = self.bounds(date)
        end += self.spec.latest
        return [fault for fault in self.faults if start <= fault.time < end]

    def events_of(self, date: dt.date) -> dict[str, int]:
        """How much was masked, dropped or sorted on a local day."""
        start, end = self.bounds(date)
        counts = {k: int(np.diff(t.searchsorted((start, end)))[0]) for k, t in self.events.items()}
        return {kind: count for kind, count in counts.items() if count}

    def digest_of(self, date: dt.date) -> str:
        """Digest of a local day: changes when, and only when, what is read of that day changes."""
        digest = sha256()
        for name, (times, values) in self.of_day(date).items():
            digest.update(f"{name} {len(times)};".encode())
            digest.update(times.tobytes())
            digest.update(values.tobytes())
        digest.update(repr((self.faults_of(date), sorted(self.events_of(date).items()))).encode())
        return digest.hexdigest()

    def dates(self) -> list[dt.date]:
        """Local days that the log says something about, ascending."""
        parts = [times for times, _ in self.series.values()]
        parts.append(np.array([fault.time for fault in self.faults], np.int64))
        times = np.unique(np.concatenate(parts)) + self.spec.tolerance
        found, at = [], 0
        while at < len(times):
            date = local(int(times[at]), self.zone).date()
            found.append(date)
            at = int(times.searchsorted(day_bounds(date, self.zone)[1]))
        return found


def make_log(columns: Columns, spec: Spec, name: str, digest: str) -> Log:
    """Bring the columns of a file to UTC, SI units and order.

    Raises
    ------
    DataError
        Where no row can be used at all, or local days cannot be told.
    """
    if not len(columns.times):
        if columns.bad:
            raise DataError(f"{name}, {columns.bad[0].text}")
        raise DataError(f"{name} has a header and no rows")
    zone = zone_of(columns, spec, name)
    events: dict[str, list[int]] = {}
    faults: list[tuple[int, str, bool]] = []  # (row, ...)
    times = columns.times
    if not columns.aware:
        times, refused = to_utc(times, zone, spec.ambiguous)
        faults += [(row, f"{columns.place(row)}: {reason}", False) for row, reason in refused]
    values = {signal.name: _signal(signal, columns, spec, events, faults) for signal in spec.signals}
    faults += undeclared(columns, times, spec, zone)
    last = len(times) - 1
    faults += [(min(max(row - 1, 0), last), text, cut) for row, text, cut in columns.bad]
    for kind, rows in columns.dropped.items():
        events.setdefault(f"{kind} dropped", []).extend(min(max(row - 1, 0), last) for row in rows)

    steps = np.diff(times)
    order = None
    if (steps < 0).any():
        late = np.flatnonzero(times < np.maximum.accumulate(times))
        events["rows out of order sorted"] = late.tolist()
        order = np.argsort(times, kind="stable")
    timed = {kind: np.sort(times[rows]) for kind, rows in events.items() if rows}
    dated = [Fault(int(times[row]), text, cut) for row, text, cut in faults]
    if order is not None:
        times, values = times[order], {k: v[order] for k, v in values.items()}
        steps = np.diff(times)
    if (steps == 0).any():
        times, values = _merge(times, values, columns, order, zone, timed, dated)
    return Log(name, spec, zone, times, values, tuple(sorted(dated)), timed, digest)


def zone_of(columns: Columns, spec: Spec, name: str) -> dt.tzinfo:
    """Whose midnight begins a day.

    Raises
    ------
    UndeclaredError
        Where neither the log nor the configuration tells.
    """
    if spec.time_zone:
        return zone_named(spec.time_zone)
    example = 'for example [input] time_zone = "Europe/Paris" or "America/Los_Angeles"'
    example += ' ("Etc/GMT+8" is 8 h behind UTC)'
    if not columns.aware:
        raise UndeclaredError(
            f"{name}: its times have no UTC offset: set the zone of the log's clock, {example}"
        )
    if columns.zone is not None:
        try:
            return zone_named(columns.zone)
        except (OSError, ValueError, KeyError):
            raise UndeclaredError(
                f"{name}: its time zone {columns.zone[:40]!r} is unknown: set {example}"
            ) from None
    if columns.offset is None:
        raise UndeclaredError(
            f"{name}: its times have several UTC offsets: set the zone whose days are meant, {example}"
        )
    return fixed_zone(columns.offset)


def _signal(
    signal: Signal,
    columns: Columns,
    spec: Spec,
    events: dict[str, list[int]],
    faults: list[tuple[int, str, bool]],
) -> Floats:
    """A canonical column from those of the log: sentinels masked, summed, in SI units."""
    total: Floats | None = None
    for source in signal.sources:
        values = columns.numbers[source]
        if spec.sentinels:
            masked = np.isin(values, spec.sentinels)
            if masked.any():
                events.setdefault("sentinels masked", []).extend(np.flatnonzero(masked).tolist())
                values = np.where(masked, np.nan, values)
        total = values if total is None else total + values
    assert total is not None
    if signal.factor != 1.0:
        total = total * signal.factor
    if np.nanmax(np.abs(total), initial=0.0) > LARGEST:
        total = total.copy()
        for row in np.flatnonzero(np.abs(total) > LARGEST):
            unit = "m" if signal.name == "h_L" else "m3/s"
            said = f"{signal.name} = {total[row]:.3g} {unit} is beyond any river: check [input.units]"
            faults.append(
                (int(row), f"{columns.place(int(row))}: {said}, or add the value to [input] sentinels", False)
            )
            total[row] = np.nan
    return total


def _merge(
    times: Micros,
    values: dict[str, Floats],
    columns: Columns,
    order: np.ndarray | None,
    zone: dt.tzinfo,
    events: dict[str, Micros],
    faults: list[Fault],
) -> tuple[Micros, dict[str, Floats]]:
    """One row per time: values that agree, or are there only once, are joined; others are faults."""
    first = np.r_[True, np.diff(times) > 0]
    group = np.cumsum(first) - 1
    events["duplicates dropped"] = times[~first]
    merged = {}
    for name, column in values.items():
        there = np.flatnonzero(np.isfinite(column))
        repeated = np.r_[False, group[there][1:] == group[there][:-1]] if len(there) else np.zeros(0, bool)
        for at in np.flatnonzero(repeated):
            old, new = there[at - 1], there[at]
            if column[old] != column[new]:
                rows = [int(i if order is None else order[i]) for i in (old, new)]
                moment = clock(int(times[new]), zone, with_date=True)
                said = (
                    f"{moment} is logged twice with different {name}: {column[old]:.6g} and {column[new]:.6g}"
                )
                faults.append(
                    Fault(int(times[new]), f"{columns.place(rows[1])}: {said} ({columns.place(rows[0])})")
                )
        merged[name] = np.full(int(group[-1]) + 1, np.nan)
        merged[name][group[there[~repeated]]] = column[there[~repeated]]
    return times[first], merged
