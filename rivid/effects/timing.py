"""Effects on timing: travel time, attenuation, clocks, and the gate's drive."""

from dataclasses import dataclass

import numpy as np

from rivid.effects.base import Effect, Trial, World, quantity
from rivid.reach.changes import Changes, Gate
from rivid.reach.transport import arrived_volume, delayed_flow, held_volume, spread_flow
from rivid.types import DAY, HOUR, Floats

LAYERS = 64
"""Layers of the flow's range that :class:`FlowDependentDelay` delays one by one."""


class _Timing(Effect):
    """An effect on when flows are real."""

    family = "timing"


@dataclass(frozen=True, kw_only=True)
class FlowDependentDelay(_Timing):
    """``a flow Q comes delay (Q - reference x usual flow) later``.

    The inflow is cut into thin layers of flow, each with its own delay: extremes and volume are kept, while
    a rise becomes steeper (`delay` negative) or flatter.
    """

    name = "flow_dependent_delay"
    windowed = False
    held_by = {"reference": "delay"}
    sentence = "High water travels faster, or slower, than low water; the fitted delay is the usual flow's."
    looks = (
        "At high flow the level moves before its time, at low flow after it (delay below zero; above zero "
        "the other way round): errors at each step of the inflow that change sign with the discharge."
    )

    delay: float = quantity(
        -0.5, "s per m3/s", -100.0, 100.0,
        "change of the travel time with the flow; below 0: faster at high flow",
    )  # fmt: skip
    reference: float = quantity(
        1.0, "-", 0.0, 2.0, "flow with the travel time of the simulation, over the usual flow"
    )

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        swing = max(float(np.quantile(np.abs(world.inflow - world.flow), 0.9)), 1e-9)
        late = (-0.5, 0.5, -1.5, 1.5, -4.0, 4.0, -10.0, 10.0)  # fronts of such a flow, in samples
        sizes = dict.fromkeys(cls.clipped("delay", samples * world.sample_time / swing) for samples in late)
        # The reference is free, since otherwise a channel would change its length for it.
        return [cls.trial_at("delay", size, also=("reference",)) for size in sizes]

    def changes(self, world: World) -> Changes:
        low, high = float(world.inflow.min()), float(world.inflow.max())
        reference = self.reference * world.flow
        levels = np.linspace(low, high, LAYERS + 1)
        real = np.full(world.inflow.shape, low)
        for bottom, top in zip(levels[:-1], levels[1:], strict=True):
            layer = np.clip(world.inflow, bottom, top) - bottom
            real += delayed_flow(world.edges, layer, self.delay * (0.5 * (bottom + top) - reference))
        return Changes(inflow=real)


@dataclass(frozen=True, kw_only=True)
class WaveAttenuation(_Timing):
    """``real inflow(t) = mean of logged inflow(t - spread X)``, X standard normal."""

    name = "wave_attenuation"
    sized_trials = {"spread": (300.0, 900.0)}
    windowed = False
    sentence = "Waves flatten on their way: a step of the inflow arrives spread out, its middle on time."
    looks = (
        "Around each arrival the level moves a little before its time and is a little late after it; the "
        "errors cancel over some times the spread."
    )

    spread: float = quantity(600.0, "s", 0.0, 21_600.0, "standard deviation of the times of arrival")

    def changes(self, world: World) -> Changes:
        return Changes(inflow=spread_flow(world.edges, world.inflow, self.spread))


@dataclass(frozen=True, kw_only=True)
class OutflowLag(_Timing):
    """``lag d(real outflow)/dt = logged outflow - real outflow``."""

    name = "outflow_lag"
    trial_dates = "between"
    sized_trials = {"lag": (200.0, 600.0, 1500.0)}
    acts_on_river = False
    confounded_with = {
        "clock_offset": (
            "Compare the clocks of both logs, or log one outflow step at the gate itself with seconds."
        ),
        "gate_rate_limit": (
            "Make one small and one large step of the outflow: a lag takes the same time for both, a "
            "slow gate longer for the large one."
        ),
    }
    sentence = "The real outflow follows its command with a lag: slow gates, turbines that run up."
    looks = (
        "After each change of the outflow the level moves late, by the lag times the change of volume; a "
        "delay that is a little off looks the same while the operators pass on what comes in."
    )

    lag: float = quantity(300.0, "s", 0.0, 21_600.0, "time constant of the outflow")

    def changes(self, world: World) -> Changes:
        return Changes(gate=Gate(lag=self.lag * self.active(world)))


ZONES = 14.0 * HOUR  # the largest offset of a local time from UTC


@dataclass(frozen=True, kw_only=True)
class ClockOffset(_Timing):
    """``real inflow(t) = logged inflow(t + offset + drift (t - first date))``."""

    name = "clock_offset"
    needs_dates = True
    sentence = "The clock of the upstream log is wrong, often from a date on: daylight saving, a restart."
    looks = (
        "From one day to the next every inflow arrives earlier (offset above zero: that clock is fast) or "
        "later by the same time; without a beginning or end it is part of the delay itself."
    )

    offset: float = quantity(600.0, "s", -ZONES, ZONES, "how far the clock of the inflow's log is fast")
    drift: float = quantity(0.0, "s/day", -3600.0, 3600.0, "what it gains a day from the first date on")

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        # Where flows come in pulses, what half an offset leaves is worse than nothing: sizes are a factor of
        # 2 apart, and each holds half-way to the next.
        late = dict.fromkeys([*(k * world.sample_time for k in (1.0, 2.0, 4.0, 8.0, 16.0)), HOUR])
        return [
            cls.trial_at("offset", sign * size, dates="between", within=1.5)
            for size in late
            for sign in (-1, 1)
            if size <= ZONES
        ]

    def changes(self, world: World) -> Changes:
        if self.drift == 0.0:
            late = delayed_flow(world.edges, world.inflow, -self.offset)
        else:  # by volumes: a drift of 10 s a day makes them 1e-4 larger
            start = 0.0 if self.dates is None else world.day_of(self.dates[0])
            edges, flow = world.edges, world.inflow
            at = edges + self.offset + self.drift * np.maximum(edges - start, 0.0) / DAY
            volume = arrived_volume(at, edges, held_volume(edges, flow), flow[..., 0], flow[..., -1])
            late = np.diff(volume, axis=-1) / np.diff(edges, axis=-1)
        return Changes(inflow=np.where(self.active(world) > 0, late, world.inflow))


