"""Events that the model lacks: rain, locks and releases found one by one in the residual; gauge jumps.

All events of a kind have the same duration, or recession, from a grid; each has its own start and size. An
event must gain its price, some 12 nats: about the logarithm of the number of possible starts, sizes and
durations, so that noise alone gives no events. Events under way at midnight are carried into the next day.
Then the duration is refined between the values of the grid, starts are moved between samples, and pulses may
have two durations, or one each.

The response of the output to a unit step of flow that starts at sample s is h_{t-s}. Whitening W is linear,
so that all atoms follow from one whitened step for each start:

    pulse of D samples:  W p_s = W h_s - W h_{s+D},
    recession:           W e_s = q (W h_s - W h_{s+1}) + rho W e_{s+1},    rho = exp(-T_s / recession),

q the mean of the recession over its first sample. Starts before the row are events under way. The same search
finds the jumps of a gauge, up and down: their atom is the whitened step itself. As the level at each row's
start is unknown, a jump appears in its own row only. Matching pursuit (Pati, Rezaiifar and Krishnaprasad
1993) adds the atom of largest gain, refits all sizes, and continues until the next gain is below the price.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import compress
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.data import Record
from rivid.diagnosis.pursuit import Steps, pursue, receding, squares, steps_of
from rivid.effects import Effect
from rivid.effects.flow import PassingFlow
from rivid.types import DAY, HOUR, Bools, Floats, Ints

Shape = Literal["pulse", "recession", "jump"]
Whiten = Callable[[Floats, Floats], Floats]
"""Whitens columns (..., days, n); its second argument (days, n) is NaN at missing samples."""
VISIBLE = 0.05
"""Atoms with a norm below this share of the largest one are left out: the row hardly contains them."""
LASTS = 2.5  # recession times for which rain is carried from day to day; 8 % of its peak flow is then left
APART = 2.0  # least distance between the starts of two events [samples]: each starts between two samples
PATTERNS = 2  # patterns of missing samples with cached atoms, in addition to the most frequent pattern


def extended(kernel: Floats, length: int) -> Floats:
    """Return a step response (m,) of `length`, extrapolated linearly: a pool rises, a river is constant."""
    if len(kernel) >= length:
        return np.asarray(kernel[:length])
    slope = kernel[-1] - kernel[-2]
    beyond = kernel[-1] + slope * np.arange(1, length - len(kernel) + 1)
    return np.asarray(np.concatenate([kernel, beyond]), float)


def at_lags(h: Floats, lags: Floats) -> Floats:
    """Interpolate a response (m,) at lags after a start between samples: flows are means over samples."""
    return np.asarray(np.interp(lags, np.arange(-1.0, len(h)), np.append(0.0, h)))


PRICE = 12.0  # price of an event [nats]
MOST = 40  # maximum number of new events of a day: as each has a price, this only limits the memory
CHOOSING = 12
"""Maximum number for the choice of durations: a misfit that lasts is coded by as many as are allowed, and the
time increases with their square. In a season with one, three searches found the same with 12 as with 40."""
PULSES = (112.5, 225.0, 450.0, 900.0, 1800.0, 3600.0, 7200.0, 14400.0, 28800.0)
"""Durations of a pulse [s]; durations below :data:`SHORTEST` are replaced by it."""
SHORTEST = 2.0  # shortest pulse [samples]: of a shorter one only the volume is identifiable, not the duration
RECESSIONS = (10800.0, 21600.0, 32400.0, 54000.0, 86400.0)  # recession times of rain [s]
RISES = (0.0, 1800.0, 3600.0, 7200.0, 14400.0)  # rise times of rain [s]
GRIDS: dict[Shape, tuple[float, ...]] = {"pulse": PULSES, "recession": RECESSIONS, "jump": (1.0,)}
"""Default grid of each shape; that of jumps, which have no duration, has one value without meaning."""
EDGE = 20  # least number of readings between a jump and its return: with fewer they are a spike
FEWEST_READINGS = 2
"""Readings of a row before and after a jump, to separate it from a single bad reading at the row's end. With
four a jump of 0.32 m, 24 minutes after midnight in a season of 582 s, was not tested, and three effects
compensated for it."""
LARGEST_JUMP = 1.0
"""Limit of the flat prior of a jump, of a gauge reset or hit [m]; 2.7 times as much costs 1 nat."""


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of event."""

    name: str
    shape: Shape  # a constant flow for some time, a rise that recedes exponentially, or a jump
    # Sign of its size: -1 for a release at the downstream dam, 1 for rain and upstream releases, 0 for any.
    sign: int
    # (m,) Response of the output to a unit step of added flow at its place, by samples since the step [m per
    # m3/s], for a river reach [-]; ones for a jump.
    kernel: Floats
    grid: tuple[float, ...] = ()  # durations or recessions [s]; that of its shape if empty

    def samples(self, sample_time: float) -> tuple[float, ...]:
        """Return the grid [samples] without duplicates."""
        least = SHORTEST if self.shape == "pulse" else 1.0
        return tuple(dict.fromkeys(max(x / sample_time, least) for x in self.grid or GRIDS[self.shape]))


