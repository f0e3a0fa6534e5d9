"""Measurement or gate operation that separates effects which the data cannot separate."""

from collections.abc import Iterable

from rivid.effects import Effect

USUAL: dict[str, str] = {
    "flow": (
        "Gauge the flow below each dam once during the hours found, and look into the gate books for them."
    ),
    "timing": "Compare the clocks of both logs and log one step of each gate with seconds.",
    "level": "Read the gauge against a staff or a second sensor.",
}
"""By family, for effects whose classes name no measurement."""


def breaker(effect: type[Effect] | Effect, tied: Iterable[type[Effect]]) -> str | None:
    """Measurement that separates an effect from those it is tied with; None where nothing is tied."""
    others = tuple(tied)
    if not others:
        return None
    for other in others:
        text = effect.confounded_with.get(other.name) or other.confounded_with.get(effect.name)
        if text:
            return text
    return USUAL[effect.family]
