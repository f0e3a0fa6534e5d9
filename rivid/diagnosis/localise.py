"""Location of the largest gap: hours, weekdays, dates, flows, levels, their rates, and times since a step.

The score s of a sample is the reconstructed inflow [m3/s], and q = 1 for samples that count, else 0. The
departure of a bin is the mean of its scores minus that of all samples,

    D_b = S_b / Q_b - S / Q = sum over blocks j of psi_jb,
    psi_jb = (s_jb - (S/Q) q_jb) / Q_b - (s_j - (S/Q) q_j) / Q,

and its significance is tested by flipping the signs of whole blocks of psi. This test needs a bin in several
blocks, so dates are binned in long parts; the ends of date windows are found by segmentation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.data import Record
from rivid.diagnosis.noise.model import FEWEST_BLOCKS
from rivid.diagnosis.segments import segment
from rivid.types import Bools, Floats, Ints

LEVEL = 0.05  # significance level of the largest bin of all drivers
BINS = 8  # number of bins of a flow, a level or a rate, with equal numbers of samples
PART_BLOCKS = 10  # blocks in a part of the season: flips of k blocks give no p-value below 2^(1 - k)
STEP = 0.02
"""A step is a change from one sample to the next of more than this share of the flow's 5-95 % range."""
SINCE = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 24.0)  # hours since a step: edges of bins
FIRST_SHIFT = 5.0  # hour at which one of three shifts begins
WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
FEWEST = 5  # smallest number of blocks of a tested bin: flips of fewer give no small p-value
KEPT = 0.6  # share of blocks, those with the smallest contributions, that set the scale of a bin


@dataclass(frozen=True, eq=False)
class Driver:
    """A quantity by which samples are binned."""

    name: str
    count: int  # number of bins
    bin: Ints  # (days, n): bin of each sample; -1 for none
    words: Callable[[int, int], str]  # describes the bins from a first to a last one
    cyclic: bool = False  # whether the last bin is next to the first one


def drivers(record: Record, blocks: Ints) -> tuple[Driver, ...]:
    """Return all drivers that vary in the logs; parts of the season consist of whole `blocks` (days,)."""
    hour, used = record.hour, record.used
    weekday = np.asarray(record.day_number + record.dates[0].weekday(), float) % 7.0
    level = ("level", "m") if record.kind == "pool" else ("discharge", "m3/s")
    logs = (("inflow", "m3/s", record.inflow), ("outflow", "m3/s", record.outflow), (*level, record.output))
    lag = max(1, round(3600.0 / record.sample_time))
    turns = [f"{(FIRST_SHIFT + 8 * i) % 24:g} to {(FIRST_SHIFT + 8 * i + 8) % 24:g} h" for i in range(3)]

    def rate(values: Floats) -> Floats:
        """Return the change over the last hour [1/h], shape (days, n); NaN in the first hour."""
        out = np.full(values.shape, np.nan)
        out[:, lag:] = (values[:, lag:] - values[:, :-lag]) * (3600.0 / (lag * record.sample_time))
        return out

    found = [
        Driver("hour", 24, _floor(hour), lambda a, b: f"hours {a} to {b + 1}", True),
        named("shift", turns, _floor(np.mod(hour - FIRST_SHIFT, 24.0) / 8.0)),
        named("weekday", WEEKDAYS, _floor(weekday[:, None] + 0.0 * hour)),
        season(blocks, hour.shape[1]),
        *(by_size(name, unit, values, used) for name, unit, values in logs),
        *(by_size(f"rate of {name}", f"{unit} per h", rate(values), used)
          for name, unit, values in logs),
        *(since_step(f"hours since a step of the {name}", values, record.sample_time)
          for name, _, values in logs[:2]),
    ]  # fmt: skip
    return tuple(d for d in found if d is not None and len(np.unique(d.bin[used & (d.bin >= 0)])) > 1)