@dataclass(frozen=True)
class Event:
    """One event."""

    day: int  # row in which it begins, or is under way at the beginning
    # Start after the day's midnight [s]; negative if before it. A jump lies half-way between two samples.
    start_s: float
    duration_s: float  # duration of a pulse, or recession [s]
    size: float  # flow (peak of a recession) [m3/s] or jump [m], and its standard error
    size_se: float
    under_way: bool  # whether it began before the row's first sample: its start is uncertain


@dataclass(frozen=True, eq=False)
class Events:
    """The events of one kind."""

    kind: Kind
    events: tuple[Event, ...]  # by day and start
    coded: Floats  # (days, n): their contribution to the residual
    gain: float  # log-likelihood gained on all days minus prices [nats]
    price: float  # of each event [nats]
    rise_s: float = 0.0  # of a recession [s]


class Form(NamedTuple):
    """Properties that all events of a search share [samples]."""

    durations: tuple[float, ...]  # possible durations, or one recession
    rise: int = 0  # of a recession
    ends: bool = False  # whether each pulse may have its own end time


@dataclass(eq=False)
class _Pattern:
    """Whitened steps of one pattern of missing samples, and cached results."""

    W: Floats  # (S, n)
    readings: Ints  # (S,): number from each start on
    steps: dict[Form, Steps] = field(default_factory=dict)
    units: dict[tuple[float, int], Floats] = field(default_factory=dict)  # by duration and rise


@dataclass(eq=False)
class _Found:
    """Events of one form, row by row; an event is row, start in it, duration, size and its variance."""

    form: Form
    events: list[list[float]] = field(default_factory=list)
    seen: list[tuple[int, float, int]] = field(default_factory=list)  # row, start in it, index of the event
    under_way: list[tuple[float, int]] = field(default_factory=list)  # start in the last row, and index
    gain: float = 0.0
    last: int = -1  # row


