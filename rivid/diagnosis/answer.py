"""Diagnosis of a study: verdict, named effects, gap, regimes, and the underlying arrays."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.closed_loop import closed_loop
from rivid.diagnosis.data import Record
from rivid.diagnosis.decision import ALONE, TEMPER, UNKNOWN, Study
from rivid.diagnosis.events import Event
from rivid.diagnosis.explanation import Explanation
from rivid.diagnosis.fit import HOURS, Model, day_errors
from rivid.diagnosis.localise import Scores, drivers, strongest
from rivid.diagnosis.noise.model import FEWEST_BLOCKS
from rivid.diagnosis.result import (
    Diagnosis,
    Estimate,
    Gap,
    NamedEffect,
    Ranked,
    Regime,
    Step,
    Unknown,
    Verdict,
    Where,
)
from rivid.diagnosis.rhythm import rhythm
from rivid.diagnosis.search import command_steps
from rivid.diagnosis.seiche import highest_peak
from rivid.effects import Effect
from rivid.effects.flow import RecurringFlow
from rivid.text import duration, shown_in
from rivid.types import HOUR, Bools, Floats

MOST = 0.5
"""Share of the squared error beyond the noise above which "no_gap" is no verdict. Two of 24 development
seasons of 40 days with nothing hidden exceed it, and four :data:`rivid.diagnosis.decision.MATERIAL`, counted
when an excess in a single block was enough."""
SHORT = 2 * HOUR  # period below which an oscillation is none of the hours of the day
LEAST_HEIGHT = 3.0
"""Smallest ratio of a reported spectral peak to its surroundings; any response's error gives low humps."""
FILLED = 0.5  # share of the time from the first pulse to the last above which pulses are no separate events
LEAST_P = 0.01  # largest p-value at which the location of the remainder is reported
STEP = 0.15  # smallest step of the outflow, as a share of its 5-95 % range; it takes RISE at most
RISE, AFTER = 1800.0, 3600.0  # longest duration of a step, and time after its end that counts as after it [s]
NIGHT = (22.0, 6.0)  # start and end of the night [h]
PLACED = ("starts", "place", "per_day", "per_month", "rise")
"""Parameters that set where and when an effect acts; they are not reported as estimates."""
WIDER = TEMPER**-0.5  # factor of standard errors: the likelihood counts with the exponent of probabilities
MANY = 12  # most values of a parameter reported one by one [-]; of more, median and 95 % range are reported


@dataclass(frozen=True, eq=False)
class Evidence:
    """The arrays behind a diagnosis."""

    record: Record
    split: Split
    # (days, n): simulated output of each day [m or m3/s] without and with the named effects, running free
    # from the measurement at the day's first used sample
    run_before: Floats
    run_after: Floats
    # (days, n): measured minus simulated output, linearised about the observed output; NaN where nothing was
    # measured. The mean of each day is arbitrary
    residual_before: Floats
    residual_after: Floats
    # (days, n): unexplained inflow w [m3/s] and its standard deviation, smoothed over whole days
    inflow_before: Floats
    inflow_before_sd: Floats
    inflow_after: Floats
    inflow_after_sd: Floats
    model: Model | None = None  # fitted model with the named effects


def conclude(
    study: Study, classes: dict[str, type[Effect]], floor: Sequence[float] | None
) -> tuple[Diagnosis, Evidence]:
    """Return a study's diagnosis and its arrays; `floor` is the RMSE of the true model at each horizon."""
    gap = _gap(study, floor)
    evidence = _evidence(study)
    remainder = _unknown(study, evidence)
    verdict, reason = _verdict(study, gap, remainder)
    missing = verdict in ("unknown", "partly_explained")
    noise = study.last.noise
    return (
        Diagnosis(
            verdict, reason, study.last.model.reach.name, _estimates(study), _named(study, classes),
            remainder or _of_noise(study) if missing else None, gap,
            {name: v for name, v in vars(noise).items() if v is not None}, _notes(study),
            closed_loop(study), _ranking(study), _small(study), _next(study, verdict, classes),
        ),
        evidence,
    )  # fmt: skip


