"""Sizes that vary slowly with the date."""

import numpy as np

from rivid.effects.base import Effect, World
from rivid.errors import ConfigError
from rivid.types import DAY, Floats

Sizes = float | tuple[float, ...]


def spread_over_dates(effect: Effect, key: str) -> None:
    """Check that a parameter of several values has dates to lie over.

    Raises
    ------
    ConfigError
        Where it has none, or no value.
    """
    value = getattr(effect, key)
    if isinstance(value, tuple) and (not value or (len(value) > 1 and effect.dates is None)):
        came = f"{len(value)} values without dates" if value else "no value"
        raise ConfigError(
            f"{effect.name}: {key} has {came}: expected one number, or several spread over "
            "dates = [first, last]"
        )


def over_dates(effect: Effect, sizes: Sizes, world: World) -> Floats:
    """Size at each sample, shape of the time grid.

    Several sizes lie evenly from the beginning of the first date to the end of the last, with straight
    lines between.
    """
    if not isinstance(sizes, tuple) or effect.dates is None:
        return np.full(world.time.shape, np.ravel(sizes)[0], float)
    start, end = world.day_of(effect.dates[0]), world.day_of(effect.dates[1]) + DAY
    return np.asarray(np.interp(world.time, np.linspace(start, end, len(sizes)), sizes))
