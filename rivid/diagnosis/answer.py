"""The result of a study: verdict, named effects, gap, its regimes, and the arrays behind them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.closed_loop import closed_loop
from rivid.diagnosis.data import Record
from rivid.diagnosis.fit import HOURS, DayErrors, Evaluation, day_errors
from rivid.diagnosis.localise import as_scores, drivers, strongest
from rivid.diagnosis.noise.model import FEWEST_BLOCKS
from rivid.diagnosis.result import (
    Diagnosis,
    Estimate,
    Gap,
    NamedEffect,
    Regime,
    Step,
    Unknown,
    Where,
    closed_share,
)
from rivid.diagnosis.selection import breaker, verdict_of
from rivid.diagnosis.spectrum import spectrum
from rivid.effects import Effect
from rivid.types import Bools, Floats

if TYPE_CHECKING:
    from rivid.diagnosis.selection import Round, Study

LEAST_RATIO = 3.0
"""Least ratio of a spectral peak to its surroundings; no response is exact, and a low hump is no rhythm."""
LEAST_P = 0.01
"""Largest p of the location of the remainder at which it is reported."""
STEP = 0.15
"""A step is a change of the outflow by this share of its 5-95 % range, within :data:`RISE`."""
RISE, AFTER = 1800.0, 3600.0
"""Time in which a step is made, and time after its end that counts as after it [s]."""
NIGHT = (22.0, 6.0)
"""Hours of the night."""
PLACED = ("starts", "place", "per_day", "per_month", "rise")
"""Parameters that set where and when an effect acts; they have no estimate of their own."""
MANY = 12
"""Most values of a parameter that are reported one by one [-]; of more, median and 95 % range."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """The arrays behind a diagnosis.

    Attributes
    ----------
    record : Record
    split : Split
    run_before, run_after : ndarray, shape (days, n)
        The simulated output of each day [m or m3/s] without and with the named effects, set to the
        measurement at the day's first sample that counts, and free from there.
    residual_before, residual_after : ndarray, shape (days, n)
        Measured less simulated about the observed course; NaN where nothing was measured. The mean of
        each day is arbitrary.
    inflow_before, inflow_before_sd, inflow_after, inflow_after_sd : ndarray, shape (days, n)
        The unexplained inflow w [m3/s] and its standard deviation, from whole days.
    step_response : ndarray, shape (n,)
        Output at each sample after 1 m3/s more flows in at the upstream dam.
    """

    record: Record
    split: Split
    run_before: Floats
    run_after: Floats
    residual_before: Floats
    residual_after: Floats
    inflow_before: Floats
    inflow_before_sd: Floats
    inflow_after: Floats
    inflow_after_sd: Floats
    step_response: Floats


def conclude(
    study: "Study", classes: dict[str, type[Effect]], floor: Sequence[float] | None
) -> tuple[Diagnosis, Evidence]:
    """The diagnosis of a study, and its arrays.

    Parameters
    ----------
    study : Study
    classes : dict
        Effects by name.
    floor : sequence of float, optional
        RMSE at each horizon of the model that knows the truth.
    """
    named = study.named
    gap = replace(_gap(study, named, floor), by_regime=regimes(study))
    evidence = _evidence(study)
    unknown = _unknown(study, evidence)
    effects = _named(study, named, classes)
    verdict, reason = verdict_of(study, gap, unknown)
    noise = study.last_evaluation.noise
    return (
        Diagnosis(
            verdict, reason, study.last.reach.name, _estimates(study), effects,
            unknown if verdict in ("unknown", "partly_explained") else None, gap,
            {f.name: v for f in fields(noise) if (v := getattr(noise, f.name)) is not None}, _notes(study),
            closed_loop(study),
        ),
        evidence,
    )  # fmt: skip


def _named(
    study: "Study", named: tuple["Round", ...], classes: dict[str, type[Effect]]
) -> tuple[NamedEffect, ...]:
    found = []
    tail = study.last_evaluation.shift_errors[len(study.last.reach.parameters) :].tolist()
    errors = {(i, name, k): e for (i, (name, k), _), e in zip(study.last.slots(), tail, strict=True)}
    quantile = _quantile(study)
    index = len(study.last.effects) - sum(not r.proposal.level_noise for r in named)
    for r in named:
        proposal = r.proposal
        if proposal.level_noise:
            effect, own = proposal.effect, {}
        else:
            effect = study.last.effects[index]
            own = {(name, k): e for (i, name, k), e in errors.items() if i == index}
            index += 1
        found.append(
            NamedEffect(
                name=effect.name, family=effect.family, p_value=proposal.p_value, tied_with=r.tied,
                runner_up=r.runner_up, margin=r.margin,
                parameters=_parameters(effect, own, proposal.spreads, quantile),
                where=Where(hours=effect.hours, dates=effect.dates),
                breaker=breaker(effect, (classes[name] for name in r.tied)), table=effect.to_table(),
                events=len(proposal.events.events) if proposal.events else 0,
            )
        )  # fmt: skip
    return tuple(found)


def _parameters(
    effect: Effect, errors: dict[tuple[str, int | None], float], spreads: dict[str, float], quantile: float
) -> tuple[Estimate, ...]:
    """Estimates with intervals of 95 %; `errors` are of fitted values, `spreads` of searched ones."""
    found = []
    for name, spec in effect.parameters().items():
        value = getattr(effect, name)
        values = value if isinstance(value, tuple) else (value,)
        if name in PLACED or not len(values):
            continue
        if len(values) > MANY:
            low, mid, high = np.quantile(values, [0.025, 0.5, 0.975]).tolist()
            found.append(Estimate(name, mid, spec.unit, low, high))
            continue
        for k, one in enumerate(values):
            error = errors.get((name, k if isinstance(value, tuple) else None))
            spread = quantile * (spreads.get(name, np.nan) if error is None else error)
            label = f"{name}[{k}]" if len(values) > 1 else name
            found.append(Estimate(label, float(one), spec.unit, float(one - spread), float(one + spread)))
    return tuple(found)


def _quantile(study: "Study") -> float:
    """Standard errors in half an interval of 95 %: Student's, for they come from few blocks."""
    from scipy.stats import t

    blocks = len(np.unique(study.split.block[study.split.fit]))
    return float(t.ppf(0.975, max(blocks - 1, 1)))


