"""Seiche: an oscillation of the gauge with a random phase, found in the spectrum of the innovations.

The innovations of a correct model are white. A damped oscillation driven by noise adds the spectrum of an
autoregression of second order, transformed by the whitening filter. Its period, damping and size are fitted
to the open days by Whittle's likelihood.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize

from rivid.diagnosis.data import Record
from rivid.diagnosis.explanation import Explanation
from rivid.diagnosis.noise.model import NoiseModel
from rivid.effects import Effect
from rivid.effects.level import covariance
from rivid.types import Bools, Floats

SHORTEST, LONGEST = 4, 0.25  # smallest period [samples] and largest one [days]
LEAST_DAMPING = 5e-5
"""Smallest accepted damping [1/s]. Less is not resolved within a day: a steady oscillation, of a machine."""
SLOWEST = 1e-6  # smallest damping tried in the fit [1/s]
BAND = 2.5  # frequencies within this factor of the peak are fitted
NEARBY = 1.3  # the power of a swing is summed over frequencies within this factor of its own
WIDEST = 0.7  # largest product of damping and period: a wider peak is no oscillation
LEAST_CONTRAST = 4.0
"""Smallest ratio of the power at the peak to that without a seiche: the error of a poor response has less."""
LEAST_PEAK = 2.0
"""Smallest height of the highest peak of the mean periodogram over its surroundings for a fit to start."""
FEWEST, FEWEST_DAYS = 30, 5
"""Samples of a day, and days, of which the mean periodogram is searched. Of white noise with 400 or 1,440
samples a day, the highest peak is three times as high as its surroundings in 0.3 or 0.7 % of cases with five
days, and in 2 or 3 % with four."""
PRESENT = 0.8  # least share of the days on which a seiche must gain
STEADY = 4.0 / 3.0
"""Largest factor between the power of the swing in the third of the samples with the quietest flows and that
in all: in five seasons of 50 days 0.9 to 1.0 for a seiche, 0.6 and 1.3 for waves that the response lacked."""


def periodograms(innovations: Floats, used: Bools) -> Floats:
    """Compute the periodogram of each day, shape (days, (n - 1) // 2); its mean is 1 for white noise.

    Frequencies are the Fourier frequencies of a row except 0 and the highest; both arguments are (days, n).
    """
    there = np.asarray(used, float)
    many = np.maximum(there.sum(axis=1, keepdims=True), 1.0)
    lines = np.fft.rfft(innovations * there, axis=1)[:, 1 : (innovations.shape[1] - 1) // 2 + 1]
    return np.asarray(np.abs(lines) ** 2 / many)


def through_filter(noise: NoiseModel, n: int) -> Floats:
    """Return the whitening filter's squared gain for a level [m] at these frequencies, ((n - 1) // 2,)."""
    impulse = np.zeros((1, 2 * n))
    impulse[0, n] = 1.0
    answer = noise.whiten(impulse)[0, n:]  # without the filter's initial transient
    return np.asarray(np.abs(np.fft.rfft(answer)[1 : (n - 1) // 2 + 1]) ** 2)


def spectrum_of(effect: Effect, n: int, sample_time: float) -> Floats:
    """Return the expected periodogram of a seiche at these frequencies [m2]; white noise of 1 m has 1 m2."""
    # It follows from the covariance, each lag weighted by its number in a row (Sykulski, Olhede, Guillaumin,
    # Lilly and Early 2019). With the spectrum of an infinite row, the width that a finite row gives to a line
    # between two frequencies would be taken for that of a strong steady oscillation.
    (a1, a2), _ = law = effect.autoregression(sample_time)  # type: ignore[attr-defined]
    variance, next_one = covariance(law)
    r, k = np.sqrt(-a2), np.arange(n)
    angle = np.arccos(0.5 * a1 / r)
    phase = (next_one / (variance * r) - np.cos(angle)) / np.sin(angle)
    lags = (1.0 - k / n) * variance * r**k * (np.cos(angle * k) + phase * np.sin(angle * k))
    power = 2.0 * np.fft.rfft(lags).real - variance
    return np.asarray(power[1 : (n - 1) // 2 + 1])


def fit_seiche(
    power: Floats, gain: Floats, fit: Bools, effect: type[Effect], T_s: float, n: int
) -> tuple[Effect, Floats, int, float]:
    """Fit the seiche that explains the periodograms of the days `fit` (days,) best, by Whittle (1953).

    In a band of :data:`BAND` about the highest peak the gain of a day is ``sum_f [I_f (1/S0_f - 1/S_f) -
    ln(S_f / S0_f)]`` with ``S_f = c f^b + |W_f|^2 P_f`` and S0 a fitted power of f alone. `power` (days, m)
    is from :func:`periodograms` of rows of n samples and `gain` (m,) from :func:`through_filter`. Returns the
    seiche, the log-likelihood gained on each day (days,) [nats], the number of periods searched, and the
    ratio of the power at the peak to that without the seiche.
    """
    mean = power[fit].mean(axis=0)
    order = np.arange(1, len(mean) + 1)
    period, tried, _ = _highest(mean, n, T_s)
    peak = n * T_s / period
    band = (order >= peak / BAND) & (order <= peak * BAND)
    away, seen = np.log(order[band] / peak), mean[band]

    def white(p: Floats) -> Floats:
        return np.asarray(np.exp(p[0] + p[1] * away))

    def spectra(p: Floats) -> Floats:
        return np.asarray(white(p[3:]) + (gain * spectrum_of(at(p), n, T_s))[band])

    def at(p: Floats) -> Effect:
        period, damping, amplitude = np.exp(np.clip(p[:3], *limits[:, :3])).tolist()
        return effect.from_table({"period": period, "damping": damping, "amplitude": amplitude})

    def cost(S: Floats) -> float:
        return float((seen / S + np.log(S)).sum())

    level = float(seen.mean())  # a line may contribute nearly all of it
    low = np.log([0.8 * period, SLOWEST, 1e-6, 1e-6 * level, 1e-4])
    limits = np.array([low, np.log([1.25 * period, WIDEST / period, 1.0, 10.0 * level, 1e4])])
    base = _lowest(lambda p: cost(white(p)), np.array([np.log(level), 0.0]), limits[:, 3:]).x
    over = np.maximum(seen - np.median(seen), 0.0) / gain[band]
    size = 2.0 * np.sqrt(over[abs(away) < np.log(NEARBY)].sum() / n)  # a swing's power is in its line
    ends = [
        _lowest(lambda p: cost(spectra(p)), np.array([*np.log([period, damping, size]), *base]), limits)
        for damping in (3e-5, 1e-4, 3e-4)
    ]
    p = min(ends, key=lambda end: float(end.fun)).x
    S0, S = white(base), spectra(p)
    gains = (power[:, band] * (1.0 / S0 - 1.0 / S) - np.log(S / S0)).sum(axis=1)
    return at(p), gains, tried, float((S / white(p[3:])).max())


def _lowest(cost: Callable[[Floats], float], start: Floats, limits: Floats) -> Any:
    """Minimise a cost within limits, shape (2, k)."""
    return minimize(cost, np.clip(start, *limits), method="L-BFGS-B", bounds=list(limits.T), tol=1e-9)


def _highest(mean: Floats, n: int, T_s: float) -> tuple[float, int, float]:
    """Return the period of the highest peak above its surroundings, the periods searched, and its height."""
    periods = n * T_s / np.arange(1, len(mean) + 1)
    smooth = np.convolve(np.pad(mean, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    able = np.flatnonzero((periods >= SHORTEST * T_s) & (periods <= LONGEST * n * T_s))
    around = [np.median(mean[max(k // 2, k - 60) : min(2 * k + 2, k + 61)]) for k in able]
    height = smooth[able] / np.maximum(around, 1e-12)
    top = int(np.argmax(height))
    return float(periods[able[top]]), len(able), float(height[top])


def highest_peak(
    innovations: Floats, used: Bools, weights: Floats, sample_time: float
) -> tuple[float, float] | None:
    """Return period [s] and height over its surroundings of the highest peak in days with a weight.

    Their periodograms are averaged, with the same mean for each, so that no day dominates; None of fewer than
    :data:`FEWEST_DAYS` with :data:`FEWEST` samples.
    """
    chosen = (weights > 0.0) & (used.sum(axis=1) >= max(FEWEST, used.shape[1] // 2))
    if chosen.sum() < FEWEST_DAYS:
        return None
    power = periodograms(innovations[chosen], used[chosen])
    mean = (power / power.mean(axis=1, keepdims=True)).mean(axis=0)
    period, _, height = _highest(mean, innovations.shape[1], sample_time)
    return period, height


def _in_quiet(record: Record, seen: Floats, noise: NoiseModel, period: float) -> float:
    """Return the power near a period in the third of the samples with the quietest flows over that in all."""
    assert record.activity is not None
    there = np.isfinite(seen)
    plain = np.where(there, replace(noise, misfit=0.0).whiten(seen), 0.0)  # the same filter for all flows
    lines = np.fft.rfft(plain, axis=1)
    frequency = np.fft.rfftfreq(plain.shape[1], record.sample_time)
    lines[:, abs(np.log(np.maximum(frequency, 1e-12) * period)) > np.log(NEARBY)] = 0.0
    power = np.fft.irfft(lines, plain.shape[1], axis=1) ** 2
    swings = max(round(period / record.sample_time), 1)
    moved = uniform_filter1d(record.activity, swings, axis=1)
    quiet = there & (moved <= np.quantile(moved[there], 1.0 / 3.0))
    return float(power[quiet].mean() / power[there].mean())


def seiche(record: Record, base: Explanation, effect: type[Effect]) -> tuple[Effect, Floats, int] | None:
    """Find a seiche, not too wide or too steady: effect, gain of each day [nats], periods searched."""
    # An oscillation of the outflow looks the same if the gauge is at the dam, but that of a governor is
    # either regular, or ends while the gates are held.
    noise = base.noise
    day = slice(record.lead, None)
    seen = np.where(record.used, base.residual, np.nan)
    innovations = noise.whiten(seen, activity=record.activity)[:, day]
    used = record.used[:, day]
    n = innovations.shape[1]
    whole = used.mean(axis=1) > 0.5
    opened = base.weights > 0.0
    if not (opened & whole).any():
        return None
    power = periodograms(innovations, used)
    gain = through_filter(noise, n)
    if _highest(power[opened & whole].mean(axis=0), n, record.sample_time)[2] < LEAST_PEAK:
        return None
    made, gains, tried, contrast = fit_seiche(power, gain, opened & whole, effect, record.sample_time, n)
    period, damping = float(getattr(made, "period")), float(getattr(made, "damping"))  # noqa: B009
    if not LEAST_DAMPING <= damping <= 0.99 * WIDEST / period or contrast < LEAST_CONTRAST:
        return None
    if abs(np.log(_in_quiet(record, seen, noise, period))) > np.log(STEADY):
        return None  # it depends on the flows: waves of the reach that the response lacks
    gains = np.where(whole, gains, 0.0)
    if (gains[whole & opened] > 0.0).mean() < PRESENT:
        return None  # a temporary fault of a clock or a gate gives oscillations as well
    return made, gains, tried
