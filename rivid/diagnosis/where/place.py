"""The place where a gap stands out most, in words: hours, flows or weekdays, a size, and dates."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from rivid.diagnosis.search.segments import FEWEST_BLOCKS, segment
from rivid.diagnosis.where.bins import Bins, Map, Scores, Tables, as_scores, hour_map, sums, tables
from rivid.diagnosis.where.drivers import Driver, drivers, in_words
from rivid.types import Bools

__all__ = [
    "Bins", "Driver", "Map", "Place", "Scores", "Tables", "as_scores", "drivers", "hour_map", "strongest",
    "tables",
]  # fmt: skip


@dataclass(frozen=True)
class Place:
    """Where a gap is largest.

    Attributes
    ----------
    driver : str
    low, high : float
        Range of the driver [its unit]; low >= high goes past midnight or Sunday. Of dates, see `windows`.
    size, size_se : float
        There, less elsewhere [unit of the effect], and its standard error by blocks.
    p_value : float
        All drivers and bins counted.
    windows : tuple of (date, date)
        First and last day of each time in which it is there; the whole season if no end is seen.
    text : str
        The same in words.
    """

    driver: str
    low: float
    high: float
    size: float
    size_se: float
    p_value: float
    windows: tuple[tuple[date, date], ...]
    text: str


def strongest(
    scores: Scores, by: Sequence[Driver], dates: Sequence[date], *, unit: str = "m3/s", level: float = 0.05,
    cut_level: float = 0.01, draws: int = 1999, seed: int = 0,
) -> Place | None:  # fmt: skip
    """The place that stands out most: neighbouring bins of one driver, and the dates; None if none does.

    Parameters
    ----------
    scores : Scores
    by : sequence of Driver
    dates : sequence of date, length days
    unit : str
        Of a size.
    level : float
        For the largest bin of all drivers. What is there in k blocks only has no p under 2^(1 - k).
    cut_level : float
        For the dates.
    draws, seed : int
        As for :func:`tables`.
    """
    told = tables(scores, by, draws=draws, resamples=2, seed=seed)
    loud = [d for d, t in zip(by, told.bins, strict=True) if t.p_value <= level]
    if told.p_value > level or not loud:
        return None
    all_days = np.ones(len(dates), bool)
    driver = max(loud, key=lambda d: _best_run(scores, d, all_days)[0])
    days, first, last = _extent(scores, driver, cut_level, seed)
    where = days[:, None] & (_between(driver, first, last) | (driver.name == "date"))
    two = Driver("two", "", np.arange(3.0), ("out", "in"), where.astype(np.int64))
    S, Q = (sums(two, a, scores.block) for a in (scores.score, scores.information))
    size = S.sum(0) / np.maximum(Q.sum(0), 1e-300)
    error = (S - size * Q) / np.maximum(Q.sum(0), 1e-300)
    value, se = float(size[1] - size[0]), float(np.sqrt(((error[:, 1] - error[:, 0]) ** 2).sum()))
    ends = np.flatnonzero(np.diff(np.concatenate([[False], days, [False]]).astype(int))).tolist()
    windows = tuple((dates[a], dates[b - 1]) for a, b in zip(ends[::2], ends[1::2], strict=True))
    text = f"{_range(driver, first, last)}{value:.3g} {unit}, {_when(windows, bool(days.all()))}"
    low, high = float(driver.edges[first]), float(driver.edges[last + 1])
    return Place(driver.name, low, high, value, se, told.p_value, windows, text)


def _extent(scores: Scores, driver: Driver, level: float, seed: int) -> tuple[Bools, int, int]:
    """Days (days,), and the first and last bin, of what stands out most."""
    days = np.ones(len(scores.block), bool)
    if driver.name == "date":
        q = scores.information.sum(1)
        cut = segment(scores.score.sum(1), q, scores.block, rest="free", level=level, seed=seed)
        if cut.found:
            longest = int(np.argmax(np.diff(cut.bounds)))  # the usual state is the one that lasts
            apart = np.abs(cut.size - cut.size[longest])
            other = apart > 2.0 * np.hypot(cut.size_se, cut.size_se[longest])
            return np.repeat(other & (np.arange(len(other)) != longest), np.diff(cut.bounds)), 0, 0
        _, _, first, last = _best_run(scores, driver, days)
        return np.asarray(_between(driver, first, last).any(1)), first, last
    first = last = 0
    for _ in range(3):  # the hours sharpen the dates, and the dates the hours
        _, sign, first, last = _best_run(scores, driver, days)
        inside = _between(driver, first, last)
        rest = ~(inside & days[:, None])
        usual = (scores.score * rest).sum() / max((scores.information * rest).sum(), 1e-300)
        g = ((scores.score - usual * scores.information) * inside).sum(1)
        q = (scores.information * inside).sum(1)
        if len(np.unique(scores.block[q > 0.0])) < FEWEST_BLOCKS:
            break  # on too few days for dates of their own
        cut = segment(g, q, scores.block, sign=sign, level=level, seed=seed)
        now = cut.mask if cut.found else np.ones_like(days)
        if (now == days).all():
            break
        days = now
    return days, first, last


def _best_run(scores: Scores, driver: Driver, days: Bools) -> tuple[float, int, int, int]:
    """Gain [nats], sign, first and last bin of the neighbours that differ most from the rest of some days.

    No more than half the information: the rest of a cycle would otherwise be the same run, with a minus.
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


def _range(driver: Driver, first: int, last: int) -> str:
    low, high = driver.edges[first], driver.edges[last + 1]
    if driver.name == "date":
        return ""
    if driver.name == "hour":
        return f"hours {low:g} to {high:g}, "
    if driver.name in ("weekday", "shift"):
        names = driver.labels[first], driver.labels[last]
        return f"{driver.name} {names[0] if first == last else ' to '.join(names)}, "
    return f"{driver.name} {low:.4g} to {high:.4g} {driver.unit}, "


def _when(windows: Sequence[tuple[date, date]], whole: bool) -> str:
    if whole:
        return "on all days"
    spans = [f"from {in_words(a)} to {in_words(b)}" for a, b in windows]
    if len(spans) > 3:
        spans = [f"at {len(spans)} times from {in_words(windows[0][0])} to {in_words(windows[-1][1])}"]
    return f"on days {' and '.join(spans)}"
