"""Flows that no log holds: water that enters or leaves beside the dams, and dams that give more or less."""

from dataclasses import dataclass

import numpy as np

from rivid.effects.base import Effect, Trial, World, quantity
from rivid.effects.slow import Sizes, over_dates, spread_over_dates
from rivid.reach.changes import AddedFlow, Changes, Gate, Leak
from rivid.types import DAY, Floats

PLACE = "0 at the upstream dam, 1 at the downstream one"
SHIFTS = ((5.0, 13.0), (13.0, 21.0), (21.0, 5.0))
"""Hours of the operators' shifts [h]: a gain error may belong to one of them."""


def _gain_trials(effect: type[Effect]) -> list[Trial]:
    return [
        effect.linear_trial("error", 0.02, dates="between"),
        *(effect.linear_trial("error", 0.02, hours=hours) for hours in SHIFTS),
    ]


@dataclass(frozen=True, kw_only=True)
class LateralInflow(Effect):
    """``flow at the place += inflow``.

    Parameters
    ----------
    inflow : float or tuple of float
        [m3/s]; several values lie evenly over the dates, the first at their beginning and the last at
        their end, with straight lines between.
    place : float
    """

    name = "lateral_inflow"
    family = "flow"
    depends_on_level = False
    varies_with_date = "inflow"
    twins = ("sensor_drift",)
    confounded_with = {
        "sensor_drift": (
            "Read the gauge against a staff or a second sensor a few days apart: a drift shows, an "
            "inflow does not."
        ),
        "inflow_gain_error": (
            "Compare days of low and of high discharge held steady: a gain error grows with the flow, "
            "an inflow does not; or gauge the upstream dam once."
        ),
        "outflow_gain_error": (
            "Compare days of low and of high discharge held steady: a gain error grows with the flow, "
            "an inflow does not; or gauge the downstream dam once."
        ),
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

    def __post_init__(self) -> None:
        super().__post_init__()
        spread_over_dates(self, "inflow")

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return [cls.linear_trial("inflow", 1.0, dates="between")]

    def changes(self, world: World) -> Changes:
        flow = over_dates(self, self.inflow, world) * self.active(world)
        return Changes(added=(AddedFlow(self.place, flow),))


@dataclass(frozen=True, kw_only=True)
class DiurnalInflow(Effect):
    """``flow at the place += amplitude cos(2 pi (hour of the day - hour) / 24 h)``.

    Parameters
    ----------
    amplitude : float
        [m3/s].
    hour : float
        [h].
    place : float
    """

    name = "diurnal_inflow"
    family = "flow"
    depends_on_level = False
    sentence = "Water that comes and goes with the hour: snow melt, evaporation, pumping by day."
    looks = (
        "A wave of 24 h in what the logs do not explain, at the same hours on working days and Sundays; "
        "evaporation and pumping take most by day, so their maximum is at night."
    )

    amplitude: float = quantity(3.0, "m3/s", 0.0, 1e4, "half the swing over the day; the mean is zero")
    hour: float = quantity(4.0, "h", 0.0, 24.0, "hour of the day of the maximum")
    place: float = quantity(0.5, "-", 0.0, 1.0, PLACE)

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
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
class Leakage(Effect):
    """``outflow at the place += loss (level - usual level)``.

    Parameters
    ----------
    loss : float
        [m3/s per m].
    place : float
    """

    name = "leakage"
    family = "flow"
    acts_on_river = False
    confounded_with = {
        "gate_head_effect": (
            "Hold the level a few decimetres high and low for some hours each, once at low and once at "
            "high outflow: a leak takes the same both times, the gates more where more goes through."
        ),
    }
    sentence = "Water that is lost the faster the higher the level stands: seepage, a leaking gate."
    looks = (
        "The level falls back to its usual height faster than the logs explain, from above as from below; "
        "the part that is always lost looks like a negative lateral_inflow."
    )

    loss: float = quantity(10.0, "m3/s per m", 0.0, 1e4, "loss for each metre above the usual level")
    place: float = quantity(1.0, "-", 0.0, 1.0, PLACE)

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return [cls.linear_trial("loss", 10.0, sign=1)]

    def changes(self, world: World) -> Changes:
        return Changes(leaks=(Leak(self.place, self.loss * self.active(world), world.level),))


@dataclass(frozen=True, kw_only=True)
class InflowGainError(Effect):
    """``real inflow = (1 + error) logged inflow``.

    Parameters
    ----------
    error : float
        [-].
    """

    name = "inflow_gain_error"
    family = "flow"
    depends_on_level = False
    confounded_with = {
        "outflow_gain_error": (
            "Gauge one of the two dams once (a current meter or ADCP at a steady flow): the operators "
            "pass on what comes in, so the logs alone cannot say which dam's figure is off."
        ),
    }
    sentence = "The upstream dam lets through more, or less, than its log says, in proportion."
    looks = (
        "What the logs do not explain follows the inflow with the travel time; only its beginning or end "
        "tells it from outflow_gain_error while the operators pass on what comes in."
    )

    error: float = quantity(0.05, "-", -0.9, 9.0, "relative error: real inflow over logged inflow, less 1")

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return _gain_trials(cls)

    def changes(self, world: World) -> Changes:
        return Changes(inflow=world.inflow * (1.0 + self.error * self.active(world)))


@dataclass(frozen=True, kw_only=True)
class OutflowGainError(Effect):
    """``real outflow = (1 + error) logged outflow``.

    Parameters
    ----------
    error : float
        [-].
    """

    name = "outflow_gain_error"
    family = "flow"
    acts_on_river = False
    depends_on_level = False
    sentence = "The downstream dam lets through more, or less, than its log says, in proportion."
    looks = (
        "What the logs do not explain follows the outflow at once; only its beginning or end tells it from "
        "inflow_gain_error while the operators pass on what comes in."
    )

    error: float = quantity(0.05, "-", -0.9, 9.0, "relative error: real outflow over logged outflow, less 1")

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return _gain_trials(cls)

    def changes(self, world: World) -> Changes:
        return Changes(gate=Gate(factor=1.0 + self.error * self.active(world)))
