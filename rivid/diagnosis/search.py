"""Candidates: every effect of the library, in its best window, linearised about a fitted explanation.

The columns of all trials are computed once for a response, and whitened with the noise of the explanation.
For a window W of days, with the whitened column w of a candidate, the residual r of the explanation and the
columns X of its parameters (priors in G = X'X + P),

    gain = s' Q^-1 s / 2,    s = sum_W w'r,    Q = sum_W w'w - (sum_W X'w)' G^-1 (sum_W X'w),

sums over days, so that cumulative sums give all windows. The choice of a window inside the season has a
price: each window of a kind is equally probable, and the whole season is as probable as all of them together.
"""

import datetime as dt
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.events import Events, as_effect, find_events, kind_of, plausible
from rivid.diagnosis.explanation import Explanation, Unknown, fitted
from rivid.diagnosis.fit import DIFFERENCE, MEMORY, WIND, Model, residual_of
from rivid.diagnosis.noise.model import KEPT, KEPT_MEAN, NoiseModel
from rivid.diagnosis.response.base import kernels_of, vector_of
from rivid.diagnosis.seiche import seiche
from rivid.effects import Dates, Effect, Trial, changes_of
from rivid.errors import RividError
from rivid.types import DAY, HOUR, Bools, Floats, Ints

HOURS_A_DAY = 24


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect that may be missing, with its window and a first estimate of its size."""

    effect: Effect
    free: tuple[str, ...]
    gain: float  # of the log-likelihood, linearised [nats]
    log_prior: float  # of its window [nats]
    shift: Floats  # (k,): change of the explanation's own parameters
    make: Callable[[float], Effect]  # the effect at a multiple of its size
    columns: Floats  # (k, days, n): of its trial on all days
    size: Floats  # (k,): multiples of these columns

    @property
    def kind(self) -> tuple[Any, ...]:
        """Name, dates, hours and place."""
        effect = self.effect
        return effect.name, effect.dates, effect.hours, getattr(effect, "place", None)

    @property
    def worth(self) -> float:
        """Gain minus the price of the window [nats]."""
        return self.gain + self.log_prior


@dataclass(frozen=True, eq=False)
class Library:
    """The columns of all trials, linearised about a model."""

    # trials, and columns (k, days, n) of each in single precision; (24, days, n) of an hourly trial
    trials: tuple[tuple[Trial, Floats], ...]
    kernels: dict[str, Floats]  # step responses by place

    @classmethod
    def of(cls, model: Model, record: Record, classes: dict[str, type[Effect]]) -> "Library":
        """Compute the columns of the effects that are possible in a record's reach."""
        able = (e for e in classes.values() if e.acts_on(record.kind))
        kernels = kernels_of(model.reach, record)
        reach = model.reach.rough
        base = reach.baseline(record, model.changes(record))
        trials: list[tuple[Trial, Any]] = []
        world = record.world(model.level, model.flow)

        @cache
        def hourly(place: str) -> Any:
            return np.asarray(hour_columns(record, kernels[place]), np.float32)

        of_response = {p.name for p in model.reach.parameters}
        for effect, trial in ((kind, trial) for kind in able for trial in kind.trials(world)):
            free = tuple(k for k in trial.free if effect.held_by.get(k) not in of_response)
            trial = replace(trial, free=free)
            if trial.hourly:
                trials.append((trial, hourly(trial.hourly)))
                continue
            columns = np.empty((len(trial.effects), *base.shape), np.float32)
            try:
                for k, (one, size) in enumerate(zip(trial.effects, trial.sizes, strict=True)):
                    run = reach.baseline(record, changes_of((*model.effects, one), world))
                    columns[k] = (run - base) / size
            except RividError:  # the reach cannot carry the flows
                continue
            trials.append((trial, columns))
        return cls(tuple(trials), kernels)

    def scatter(self, one: Explanation, record: Record, blocks: Ints) -> float:
        """Return the median inflation of an explanation's residual, over the first trial of each name."""
        first: dict[str, Floats] = {}
        for trial, columns in self.trials:
            if not trial.hourly:
                first.setdefault(trial.name, columns)
        return float(np.median([scatter_of(one, columns, record, blocks) for columns in first.values()]))


