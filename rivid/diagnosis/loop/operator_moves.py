"""What the logs show of how operators act: in moves, at looks, in steps of the command."""

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.data import Record
from rivid.types import Bools, Floats

PROMPT = 0.5
"""Chance of a move at a sample from which the inflow's move is said to ask for it."""

OFTEN = 0.02
"""Share of the samples at the smallest command from which that is a limit."""


def moves(record: Record) -> Bools:
    """Samples at which the outflow command is new and the level known, shape (days, n)."""
    return np.asarray(_new(record) & record.used & np.isfinite(record.output))


def last_move(record: Record) -> NDArray[np.intp]:
    """Sample of the last new command in the row, shape (days, n); 0 before the first."""
    sample = np.arange(record.time.shape[1])
    return np.asarray(np.maximum.accumulate(np.where(_new(record), sample, 0), axis=1))


def looks(record: Record, lag: int) -> tuple[float, float]:
    """Longest time between looks [s], and the move of the inflow that asks for one at once [m3/s].

    Where there is something to answer, the chance of a move at a sample has two values, below and above
    the notice: the notice is where they tell the logs' moves best, infinite where what lies above is no
    prompt answer either. Moves below it are looks that were due: their usual distance is the time.
    """
    sample, last = np.arange(record.time.shape[1]), last_move(record)
    before = np.concatenate([last[:, :1], last[:, :-1]], axis=1)
    seen = late(record.inflow, lag)
    waiting = np.abs(seen - np.take_along_axis(seen, before, axis=1))[record.used]
    acted, age = moves(record)[record.used], (sample - before)[record.used]
    some = waiting > 0.0
    best, notice = -np.inf, np.inf
    for limit in np.unique(np.quantile(waiting[some], np.linspace(0.0, 0.98, 50))) if some.any() else ():
        above, below = some & (waiting > limit), some & (waiting <= limit)
        told = _nats(acted[above]) + _nats(acted[below])
        if told > best and above.any():
            best, notice = told, float(limit) if acted[above].mean() > PROMPT else np.inf
    due = acted & (waiting <= notice)
    return float(np.median(age[due if due.any() else acted])) * record.sample_time, notice


def step_of(values: Floats) -> float:
    """The step that values come in; 0 where they come in none.

    Examples
    --------
    >>> step_of(np.array([130.01, 130.04, 130.02])), step_of(np.array([1.0, 2.5, 1.3])), step_of(np.ones(3))
    (0.01, 0.1, 0.0)
    """
    there = np.unique(np.round(values[np.isfinite(values)], 9))
    if len(there) < 2:
        return 0.0
    smallest = float(np.diff(there).min())
    for digits in range(-3, 5):
        for part in (5.0, 2.0, 1.0):
            step = part * 10.0**-digits
            off = np.abs(there - np.round(there / step) * step)
            if step <= smallest * (1 + 1e-6) and off.max() < 1e-6:
                return round(step, 9)
    return 0.0


def lowest_of(values: Floats) -> float:
    """The smallest command, if it is given so often that it must be a limit; else 0, or none that is less.

    Examples
    --------
    >>> lowest_of(np.array([40.0, 40.0, 57.0, 63.0])), lowest_of(np.linspace(40.0, 90.0, 100))
    (40.0, 0.0)
    """
    smallest = float(values.min())
    return smallest if np.mean(values == smallest) > OFTEN else min(smallest, 0.0)


def late(values: Floats, lag: int) -> Floats:
    """Values some samples before; a row's first holds before it."""
    if lag == 0:
        return values
    return np.concatenate([np.repeat(values[:, :1], lag, axis=1), values[:, :-lag]], axis=1)


def _new(record: Record) -> Bools:
    return np.asarray(np.diff(record.outflow, axis=1, prepend=record.outflow[:, :1]) != 0.0)


def _nats(happened: Bools) -> float:
    """Largest log-likelihood of a chance that is the same for all."""
    n = len(happened)
    p = happened.mean() if n else 0.0
    return float(n * (p * np.log(p) + (1 - p) * np.log1p(-p))) if 0.0 < p < 1.0 else 0.0
