"""Effects: what a simulation of a reach may lack, each defined once for simulation and diagnosis."""

from rivid.effects.base import FAMILIES, Effect, Quantity, World, quantity
from rivid.effects.registry import CATALOGUE, build, changes_of, effect_classes, worlds_of
from rivid.effects.series import Autoregression

__all__ = [
    "CATALOGUE",
    "FAMILIES",
    "Autoregression",
    "Effect",
    "Quantity",
    "World",
    "build",
    "changes_of",
    "effect_classes",
    "quantity",
    "worlds_of",
]