def hour_columns(record: Record, kernel: Floats) -> Floats:
    """Return the output for 1 m3/s in each hour of the day, (24, days, n), by convolution."""
    # `kernel` (n,) is the step response: the output at each sample after 1 m3/s sets in. The reach is taken
    # as linear here; candidates are refitted in the simulator afterwards.
    days, n = record.time.shape
    pulse = np.diff(kernel, prepend=0.0)
    columns = np.empty((HOURS_A_DAY, days, n))
    hour = np.mod(record.time, DAY) / 3600.0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(pulse, size)
    for h in range(HOURS_A_DAY):
        on = ((hour >= h) & (hour < h + 1)).astype(float)
        columns[h] = np.fft.irfft(np.fft.rfft(on, size, axis=1) * spectrum, size, axis=1)[:, :n]
    return columns


def screened_again(
    one: Explanation, found: Sequence[Candidate], library: Library, record: Record
) -> list[Candidate]:
    """Return the candidates with the noise that the best one leaves, two of each name, best first.

    What is missing has been fitted as noise: a lasting flow as weather with the longest memory, in which its
    dates and most of its gain disappear. Therefore the noise is fitted to the residual less the best
    candidate: that of `found`, with the noise of the explanation, and that with weather of a memory up to the
    geometric middle of the plausible ones. Gains include what the explanation loses with that noise, but not
    what it gains, which needs no effect.
    """
    opened = one.weights > 0.0
    few, weights = record.take(opened), one.weights[opened]
    off = _off(one)

    def seen(residual: Floats) -> Floats:
        return np.where(few.used, residual[opened], np.nan)

    def log_posterior(noise: NoiseModel, residual: Floats, off: Floats) -> float:
        return float(noise.log_likelihood(seen(residual), few.activity) @ weights - 0.5 * off @ off)

    def moved(noise: NoiseModel) -> tuple[Explanation, Floats]:
        return _at_optimum(replace(one, model=replace(one.model, noise=noise)), record)

    before, middle = log_posterior(one.noise, one.residual, off), float(np.sqrt(np.prod(MEMORY)))
    short, _ = moved(one.model.fit_noise(seen(one.residual), few, weights, memory=middle))
    tops = {top.kind: (top, short) for top in screened(short, library, record)[:1]}
    tops |= {top.kind: (top, one) for top in found[:1]}
    best: dict[Any, Candidate] = {}
    for top, base in tops.values():
        acting = one.active(record, top.effect)[:, None]
        output = np.tensordot(top.size, top.columns, 1) * acting + np.tensordot(top.shift, one.columns, 1)
        other, step = moved(short.model.fit_noise(seen(base.residual - output), few, weights))
        more = min(log_posterior(other.noise, other.residual, off + step) - before, 0.0)
        for o in screened(other, library, record):
            o = replace(o, gain=o.gain + more, shift=o.shift + step * one.sd)
            best[o.kind] = max(best.get(o.kind, o), o, key=lambda one: one.worth)
    return _two_each([*best.values()])


def screened_instead(
    one: Explanation, library: Library, record: Record, effect: Effect | None = None
) -> list[Candidate]:
    """Return the candidates in place of the last effect of an explanation, best first; if given, of `effect`.

    They have the noise of the explanation and, without its last effect, the linear optimum near its response.
    """
    model, last = one.model, len(one.model.effects) - 1
    bare = replace(model, effects=model.effects[:last], free=model.free[:last])
    try:
        left = residual_of(record, bare.baseline(record)) - one.coded
    except RividError:  # the reach cannot carry the flows
        return []
    mine = np.array([i == last for i, _, _ in model.slots()], bool)
    own, sd = one.own[~mine], one.sd[np.append(np.ones(len(one.shared), bool), ~mine)]
    base, _ = _at_optimum(replace(one, model=bare, residual=left, own=own, sd=sd), record)
    same = tuple(pair for pair in library.trials if effect is None or pair[0].name == effect.name)
    return screened(base, Library(same, library.kernels), record)


