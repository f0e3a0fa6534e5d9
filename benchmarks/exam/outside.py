"""Outsiders, which no effect of the catalogue is; three more stand in configs/scenarios/outside."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rivid.effects import Effect, World, effect_classes
from rivid.effects.base import quantity
from rivid.reach.changes import Changes
from rivid.reach.transport import held_volume, spread_flow
from rivid.types import DAY, Floats

FILES = Path(__file__).parent.parent.parent / "configs" / "scenarios" / "outside"
FREEZES, MELTS = 0.3, 0.1
"""Shares of the dates in which the ice grows and in which it breaks."""


@dataclass(frozen=True, kw_only=True)
class IceCover(Effect):
    """``real inflow(t) = spread logged inflow(t - late ice(t))``, ice from 0 to 1 and back over the dates."""

    name = "ice_cover"
    family = "timing"
    sentence = "Ice grows on the reach: waves come later and flatter, until it breaks."
    looks = "For some weeks each wave is late, the later the older the ice; one day all is as before."

    late: float = quantity(600.0, "s", 0.0, 36_000.0, "delay under the thickest ice")
    spread: float = quantity(300.0, "s", 0.0, 36_000.0, "standard deviation of the times of arrival under it")

    def ice(self, time: Floats, world: World) -> Floats:
        """Its thickness over the largest; as the root of time, as ice grows."""
        first, last = (world.day_of(date) for date in self.dates or (world.first_day, world.first_day))
        length = last + DAY - first
        grown = np.sqrt(np.clip((time - first) / (FREEZES * length), 0.0, 1.0))
        return np.asarray(grown * np.clip((last + DAY - time) / (MELTS * length), 0.0, 1.0))

    def changes(self, world: World) -> Changes:
        """On the inflow."""
        edges = world.edges
        there = self.ice(world.time, world)
        flat = spread_flow(edges, world.inflow, self.spread, world.sample_time)
        inflow = world.inflow + there * (flat - world.inflow)
        arrival = np.maximum.accumulate(edges + self.late * self.ice(edges, world))
        volume = np.interp(edges, arrival, held_volume(edges, inflow))
        volume += inflow[0] * np.minimum(edges - arrival[0], 0.0)
        return Changes(inflow=np.diff(volume) / np.diff(edges))


def classes() -> dict[str, type[Effect]]:
    """The outsiders that change flows, by name."""
    found: dict[str, type[Effect]] = {IceCover.name: IceCover}
    for path, name in (("hunting", "hunting_governor"), ("rating", "bent_rating"), ("siphon", "siphon")):
        found[name] = effect_classes(FILES / f"{path}.py")[name]
    return found