def _verdict(study: Study, gap: Gap, remainder: Unknown | None) -> tuple[Verdict, str]:
    """Return the verdict and a sentence with its reason."""
    base, end = gap.rmse_baseline[1], gap.rmse_augmented[1]
    factor, unit = shown_in(gap.unit)
    shown = f"{factor * base:.3g} {unit} to {factor * end:.3g} {unit} after 4 h"
    if gap.rmse_described is not None:
        shown += f" ({factor * gap.rmse_described[1]:.3g} {unit} with the events of these days)"
    named = study.sure or study.group
    if not named:
        nothing = study.chance(lambda names, unknown: not names and not unknown)
        p, first = study.chance_of(study.names[0]) if study.names else 0.0, ""
        if p >= 1.0 - ALONE:
            first = f"; the most probable effect, {_words(study.names[0])}, has {p:.2f}"
        if study.unfit:
            return "unknown", (
                "No response describes this reach: fronts are early or late by a third of a sample or "
                f"more{first}. Check length, width and depth in the configuration."
            )
        if study.strained:
            return "unknown", f"{STRAIN}{first}."
        if max(study.unknown, nothing) < UNKNOWN:
            return "unknown", (
                f"Something is missing, with a probability of {1.0 - nothing:.2f}, and no name is probable "
                f"enough{first}."
            )
        if study.unknown >= UNKNOWN:
            what = f": {remainder.drivers[0]}" if remainder is not None else ""
            kind = "Something is missing that no known effect explains"
            if study.stranger is not None and study.stranger.unknown == "dynamics":
                kind = "No geometry near the configured length, width and depth makes this response"
            return "unknown", f"{kind}, with a probability of {study.unknown:.2f}{what}{first}."
        days = np.flatnonzero(study.excess(study.ranking[0][0], MOST, study.opened, study.split.sealed))
        if np.unique(study.split.block[days]).size > 1:
            return "unknown", (
                "Something is missing: most of the error of the simulation is beyond plausible weather, the "
                f"gauge and the response, and no name is probable enough{first}."
            )
        incident = ""
        if days.size:
            ends = " to ".join(str(study.record.dates[day]) for day in days[[0, -1]])
            incident = (
                f" Most of the error of {ends} is beyond the noise, on those days only: see their logs."
            )
        return "no_gap", (
            f"Nothing that matters is missing, as far as these data show (probability {nothing:.2f}{first})."
            + incident
        )
    counted = Counter(named)
    names = ", ".join(_words(name) + TIMES.get(k, "") for name, k in counted.items()).capitalize()
    if study.contradicted:
        less = round(float((study.first.density - study.last.density)[study.split.sealed].sum()))
        worse = "on the days kept apart the error"
        if less > 0:
            worse = f"the days kept apart are less probable with it, by {less} nats; the error there"
        return "did_not_hold", f"{names} fits, but {worse} goes from {shown}."
    if not study.sure:
        return (
            "cannot_tell",
            f"{names.replace(', ', ' or ')}: these data do not separate them. The error: {shown}.",
        )
    if study.strained:
        return "partly_explained", f"Named: {names}. {STRAIN}. The error: {shown}."
    if study.unknown >= UNKNOWN:
        what = f" Left: {remainder.drivers[0]}." if remainder is not None else ""
        return "partly_explained", f"Named: {names}.{what} The error: {shown}."
    more = study.chance(lambda names, _: Counter(names) > counted)
    if more >= UNKNOWN:
        able = [n for n in study.names if study.chance_of(n, counted[n] + 1) >= 1.0 - ALONE]
        others = [_words(n) for n in study.group or able]
        which = f", perhaps {' or '.join(others)}" if others else ""
        return "partly_explained", (
            f"Named: {names}. One more is missing with a probability of {more:.2f}{which}. The error: "
            f"{shown}."
        )
    p = min(study.chance_of(name, k) for name, k in counted.items())
    sure = "above 0.99" if p > 0.99 else f"of {p:.2f}"
    return "explained", f"{names} has a probability {sure}; on days kept apart the error goes from {shown}."


STRAIN = (
    "The logs contradict the configured geometry beyond its tolerance: it is wrong, or an unknown effect "
    "acts at all times. Check length, width and depth in the configuration"
)
TIMES = {2: " (twice)", 3: " (three times)", 4: " (four times)"}
"""Words for the number of times that an effect is named."""


