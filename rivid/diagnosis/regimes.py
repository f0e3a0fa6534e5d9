"""The gap by regime: at low and high inflow, after a step of the outflow and in calm, by night and by day."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.fit import DayErrors, day_errors
from rivid.diagnosis.result import Regime
from rivid.types import Bools, Floats

if TYPE_CHECKING:
    from rivid.diagnosis.selection import Study


STEP = 0.15
"""A step is a change of the outflow by this share of its 5-95 % range, within :data:`RISE`."""
RISE, AFTER = 1800.0, 3600.0
"""Time in which a step is made, and time after its end that counts as after it [s]."""
NIGHT = (22.0, 6.0)
"""Hours of the night."""


@dataclass(frozen=True, eq=False)
class State:
    """Samples in which the reach is in one state.

    Attributes
    ----------
    name, words : str
    samples : ndarray of bool, shape (days, n)
    """

    name: str
    words: str
    samples: Bools


def regimes(study: "Study") -> tuple[Regime, ...]:
    """The gap on the sealed days by the state of the reach in which a forecast ends.

    Parameters
    ----------
    study : Study

    Returns
    -------
    tuple of Regime
        Low, middle and high inflow; after a step of the outflow and in calm, of a pool; night and day. A
        state that is always or never there is left out. Events count as known beforehand, as in the gap.
    """
    record = study.record
    first, last = study.first_evaluation, study.last_evaluation
    coded = np.zeros(record.time.shape)
    for turn in study.named:
        if turn.proposal.events is not None:
            coded = coded + turn.proposal.events.coded
    found = []
    for state in states(record):
        part = only(record, state.samples)
        before = day_errors(part, first.residual, first.noise)
        after = day_errors(part, last.residual + coded, last.noise)
        found.append(_told(state, before, after, study.split.sealed))
    return tuple(found)


def states(record: Record) -> tuple[State, ...]:
    """The states of a record, in the order of a table.

    Parameters
    ----------
    record : Record

    Returns
    -------
    tuple of State
        Terciles of the inflow are those of all samples that count.
    """
    found: list[State] = []
    low, high = np.quantile(record.inflow[record.used], [1.0 / 3.0, 2.0 / 3.0])
    if low < high:
        u = record.inflow
        found += [
            State("inflow_low", f"inflow below {low:.0f} m³/s", u < low),
            State("inflow_middle", f"inflow {low:.0f} to {high:.0f} m³/s", (u >= low) & (u < high)),
            State("inflow_high", f"inflow of {high:.0f} m³/s or more", u >= high),
        ]
    if record.kind == "pool":
        after, size = after_step(record)
        found += [
            State("after_step", f"in the hour after a step of the outflow of {size:.0f} m³/s or more", after),
            State("calm", "longer after such a step", ~after),
        ]
    night = (record.hour >= NIGHT[0]) | (record.hour < NIGHT[1])
    found += [
        State("night", f"by night, {NIGHT[0]:.0f} to {NIGHT[1]:.0f} h", night),
        State("day", f"by day, {NIGHT[1]:.0f} to {NIGHT[0]:.0f} h", ~night),
    ]
    return tuple(state for state in found if 0 < (state.samples & record.used).sum() < record.used.sum())


def after_step(record: Record) -> tuple[Bools, float]:
    """Samples during a step of the outflow and in the hour after it, shape (days, n), and its size [m3/s].

    A step is of a size that an operator would remember; by some m3/s the outflow moves all the time.
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


def only(record: Record, samples: Bools) -> Record:
    """The record with some of its samples as those that count."""
    return replace(record, used=record.used & samples)


def _told(state: State, before: DayErrors, after: DayErrors, days: Bools) -> Regime:
    counts = before.counts[:, days].sum(axis=1)
    return Regime(
        state.name, state.words, _plain(before.rmse(days)), _plain(after.rmse(days)),
        tuple(int(c) for c in counts),
    )  # fmt: skip


def _plain(values: Floats) -> tuple[float, ...]:
    return tuple(values.tolist())
