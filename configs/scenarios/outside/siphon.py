"""A user's effect: a spring that fills and empties by itself."""

from dataclasses import dataclass

import numpy as np

from rivid.effects.base import Effect, World, quantity
from rivid.reach.changes import AddedFlow, Changes


@dataclass(frozen=True, kw_only=True)
class Siphon(Effect):
    """``flow at the place += size`` for a part of each period, less its mean."""

    name = "siphon"
    family = "flow"
    sentence = "A spring behind a siphon: it runs until its cave is empty, and then waits."
    looks = "Water comes and goes by a clock of its own, with no regard to hour or flow."

    size: float = quantity(8.0, "m3/s", 0.0, 1000.0, "what runs while it runs")
    period: float = quantity(5.3, "h", 0.1, 100.0, "from one emptying to the next")
    part: float = quantity(0.4, "-", 0.05, 0.95, "of the period in which it runs")
    place: float = quantity(0.5, "-", 0.0, 1.0, "0 at the upstream dam, 1 at the downstream one")

    def changes(self, world: World) -> Changes:
        """A flow on the way."""
        turn = np.mod(world.time / (3600.0 * self.period), 1.0)
        runs = (turn < self.part) - self.part
        return Changes(added=(AddedFlow(self.place, self.size * runs * self.active(world)),))