class Rows:
    """Rows in which events of one kind are sought; arguments as of :func:`find_events`."""

    def __init__(
        self, residual: ArrayLike, whiten: Whiten, kind: Kind, sample_time: float, lead: int,
        follows: ArrayLike | None,
    ) -> None:  # fmt: skip
        z = np.asarray(residual, float)
        days, n = z.shape
        self.follows = np.zeros(days, bool) if follows is None else np.asarray(follows, bool)
        self.whiten, self.kind, self.T, self.lead = whiten, kind, sample_time, lead
        self.there = np.isfinite(z)
        self.white = whiten(np.where(self.there, z, np.nan)[None], z)[0]
        self.before = self._before(max(kind.samples(sample_time)))
        h = extended(kind.kernel, n + self.before)
        lag = np.arange(n) - (np.arange(self.before + n) - self.before)[:, None]
        self.steps = np.where(lag >= 0, h[np.maximum(lag, 0)], 0.0)
        self.usual = Counter(row.tobytes() for row in self.there).most_common(1)[0][0]
        self.patterns: dict[bytes, _Pattern] = {}
        self.products: dict[int, Floats] = {}
        self.price = self._price_of_a_jump() if kind.shape == "jump" else PRICE

    def search(
        self, forms: Sequence[Form], rows: Sequence[int], timed: int = 0, most: int = MOST
    ) -> list[_Found]:
        """Find the events of each form in some rows, in order; `timed` and `most` as of :func:`pursue`."""
        every = [_Found(form) for form in forms]
        for d in rows:
            if self.there[d].any():
                pattern = self.pattern(self.there[d])
                if d not in self.products:
                    self.products[d] = pattern.W @ self.white[d]
                for found in every:
                    self._row(d, found, pattern, timed, most)
        return every

    def _row(self, d: int, found: _Found, pattern: _Pattern, timed: int, most: int) -> None:
        """Find the events of one form in row d; those of the row before that continue are estimated again."""
        shape, form = self.kind.shape, found.form
        steps, unit = self.atoms(pattern, form)
        n, before, pulse = self.white.shape[1], steps.before, shape == "pulse"
        day, goes_on = n - self.lead, bool(self.follows[d]) and found.last == d - 1
        durations = np.array(form.durations)
        old = [(x - day, i) for x, i in found.under_way if goes_on]
        old = [(x, i) for x, i in old if x + (found.events[i][2] if pulse else before) > 0.0]
        carried = np.array([[x + before, *found.events[i][2:5]] for x, i in old]).reshape(-1, 4)
        carried[:, 3] **= 0.5
        c = self.products[d]
        if shape == "recession":
            c = steps.W @ self.white[d]
        apart = float(EDGE) if shape == "jump" else APART
        lasts = durations if pulse else np.full(len(durations), np.inf)
        low = np.maximum(before - np.ceil(durations).astype(np.int64) + 1, 0)
        best = -np.inf
        while True:
            tried, likelier = pursue(
                steps, c, lasts, unit, low, apart, self.kind.sign,
                self._paid(form), most, carried, timed, form.ends,
            )  # fmt: skip
            early = [e for e in tried[len(old) :].tolist() if goes_on and 0.0 <= e[0] - before + day < n]
            there = [self._gain(found, d - 1, e[0] - before + day, e[1:3]) for e in early]
            if likelier + sum(there) > best:
                best, events = likelier + sum(there), tried
            wrong = [e[0] for e, its in zip(early, there, strict=True) if its < 0.0]
            if not wrong:
                break
            # The day before contradicts such early starts, but not one at midnight.
            middle = int(np.ceil(0.5 * (max(wrong) + before + self.lead)))
            low = np.maximum(low, max(middle, int(low.min()) + 1))
        for (_, i), event in zip(old, events, strict=False):
            # Estimate of both days: size and standard error of the first are the prior of the second.
            found.events[i][3:] = event[2:].tolist()
        found.seen += [(d, x, i) for x, i in old]
        found.under_way = list(old)
        for at, *event in events[len(old) :].tolist():
            x, i = at - before, len(found.events)
            found.events.append([d, x, *event])
            found.seen.append((d, x, i))
            found.under_way.append((x, i))
            if goes_on and 0.0 <= x + day < n:
                found.seen.append((d - 1, x + day, i))  # too late in that row to be found there
        found.gain += best
        found.last = d

    def _gain(self, found: _Found, d: int, x: float, event: Sequence[float]) -> float:
        """Return the log-likelihood that one more event gains in row d, beside those found there [nats]."""
        held = [(at, *found.events[i][2:4]) for row, at, i in found.seen if row == d]
        made = np.zeros((2, 1, self.white.shape[1]))
        h = self._kernel(found.form)
        for k, events in enumerate((held, [(x, *event[:2])])):
            for one in events:
                made[k, 0] += self._made(h, *one)
        there = np.where(self.there[d], 0.0, np.nan)[None]
        before, more = self.whiten(made, there)[:, 0]
        return float(more @ (self.white[d] - before - 0.5 * more))

    def _kernel(self, form: Form) -> Floats:
        """Return the response to an event of a form that does not end."""
        h = extended(self.kind.kernel, 2 * self.white.shape[1] + self.before)
        if self.kind.shape == "recession":
            return np.asarray(receding(h[::-1, None].copy(), form.durations[0], form.rise)[::-1, 0])
        return h

    def _made(self, h: Floats, x: float, samples: float, size: float) -> Floats:
        """Return the output of an event in a row (n,) that starts at x; `h` from :meth:`_kernel`."""
        lags = np.arange(float(self.white.shape[1])) - x
        return size * (at_lags(h, lags) - (at_lags(h, lags - samples) if np.isfinite(samples) else 0.0))

    def as_events(self, found: _Found) -> Events:
        """Convert the events to seconds, and compute their contribution to the residual."""
        kind, form, T = self.kind, found.form, self.T
        jump = kind.shape == "jump"
        h, coded = self._kernel(form), np.zeros(self.white.shape)
        for d, x, i in found.seen:
            coded[d] += self._made(h, x, *found.events[i][2:4])
        events = tuple(
            Event(
                day=int(d), start_s=(x - self.lead - 0.5 * jump) * T,
                duration_s=(D if np.isfinite(D) else form.durations[0]) * T, size=size,
                size_se=float(np.sqrt(variance)), under_way=x < 0.0,
            )
            for d, x, D, size, variance in sorted(found.events)
        )  # fmt: skip
        return Events(kind, events, coded, found.gain, self._paid(form), form.rise * T)

    def _paid(self, form: Form) -> float:
        """Return the price of an event of a form: it also has one of the durations."""
        return self.price + float(np.log(len(form.durations)))

    def _before(self, samples: float) -> int:
        """Return the number of starts before a row for events that last `samples`."""
        if self.kind.shape == "jump":
            return 0
        return int(np.ceil(samples * (LASTS if self.kind.shape == "recession" else 1.0)))

    def pattern(self, there: Bools) -> _Pattern:
        key = there.tobytes()
        if key not in self.patterns:
            others = [k for k in self.patterns if k != self.usual]
            if len(others) >= PATTERNS:
                self.patterns.pop(others[0])
            W = self.whiten(self.steps[:, None], np.where(there, 0.0, np.nan)[None])[:, 0]
            readings = np.append(np.full(self.before, there.sum()), np.cumsum(there[::-1])[::-1])
            self.patterns[key] = _Pattern(W, readings)
        return self.patterns[key]

    def atoms(self, pattern: _Pattern, form: Form) -> tuple[Steps, Floats]:
        """Return steps of a form, and 1 over the norms of its atoms (durations, S), 0 if hardly visible."""
        shape, steps = self.kind.shape, pattern.steps
        key = form if shape == "recession" else Form(())
        if key not in steps:
            if shape == "recession":
                before = self._before(form.durations[0])
                W = receding(pattern.W[self.before - before :], form.durations[0], form.rise)
                steps[key] = steps_of(W, before)
            else:
                usual = shape == "pulse" and pattern is self.patterns.get(self.usual)
                steps[key] = steps_of(pattern.W, self.before, usual)  # every start is needed on some day
        made, units = steps[key], []
        for D in form.durations:
            of = D, form.rise
            if of not in pattern.units:
                root = np.sqrt(squares(made.W, made.before, D if shape == "pulse" else np.inf))
                seen = root > VISIBLE * root.max(initial=0.0)
                if shape == "jump":
                    whole = pattern.readings.max()
                    seen &= pattern.readings >= FEWEST_READINGS
                    seen &= whole - pattern.readings >= FEWEST_READINGS
                pattern.units[of] = np.divide(1.0, root, out=np.zeros(len(root)), where=seen)
            units.append(pattern.units[of])
        return made, np.array(units)

    def _price_of_a_jump(self) -> float:
        """Return what flat priors cost [nats], by Laplace's approximation of the evidence."""
        whole = self.pattern(self.there[int(np.argmax(self.there.sum(1)))])
        _, unit = self.atoms(whole, Form(self.kind.samples(self.T)))
        sure = unit[unit > 0.0]
        if not len(sure):
            return PRICE
        starts, se = max(int(self.there.sum()), 1), float(np.median(sure))
        return float(np.log(starts * 2.0 * LARGEST_JUMP / (np.sqrt(2.0 * np.pi) * se)))