def _off(one: Explanation) -> Floats:
    """Return how far the parameters are from their prior means, in prior standard deviations, shape (k,)."""
    free, off = one.model.reach.parameters, np.zeros(len(one.sd))
    off[: len(free)] = (vector_of(one.model.reach) - [p.mean for p in free]) / one.sd[: len(free)]
    return off


def _at_optimum(one: Explanation, record: Record) -> tuple[Explanation, Floats]:
    """Move the residual to the linear optimum of the parameters; return also their step (k,) in prior sd."""
    white, columns = one.whitened(record)
    r, X = white(one.residual[None]).ravel(), columns.reshape(len(columns), -1)
    step = np.asarray(np.linalg.solve(X @ X.T + np.eye(len(X)), X @ r - _off(one)))
    return replace(one, residual=one.residual - np.tensordot(step * one.sd, one.columns, 1)), step


def screened(
    base: Explanation, library: Library, record: Record, beside: Effect | None = None
) -> list[Candidate]:
    """Return the two best candidates of each name, best first; only of effects confounded with `beside`."""
    white, X = base.whitened(record)
    r, flat = white(base.residual[None])[0], X.reshape(len(X), -1)
    G = np.asarray(np.linalg.inv(flat @ flat.T + np.eye(len(X))), float)
    open_days = np.flatnonzero(base.weights > 0.0)
    before = np.zeros(record.time.shape)
    before[:, : record.lead] = 1.0  # 1 m until the midnight before each day
    found: list[Candidate] = []

    def products(w: Floats) -> tuple[Floats, Floats, Floats]:
        """Multiply whitened columns by the residual, by each other and by the parameters' columns."""
        s = np.einsum("kdn,dn->kd", w, r)
        q = np.einsum("kdn,ldn->kld", w, w, optimize=True)
        return s, q, np.einsum("pdn,kdn->pkd", X, w, optimize=True)

    for trial, columns in library.trials:
        if beside is not None and not any(
            one.name in beside.confounded_with or beside.name in one.confounded_with for one in trial.effects
        ):
            continue
        w = white(columns)
        if not w.any():
            continue
        reset = products(white(before[None])) if any(one.set_right for one in trial.effects) else None
        given = trial, columns, *products(w), G, base.sd, record, open_days
        found += _hourly(*given) if trial.hourly else _windows(*given, beside, reset)
    return _two_each(found)


def _two_each(found: Sequence[Candidate]) -> list[Candidate]:
    """Return the two best candidates of each name, best first."""
    kept, count = list[Candidate](), Counter[str]()
    for one in sorted(found, key=lambda one: -one.worth):
        count[one.effect.name] += 1
        if count[one.effect.name] <= 2:
            kept.append(one)
    return kept


