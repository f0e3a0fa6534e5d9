"""Proposals that are no columns: events found one by one, jumps of the gauge, and noises (wind, a seiche)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.model.linear import Evaluation, Linear, evaluate
from rivid.diagnosis.noise import WALK_LIMIT
from rivid.diagnosis.search.events import PRICE, PULSES, RECESSIONS, Event, Events, Kind, find_events
from rivid.diagnosis.search.proposal import Proposal, compared
from rivid.diagnosis.search.seiche import seiche
from rivid.diagnosis.search.timetable import sizes, timetable
from rivid.effects import Effect
from rivid.types import DAY, HOUR, Floats

FEWEST = 3
"""Events of a kind must be so many."""
ALIKE = 0.75
"""Releases are alike: their sizes vary by less than this share, rain's by more or less."""
A_STORM = 3 * HOUR
"""Events that follow each other within this are one storm."""
SCHEDULED = 0.002
"""p of a timetable from which events are somebody's."""
MOST_PULSE, MOST_RAIN = 3.0, 10.0
"""Times the usual event: of one that midnight cuts off only the start is seen, and its size is a guess."""
STEP_PRICE = 30.0
"""Of a jump of the gauge [nats]."""
LEAST_WIND = 0.005
"""[m]."""
EDGE = 20
"""Samples at both ends of a day in which a jump cannot be told from a bad start."""
SMALLEST_STEP = 0.015
"""[m]."""


def happenings(
    model: Linear,
    before: Evaluation,
    classes: dict[str, type[Effect]],
    kernels: dict[str, Floats],
    names: tuple[str, ...] = (),
    coded: bool = False,
) -> list[Proposal]:
    """Events and noises that might be missing, by gain on the selecting days.

    Parameters
    ----------
    model : Linear
    before : Evaluation
    classes : dict
        Effects that may be named.
    kernels : dict of str to ndarray, shape (n,)
        Step responses of an inflow in the middle ("middle") and of a release at the lower dam ("down").
    names : tuple of str
        Effects that are in already.
    coded : bool
        Whether pulses at the lower dam are among them.
    """
    record = model.record
    kinds = []
    if "rain_inflow" in classes and "rain_inflow" not in names:
        kinds.append(rain(kernels))
    if "unlogged_downstream_release" in classes and record.kind == "pool" and not coded:
        kinds.append(lock(kernels))
    found = [_of_events(model, before, kind, classes[kind.name]) for kind in kinds]
    if "sensor_step" in classes and record.kind == "pool" and "sensor_step" not in names:
        found.append(_of_steps(model, before, classes["sensor_step"]))
    if "seiche" in classes and record.kind == "pool" and "seiche" not in names:
        found.append(seiche(model, before, classes["seiche"]))
    if "wind_setup" in classes and record.kind == "pool" and not model.level_noise:
        found.append(_of_wind(model, before, classes["wind_setup"]))
    return sorted((f for f in found if f is not None), key=lambda f: -f.gain_select)


def rain(kernels: dict[str, Floats]) -> Kind:
    """Rain: a steep rise and a recession."""
    return Kind("rain_inflow", "recession", 1, kernels["middle"], RECESSIONS)


def lock(kernels: dict[str, Floats]) -> Kind:
    """Pulses at the lower dam."""
    return Kind("unlogged_downstream_release", "pulse", -1, -kernels["down"], PULSES)


def search(model: Linear, before: Evaluation, kind: Kind, price: float = PRICE) -> Events:
    """Events of a kind in the residual of all days."""
    record = model.record
    follows = np.append(False, np.diff(record.day_number) == 1)
    return find_events(
        model.used(before.residual), before.noise.whiten, kind, record.sample_time, lead=record.lead,
        follows=follows, weights=before.weights, price=price,
    )  # fmt: skip


def _of_events(model: Linear, before: Evaluation, kind: Kind, effect: type[Effect]) -> Proposal | None:
    events = search(model, before, kind)
    if len(events.events) < FEWEST:
        return None
    if kind.shape == "pulse" and sizes(events.events).variation > ALIKE:
        return None
    if kind.shape == "recession":
        clock = timetable(_storms(events.events))
        if clock.p_value <= SCHEDULED and clock.share > 0.5:
            return None  # rain keeps no hours
    record = model.record
    made = as_effect(effect, events, record)
    price = PRICE * np.bincount([e.day for e in events.events], minlength=record.days).astype(float)
    after = evaluate(model.less(events.coded))
    active = np.abs(events.coded).max(axis=1)
    fit, select, t, better, blocks = compared(model, before, after, price, active)
    return Proposal(
        kind.name, f"{len(events.events)} events", made, (), (None, None), _chance(fit), after,
        events.coded[None], fit, select, t, better, blocks, events=events,
    )  # fmt: skip


