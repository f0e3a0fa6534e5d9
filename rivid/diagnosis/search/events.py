"""Events that the model lacks: rain, locks and releases found one by one in the residual, and coded.

Of a kind of event all have one duration, or one recession, from a grid; each has its own start and size.
An event must gain its price, some 12 nats: about the logarithm of how many starts, sizes and durations it
could have had, so that days of noise have none. What a day leaves behind is carried into the next. Pulses
less than half their duration apart may come back as one longer pulse.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.search.pursuit import APART, Atoms, Found, Shape, Whiten, pursue, response
from rivid.errors import RividError
from rivid.types import Floats

PRICE = 12.0
"""Of an event [nats]."""

MOST = 14
"""Events of a day at most."""

PULSES = (900.0, 1800.0, 3600.0, 7200.0, 14400.0, 28800.0)
"""Durations of a pulse [s]."""

RECESSIONS = (10800.0, 21600.0, 32400.0, 54000.0, 86400.0)
"""Recessions of rain [s]."""


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of event to look for.

    Attributes
    ----------
    name : str
    shape : {"pulse", "recession"}
        A constant flow for some time, or a steep rise that recedes exponentially.
    sign : {-1, 1}
        Of its flow: a release at the downstream dam takes water, -1; rain and upstream releases bring it.
    kernel : ndarray, shape (m,)
        Change of the output to a unit step of added flow at its place, by samples since the step [m per
        m3/s], or of a river reach [-].
    grid : tuple of float
        Durations or recessions [s].
    """

    name: str
    shape: Shape
    sign: int
    kernel: Floats
    grid: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        kernel = np.asarray(self.kernel, float)
        if kernel.ndim != 1 or len(kernel) < 2 or not np.isfinite(kernel).all() or not kernel.any():
            raise RividError(f"kernel of {self.name} has shape {kernel.shape}: expected two or more finite "
                             "numbers, not all zero")  # fmt: skip
        if self.sign not in (-1, 1):
            raise RividError(f"sign of {self.name} is {self.sign}: expected -1 or 1")
        if any(not x > 0.0 for x in self.grid):
            raise RividError(f"grid of {self.name} is {self.grid}: expected durations over 0 s")
        object.__setattr__(self, "kernel", kernel)
        if not self.grid:
            object.__setattr__(self, "grid", PULSES if self.shape == "pulse" else RECESSIONS)


@dataclass(frozen=True)
class Event:
    """One event.

    Attributes
    ----------
    day : int
        Row in which it begins, or is under way at the beginning.
    start_s : float
        Start after the day's midnight [s]; negative where it is under way before.
    duration_s : float
        Duration of a pulse, or recession [s].
    size, size_se : float
        Flow, of a recession at its peak [m3/s], and its standard error.
    gain : float
        Log-likelihood that is lost without it, the rest fitted again [nats].
    under_way : bool
        Whether it began before the first sample of the row: the start is a guess then.
    """

    day: int
    start_s: float
    duration_s: float
    size: float
    size_se: float
    gain: float
    under_way: bool


@dataclass(frozen=True, eq=False)
class Events:
    """The events of one kind.

    Attributes
    ----------
    kind : Kind
    duration_s : float
        The duration or recession with the largest gain [s].
    events : tuple of Event
        By day and start.
    coded : ndarray, shape (days, n)
        Their response, as it is in the residual.
    remaining : ndarray, shape (days, n)
        Residual less `coded`.
    gain : float
        Log-likelihood gained on all days, prices paid [nats].
    gains : tuple of float
        The same for each of the kind's grid.
    """

    kind: Kind
    duration_s: float
    events: tuple[Event, ...]
    coded: Floats
    remaining: Floats
    gain: float
    gains: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Ranking:
    """Kinds of events by what they gain.

    Attributes
    ----------
    found : tuple of Events
        Best first.
    margin : float
        Gain of the best one over the next, or over no events [nats].
    """

    found: tuple[Events, ...]
    margin: float