def find_events(
    residual: ArrayLike,  # (days, n): measured minus simulated [m, or m3/s]; NaN at missing or unused samples
    whiten: Whiten,
    kind: Kind,
    sample_time: float,
    *,
    lead: int = 0,  # samples of a row before its day; rows are `n - lead` samples apart
    follows: ArrayLike | None = None,  # (days,): whether a row is the day after the one above it; none is
    refine: bool = True,
) -> Events:
    """Find events of one kind, day by day, for each duration; keep the duration of largest gain.

    Events under way are carried over to a row that follows. With `refine`, the duration is refined between
    the values of the grid, starts are moved between samples, and pulses may have two durations, or one each,
    if that gains more than its price.
    """
    rows = Rows(residual, whiten, kind, sample_time, lead, follows)
    refine = refine and kind.shape != "jump"
    (found,) = rows.search([_form(rows, refine)], range(len(rows.white)), timed=2 if refine else 0)
    return rows.as_events(found)


FEW_ROWS = 16  # number of rows, those with the largest residuals, from which durations are chosen and refined
PASSES, FINER = 2, 4
"""Passes of the refinement of a duration, and steps between neighbours of the previous pass: from a factor of
2 to one of 1.04, within which the gain is flat."""


def _form(rows: Rows, refine: bool) -> Form:
    """Return the form of largest gain, first on the grid and then, to `refine` it, between its values."""
    recession, grid = rows.kind.shape == "recession", rows.kind.samples(rows.T)
    some = sorted(np.argsort(-(rows.white**2).sum(1), kind="stable")[:FEW_ROWS].tolist())

    def best(forms: list[Form], timed: int = 0) -> _Found:
        return max(rows.search(forms, some, timed, CHOOSING), key=lambda f: f.gain)

    if len(grid) == 1 and not refine:
        return Form(grid)
    now = best([Form((x,)) for x in grid])
    if not refine or not now.events:
        return now.form
    if recession:
        now = best([now.form._replace(rise=round(x / rows.T)) for x in RISES])
    now = _finer(now, 0, grid, best)
    if recession:
        return now.form
    two = best([Form((*now.form.durations, x)) for x in grid if x not in now.form.durations], timed=1)
    if two.gain > now.gain + rows.price:
        two = _finer(_finer(two, 0, grid, best), 1, grid, best)
    # A wrong duration can compensate for a start between samples: forms are compared at their best starts.
    free = best([Form(grid, ends=True)], timed=1)
    paid = ((now.gain, now.form), (two.gain - rows.price, two.form), (free.gain, free.form))
    return max(paid)[1]