@dataclass(frozen=True, kw_only=True)
class IceCover(_Timing):
    """``real inflow(t) = spread of logged inflow(t - late cover(t))``, `cover` from 0 to 1 and back to 0.

    The cover grows with the root of time over the first `growth` days of the dates, as the ice of a constant
    frost does (Stefan 1891), and goes in a straight line over the last `breakup` days.
    """

    name = "ice_cover"
    needs_dates = True
    confounded_with = {
        "clock_offset": (
            "Compare the clock of the upstream log with a reference while the waves are late, or look at the "
            "water: ice or weed is seen."
        ),
    }
    sentence = "Ice or weed roughens the reach for some weeks: waves come later and flatter."
    looks = (
        "For some weeks each wave is late, the later the thicker the cover, and flatter than before; a "
        "clock_offset makes it late by the same time from one sample to the next, and as steep as before."
    )

    late: float = quantity(600.0, "s", 0.0, 86_400.0, "delay under the full cover")
    spread: float = quantity(
        0.5, "-", 0.0, 1.0, "standard deviation of the times of arrival, over their delay"
    )
    growth: float = quantity(7.0, "days", 1.0, 366.0, "time in which the cover grows")
    breakup: float = quantity(2.0, "days", 1.0, 366.0, "time in which it goes")

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        also = ("spread", "growth")
        return [
            cls.trial_at("late", samples * world.sample_time, dates="between", also=also)
            for samples in (1.0, 4.0, 16.0)
        ]

    @property
    def degenerate(self) -> bool:
        # Waves late by the same time from one day to the next, and as steep, show a wrong clock; waves that
        # are spread by all of their delay another cause.
        return self.spread in (0.0, 1.0) or self.growth == 1.0

    def cover(self, time: Floats, world: World) -> Floats:
        """Share of the full cover at times [s]; shape of `time`."""
        if self.dates is None:
            return np.ones(time.shape)
        first, last = (world.day_of(date) / DAY for date in self.dates)
        days = time / DAY
        grown = np.sqrt(np.clip((days - first) / self.growth, 0.0, 1.0))
        return np.asarray(grown * np.clip((last + 1.0 - days) / self.breakup, 0.0, 1.0))

    def changes(self, world: World) -> Changes:
        edges = world.edges
        covered = self.cover(world.time, world) * world.inflow
        flat = spread_flow(edges, covered, self.spread * self.late)
        inflow = world.inflow - covered + flat
        # A wave that has overtaken another one arrives with it.
        arrival = np.maximum.accumulate(edges + self.late * self.cover(edges, world), axis=-1)
        volume = arrived_volume(edges, arrival, held_volume(edges, inflow), inflow[..., 0], inflow[..., -1])
        late = np.diff(volume, axis=-1) / np.diff(edges, axis=-1)
        return Changes(inflow=np.where(self.active(world) > 0, late, world.inflow))


@dataclass(frozen=True, kw_only=True)
class GateDeadband(_Timing):
    """``the gate stays where it is while |command - gate| < band``."""

    name = "gate_deadband"
    trial_dates = "between"
    sized_trials = {"band": (3.0, 8.0)}
    acts_on_river = False
    stepwise = ("band",)
    sentence = "Small changes of the outflow are logged, but the gate does not move for them."
    looks = (
        "After small changes of the outflow, and only after these, the level drifts as if nothing had been "
        "changed, until a larger change comes."
    )

    band: float = quantity(4.0, "m3/s", 0.0, 1e4, "changes smaller than this are not carried out")

    def changes(self, world: World) -> Changes:
        band = self.band * self.active(world)
        return Changes(gate=Gate(dead_band=band, start=_rested(world.earlier, band)))


def _rested(earlier: Floats | None, band: Floats) -> Floats:
    """Return the position, shape (days, 1) [m3/s], in which earlier commands left a gate with a dead-band."""
    if earlier is None:
        return np.full(1, np.inf)
    position, within = earlier[:, 0], np.broadcast_to(band, (len(earlier), band.shape[-1]))[:, 0]
    for command in earlier.T[1:]:
        position = np.where(np.abs(command - position) >= within, command, position)
    return position[:, None]


@dataclass(frozen=True, kw_only=True)
class GateRateLimit(_Timing):
    """``|d gate / dt| <= rate``."""

    name = "gate_rate_limit"
    trial_dates = "between"
    sized_trials = {"rate": (0.02, 0.08)}
    acts_on_river = False
    sentence = "The gate moves no faster than its drive allows, while the log holds the command at once."
    looks = (
        "After large changes of the outflow the level moves late, the later the larger the change; small "
        "changes are on time. That distinguishes it from outflow_lag."
    )

    rate: float = quantity(0.05, "m3/s per s", 1e-5, 1e4, "fastest change of the outflow")

    def changes(self, world: World) -> Changes:
        return Changes(gate=Gate(rate=np.where(self.active(world) > 0, self.rate, np.inf)))