def _words(name: str) -> str:
    return name.replace("_", " ")


GEOMETRY = "Measure the reach's length, width and depth, and time one wave between the dams."
USUAL: dict[str, str] = {
    "flow": (
        "Gauge the flow below each dam once during the hours found, and look into the gate books for them."
    ),
    "timing": "Compare the clocks of both logs and log one step of each gate with seconds.",
    "level": "Read the gauge against a staff or a second sensor.",
}
"""Recommended measurement by family, for effects without a specific one."""


def breaker(effect: type[Effect] | Effect, tied: Iterable[type[Effect]]) -> str | None:
    """Return the measurement that separates an effect from those tied with it, or None if none is tied."""
    others = tuple(tied)
    known = (effect.confounded_with.get(e.name) or e.confounded_with.get(effect.name) for e in others)
    return next(filter(None, known), USUAL[effect.family]) if others else None


def _next(study: Study, verdict: Verdict, classes: dict[str, type[Effect]]) -> str | None:
    """Return the recommended next measurement, or None."""
    if verdict in ("unknown", "partly_explained") and study.strained:
        return GEOMETRY
    if verdict == "unknown":
        if study.unknown_delays:
            return USUAL["timing"]
        kind = "" if study.stranger is None else study.stranger.unknown
        if study.unfit or kind == "dynamics":
            return GEOMETRY
        return USUAL["level" if kind == "gauge" else "flow"]
    if verdict in ("cannot_tell", "partly_explained") and study.group:
        first, *rest = (classes[name] for name in study.group)
        return breaker(first, rest) or USUAL[first.family]
    return None


def _small(study: Study) -> tuple[str, ...]:
    """Describe each effect that is probable but immaterial in a sentence."""
    found = []
    for name in dict.fromkeys(name for one, _ in study.ranking for name in one.names):
        p = sum(chance for one, chance in study.ranking if name in one.names)
        if p < ALONE or study.chance_of(name) >= 1.0 - ALONE:
            continue
        one = next(one for one, _ in study.ranking if name in one.names)
        effect = next(effect for effect in one.effects if effect.name == name)
        size = next(iter(_parameters(effect, {}, (), 1.0)), None)
        about = ""
        if size is not None:
            factor, unit = shown_in(size.unit, study.record.kind == "river")
            about = f", {_words(size.name)} about {factor * size.value:.3g} {unit},"
        found.append(
            f"{_words(name).capitalize()}{about} improves the fit with a probability of {p:.2f}, and is "
            "too small to be named: it may stand for what the response lacks."
        )
    return tuple(found)


def _ranking(study: Study) -> tuple[Ranked, ...]:
    """Rank explanations, merging those that differ only in immaterial effects or the response."""
    base, known = study.score(study.first), tuple(effect.name for effect in study.start)
    found: dict[tuple[tuple[str, ...], str], Ranked] = {}
    for one, p in study.ranking:
        names, unknown = study.core(one)
        key = tuple(sorted(names)), one.unknown or unknown
        row = found.get(key)
        if row is None:
            gain = study.score(one) - base
            row = Ranked((*known, *names), key[1] or None, one.model.reach.name, 0.0, gain, False)
        material = row.material or bool(names or unknown)
        found[key] = replace(row, probability=row.probability + p, material=material)
    return tuple(sorted(found.values(), key=lambda row: -row.probability))


def _named(study: Study, classes: dict[str, type[Effect]]) -> tuple[NamedEffect, ...]:
    """Return the sure effects, and the first of the group with the others as ties."""
    wanted = (*study.sure, *study.group[:1])
    others = [name for name in study.names if name not in (*study.sure, *study.group[1:])]
    last = study.last
    found: list[NamedEffect] = []
    for step in study.steps:
        effect = step.added
        times = 1 + sum(one.name == effect.name for one in found) if effect is not None else 0
        if effect is None or times > wanted.count(effect.name):
            continue
        tied = () if effect.name in study.sure else study.group[1:]
        runner_up = next(iter(tied or others), None)
        same = [i for i, e in enumerate(last.effects) if e.name == effect.name]
        index = same[min(times, len(same)) - 1]
        effect = last.effects[index]
        events = next((e.events for e in last.events if e.kind.name == effect.name), ())
        p = study.chance_of(effect.name, times)
        found.append(
            NamedEffect(
                name=effect.name, family=effect.family, p_value=study.p_value(step), tied_with=tied,
                runner_up=runner_up, margin=None if runner_up is None else p - study.chance_of(runner_up),
                parameters=_parameters(effect, _errors(study, index), events, _quantile(study)),
                where=Where(hours=effect.hours, dates=effect.dates),
                breaker=breaker(effect, (classes[name] for name in tied)), table=effect.to_table(),
                events=len(events), probability=p,
            )
        )  # fmt: skip
    return tuple(found)


