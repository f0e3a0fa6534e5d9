"""The days of a run joined, and their law of delay and discharge.

Where windows of several days overlap, only days whose windows share nothing are joined: the same samples
must not be counted twice.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rivid.core.law.delay_law import DelayLaw, delay_law
from rivid.core.river.settings import RiverSettings
from rivid.core.season.joined import season
from rivid.errors import ConfigError
from rivid.seasons.days import SeasonDays

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

DIRECTIONS = {False: "forward", True: "both"}


@dataclass(frozen=True)
class Joined:
    """The answers of posterior-season; a leading axis of days.

    Attributes
    ----------
    direction : str
        "forward" or "both".
    probability : ndarray, shape (n, D)
        p(d | days).
    delay, travel : ndarray, shape (n,)
        Delay [samples] and travel time [s]; NaN where none is sure enough.
    sure : ndarray, shape (n,)
        Probability of the likeliest delay, of a river of its rounded t50.
    low, high : ndarray, shape (n,)
        Ends of the smallest set of delays that holds 90 % [samples].
    observed : ndarray of bool, shape (n,)
        The day had a probability of its own.
    related : float
        Probability, after the last day, that days have to do with each other.
    """

    direction: str
    probability: Floats
    delay: Floats
    travel: Floats
    sure: Floats
    low: Floats
    high: Floats
    observed: Bools
    related: float


def join(days: SeasonDays, both_ways: bool = False) -> Joined:
    """posterior-season of the days of a run.

    Parameters
    ----------
    days : SeasonDays
    both_ways : bool
        False: a day knows the days before it only, so that no answer changes when days are added.

    Returns
    -------
    Joined

    Raises
    ------
    ConfigError
        For a river both ways: its days err alike, and on simulated rivers the 90 % band then held 81 %.
    """
    if both_ways and days.river:
        raise ConfigError(
            "--both-ways on a river: its days err alike, and joined both ways they are surer than right: "
            "leave it out"
        )
    n = len(days.dates)
    p = np.empty(days.probability.shape)
    in_set: Bools = np.empty(p.shape, bool)
    delay, sure = np.empty((2, n))
    observed: Bools = np.empty(n, bool)
    related = 0.0
    for first in range(min(days.window, n)):
        take = slice(first, None, days.window)
        found = season(
            days.probability[take], None, days.discharge[take], d_min=int(days.candidates[0]),
            both_ways=both_ways,
        )  # fmt: skip
        p[take], in_set[take], observed[take] = found.probability, found.in_set, found.observed
        delay[take], sure[take] = found.delay, found.sure
        if (n - 1) % days.window == first:
            related = 1.0 - float(found.independent[-1])
    middle = days.place(p, 0.5)
    if days.river:
        delay, sure = _river_answer(days, p, middle)
    own = delay == days.delay  # the day's own fraction of a sample is finer than the season's
    travel = np.where(own, days.travel, np.where(np.isfinite(delay), middle * days.sample_time, np.nan))
    low = days.candidates[np.argmax(in_set, axis=1)].astype(float)
    high = days.candidates[::-1][np.argmax(in_set[:, ::-1], axis=1)].astype(float)
    return Joined(DIRECTIONS[both_ways], p, delay, travel, sure, low, high, observed, related)


def _river_answer(days: SeasonDays, p: Floats, t50: Floats) -> tuple[Floats, Floats]:
    """A river is answered where the band of t50 is narrow enough, as a day alone is."""
    wide = days.place(p, 0.95) - days.place(p, 0.05)
    first, last = days.candidates[0], days.candidates[-1]
    rounded = np.clip(np.floor(t50 + 0.5), first, last)
    sure = p[np.arange(len(p)), (rounded - first).astype(int)]
    return np.where(wide <= RiverSettings().widest + 0.5 * t50, rounded, np.nan), sure


def law_of(days: SeasonDays) -> DelayLaw:
    """The law of the days' own answers, in seconds.

    Days count alike, without a band of their own: what a table of probabilities tells of a travel time
    within its sample is nothing, which would pass for an error of a third of a sample that no day has. The
    scatter of the days about the law then holds their errors too, so a single day's interval is rather wide.
    """
    T = days.travel
    return delay_law(days.discharge, T, T, T, day=np.array([day.toordinal() for day in days.dates]))