def _finer(now: _Found, which: int, grid: Sequence[float], best: Callable[..., _Found]) -> _Found:
    """Refine one duration of a form between the values of a grid; the last pass refines starts as well."""
    ratio = max(b / a for a, b in zip(grid, grid[1:], strict=False)) if len(grid) > 1 else 2.0
    for turn in range(PASSES):
        ratio **= 1.0 / FINER
        durations = list(now.form.durations)
        forms = []
        for k in range(-FINER + 1, FINER):
            durations[which] = min(max(now.form.durations[which] * ratio**k, grid[0]), grid[-1])
            forms.append(now.form._replace(durations=tuple(durations)))
        now = best(forms, int(turn == PASSES - 1))
    return now


WITHIN = 1800.0  # largest distance of two starts at the same hour of the day [s]
ASTRAY = 2 * HOUR
"""Least scatter of natural events in their time of the day: thunderstorms come in the afternoon."""


def timetable(events: Sequence[Event], *, draws: int = 999, seed: int = 0) -> tuple[float, float]:
    """Test whether events start at the same hours of the day: p-value, and share of starts at frequent hours.

    The statistic is the number of pairs at the same hour; in the null distribution each start is up to
    :data:`ASTRAY` off. p is 1 with events of one day only. Events under way at a row's start are left out.
    """
    counted = [e for e in events if not e.under_way]
    starts = np.array([e.start_s % DAY for e in counted])
    if len({e.day for e in counted}) < 2:
        return 1.0, 0.0
    observed = _agreeing(starts[None])[0]
    off = np.random.default_rng(seed).uniform(-ASTRAY, ASTRAY, (draws, len(starts)))
    by_chance = np.mod(starts + off, DAY)
    p_value = float((1 + (_agreeing(by_chance) >= observed).sum()) / (1 + draws))
    left = np.ones(len(starts), bool)
    while left.any():
        apart = np.abs(starts[:, None] - starts)
        near = (np.minimum(apart, DAY - apart) <= WITHIN) & left
        members = near[int(np.argmax(near.sum(1)))]
        if members.sum() < max(3, 0.15 * len(starts)):
            break
        left &= ~members
    return p_value, float(1.0 - left.mean())


