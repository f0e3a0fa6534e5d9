"""A user's effect: the rating of the downstream dam is bent."""

from dataclasses import dataclass

from rivid.effects.base import Effect, World, quantity
from rivid.reach.changes import AddedFlow, Changes


@dataclass(frozen=True, kw_only=True)
class BentRating(Effect):
    """``real inflow = logged inflow + bend (logged inflow - usual flow)^2 / usual flow - its mean``."""

    name = "bent_rating"
    family = "flow"
    sentence = "The rating of the upstream dam is bent: right at usual flow, too low above and below it."
    looks = "More comes in than is logged at high and at low flow, less in between."

    bend: float = quantity(0.2, "-", -5.0, 5.0, "relative error where the flow is twice the usual one")

    def changes(self, world: World) -> Changes:
        """A flow at the upstream dam."""
        extra = self.bend * (world.inflow - world.flow) ** 2 / world.flow
        return Changes(added=(AddedFlow(0.0, extra - extra.mean()),))