def _windows(
    trial: Trial, columns: Floats, s: Floats, q: Floats, c: Floats, G: Floats, sd: Floats, record: Record,
    open_days: Ints, beside: Effect | None, reset: tuple[Floats, Floats, Floats] | None,
) -> list[Candidate]:  # fmt: skip
    """Return a trial in the season and in its best window of dates (and hours), or at those of `beside`."""
    days = s.shape[1]
    first, end, prior = _spans(trial.dates, days)
    S, Q, C = (_summed(part, first, end) for part in (s, q, c))
    if reset is not None:  # the drift in the window is reset at the midnight after it
        number = record.day_number[open_days]
        grown = np.append(number, number[-1] + 1)[end] - number[first]
        grown = np.where(end < days, grown, 0) * np.append(np.diff(number) == 1, False)[end - 1]
        after = np.minimum(end, days - 1)
        S += grown[:, None] * np.moveaxis(reset[0][..., after], -1, 0)
        Q += grown[:, None, None] ** 2 * np.moveaxis(reset[1][..., after], -1, 0)
        C += grown[:, None, None] * np.moveaxis(reset[2][..., after], -1, 0)
    left = Q - np.einsum("wpk,pr,wrl->wkl", C, G, C, optimize=True)
    size = np.einsum("wkk->wk", Q)
    solid = np.einsum("wkk->wk", left) > LEAST_LEFT * size
    left = left + 1e-9 * size.max(axis=1)[:, None, None] * np.eye(len(s)) + 1e-300 * np.eye(len(s))
    b = np.linalg.solve(left, S[..., None])[..., 0]
    gain = 0.5 * np.einsum("wk,wk->w", S, b)
    gain[~solid.all(axis=1)] = 0.0
    if trial.sign:
        gain[trial.sign * b[:, 0] <= 0.0] = 0.0
    found = []
    windows = [np.arange(len(first)) == 0, np.arange(len(first)) > 0]
    if beside is not None and beside.dates is None:
        windows = windows[:1]
    elif beside is not None:
        spans = zip(first.tolist(), end.tolist(), strict=True)
        windows = [np.array([_dates(record, open_days, a, b) == beside.dates for a, b in spans])]
    for rows in windows:
        able = np.flatnonzero(rows)
        if not len(able):
            continue
        i = able[int(np.argmax(gain[able] + prior[able]))]
        if gain[i] <= 0.0 or i == 0 and trial.effects[0].needs_dates:
            continue
        effect, shift = trial.make(b[i]), -G @ (C[i] @ b[i]) * sd
        if i > 0:
            effect = replace(effect, dates=_dates(record, open_days, int(first[i]), int(end[i])))
        found.append(candidate_of(effect, trial, columns, float(gain[i]), float(prior[i]), shift, b[i]))
    return found


def _summed(a: Floats, first: Ints, end: Ints) -> Floats:
    """Sum over windows of the last axis, shape (windows, ...)."""
    sums = np.concatenate([np.zeros((*a.shape[:-1], 1)), np.cumsum(a, axis=-1)], axis=-1)
    return np.moveaxis(sums[..., end] - sums[..., first], -1, 0)


def candidate_of(
    whole: Effect, trial: Trial, columns: Floats, gain: float, log_prior: float, shift: Floats, size: Floats
) -> Candidate:  # fmt: skip
    """Return a candidate of a trial from an effect of its kind, of any size and dates."""
    key = trial.free[0]
    value = getattr(whole, key)

    def make(share: float) -> Effect:
        if isinstance(value, tuple):
            return whole.with_values(**{key: tuple(whole.clipped(key, share * one) for one in value)})
        return whole.with_values(**{key: whole.clipped(key, share * value)})

    return Candidate(make(1.0), trial.free, gain, log_prior, shift, make, columns, size)


def inflation_of(score: Floats, information: Floats, blocks: Ints) -> float:
    """Return the variance of block scores over that under the noise model, 1 or more.

    Scores and information (k, days) are w'r and w'w of whitened columns w and residual r. A response with the
    same error for days gives more than 1. The largest quarter is left out: a few bad days do not count.
    """
    label = np.unique(blocks, return_inverse=True)[1]
    many = int(label.max()) + 1
    found = []
    for s, q in zip(score, information, strict=True):
        sums, sizes = np.bincount(label, s, many), np.bincount(label, q, many)
        shown = sizes > SHOWN * sizes.max(initial=0.0)
        squares: Floats = np.sort(np.asarray(sums[shown] ** 2 / sizes[shown], float))
        kept = squares[: max(1, round(KEPT * len(squares)))]
        found.append(float(kept.mean()) / KEPT_MEAN if len(kept) else 1.0)
    return max(float(np.mean(found)), 1.0)


def scatter_of(one: Explanation, columns: Floats, record: Record, blocks: Ints) -> float:
    """Return the inflation of an explanation's residual, by columns (k, days, n); `blocks` (days,)."""
    opened = one.weights > 0.0
    few = record.take(opened)
    seen = np.where(few.used, one.residual[opened], np.nan)
    r = one.noise.whiten(seen, activity=few.activity)
    w = one.noise.whiten(columns[:, opened], like=seen, activity=few.activity)
    score, information = np.einsum("kdn,dn->kd", w, r), np.einsum("kdn,kdn->kd", w, w)
    return inflation_of(score, information, blocks[opened])


SHOWN = 0.01  # share of the largest block's information below which a block is ignored


