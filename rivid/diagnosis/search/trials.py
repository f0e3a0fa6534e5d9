"""Columns of trials: what each effect would change in the output, for a small or usual size of it."""

import datetime as dt
from collections.abc import Callable, Sequence

import numpy as np

from rivid.diagnosis.data import Record
from rivid.effects import Effect, Trial
from rivid.types import DAY, Floats

HOURS_A_DAY = 24
Window = tuple[tuple[dt.date, dt.date] | None, tuple[float, float] | None]


def hour_columns(record: Record, kernel: Floats) -> Floats:
    """Output for 1 m3/s in each hour of the day, from the response to a step; shape (24, days, n).

    Parameters
    ----------
    record : Record
    kernel : ndarray, shape (n,)
        Output at each sample after 1 m3/s set in.

    Notes
    -----
    The reach is taken as linear here; what is found is fitted in the simulator afterwards.
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
    """Columns of a trial that has instances, shape (k, days, n): what the baseline gains by each.

    Parameters
    ----------
    trial : Trial
    baseline : callable
        Output for further effects, shape (days, n).
    before : ndarray, shape (days, n)
        Output without them.
    """
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