def _estimates(study: "Study") -> tuple[Estimate, ...]:
    found = []
    errors, quantile = study.last_evaluation.shift_errors, _quantile(study)
    for free, error in zip(study.last.reach.parameters, errors, strict=False):
        low, high = free.value - quantile * error, free.value + quantile * error
        found.append(
            Estimate(free.name, free.natural, free.unit, free.to_natural(low), free.to_natural(high))
        )
    return tuple(found)


def _gap(study: "Study", named: tuple["Round", ...], floor: Sequence[float] | None) -> Gap:
    sealed = study.split.sealed
    record = study.record
    base = study.first_evaluation.errors.rmse(sealed)
    end = study.last_evaluation.errors.rmse(sealed)
    steps, coded = [], np.zeros(record.time.shape)
    forecast = end
    for r in named:
        rmse, described = r.after.errors.rmse(sealed), None
        if r.proposal.events is not None:
            coded = coded + r.proposal.events.coded
            described = tuple(rmse.tolist())
            rmse = _unforeseen(study, r.after, coded).rmse(sealed)
            forecast = rmse if r is named[-1] else forecast
        steps.append(Step(r.proposal.name, tuple(rmse.tolist()), described))
    if coded.any():
        forecast = _unforeseen(study, study.last_evaluation, coded).rmse(sealed)
    closed = closed_forecast = None
    if floor is not None:
        closed, closed_forecast = (_closed(base, errors, floor) for errors in (end, forecast))
    return Gap(
        heldout_dates=tuple(d for d, kept in zip(record.dates, sealed, strict=True) if kept),
        horizon_h=HOURS, unit="m" if record.kind == "pool" else "m3/s",
        rmse_baseline=tuple(base.tolist()), rmse_augmented=tuple(forecast.tolist()),
        rmse_floor=None if floor is None else tuple(floor), closed=closed, closed_forecast=closed_forecast,
        steps=tuple(steps), rmse_described=tuple(end.tolist()) if coded.any() else None,
    )  # fmt: skip


def _unforeseen(study: "Study", after: Evaluation, coded: Floats) -> DayErrors:
    """Errors of forecasts to which the events of the day are unknown."""
    return day_errors(study.record, after.residual + coded, after.noise)


def _closed(base: Floats, end: Floats, floor: Sequence[float]) -> float | None:
    shares = [
        closed_share(float(b), float(e), float(f))
        for b, e, f in zip(base, end, floor, strict=True)
        if b * b - f * f > 0.05 * b * b
    ]
    kept = [s for s in shares if s is not None and np.isfinite(s)]
    return float(np.median(kept)) if kept else None


def _unknown(study: "Study", evidence: Evidence) -> Unknown | None:
    """The remainder, if it has a period or a place."""
    record, last = study.record, study.last_evaluation
    innovations = last.noise.whiten(np.where(record.used, last.residual, np.nan))
    period, ratio, limit, _ = spectrum(innovations, record.used, record.sample_time, weights=last.weights)
    w = np.where(record.used, evidence.inflow_after, 0.0)
    place, blocks = None, study.split.block
    if len(np.unique(blocks[record.used.any(axis=1)])) >= FEWEST_BLOCKS:  # with fewer no place is certain
        place = strongest(as_scores(w, record.used, blocks), drivers(record, blocks), record.dates)
    found = []
    known = any(0.7 < period / other < 1.4 for other in study.swings())
    rhythm = ratio > max(limit, LEAST_RATIO) and not known
    if rhythm:
        found.append(f"a swing with a period of {period / 60:.0f} min")
    if place is not None and place.p_value <= LEAST_P and abs(place.size) > 0.5 * last.noise.inflow_sd:
        found.append(place.text)
    if not found:
        return None
    size = float(np.sqrt(np.mean(w[record.used] ** 2)))
    dates = place.windows[0] if place is not None and place.windows else None
    return Unknown(Where(dates=dates), size, tuple(found), period if rhythm else None)