LEAST_LEFT = 0.02
"""Least share of a column's information, beyond the response's parameters, at which it is estimated."""
FEWEST = 4  # open days that a window of dates at least holds, and leaves out: one block and a neighbour


def _spans(dates: Dates, days: int) -> tuple[Ints, Ints, Floats]:
    """Return first day, end and log prior of the windows of a kind; the whole season comes first."""
    first, end = np.triu_indices(days + 1, FEWEST)
    kinds = {"all": first < 0, "from": end == days, "until": first == 0, "between": first >= 0}
    inside = kinds[dates] & (end - first <= days - FEWEST)
    a, b = first[inside], end[inside]
    one_end = (a == 0) | (b == days)
    prior = np.empty(len(a))
    both = bool((~one_end).any())
    for group in (one_end, ~one_end):  # both groups have the same total probability
        prior[group] = -np.log(2.0 * (2.0 if both else 1.0) * max(int(group.sum()), 1))
    whole = 0.0 if not len(a) else -float(np.log(2.0))
    return (
        np.concatenate([[0], a]), np.concatenate([[days], b]), np.concatenate([[whole], prior]),
    )  # fmt: skip


def _dates(record: Record, open_days: Ints, first: int, end: int) -> tuple[dt.date, dt.date]:
    """Return the dates of a window: up to the season's ends, or half-way over the sealed days beside it."""
    a = 0 if first == 0 else int(open_days[first - 1] + open_days[first] + 1) // 2
    b = record.days - 1 if end == len(open_days) else int(open_days[end - 1] + open_days[end] - 1) // 2
    return record.dates[a], record.dates[b]


Window = tuple[tuple[dt.date, dt.date] | None, tuple[float, float] | None]
"""Dates and hours of an effect."""


def windows_near(window: Window, record: Record, open_days: Ints) -> list[Window]:
    """Return windows with one end of the dates moved by an open day, or of the hours by an hour."""
    # An end of the season is kept, and an end inside it stays inside.
    (dates, hours), found = window, list[Window]()
    moves = ((-1, 0), (1, 0), (0, -1), (0, 1))
    if hours is not None:
        for by, to in moves:
            start, stop = (hours[0] + by) % HOURS_A_DAY, (hours[1] + to) % HOURS_A_DAY
            if start != stop:
                found.append((dates, (start, stop or float(HOURS_A_DAY))))
    if dates is not None:
        inside = [i for i, day in enumerate(open_days) if dates[0] <= record.dates[day] <= dates[1]]
        first, end = inside[0], inside[-1] + 1
        for by, to in moves:
            a, b = first + by, end + to
            inner = min(first, a) > 0 if by else max(end, b) < len(open_days)
            if inner and FEWEST <= b - a <= len(open_days) - FEWEST:
                found.append((_dates(record, open_days, a, b), hours))
    return found


