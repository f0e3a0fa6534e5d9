"""Rhythms that the model lacks: lines in the spectrum of a whole record, from days down to a few samples.

A rhythm keeps its phase from day to day, unlike a seiche (:mod:`rivid.diagnosis.seiche`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import rfft
from scipy.ndimage import median_filter

from rivid.types import Floats, Ints

NEAREST = 12  # fewest lines to either side of one that give its surroundings
SHORTEST = 2.2  # shortest period of a rhythm [samples]
FINER = 8  # places for each sample: those of a day are in step with no other day's
CYCLES = 3.0  # fewest cycles of a period in a record
CHANCE = 0.01  # probability that a series without a rhythm shows one
AROUND = 60  # most lines to either side of one that give its surroundings: a damped oscillation is wider
PER_LINE = 3.0  # lines of the padded spectrum under a Hann window that have the information of one
MULTIPLES = 0.5
"""Share of the multiples of a frequency, up to the strongest line, that are lines: above it the frequency is
the fundamental. Short pulses have dozens."""


class Rhythm(NamedTuple):
    """A line in the spectrum of a whole record."""

    period: float  # [s]
    resolution: float  # difference of period that makes half a cycle over the record [s]
    many: float  # number of periods that the record separates


def rhythm(series: ArrayLike, used: ArrayLike, time: ArrayLike) -> Rhythm | None:
    """Return the strongest line of a record, a series (days, n) at times on one clock [s], or None.

    A sample that occurs twice, as in lead times, must be used once only. A line exceeds the multiple of the
    local median that white noise exceeds with the probability :data:`CHANCE`.
    """
    there, clock = np.asarray(used, bool), np.asarray(time, float)
    both = there[:, 1:] & there[:, :-1]
    if not both.any():
        return None
    # Remove the memory of weather, so that the spectrum is flat about a line.
    y = np.where(there, np.asarray(series, float), 0.0)
    y = np.where(there, y - y[there].mean(), 0.0)
    kept_on = float((y[:, 1:] * y[:, :-1])[both].sum() / max((y[:, :-1][both] ** 2).sum(), 1e-300))
    at, left = clock[:, 1:][both], (y[:, 1:] - kept_on * y[:, :-1])[both]
    step, span = float(clock[0, 1] - clock[0, 0]), float(np.ptp(at))
    first, many = int(np.ceil(2.0 * CYCLES)), int(2.0 * span / (SHORTEST * step)) + 1
    if many - first < 2 * NEAREST:
        return None
    m, hann = round(FINER * span / step), np.sin(np.pi * (at - at.min()) / span) ** 2
    line = np.bincount(np.rint((at - at.min()) * (m / span)).astype(np.intp), left * hann)
    power = np.asarray(abs(rfft(line, 2 * m)[first:many]) ** 2, float)
    frequency = np.arange(first, many) / (2.0 * span)
    reach = np.clip(np.rint(span * frequency), NEAREST, AROUND).astype(np.intp)
    ratio = power / np.maximum(_running_median(power, reach), 1e-300)
    # Powers of white noise are exponential. The median of n of them has the relative variance of a gamma
    # variable of the shape n ln2 ** 2: their ratio to it is a Pareto variable.
    shape = np.log(2.0) ** 2 * 2.0 * reach / PER_LINE
    log_chance = -shape * np.log1p(np.log(2.0) * ratio / shape)
    clear = log_chance < np.log(CHANCE / len(power))
    best = int(np.argmin(log_chance))
    if not clear[best]:
        return None
    wide, place = np.convolve(clear, np.ones(3), "same") > 0.0, 2.0 * span * frequency[best]
    fundamental = 1
    for times in range(2, int(min(0.5 * place / CYCLES, wide.sum() / MULTIPLES)) + 1):
        multiples = np.rint(place * np.arange(1, times + 1) / times).astype(np.intp)
        if wide[multiples - first].mean() > MULTIPLES:
            fundamental = times
    low, top, high = np.log(power[np.clip([best - 1, best, best + 1], 0, len(power) - 1)])
    between = 0.5 * (low - high) / min(low - 2.0 * top + high, -1e-9)  # vertex of a parabola through the line
    period = float(fundamental / (frequency[best] + 0.5 * np.clip(between, -0.5, 0.5) / span))
    return Rhythm(period, 0.5 * period**2 / span, 0.5 * many)


def _running_median(power: Floats, reach: Ints) -> Floats:
    """Return the median of so many lines to either side of each; `reach` (m,) increases to a constant."""
    m, wide = len(power), int(reach[-1])
    near = np.flatnonzero(reach < wide)
    out = median_filter(power, 2 * wide + 1, mode="reflect")
    for k in near.tolist():
        out[k] = np.median(power[max(k - reach[k], 0) : min(k + reach[k] + 1, m)])
    return np.asarray(out, float)
