"""Periodic components that the model lacks: spectrum of the innovations compared with its bootstrap.

Innovations of a correct model are white with variance 1, so the parametric bootstrap does not depend on the
reach: days of independent normal numbers with the same missing samples and weights. Every day is a segment,
and periodograms are averaged, as the phase of a seiche is not kept from day to day.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import rfft

from rivid.types import DAY, Bools, Floats

KNOTS = 24
"""Frequencies at which the local median is computed; its logarithm is interpolated linearly between them."""
NEAREST = 12  # smallest number of frequencies on either side in a local median, if there are as many
FEWEST = 30  # samples below which a day has no spectrum


def spectrum(
    innovations: Floats, used: Bools, sample_time: float, weights: Floats, *, level: float = 0.01,
    draws: int = 199, seed: int = 0,
) -> tuple[float, float, float] | None:  # fmt: skip
    """Find the largest line in the spectrum of innovations (days, n): period [s], ratio, and its limit.

    The ratio is its power over the local median; white innovations exceed the limit with the probability
    `level`. Days are averaged by their weights (days,). Returns None if no day with a weight has
    :data:`FEWEST` used samples.
    """
    rows = (used.sum(1) >= FEWEST) & (weights > 0.0)
    if not rows.any():
        return None
    r, there = np.where(used, innovations, 0.0)[rows], used[rows]
    weight = weights[rows] / weights[rows].sum()
    n = r.shape[1]
    white = np.random.default_rng(seed)
    quiet = np.stack([
        _power(white.standard_normal(r.shape, np.float32), there.astype(np.float32), weight)
        for _ in range(draws)
    ])  # fmt: skip
    frequency = np.arange(quiet.shape[1]) / (2 * n * sample_time)
    kept = (frequency >= 0.999 / min(DAY, n * sample_time)) & (frequency <= 0.5 / sample_time)
    # The day's mean is removed and gaps smear: the bootstrap gives the expected power at each frequency.
    expected = quiet[:, kept].mean(0)
    powers = np.concatenate([_power(r, there.astype(float), weight)[None], quiet])[:, kept] / expected
    ratio, *others = powers / _local_median(powers)
    peak = int(np.argmax(ratio))
    largest = np.sort(np.max(others, axis=1))
    return float(1.0 / frequency[kept][peak]), float(ratio[peak]), float(largest[-int(level * (draws + 1))])


BIN = 1800.0
"""Length of the averages of a series in which a rhythm is sought [s], or one sample if this is longer."""
BINS = 4.0  # averages in the shortest period of a rhythm
SHORTEST = BINS * BIN  # shortest period of a rhythm [s]
CYCLES = 3.0  # fewest cycles of a period in a record
CHANCE = 0.01  # probability that a series without a rhythm shows one
RHYTHM_DRAWS = 200  # draws of white noise: they give a probability of 1 % to within 0.7 %
HARMONICS = range(2, 13)
"""A line is taken as that of a period this number of times as long if there is a line too: pulses of two
hours a day have twelve."""


class Rhythm(NamedTuple):
    """A line in the spectrum of a whole record."""

    period: float  # [s]
    resolution: float  # difference of period that makes half a cycle over the record [s]
    many: float  # number of periods that the record separates


def rhythm(series: ArrayLike, used: ArrayLike, time: ArrayLike) -> Rhythm | None:
    """Return the strongest line of a record, a series (days, n) at times on one clock [s], or None.

    A sample that occurs twice, as in lead times, must be used once only. A line exceeds the multiple of the
    local median that white noise with the same gaps exceeds with the probability :data:`CHANCE`.
    """
    there = np.asarray(used, bool)
    clock = np.asarray(time, float)
    at, y = clock[there], np.asarray(series, float)[there]
    if not len(at):
        return None
    step = float(np.diff(clock[0]).max(initial=BIN))
    bins = ((at - at.min()) // step).astype(np.intp)
    counts = np.bincount(bins)
    m = len(counts)
    means = np.bincount(bins, y) / np.maximum(counts, 1)
    frequency = np.arange(m + 1) / (2.0 * m * step)
    kept = (frequency >= CYCLES / (m * step)) & (frequency <= 1.0 / (BINS * step))
    if kept.sum() < 2 * NEAREST:
        return None
    # Remove the memory of weather, so that the spectrum is flat about a line.
    both = (counts[1:] > 0) & (counts[:-1] > 0)
    y = np.where(counts > 0, means - means[counts > 0].mean(), 0.0)
    kept_on = float((y[1:] * y[:-1])[both].sum() / max((y[:-1][both] ** 2).sum(), 1e-300))
    steps = np.where(both, y[1:] - kept_on * y[:-1], 0.0)
    white = np.random.default_rng(0).standard_normal((RHYTHM_DRAWS, m - 1)) * both
    levels = np.concatenate([steps[None], white])
    powers = abs(rfft(levels * np.hanning(m - 1), 2 * m, axis=1)[:, kept]) ** 2
    ratios = powers / np.maximum(_local_median(powers), 1e-300)
    frequency, ratio = frequency[kept], ratios[0]
    limit = float(np.quantile(ratios[1:].max(axis=1), 1.0 - CHANCE))
    best = int(np.argmax(ratio))
    if ratio[best] <= limit:
        return None
    found = frequency[best]
    for times in HARMONICS:
        near = abs(frequency - found / times) <= 1.0 / (2.0 * m * step)
        if (ratio[near] > limit).any():
            best = int(np.argmax(np.where(near, ratio, 0.0)))
    low, top, high = np.log(powers[0][np.clip([best - 1, best, best + 1], 0, len(frequency) - 1)])
    between = 0.5 * (low - high) / min(low - 2.0 * top + high, -1e-9)  # vertex of a parabola through the line
    period = float(1.0 / (frequency[best] + np.clip(between, -0.5, 0.5) / (2.0 * m * step)))
    return Rhythm(period, period**2 / (2.0 * m * step), m / BINS)


def _power(r: NDArray[Any], there: NDArray[Any], weight: Floats) -> Floats:
    """Return the average periodogram of days (days, n) at frequencies k / (2 n T_s), under a Hann window."""
    # Days have their mean subtracted and the mean square 1, so that no single day dominates.
    n, many = r.shape[1], there.sum(1, keepdims=True)
    z = (r - (r * there).sum(1, keepdims=True) / many) * there
    z /= np.sqrt(np.maximum((z * z).sum(1, keepdims=True) / many, 1e-30))
    window = np.hanning(n).astype(r.dtype)
    lines = rfft(z * window, 2 * n, axis=1)
    share = weight / np.maximum((there * window**2).sum(1), 1e-30)
    return np.asarray(share @ (lines.real**2 + lines.imag**2), float)


def _local_median(power: NDArray[Any]) -> Floats:
    """Return the running median over half to twice each frequency; power is (draws, m), evenly spaced."""
    m = power.shape[1]
    at = np.unique(np.geomspace(1, m, KNOTS).astype(int)) - 1
    low = np.clip(np.minimum(at // 2, at - NEAREST), 0, None)
    high = np.clip(np.maximum(2 * at, at + NEAREST), None, m - 1)
    windows = zip(low, high, strict=True)
    medians = np.stack([np.median(power[:, a : b + 1], axis=1) for a, b in windows], axis=1)
    between = [np.interp(np.log1p(np.arange(m)), np.log1p(at), row) for row in np.log(medians)]
    return np.exp(between)