def _hourly(
    trial: Trial, columns: Floats, s: Floats, q: Floats, c: Floats, G: Floats, sd: Floats, record: Record,
    open_days: Ints,
) -> list[Candidate]:  # fmt: skip
    """Return a release in a run of hours: in the whole season, and in its best window of dates.

    Hours are first chosen with windows between some dates, then dates and hours in turn until none changes.
    """
    days = s.shape[1]
    first, end, prior = _spans(trial.dates, days)
    grid = np.linspace(0, days, GRID + 1).round()

    def runs(rows: Ints) -> tuple[Floats, Ints, Ints]:
        """Return the gain of the best run of hours in each window, prior included, its start and length."""
        S, Q, C = (_summed(part, first[rows], end[rows]) for part in (s, q, c))
        left = Q - np.einsum("wpk,pr,wrl->wkl", C, G, C, optimize=True)
        gain, start, length = _best_hours(S, left, Q, trial.sign)
        return gain + prior[rows], start, length

    found = []
    inside = np.flatnonzero(np.isin(first, grid) & np.isin(end, grid))
    for rows in (inside[:1], inside[1:]):
        if not len(rows):
            continue
        gains, starts, lengths = runs(rows)
        i = int(np.argmax(gains))
        total, row, start, length = gains[i], int(rows[i]), int(starts[i]), int(lengths[i])
        while row > 0:  # each turn gains
            hours = (start + np.arange(length)) % HOURS_A_DAY
            parts = s[hours].sum(axis=0), q[np.ix_(hours, hours)].sum(axis=(0, 1)), c[:, hours].sum(axis=1)
            S, Q, C = (_summed(part, first[1:], end[1:]) for part in parts)
            left = Q - np.einsum("wp,pr,wr->w", C, G, C, optimize=True)
            near = 1 + int(np.argmax(_gain(S, left, Q, trial.sign) + prior[1:]))
            gains, starts, lengths = runs(np.array([near]))
            if gains[0] <= total + 1e-9:
                break
            total, row, start, length = gains[0], near, int(starts[0]), int(lengths[0])
        if total <= prior[row]:
            continue
        hours = (start + np.arange(length)) % HOURS_A_DAY
        span = slice(first[row], end[row])
        bent, gain = G @ c[:, hours, span].sum(axis=(1, 2)), float(total - prior[row])
        size = 2.0 * gain / float(s[hours, span].sum())
        until = (start + length) % HOURS_A_DAY or HOURS_A_DAY
        dates = _dates(record, open_days, int(first[row]), int(end[row])) if row > 0 else None
        effect = replace(trial.make(np.array([size])), hours=(float(start), float(until)), dates=dates)
        price = float(prior[row] - np.log(HOURS_A_DAY * (HOURS_A_DAY - 1)))
        whole = columns[hours].sum(axis=0)[None]
        found.append(candidate_of(effect, trial, whole, gain, price, -bent * size * sd, np.array([size])))
    return found


GRID = 24
"""Parts of a season between which a window of hours first begins and ends: 300 windows, so that a month and a
year take the same time."""


def _best_hours(score: Floats, left: Floats, whole: Floats, sign: int) -> tuple[Floats, Ints, Ints]:
    """Return gain, start and length of the best run of hours of each window.

    Scores (windows, 24); information (windows, 24, 24) beyond the response's parameters, and all of it.
    """
    start, many = np.arange(HOURS_A_DAY)[:, None], np.arange(HOURS_A_DAY - 1)
    twice = np.arange(2 * HOURS_A_DAY) % HOURS_A_DAY
    hour = start + many

    def over_runs(info: Floats) -> Floats:
        up_to = np.cumsum(info[:, twice[:, None], twice], axis=1)
        before = np.where(start > 0, up_to[:, start - 1, hour], 0.0)
        own = info[:, twice[hour], twice[hour]]
        return np.asarray(np.cumsum(2.0 * (up_to[:, hour, hour] - before) - own, axis=2))

    sums = np.cumsum(score[:, twice[hour]], axis=2)
    gains = _gain(sums, over_runs(left), over_runs(whole), sign).reshape(len(score), -1)
    best = np.argmax(gains, axis=1)
    return gains[np.arange(len(best)), best], best // len(many), best % len(many) + 1


def _gain(score: Floats, left: Floats, whole: Floats, sign: int) -> Floats:
    s = np.maximum(sign * score, 0.0) if sign else score
    safe = np.where(left > LEAST_LEFT * whole, left, np.inf)
    return np.asarray(0.5 * s * s / safe)


SHARES = (0.1, 0.3, 0.6, 1.0, 2.0, 4.0, 8.0)
"""Multiples of a candidate's size at which its fit may begin. For a delay that follows the flow, to which the
response had adapted, the first estimate was a sixth. 0.6 leaves no gap wider than 2 for a clock; its column
holds within 1.5 times."""
APART = 3
"""The multiple is chosen on every third of the open days, in order of the candidate's output on them: on all
days that took a seventh of the time of a diagnosis."""
CODINGS = 2  # searches for events: the second one is refined and uses the noise of the first one's residual


