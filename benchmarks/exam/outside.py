"""Outsiders: effects that are not in the catalogue."""

from pathlib import Path

from rivid.effects import Effect, effect_classes

FILES = Path(__file__).parent.parent.parent / "configs" / "scenarios" / "outside"


def classes() -> dict[str, type[Effect]]:
    """Return the outsiders that change flows, by name."""
    files = {"hunting_governor": "hunting", "bent_rating": "rating", "siphon": "siphon"}
    return {name: effect_classes(FILES / f"{file}.py")[name] for name, file in files.items()}