def _errors(study: Study, index: int) -> dict[tuple[str, int | None], float]:
    """Return standard errors of the free values of an effect of the last explanation."""
    # A stepwise parameter has no influence between two commands, which adds to its standard error, or is all
    # of it where it is not free.
    errors = {key: WIDER * error for key, error in study.last.errors_of(index).items()}
    effect = study.last.effects[index]
    for key in effect.stepwise:
        between = command_steps(study.record)[0] / np.sqrt(12.0)
        errors[key, None] = float(np.hypot(errors.get((key, None), 0.0), between))
    return errors


def _parameters(
    effect: Effect, errors: dict[tuple[str, int | None], float], events: Sequence[Event], quantile: float
) -> tuple[Estimate, ...]:
    """Return estimates with 95 % intervals, from standard errors of fitted values or of event sizes."""
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
            error = errors.get((name, k if isinstance(value, tuple) else None), np.nan)
            if len(events) == len(values) and np.isclose(abs(one), abs(events[k].size)):
                error = WIDER * events[k].size_se
            label = f"{name}[{k}]" if len(values) > 1 else name
            low, high = one - quantile * error, one + quantile * error
            if name != "hour":  # it continues at midnight
                low, high = max(low, min(spec.low, one)), min(high, max(spec.high, one))
            found.append(Estimate(label, float(one), spec.unit, float(low), float(high)))
    return tuple(found)


def _quantile(study: Study) -> float:
    """Return the 97.5 % quantile of Student's t: standard errors are estimated from few blocks."""
    from scipy.stats import t

    return float(t.ppf(0.975, max(len(np.unique(study.split.block[study.opened])) - 1, 1)))


def _estimates(study: Study) -> tuple[Estimate, ...]:
    """Return the parameters of the response with 95 % intervals."""
    spreads = (_quantile(study) * WIDER * study.last.standard_errors).tolist()
    return tuple(
        Estimate(p.name, p.natural, p.unit, p.to_natural(p.value - spread), p.to_natural(p.value + spread))
        for p, spread in zip(study.last.model.reach.parameters, spreads, strict=False)
    )


def _gap(study: Study, floor: Sequence[float] | None) -> Gap:
    sealed, opened, record = study.split.sealed, study.opened, study.record

    def rmse(one: Explanation, days: Bools, foreseen: bool) -> tuple[float, ...]:
        errors = one.errors
        if one.events and not foreseen:
            errors = day_errors(record, one.predicted + one.coded, one.noise)
        return tuple(errors.rmse(days)[-len(HOURS) :].tolist())

    steps = tuple(
        Step(step.added.name, rmse(step, sealed, False), rmse(step, sealed, True) if step.events else None)
        for step in study.steps
        if step.added is not None
    )
    base, end = rmse(study.first, sealed, True), rmse(study.last, sealed, True)
    forecast = rmse(study.last, sealed, False)
    return Gap(
        heldout_dates=tuple(d for d, kept in zip(record.dates, sealed, strict=True) if kept),
        horizon_h=HOURS, unit="m" if record.kind == "pool" else "m3/s", rmse_baseline=base,
        rmse_augmented=forecast, rmse_floor=None if floor is None else tuple(floor),
        closed=_closed(base, end, floor), closed_forecast=_closed(base, forecast, floor), steps=steps,
        by_regime=regimes(study),
        rmse_described=end if study.last.events else None,
        rmse_open_baseline=rmse(study.first, opened, True),
        rmse_open_augmented=rmse(study.last, opened, False),
    )  # fmt: skip


