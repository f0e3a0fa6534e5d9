"""Flows that no log holds: water that enters or leaves beside the dams, and dams that give more or less."""

from dataclasses import dataclass

import numpy as np

from rivid.effects.base import Effect, World, quantity
from rivid.effects.held import mean_of
from rivid.effects.slow import Sizes, over_dates, spread_over_dates
from rivid.reach.changes import AddedFlow, Changes, Gate, Leak
from rivid.types import DAY, Floats

PLACE = "0 at the upstream dam, 1 at the downstream one"


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
    sentence = "Water that comes and goes with the hour: snow melt, evaporation, pumping by day."
    looks = (
        "A wave of 24 h in what the logs do not explain, at the same hours on working days and Sundays; "
        "evaporation and pumping take most by day, so their maximum is at night."
    )

    amplitude: float = quantity(3.0, "m3/s", 0.0, 1e4, "half the swing over the day; the mean is zero")
    hour: float = quantity(4.0, "h", 0.0, 24.0, "hour of the day of the maximum")
    place: float = quantity(0.5, "-", 0.0, 1.0, PLACE)

    def changes(self, world: World) -> Changes:
        turn = 2.0 * np.pi / DAY

        def volume(t: Floats) -> Floats:
            return np.asarray(np.sin(turn * (t - 3600.0 * self.hour)) / turn)

        flow = self.amplitude * mean_of(volume, world) * self.active(world)
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
    sentence = "Water that is lost the faster the higher the level stands: seepage, a leaking gate."
    looks = (
        "The level falls back to its usual height faster than the logs explain, from above as from below; "
        "the part that is always lost looks like a negative lateral_inflow."
    )

    loss: float = quantity(10.0, "m3/s per m", 0.0, 1e4, "loss for each metre above the usual level")
    place: float = quantity(1.0, "-", 0.0, 1.0, PLACE)

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
    sentence = "The upstream dam lets through more, or less, than its log says, in proportion."
    looks = (
        "What the logs do not explain follows the inflow with the travel time; only its beginning or end "
        "tells it from outflow_gain_error while the operators pass on what comes in."
    )

    error: float = quantity(0.05, "-", -0.9, 9.0, "relative error: real inflow over logged inflow, less 1")

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
    sentence = "The downstream dam lets through more, or less, than its log says, in proportion."
    looks = (
        "What the logs do not explain follows the outflow at once; only its beginning or end tells it from "
        "inflow_gain_error while the operators pass on what comes in."
    )

    error: float = quantity(0.05, "-", -0.9, 9.0, "relative error: real outflow over logged outflow, less 1")

    def changes(self, world: World) -> Changes:
        return Changes(gate=Gate(factor=1.0 + self.error * self.active(world)))