def with_effect(parent: Explanation, candidate: Candidate, record: Record, log_prior: float) -> Explanation:
    """Return an explanation with one more effect in the simulator, all parameters fitted together."""
    model, p = parent.model, len(parent.model.reach.parameters)
    tried: list[tuple[float, float, Model]] = []
    opened = np.flatnonzero(parent.weights > 0.0)
    acting = np.argsort(-np.sum(candidate.columns[:, opened] ** 2, axis=(0, 2)), kind="stable")
    some = np.isin(np.arange(record.days), opened[acting[::APART]])
    # The columns are valid near the fit, where the response may be biased by the effect, or not.
    for share, bent in product(SHARES, (True, False)):
        try:
            reach = model.reach.with_parameters(
                vector_of(model.reach) + bent * min(share, 1.0) * candidate.shift[:p]
            )
            larger = replace(
                model, reach=reach, effects=(*model.effects, candidate.make(share)),
                free=(*model.free, candidate.free),
            )  # fmt: skip
            tried.append((squares_left(larger, parent, record, some), share, larger))
        except RividError:
            continue
    if not tried:
        raise RividError(f"{candidate.effect.name}: the reach cannot carry the flows with it")
    _, share, larger = min(tried, key=lambda one: one[0])
    for key in set(candidate.free) & set(candidate.effect.stepwise):
        larger = stepped(larger, key, parent, record)
    return fitted(
        larger, record, parent.weights > 0.0, draft=parent.extended(log_prior + candidate.log_prior),
        start=parent, fresh=2 if share > 1.0 else 0,
    )  # fmt: skip


MANY_STEPS, FEW_STEPS = 80, 8
"""Values tried of a stepwise parameter: at first, over its range, and then about the best one in turn. Of
2,000 steps, 40 at first left a ratio of 1.2, and missed a band of 26 m3/s."""


def command_steps(record: Record) -> tuple[float, float]:
    """Return the smallest usual step of the commanded outflow, and the largest one [m3/s]."""
    moves = np.abs(np.diff(record.outflow, axis=1))
    moves = moves[moves > 1e-6] if (moves > 1e-6).any() else np.ones(1)
    return float(np.quantile(moves, 0.02)), float(moves.max())


def stepped(model: Model, key: str, parent: Explanation, record: Record) -> Model:
    """Return a model with the likeliest value of a stepwise parameter of its last effect.

    It is no longer free where its column would be that between two commands, at which the output is the same.
    """
    # Commands are quantised, and a band between two of them acts as the larger one. Values lie half-way
    # between commands, up to the largest change of the outflow; of many, first some at equal ratios.
    step, most = command_steps(record)
    effect, fixed = model.effects[-1], tuple(k for k in model.free[-1] if k != key)
    tried: dict[int, tuple[float, Model]] = {}
    low, high, many = 1, int(most / step) + 2, MANY_STEPS
    while True:
        for number in np.unique(np.geomspace(low, high, many).round().astype(int)).tolist():
            if number not in tried:
                value = effect.clipped(key, (number - 0.5) * step)
                free = fixed if DIFFERENCE * value < step else model.free[-1]
                other = replace(
                    model, effects=(*model.effects[:-1], effect.with_values(**{key: value})),
                    free=(*model.free[:-1], free),
                )  # fmt: skip
                tried[number] = squares_left(other, parent, record), other
        best = min(tried, key=lambda each: tried[each][0])
        known = sorted(tried)
        place = known.index(best)
        low, high, many = known[max(place - 1, 0)], known[min(place + 1, len(known) - 1)], FEW_STEPS
        if all(number in tried for number in range(low, high)):
            return tried[best][1]


def squares_left(model: Model, parent: Explanation, record: Record, days: Bools | None = None) -> float:
    """Return the sum of squares of a model's residual on open days, with noise and weights of `parent`."""
    opened = parent.weights > 0.0 if days is None else days
    few = record.take(opened)
    base = model.rough.baseline(few) + parent.defect[opened]
    left = residual_of(few, base) - parent.coded[opened]
    white = parent.noise.whiten(np.where(few.used, left, np.nan), activity=few.activity)
    return float(parent.weights[opened] @ (white * white).sum(axis=1))


LEAST_EVENTS = 8.0
"""Least gain of all events together, minus their prices [nats]: that of a candidate that is tried."""


