"""A user's effect: a governor that hunts about its command."""

from dataclasses import dataclass

import numpy as np

from rivid.effects.base import Effect, World, quantity
from rivid.reach.changes import AddedFlow, Changes


@dataclass(frozen=True, kw_only=True)
class HuntingGovernor(Effect):
    """``real outflow = logged outflow + amplitude sin(2 pi t / period)``."""

    name = "hunting_governor"
    family = "flow"
    sentence = "The governor downstream hunts: the outflow swings about its command."
    looks = "A regular swing of the level with a period of minutes to an hour, day and night."

    amplitude: float = quantity(6.0, "m3/s", 0.0, 1000.0, "half the swing of the outflow")
    period: float = quantity(2400.0, "s", 300.0, 14_400.0, "time of one swing")

    def changes(self, world: World) -> Changes:
        """A flow at the dam, out and in."""
        swing = np.sin(2.0 * np.pi * world.time / self.period)
        return Changes(added=(AddedFlow(1.0, -self.amplitude * swing * self.active(world)),))
