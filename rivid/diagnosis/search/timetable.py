"""Do events keep a timetable, and are they alike? What tells a lock from rain, and what can be foreseen."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rivid.diagnosis.search.events import Event
from rivid.types import DAY, Floats, Ints

WITHIN = 1800.0
"""Two starts are at the same hour if they are no further apart by the clock [s]."""


@dataclass(frozen=True, eq=False)
class Timetable:
    """Hours at which events start.

    Attributes
    ----------
    counts : ndarray of int, shape (24,)
        Starts in each hour of the day.
    hours : tuple of float
        Hours at which many start, busiest first [h].
    share : float
        Share of the starts that are at one of `hours`.
    p_value : float
        Of as many pairs of starts at the same hour, were they anywhere; 1 with events of one day only.
    """

    counts: Ints
    hours: tuple[float, ...]
    share: float
    p_value: float


@dataclass(frozen=True)
class Sizes:
    """How alike events are.

    Attributes
    ----------
    median : float
        [m3/s]
    variation : float
        Coefficient of variation [-], without what the standard errors explain; NaN for fewer than two.
    raw_variation : float
        With it.
    """

    median: float
    variation: float
    raw_variation: float


def timetable(
    events: Sequence[Event], *, within: float = WITHIN, draws: int = 999, seed: int = 0
) -> Timetable:
    """Whether starts agree by the clock, against as many at random.

    Parameters
    ----------
    events : sequence of Event
        Those under way at the start of a row do not count.
    within : float
        Largest distance of two starts at the same hour [s].
    draws, seed : int
        Timetables at random.
    """
    counted = [e for e in events if not e.under_way]
    starts = np.array([e.start_s % DAY for e in counted])
    days = np.array([e.day for e in counted])
    counts = np.bincount((starts // 3600.0).astype(int), minlength=24).astype(np.int64)
    if len(np.unique(days)) < 2:
        return Timetable(counts, (), 0.0, 1.0)
    observed = _agreeing(starts[None], within)[0]
    by_chance = np.random.default_rng(seed).uniform(0.0, DAY, (draws, len(starts)))
    p = float((1 + (_agreeing(by_chance, within) >= observed).sum()) / (1 + draws))
    hours, left = [], np.ones(len(starts), bool)
    while left.any():
        near = (_apart(starts[:, None], starts) <= within) & left
        busiest = int(np.argmax(near.sum(1)))
        members = near[busiest]
        if members.sum() < max(3, 0.15 * len(starts)):
            break
        turn = (starts[members] - starts[busiest] + DAY / 2) % DAY - DAY / 2
        hours.append(float((starts[busiest] + np.median(turn)) % DAY / 3600.0))
        left &= ~members
    return Timetable(counts, tuple(hours), float(1.0 - left.mean()), p)


def sizes(events: Sequence[Event]) -> Sizes:
    """Median size of events, and how much sizes differ beyond their standard errors."""
    a = np.array([e.size for e in events])
    if len(a) < 2:
        return Sizes(float(a[0]) if len(a) else float("nan"), float("nan"), float("nan"))
    variance, mean = float(a.var(ddof=1)), abs(float(a.mean()))
    own = max(variance - float(np.mean([e.size_se**2 for e in events])), 0.0)
    scale = max(mean, 1e-300)
    return Sizes(float(np.median(a)), float(np.sqrt(own) / scale), float(np.sqrt(variance) / scale))


def _apart(a: Floats, b: Floats) -> Floats:
    """Distance by the clock [s]."""
    d = np.abs(a - b)
    return np.asarray(np.minimum(d, DAY - d), float)


def _agreeing(starts: Floats, within: float) -> Ints:
    """Pairs of starts up to about `within` apart by the clock, on a ring of bins; starts (draws, events)."""
    ring = max(round(DAY / (within / 3.0)), 8)
    bins = np.minimum((starts * (ring / DAY)).astype(np.int64), ring - 1)
    cell = bins + ring * np.arange(len(starts))[:, None]
    counts = np.bincount(cell.ravel(), minlength=ring * len(starts)).reshape(len(starts), ring)
    near = sum(np.roll(counts, shift, axis=1) for shift in range(-3, 4))
    return np.asarray((counts * near).sum(1), np.int64)
