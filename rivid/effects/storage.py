"""What depends on the level: the gate's head, the water surface, water beside the reach."""

from dataclasses import dataclass

from rivid.effects.base import Effect, Trial, World, quantity
from rivid.effects.flow import PLACE
from rivid.reach.changes import Changes, Gate, Pond


@dataclass(frozen=True, kw_only=True)
class GateHeadEffect(Effect):
    """``real outflow = (1 + gain (level - usual level)) logged outflow``.

    Parameters
    ----------
    gain : float
        [1/m].
    """

    name = "gate_head_effect"
    family = "flow"
    acts_on_river = False
    absorbed_by_response = True
    sentence = "The downstream gates let through more the higher the level stands; the log says otherwise."
    looks = (
        "What the logs do not explain grows with level times outflow: as leakage, but less at night when "
        "little is sent down. An orifice at 4 m of head has 0.12 1/m."
    )

    gain: float = quantity(0.1, "1/m", -0.5, 2.0, "relative gain of the outflow for each metre of level")

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return [cls.linear_trial("gain", 0.05, sign=1)]

    def changes(self, world: World) -> Changes:
        return Changes(gate=Gate(head=self.gain * self.active(world), reference=world.level))


@dataclass(frozen=True, kw_only=True)
class StorageAreaSlope(Effect):
    """``water surface = A (1 + slope (level - usual level))``.

    Parameters
    ----------
    slope : float
        [1/m].
    """

    name = "storage_area_slope"
    family = "flow"
    windowed = False
    acts_on_river = False
    absorbed_by_response = True
    sentence = "The water surface grows with the level: banks that slope, flats that flood."
    looks = (
        "The same surplus of inflow lifts a high level less than a low one. Sloping banks of the channel "
        "do this too: it hides in a free geometry."
    )

    slope: float = quantity(0.25, "1/m", -0.5, 2.0, "relative growth of the surface for each metre of level")

    @classmethod
    def trials(cls, sample_time: float) -> list[Trial]:
        return [cls.linear_trial("slope", 0.1)]

    def changes(self, world: World) -> Changes:
        return Changes(area_slope=self.slope, area_reference=world.level)


@dataclass(frozen=True, kw_only=True)
class SideStorage(Effect):
    """``area dz/dt = exchange (level - z)``, and the reach loses what the pond gains.

    Parameters
    ----------
    area : float
        [m2].
    exchange : float
        [m3/s per m].
    place : float
    """

    name = "side_storage"
    family = "flow"
    acts_on_river = False
    absorbed_by_response = True
    depends_on_level = False
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
    def trials(cls, sample_time: float) -> list[Trial]:
        return [
            cls.trial_at("area", area, also=("exchange",), exchange=exchange)
            for area in (1e5, 3e5)
            for exchange in (20.0, 100.0)
        ]

    def changes(self, world: World) -> Changes:
        return Changes(ponds=(Pond(self.place, self.area, self.exchange * self.active(world)),))