def _evidence(study: "Study") -> Evidence:
    record = study.record
    first, last = study.first_evaluation, study.last_evaluation
    smooth = [e.noise.smooth(np.where(record.used, e.residual, np.nan)) for e in (first, last)]
    runs = [m.reach.simulate(record, m.changes(record)) for m in (study.first, study.last)]
    start = np.argmax(record.used, axis=1)
    rows = np.arange(record.days)
    runs = [run + (record.output[rows, start] - run[rows, start])[:, None] for run in runs]
    return Evidence(
        record, study.split, runs[0], runs[1], first.residual, last.residual,
        smooth[0].inflow, smooth[0].inflow_sd, smooth[1].inflow, smooth[1].inflow_sd, study.kernels["up"],
    )  # fmt: skip


def _notes(study: "Study") -> tuple[str, ...]:
    notes = list(study.notes)
    at_limit = [
        f.name for f in study.last.reach.parameters
        if f.value >= f.high or f.value <= f.low < f.mean  # a gauge without a well has no lag
    ]  # fmt: skip
    if at_limit:
        notes.append(f"calibrated values at their limits: {', '.join(at_limit)}")
    light = int((study.last_evaluation.weights[study.split.fit] < 0.3).sum())
    if light:
        notes.append(f"{light} fitting days are far noisier than most and count little")
    return tuple(notes)


def regimes(study: "Study") -> tuple[Regime, ...]:
    """The gap on the sealed days by the state of the reach in which a forecast ends.

    Parameters
    ----------
    study : Study

    Returns
    -------
    tuple of Regime
        Low, middle and high inflow; after a step of the outflow and in calm, of a pool; night and day. A
        state that is always or never there is left out. Events of the day itself are unknown, as in the gap.
    """
    record = study.record
    first, last = study.first_evaluation, study.last_evaluation
    coded = np.zeros(record.time.shape)
    for turn in study.named:
        if turn.proposal.events is not None:
            coded = coded + turn.proposal.events.coded
    found, sealed = [], study.split.sealed
    for name, words, samples in states(record):
        part = replace(record, used=record.used & samples)
        before = day_errors(part, first.residual, first.noise)
        after = day_errors(part, last.residual + coded, last.noise)
        rmse = [tuple(errors.rmse(sealed).tolist()) for errors in (before, after)]
        counts = before.counts[:, sealed].sum(axis=1)
        found.append(Regime(name, words, rmse[0], rmse[1], tuple(int(c) for c in counts)))
    return tuple(found)


def states(record: Record) -> list[tuple[str, str, Bools]]:
    """Name, words and samples (days, n) of each state; terciles are those of all samples that count."""
    found: list[tuple[str, str, Bools]] = []
    low, high = np.quantile(record.inflow[record.used], [1.0 / 3.0, 2.0 / 3.0])
    if low < high:
        u = record.inflow
        found += [
            ("inflow_low", f"inflow below {low:.0f} m³/s", u < low),
            ("inflow_middle", f"inflow {low:.0f} to {high:.0f} m³/s", (u >= low) & (u < high)),
            ("inflow_high", f"inflow of {high:.0f} m³/s or more", u >= high),
        ]
    if record.kind == "pool":
        after, size = after_step(record)
        found += [
            ("after_step", f"in the hour after a step of the outflow of {size:.0f} m³/s or more", after),
            ("calm", "longer after such a step", ~after),
        ]
    night = (record.hour >= NIGHT[0]) | (record.hour < NIGHT[1])
    found += [
        ("night", f"by night, {NIGHT[0]:.0f} to {NIGHT[1]:.0f} h", night),
        ("day", f"by day, {NIGHT[1]:.0f} to {NIGHT[0]:.0f} h", ~night),
    ]
    return [state for state in found if 0 < (state[2] & record.used).sum() < record.used.sum()]


def after_step(record: Record) -> tuple[Bools, float]:
    """Samples during a step of the outflow and in the hour after it, shape (days, n), and its size [m3/s].

    Smaller changes of the outflow occur all the time and are no steps.
    """
    rise, after = (max(round(t / record.sample_time), 1) for t in (RISE, AFTER))
    low, high = np.quantile(record.outflow[record.used], [0.05, 0.95])
    size = max(STEP * float(high - low), 1e-9)
    u = record.outflow
    step = np.zeros(u.shape, bool)
    step[:, rise:] = np.abs(u[:, rise:] - u[:, :-rise]) >= size
    sample = np.arange(u.shape[1])
    last = np.maximum.accumulate(np.where(step, sample, -after - 1), axis=1)
    return np.asarray(sample - last <= after), size
