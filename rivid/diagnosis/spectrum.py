"""A rhythm that the model lacks: the spectrum of the innovations, against that of days without one.

Innovations of a right model are white and of variance 1, so the reach drops out of its parametric bootstrap:
days of independent normal numbers with the same samples missing and the same weights. Every day is a
segment, and their periodograms are averaged: a seiche starts anew each day. What keeps step with the clock is
added before squaring, which is far sharper: the daily lines.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.errors import RividError
from rivid.types import DAY, Bools, Floats

KNOTS = 24
"""Frequencies at which the local median is taken; it is straight in the logarithm between them."""

NEAREST = 12
"""Frequencies on either side that a local median has at least, where there are as many."""

FEWEST = 30
"""Samples below which a day has no spectrum."""


@dataclass(frozen=True)
class DailyLine:
    """A harmonic of the day, the same on all days.

    Attributes
    ----------
    period : float
        [s]
    amplitude : float
        In standard deviations of an innovation.
    hour : float
        Hour of its maximum, in the innovations.
    gain : float
        Log-likelihood that it is worth [nats].
    p_value : float
        Of this line alone; exp(-gain), as two normal numbers have it.
    """

    period: float
    amplitude: float
    hour: float
    gain: float
    p_value: float


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The spectrum of innovations and its largest line.

    Attributes
    ----------
    period : ndarray, shape (m,)
        [s], longest first.
    power : ndarray, shape (m,)
        Average periodogram over what white innovations would have.
    ratio : ndarray, shape (m,)
        Power over its local median.
    peak_ratio, peak_period : float
        Largest ratio and its period [s].
    limit : float
        A ratio that white innovations exceed with probability `level`.
    level : float
    p_value : float
        Share of the bootstrap with as large a ratio.
    daily : tuple of DailyLine
        24 h, 12 h, ...
    """

    period: Floats
    power: Floats
    ratio: Floats
    peak_ratio: float
    peak_period: float
    limit: float
    level: float
    p_value: float
    daily: tuple[DailyLine, ...]

    @property
    def rhythm(self) -> bool:
        """Whether some period stands out."""
        return self.peak_ratio > self.limit

    @property
    def keeps_hours(self) -> bool:
        """Whether the day's harmonics, all of them counted, stand out."""
        return any(line.p_value <= self.level / len(self.daily) for line in self.daily)


def spectrum(
    innovations: ArrayLike,
    used: ArrayLike,
    sample_time: float,
    *,
    weights: ArrayLike | None = None,
    harmonics: int = 2,
    level: float = 0.01,
    draws: int = 199,
    seed: int = 0,
) -> Spectrum:
    """Spectrum of innovations, its largest line, and a limit for it.

    Parameters
    ----------
    innovations : array_like, shape (days, n)
        Whitened residual; rows on the same clock.
    used : array_like of bool, shape (days, n)
        Samples that count.
    sample_time : float
        T_s [s].
    weights : array_like, shape (days,), optional
        Weight of each day in the average.
    harmonics : int
        Daily lines: 24 h, 12 h, ...
    level : float
        Probability of exceeding the limit if nothing is there; 0.01 needs 99 draws or more.
    draws, seed : int
        Of the bootstrap.

    Raises
    ------
    RividError
        Where arrays do not fit, or no day has enough samples.
    """
    r, there = np.asarray(innovations, float), np.asarray(used, bool)
    weight = np.ones(len(r)) if weights is None else np.asarray(weights, float)
    if r.ndim != 2 or r.shape != there.shape or weight.shape != r.shape[:1]:
        raise RividError(f"innovations, used, weights have shapes {r.shape}, {there.shape}, {weight.shape}: "
                         "expected (days, n) twice and (days,)")  # fmt: skip
    if (rank := int(level * (draws + 1))) < 1:
        raise RividError(f"{draws} draws give no limit at {level:g}: expected {int(1 / level)} or more")
    rows = (there.sum(1) >= FEWEST) & (weight > 0.0)
    if not rows.any():
        raise RividError(f"no day has {FEWEST} used samples and a weight: nothing to take a spectrum of")
    r, there, weight = np.where(there, r, 0.0)[rows], there[rows], weight[rows] / weight[rows].sum()
    n = r.shape[1]
    white = np.random.default_rng(seed)
    quiet = np.stack([
        _power(white.standard_normal(r.shape, np.float32), there.astype(np.float32), weight)
        for _ in range(draws)
    ])  # fmt: skip
    frequency = np.arange(quiet.shape[1]) / (2 * n * sample_time)
    kept = (frequency >= 0.999 / min(DAY, n * sample_time)) & (frequency <= 0.5 / sample_time)
    # The day's own mean is out, and gaps smear: white innovations say what is left at each frequency.
    expected = quiet[:, kept].mean(0)
    power = _power(r, there.astype(float), weight)[kept] / expected
    ratio = power / _local_median(power[None])[0]
    largest = np.sort((quiet[:, kept] / expected / _local_median(quiet[:, kept] / expected)).max(1))
    peak = int(np.argmax(ratio))
    return Spectrum(
        period=1.0 / frequency[kept], power=power, ratio=ratio, peak_ratio=float(ratio[peak]),
        peak_period=float(1.0 / frequency[kept][peak]), limit=float(largest[-rank]), level=level,
        p_value=float((1 + (largest >= ratio[peak]).sum()) / (1 + draws)),
        daily=tuple(_line(r, there, weight, sample_time, k) for k in range(1, harmonics + 1)),
    )  # fmt: skip


