"""Location of the largest gap: hours, weekdays, dates, flows, levels, their rates, and times since a step.

A sample has a score s and an information q, so that the sum of s over the sum of q is a size: with x the
whitened column of a unit inflow and r the whitened residual, s = x r and q = x^2 give it in m3/s; for a
reconstructed inflow q = 1. The departure of a bin is its size minus that of all samples,

    D_b = S_b / Q_b - S / Q = sum over blocks j of psi_jb,
    psi_jb = (s_jb - (S/Q) q_jb) / Q_b - (s_j - (S/Q) q_j) / Q,

and its significance is tested by flipping the signs of whole blocks of psi. This test needs a bin in several
blocks, so dates are binned in long parts; the ends of date windows are found by segmentation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.diagnosis.data import Record
from rivid.diagnosis.noise.model import FEWEST_BLOCKS
from rivid.diagnosis.segments import segment
from rivid.errors import RividError
from rivid.types import Bools, Floats, Ints

BINS = 8
"""Number of bins of a flow, a level or a rate, with equal numbers of samples."""

PART_BLOCKS = 10
"""Blocks in a part of the season: flips of k blocks give no p-value below 2^(1 - k)."""

STEP = 0.02
"""A step is a change from one sample to the next of more than this share of the flow's 5-95 % range."""

SINCE = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 24.0)
"""Hours since a step: edges of bins."""

FIRST_SHIFT = 5.0
"""Hour at which one of three shifts begins."""
WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
FEWEST = 5
"""Smallest number of blocks of a tested bin: flips of fewer give no small p-value."""

KEPT = 0.6
"""Share of blocks, those with the smallest contributions, that set the scale of a bin."""


@dataclass(frozen=True, eq=False)
class Driver:
    """A quantity by which samples are binned."""

    name: str
    unit: str
    edges: Floats  # (k + 1,) [unit]; a bin includes its lower edge
    labels: tuple[str, ...]  # length k
    bin: Ints  # (days, n): bin of each sample; -1 for none
    cyclic: bool = False  # whether the last bin is next to the first one


def drivers(record: Record, blocks: ArrayLike) -> tuple[Driver, ...]:
    """Return all drivers that vary in the logs.

    `blocks` (days,) are the blocks of the days: parts of the season consist of whole blocks.
    """
    hour, used = record.hour, record.used
    weekday = np.asarray(record.day_number + record.dates[0].weekday(), float) % 7.0
    level = ("level", "m") if record.kind == "pool" else ("discharge", "m3/s")
    logs = (("inflow", "m3/s", record.inflow), ("outflow", "m3/s", record.outflow), (*level, record.output))
    lag = max(1, round(3600.0 / record.sample_time))
    shift = np.mod(hour - FIRST_SHIFT, 24.0) / 8.0
    hours = [f"{h} to {h + 1} h" for h in range(24)]
    turns = [f"{(FIRST_SHIFT + 8 * i) % 24:g} to {(FIRST_SHIFT + 8 * i + 8) % 24:g} h" for i in range(3)]

    def rate(values: Floats) -> Floats:
        """Return the change over the last hour [1/h], shape (days, n); NaN in the first hour."""
        out = np.full(values.shape, np.nan)
        out[:, lag:] = (values[:, lag:] - values[:, :-lag]) * (3600.0 / (lag * record.sample_time))
        return out

    found = [
        Driver("hour", "h", np.arange(25.0), tuple(hours), _floor(hour), True),
        Driver("shift", "shift", np.arange(4.0), tuple(turns), _floor(shift), True),
        Driver("weekday", "day", np.arange(8.0), WEEKDAYS, _floor(weekday[:, None] + 0.0 * hour), True),
        season(record.dates, blocks, hour.shape[1]),
        *(by_size(name, unit, values, used) for name, unit, values in logs),
        *(by_size(f"rate of {name}", f"{unit} per h", rate(values), used)
          for name, unit, values in logs),
        *(since_step(f"hours since a step of the {name}", values, record.sample_time)
          for name, _, values in logs[:2]),
    ]  # fmt: skip
    return tuple(d for d in found if d is not None and len(np.unique(d.bin[used & (d.bin >= 0)])) > 1)


def season(dates: Sequence[date], blocks: ArrayLike, n: int) -> Driver | None:
    """Return parts of :data:`PART_BLOCKS` blocks or more, for rows of n samples; None if only one."""
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
    """Return bins with equal numbers of used samples, or None if values do not vary. NaN has no bin."""
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


def since_step(name: str, flow: Floats, sample_time: float) -> Driver | None:
    """Return bins by hours since the last step in the row; samples before the first one have no bin."""
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
    """Return a date such as "12 May"."""
    return f"{day.day} {day:%B}"


