"""What samples are binned by to see where a gap is: clock, calendar, flows, level, their rates, and steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rivid.types import Bools, Floats, Ints

if TYPE_CHECKING:
    from rivid.diagnosis.data import Record


BINS = 8
"""Bins of a flow, a level or a rate, with as many samples each."""

PART_BLOCKS = 10
"""Blocks in a part of the season: flips of k blocks give no p under 2^(1 - k)."""

STEP = 0.02
"""A step is a change from one sample to the next of more than this share of the flow's 5-95 % range."""

SINCE = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 24.0)
"""Hours since a step: edges of bins."""

WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")


@dataclass(frozen=True, eq=False)
class Driver:
    """Something that samples are binned by.

    Attributes
    ----------
    name, unit : str
    edges : ndarray, shape (k + 1,)
        [unit]; a bin holds its lower edge.
    labels : tuple of str, length k
    bin : ndarray of int, shape (days, n)
        Bin of each sample; -1 for none.
    cyclic : bool
        Whether the last bin is next to the first one.
    """

    name: str
    unit: str
    edges: Floats
    labels: tuple[str, ...]
    bin: Ints
    cyclic: bool = False


def drivers(record: "Record", blocks: ArrayLike, shift_start: float = 5.0) -> tuple[Driver, ...]:
    """Everything the logs allow to bin by; what does not vary is left out.

    Parameters
    ----------
    record : Record
    blocks : array_like of int, shape (days,)
        Block of each day; parts of the season are whole blocks.
    shift_start : float
        Hour at which one of the day's three shifts begins.
    """
    hour, used = record.hour, record.used
    weekday = np.asarray(record.day_number + record.dates[0].weekday(), float) % 7.0
    level = ("level", "m") if record.kind == "pool" else ("discharge", "m3/s")
    logs = (("inflow", "m3/s", record.inflow), ("outflow", "m3/s", record.outflow), (*level, record.output))
    lag = max(1, round(3600.0 / record.sample_time))
    shift = np.mod(hour - shift_start, 24.0) / 8.0
    hours = [f"{h} to {h + 1} h" for h in range(24)]
    turns = [f"{(shift_start + 8 * i) % 24:g} to {(shift_start + 8 * i + 8) % 24:g} h" for i in range(3)]
    found = [
        Driver("hour", "h", np.arange(25.0), tuple(hours), _floor(hour), True),
        Driver("shift", "shift", np.arange(4.0), tuple(turns), _floor(shift), True),
        Driver("weekday", "day", np.arange(8.0), WEEKDAYS, _floor(weekday[:, None] + 0.0 * hour), True),
        season(record.dates, blocks, hour.shape[1]),
        *(by_size(name, unit, values, used) for name, unit, values in logs),
        *(by_size(f"rate of {name}", f"{unit} per h", rate(values, lag, record.sample_time), used)
          for name, unit, values in logs),
        *(since_step(f"hours since a step of the {name}", values, record.sample_time)
          for name, _, values in logs[:2]),
    ]  # fmt: skip
    return tuple(d for d in found if d is not None and len(np.unique(d.bin[used & (d.bin >= 0)])) > 1)


def season(dates: Sequence[date], blocks: ArrayLike, n: int) -> Driver | None:
    """Parts of the season of :data:`PART_BLOCKS` blocks or more, for rows of n samples; None if only one."""
    number = np.unique(np.asarray(blocks), return_inverse=True)[1]
    many = int(number.max()) + 1
    parts = min(many // PART_BLOCKS, 12)
    if parts < 2:
        return None
    part = number * parts // many
    ends = [*np.flatnonzero(np.diff(part, prepend=-1)).tolist(), len(dates)]
    labels = tuple(
        f"{in_words(dates[a])} to {in_words(dates[b - 1])}" for a, b in zip(ends[:-1], ends[1:], strict=True)
    )
    return Driver(
        "date", "row", np.array(ends, float), labels, np.repeat(part[:, None].astype(np.int64), n, axis=1)
    )


def by_size(name: str, unit: str, values: Floats, used: Bools) -> Driver | None:
    """Bins with as many used samples each; None where nothing varies. NaN has no bin."""
    there = used & np.isfinite(values)
    if not there.any():
        return None
    edges = np.unique(np.quantile(values[there], np.linspace(0.0, 1.0, BINS + 1)))
    if len(edges) < 3:
        return None
    inner = np.digitize(values, edges[1:-1])  # the highest value belongs to the last bin
    outside = ~np.isfinite(values) | (values < edges[0]) | (values > edges[-1])
    labels = tuple(f"{a:.4g} to {b:.4g} {unit}" for a, b in zip(edges[:-1], edges[1:], strict=True))
    return Driver(name, unit, edges, labels, np.where(outside, -1, inner).astype(np.int64))


def rate(values: Floats, lag: int, sample_time: float) -> Floats:
    """Change over the last `lag` samples, per hour, shape (days, n); NaN before."""
    out = np.full(values.shape, np.nan)
    out[:, lag:] = (values[:, lag:] - values[:, :-lag]) * (3600.0 / (lag * sample_time))
    return out


def since_step(name: str, flow: Floats, sample_time: float) -> Driver | None:
    """Hours since the last step in the row; samples before the first one have no bin."""
    low, high = np.quantile(flow, [0.05, 0.95])
    steps = np.abs(np.diff(flow, axis=1, prepend=flow[:, :1])) > max(STEP * (high - low), 1e-9)
    if not steps.any():
        return None
    at = np.where(steps, np.arange(flow.shape[1]), -1)
    last = np.maximum.accumulate(at, axis=1)
    hours = (np.arange(flow.shape[1]) - last) * (sample_time / 3600.0)
    bins = np.where((last >= 0) & (hours < SINCE[-1]), np.digitize(hours, SINCE) - 1, -1)
    labels = tuple(f"{a:g} to {b:g} h" for a, b in zip(SINCE[:-1], SINCE[1:], strict=True))
    return Driver(name, "h", np.array(SINCE), labels, bins.astype(np.int64))


def in_words(day: date) -> str:
    """12 May."""
    return f"{day.day} {day:%B}"


def _floor(values: Floats) -> Ints:
    return np.floor(values + 1e-9).astype(np.int64)
