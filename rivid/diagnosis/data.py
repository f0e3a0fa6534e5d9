"""Records: days of logs as rows on one grid, each preceded by samples of lead time."""

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.check import check_days
from rivid.check.findings import UNTRUE
from rivid.check.flags import chosen
from rivid.config import Config
from rivid.core.hydraulics import wave_memory
from rivid.diagnosis.blocks import split
from rivid.effects import Effect
from rivid.effects.base import World
from rivid.effects.timing import ClockOffset
from rivid.errors import DataError, NoDataError, RividError
from rivid.logs.days import DataSet, find_days, read_window
from rivid.text import count
from rivid.types import DAY, Floats

Kind = Literal["pool", "river"]
START_UP = 30
"""Samples, beyond the delay, after which a day without a predecessor has forgotten its assumed start."""
FADED = 3.0
"""Start-up of a pool, in memories of its waves: 5 % of the waves of a wrong steady start then remain. With
START_UP alone 29 releases were found in a season of 39 days, 27 within half an hour of midnight."""

PAST = 7
"""Days of earlier commands from which the position of a gate with a dead-band follows. In four development
seasons, for bands of up to three times the median change, it is that of thirty days; the command itself is
wrong on 59 to 84 % of the days."""


@dataclass(frozen=True, eq=False)
class Record:
    """Days of logs on one grid."""

    dates: tuple[dt.date, ...]  # date of each row, in order
    # (days, n): seconds since the midnight of `dates[0]`. The first `lead` samples of a row are before its
    # day
    time: Floats
    inflow: Floats  # (days, n): u_Qi [m3/s]
    outflow: Floats  # (days, n): u_Qo [m3/s]; zero for a river reach, which has none
    output: Floats  # (days, n): level [m] or, for a river reach, discharge [m3/s]; NaN where it is missing
    # (days, n): samples used in fits and scores: those of the day itself and the last one before it, with an
    # output, and not in the start-up of a day without a predecessor
    used: NDArray[np.bool_]
    lead: int  # samples before each day
    sample_time: float  # T_s [s]
    kind: Kind = "pool"
    # (days, n): activity of the flows, see :func:`activity` [m2 or (m3/s)2]; None before a response is known
    activity: Floats | None = None
    # samples at the start of each row until flows of that time arrive: errors show the assumed start
    blind: int = 0
    # (days, m): u_Qo before the first sample of each row, without repetitions [m3/s]; None if unknown
    earlier: Floats | None = None

    @property
    def days(self) -> int:
        """Number of rows."""
        return len(self.dates)

    @property
    def day_number(self) -> NDArray[np.intp]:
        """Days since the first one, shape (days,)."""
        first = self.dates[0]
        return np.array([(date - first).days for date in self.dates], np.intp)

    @property
    def hour(self) -> Floats:
        """Hour of the day of each sample, shape (days, n)."""
        return np.asarray(np.mod(self.time, DAY) / 3600.0)

    @property
    def usual_output(self) -> float:
        """Median of the used output: reference of level-dependent effects."""
        return float(np.median(self.output[self.used]))

    @property
    def usual_flow(self) -> float:
        """Median inflow of the used samples [m3/s]."""
        return float(np.median(self.inflow[self.used]))

    def world(self, level: float | None = None, flow: float | None = None) -> World:
        """Return grid and logs for effects; `level` and `flow` are the usual ones by default."""
        past = dt.timedelta(days=int(self.time[0, self.lead] // DAY))  # a subset may start later
        return World(
            time=self.time, inflow=self.inflow, outflow=self.outflow, first_day=self.dates[0] - past,
            sample_time=self.sample_time, level=self.usual_output if level is None else level,
            flow=self.usual_flow if flow is None else flow, earlier=self.earlier,
        )  # fmt: skip

    def take(self, rows: ArrayLike) -> "Record":
        """Return the days `rows`, an index or a mask; times still count from the first day of all."""
        kept = np.arange(self.days)[np.asarray(rows)]
        return replace(
            self, dates=tuple(self.dates[i] for i in kept), time=self.time[kept], inflow=self.inflow[kept],
            outflow=self.outflow[kept], output=self.output[kept], used=self.used[kept],
            activity=None if self.activity is None else self.activity[kept],
            earlier=None if self.earlier is None else self.earlier[kept],
        )  # fmt: skip


NEAR = 0.25
"""Share of the delay by which a front may be early or late: twice the few percent of the geometry, squared in
the celerity, and the equally long shape of a front."""


def activity(record: Record, up: Floats, down: Floats) -> Floats:
    """Return the squared recent change of the output's rate by changes of the flows, shape (days, n)."""
    # The error of a response is largest where the flows have changed: a front that is early or late by a
    # share of a sample changes the output by that share of the change of its rate. As the position of a front
    # is uncertain by some samples, squares are averaged over NEAR of the delay to either side. `up` and
    # `down` (n,) are the output after a unit step of the inflow and of the outflow [m per m3/s, or -].
    n = record.time.shape[1]
    order, delay = _front(record, up)
    total = np.zeros(record.time.shape)
    for flow, kernel in ((record.inflow, up), (record.outflow, down)):
        rate = np.diff(kernel, n=order, prepend=np.zeros(order))
        moves = np.diff(flow, axis=1, prepend=flow[:, :1])
        size = 2 * n
        spectrum = np.fft.rfft(moves, size, axis=1) * np.fft.rfft(rate[:n], size)
        total += np.fft.irfft(spectrum, size, axis=1)[:, :n] ** 2
    half = max(round(NEAR * delay), 1)
    sums = np.cumsum(np.pad(total, ((0, 0), (half + 1, half)), mode="edge"), axis=1)
    return np.asarray(np.maximum(sums[:, 2 * half + 1 :] - sums[:, : -2 * half - 1], 0.0) / (2 * half + 1))


def _front(record: Record, up: Floats) -> tuple[int, float]:
    """Return the differences that make a front of a step response (n,), and its mean delay [samples]."""
    order = 2 if record.kind == "pool" else 1
    sizes = np.abs(np.diff(up, n=order, prepend=np.zeros(order)))
    return order, float(np.arange(len(sizes)) @ sizes / max(sizes.sum(), 1e-300))


def with_activity(record: Record, up: Floats, down: Floats) -> Record:
    """Return a record with the activity of its flows and the samples in which its rows are blind."""
    blind = min(math.ceil(_front(record, up)[1]), max(record.lead - 1, 0))
    return replace(record, activity=activity(record, up, down), blind=blind)


LONGEST = 150.0
"""Longest sample to which shorter ones are joined [s]: six in the 15 minutes of the nearest forecast."""
A_FRONT = 4  # fewest samples of a usual delay after joining: the arrival of a front is fitted between samples


def joined(config: Config, sample_time: float) -> int:
    """Return how many samples a diagnosis joins: event searches use matrices of the samples of a day."""
    delay = sample_time * (config.reach.proposal(sample_time).delay_scale + 1.0)
    return max(int(min(LONGEST, delay / A_FRONT) / sample_time), 1)


def lead_of(config: Config, inflow: Floats, sample_time: float) -> int:
    """Return the samples in which a simulation forgets its start: a delay, and the decay of its waves."""
    reach = config.reach
    start_up = float(START_UP)
    if reach.kind == "pool":
        memory = wave_memory(
            float(np.median(inflow)), width=reach.width, depth=reach.depth, manning=config.diagnose.manning
        )
        start_up = min(max(start_up, FADED * memory / sample_time), DAY / sample_time)
    return reach.proposal(sample_time).d_max // 2 + round(start_up)


def as_record(
    dates: Sequence[dt.date],
    seconds: ArrayLike,
    inflow: ArrayLike,
    outflow: ArrayLike | None,
    output: ArrayLike,
    *,
    sample_time: float,
    lead: int,
    kind: Kind = "pool",
    every: int = 1,
) -> Record:
    """Arrange days, in order, in rows and give each the end of the day before it, `lead` samples.

    Samples are `seconds` (N,) after local midnight. The logs (days, N) are u_Qi [m3/s], u_Qo [m3/s] (None for
    a river reach) and level [m] or discharge [m3/s], NaN where missing. `every` samples of `sample_time` [s]
    are joined to one: the mean of a flow, which is constant over a sample, and the mean of the readings about
    the first of them. `lead` counts joined samples.
    """
    clock, u, y = (np.asarray(x, float) for x in (seconds, inflow, output))
    o = np.zeros_like(u) if outflow is None else np.asarray(outflow, float)
    shape = (len(dates), len(clock))
    for name, values in (("inflow", u), ("outflow", o), ("output", y)):
        if values.shape != shape:
            raise RividError(f"{name} has shape {values.shape}: expected {shape}, days and samples of a day")
        if name != "output" and not np.isfinite(values).all():
            day = int(np.argwhere(~np.isfinite(values))[0, 0])
            raise RividError(
                f"{name} of {dates[day]} has gaps: expected whole days, with gaps filled or left out"
            )
    if not dates or any(a >= b for a, b in zip(dates, dates[1:], strict=False)):
        raise RividError("dates are empty or out of order: expected days in order, none twice")
    if every > 1:
        first = np.arange(0, len(clock), every)
        many = np.diff(np.append(first, len(clock)))
        u, o = (np.add.reduceat(flow, first, axis=1) / many for flow in (u, o))
        around = first + np.arange(-((every - 1) // 2), (every - 1) // 2 + 1)[:, None]
        within = (around >= 0) & (around < len(clock))
        about = np.ma.masked_invalid(np.where(within, y[:, np.where(within, around, 0)], np.nan))
        clock, y, sample_time = clock[first], about.mean(axis=1).filled(np.nan), sample_time * every
    lead = min(lead, len(clock))
    number = np.array([(date - dates[0]).days for date in dates])
    follows = np.append(False, np.diff(number) == 1)
    time = number[:, None] * DAY + np.concatenate([clock[len(clock) - lead :] - DAY, clock])
    rows = np.arange(len(dates))
    previous = np.maximum(rows - 1, 0)

    def led(values: Floats, start: Floats) -> Floats:
        tail = np.where(follows[:, None], values[previous, len(clock) - lead :], start)
        return np.concatenate([tail, values], axis=1)

    # commands of missing days are replaced by the next one
    earlier, back, there = o[:, :1], rows, follows
    for end in (len(clock) - lead, *(len(clock),) * (PAST - 1)):
        back = previous[back]
        earlier = np.concatenate([np.where(there[:, None], o[back, :end], earlier[:, :1]), earlier], axis=1)
        there = there & follows[back]
    used = np.isfinite(y)
    used[~follows, :lead] = False
    before = np.zeros((len(dates), lead), bool)
    before[follows, lead - 1 :] = used[previous[follows], -1:]  # changes at midnight count, too
    return Record(
        dates=tuple(dates), time=time, inflow=led(u, u[:, :1]), outflow=led(o, o[:, :1]),
        output=led(y, np.full((len(dates), 1), np.nan)), lead=lead, sample_time=sample_time, kind=kind,
        used=np.concatenate([before, used], axis=1),
        earlier=moves_of(earlier[:, :-1]) if kind == "pool" else None,
    )  # fmt: skip


def moves_of(commands: Floats) -> Floats:
    """Return commands (days, n) without repetitions, the first one of each row repeated before them."""
    change = np.diff(commands, axis=1) != 0.0
    moves = np.repeat(commands[:, :1], change.sum(axis=1).max() + 1, axis=1)
    for row, given, new in zip(moves, commands, change, strict=True):
        row[len(row) - new.sum() :] = given[1:][new]
    return moves


def read_record(
    root: Path,
    config: Config,
    *,
    first: dt.date | None = None,
    last: dt.date | None = None,
    today: dt.date | dt.datetime | None = None,
) -> tuple[Record, "Known"]:
    """Read the days of DATA_DIR, or of one file, that a diagnosis can use, from `first` until `last`."""
    # Values that `rivid check` finds untrue are left out. A log of `today` may be unfinished.
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
    days, known = checked(days, config)
    if not days:
        raise NoDataError(f"{root}: no day is left; {known.notes[0]}")
    reach = config.reach
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
            f"{failed[0][1]}: see `rivid check`"
        )
    outflow = None
    if reach.kind == "pool":
        missing = [day.date for day in whole if day.outflow is None]
        if missing:
            raise DataError(
                f"{root}: the outflow is not logged on {missing[0]}: a diagnosis of a pool needs u_Qo"
            )
        outflow = np.array([day.outflow for day in whole])
    inflow = np.array([day.inflow for day in whole])
    every = joined(config, reach.sample_time)
    record = as_record(
        [day.date for day in whole], seconds, inflow, outflow, np.array([day.output for day in whole]),
        sample_time=reach.sample_time, lead=lead_of(config, inflow, every * reach.sample_time),
        kind=reach.kind, every=every,
    )  # fmt: skip
    if every > 1:
        note = f"{every} samples of {reach.sample_time:g} s were joined to one of {record.sample_time:g} s"
        known = known._replace(notes=(*known.notes, note))
    if failed:
        day, why = failed[0]
        which = count(len(failed), "day or file", "days or files")
        known = known._replace(
            notes=(*known.notes, f"{which} could not be used; the first, {day or 'a file'}: {why}")
        )
    return record, known


class Known(NamedTuple):
    """Facts about the logs known before a diagnosis."""

    notes: tuple[str, ...] = ()  # what was left out and why, and other findings of `rivid check`
    dated: tuple[Effect, ...] = ()  # effects found by `rivid check`, with their dates


def checked(days: Sequence[DataSet], config: Config) -> tuple[list[DataSet], Known]:
    """Leave out what `rivid check` finds untrue: values of the output, or whole days."""
    # A jump of the gauge and a shifted clock are effects, and are left to the search. No search can find one
    # on sealed days alone: these days are left out. `days` are in order of dates; output that is left out
    # becomes NaN.
    left, notes, dated = {day.date: day for day in days}, list[str](), list[Effect]()
    findings = [finding for finding in check_days(days, config) if finding.wrong]
    for finding in sorted(findings, key=lambda one: one.kind not in UNTRUE):
        on = [date for date in finding.days if date in left]
        if finding.days and not on:
            continue
        untrue = bool(on) and finding.kind in UNTRUE
        hidden = bool(on) and finding.kind in ("clock", "jump")
        hidden = hidden and set(on) <= set(compress(left, split([*left]).sealed))
        out = untrue or hidden
        notes.append(f"{'left out' if out else 'kept'}; rivid check finds: {finding}")
        if not out and on and finding.kind == "clock" and finding.values["column"] == "u_Qi":
            fast = 1.0 if finding.values["sense"] == "late" else -1.0
            dated.append(ClockOffset(offset=fast * finding.values["off_s"], dates=(min(on), max(on))))
        for date in on if out else ():
            output, step = left[date].output, config.reach.sample_time
            gone = chosen(finding, date, np.rint(1e6 * step * np.arange(len(output))).astype(int), step)
            if untrue and not gone.all():
                left[date] = replace(left[date], output=np.where(gone, np.nan, output))
            else:
                del left[date]
    return [*left.values()], Known(tuple(notes), tuple(dated))


def _no_day(
    root: Path, failed: list[tuple[dt.date | None, str]], dates: list[dt.date], first: dt.date | None,
    last: dt.date | None,
) -> str:  # fmt: skip
    """Return why no day can be used: none in the given dates, or each failed."""
    if not any(date for date, _ in failed) and dates:
        return (
            f"no day from {first or 'the first'} to {last or 'the last'}: "
            f"{root} has them from {min(dates)} to {max(dates)}"
        )
    return (
        f"{root}: none of {len(failed)} days or files can be used; the first, {failed[0][0] or 'a file'}: "
        f"{failed[0][1]}: see `rivid check`"
    )