def _floor(values: Floats) -> Ints:
    return np.floor(values + 1e-9).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores ready to be binned; made by :func:`as_scores`."""

    score: Floats  # (days, n) s and q; 0 where a sample does not count
    information: Floats
    used: Bools  # (days, n)
    block: Ints  # (days,) 0, 1, ... without holes


def as_scores(score: ArrayLike, used: ArrayLike, blocks: ArrayLike) -> Scores:
    """Prepare scores of an inflow (days, n), with the information 1, used samples and blocks (days,)."""
    there, s, block = np.asarray(used, bool), np.asarray(score, float), np.asarray(blocks)
    seen = len(np.unique(block[there.any(1)]))
    if seen < FEWEST_BLOCKS:
        raise RividError(f"{seen} blocks have samples that count: expected {FEWEST_BLOCKS} or more; "
                         "give more days or shorter blocks")  # fmt: skip
    number = np.unique(block, return_inverse=True)[1].astype(np.int64)
    return Scores(np.where(there, s, 0.0), there.astype(float), there, number)


def p_values(
    scores: Scores, by: Sequence[Driver], *, draws: int = 1999, seed: int = 0
) -> tuple[Floats, float]:
    """Return p-values of the largest departure of each driver (drivers,), and that of their minimum.

    Signs of blocks are flipped, in the same way for all drivers. Bins of one driver are comparable, drivers
    are not; the smallest p-value of each flip is (Westfall and Young 1993).
    """
    signs = np.random.default_rng(seed).choice(np.array([-1.0, 1.0]), (draws, int(scores.block.max()) + 1))
    ranks = []
    for driver in by:
        S, Q = (sums(driver, a, scores.block) for a in (scores.score, scores.information))
        blocks = (sums(driver, scores.used, scores.block) > 0.0).sum(0)
        psi = influence(S, Q)
        root = _spread(psi)
        tested = (blocks >= FEWEST) & (root > 1e-12 * np.abs(S).sum() / max(Q.sum(), 1e-300))
        flipped = np.abs(signs @ (psi[:, tested] / root[tested])).max(1, initial=0.0)
        top = float((np.abs(psi[:, tested].sum(0)) / root[tested]).max(initial=0.0))
        ranks.append(_shares(np.append(flipped, top)))
    smallest = np.min(ranks, axis=0)
    return np.array([share[-1] for share in ranks]), float(np.mean(smallest <= smallest[-1]))


def sums(driver: Driver, values: NDArray[np.generic], block: Ints) -> Floats:
    """Sum by block and bin, shape (blocks, k)."""
    k, J = len(driver.labels), int(block.max()) + 1
    inside = driver.bin >= 0
    cell = (block[:, None] * k + driver.bin)[inside]
    return np.asarray(np.bincount(cell, np.asarray(values, float)[inside], J * k).reshape(J, k), float)


def influence(S: Floats, Q: Floats) -> Floats:
    """Compute psi, shape (blocks, k), from sums by block and bin; 0 in empty bins."""
    u = S - S.sum() / max(Q.sum(), 1e-300) * Q
    known = Q.sum(0)
    return np.where(known > 0.0, u / np.where(known > 0.0, known, 1.0) - u.sum(1)[:, None] / known.sum(), 0.0)


def _spread(psi: Floats) -> Floats:
    """Return the scale of each bin's departure (k,), from the smaller contributions of blocks (blocks, k).

    It does not change with the flips, so the test stays valid, and an effect that acts in some weeks only
    does not inflate its own scale.
    """
    squares = np.sort(psi**2, axis=0)
    many = (squares > 0.0).sum(0)
    rank = np.arange(len(psi))[:, None] - (len(psi) - many)
    kept = (rank >= 0) & (rank < np.ceil(KEPT * many))
    mean = (squares * kept).sum(0) / np.maximum(kept.sum(0), 1)
    return np.asarray(np.sqrt(mean * many))


def _shares(values: Floats) -> Floats:
    """Return the share of all values that are at least as large as each one, itself included, to rounding."""
    rounded = np.round(values, 9)
    return np.asarray(1.0 - np.searchsorted(np.sort(rounded), rounded, side="left") / len(values), float)


@dataclass(frozen=True)
class Place:
    """Location of the largest gap."""

    driver: str
    # Range of the driver [its unit]; low >= high wraps past midnight or Sunday. For dates, see `windows`.
    low: float
    high: float
    size: float  # inside minus outside [unit of the effect], and its standard error by blocks
    size_se: float
    p_value: float  # corrected for all drivers and bins
    # First and last day of each period in which it acts; the whole season if no end is found.
    windows: tuple[tuple[date, date], ...]
    text: str  # description


def strongest(
    scores: Scores, by: Sequence[Driver], dates: Sequence[date], level: float = 0.05
) -> Place | None:
    """Find the largest departure: adjacent bins of one driver, and dates; None if none is significant.

    `level` is that of the largest bin of all drivers. With k blocks no p-value is below 2^(1 - k).
    """
    each, p_value = p_values(scores, by)
    significant = [d for d, p in zip(by, each, strict=True) if p <= level]
    if p_value > level or not significant:
        return None
    all_days = np.ones(len(dates), bool)
    driver = max(significant, key=lambda d: _best_run(scores, d, all_days)[0])
    days, first, last = _extent(scores, driver)
    where = days[:, None] & (_between(driver, first, last) | (driver.name == "date"))
    two = Driver("two", "", np.arange(3.0), ("out", "in"), where.astype(np.int64))
    S, Q = (sums(two, a, scores.block) for a in (scores.score, scores.information))
    size = S.sum(0) / np.maximum(Q.sum(0), 1e-300)
    error = (S - size * Q) / np.maximum(Q.sum(0), 1e-300)
    value, se = float(size[1] - size[0]), float(np.sqrt(((error[:, 1] - error[:, 0]) ** 2).sum()))
    ends = np.flatnonzero(np.diff(np.concatenate([[False], days, [False]]).astype(int))).tolist()
    windows = tuple((dates[a], dates[b - 1]) for a, b in zip(ends[::2], ends[1::2], strict=True))
    low, high = float(driver.edges[first]), float(driver.edges[last + 1])
    names = driver.labels[first], driver.labels[last]
    if driver.name == "date":
        span = ""
    elif driver.name == "hour":
        span = f"hours {low:g} to {high:g}, "
    elif driver.name in ("weekday", "shift"):
        span = f"{driver.name} {names[0] if first == last else ' to '.join(names)}, "
    else:
        span = f"{driver.name} {low:.4g} to {high:.4g} {driver.unit}, "
    spans = [f"from {in_words(a)} to {in_words(b)}" for a, b in windows]
    if len(spans) > 3:
        spans = [f"at {len(spans)} times from {in_words(windows[0][0])} to {in_words(windows[-1][1])}"]
    when = "on all days" if days.all() else f"on days {' and '.join(spans)}"
    return Place(driver.name, low, high, value, se, p_value, windows, f"{span}{value:.3g} m3/s, {when}")


def _extent(scores: Scores, driver: Driver) -> tuple[Bools, int, int]:
    """Return days (days,) and the first and last bin of the largest departure."""
    days = np.ones(len(scores.block), bool)
    if driver.name == "date":
        q = scores.information.sum(1)
        cut = segment(scores.score.sum(1), q, scores.block, rest="free")
        if cut.found:
            longest = int(np.argmax(np.diff(cut.bounds)))  # the usual state is the longest one
            apart = np.abs(cut.size - cut.size[longest])
            other = apart > 2.0 * np.hypot(cut.size_se, cut.size_se[longest])
            return np.repeat(other & (np.arange(len(other)) != longest), np.diff(cut.bounds)), 0, 0
        _, _, first, last = _best_run(scores, driver, days)
        return np.asarray(_between(driver, first, last).any(1)), first, last
    first = last = 0
    for _ in range(3):  # refine dates and hours in turn
        _, sign, first, last = _best_run(scores, driver, days)
        inside = _between(driver, first, last)
        rest = ~(inside & days[:, None])
        usual = (scores.score * rest).sum() / max((scores.information * rest).sum(), 1e-300)
        g = ((scores.score - usual * scores.information) * inside).sum(1)
        q = (scores.information * inside).sum(1)
        if len(np.unique(scores.block[q > 0.0])) < FEWEST_BLOCKS:
            break  # too few blocks for separate dates
        cut = segment(g, q, scores.block, sign=sign)
        now = cut.mask if cut.found else np.ones_like(days)
        if (now == days).all():
            break
        days = now
    return days, first, last


def _best_run(scores: Scores, driver: Driver, days: Bools) -> tuple[float, int, int, int]:
    """Return gain [nats], sign, first and last bin of the adjacent bins that differ most from the others.

    A run has at most half of the information: the rest of a cycle is the same run with opposite sign.
    """
    S, Q = (sums(driver, a * days[:, None], scores.block).sum(0) for a in (scores.score, scores.information))
    k, total_S, total_Q = len(S), S.sum(), Q.sum()
    best = (0.0, 1, 0, 0)
    for first in range(k):
        for length in range(1, k if driver.cyclic else k - first + 1):
            members = np.arange(first, first + length) % k
            s, q = S[members].sum(), Q[members].sum()
            if not 0.0 < q < total_Q or (length > 1 and q > 0.5 * total_Q * (1.0 + 1e-9)):
                continue
            contrast = s / q - (total_S - s) / (total_Q - q)
            gain = 0.5 * contrast**2 * q * (total_Q - q) / total_Q
            if gain > best[0]:
                best = (float(gain), 1 if contrast > 0 else -1, first, int(members[-1]))
    return best


def _between(driver: Driver, first: int, last: int) -> Bools:
    b = driver.bin
    return (b >= first) & (b <= last) if first <= last else (b >= first) | ((b >= 0) & (b <= last))