def find_events(
    residual: ArrayLike,
    whiten: Whiten,
    kind: Kind,
    sample_time: float,
    *,
    lead: int = 0,
    follows: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    price: float = PRICE,
    most: int = MOST,
) -> Events:
    """Look for events of one kind, day by day, for each duration; keep the duration that gains most.

    Parameters
    ----------
    residual : array_like, shape (days, n)
        Measured less simulated output [m, or m3/s]; NaN where a sample is missing or does not count.
    whiten : callable
        `whiten(columns, like)` of a noise model: linear along the last axis, variance 1 if the columns are
        noise; `like` (days, n) is NaN where samples are missing.
    kind : Kind
    sample_time : float
        T_s [s].
    lead : int
        Samples of a row before its day; rows are `n - lead` samples apart.
    follows : array_like of bool, shape (days,), optional
        Whether a row is the day after the one above it: what is under way is carried over. Default: none is.
    weights : array_like, shape (days,), optional
        Of each day's log-likelihood.
    price : float
        Of an event [nats].
    most : int
        Events of a day at most.

    Raises
    ------
    RividError
        Where arrays do not fit.
    """
    z = np.asarray(residual, float)
    if z.ndim != 2 or not 0 <= lead < z.shape[1]:
        raise RividError(f"residual has shape {z.shape} with a lead of {lead}: expected (days, n), n > lead")
    days, n = z.shape
    after = np.zeros(days, bool) if follows is None else np.asarray(follows, bool)
    weight = np.ones(days) if weights is None else np.asarray(weights, float)
    if after.shape != (days,) or weight.shape != (days,):
        raise RividError(
            f"follows and weights have shapes {after.shape} and {weight.shape}: expected ({days},)"
        )
    grid = tuple(max(x / sample_time, 1.0) for x in kind.grid)
    if kind.shape == "pulse":
        grid = tuple(float(round(x)) for x in grid)
    there = np.isfinite(z)
    r = whiten(np.where(there, z, np.nan)[None], z)[0]
    atoms = Atoms(kind.kernel, kind.shape, grid, n, whiten)
    searches = [_Search(g, n - lead, atoms.before, k) for g, k in zip(grid, atoms.first, strict=True)]
    for d in range(days):
        if not there[d].any():
            continue
        for search, (A, norm) in zip(searches, atoms.whitened(there[d]), strict=True):
            apart = int(search.samples) if kind.shape == "pulse" else APART
            search.day(d, bool(after[d]), A, norm, r[d], kind.sign, apart, price, most, float(weight[d]))
    gains = tuple(s.gain for s in searches)
    best = int(np.argmax(gains))
    chosen = searches[best]
    coded = np.zeros(z.shape)
    if chosen.seen:
        shape = response(kind.kernel, kind.shape, grid[best], n + atoms.before + n)
        for d, k, i in chosen.seen:
            lag = np.arange(n) - k
            coded[d] += chosen.found[i][1].size * np.where(lag >= 0, shape[np.maximum(lag, 0)], 0.0)
    events = tuple(
        Event(
            day=d, start_s=(f.start - lead) * sample_time, duration_s=grid[best] * sample_time, size=f.size,
            size_se=f.size_se, gain=f.gain, under_way=f.start < 0,
        )
        for d, f in sorted(chosen.found, key=lambda e: (e[0], e[1].start))
    )  # fmt: skip
    return Events(kind, kind.grid[best], events, coded, z - coded, gains[best], gains)


class _Search:
    """Events of one duration, day after day."""

    def __init__(self, samples: float, row: int, before: int, first: int) -> None:
        self.samples, self.row, self.before, self.first = samples, row, before, first
        self.found: list[tuple[int, Found]] = []
        self.seen: list[tuple[int, int, int]] = []
        """Row, start in it, and which event."""
        self.gain = 0.0
        self._last = -1

    def day(
        self, d: int, follows: bool, A: Floats, norm: Floats, r: Floats, sign: int, apart: int, price: float,
        most: int, weight: float,
    ) -> None:  # fmt: skip
        """Look in row d; events of the row before that still show keep their place and are measured again."""
        before = [(k - self.row, i) for e, k, i in self.seen if follows and e == d - 1 == self._last]
        old = [(k, i) for k, i in before if k >= -self.before and norm[k + self.before] > 0.0]
        carried = [(k + self.before, self.found[i][1].size, self.found[i][1].size_se) for k, i in old]
        new, again, gain = pursue(
            A, norm, r, first=self.first, sign=sign, apart=apart, price=price, most=most, weight=weight,
            carried=carried,
        )  # fmt: skip
        for (k, i), f in zip(old, again, strict=True):
            day, first = self.found[i]
            # Two days' worth: the second was told the first one's size, with its standard error.
            self.found[i] = day, replace(first, size=f.size, size_se=f.size_se, gain=f.gain)
            self.seen.append((d, k, i))
        for f in new:
            start, i = f.start - self.before, len(self.found)
            self.found.append((d, replace(f, start=start)))
            self.seen.append((d, start, i))
            if follows and self._last == d - 1 and 0 <= start + self.row < len(r):
                self.seen.append((d - 1, start + self.row, i))  # too late in its own day to be told there
        self.gain += gain
        self._last = d


def best_kind(
    residual: ArrayLike,
    whiten: Whiten,
    kinds: Sequence[Kind],
    sample_time: float,
    *,
    lead: int = 0,
    follows: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    price: float = PRICE,
    most: int = MOST,
) -> Ranking:
    """Which kind of event the residual holds: pulses or recessions, up or down, here or there.

    Parameters are those of :func:`find_events`. Kinds pay the same price, so their gains compare; the error
    that they leave does not: any smooth hump takes rain for a release.

    Raises
    ------
    RividError
        Where there are no kinds.
    """
    if not kinds:
        raise RividError("no kinds of events: expected one or more")
    found = [
        find_events(residual, whiten, kind, sample_time, lead=lead, follows=follows, weights=weights,
                    price=price, most=most)
        for kind in kinds
    ]  # fmt: skip
    found.sort(key=lambda e: -e.gain)
    second = max(found[1].gain, 0.0) if len(found) > 1 else 0.0
    return Ranking(tuple(found), found[0].gain - second)
