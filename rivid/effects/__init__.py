"""Effects that a simulation of a reach may lack, each defined once for simulation and diagnosis."""

from rivid.effects.base import FAMILIES, LEVEL_NOISES, Dates, Effect, Quantity, Trial, World, quantity
from rivid.effects.registry import CATALOGUE, build, changes_of, effect_classes, worlds_of

__all__ = [
    "CATALOGUE", "FAMILIES", "LEVEL_NOISES", "Dates", "Effect", "Quantity", "Trial", "World", "build",
    "changes_of", "effect_classes", "quantity", "worlds_of",
]  # fmt: skip
