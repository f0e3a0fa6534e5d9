"""A clock that goes wrong a little more every day."""

import datetime as dt

import numpy as np

from rivid.check.agree import MOST_PAIRED, slope_of, whose
from rivid.check.findings import Finding, hours
from rivid.check.fit import Fit
from rivid.check.record import Record
from rivid.types import Floats

LEAST = {"pool": 20 * 60.0, "river": 90 * 60.0}
"""A clock that drifts by less over the record is not told of [s]: the delay of a river changes by itself."""
STRAIGHT = 4.0
"""How many times the lags' scatter about a straight line the drift is."""
FEWEST = 6
"""Days that a line needs."""


def drift(record: Record, told: dict[dt.date, Fit]) -> list[Finding]:
    """A clock that goes wrong a little more every day."""
    if len(told) < FEWEST:
        return []
    days = np.array([date.toordinal() for date in told], float)
    span = float(np.ptp(days))
    changes = []
    for lags in ([f.lag_in for f in told.values()], [f.lag_out for f in told.values()]):
        values = np.array(lags)
        slope, rest, jump = _line(days, values)
        straight = STRAIGHT * rest < abs(slope) * span and rest < jump
        changes.append(slope * span if straight and abs(slope) * span >= LEAST["pool"] else 0.0)
    if not any(changes):
        return []
    column, late = whose(record, *changes)
    if not column or abs(late) < LEAST[record.reach.kind]:
        return []
    first, last = min(told), max(told)
    faster = "fast" if late > 0 else "slow"
    text = (
        f"the clock of {column} goes {faster}: by {hours(abs(late))} from {first} to {last}, "
        f"{abs(late) / span:.0f} s a day, against the others'"
    )
    return [Finding("drift", text)]


def _line(days: Floats, values: Floats) -> tuple[float, float, float]:
    """The slope of a line, how far values lie from it, and from the best single jump."""
    slope = slope_of(days, values)
    rest = _scatter(values - slope * days) * len(values)
    jump = min(
        k * _scatter(values[:k]) + (len(values) - k) * _scatter(values[k:])
        for k in range(2, len(values) - 1, max(1, len(values) // MOST_PAIRED))
    )
    return slope, rest / len(values), jump / len(values)


def _scatter(values: Floats) -> float:
    """The mean distance from the median."""
    return float(np.abs(values - np.median(values)).mean())