def named(name: str, labels: Sequence[str], bins: Ints) -> Driver:
    """Return a driver with a label for each bin of a cycle."""

    def words(first: int, last: int) -> str:
        return f"{name} {labels[first] if first == last else f'{labels[first]} to {labels[last]}'}"

    return Driver(name, len(labels), bins, words, True)


def season(block: Ints, n: int) -> Driver | None:
    """Return parts of :data:`PART_BLOCKS` blocks or more, for rows of n samples; None if only one."""
    many = int(block.max()) + 1
    parts = min(many // PART_BLOCKS, 12)
    if parts < 2:
        return None
    bins = np.repeat((block * parts // many)[:, None], n, axis=1)
    return Driver("date", parts, bins, lambda first, last: "")


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
    return between(name, unit, edges, np.where(outside, -1, inner))


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
    return between(name, "h", SINCE, bins)


def between(name: str, unit: str, edges: Sequence[float] | Floats, bins: Ints) -> Driver:
    """Return a driver with bins between edges."""

    def words(first: int, last: int) -> str:
        return f"{name} {edges[first]:.4g} to {edges[last + 1]:.4g} {unit}"

    return Driver(name, len(edges) - 1, bins, words)


def _floor(values: Floats) -> Ints:
    return np.floor(values + 1e-9).astype(np.int64)


class Scores(NamedTuple):
    """Scores that are binned."""

    score: Floats  # (days, n): s; 0 where a sample does not count
    used: Bools  # (days, n): samples that count
    block: Ints  # (days,): block of each day: 0, 1, ... without gaps


def p_values(
    scores: Scores, by: Sequence[Driver], *, draws: int = 1999, seed: int = 0
) -> tuple[Floats, float]:
    """Return p-values of the largest departure of each driver (drivers,), and that of their minimum."""
    # Signs of blocks are flipped, in the same way for all drivers. Bins of one driver are comparable, drivers
    # are not; the smallest p-value of each flip is (Westfall and Young 1993).
    signs = np.random.default_rng(seed).choice(np.array([-1.0, 1.0]), (draws, int(scores.block.max()) + 1))
    ranks = []
    for driver in by:
        S, Q = (sums(driver, a, scores.block) for a in (scores.score, scores.used))
        psi = influence(S, Q)
        root = _spread(psi)
        tested = ((Q > 0.0).sum(0) >= FEWEST) & (root > 1e-12 * np.abs(S).sum() / max(Q.sum(), 1e-300))
        flipped = np.abs(signs @ (psi[:, tested] / root[tested])).max(1, initial=0.0)
        top = float((np.abs(psi[:, tested].sum(0)) / root[tested]).max(initial=0.0))
        ranks.append(_shares(np.append(flipped, top)))
    smallest = np.min(ranks, axis=0)
    return np.array([share[-1] for share in ranks]), float(np.mean(smallest <= smallest[-1]))


def sums(driver: Driver, values: NDArray[np.generic], block: Ints) -> Floats:
    """Sum by block and bin, shape (blocks, k)."""
    k, J = driver.count, int(block.max()) + 1
    inside = driver.bin >= 0
    cell = (block[:, None] * k + driver.bin)[inside]
    return np.asarray(np.bincount(cell, np.asarray(values, float)[inside], J * k).reshape(J, k), float)


def influence(S: Floats, Q: Floats) -> Floats:
    """Compute psi, shape (blocks, k), from sums by block and bin; 0 in empty bins."""
    u = S - S.sum() / max(Q.sum(), 1e-300) * Q
    known = Q.sum(0)
    return np.where(known > 0.0, u / np.where(known > 0.0, known, 1.0) - u.sum(1)[:, None] / known.sum(), 0.0)


def _spread(psi: Floats) -> Floats:
    """Return the scale of each bin's departure (k,), from the smaller contributions of blocks (blocks, k)."""
    # It does not change with the flips, so the test stays valid, and an effect that acts in some weeks only
    # does not inflate its own scale.
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


class Place(NamedTuple):
    """Location of the largest gap."""

    where: str  # range of the driver in words; empty if it is a matter of dates
    size: float  # mean score inside minus that outside [m3/s]
    p_value: float  # corrected for all drivers and bins
    # First and last day of each period in which it acts; the whole season if no end is found.
    windows: tuple[tuple[date, date], ...]


def strongest(scores: Scores, by: Sequence[Driver], dates: Sequence[date]) -> Place | None:
    """Find the largest departure: adjacent bins of one driver, and dates; None if none is significant."""
    # With k blocks no p-value is below 2^(1 - k); at least FEWEST_BLOCKS are needed.
    each, p_value = p_values(scores, by)
    if p_value > LEVEL:
        return None
    all_days = np.ones(len(dates), bool)
    significant = [d for d, p in zip(by, each, strict=True) if p <= LEVEL]
    driver = max(significant, key=lambda d: _best_run(scores, d, all_days)[0])
    if driver.name == "date":
        where, days = "", _dates(scores, driver)
        inside = np.broadcast_to(days[:, None], scores.used.shape)
    else:
        days, first, last = _extent(scores, driver)
        where, inside = driver.words(first, last), days[:, None] & _within(driver, first, last)
    size = _mean(scores, inside) - _mean(scores, ~inside)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], days, [False]]).astype(int))).tolist()
    windows = tuple((dates[a], dates[b - 1]) for a, b in zip(ends[::2], ends[1::2], strict=True))
    return Place(where, size, p_value, windows)