def _unit(r: NDArray[Any], there: NDArray[Any]) -> NDArray[Any]:
    """Days (days, n) without their mean and with a mean square of 1: one loud day is not the average."""
    many = there.sum(1, keepdims=True)
    z = (r - (r * there).sum(1, keepdims=True) / many) * there
    return np.asarray(z / np.sqrt(np.maximum((z * z).sum(1, keepdims=True) / many, 1e-30)))


def _power(r: NDArray[Any], there: NDArray[Any], weight: Floats) -> Floats:
    """Average periodogram of days (days, n) at the frequencies k / (2 n T_s), under a Hann window."""
    from scipy.fft import rfft

    n = r.shape[1]
    window = np.hanning(n).astype(r.dtype)
    lines = rfft(_unit(r, there) * window, 2 * n, axis=1)
    share = weight / np.maximum((there * window**2).sum(1), 1e-30)
    return np.asarray(share @ (lines.real**2 + lines.imag**2), float)


def _local_median(power: Floats) -> Floats:
    """Running median over half to twice each frequency; power is (draws, m), evenly spaced."""
    m = power.shape[1]
    at = np.unique(np.geomspace(1, m, KNOTS).astype(int)) - 1
    low = np.clip(np.minimum(at // 2, at - NEAREST), 0, None)
    high = np.clip(np.maximum(2 * at, at + NEAREST), None, m - 1)
    medians = np.stack(
        [np.median(power[:, a : b + 1], axis=1) for a, b in zip(low, high, strict=True)], axis=1
    )
    position = np.log1p(np.arange(m))
    knots = np.log1p(at)
    right = np.clip(np.searchsorted(knots, position), 1, len(knots) - 1)
    share = (position - knots[right - 1]) / (knots[right] - knots[right - 1])
    return np.asarray(np.exp(np.log(medians[:, right - 1]) * (1 - share) + np.log(medians[:, right]) * share))


def _line(r: Floats, there: Bools, weight: Floats, sample_time: float, harmonic: int) -> DailyLine:
    """One cosine over all days by least squares, each day without its mean."""
    period = DAY / harmonic
    angle = 2.0 * np.pi * np.arange(r.shape[1]) * sample_time / period
    many = there.sum(1, keepdims=True)
    columns = np.stack([np.cos(angle), np.sin(angle)])[:, None] * there
    columns = (columns - columns.sum(2, keepdims=True) / many) * there
    z = _unit(r, there)
    share = weight / weight.max()
    gram = np.einsum("idn,jdn,d->ij", columns, columns, share)
    score = np.einsum("idn,dn,d->i", columns, z, share)
    spread = np.einsum("idn,jdn,d->ij", columns, columns, share**2)
    a, b = np.linalg.solve(gram, score)
    gain = 0.5 * float(score @ np.linalg.solve(spread, score))
    hour = float(np.arctan2(b, a) / (2.0 * np.pi) * period / 3600.0 % (period / 3600.0))
    return DailyLine(period, float(np.hypot(a, b)), hour, gain, float(np.exp(-gain)))
