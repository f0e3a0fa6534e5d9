"""The arrays behind a diagnosis, for pictures and for the table of the unexplained inflow."""

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
from rivid.diagnosis.regimes import regimes
from rivid.diagnosis.result import (
    Diagnosis,
    Estimate,
    Gap,
    NamedEffect,
    Step,
    Unknown,
    Where,
    closed_share,
)
from rivid.diagnosis.selection import breaker, verdict_of
from rivid.diagnosis.spectrum import spectrum
from rivid.effects import Effect
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.fit import Model
    from rivid.diagnosis.selection import Round, Study


@dataclass(frozen=True, eq=False)
class Evidence:
    """What was looked at.

    Attributes
    ----------
    record : Record
    split : Split
    run_before, run_after : ndarray, shape (days, n)
        The simulated output of each day [m or m3/s] without and with the named effects, set to the
        measurement at the day's first sample that counts, and free from there.
    residual_before, residual_after : ndarray, shape (days, n)
        Measured less simulated about the observed course; NaN where nothing was measured. Its constant of
        each day means nothing.
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


LEAST_RATIO = 3.0
"""Of a peak in the spectrum to its surroundings: no response is all right, and a hump no rhythm."""
SPEAKS = 0.01
"""p of the place of what is left, from which it speaks."""


def too_few(record: Record, least: int) -> Diagnosis:
    """The answer where there is too little to look at."""
    return Diagnosis(
        "insufficient_data",
        f"{record.days} days can be used: expected {least} or more, to have days that fit, that select and "
        "that confirm.",
        "none",
    )


def too_still(record: Record) -> Diagnosis:
    """The answer where nothing moves: a response cannot be seen at rest."""
    return Diagnosis(
        "insufficient_data",
        f"the flows of {record.days} days never move: expected commands that change, for a response to be "
        "seen; check the columns",
        "none",
    )


def no_candidates() -> Diagnosis:
    """The answer where nothing may be named."""
    return Diagnosis(
        "insufficient_data",
        "no effect may be named: expected one or more in the library; [diagnose] exclude leaves none",
        "none",
    )


def conclude(
    study: "Study", classes: dict[str, type[Effect]], floor: Sequence[float] | None
) -> tuple[Diagnosis, Evidence]:
    """Put a study into words and numbers.

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
    errors = dict(zip(_slots(study.last), _tail(study), strict=True))
    quantile = _quantile(study)
    place = 0
    for r in named:
        proposal = r.proposal
        effect = proposal.effect
        index = None
        if not proposal.level_noise:
            index = len(study.last.effects) - sum(not x.proposal.level_noise for x in named) + place
            place += 1
            effect = study.last.effects[index]
        found.append(
            NamedEffect(
                name=effect.name, family=effect.family, p_value=proposal.p_value, tied_with=r.tied,
                runner_up=r.runner_up, margin=r.margin,
                parameters=_parameters(effect, index, errors, proposal.spreads, quantile),
                where=_where(effect, study.record),
                breaker=breaker(effect, (classes[name] for name in r.tied)), table=effect.to_table(),
                events=len(proposal.events.events) if proposal.events else 0,
            )
        )  # fmt: skip
    return tuple(found)


def _slots(model: "Model") -> list[tuple[int, str, int | None]]:
    return [(i, name, k) for i, (name, k), _ in model.slots()]


def _tail(study: "Study") -> list[float]:
    p = len(study.last.reach.parameters)
    return [float(e) for e in study.last_evaluation.shift_errors[p:]]


def _parameters(
    effect: Effect,
    index: int | None,
    errors: dict[tuple[int, str, int | None], float],
    spreads: dict[str, float],
    quantile: float,
) -> tuple[Estimate, ...]:
    found = []
    for name, said in effect.parameters().items():
        value = getattr(effect, name)
        values = value if isinstance(value, tuple) else (value,)
        if name in ("starts", "place", "per_day", "per_month", "rise") or not len(values):
            continue
        if len(values) > 12:  # of events: the middle and the spread say it
            low, mid, high = np.quantile(values, [0.025, 0.5, 0.975]).tolist()
            found.append(Estimate(name, mid, said.unit, low, high))
            continue
        for k, one in enumerate(values):
            error = errors.get(
                (index if index is not None else -1, name, k if isinstance(value, tuple) else None)
            )
            if error is None:
                error = spreads.get(name)
            label = f"{name}[{k}]" if len(values) > 1 else name
            spread = quantile * error if error is not None else np.nan
            found.append(Estimate(label, float(one), said.unit, float(one - spread), float(one + spread)))
    return tuple(found)


def _quantile(study: "Study") -> float:
    """Standard errors in half an interval of 95 %: Student's, for they come from few blocks."""
    from scipy.stats import t

    blocks = len(np.unique(study.split.block[study.split.fit]))
    return float(t.ppf(0.975, max(blocks - 1, 1)))


def _where(effect: Effect, record: Record) -> Where:
    return Where(hours=effect.hours, dates=effect.dates)


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
        told = tuple(r.after.errors.rmse(sealed).tolist())
        ahead = None
        if r.proposal.events is not None:
            coded = coded + r.proposal.events.coded
            ahead = told
            told = tuple(_unforeseen(study, r.after, coded).rmse(sealed).tolist())
            forecast = np.array(told) if r is named[-1] else forecast
        steps.append(Step(r.proposal.name, told, ahead))
    described = tuple(end.tolist()) if coded.any() else None
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
        steps=tuple(steps), rmse_described=described,
    )  # fmt: skip


def _unforeseen(study: "Study", after: Evaluation, coded: Floats) -> DayErrors:
    """Errors where the events of the day are not known beforehand."""
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
    """What is left, if it has a rhythm or a place."""
    record, last = study.record, study.last_evaluation
    innovations = last.noise.whiten(np.where(record.used, last.residual, np.nan))
    period, ratio, limit, _ = spectrum(innovations, record.used, record.sample_time, weights=last.weights)
    unit = "m3/s"
    w = np.where(record.used, evidence.inflow_after, 0.0)
    place = None
    if len(np.unique(study.split.block[record.used.any(axis=1)])) >= FEWEST_BLOCKS:  # else no place is sure
        place = strongest(
            as_scores(w, record.used, study.split.block), drivers(record, study.split.block), record.dates,
            unit=unit,
        )  # fmt: skip
    said = []
    rhythm = ratio > max(limit, LEAST_RATIO)
    known = any(0.7 < period / other < 1.4 for other in study.swings())
    if rhythm and not known:
        said.append(f"a swing with a period of {period / 60:.0f} min")
    if place is not None and place.p_value <= SPEAKS and abs(place.size) > 0.5 * last.noise.inflow_sd:
        said.append(place.text)
    if not said:
        return None
    size = float(np.sqrt(np.mean(w[record.used] ** 2)))
    dates = place.windows[0] if place is not None and place.windows else None
    return Unknown(Where(dates=dates), size, tuple(said), period if rhythm and not known else None)


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
    at_limit = [f.name for f in study.last.reach.parameters if f.value <= f.low or f.value >= f.high]
    if at_limit:
        notes.append(f"calibrated values at their limits: {', '.join(at_limit)}")
    light = int((study.last_evaluation.weights[study.split.fit] < 0.3).sum())
    if light:
        notes.append(f"{light} fitting days are far noisier than most and count little")
    return tuple(notes)
