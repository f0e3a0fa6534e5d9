"""Events: when they begin, given or drawn day by day."""

import datetime as dt
from typing import Any

import numpy as np

from rivid.effects.base import Effect, World
from rivid.effects.slow import Sizes
from rivid.errors import ConfigError
from rivid.types import DAY, HOUR, Floats


def each(sizes: Sizes, n: int) -> Floats:
    """A value for each of n events."""
    return np.array(np.broadcast_to(np.asarray(sizes, float), (n,)))


def check_given(effect: Effect, *keys: str) -> None:
    """Check that parameters of several values have one for each of the effect's `starts`.

    Raises
    ------
    ConfigError
        Where they have not.
    """
    starts: Any = getattr(effect, "starts")  # noqa: B009 - of the subclasses that call this
    n = np.size(starts)
    for key in keys:
        value = getattr(effect, key)
        if isinstance(value, tuple) and len(value) != n:
            raise ConfigError(
                f"{effect.name}: {key} has {len(value)} values for {n} starts: expected one number, "
                "or one for each start"
            )


def allowed(effect: Effect, starts: Floats, world: World) -> Floats:
    """Those of the starts [s] that the effect's dates and hours allow."""
    there = np.ones(starts.shape, bool)
    if effect.dates is not None:
        first, last = (world.day_of(date) for date in effect.dates)
        there &= (starts >= first) & (starts < last + DAY)
    if effect.hours is not None:
        since = np.mod(starts / HOUR - effect.hours[0], 24.0)
        there &= since < _width(effect)
    return there


def drawn_days(effect: Effect, world: World) -> list[tuple[float, np.random.Generator]]:
    """Midnight [s] and generator of each day of the record that the effect's dates allow.

    A day has a generator of its own, so that a longer record holds the same events and more.
    """
    first = int(np.floor(world.time.min() / DAY))
    last = int(np.floor(world.time.max() / DAY))
    days = []
    for day in range(first, last + 1):
        date = world.first_day + dt.timedelta(days=day)
        if effect.dates is None or effect.dates[0] <= date <= effect.dates[1]:
            days.append((day * DAY, world.rng(date.toordinal())))
    return days


def drawn_starts(effect: Effect, per_day: float, rng: np.random.Generator) -> Floats:
    """Times after midnight [s] of the events of a day: as many as a Poisson draw says, within its hours."""
    first = 0.0 if effect.hours is None else effect.hours[0]
    at = first + _width(effect) * rng.random(rng.poisson(per_day))
    return np.sort(np.mod(at, 24.0)) * HOUR


def _width(effect: Effect) -> float:
    """Length of the effect's hours [h]."""
    if effect.hours is None or effect.hours == (0, 24):
        return 24.0
    return float(np.mod(effect.hours[1] - effect.hours[0], 24.0))
