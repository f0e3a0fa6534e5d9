"""What might be missing: every trial of the library scored, its window refined, its gain measured.

A proposal is an effect with its window, and what the model would be with it: likelihood on the days that fit
and on those that select, and the simulation's error on these.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rivid.diagnosis.blocks import flip_blocks
from rivid.diagnosis.data import Record
from rivid.diagnosis.fit import Evaluation, Linear, evaluate
from rivid.diagnosis.score import Candidate, scan
from rivid.diagnosis.search.proposal import Proposal, compared
from rivid.diagnosis.search.trials import HOURS_A_DAY, Window, columns_of, hour_columns
from rivid.diagnosis.search.windows import Span, best_dates, best_span, chance_of, combined
from rivid.effects import Effect, Trial
from rivid.errors import RividError
from rivid.types import DAY, Floats

LOOK = 0.05
"""Candidates with a smaller family-wise p are looked at closely."""
PROMISING = 4.0
"""Likelihood gain of a trial as a whole [nats] from which it is measured."""
DATES_PRICE = 12.0
"""What dates have to gain against none [nats]."""
CLEAR = 15.0
"""Or those whose window gains as many nats."""
ALWAYS = 0.9
"""A window that holds this share of the days is no window."""
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
        except RividError:  # no water, or a level below the bed: with this effect the reach cannot be
            continue
        able.append(t)
        columns.append(one)
    trials = able
    whitened = [noise.whiten(c, like=z) for c in columns]
    nuisance = noise.whiten(model.columns, like=z)
    candidates, whose = [], []
    for i, (t, w) in enumerate(zip(trials, whitened, strict=True)):
        # a night is one run of hours where the day begins at noon
        for turn in (0, HOURS_A_DAY // 2) if t.hourly else (0,):
            turned = np.roll(w[:, rows], turn, axis=0)
            candidates.append(Candidate(t.name, turned, t.dates, bool(t.hourly), t.sign))
            whose.append(i)
    daily = noise.smooth(z).inflow.mean(axis=1)  # what days have in common shows in their mean inflow
    blocks = flip_blocks(daily - daily[open_days].mean(), split, open_days)
    found = scan(
        r[rows], nuisance[:, rows], candidates, blocks=blocks[rows], weights=before.weights[rows],
        flips=flips, seed=seed,
    )  # fmt: skip
    p_family = [float(found[np.array(whose) == i].min()) for i in range(len(trials))]
    result = []
    free_of = _projected(r, nuisance, split.fit | split.select)
    dated, blocks_of = len(trials), split.block[rows]
    shown = (rows, free_of, blocks_of, dated)
    for trial, c, w, p_flips in zip(trials, columns, whitened, p_family, strict=True):
        whole = Span(0, len(rows) - 1, None, 0.0)
        span = _span(trial, w, free_of, rows)
        if trial.hourly:
            # all day long it would be a lateral inflow or an outflow's gain
            spans = [span] if span.hours is not None and span.gain >= CLEAR else []
        elif trial.dates == "all":
            spans = [whole]
        else:  # beside the best window always the whole season: a slow noise hides it from the search
            spans = [whole, span] if _window(record, rows, span, trial)[1] else [whole]
        if p_flips > LOOK and span.gain < CLEAR and not _promising(w, free_of, rows):
            continue
        found_ = [_measured(model, before, trial, c, w, one_span, p_flips, shown) for one_span in spans]
        result += [f for f in found_ if f is not None]
    return sorted(result, key=lambda p: -p.gain_select)


def _promising(w: Floats, r: Floats, rows: np.ndarray) -> bool:
    """Whether the columns as a whole gain enough to be looked at."""
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
    """A trial in a window, with all its gains; None where it cannot be told or is likely chance."""
    record, split = model.record, model.split
    rows, free_of, blocks, dated = shown
    window, used = _window(record, rows, span, trial)
    tried = _inside(trial, c, record, window)
    if not np.abs(tried[:, split.fit]).any() or not np.abs(tried[:, split.select]).any():
        return None  # nothing to fit it to, or to confirm it with
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

    Without weights: days that an effect makes noisy are those on which to look for it.
    """
    score = np.einsum("hdn,dn->hd", w[:, rows], r[rows])
    return score, np.einsum("hdn,gdn->hgd", w[:, rows], w[:, rows])


def _span(trial: Trial, w: Floats, r: Floats, rows: np.ndarray) -> Span:
    """The best window among the open days; whole where the trial is always there."""
    if trial.dates == "all":
        return Span(0, len(rows) - 1, None, 0.0)
    if len(w) > 1 and not trial.hourly:
        return best_dates(*_sums(w, r, rows))
    return best_span(*_sums(w, r, rows), trial.sign)


def _window(record: Record, rows: np.ndarray, span: Span, trial: Trial) -> tuple[Window, bool]:
    """Dates and hours of a span; days between two open ones are its own where both neighbours are."""
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
    """The columns within a window; hours of the day added up."""
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