def with_events(
    parent: Explanation, effect: type[Effect], kernels: dict[str, Floats], record: Record, log_prior: float
) -> Explanation | None:
    """Return an explanation with events of a kind, found one by one in its residual; None without any."""
    kind = kind_of(effect, kernels)
    seen = np.where(record.used, parent.residual, np.nan)
    opened = parent.weights > 0.0
    follows = np.append(False, np.diff(record.day_number) == 1)
    if any(other.stepwise for other in parent.model.effects):
        seen[~follows] = np.nan  # where the gate rests is known from the day before: else it makes events
    plain = replace(record.take(opened), activity=None)
    found: Events | None = None
    for turn in range(CODINGS):
        left = seen if found is None else seen - found.coded
        noise = replace(parent.model, noise=None).fit_noise(left[opened], plain, None)
        found = find_events(
            seen, noise.whiten, kind, record.sample_time, lead=record.lead, follows=follows,
            refine=turn == CODINGS - 1,
        )  # fmt: skip
        if found.gain < LEAST_EVENTS or not plausible(found):  # refinement does not change this
            return None
    assert found is not None
    unknown: Unknown = "gauge" if effect.family == "level" else "flow"
    draft = parent.extended(
        log_prior, unknown=parent.unknown if effect.name else unknown,
        others=(*parent.others, as_effect(effect, found, record)), events=(*parent.events, found),
    )  # fmt: skip
    return fitted(parent.model, record, opened, draft=draft, start=parent)


def swung(one: Explanation, record: Record) -> Explanation | None:
    """Update the seiche of an explanation from its residual; None if the last effect has explained it."""
    swings = [i for i, effect in enumerate(one.others) if effect.found_as == "swing"]
    if not swings or one.bonus is not None:
        return one
    found = seiche(record, one, type(one.others[swings[0]]))
    if found is None:
        return None
    made, gains, _ = found
    others = tuple(made if i == swings[0] else effect for i, effect in enumerate(one.others))
    return replace(one, others=others, bonus=gains)


AT_LIMIT = 1.01
"""Ratio to a limit of its memory within which wind is rejected: it stands for a noise of another memory."""


def with_noise(
    parent: Explanation, effect: type[Effect], record: Record, log_prior: float,
    latent: Sequence[Explanation] = (),
) -> Explanation | None:  # fmt: skip
    """Return an explanation with a noise of the level: wind in the filter, or a seiche outside it."""
    # Wind starts from the parent with an unknown gauge (`latent`). A short weather memory and a large gauge
    # noise can hide a seiche: it is sought in the residual of `latent` too, and then takes its noise.
    opened = parent.weights > 0.0
    latent = [one for one in latent if one.names == parent.names]  # not of a rival
    if effect.found_as == "swing":
        swings = [(one, seiche(record, one, effect)) for one in (parent, *latent)]
        found = [(one, swing) for one, swing in swings if swing is not None]
        if not found:
            return None

        def likelihood(pair: tuple[Explanation, tuple[Effect, Floats, int]]) -> float:
            one, (_, gains, _) = pair
            seen = np.where(record.used, one.residual, np.nan)
            return float((one.noise.log_likelihood(seen, record.activity) + gains)[opened].sum())

        one, (made, gains, tried) = max(found, key=likelihood)
        bonus = gains if parent.bonus is None else gains + parent.bonus
        return replace(
            one, unknown=parent.unknown if made.name else "gauge", parent=parent, bonus=bonus,
            others=(*parent.others, made), log_prior=log_prior - float(np.log(tried)),
        )  # fmt: skip
    if parent.model.noise_kind != "plain":
        return None
    start = latent[0] if latent else parent
    model, draft = replace(start.model, noise_kind="wind"), parent.extended(log_prior)
    windy = fitted(model, record, opened, draft=draft, start=start)
    noise = windy.noise
    if not WIND[0] * AT_LIMIT < noise.level_memory < WIND[1] / AT_LIMIT:
        return None
    made = effect.from_table({"deviation": noise.level_sd, "correlation_time": noise.level_memory / HOUR})
    return replace(windy, others=(*windy.others, made))
