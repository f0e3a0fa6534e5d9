"""Candidates: every trial of the library scored, its window refined, its gain measured.

A proposal is an effect with its window, and the model refitted with it: likelihood on the fitting and the
selecting days, and the error of the simulation on the latter.

Dates and hours are refined by ascent on the likelihood gain. With the whitened column of each hour, score and
information of a window are sums over its days and hours:

    gain = (sum of scores)^2 / (2 sum of information).

For given dates the best run of hours is found, for given hours the best run of days, in turn.
"""

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.blocks import flip_blocks
from rivid.diagnosis.data import Record
from rivid.diagnosis.fit import Evaluation, Linear, evaluate
from rivid.diagnosis.score import Candidate, scan
from rivid.effects import Effect, Trial
from rivid.errors import RividError
from rivid.types import DAY, Floats

if TYPE_CHECKING:
    from rivid.diagnosis.events import Events

HOURS_A_DAY = 24
Window = tuple[tuple[dt.date, dt.date] | None, tuple[float, float] | None]


def hour_columns(record: Record, kernel: Floats) -> Floats:
    """Output for 1 m3/s in each hour of the day, shape (24, days, n), by convolution with a step response.

    `kernel` (n,) is the output at each sample after 1 m3/s sets in; the reach is linear here, and findings
    are fitted in the simulator afterwards.
    """
    days, n = record.time.shape
    pulse = np.diff(kernel, prepend=0.0)
    columns = np.empty((HOURS_A_DAY, days, n))
    hour = np.mod(record.time, DAY) / 3600.0
    for h in range(HOURS_A_DAY):
        on = ((hour >= h) & (hour < h + 1)).astype(float)
        size = 1 << (2 * n - 1).bit_length()
        spectrum = np.fft.rfft(on, size, axis=1) * np.fft.rfft(pulse, size)
        columns[h] = np.fft.irfft(spectrum, size, axis=1)[:, :n]
    return columns


def columns_of(trial: Trial, baseline: Callable[[Sequence[Effect]], Floats], before: Floats) -> Floats:
    """Columns (k, days, n) of a trial with instances: change of the output `before` (days, n) by each."""
    return np.stack(
        [
            (baseline((effect,)) - before) / size
            for effect, size in zip(trial.effects, trial.sizes, strict=True)
        ]
    )


def trials_of(classes: dict[str, type[Effect]], record: Record) -> list[Trial]:
    """Trials of the effects that are possible in a record's reach, in the order of the catalogue."""
    able = (e for e in classes.values() if record.kind == "pool" or e.acts_on_river)
    return [trial for effect in able for trial in effect.trials(record.sample_time)]


TURNS = 12
"""Most turns of an ascent; three are usual."""


@dataclass(frozen=True)
class Span:
    """A window."""

    first: int  # days, both included
    last: int
    hours: tuple[int, int] | None  # from and to; (22, 6) passes midnight. None is all day
    gain: float  # likelihood gain [nats]


def chance_of(
    score: Floats, information: Floats, span: Span, blocks: NDArray[np.int64], library: int, gain: float
) -> float:
    """A bound of the p of a window's gain, ``min(1, windows exp(-gain / (2 inflation)))``.

    Sign flips cannot give a small p for a window of few blocks, however large its gain. Here the gain is that
    of the noise model, divided by the inflation of the blocks' scatter once the effect is taken out, and by
    two for the choice of the window; all windows of the library count, for the whole season its candidates.

    Parameters
    ----------
    score, information
        As for :func:`best_span`.
    span : Span
    blocks : ndarray of int, shape (days,)
        Blocks of days.
    library : int
        Number of candidates searched.
    gain : float
        Likelihood gained with noise and response refitted [nats].
    """
    n, days = score.shape
    hours = (
        np.ones(n, bool)
        if span.hours is None
        else _run(n, span.hours[0], (span.hours[1] - span.hours[0]) % n)
    )
    s, q = score[hours].sum(axis=0), information[np.ix_(hours, hours)].sum(axis=(0, 1))
    inside = np.zeros(days, bool)
    inside[span.first : span.last + 1] = True
    left = s - np.where(inside, s[inside].sum() / q[inside].sum(), 0.0) * q
    labels, block = np.unique(blocks, return_inverse=True)
    sums = np.bincount(block, left, len(labels))
    longest = float(np.bincount(block).max())  # as if the days of a block were one
    inflation = float(np.clip((sums**2).sum() / q.sum(), 1.0, 2.0 * longest))
    windows = library * days * (days + 1) / 2 * max(n * (n - 1), 1)
    if span.first == 0 and span.last == days - 1 and span.hours is None:
        windows = library  # the whole season is tried in any case
    return float(min(1.0, windows * np.exp(-gain / (2.0 * inflation))))