def _closed(base: Sequence[float], end: Sequence[float], floor: Sequence[float] | None) -> float | None:
    """Return the median over the horizons of the share of the squared error above the floor that is gone."""
    if floor is None:
        return None
    b, e, f = (np.square(errors) for errors in (base, end, floor))
    above = b - f > 0.05 * b
    shares = (b - e)[above] / (b - f)[above]
    shares = shares[np.isfinite(shares)]
    return float(np.median(shares)) if len(shares) else None


def _of_noise(study: Study) -> Unknown | None:
    """Return the size of the unknown cause in the most probable explanation that has one."""
    one = study.stranger
    if one is None:
        return None
    size = one.noise.level_sd if study.record.kind == "river" else one.noise.inflow_sd
    return Unknown(Where(), size, (f"an unlogged flow of {size:.3g} m3/s, without rhythm or place",))


def _unknown(study: Study, evidence: Evidence) -> Unknown | None:
    """Return the unexplained remainder if it has a period or a location, else None."""
    record, last = study.record, study.last
    seen = np.where(record.used, last.residual, np.nan)
    innovations = last.noise.whiten(seen, activity=record.activity)
    w = np.where(record.used, evidence.inflow_after, 0.0)
    place, blocks = None, study.split.block
    if len(np.unique(blocks[record.used.any(axis=1)])) >= FEWEST_BLOCKS:  # fewer give no significant location
        place = strongest(Scores(w, record.used, blocks), drivers(record, blocks), record.dates)
    likeliest = study.stranger if study.unknown >= UNKNOWN else None
    found, rows = _unnamed(likeliest or last, record)
    # size, dates and period refer to the same days
    windows = place.windows if place is not None else ()
    if rows:
        windows, place = ((record.dates[min(rows)], record.dates[max(rows)]),), None
    if late := study.unknown_delays if likeliest is not None else ():
        found.append(f"a delay that resembles {' with '.join(_described(effect) for effect in late)}")
        dates = [effect.dates for effect in late if effect.dates]
        if dates:
            windows, place = ((min(d[0] for d in dates), max(d[1] for d in dates)),), None
    within = np.array([not windows or any(a <= day <= b for a, b in windows) for day in record.dates])
    used = record.used & within[:, None]
    slow = rhythm(innovations, used, record.time)
    if slow is not None:
        unit, name = (HOUR, "h") if slow.period > SHORT else (60.0, "min")
        lasts, to = slow.period / unit, slow.resolution / unit
        found.append(f"a rhythm with a period of {lasts:.3g} {name} (to {to:.2g} {name})")
    # of all days if too few are within
    peaks = (
        highest_peak(innovations, days, last.weights, record.sample_time) for days in (used, record.used)
    )
    period, height = next((peak for peak in peaks if peak is not None), (0.0, 0.0))
    swings = (getattr(e, "period") for e in (*study.start, *last.effects) if e.found_as == "swing")  # noqa: B009
    known = any(0.7 < period / float(other) < 1.4 for other in swings)
    short = slow is None or slow.period > SHORT > period  # another one repeats `slow`
    swing = height > LEAST_HEIGHT and not known and short
    if swing:
        found.append(f"a swing with a period of {period / 60:.0f} min")
    if place is not None and place.p_value <= LEAST_P and abs(place.size) > 0.5 * last.noise.inflow_sd:
        sense = "more" if place.size > 0 else "less"
        found.append(f"{place.where or 'these days'} ({abs(place.size):.3g} m3/s {sense})")
    if not found:
        return None
    rms = float(np.sqrt(np.mean(w[used] ** 2)))
    for effect in likeliest.effects if likeliest is not None else ():
        if isinstance(effect, RecurringFlow):  # the weather of `w` is no part of it, or swings more slowly
            rms = float(np.sqrt(0.5 * np.square(effect.waves).sum()))
    length = slow.period if slow is not None else period if swing else None
    where = Where() if not windows else Where(
        dates=(windows[0][0], windows[-1][1]), regime=f"at {len(windows)} times" if windows[1:] else None
    )  # fmt: skip
    return Unknown(where, rms, tuple(found), length)