def size_variation(events: Sequence[Event]) -> float:
    """Return the coefficient of variation of the sizes of several events beyond standard errors [-]."""
    a = np.array([e.size for e in events])
    own = max(float(a.var(ddof=1)) - float(np.mean([e.size_se**2 for e in events])), 0.0)
    return float(np.sqrt(own) / max(abs(float(a.mean())), 1e-300))


def _agreeing(starts: Floats) -> Ints:
    """Count pairs of starts (draws, events) up to about :data:`WITHIN` apart by the clock, by cyclic bins."""
    ring = round(DAY / (WITHIN / 3.0))
    bins = np.minimum((starts * (ring / DAY)).astype(np.int64), ring - 1)
    cell = bins + ring * np.arange(len(starts))[:, None]
    counts = np.bincount(cell.ravel(), minlength=ring * len(starts)).reshape(len(starts), ring)
    near = sum(np.roll(counts, shift, axis=1) for shift in range(-3, 4))
    return np.asarray((counts * near).sum(1), np.int64)


FEWEST = 3  # fewest events of a kind
ALIKE = 0.75  # largest coefficient of variation of the sizes of releases
A_STORM = 3 * HOUR  # events that follow each other within this time are one storm [s]
SCHEDULED = 0.002  # p-value of a timetable at or below which events are operated, not natural
MOST_PULSE, MOST_RAIN = 3.0, 10.0
"""Largest size over the median: for an event cut off by midnight only the start is observed."""


def kind_of(effect: type[Effect], kernels: dict[str, Floats]) -> Kind:
    """Return the kind of an effect's events: jumps of the gauge, recessions or pulses."""
    # Recessions and pulses of an unknown flow enter along the reach, other pulses at the lower dam.
    if effect.found_as == "jump":
        return Kind(effect.name, "jump", 0, np.ones_like(kernels["down"]))
    if effect.found_as == "recession":
        return Kind(effect.name, "recession", 1, kernels["middle"])
    if issubclass(effect, PassingFlow):
        return Kind(effect.name, "pulse", 1, kernels["middle"])
    return Kind(effect.name, "pulse", -1, -kernels["down"])


def _storms(events: Sequence[Event]) -> list[Event]:
    """Return the first event of each storm: a slow rise is coded as several consecutive events."""
    found = sorted(events, key=lambda e: (e.day, e.start_s))
    at = [e.day * DAY + e.start_s for e in found]
    return list(compress(found, np.diff(at, prepend=-np.inf) > A_STORM))


def as_effect(effect: type[Effect], events: Events, record: Record) -> Effect:
    """Return the effect with its events; starts are hours since the first day's midnight."""
    number = record.day_number
    starts = tuple(float((number[e.day] * DAY + e.start_s) / HOUR) for e in events.events)
    sizes = np.array([e.size for e in events.events])
    if effect.found_as == "jump":
        return effect.from_events(starts, sizes.tolist(), 0.0)
    alike = effect.found_as == "pulse" and effect.name
    most = (MOST_PULSE if alike else MOST_RAIN) * float(np.median(np.abs(sizes)))
    lasts = tuple(e.duration_s / HOUR for e in events.events)
    made = effect.from_events(
        starts, np.minimum(np.abs(sizes), most).tolist(), lasts[0] if np.ptp(lasts) == 0.0 else lasts
    )
    if events.rise_s > 0.0 and "rise" in effect.parameters():
        made = made.with_values(rise=events.rise_s / HOUR)
    return made


def plausible(found: Events) -> bool:
    """Return whether events resemble their kind: releases have similar sizes, rain has no timetable."""
    if found.kind.shape == "jump":
        return bool(found.events)
    if len(found.events) < FEWEST:
        return False
    if found.kind.shape == "pulse":
        return not found.kind.name or size_variation(found.events) <= ALIKE
    p_value, share = timetable(_storms(found.events))
    return not (p_value <= SCHEDULED and share > 0.5)