def best_dates(score: Floats, information: Floats) -> Span:
    """Dates of largest gain for several columns in a window; score (k, days), information (k, k, days)."""
    s = np.concatenate([np.zeros((len(score), 1)), np.cumsum(score, axis=1)], axis=1)
    q = np.concatenate([np.zeros((*information.shape[:2], 1)), np.cumsum(information, axis=2)], axis=2)
    first, end = np.triu_indices(s.shape[1], 1)
    sums, Q = (s[:, end] - s[:, first]).T, np.moveaxis(q[..., end] - q[..., first], -1, 0)
    Q = (
        Q
        + 1e-9 * np.trace(Q, axis1=1, axis2=2)[:, None, None] * np.eye(len(score))
        + 1e-300 * np.eye(len(score))
    )
    gains = 0.5 * np.einsum("wk,wk->w", sums, np.linalg.solve(Q, sums[..., None])[..., 0])
    best = int(np.argmax(gains))
    return Span(int(first[best]), int(end[best]) - 1, None, float(gains[best]))


def combined(score: Floats, information: Floats, span: Span) -> tuple[Floats, Floats]:
    """Several columns as the one at their estimates in a window; (1, days), (1, 1, days)."""
    inside = slice(span.first, span.last + 1)
    c = np.linalg.lstsq(information[..., inside].sum(axis=2), score[:, inside].sum(axis=1), rcond=None)[0]
    return (c @ score)[None], np.einsum("k,l,kld->d", c, c, information)[None, None]


def best_span(score: Floats, information: Floats, sign: int = 0) -> Span:
    """The window of largest gain.

    Parameters
    ----------
    score : ndarray, shape (hours, days)
        Whitened column of each hour times the residual, summed over each day.
    information : ndarray, shape (hours, hours, days)
        Products of the whitened columns, summed over each day.
    sign : {-1, 0, 1}
        Sign of the effect; 0: any.
    """
    n = len(score)
    starts = [np.ones(n, bool), *(_run(n, h, 8) for h in range(0, n if n > 1 else 0, 4))]
    found = [_ascend(score, information, hours, sign) for hours in starts]
    return max(found, key=lambda span: span.gain)


def _ascend(score: Floats, information: Floats, hours: np.ndarray, sign: int) -> Span:
    best = Span(0, score.shape[1] - 1, None, -np.inf)
    for _ in range(TURNS):
        s = score[hours].sum(axis=0)
        q = information[np.ix_(hours, hours)].sum(axis=(0, 1))
        first, last, gain = _best_days(s, q, sign)
        days = slice(first, last + 1)
        inside = score[:, days].sum(axis=1), information[:, :, days].sum(axis=2)
        start, length, gain = _best_hours(*inside, sign)
        whole = length == len(score)
        span = Span(first, last, None if whole else (start, (start + length) % len(score)), gain)
        if span.gain <= best.gain + 1e-9:
            break
        best = span
        hours = _run(len(score), start, length)
    return best


def _best_days(score: Floats, information: Floats, sign: int) -> tuple[int, int, float]:
    s = np.concatenate([[0.0], np.cumsum(score)])
    q = np.concatenate([[0.0], np.cumsum(information)])
    sums, weight = s[None, :] - s[:, None], q[None, :] - q[:, None]
    gains = _gain(sums, weight, sign)
    gains[np.tril_indices(len(s))] = -np.inf
    first, end = np.unravel_index(int(np.argmax(gains)), gains.shape)
    return int(first), int(end) - 1, float(gains[first, end])


