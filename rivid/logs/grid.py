"""The regular grid: k T_s from local midnight, commands held, measurements interpolated, gaps counted."""

import datetime as dt
from dataclasses import dataclass

import numpy as np

from rivid.errors import DataError
from rivid.logs.spec import MICRO, Signal, Spec
from rivid.logs.times import clock
from rivid.types import Bools, Floats, Ints

UNLIKE = 0.02
"""Part of an interval by which the steps of a log may differ from it: clocks are rounded."""

MISSED = 1.5
"""A step of this many usual intervals means that a value is missing between; less is an unsteady clock."""


class TrailingGap(DataError):
    """The log ends before its day does."""


@dataclass(frozen=True)
class Grid:
    """Regular instants of consecutive local days."""

    start: int  # first local midnight and the one after the last day [us UTC]
    end: int
    times: Ints  # (N,) ``start + k T_s``, N = ceil((end - start) / T_s) [us UTC]
    zone: dt.tzinfo  # for messages
    n_days: int


def make_grid(start: int, end: int, period: float, zone: dt.tzinfo, n_days: int = 1) -> Grid:
    """The grid of the local days from `start` to `end` [us UTC] at `period` T_s [s].

    Examples
    --------
    >>> len(make_grid(0, 86_400_000_000, 133.0, dt.timezone.utc).times)
    650
    """
    count = -int(-(end - start) // (period * MICRO))
    times: Ints = start + np.rint(np.arange(count) * (period * MICRO)).astype(np.int64)
    return Grid(start, end, times, zone, n_days)


def on_grid(
    times: Ints, values: Floats, grid: Grid, signal: Signal, spec: Spec
) -> tuple[Floats, Bools | None]:
    """Samples (N,) of ascending times [us UTC] and values, and where a gap was bridged (None: nowhere).

    Raises DataError for a gap longer than `[input] max_gap`; TrailingGap where it is at the end.
    """
    late = spec.tolerance
    if len(times) == len(grid.times) and np.abs(times - grid.times).max() <= late:
        return values, None
    if not len(times):
        raise TrailingGap(f"no {signal.name} at all ({_limit(spec)})")
    _refuse_gaps(times, grid, signal, spec)
    after = times.searchsorted(grid.times + late, side="right")
    before = np.maximum(after - 1, 0)  # ahead of the first value, that one
    samples = values[before] if signal.held else np.interp(grid.times, times, values)
    # where a value is missing, what comes later than one interval after the last is not measured but bridged
    bounded = np.append(times, max(grid.end, int(times[-1])))
    missed = np.diff(bounded) > MISSED * signal.spacing
    age = grid.times - times[before]
    filled = (missed[before] & (age >= signal.spacing - late)) | (age < -late)
    if not signal.held:
        exact = np.minimum(np.abs(age), np.abs(bounded[before + 1] - grid.times)) <= late
        filled |= missed[before] & (age > late)
        filled &= ~exact | (age < -late)
    return samples, filled


def _refuse_gaps(times: Ints, grid: Grid, signal: Signal, spec: Spec) -> None:
    """A gap is the time without a value: it begins one interval after the last one before it."""
    spacing = signal.spacing
    ends = np.append(times, grid.end)
    begins = np.append(grid.start, times + spacing)
    gaps = np.where(ends - begins > (MISSED - 1) * spacing, ends - begins, 0)
    gaps[0] = ends[0] - begins[0] if ends[0] - begins[0] > spacing + spec.tolerance else 0
    allowed = spec.max_gap + spec.tolerance
    if gaps.max() <= allowed:
        return
    worst = int(np.argmax(gaps))
    begin = clock(int(begins[worst]), grid.zone, grid.n_days > 1)
    text = f"gap of {_span(int(gaps[worst]))} from {begin} in {signal.name}"
    usual = int(np.median(np.diff(times))) if len(times) > 2 else 0
    if usual > MISSED * spacing:
        raise DataError(f"{text}: {_coarse(signal, usual, spec)}")
    kind = TrailingGap if gaps[-1] > allowed and gaps[:-1].max() <= allowed else DataError
    if kind is TrailingGap and gaps[-1] <= signal.shift + spec.tolerance:
        text += ": the row that closes the day is the first of the next one's log, and is not there"
    raise kind(f"{text} ({_limit(spec)})")


def refuse_supposed(times: Ints, signal: Signal, spec: Spec) -> None:
    """Raise DataError where stamps were moved by T_s but the intervals differ: the shift decides d."""
    usual = int(np.median(np.diff(times))) if len(times) > 2 else signal.spacing
    if abs(usual - signal.spacing) > max(UNLIKE * signal.spacing, spec.tolerance):
        raise DataError(
            f'{signal.name} is stamped at the end of its interval ([input.stamp] "end") and comes every '
            f"{usual / MICRO:g} s, not every {signal.spacing / MICRO:g} s as [reach] sample_time: "
            + _declare(signal, usual)
        )


def _declare(signal: Signal, usual: int) -> str:
    return f"set [input.interval] {signal.name} = {usual / MICRO:g}"


def refuse_filled(filled: Bools, series: dict[str, tuple[Ints, Floats]], spec: Spec) -> None:
    """Raise DataError for a data set of which too much was bridged."""
    share = float(filled.mean())
    if share <= spec.input.max_filled:
        return
    text = f"{share:.0%} of the samples lie in gaps (limit {spec.input.max_filled:.0%}, [input] max_filled)"
    steps = {
        signal.name: int(np.median(np.diff(times))) if len(times := series[signal.name][0]) > 1 else 0
        for signal in spec.signals
    }
    coarse = [signal for signal in spec.signals if steps[signal.name] > MISSED * signal.spacing]
    if coarse:
        finest = min(steps.values()) if len(coarse) == len(spec.signals) else 0
        text += f"; {_coarse(coarse[0], steps[coarse[0].name], spec, finest)}"
    raise DataError(text)


def _coarse(signal: Signal, usual: int, spec: Spec, finest: int | None = None) -> str:
    """What to do with a column that comes less often than it should.

    `finest` is the step of the column that comes most often: 0 where one of them comes often enough, None
    where the others are not known.
    """
    interval = f"if that is its interval, {_declare(signal, usual)}"
    if finest == 0 or signal.spacing != round(spec.period * MICRO):
        return f"{signal.name} comes every {_span(usual)}: {interval}"
    period = "[reach] sample_time is not set:"
    if spec.period_set:
        period = f"[reach] sample_time = {spec.period:g} s, but"
    if finest:
        every = f"{finest / MICRO:g}"
        only = f"or, where that is the interval of one column only, {_declare(signal, usual)}"
        return f"{period} the log comes every {every} s: set [reach] sample_time = {every}; {only}"
    every = f"{signal.name} comes every {_span(usual)}"
    return f"{period} {every}: set [reach] sample_time = {usual / MICRO:g} if all columns do; {interval}"


def _limit(spec: Spec) -> str:
    return f"limit {_span(spec.max_gap)}, [input] max_gap"


def _span(micros: int) -> str:
    seconds = micros / MICRO
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
