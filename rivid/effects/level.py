"""Effects on the gauge reading: drift, steps, a silting well, wind set-up, seiches."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from rivid.effects.base import HIGH, LOW, Effect, Sizes, Trial, World, quantity
from rivid.errors import ConfigError
from rivid.reach.changes import Changes
from rivid.types import DAY, HOUR, Floats

Autoregression = tuple[tuple[float, ...], float]
"""a_1, or a_1 and a_2, of a stationary ``x_k = a_1 x_k-1 + a_2 x_k-2 + e_k``; standard deviation of e [m]."""


def covariance(model: Autoregression) -> Floats:
    """Variance, and with two coefficients the covariance of neighbours [m2]; by Yule and Walker."""
    coefficients, innovation = model
    if len(coefficients) == 1:
        return np.array([innovation**2 / (1.0 - coefficients[0] ** 2)])
    a1, a2 = coefficients
    variance = innovation**2 * (1.0 - a2) / ((1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1))
    return variance * np.array([1.0, a1 / (1.0 - a2)])


def draw(model: Autoregression, world: World) -> Floats:
    """A series with the law of an autoregression at the world's sample time, shape of the time grid.

    It is drawn at all multiples of the sample time between the first and the last sample. Each sample has
    the value nearest in time: within a day these are neighbours of the series, and rows that are days
    apart are that far apart in it.
    """
    from scipy.signal import lfilter

    T_s = world.sample_time
    steps = (world.time - world.time.min()) / T_s
    at = np.floor(steps + 0.4999).astype(np.intp)  # a half always goes the same way
    coefficients, innovation = model
    shocks = world.rng().standard_normal(int(at.max()) + 1 + len(coefficients))
    variance = covariance(model)
    past = np.sqrt(variance[0]) * shocks[0]
    before = [past]
    if len(coefficients) == 2:  # x_-1 given x_-2
        rho = variance[1] / variance[0] if variance[0] > 0 else 0.0
        before = [rho * past + np.sqrt(variance[0] * (1.0 - rho * rho)) * shocks[1], past]
    a = np.array(coefficients)
    # state of the filter: sum of a_j x_k-j over the values before the first
    memory = [float(a[i:] @ before[: len(a) - i]) for i in range(len(a))]
    shocks = innovation * shocks[len(a) :]
    series, _ = lfilter([1.0], np.concatenate([[1.0], -a]), shocks, zi=memory)
    return np.asarray(series[at])


class _Level(Effect):
    """An effect on the reading of the gauge."""

    family = "level"


@dataclass(frozen=True, kw_only=True)
class SensorDrift(_Level):
    """``gauge = level + drift (t - first date)`` from the first date to the last."""

    name = "sensor_drift"
    acts_on_river = False
    twins = ("lateral_inflow",)
    linear_trials = {"drift": 0.005}
    trial_dates = "between"
    set_right = True
    sentence = "The gauge drifts away from the water, until it is set right."
    looks = (
        "The level creeps the same way every day whatever flows, and the operators follow it. Within a few "
        "days a small lateral_inflow looks the same: over weeks the reading leaves its range."
    )

    drift: float = quantity(0.005, "m/day", -1.0, 1.0, "growth of the reading relative to the level")

    def changes(self, world: World) -> Changes:
        start = 0.0 if self.dates is None else world.day_of(self.dates[0])
        since = np.maximum(world.time - start, 0.0) / DAY
        return Changes(gauge=self.drift * since * self.active(world))


@dataclass(frozen=True, kw_only=True)
class SensorStep(_Level):
    """``gauge = level + the steps that have started``, within dates and hours."""

    name = "sensor_step"
    acts_on_river = False
    found_as = "jump"
    sentence = "The gauge reads too high or too low from a moment on: it was moved, knocked or set anew."
    looks = (
        "The reading jumps between two samples, which no flow can do, and stays off; the water itself "
        "moves only as the operators answer."
    )

    step: Sizes = quantity(0.05, "m", -10.0, 10.0, "what the reading is too high from each start", many=True)
    start: Sizes = quantity(
        0.0, "h", LOW, HIGH, "when each happens, hours since the first day's midnight", many=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        steps, starts = np.size(self.step), np.size(self.start)
        if steps != starts or not steps:
            raise ConfigError(
                f"{self.name}: step has {steps} values and start {starts}: expected a start for each step"
            )

    @classmethod
    def from_events(cls, starts: Sequence[float], sizes: Sequence[float], duration: Sizes) -> Self:
        return cls(step=tuple(sizes), start=tuple(starts))

    def changes(self, world: World) -> Changes:
        order = np.argsort(np.ravel(self.start))
        offset = np.cumsum(np.ravel(self.step)[order])
        started = np.searchsorted(HOUR * np.ravel(self.start)[order], world.time, side="right")
        return Changes(gauge=np.append(0.0, offset)[started] * self.active(world))


@dataclass(frozen=True, kw_only=True)
class UnsteadyGauge(SensorStep):
    """Jumps of an unknown cause, where no effect of the library jumps. It has no name."""

    name = ""


@dataclass(frozen=True, kw_only=True)
class RatingShift(_Level):
    """``read discharge = (1 + error) discharge + offset usual discharge``, within dates.

    The limits are a tenth: a larger shift of the balance is taken for water.
    """

    name = "rating_shift"
    acts_on_pool = False
    confounded_with = dict.fromkeys(
        ("inflow_gain_error", "lateral_inflow", "unlogged_upstream_release"),
        "Gauge the discharge at the lower gauge once, at low and at high flow, and compare its rating.",
    )
    sentence = (
        "The lower gauge's rating is off: its bed has shifted, or weed grows, since it was last gauged."
    )
    looks = (
        "The water balance of the two gauges shifts from a date on, at once and not with the travel time; "
        "a constant inflow and a gain error of the inflow look nearly the same."
    )

    error: float = quantity(0.02, "-", -0.1, 0.1, "read discharge over real discharge, less 1")
    offset: float = quantity(0.0, "-", -0.1, 0.1, "what it reads too high always, over the usual discharge")

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        return [
            cls.linear_trial("error", 0.02, dates="between", offset=0.0),
            cls.linear_trial("offset", 0.01, dates="between", error=0.0),
        ]

    def changes(self, world: World) -> Changes:
        active = self.active(world)
        return Changes(gauge=self.offset * world.flow * active, rating=self.error * active)


@dataclass(frozen=True, kw_only=True)
class StillingWell(_Level):
    """``lag d(reading)/dt = level - reading``, beside the lag that the gauge has always had."""

    name = "stilling_well"
    acts_on_river = False
    needs_dates = True
    sized_trials = {"lag": (60.0, 300.0, 900.0)}
    trial_dates = "between"
    confounded_with = {
        "outflow_lag": (
            "Pour water into the well and time its fall, or read a staff gauge after a step of the inflow."
        ),
    }
    sentence = "The gauge's stilling well follows the water late: its intake silts up, until it is cleaned."
    looks = (
        "From a date on every change of the level is read late, whichever dam makes it: outflow_lag and "
        "clock_offset delay one of the two."
    )

    lag: float = quantity(300.0, "s", 0.0, 86_400.0, "time constant of the well")

    def changes(self, world: World) -> Changes:
        return Changes(well=self.lag * self.active(world))


@dataclass(frozen=True, kw_only=True)
class Tide(_Level):
    """``output = output without it + two waves with periods of their own``, within dates.

    Periods are below 20 h: an outside level that returns every day looks like a flow that does.
    """

    name = "tide"
    confounded_with = {
        "seiche": "Compare the times of high water with a tide table, or with the level below the gauge.",
    }
    sentence = "A tide, or another level outside the reach that returns, moves the water at the gauge."
    looks = (
        "The output swings with one or two fixed periods, of a tide 12.42 and 12 h, as long as the record "
        "runs and whatever flows; a seiche loses its phase after some swings."
    )

    amplitude: float = quantity(0.05, "m or m3/s", 0.0, 1e4, "of the first wave")
    high: float = quantity(6.0, "h", -48.0, 48.0, "a high water of it, hours since the first day's midnight")
    period: float = quantity(12.4206, "h", 1.0, 20.0, "of it; usually half a lunar day")
    amplitude2: float = quantity(0.02, "m or m3/s", 0.0, 1e4, "of the second wave")
    high2: float = quantity(6.0, "h", -48.0, 48.0, "a high water of it, hours since the first day's midnight")
    period2: float = quantity(12.0, "h", 1.0, 20.0, "of it; usually half a day")

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        one, two = cls().period, cls().period2

        def make(c: Floats) -> Effect:
            (a, b), (a2, b2) = np.reshape(c, (2, 2)).tolist()
            turn = 2.0 * math.pi
            return cls(
                amplitude=math.hypot(a, b), high=one * math.atan2(b, a) / turn,
                amplitude2=math.hypot(a2, b2), high2=two * math.atan2(b2, a2) / turn,
            )  # fmt: skip

        unit = 0.01
        columns = tuple(make(np.where(np.arange(4) == k, unit, 0.0)) for k in range(4))
        return [Trial(cls.name, "waves", columns, (unit,) * 4, make, tuple(cls.parameters()))]

    def changes(self, world: World) -> Changes:
        hours = world.time / HOUR
        made = self.amplitude * np.cos(2.0 * np.pi * (hours - self.high) / self.period)
        made += self.amplitude2 * np.cos(2.0 * np.pi * (hours - self.high2) / self.period2)
        return Changes(gauge=made * self.active(world))


@dataclass(frozen=True, kw_only=True)
class WindSetup(_Level):
    """``gauge = level + x``, x an autoregression of first order with standard deviation `deviation`."""

    name = "wind_setup"
    acts_on_river = False
    found_as = "level noise"
    sentence = "Wind pushes the water towards the gauge or away from it."
    looks = (
        "The level wanders by some centimetres over hours and comes back, whatever flows; the volume of the "
        "reach does not change."
    )

    deviation: float = quantity(0.01, "m", 0.0, 5.0, "standard deviation of the set-up")
    correlation_time: float = quantity(3.0, "h", 0.01, 240.0, "time over which the correlation falls to 1/e")

    def autoregression(self, sample_time: float) -> Autoregression:
        """The set-up at times `sample_time` [s] apart."""
        rho = math.exp(-sample_time / (3600.0 * self.correlation_time))
        return (rho,), self.deviation * math.sqrt(1.0 - rho * rho)

    def changes(self, world: World) -> Changes:
        return Changes(gauge=draw(self.autoregression(world.sample_time), world) * self.active(world))


@dataclass(frozen=True, kw_only=True)
class Seiche(_Level):
    """``gauge = level + x``, x a damped oscillation that noise keeps alive.

    The standard deviation of x is `amplitude` over the square root of 2, as of a lasting oscillation.
    """

    name = "seiche"
    acts_on_river = False
    found_as = "swing"
    sentence = "The reach swings to and fro in its own period, set going by gates, wind and ships."
    looks = (
        "The level swings with one period, a peak in the spectrum: the narrower, the smaller the damping. "
        "Its size comes and goes; the flows need not move at all."
    )

    period: float = quantity(2700.0, "s", 10.0, 86_400.0, "time of one swing to and fro")
    damping: float = quantity(1e-4, "1/s", 1e-7, 0.1, "rate at which the swing fades by itself")
    amplitude: float = quantity(0.01, "m", 0.0, 5.0, "usual height of the swing above its middle")

    def autoregression(self, sample_time: float) -> Autoregression:
        """The swing at times `sample_time` [s] apart.

        The poles are ``exp((-damping +- 2 pi i / period) T_s)``.
        """
        r = math.exp(-self.damping * sample_time)
        a1, a2 = 2.0 * r * math.cos(2.0 * math.pi * sample_time / self.period), -r * r
        share = (1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1) / (1.0 - a2)
        return (a1, a2), self.amplitude * math.sqrt(0.5 * share)

    def changes(self, world: World) -> Changes:
        return Changes(gauge=draw(self.autoregression(world.sample_time), world) * self.active(world))


@dataclass(frozen=True, kw_only=True)
class UnknownSwing(Seiche):
    """Waves of an unknown cause, where no effect of the library swings. It has no name."""

    name = ""
