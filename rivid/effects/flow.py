"""Effects on flows and storage: inflows, releases, gain errors, leakage, storage."""

import datetime as dt
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from rivid.effects.base import HIGH, LOW, Effect, Sizes, Trial, World, quantity
from rivid.errors import ConfigError
from rivid.reach.changes import AddedFlow, Changes, Gate, Leak, Pond
from rivid.types import DAY, HOUR, Floats


class _Flow(Effect):
    """An effect on flows or storage."""

    family = "flow"


class _FlowOverDates(_Flow):
    """A flow that may have several sizes over its dates: its parameter `varies_with_date`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        key = self.varies_with_date
        value = getattr(self, key)
        if isinstance(value, tuple) and (not value or (len(value) > 1 and self.dates is None)):
            came = f"{len(value)} values without dates" if value else "no value"
            raise ConfigError(
                f"{self.name}: {key} has {came}: expected one number, or several spread over "
                "dates = [first, last]"
            )

    def flow(self, world: World) -> Floats:
        """Flow at each sample [m3/s], shape of the time grid; zero where dates and hours do not allow it.

        Several sizes are spread evenly from the start of the first date to the end of the last, with linear
        interpolation between them.
        """
        sizes: Sizes = getattr(self, self.varies_with_date)
        if not isinstance(sizes, tuple) or self.dates is None:
            size = np.full(world.time.shape, np.ravel(sizes)[0], float)
        else:
            start, end = world.day_of(self.dates[0]), world.day_of(self.dates[1]) + DAY
            size = np.interp(world.time, np.linspace(start, end, len(sizes)), sizes)
        return size * self.active(world)


class _Events(_Flow):
    """A flow in events: at given starts, or `per_day` of them are drawn."""

    columns: ClassVar[dict[str, str]]  # parameters with a value for each event, the size first; in the truth
    drawn_size: ClassVar[bool] = False  # whether the size of a drawn event is exponential, not its mean
    starts: tuple[float, ...]

    @property
    @abstractmethod
    def per_day(self) -> float:
        """Mean number of events that are drawn."""

    def __post_init__(self) -> None:
        super().__post_init__()
        starts: Any = self.starts
        if not isinstance(starts, tuple):  # of a table: one may be a number
            object.__setattr__(self, "starts", (starts,))
        for key in self.columns:
            value, n = getattr(self, key), len(self.starts)
            if isinstance(value, tuple) and len(value) != n:
                raise ConfigError(
                    f"{self.name}: {key} has {len(value)} values for {n} starts: expected one number, "
                    "or one for each start"
                )

    def events(self, world: World) -> list[dict[str, float]]:
        """The events in order: beginning [h since the first day's midnight], size [m3/s], times [h]."""
        start, size, *times = self._events(world)
        names = ("start_h", *self.columns.values())
        rows = np.stack([start / HOUR, size, *(time / HOUR for time in times)], axis=1).tolist()
        return [dict(zip(names, row, strict=True)) for row in rows]

    def _events(self, world: World) -> list[Floats]:
        """Beginning [s], size [m3/s] and times [s] of each event.

        Given starts are limited to the effect's dates and hours. Otherwise each day of the dates draws a
        Poisson number of events within the hours from a generator of its own, so that a longer record holds
        the same events and more.
        """
        values = [getattr(self, key) for key in self.columns]
        if self.starts:
            starts = HOUR * np.array(self.starts, float)
            there = self.allows(starts, world)
            size, *times = (np.broadcast_to(x, starts.shape)[there].astype(float) for x in values)
            return [starts[there], size, *(HOUR * time for time in times)]
        after, until = self.hours or (0.0, 24.0)
        width = 24.0 if (after, until) == (0.0, 24.0) else float(np.mod(until - after, 24.0))
        starts = draws = np.empty(0)
        for day in range(int(np.floor(world.time.min() / DAY)), int(np.floor(world.time.max() / DAY)) + 1):
            date = world.first_day + dt.timedelta(days=day)
            if self.dates is None or self.dates[0] <= date <= self.dates[1]:
                rng = world.rng(date.toordinal())
                at = np.sort(np.mod(after + width * rng.random(rng.poisson(self.per_day)), 24.0)) * HOUR
                starts = np.concatenate([starts, day * DAY + at])
                draws = np.concatenate([draws, rng.exponential(size=len(at))])
        size, *times = (np.full(len(starts), x, float) for x in values)
        return [starts, size * draws if self.drawn_size else size, *(HOUR * time for time in times)]


PLACE = "0 at the upstream dam, 1 at the downstream one"
QUARTERS = (0.125, 0.375, 0.625, 0.875)
"""Places from which the diagnosis seeks the true one."""
START = "when each begins, hours since the first day's midnight; none: drawn"
STEADY = (
    "Compare days of low and of high discharge held steady: a gain error grows with the flow, an inflow does "
    "not; or gauge the {} dam once."
)
SHIFTS = ((5.0, 13.0), (13.0, 21.0), (21.0, 5.0))
"""Hours of the operators' shifts [h]: a gain error of the outflow may belong to one."""


@dataclass(frozen=True, kw_only=True)
class LateralInflow(_FlowOverDates):
    """``flow at the place += inflow``.

    Several values lie evenly over the dates, the first at their beginning and the last at their end, with
    linear interpolation between them.
    """

    name = "lateral_inflow"
    varies_with_date = "inflow"
    twins = ("sensor_drift",)
    confounded_with = {
        "sensor_drift": (
            "Read the gauge against a staff or a second sensor a few days apart: a drift shows, an "
            "inflow does not."
        ),
        "inflow_gain_error": STEADY.format("upstream"),
        "outflow_gain_error": STEADY.format("downstream"),
    }
    sentence = "Water that enters along the reach and is in no log: a tributary, a spring, seepage."
    looks = (
        "The level rises more than the logs explain, day and night alike; the operators send more down "
        "than comes in. A slow drift of the gauge looks the same."
    )

    inflow: Sizes = quantity(
        2.0, "m3/s", -1e4, 1e4, "water that enters; several values spread over the dates", many=True
    )
    place: float = quantity(0.5, "-", 0.0, 1.0, PLACE)

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        return [
            cls.linear_trial("inflow", 1.0, dates="between", also=("place",), place=at) for at in QUARTERS
        ]

    def changes(self, world: World) -> Changes:
        return Changes(added=(AddedFlow(self.place, self.flow(world)),))


@dataclass(frozen=True, kw_only=True)
class DiurnalInflow(_Flow):
    """``flow at the place += amplitude cos(2 pi (hour of the day - hour) / 24 h)``."""

    name = "diurnal_inflow"
    sentence = "Water that comes and goes with the hour: snow melt, evaporation, pumping by day."
    looks = (
        "A wave of 24 h in what the logs do not explain, at the same hours on working days and Sundays; "
        "evaporation and pumping take most by day, so their maximum is at night."
    )

    amplitude: float = quantity(3.0, "m3/s", 0.0, 1e4, "half the swing over the day; the mean is zero")
    hour: float = quantity(4.0, "h", 0.0, 24.0, "hour of the day of the maximum")
    place: float = quantity(0.5, "-", 0.0, 1.0, PLACE)

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        def make(c: Floats) -> Effect:
            hour = float(np.mod(np.arctan2(c[1], c[0]) * 24.0 / (2.0 * np.pi), 24.0))
            return cls(amplitude=cls.clipped("amplitude", float(np.hypot(*c))), hour=hour)

        parts = tuple(cls(amplitude=1.0, hour=hour) for hour in (0.0, 6.0))
        return [Trial(cls.name, "24 h", parts, (1.0, 1.0), make, ("amplitude", "hour"), dates="between")]

    def changes(self, world: World) -> Changes:
        turn = 2.0 * np.pi / DAY

        def volume(t: Floats) -> Floats:
            return np.asarray(np.sin(turn * (t - 3600.0 * self.hour)) / turn)

        flow = self.amplitude * world.mean_of(volume) * self.active(world)
        return Changes(added=(AddedFlow(self.place, flow),))


@dataclass(frozen=True, kw_only=True)
class RecurringFlow(_Flow):
    """An unknown flow that returns with a period, by its waves of the period, a half and a third of it.

    It has no name: the diagnosis holds it against the effects that have one.
    """

    name = ""
    sentence = "A flow that returns every day, or with another period."
    looks = "A wave of any shape and one period in what the logs do not explain."

    waves: tuple[float, ...] = quantity(
        (20.0,) * 6, "m3/s", -1e5, 1e5, "cosine and sine of each wave over the time since midnight", many=True
    )
    period: float = quantity(24.0, "h", 0.0, 1e5, "of the longest wave")

    def changes(self, world: World) -> Changes:
        flow = np.zeros(world.time.shape)
        for k, (a, b) in enumerate(zip(self.waves[::2], self.waves[1::2], strict=True), 1):
            angle = 2.0 * np.pi * k * world.time / (HOUR * self.period)
            flow += a * np.cos(angle) + b * np.sin(angle)
        return Changes(added=(AddedFlow(0.5, flow * self.active(world)),))


@dataclass(frozen=True, kw_only=True)
class RainInflow(_Events):
    """``flow at the place += peak x shape``: a straight rise, then ``exp(-t / recession)``.

    Dates and hours say when an event may begin; its recession runs on.
    """

    name = "rain_inflow"
    found_as = "recession"
    columns = {"peak": "peak_m3s", "rise": "rise_h", "recession": "recession_h"}
    drawn_size = True
    confounded_with = {
        "unlogged_upstream_release": (
            "Compare the dates found with the rain gauge of the catchment and the upstream dam's spill book."
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

    @property
    def per_day(self) -> float:
        return self.per_month / 30.0

    @classmethod
    def from_events(cls, starts: Sequence[float], sizes: Sequence[float], duration: Sizes) -> Self:
        return cls(starts=tuple(starts), peak=tuple(sizes), rise=0.1, recession=duration)

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        return []

    def changes(self, world: World) -> Changes:
        flow = np.zeros(world.time.shape)
        for start, peak, rise, recession in zip(*self._events(world), strict=True):

            def volume(t: Floats, a: float = start, r: float = rise, k: float = recession) -> Floats:
                up, down = np.clip(t - a, 0.0, r), np.maximum(t - a - r, 0.0)
                return np.asarray(0.5 * up * up / r - k * np.expm1(-down / k))

            flow += peak * world.mean_of(volume)
        return Changes(added=(AddedFlow(self.place, flow),))


@dataclass(frozen=True, kw_only=True)
class UnloggedUpstreamRelease(_FlowOverDates):
    """``real inflow = logged inflow + size`` within dates and hours.

    Several values lie evenly over the dates, the first at their beginning and the last at their end, with
    linear interpolation between them.
    """

    name = "unlogged_upstream_release"
    repeatable = True
    varies_with_date = "size"
    confounded_with = {
        "lateral_inflow": (
            "Look up the gate and spill book of the upstream dam for these hours, or gauge below it once."
        ),
    }
    sentence = "The upstream dam lets water through besides what is logged: a bypass, a spill, a test."
    looks = (
        "On certain dates, often at certain hours, the level shows an inflow that came with the travel time "
        "of the upstream dam: a flat top, sharp ends, the same hours every day."
    )

    size: Sizes = quantity(
        20.0, "m3/s", 0.0, 1e5, "the release; several values spread over the dates", many=True
    )

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        return [cls.linear_trial("size", 10.0, dates="between", sign=1), cls.hourly_trial("up")]

    def changes(self, world: World) -> Changes:
        return Changes(added=(AddedFlow(0.0, self.flow(world)),))


@dataclass(frozen=True, kw_only=True)
class UnloggedDownstreamRelease(_Events):
    """``real outflow = logged outflow + size`` during pulses, or all through dates and hours.

    Dates and hours say when a pulse may begin; it lasts its duration.
    """

    name = "unlogged_downstream_release"
    acts_on_river = False
    repeatable = True
    found_as = "pulse"
    columns = {"size": "size_m3s", "duration": "duration_h"}
    sentence = "The downstream dam lets water through besides what is logged: a lock, a spill, a pump."
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

    @classmethod
    def from_events(cls, starts: Sequence[float], sizes: Sequence[float], duration: Sizes) -> Self:
        return cls(starts=tuple(starts), size=tuple(sizes), duration=duration)

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        return [cls.hourly_trial("down", per_day=0.0)]

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


@dataclass(frozen=True, kw_only=True)
class LeavingFlow(UnloggedDownstreamRelease):
    """An unknown flow out of the reach in pulses, at no fixed time.

    It has no name: it stands for what is unknown where no effect of the library comes in pulses.
    """

    name = ""
    sentence = "A flow that leaves now and then."
    looks = "Now and then the level falls for a while, without a cause in the logs."


@dataclass(frozen=True, kw_only=True)
class PassingFlow(LeavingFlow):
    """An unknown flow into the reach in pulses, at no fixed time: rain recedes, this does not."""

    sentence = "A flow that comes and goes."
    looks = "Now and then the level rises and falls again within hours, without a cause in the logs."

    def changes(self, world: World) -> Changes:
        (taken,) = super().changes(world).added
        return Changes(added=(AddedFlow(0.5, -taken.flow),))


@dataclass(frozen=True, kw_only=True)
class Leakage(_Flow):
    """``outflow at the place += loss (level - usual level - reference)``."""

    name = "leakage"
    acts_on_river = False
    confounded_with = {
        "gate_head_effect": (
            "Hold the level a few decimetres high and low for some hours each, once at low and once at "
            "high outflow: a leak takes the same both times, the gates more where more goes through."
        ),
    }
    sentence = "Water that is lost the faster the higher the level stands: seepage, a leaking gate."
    looks = (
        "The level falls back to its reference faster than the logs explain, from above as from below; "
        "what is always lost beside that looks like a negative lateral_inflow."
    )

    loss: float = quantity(10.0, "m3/s per m", 0.0, 1e4, "loss for each metre above the reference")
    reference: float = quantity(0.0, "m", -1.0, 1.0, "level without a loss, above the usual level")
    place: float = quantity(1.0, "-", 0.0, 1.0, PLACE)

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        # The reference is free, since otherwise a lateral inflow would be found beside it.
        free = ("place", "reference")
        return [cls.linear_trial("loss", 10.0, sign=1, also=free, place=at) for at in QUARTERS]

    def changes(self, world: World) -> Changes:
        level = world.level + self.reference
        return Changes(leaks=(Leak(self.place, self.loss * self.active(world), level),))


@dataclass(frozen=True, kw_only=True)
class _GainError(_Flow):
    """An error in proportion to a logged flow."""

    error: float = quantity(0.05, "-", -0.9, 9.0, "relative error: real flow over logged flow, less 1")

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        return [cls.linear_trial("error", 0.02, dates="between")]


@dataclass(frozen=True, kw_only=True)
class InflowGainError(_GainError):
    """``real inflow = (1 + error) logged inflow``."""

    name = "inflow_gain_error"
    confounded_with = {
        "outflow_gain_error": (
            "Gauge one of the two dams once (a current meter or ADCP at a steady flow): the operators "
            "pass on what comes in, so the logs alone cannot show which dam's figure is off."
        ),
    }
    sentence = "The upstream dam lets through more, or less, than its log holds, in proportion."
    looks = (
        "What the logs do not explain follows the inflow with the travel time; only its beginning or end "
        "distinguishes it from outflow_gain_error while the operators pass on what comes in."
    )

    def changes(self, world: World) -> Changes:
        return Changes(inflow=world.inflow * (1.0 + self.error * self.active(world)))


@dataclass(frozen=True, kw_only=True)
class OutflowGainError(_GainError):
    """``real outflow = (1 + error) logged outflow``."""

    name = "outflow_gain_error"
    acts_on_river = False
    sentence = "The downstream dam lets through more, or less, than its log holds, in proportion."
    looks = (
        "What the logs do not explain follows the outflow at once; only its beginning or end "
        "distinguishes it from inflow_gain_error while the operators pass on what comes in."
    )

    @classmethod
    def trials(cls, world: World) -> list[Trial]:  # the operators of one shift may log it, others not
        hourly = [cls.linear_trial("error", 0.02, hours=hours) for hours in SHIFTS]
        return [*super().trials(world), *hourly]

    def changes(self, world: World) -> Changes:
        return Changes(gate=Gate(factor=1.0 + self.error * self.active(world)))


@dataclass(frozen=True, kw_only=True)
class GateHeadEffect(_Flow):
    """``real outflow = (1 + gain (level - usual level - reference)) logged outflow``."""

    name = "gate_head_effect"
    acts_on_river = False
    linear_trials = {"gain": 0.05}
    trial_sign = 1
    sentence = "The downstream gates let through more the higher the level stands; the log does not show it."
    looks = (
        "What the logs do not explain grows with level times outflow: as leakage, but less at night when "
        "little is sent down. An orifice at 4 m of head has 0.12 1/m."
    )

    gain: float = quantity(0.1, "1/m", 0.0, 2.0, "relative gain of the outflow for each metre of level")
    reference: float = quantity(0.0, "m", -1.0, 1.0, "level at which the log is right, above the usual level")

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        # The reference is free, since otherwise a gain error of the outflow would be found beside it.
        return [replace(trial, free=(*trial.free, "reference")) for trial in super().trials(world)]

    def changes(self, world: World) -> Changes:
        head = self.gain * self.active(world)
        factor = 1.0 - self.reference * head
        factor = np.where(factor == 0.0, 1e-9, factor)  # no flow at the usual level
        return Changes(gate=Gate(factor=factor, head=head / factor, reference=world.level))


@dataclass(frozen=True, kw_only=True)
class StorageAreaSlope(_Flow):
    """``water surface = A (1 + slope (level - usual level))``."""

    name = "storage_area_slope"
    windowed = False
    acts_on_river = False
    linear_trials = {"slope": 0.1}
    sentence = "The water surface grows with the level: banks that slope, flats that flood."
    looks = (
        "The same surplus of inflow lifts a high level less than a low one. Sloping banks of the channel "
        "do this too: it hides in a free geometry."
    )

    slope: float = quantity(0.25, "1/m", -0.5, 2.0, "relative growth of the surface for each metre of level")

    def changes(self, world: World) -> Changes:
        return Changes(area_slope=self.slope, area_reference=world.level)


@dataclass(frozen=True, kw_only=True)
class SideStorage(_Flow):
    """``area dz/dt = exchange (level - z)``, and the reach loses what the pond gains."""

    name = "side_storage"
    acts_on_river = False
    confounded_with = {
        "storage_area_slope": (
            "Step the level and hold it for a day: side storage drains back for hours, a larger surface "
            "does not."
        ),
    }
    sentence = "Water beside the reach that fills and empties through a narrow passage: an old arm, gravel."
    looks = (
        "After a quick rise the level sinks back while in- and outflow balance, after a fall it recovers, "
        "with a time constant of area / exchange."
    )

    area: float = quantity(2e5, "m2", 1.0, 1e8, "water surface beside the reach")
    exchange: float = quantity(30.0, "m3/s per m", 0.0, 1e5, "flow for each metre of difference of level")
    place: float = quantity(0.5, "-", 0.0, 1.0, PLACE)

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        return [  # from a place far off, a fit bends the reach instead
            cls.trial_at("area", 2e5, also=("exchange", "place"), exchange=exchange, place=place)
            for place in QUARTERS
            for exchange in (20.0, 100.0)
        ]

    def changes(self, world: World) -> Changes:
        return Changes(ponds=(Pond(self.place, self.area, self.exchange * self.active(world)),))