def _described(effect: Effect) -> str:
    """Return the name of an effect, with its first parameter if that is a time."""
    size = _parameters(effect, {}, (), 1.0)[0]
    return _words(effect.name) + (f" ({duration([abs(size.value)])})" if size.unit == "s" else "")


def _unnamed(one: Explanation, record: Record) -> tuple[list[str], list[int]]:
    """Describe the events without a name, and return the rows in which their pulses begin."""
    found, rows = list[str](), list[int]()
    for kind, events in ((e.kind, e.events) for e in one.events if e.events and not e.kind.name):
        days, sizes = [e.day for e in events], np.abs([e.size for e in events])
        if kind.shape == "jump":
            found.append(f"{len(days)} jumps of the reading, of {sizes.max():.2g} m at most")
            continue
        lasts = np.array([e.duration_s for e in events]) / HOUR
        hours = record.used[min(days) : max(days) + 1].sum() * record.sample_time / HOUR
        if lasts.sum() <= FILLED * hours:
            what = f"pulses of about {np.median(sizes):.3g} m3/s that last {np.median(lasts):.2g} h"
            found.append(f"{len(days)} {what}")
            rows += days
    return found, rows


def _evidence(study: Study) -> Evidence:
    record = study.record
    first, last = study.first, study.last
    before, after = (
        e.noise.smooth(np.where(record.used, e.residual, np.nan), record.activity) for e in (first, last)
    )
    runs = [m.reach.simulate(record, m.changes(record)) for m in (first.whole, last.whole)]
    start = np.argmax(record.used, axis=1)
    rows = np.arange(record.days)
    runs = [run + (record.output[rows, start] - run[rows, start])[:, None] for run in runs]
    return Evidence(
        record, study.split, runs[0], runs[1], first.residual, last.residual, *before, *after, last.whole
    )  # fmt: skip


def _notes(study: Study) -> tuple[str, ...]:
    notes = list(study.notes)
    at_limit = [
        f.name for f in study.last.model.reach.parameters
        if f.value >= f.high or f.value <= f.low < f.mean  # gauge_lag may be 0, its prior mean
    ]  # fmt: skip
    if at_limit:
        notes.append(f"calibrated values at their limits: {', '.join(at_limit)}")
    light = int((study.last.weights[study.opened] < 0.3).sum())
    if light:
        notes.append(f"{light} open days are far noisier than most and count little")
    return tuple(notes)


def regimes(study: Study) -> tuple[Regime, ...]:
    """Return the gap on the sealed days by the state of the reach at the target of each forecast."""
    # States: low, middle and high inflow; for a pool, after a step of the outflow and calm; night and day. A
    # state that always or never occurs is left out. Events of the day itself are unknown, as in the gap.
    record = study.record
    first, last = study.first, study.last
    found, sealed = [], study.split.sealed
    for name, words, samples in states(record):
        part = replace(record, used=record.used & samples)
        before = day_errors(part, first.predicted, first.noise)
        after = day_errors(part, last.predicted + last.coded, last.noise)
        rmse = [tuple(errors.rmse(sealed).tolist()) for errors in (before, after)]
        counts = before.counts[:, sealed].sum(axis=1)
        found.append(Regime(name, words, rmse[0], rmse[1], tuple(int(c) for c in counts)))
    return tuple(found)


def states(record: Record) -> list[tuple[str, str, Bools]]:
    """Return name, words and samples (days, n) of each state; inflow terciles are of the used samples."""
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
    """Return samples in and within an hour after a step of the outflow (days, n); its least size [m3/s]."""
    # Smaller changes of the outflow occur all the time and do not count as steps.
    rise, after = (max(round(t / record.sample_time), 1) for t in (RISE, AFTER))
    low, high = np.quantile(record.outflow[record.used], [0.05, 0.95])
    size = max(STEP * float(high - low), 1e-9)
    u = record.outflow
    step = np.zeros(u.shape, bool)
    step[:, rise:] = np.abs(u[:, rise:] - u[:, :-rise]) >= size
    sample = np.arange(u.shape[1])
    last = np.maximum.accumulate(np.where(step, sample, -after - 1), axis=1)
    return np.asarray(sample - last <= after), size
