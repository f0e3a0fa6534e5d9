"""Events that the model lacks: rain, locks and releases found one by one in the residual; jumps and noises.

All events of a kind have one duration, or one recession, from a grid; each has its own start and size. An
event must gain its price, some 12 nats: about the logarithm of the number of starts, sizes and durations it
could have had, so that noise alone gives none. Events under way at midnight are carried into the next day.
Pulses less than half their duration apart may come back as one longer pulse.

The response of the output to a unit step of flow that starts at sample s is h_{t-s}. Whitening W is linear,
so one whitened step for each start gives every atom without whitening again:

    pulse of D samples:  W p_s = W h_s - W h_{s+D},
    recession:           W e_s = (W h_s - W h_{s+1}) + rho W e_{s+1},    rho = exp(-T_s / recession).

Starts before the row are events under way. The same search finds the jumps of a gauge, up and down: their
atom is the whitened step itself. As the level of each row's start is unknown, a jump shows in its own row
only. Matching pursuit (Pati, Rezaiifar and Krishnaprasad 1993) takes
the atom of largest gain, fits all amplitudes again, and continues until the next gain is below the price.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.data import Record
from rivid.effects import Effect
from rivid.errors import RividError
from rivid.types import DAY, HOUR, Bools, Floats, Ints

Shape = Literal["pulse", "recession", "jump"]
Whiten = Callable[[Floats, Floats], Floats]
"""Columns (..., days, n) and a row each that is NaN where a sample is missing, to whitened columns."""

VISIBLE = 0.05
"""Atoms with less than this share of the largest norm are left out: the row hardly shows them."""

LASTS = 2.5
"""Recessions over which rain is carried from day to day; after them 8 % of its peak flow is left."""

APART = 2
"""Samples between the starts of two recessions."""

PATTERNS = 2
"""Patterns of missing samples with cached atoms; most days have the same pattern."""


@dataclass(frozen=True)
class Found:
    """An event in a row."""

    start: int  # sample of the row; negative before its first one
    size: float
    size_se: float
    gain: float  # log-likelihood lost without it, the others fitted again [nats]


def extended(kernel: Floats, length: int) -> Floats:
    """A step response (m,) of some length, going on as it ended: a pool rises, a river stays."""
    if len(kernel) >= length:
        return np.asarray(kernel[:length])
    slope = kernel[-1] - kernel[-2]
    beyond = kernel[-1] + slope * np.arange(1, length - len(kernel) + 1)
    return np.asarray(np.concatenate([kernel, beyond]), float)


def response(kernel: Floats, shape: Shape, samples: float, length: int) -> Floats:
    """Response (length,) of the output to a unit event that starts at 0; of some samples, unless a jump."""
    h = extended(kernel, length)
    if shape == "jump":
        return h
    if shape == "pulse":
        D = round(samples)
        return np.asarray(h - np.concatenate([np.zeros(min(D, length)), h[: max(length - D, 0)]]), float)
    flow = np.exp(-np.arange(length) / samples)
    size = 2 * length
    spread = np.fft.irfft(np.fft.rfft(np.diff(h, prepend=0.0), size) * np.fft.rfft(flow, size), size)
    return np.asarray(spread[:length], float)


class Atoms:
    """Whitened atoms of one kind for rows of n samples; `grid` holds durations or recessions [samples]."""

    def __init__(self, kernel: Floats, shape: Shape, grid: tuple[float, ...], n: int, whiten: Whiten) -> None:
        self.shape, self.grid, self.n, self.whiten = shape, grid, n, whiten
        self.before = (
            0 if shape == "jump" else int(np.ceil(max(grid) * (LASTS if shape == "recession" else 1.0)))
        )
        """Starts before the row: index k of an atom is the start k - before."""
        h = extended(kernel, n + self.before)
        lag = np.arange(n) - (np.arange(self.before + n) - self.before)[:, None]
        self.steps: Floats = np.where(lag >= 0, h[np.maximum(lag, 0)], 0.0)
        self.first = tuple(max(self.before - int(np.ceil(x)) + 1, 0) for x in grid)
        """First atom to look for, for each of the grid: what is over before the row, or long past its peak,
        is not."""
        self._kept: dict[bytes, list[tuple[Floats, Floats]]] = {}

    def whitened(self, there: Bools) -> list[tuple[Floats, Floats]]:
        """For each of the grid: atoms (starts, n) and their norms (starts,), 0 where hardly visible."""
        key = there.tobytes()
        if key not in self._kept:
            while len(self._kept) >= PATTERNS:
                self._kept.pop(next(iter(self._kept)))
            like = np.where(there, 0.0, np.nan)[None]
            W = self.whiten(self.steps[:, None], like)[:, 0]
            self._kept[key] = [self._atoms(W, samples, there) for samples in self.grid]
        return self._kept[key]

    def _atoms(self, W: Floats, samples: float, there: Bools) -> tuple[Floats, Floats]:
        A = W.copy()
        if self.shape == "jump":
            after = np.cumsum(there[::-1])[::-1]
            A[(after < EDGE) | (there.sum() - after < EDGE)] = 0.0
        elif self.shape == "pulse":
            D = round(samples)
            A[: len(A) - D] -= W[D:]
        else:
            A[:-1] -= W[1:]
            rho = np.exp(-1.0 / samples)
            for s in range(len(A) - 2, -1, -1):
                A[s] += rho * A[s + 1]
        norm = np.sqrt((A * A).sum(1))
        norm[norm < VISIBLE * norm.max(initial=0.0)] = 0.0
        return A, norm


def pursue(
    A: Floats,
    norm: Floats,
    r: Floats,
    *,
    first: int,
    sign: int,
    apart: int,
    price: float,
    most: int,
    weight: float,
    carried: list[tuple[int, float, float]],
) -> tuple[list[Found], list[Found], float]:
    """Events in a whitened row, and those carried from the row before.

    Parameters
    ----------
    A, norm : ndarray, shapes (starts, n) and (starts,)
        Atoms and their norms; 0 is never chosen.
    r : ndarray, shape (n,)
        Whitened residual.
    first : int
        First atom to consider.
    sign : {-1, 0, 1}
        Of all sizes; 0 is either.
    apart : int
        Least distance of two starts [samples].
    price : float
        Of an event [nats].
    most : int
        Most events.
    weight : float
        Of the row's log-likelihood.
    carried : list of (int, float, float)
        Events of the row before: index, size and its standard error; they cost nothing.

    Returns
    -------
    new, carried : list of Found
        `start` is an index of A.
    gain : float
        Of all, over none, prices of the new ones paid [nats].
    """
    prior = [(a, 1.0 / max(se, 1e-12) ** 2) for _, a, se in carried]
    old = len(carried)
    fit = _fit(A, r, weight, [k for k, _, _ in carried], prior)
    none = -0.5 * weight * float(r @ r)
    unit = np.where(norm > 0.0, np.sqrt(weight) / np.where(norm > 0.0, norm, 1.0), 0.0)
    unit[:first] = 0.0

    def worth_of(rest: Floats) -> Floats:
        """Root of twice the gain of each atom, below 0 for one of the other sign."""
        return unit * (sign * (A @ rest) if sign else np.abs(A @ rest))

    refused = np.zeros(len(norm), bool)
    tries = 0
    while len(fit.starts) - old < most and tries < 3 * most and weight > 0.0:
        tries += 1
        worth = worth_of(fit.rest)
        worth[refused | _near(fit.starts, len(norm), apart)] = 0.0
        k = int(np.argmax(worth))
        # With the others fitted again an atom gains more than this, twice as much where it leans on them.
        if worth[k] ** 2 < price:
            break
        more = _fit(A, r, weight, [*fit.starts, k], prior)
        more = _settled(A, r, weight, worth_of, unit == 0.0, more, old, apart, prior)
        if (sign and (sign * more.size[old:] <= 0.0).any()) or more.likelihood - fit.likelihood < price:
            refused[k] = True
        else:
            fit = more
    gains = 0.5 * fit.size**2 / np.maximum(fit.variance, 1e-300)  # exact: the likelihood is a parabola
    if len(fit.starts) > old and gains[old:].min() < price:
        kept = [k for i, k in enumerate(fit.starts) if i < old or gains[i] >= price]
        fit = _fit(A, r, weight, kept, prior)
        gains = 0.5 * fit.size**2 / np.maximum(fit.variance, 1e-300)
    every = [
        Found(k, float(a), float(np.sqrt(v)), float(g))
        for k, a, v, g in zip(fit.starts, fit.size, fit.variance, gains, strict=True)
    ]
    return every[old:], every[:old], fit.likelihood - none - price * (len(every) - old)


class _Fit(NamedTuple):
    """Amplitudes of the atoms that start at `starts`: sizes, their variances, and what is left of the row."""

    starts: list[int]
    size: Floats
    variance: Floats
    likelihood: float
    rest: Floats


def _fit(A: Floats, r: Floats, weight: float, starts: list[int], prior: list[tuple[float, float]]) -> _Fit:
    """Least squares; the first atoms have a mean and a precision from the row before."""
    if not starts:
        return _Fit([], np.zeros(0), np.zeros(0), -0.5 * weight * float(r @ r), r)
    X = A[starts]
    mean, precision = np.zeros(len(starts)), np.zeros(len(starts))
    if prior:
        mean[: len(prior)], precision[: len(prior)] = np.array(prior).T
    G = weight * (X @ X.T) + np.diag(precision)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(G), 1e-300))
    inverse = np.linalg.pinv(G * np.outer(scale, scale), rcond=1e-10, hermitian=True) * np.outer(scale, scale)
    size = inverse @ (weight * (X @ r) + precision * mean)
    rest = r - size @ X
    likelihood = -0.5 * (weight * float(rest @ rest) + float(precision @ (size - mean) ** 2))
    return _Fit(starts, size, np.diag(inverse).copy(), likelihood, rest)


def _near(starts: list[int], many: int, apart: int) -> Bools:
    """Starts that would share a sample with an event that is there."""
    near = np.zeros(many, bool)
    for k in starts:
        near[max(k - apart + 1, 0) : k + apart] = True
    return near


def _settled(
    A: Floats,
    r: Floats,
    weight: float,
    worth_of: Callable[[Floats], Floats],
    barred: Bools,
    fit: _Fit,
    old: int,
    apart: int,
    prior: list[tuple[float, float]],
) -> _Fit:
    """Each new event at its best start given the others, once round: the first ones were chosen without."""
    if len(fit.starts) - old < 2:
        return fit
    starts = list(fit.starts)
    for i in range(old, len(starts)):
        others = starts[:i] + starts[i + 1 :]
        worth = worth_of(fit.rest + fit.size[i] * A[starts[i]])
        worth[_near(others, len(barred), apart) | barred] = -np.inf
        k = int(np.argmax(worth))
        if k == starts[i]:
            continue
        moved = _fit(A, r, weight, [*starts[:i], k, *starts[i + 1 :]], prior)
        if moved.likelihood > fit.likelihood:
            fit, starts[i] = moved, k
    return fit


PRICE = 12.0
"""Of an event [nats]."""

MOST = 14
"""Events of a day at most."""

PULSES = (900.0, 1800.0, 3600.0, 7200.0, 14400.0, 28800.0)
"""Durations of a pulse [s]."""

RECESSIONS = (10800.0, 21600.0, 32400.0, 54000.0, 86400.0)
"""Recessions of rain [s]."""

GRIDS: dict[Shape, tuple[float, ...]] = {"pulse": PULSES, "recession": RECESSIONS, "jump": (1.0,)}
"""Usual grid of each shape; that of jumps, which have no duration, has one value without meaning."""

EDGE = 20
"""Readings at both ends of a day in which a jump cannot be separated from a bad start, and between which a
jump and its return are a spike."""

LARGEST_JUMP = 1.0
"""A gauge set anew or knocked [m]: with a flat prior to here, 1 nat more for 2.7 times."""


def price_of(starts: int, largest: float, size_se: float) -> float:
    """Price of an event that may start at so many times, with a size between -`largest` and `largest` [nats].

    The logarithm of its evidence, by Laplace's approximation with flat priors, is its gain less this:
    ``log(starts) + log(2 largest / (sqrt(2 pi) size_se))``.
    """
    return float(np.log(max(starts, 1) * 2.0 * largest / (np.sqrt(2.0 * np.pi) * size_se)))


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of event."""

    name: str
    shape: Shape  # a constant flow for some time, a steep rise that recedes exponentially, or a jump
    # Of its flow: a release at the downstream dam takes water, -1; rain and upstream releases bring it. 0 is
    # either.
    sign: int
    # (m,) Change of the output to a unit step of added flow at its place, by samples since the step [m per
    # m3/s], or of a river reach [-]; of a jump, ones.
    kernel: Floats
    grid: tuple[float, ...] = ()  # durations or recessions [s]

    def __post_init__(self) -> None:
        kernel = np.asarray(self.kernel, float)
        if kernel.ndim != 1 or len(kernel) < 2 or not np.isfinite(kernel).all() or not kernel.any():
            raise RividError(f"kernel of {self.name} has shape {kernel.shape}: expected two or more finite "
                             "numbers, not all zero")  # fmt: skip
        if self.sign not in (-1, 0, 1):
            raise RividError(f"sign of {self.name} is {self.sign}: expected -1, 0 or 1")
        if any(not x > 0.0 for x in self.grid):
            raise RividError(f"grid of {self.name} is {self.grid}: expected durations over 0 s")
        object.__setattr__(self, "kernel", kernel)
        if not self.grid:
            object.__setattr__(self, "grid", GRIDS[self.shape])


