"""The gap by regime: at low and high inflow, after a step of the outflow and in calm, by night and by day."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rivid.diagnose.data import Floats, Record
from rivid.diagnose.drivers import SINCE, since_step
from rivid.diagnose.gap import DayErrors, day_errors
from rivid.diagnose.result import Regime

if TYPE_CHECKING:
    from rivid.diagnose.workflow import Study

Bools = NDArray[np.bool_]
AFTER = 1.0
"""A sample is after a step for so many hours; an edge of :data:`rivid.diagnose.drivers.SINCE`."""
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
        Low, middle and high inflow; after a step of the outflow and in calm, of a pool; night and day. What
        never occurs is left out. Events count as known beforehand, as in the gap itself.
    """
    record = study.record
    first, last = study.first_evaluation, study.last_evaluation
    coded = np.zeros(record.time.shape)
    for turn in study.rounds:
        if turn.choice is not None and turn.choice.proposal.events is not None:
            coded = coded + turn.choice.proposal.events.coded
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
    driver = since_step("", record.outflow, record.sample_time) if record.kind == "pool" else None
    if driver is not None:
        after = (driver.bin >= 0) & (driver.bin < SINCE.index(AFTER))
        found += [
            State("after_step", "in the hour after a step of the outflow", after),
            State("calm", "an hour or more after the last step", ~after),
        ]
    night = (record.hour >= NIGHT[0]) | (record.hour < NIGHT[1])
    found += [
        State("night", f"by night, {NIGHT[0]:.0f} to {NIGHT[1]:.0f} h", night),
        State("day", f"by day, {NIGHT[1]:.0f} to {NIGHT[0]:.0f} h", ~night),
    ]
    return tuple(state for state in found if (state.samples & record.used).any())


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
