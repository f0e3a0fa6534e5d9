"""Water in events: rain, and what a dam lets through without writing it down."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rivid.effects.base import Effect, Trial, World, quantity
from rivid.effects.events import allowed, check_given, drawn_days, drawn_starts, each
from rivid.effects.flow import PLACE
from rivid.effects.slow import Sizes, over_dates, spread_over_dates
from rivid.reach.changes import AddedFlow, Changes
from rivid.types import HOUR, Floats

LOW, HIGH = -87_600.0, 876_000.0
"""Ten years before the first day and a hundred after it [h]."""
START = "when each begins, hours since the first day's midnight; none: drawn"


class Events(NamedTuple):
    """Arrays of shape (events,): beginning and length [s], size [m3/s]."""

    start: Floats
    size: Floats
    length: Floats


@dataclass(frozen=True, kw_only=True)
class RainInflow(Effect):
    """``flow at the place += peak x shape``: a straight rise, then ``exp(-t / recession)``.

    Dates and hours say when an event may begin; its recession runs on.

    Parameters
    ----------
    starts : tuple of float
        Beginnings [h] since the midnight of the first day; none: drawn.
    per_month : float
        Mean number of events in 30 days, where they are drawn.
    peak : float or tuple of float
        [m3/s]: of each start, of all, or the mean of exponential draws.
    rise, recession : float or tuple of float
        [h].
    place : float
    """

    name = "rain_inflow"
    family = "flow"
    depends_on_level = False
    found_as = "recession"
    confounded_with = {
        "unlogged_upstream_release": (
            "Lay the rain gauge of the catchment and the upstream dam's spill book beside the dates found."
        ),
    }
    sentence = "Rain runs into the reach: a steep rise, then a recession over hours."
    looks = (
        "Now and then the level rises over an hour or two without a cause in the logs, and the surplus "
        "fades exponentially: no flat top and no sharp end, as a release has."
    )

    starts: tuple[float, ...] = quantity((), "h", LOW, HIGH, START, many=True)
    per_month: float = quantity(5.0, "1/30 days", 0.0, 1000.0, "mean number of events, where they are drawn")
    peak: Sizes = quantity(
        8.0, "m3/s", 0.0, 1e5, "peak of each event, of all, or the mean of those drawn", many=True
    )
    rise: Sizes = quantity(1.0, "h", 0.01, 240.0, "time from the beginning to the peak", many=True)
    recession: Sizes = quantity(9.0, "h", 0.05, 2400.0, "time in which a fall by 1/e takes place", many=True)
    place: float = quantity(0.5, "-", 0.0, 1.0, PLACE)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_given(self, "peak", "rise", "recession")

    @classmethod
    def from_events(cls, starts: Sequence[float], sizes: Sequence[float], duration: float) -> "RainInflow":
        return cls(starts=tuple(starts), peak=tuple(sizes), rise=0.1, recession=duration)

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return []

    def events(self, world: World) -> list[dict[str, float]]:
        """What happens, in order: beginning [h since the first day's midnight], peak [m3/s], times [h]."""
        found, rise = self._events(world)
        return [
            {"start_h": s / HOUR, "peak_m3s": p, "rise_h": r / HOUR, "recession_h": k / HOUR}
            for s, p, k, r in zip(*(part.tolist() for part in (*found, rise)), strict=True)
        ]

    def changes(self, world: World) -> Changes:
        found, rises = self._events(world)
        flow = np.zeros(world.time.shape)
        for start, peak, recession, rise in zip(*found, rises, strict=True):

            def volume(t: Floats, a: float = start, r: float = rise, k: float = recession) -> Floats:
                up, down = np.clip(t - a, 0.0, r), np.maximum(t - a - r, 0.0)
                return np.asarray(0.5 * up * up / r - k * np.expm1(-down / k))

            flow += peak * world.mean_of(volume)
        return Changes(added=(AddedFlow(self.place, flow),))

    def _events(self, world: World) -> tuple[Events, Floats]:
        if self.starts:
            starts = HOUR * np.ravel(self.starts).astype(float)
            n = len(starts)
            kept = np.isin(np.arange(n), np.flatnonzero(allowed(self, starts, world)))
            peak, recession, rise = (each(x, n)[kept] for x in (self.peak, self.recession, self.rise))
            starts = starts[kept]
        else:
            parts = [
                (
                    midnight + (begun := drawn_starts(self, self.per_month / 30.0, rng)),
                    rng.exponential(size=len(begun)),
                )
                for midnight, rng in drawn_days(self, world)
            ]
            starts = np.concatenate([np.empty(0), *(at for at, _ in parts)])
            n = len(starts)
            peak = each(self.peak, n) * np.concatenate([np.empty(0), *(share for _, share in parts)])
            recession, rise = each(self.recession, n), each(self.rise, n)
        return Events(starts, peak, HOUR * recession), HOUR * rise


@dataclass(frozen=True, kw_only=True)
class UnloggedUpstreamRelease(Effect):
    """``real inflow = logged inflow + size`` within dates and hours.

    Parameters
    ----------
    size : float or tuple of float
        [m3/s]; several values lie evenly over the dates, the first at their beginning and the last at
        their end, with straight lines between.
    """

    name = "unlogged_upstream_release"
    family = "flow"
    depends_on_level = False
    repeatable = True
    varies_with_date = "size"
    confounded_with = {
        "lateral_inflow": (
            "Look up the gate and spill book of the upstream dam for these hours, or gauge below it once."
        ),
    }
    sentence = "The upstream dam lets water through beside what is logged: a bypass, a spill, a test."
    looks = (
        "On certain dates, often at certain hours, the level shows an inflow that came with the travel time "
        "of the upstream dam: a flat top, sharp ends, the same hours every day."
    )

    size: Sizes = quantity(
        20.0, "m3/s", 0.0, 1e5, "the release; several values spread over the dates", many=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        spread_over_dates(self, "size")

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return [cls.hourly_trial("up")]

    def changes(self, world: World) -> Changes:
        return Changes(added=(AddedFlow(0.0, over_dates(self, self.size, world) * self.active(world)),))


@dataclass(frozen=True, kw_only=True)
class UnloggedDownstreamRelease(Effect):
    """``real outflow = logged outflow + size`` during pulses, or all through dates and hours.

    Dates and hours say when a pulse may begin; it lasts its duration.

    Parameters
    ----------
    size : float or tuple of float
        [m3/s]: of each start, or of all.
    starts : tuple of float
        Beginnings of the pulses [h] since the midnight of the first day; none: see `per_day`.
    per_day : float
        Mean number of pulses drawn a day; 0 without starts is a release all through dates and hours.
    duration : float or tuple of float
        [h].
    """

    name = "unlogged_downstream_release"
    family = "flow"
    acts_on_river = False
    depends_on_level = False
    repeatable = True
    found_as = "pulse"
    sentence = "The downstream dam lets water through beside what is logged: a lock, a spill, a pump."
    looks = (
        "The level falls at once and for a short time, again and again by the same volume (a lock), or at "
        "the same hours every day (a pump, a spill), with no change of the outflow."
    )

    size: Sizes = quantity(10.0, "m3/s", 0.0, 1e5, "the release, of each start or of all", many=True)
    starts: tuple[float, ...] = quantity((), "h", LOW, HIGH, START, many=True)
    per_day: float = quantity(
        6.0, "1/day", 0.0, 1000.0, "mean number of pulses drawn; 0: all through dates and hours"
    )
    duration: Sizes = quantity(0.5, "h", 0.001, 2400.0, "how long a pulse lasts", many=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_given(self, "size", "duration")

    @classmethod
    def from_events(
        cls, starts: Sequence[float], sizes: Sequence[float], duration: float
    ) -> "UnloggedDownstreamRelease":
        return cls(starts=tuple(starts), size=tuple(sizes), duration=duration)

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return [cls.hourly_trial("down", per_day=0.0)]

    def events(self, world: World) -> list[dict[str, float]]:
        """The pulses in order: beginning [h since the first day's midnight], size [m3/s], length [h]."""
        return [
            {"start_h": s / HOUR, "size_m3s": q, "duration_h": d / HOUR}
            for s, q, d in zip(*(part.tolist() for part in self._events(world)), strict=True)
        ]

    def changes(self, world: World) -> Changes:
        flow = np.zeros(world.time.shape)
        if not self.starts and self.per_day == 0.0:
            flow += np.ravel(self.size)[0] * self.active(world)
        start, size, length = self._events(world)
        if len(start):  # all pulses at once: their volume is straight between their beginnings and ends
            knots = np.concatenate([start, start + length])
            order = np.argsort(knots)
            knots, slope = knots[order], np.cumsum(np.concatenate([size, -size])[order])
            passed = np.concatenate([[0.0], np.cumsum(slope[:-1] * np.diff(knots))])
            flow += world.mean_of(lambda t: np.interp(t, knots, passed))
        return Changes(added=(AddedFlow(1.0, -flow),))

    def _events(self, world: World) -> Events:
        if self.starts:
            starts = HOUR * np.ravel(self.starts).astype(float)
            kept = allowed(self, starts, world)
            size, duration = (each(x, len(starts))[kept] for x in (self.size, self.duration))
            return Events(starts[kept], size, HOUR * duration)
        days = drawn_days(self, world)
        starts = np.concatenate([np.empty(0), *(at + drawn_starts(self, self.per_day, r) for at, r in days)])
        return Events(starts, each(self.size, len(starts)), HOUR * each(self.duration, len(starts)))