def _mean(scores: Scores, chosen: Bools) -> float:
    """Return the mean score of the chosen samples that count; 0 if none does."""
    return float((scores.score * chosen).sum() / max((scores.used & chosen).sum(), 1))


def _dates(scores: Scores, driver: Driver) -> Bools:
    """Return the days (days,) of the largest departure by date."""
    cut = segment(scores.score.sum(1), scores.used.sum(1), scores.block, rest="free")
    if cut.found:
        longest = int(np.argmax(np.diff(cut.bounds)))  # the usual state is the longest one
        apart = np.abs(cut.size - cut.size[longest])
        other = apart > 2.0 * np.hypot(cut.size_se, cut.size_se[longest])
        return np.repeat(other & (np.arange(len(other)) != longest), np.diff(cut.bounds))
    _, _, first, last = _best_run(scores, driver, np.ones(len(scores.block), bool))
    return np.asarray(_within(driver, first, last).any(1))


def _extent(scores: Scores, driver: Driver) -> tuple[Bools, int, int]:
    """Return days (days,) and the first and last bin of the largest departure of a driver but the date."""
    days = np.ones(len(scores.block), bool)
    first = last = 0
    for _ in range(3):  # refine dates and hours in turn
        _, sign, first, last = _best_run(scores, driver, days)
        inside = _within(driver, first, last)
        usual = _mean(scores, ~(inside & days[:, None]))
        g = ((scores.score - usual * scores.used) * inside).sum(1)
        q = (scores.used & inside).sum(1)
        if len(np.unique(scores.block[q > 0])) < FEWEST_BLOCKS:
            break  # too few blocks for separate dates
        cut = segment(g, q, scores.block, sign=sign)
        now = cut.mask if cut.found else np.ones_like(days)
        if (now == days).all():
            break
        days = now
    return days, first, last


def _best_run(scores: Scores, driver: Driver, days: Bools) -> tuple[float, int, int, int]:
    """Return gain [nats], sign, first and last bin of the adjacent bins that differ most from the others."""
    # A run has at most half of the information: the rest of a cycle is the same run with opposite sign.
    S, Q = (sums(driver, a * days[:, None], scores.block).sum(0) for a in (scores.score, scores.used))
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


def _within(driver: Driver, first: int, last: int) -> Bools:
    b = driver.bin
    return (b >= first) & (b <= last) if first <= last else (b >= first) | ((b >= 0) & (b <= last))