def _best_hours(score: Floats, information: Floats, sign: int) -> tuple[int, int, float]:
    n = len(score)
    best = (0, n, float(_gain(score.sum(), information.sum(), sign)))
    if n == 1:
        return best
    twice = np.concatenate([np.arange(n), np.arange(n)])
    for start in range(n):
        order = twice[start : start + n]
        s = np.cumsum(score[order])
        part = information[np.ix_(order, order)]
        q = np.cumsum(np.cumsum(part, axis=0), axis=1).diagonal()
        gains = _gain(s, q, sign)
        length = int(np.argmax(gains[:-1])) + 1
        if gains[length - 1] > best[2] + 1e-9:
            best = (start, length, float(gains[length - 1]))
    return best


def _gain(score: Floats, information: Floats, sign: int) -> Floats:
    s = np.maximum(sign * score, 0.0) if sign else score
    safe = np.where(information > 0, information, np.inf)
    return np.asarray(0.5 * s * s / safe)


def _run(n: int, start: int, length: int) -> np.ndarray:
    mask = np.zeros(n, bool)
    mask[(start + np.arange(length)) % n] = True
    return mask


MOST_USUAL = 4.0
"""Largest gain of a day, in gains of the usual day."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """An effect that might be missing."""

    name: str  # of the effect, and which of its trials
    label: str
    effect: Effect  # with its window
    free: tuple[str, ...]  # parameters to refit
    window: Window  # dates and hours; None where it always acts
    p_value: float  # family-wise, of the whole library
    evaluation: Evaluation
    columns: Floats  # (k, days, n): what was tried; empty for a noise
    gain_fit: float  # log-likelihood gained on the fitting (priors included) and the selecting days [nats]
    gain_select: float
    t: float  # paired gain on the selecting blocks over its standard error
    improvement: Floats  # (horizons,): share by which the error of the simulation falls on the selecting days
    blocks: int  # selecting blocks on which it acts
    events: "Events | None" = None
    level_noise: bool = False  # whether the proposal is a noise of the level (wind, a seiche)
    # Standard errors of a noise's parameters, where they are known.
    spreads: dict[str, float] = field(default_factory=dict)
    gains: Floats | None = None  # (days,): of a noise: its gain on each day [nats]


def compared(
    model: Linear, before: Evaluation, after: Evaluation, price: Floats, active: Floats
) -> tuple[float, float, float, Floats, int]:
    """Gains on fitting and selecting days, t of the latter by blocks, and the fall of the error.

    `price` [nats], shape (days,), is what the days pay for events; t and error are of the selecting days that
    are `active`, where the candidate acts; the last number is the number of their blocks.
    """
    gain = after.likelihood - before.likelihood
    gain = gain * np.minimum(before.weights, after.weights) - price
    if not price.any():  # outliers are limited, but for events, which are rare days
        usual = np.median(np.abs(gain[active > 0])) if (active > 0).any() else 0.0
        gain = np.clip(gain, -MOST_USUAL * usual - 5.0, MOST_USUAL * usual + 5.0)
    split = model.split
    chosen = split.select & (active > 0)
    blocks = split.block[chosen]
    sums = np.array([gain[chosen][blocks == b].sum() for b in np.unique(blocks)])
    if len(sums) > 1:
        t = float(sums.mean() / max(sums.std(ddof=1) / np.sqrt(len(sums)), 1e-9))
    else:  # one block has no spread: that of its days
        days = gain[chosen]
        t = float(days.mean() / max(days.std(ddof=1) / np.sqrt(len(days)), 1e-9)) if len(days) > 1 else 0.0
    old, new = before.errors.rmse(chosen), after.errors.rmse(chosen)
    return (
        float(gain[split.fit].sum() + before.penalty - after.penalty), float(gain[split.select].sum()), t,
        np.nan_to_num(1.0 - new / old), len(sums),
    )  # fmt: skip


LOOK = 0.05
"""Candidates with a smaller family-wise p are measured."""
PROMISING = 4.0
"""Likelihood gain of a trial as a whole [nats] from which it is measured."""
CLEAR = 15.0
"""Gain of a window [nats] from which it is measured whatever its p."""
ALWAYS = 0.9
"""Share of the days from which a window is the whole season."""
Baseline = Callable[[Sequence[Effect]], Floats]


def proposals(
    model: Linear,
    before: Evaluation,
    trials: Sequence[Trial],
    baseline: Baseline,
    kernels: dict[str, Floats],
    *,
    seed: int = 0,
    flips: int = 4_999,
) -> list[Proposal]:
    """Score the library on the days that fit and select, and measure what stands out.

    Parameters
    ----------
    model : Linear
    before : Evaluation
        The model as it is.
    trials : sequence of Trial
    baseline : callable
        Simulated output of all days with further effects.
    kernels : dict of str to ndarray, shape (n,)
        Step responses at the upper ("up") and the lower dam ("down").
    seed, flips : int
        Of the sign flips.

    Returns
    -------
    list of Proposal
        By gain on the selecting days, largest first.
    """
    record, split = model.record, model.split
    open_days = split.fit | split.select
    rows = np.flatnonzero(open_days)
    z = model.used(before.residual)
    noise = before.noise
    r = noise.whiten(z)
    start = baseline(())
    able, columns = [], []
    for t in trials:
        try:
            one = hour_columns(record, kernels[t.hourly]) if t.hourly else columns_of(t, baseline, start)
        except RividError:  # the reach runs dry with this effect
            continue
        able.append(t)
        columns.append(one)
    trials = able
    whitened = [noise.whiten(c, like=z) for c in columns]
    nuisance = noise.whiten(model.columns, like=z)
    candidates, trial_of = [], []
    for i, (t, w) in enumerate(zip(trials, whitened, strict=True)):
        # a night is one run of hours if the day begins at noon
        for turn in (0, HOURS_A_DAY // 2) if t.hourly else (0,):
            turned = np.roll(w[:, rows], turn, axis=0)
            candidates.append(Candidate(t.name, turned, t.dates, bool(t.hourly), t.sign))
            trial_of.append(i)
    daily = noise.smooth(z).inflow.mean(axis=1)  # correlation of days shows in their mean inflow
    blocks = flip_blocks(daily - daily[open_days].mean(), split, open_days)
    found = scan(
        r[rows], nuisance[:, rows], candidates, blocks=blocks[rows], weights=before.weights[rows],
        flips=flips, seed=seed,
    )  # fmt: skip
    p_family = [float(found[np.array(trial_of) == i].min()) for i in range(len(trials))]
    result = []
    free_of = _projected(r, nuisance, split.fit | split.select)
    dated, blocks_of = len(trials), split.block[rows]
    shown = (rows, free_of, blocks_of, dated)
    for trial, c, w, p_flips in zip(trials, columns, whitened, p_family, strict=True):
        whole = Span(0, len(rows) - 1, None, 0.0)
        span = _span(trial, w, free_of, rows)
        if trial.hourly:
            # all day it would be a lateral inflow or a gain error
            spans = [span] if span.hours is not None and span.gain >= CLEAR else []
        elif trial.dates == "all":
            spans = [whole]
        else:  # the whole season in any case: a slow noise hides it from the search
            spans = [whole, span] if _window(record, rows, span, trial)[1] else [whole]
        if p_flips > LOOK and span.gain < CLEAR and not _promising(w, free_of, rows):
            continue
        found_ = [_measured(model, before, trial, c, w, one_span, p_flips, shown) for one_span in spans]
        result += [f for f in found_ if f is not None]
    return sorted(result, key=lambda p: -p.gain_select)


def _promising(w: Floats, r: Floats, rows: np.ndarray) -> bool:
    """Whether the columns as a whole gain enough to be measured."""
    score, information = _sums(w, r, rows)
    s, q = score.sum(axis=1), information.sum(axis=2)
    return bool(0.5 * float(s @ np.linalg.lstsq(q, s, rcond=None)[0]) > PROMISING)


def _measured(
    model: Linear,
    before: Evaluation,
    trial: Trial,
    c: Floats,
    w: Floats,
    span: Span,
    p_flips: float,
    shown: tuple[np.ndarray, Floats, np.ndarray, int],
) -> Proposal | None:
    """A trial in a window, with all its gains; None where it cannot be estimated or is likely chance."""
    record, split = model.record, model.split
    rows, free_of, blocks, dated = shown
    window, used = _window(record, rows, span, trial)
    tried = _inside(trial, c, record, window)
    if not np.abs(tried[:, split.fit]).any() or not np.abs(tried[:, split.select]).any():
        return None  # no days to fit or to confirm it
    after = evaluate(model, tried, thorough=trial.dates != "all")
    if trial.sign and trial.sign * after.coefficients[0] <= 0:
        return None
    fit, select, t, better, active = compared(
        model, before, after, np.zeros(record.days), np.abs(tried).max(axis=(0, 2))
    )
    sums = _sums(w, free_of, rows)
    if len(w) > 1 and not trial.hourly:
        sums = combined(*sums, span)
    chance = chance_of(*sums, span, blocks, dated, max(fit + select, 0.0))
    p_value = min(p_flips, chance)
    if p_value > LOOK:
        return None
    effect = trial.make(after.coefficients)
    if used:
        effect = replace(effect, dates=window[0] or effect.dates, hours=window[1] or effect.hours)
    return Proposal(
        trial.name,
        trial.label,
        effect,
        trial.free,
        window,
        p_value,
        after,
        tried,
        fit,
        select,
        t,
        better,
        active,
    )


def _projected(r: Floats, X: Floats, days: np.ndarray) -> Floats:
    """The whitened residual without what the response's parameters explain."""
    flat = X[:, days].reshape(len(X), -1)
    b = np.linalg.lstsq(flat.T, r[days].ravel(), rcond=None)[0]
    return np.asarray(r - np.tensordot(b, X, 1))


