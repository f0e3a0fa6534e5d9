"""Inputs of effects, and second-by-second references."""

import datetime as dt

import numpy as np

from rivid.effects import World

FIRST = dt.date(2008, 3, 28)


def times(days=3, sample_time=133.0, lead=1):
    """Return the time grid, which starts anew at every midnight; shape (lead + days, n)."""
    return np.arange(-lead, days)[:, None] * 86_400.0 + np.arange(0.0, 86_400.0, sample_time)


def world(seed=0, days=3, sample_time=133.0, lead=1, rows=False, flow=300.0, swing=80.0):
    """Return a world with a stepwise inflow; `rows`: one row a day, otherwise one long row."""
    time = times(days, sample_time, lead)
    rng = np.random.default_rng([91, seed])
    moves = rng.random(time.size) < 0.1
    inflow = flow + swing * np.round(rng.uniform(-1, 1, time.size), 2)
    held = inflow[np.maximum.accumulate(np.where(moves, np.arange(time.size), 0))]
    if not rows:
        time = time.ravel()
    return World(
        time=time, inflow=held.reshape(time.shape), outflow=None, first_day=FIRST,
        sample_time=sample_time, level=128.5, flow=flow, seed=(seed,),
    )  # fmt: skip


def seconds_of(row_time, row_flow, sample_time, aside=0):
    """Return a held flow second by second, with `aside` seconds of its first and last value at the ends."""
    end = min(row_time[-1] + sample_time, (row_time[-1] // 86_400 + 1) * 86_400)
    lengths = np.diff(np.append(row_time, end)).astype(int)
    inside = np.repeat(row_flow, lengths)
    return np.concatenate([np.full(aside, row_flow[0]), inside, np.full(aside, row_flow[-1])])


def samples_of(row_time, second_by_second, sample_time):
    """Return the sample means of a flow given second by second from the first sample on."""
    starts = (row_time - row_time[0]).astype(int)
    return np.array([part.mean() for part in np.split(second_by_second, starts[1:])])


def total(row_time, row_flow, sample_time):
    """Return the volume of a held flow [m3], summed over the samples."""
    return seconds_of(row_time, row_flow, sample_time).sum()