def _storms(events: Sequence[Event]) -> list[Event]:
    """The first event of each storm: a rise that took its time is coded as several that follow each other."""
    found: list[Event] = []
    last = -np.inf
    for event in sorted(events, key=lambda e: (e.day, e.start_s)):
        at = event.day * DAY + event.start_s
        if at - last > A_STORM:
            found.append(event)
        last = at
    return found


def _chance(gain: float) -> float:
    """Of events whose price is the logarithm of how many there could have been; half, for safety."""
    return float(np.exp(-max(gain, 0.0) / 2.0))


def as_effect(effect: type[Effect], events: Events, record: Record) -> Effect:
    """The effect with its events, as hours since the first day's midnight."""
    number = record.day_number
    starts = tuple(float((number[e.day] * DAY + e.start_s) / HOUR) for e in events.events)
    sizes_ = np.array([abs(float(e.size)) for e in events.events])
    most = (MOST_RAIN if effect.name == "rain_inflow" else MOST_PULSE) * float(np.median(sizes_))
    size = tuple(np.minimum(sizes_, most).tolist())
    if effect.name == "rain_inflow":
        table = {"starts": starts, "peak": size, "rise": 0.1, "recession": events.events[0].duration_s / HOUR}
    else:
        table = {"starts": starts, "size": size, "duration": events.events[0].duration_s / HOUR}
    return effect.from_table({key: list(v) if isinstance(v, tuple) else v for key, v in table.items()})


def _of_steps(model: Linear, before: Evaluation, effect: type[Effect]) -> Proposal | None:
    """Jumps of the gauge: a pulse of one sample into a reach that only stores is a step."""
    record = model.record
    ramp = np.arange(record.time.shape[1], dtype=float)
    found = [
        search(model, before, Kind("sensor_step", "pulse", sign, ramp, (record.sample_time,)), STEP_PRICE)
        for sign in (1, -1)
    ]
    best = max(found, key=lambda f: f.gain)
    edge = EDGE * record.sample_time
    end = (record.time.shape[1] - record.lead) * record.sample_time - edge
    large = [e for e in best.events if abs(e.size) > SMALLEST_STEP and edge < e.start_s < end]
    if not large:
        return None
    top = max(large, key=lambda e: e.gain)
    at = record.lead + top.start_s / record.sample_time
    column = np.zeros(record.time.shape)
    column[top.day] = np.arange(record.time.shape[1]) >= at
    after = evaluate(model, column[None])
    gain = after.likelihood - before.likelihood
    total = float(gain[model.split.fit | model.split.select].sum()) - STEP_PRICE
    day = record.day_number[top.day]
    made = effect.from_table(
        {"step": float(top.size), "start": float((day * DAY + top.start_s) / HOUR)}
    )  # fmt: skip
    return Proposal(
        "sensor_step", "jump", made, (), (None, None), _chance(total), after, column[None], total, total,
        float(np.sqrt(max(total, 0.0))),
        1.0 - after.errors.rmse([top.day]) / before.errors.rmse([top.day]), 1,
    )  # fmt: skip


def _of_wind(model: Linear, before: Evaluation, effect: type[Effect]) -> Proposal | None:
    """A level noise with a memory of hours.

    A random walk of the level is all but the same within a day, and would swallow it: both models have
    a small one only.
    """
    plain = replace(model, noise=before.noise)
    after = evaluate(plain, level_noise=True)
    before = evaluate(plain, walk_limit=WALK_LIMIT)
    noise = after.noise
    if not (LEAST_WIND < noise.level_sd < 1.0 and 0.3 * HOUR < noise.level_memory < 24.0 * HOUR):
        return None
    quiet = np.zeros(model.record.days)
    fit, select, t, better, blocks = compared(model, before, after, quiet, quiet + 1.0)
    made = effect.from_table({"deviation": noise.level_sd, "correlation_time": noise.level_memory / HOUR})
    return Proposal(
        "wind_setup", "level noise", made, (), (None, None), _chance(fit), after,
        np.empty((0, *model.record.time.shape)), fit, select, t, better, blocks, level_noise=True,
        gains=after.likelihood - before.likelihood,
    )  # fmt: skip