@dataclass(frozen=True)
class Event:
    """One event."""

    day: int  # row in which it begins, or is under way at the beginning
    # Start after the day's midnight [s]; negative where it is under way before. A jump lies half-way between
    # two samples.
    start_s: float
    duration_s: float  # duration of a pulse, or recession [s]
    size: float  # flow, of a recession at its peak [m3/s], or jump [m]; and its standard error
    size_se: float
    gain: float  # log-likelihood that is lost without it, the rest fitted again [nats]
    under_way: bool  # whether it began before the first sample of the row: the start is a guess then


@dataclass(frozen=True, eq=False)
class Events:
    """The events of one kind."""

    kind: Kind
    duration_s: float  # the duration or recession with the largest gain [s]
    events: tuple[Event, ...]  # by day and start
    coded: Floats  # (days, n): their response, as it is in the residual
    gain: float  # log-likelihood gained on all days, prices paid [nats]
    price: float  # of each event [nats]


def find_events(
    residual: ArrayLike,
    whiten: Whiten,
    kind: Kind,
    sample_time: float,
    *,
    lead: int = 0,
    follows: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    price: float | None = None,
    most: int = MOST,
) -> Events:
    """Find events of one kind, day by day, for each duration; keep the duration of largest gain.

    Parameters
    ----------
    residual : array_like, shape (days, n)
        Measured less simulated output [m, or m3/s]; NaN where a sample is missing or does not count.
    whiten : callable
        `whiten(columns, like)` of a noise model; `like` (days, n) is NaN where samples are missing.
    kind : Kind
    sample_time : float
        T_s [s].
    lead : int
        Samples of a row before its day; rows are `n - lead` samples apart.
    follows : array_like of bool, shape (days,), optional
        Whether a row is the day after the one above it: events under way are carried over. Default: none.
    weights : array_like, shape (days,), optional
        Of each day's log-likelihood.
    price : float, optional
        Of an event [nats]. Default: :data:`PRICE`, of a jump that of :func:`price_of`.
    most : int
        Most events of a day.

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
    jump = kind.shape == "jump"
    if kind.shape == "pulse":
        grid = tuple(float(round(x)) for x in grid)
    there = np.isfinite(z)
    r = whiten(np.where(there, z, np.nan)[None], z)[0]
    atoms = Atoms(kind.kernel, kind.shape, grid, n, whiten)
    searches = [_Search(g, n - lead, atoms.before, k) for g, k in zip(grid, atoms.first, strict=True)]
    if price is None:
        price = _jump_price(atoms, there) if jump else PRICE
    for d in range(days):
        if not there[d].any():
            continue
        for search, (A, norm) in zip(searches, atoms.whitened(there[d]), strict=True):
            apart = EDGE if jump else int(search.samples) if kind.shape == "pulse" else APART
            search.day(d, bool(after[d]), A, norm, r[d], kind.sign, apart, price, most, float(weight[d]))
    best = int(np.argmax([s.gain for s in searches]))
    chosen = searches[best]
    coded = np.zeros(z.shape)
    if chosen.seen:
        shape = response(kind.kernel, kind.shape, grid[best], n + atoms.before + n)
        # The lead of the next row shows a late jump; there is no atom for it, as its size is known.
        late = [e for e in chosen.seen if jump and e[1] >= n - lead and after[e[0] + 1 : e[0] + 2].any()]
        later = [(d + 1, k - n + lead, i) for d, k, i in late]
        for d, k, i in chosen.seen + later:
            lag = np.arange(n) - k
            coded[d] += chosen.found[i][1].size * np.where(lag >= 0, shape[np.maximum(lag, 0)], 0.0)
    events = tuple(
        Event(
            day=d, start_s=(f.start - lead - 0.5 * jump) * sample_time, duration_s=grid[best] * sample_time,
            size=f.size, size_se=f.size_se, gain=f.gain, under_way=f.start < 0,
        )
        for d, f in sorted(chosen.found, key=lambda e: (e[0], e[1].start))
    )  # fmt: skip
    return Events(kind, kind.grid[best], events, coded, chosen.gain, price)


def _jump_price(atoms: Atoms, there: Bools) -> float:
    """Price of a jump anywhere in the rows [nats]."""
    ((_, norm),) = atoms.whitened(there[int(np.argmax(there.sum(1)))])
    sure = norm[norm > 0.0]
    return price_of(int(there.sum()), LARGEST_JUMP, 1.0 / float(np.median(sure))) if len(sure) else PRICE


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
            # The estimate of both days: the first one's size and standard error are the second one's prior.
            self.found[i] = day, replace(first, size=f.size, size_se=f.size_se, gain=f.gain)
            self.seen.append((d, k, i))
        for f in new:
            start, i = f.start - self.before, len(self.found)
            self.found.append((d, replace(f, start=start)))
            self.seen.append((d, start, i))
            if follows and self._last == d - 1 and 0 <= start + self.row < len(r):
                self.seen.append((d - 1, start + self.row, i))  # too late in its own day to be measured there
        self.gain += gain
        self._last = d


WITHIN = 1800.0
"""Two starts are at the same hour if they are no further apart by the clock [s]."""


def timetable(
    events: Sequence[Event], *, within: float = WITHIN, draws: int = 999, seed: int = 0
) -> tuple[float, float]:
    """Whether events start at the same hours of the day.

    Parameters
    ----------
    events : sequence of Event
        Those under way at the start of a row are left out.
    within : float
        Largest distance of two starts at the same hour [s].
    draws, seed : int
        Random timetables.

    Returns
    -------
    p_value : float
        Of as many pairs of starts at the same hour, were they uniform; 1 with events of one day only.
    share : float
        Share of the starts at an hour at which many start.
    """
    counted = [e for e in events if not e.under_way]
    starts = np.array([e.start_s % DAY for e in counted])
    if len({e.day for e in counted}) < 2:
        return 1.0, 0.0
    observed = _agreeing(starts[None], within)[0]
    by_chance = np.random.default_rng(seed).uniform(0.0, DAY, (draws, len(starts)))
    p_value = float((1 + (_agreeing(by_chance, within) >= observed).sum()) / (1 + draws))
    left = np.ones(len(starts), bool)
    while left.any():
        near = (_apart(starts[:, None], starts) <= within) & left
        members = near[int(np.argmax(near.sum(1)))]
        if members.sum() < max(3, 0.15 * len(starts)):
            break
        left &= ~members
    return p_value, float(1.0 - left.mean())


def size_variation(events: Sequence[Event]) -> float:
    """Coefficient of variation of sizes beyond their standard errors [-]; NaN for fewer than two events."""
    a = np.array([e.size for e in events])
    if len(a) < 2:
        return float("nan")
    own = max(float(a.var(ddof=1)) - float(np.mean([e.size_se**2 for e in events])), 0.0)
    return float(np.sqrt(own) / max(abs(float(a.mean())), 1e-300))


def _apart(a: Floats, b: Floats) -> Floats:
    """Distance by the clock [s]."""
    d = np.abs(a - b)
    return np.asarray(np.minimum(d, DAY - d), float)


def _agreeing(starts: Floats, within: float) -> Ints:
    """Pairs of starts up to about `within` apart by the clock, on a ring of bins; starts (draws, events)."""
    ring = max(round(DAY / (within / 3.0)), 8)
    bins = np.minimum((starts * (ring / DAY)).astype(np.int64), ring - 1)
    cell = bins + ring * np.arange(len(starts))[:, None]
    counts = np.bincount(cell.ravel(), minlength=ring * len(starts)).reshape(len(starts), ring)
    near = sum(np.roll(counts, shift, axis=1) for shift in range(-3, 4))
    return np.asarray((counts * near).sum(1), np.int64)


FEWEST = 3
"""Events of a kind must be so many."""
ALIKE = 0.75
"""Largest coefficient of variation of the sizes of releases."""
A_STORM = 3 * HOUR
"""Events that follow each other within this are one storm."""
SCHEDULED = 0.002
"""p of a timetable from which events are taken as operated, not natural."""
MOST_PULSE, MOST_RAIN = 3.0, 10.0
"""Largest size over the median: of an event cut off by midnight only the start is observed."""


def kind_of(effect: type[Effect], kernels: dict[str, Floats]) -> Kind:
    """Events of an effect: recessions along the reach, pulses at the lower dam, or jumps of the gauge."""
    if effect.found_as == "jump":
        return Kind(effect.name, "jump", 0, np.ones_like(kernels["down"]))
    if effect.found_as == "recession":
        return Kind(effect.name, "recession", 1, kernels["middle"], RECESSIONS)
    return Kind(effect.name, "pulse", -1, -kernels["down"], PULSES)


def _storms(events: Sequence[Event]) -> list[Event]:
    """The first event of each storm: a slow rise is coded as several that follow each other."""
    found: list[Event] = []
    last = -np.inf
    for event in sorted(events, key=lambda e: (e.day, e.start_s)):
        at = event.day * DAY + event.start_s
        if at - last > A_STORM:
            found.append(event)
        last = at
    return found


def as_effect(effect: type[Effect], events: Events, record: Record) -> Effect:
    """The effect with its events, as hours since the first day's midnight."""
    number = record.day_number
    starts = tuple(float((number[e.day] * DAY + e.start_s) / HOUR) for e in events.events)
    if effect.found_as == "jump":
        return effect.from_events(starts, [e.size for e in events.events], 0.0)
    sizes_ = np.array([abs(float(e.size)) for e in events.events])
    most = (MOST_RAIN if effect.found_as == "recession" else MOST_PULSE) * float(np.median(sizes_))
    size = np.minimum(sizes_, most).tolist()
    return effect.from_events(starts, size, events.events[0].duration_s / HOUR)


def plausible(found: Events) -> bool:
    """Whether events look like their kind: releases are alike, and rain follows no timetable."""
    if found.kind.shape == "jump":
        return bool(found.events)
    if len(found.events) < FEWEST:
        return False
    if found.kind.shape == "pulse":
        return not size_variation(found.events) > ALIKE
    p_value, share = timetable(_storms(found.events))
    return not (p_value <= SCHEDULED and share > 0.5)