def _sums(w: Floats, r: Floats, rows: np.ndarray) -> tuple[Floats, Floats]:
    """Score (hours, days) and information (hours, hours, days) of the open days.

    Without weights: an effect makes the days noisy on which it acts.
    """
    score = np.einsum("hdn,dn->hd", w[:, rows], r[rows])
    return score, np.einsum("hdn,gdn->hgd", w[:, rows], w[:, rows])


def _span(trial: Trial, w: Floats, r: Floats, rows: np.ndarray) -> Span:
    """The best window among the open days; the whole season where the trial has none."""
    if trial.dates == "all":
        return Span(0, len(rows) - 1, None, 0.0)
    if len(w) > 1 and not trial.hourly:
        return best_dates(*_sums(w, r, rows))
    return best_span(*_sums(w, r, rows), trial.sign)


def _window(record: Record, rows: np.ndarray, span: Span, trial: Trial) -> tuple[Window, bool]:
    """Dates and hours of a span, extended to days beyond the open ones at the season's ends."""
    dates = None
    if span.last - span.first + 1 < ALWAYS * len(rows):
        first = 0 if span.first <= 1 else rows[span.first]
        last = record.days - 1 if span.last >= len(rows) - 2 else rows[span.last]
        dates = (record.dates[first], record.dates[last])
    hours = None
    if span.hours is not None and trial.hourly:
        end = span.hours[1] or HOURS_A_DAY
        hours = (float(span.hours[0]), float(end))
    return (dates, hours), dates is not None or hours is not None


def _inside(trial: Trial, columns: Floats, record: Record, window: Window) -> Floats:
    """The columns within a window; hours of the day summed."""
    dates, hours = window
    c = columns
    if trial.hourly:
        chosen = np.ones(HOURS_A_DAY, bool)
        if hours is not None:
            h = np.arange(HOURS_A_DAY)
            a, b = hours
            chosen = (h >= a) & (h < b) if a < b else (h >= a) | (h < b)
        c = columns[chosen].sum(axis=0, keepdims=True)
    if dates is None:
        return c
    first = (dates[0] - record.dates[0]).days * DAY
    last = ((dates[1] - record.dates[0]).days + 1) * DAY
    on = (record.time[:, record.lead] >= first) & (record.time[:, record.lead] < last)
    return np.asarray(c * on[:, None])
