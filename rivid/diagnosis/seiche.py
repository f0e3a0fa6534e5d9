"""A seiche: a swing of the gauge whose phase wanders, found in the spectrum of the innovations.

The innovations of a right model are white. A damped oscillation that noise keeps alive adds to their spectrum
that of an autoregression of second order, seen through the whitening filter. Its period, damping and size are
fitted to the days that fit by Whittle's likelihood and tried on those that select.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from rivid.diagnosis.fit import Evaluation, Linear
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.search.proposal import Proposal, compared
from rivid.effects import Effect
from rivid.types import Bools, Floats

SHORTEST, LONGEST = 8, 0.25
"""Period: samples at least, and days at most."""
LEAST_DAMPING = 5e-5
"""[1/s]. A slower fading is no wider than a day can resolve: a steady swing, of a machine, not of water."""
SLOWEST = 1e-6
BAND = 2.5
"""Frequencies within this factor of the peak are fitted."""
WIDEST = 0.7
"""Damping times period at most: a wider hump is no swing."""
LEAST_CONTRAST = 4.0
"""A lower hump is what a poor response leaves."""
PRESENT = 0.8
"""Share of the days on which a seiche is seen."""
SMALLEST = 0.002
"""Amplitude [m]."""


@dataclass(frozen=True)
class Swing:
    """A fitted seiche.

    Attributes
    ----------
    period : float
        [s].
    damping : float
        [1/s].
    amplitude : float
        [m].
    spreads : ndarray, shape (3,)
        Standard errors of their logarithms.
    gains : ndarray, shape (days,)
        Log-likelihood gained on each day [nats].
    tried : int
        At how many periods it was looked for.
    contrast : float
        Power at the peak over what is there without it.
    """

    period: float
    damping: float
    amplitude: float
    spreads: Floats
    gains: Floats
    tried: int
    contrast: float


def periodograms(innovations: Floats, used: Bools) -> Floats:
    """Of each day, at the Fourier frequencies of a row but 0 and the highest, 1 on average where white.

    Parameters
    ----------
    innovations : ndarray, shape (days, n)
    used : ndarray of bool, shape (days, n)

    Returns
    -------
    ndarray, shape (days, (n - 1) // 2)
    """
    there = np.asarray(used, float)
    many = np.maximum(there.sum(axis=1, keepdims=True), 1.0)
    lines = np.fft.rfft(innovations * there, axis=1)[:, 1 : (innovations.shape[1] - 1) // 2 + 1]
    return np.asarray(np.abs(lines) ** 2 / many)


def through_filter(noise: NoiseModel, n: int) -> Floats:
    """Squared gain of the whitening filter from a level [m] at the same frequencies, ((n - 1) // 2,)."""
    impulse = np.zeros((1, 2 * n))
    impulse[0, n] = 1.0
    answer = noise.whiten(impulse)[0, n:]  # the filter has forgotten its start
    return np.asarray(np.abs(np.fft.rfft(answer)[1 : (n - 1) // 2 + 1]) ** 2)


def spectrum_of(effect: Effect, n: int, sample_time: float) -> Floats:
    """Power of a seiche's level at the same frequencies [m2], 1 m2 for white noise of 1 m."""
    law = effect.autoregression(sample_time)  # type: ignore[attr-defined]
    omega = 2.0 * np.pi * np.arange(1, (n - 1) // 2 + 1) / n
    a1, a2 = law.coefficients
    turn = np.exp(-1j * omega)
    return np.asarray(law.innovation**2 / np.abs(1.0 - a1 * turn - a2 * turn**2) ** 2)


def find_swing(power: Floats, gain: Floats, fit: Bools, effect: type[Effect], T_s: float, n: int) -> Swing:
    """The swing that explains the periodograms of some days best.

    Parameters
    ----------
    power : ndarray, shape (days, m)
        From :func:`periodograms`.
    gain : ndarray, shape (m,)
        From :func:`through_filter`.
    fit : ndarray of bool, shape (days,)
        Days that it is fitted to.
    effect : type
        The catalogue's seiche.
    T_s : float
        [s].
    n : int
        Samples a row.

    Notes
    -----
    Whittle (1953), in a band of :data:`BAND` about the highest peak: the gain of a day is
    ``sum_f [I_f (1/S0_f - 1/S_f) - ln(S_f / S0_f)]`` with ``S_f = c f^b + |W_f|^2 P_f`` and S0 a fitted power
    of f alone: a noise model that has no swing bends all around one.
    """
    mean = power[fit].mean(axis=0)
    order = np.arange(1, len(mean) + 1)
    period, tried = _highest(mean, n * T_s / order, SHORTEST * T_s, LONGEST * n * T_s)
    peak = n * T_s / period
    band = (order >= peak / BAND) & (order <= peak * BAND)
    away, seen = np.log(order[band] / peak), mean[band]

    def white(p: Floats) -> Floats:
        return np.asarray(np.exp(p[0] + p[1] * away))

    def spectra(p: Floats) -> Floats:
        period, damping, amplitude = limited(p)
        at = effect.from_table({"period": period, "damping": damping, "amplitude": amplitude})
        return np.asarray(white(p[3:]) + (gain * spectrum_of(at, n, T_s))[band])

    def limited(p: Floats) -> tuple[float, float, float]:
        period = float(np.exp(np.clip(p[0], np.log(0.8 * n * T_s / peak), np.log(1.25 * n * T_s / peak))))
        damping = float(np.exp(np.clip(p[1], np.log(SLOWEST), np.log(WIDEST / period))))
        return period, damping, float(np.exp(np.clip(p[2], -14.0, 1.0)))

    def cost(S: Floats) -> float:
        return float((seen / S + np.log(S)).sum())

    base, _ = _lowest(lambda p: cost(white(p)), np.array([np.log(seen.mean()), 0.0]))
    found = [
        _lowest(lambda q: cost(spectra(q)), np.array([np.log(period), np.log(damping), np.log(size), *base]))
        for damping in (SLOWEST, 3e-5, 2e-4)
        for size in (0.003, 0.03)
    ]
    p = min(found, key=lambda f: f[1])[0]
    S0, S = white(base), spectra(p)
    gains = (power[:, band] * (1.0 / S0 - 1.0 / S) - np.log(S / S0)).sum(axis=1)
    days = int(fit.sum())
    return Swing(
        *limited(p),
        _spreads(lambda q: days * cost(spectra(q)), p)[:3],
        gains,
        tried,
        float((S / white(p[3:])).max()),
    )


def _lowest(cost: Callable[[Floats], float], start: Floats) -> tuple[Floats, float]:
    """The minimum of a cost, by Nelder and Mead, and its value."""
    end = minimize(cost, start, method="Nelder-Mead", options={"maxiter": 3000, "fatol": 1e-6})
    return np.asarray(end.x, float), float(end.fun)


def _spreads(cost: Callable[[Floats], float], p: Floats) -> Floats:
    """Standard errors from the curvature of a cost at its minimum."""
    k, h = len(p), 0.02
    H = np.empty((k, k))
    step = h * np.eye(k)
    for i in range(k):
        for j in range(k):
            corners = (cost(p + a * step[i] + b * step[j]) * a * b for a in (1, -1) for b in (1, -1))
            H[i, j] = sum(corners) / (4.0 * h * h)
    return np.sqrt(np.maximum(np.diag(np.linalg.pinv(H, hermitian=True)), 0.0))


def _highest(mean: Floats, periods: Floats, shortest: float, longest: float) -> tuple[float, int]:
    """Period of the highest peak above its surroundings, and among how many it was looked for."""
    smooth = np.convolve(np.pad(mean, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    able = np.flatnonzero((periods >= shortest) & (periods <= longest))
    around = [np.median(mean[max(k // 2, k - 60) : min(2 * k + 2, k + 61)]) for k in able]
    top = int(np.argmax(smooth[able] / np.maximum(around, 1e-12)))
    return float(periods[able[top]]), len(able)


def seiche(model: Linear, before: Evaluation, effect: type[Effect]) -> Proposal | None:
    """The seiche as a proposal; None where the swing is small, too wide, or as steady as a machine's.

    A swing of the outflow looks the same where the gauge stands at the dam; but what a governor does is
    either regular, and refused here, or ends when the gates are held: the answer says so.
    """
    record = model.record
    day = slice(record.lead, None)
    innovations = before.noise.whiten(model.used(before.residual))[:, day]
    used = record.used[:, day]
    n = innovations.shape[1]
    whole = used.mean(axis=1) > 0.5
    power = periodograms(innovations, used)
    gain = through_filter(before.noise, n)
    split = model.split
    swing = find_swing(power, gain, split.fit & whole, effect, record.sample_time, n)
    if swing.damping < LEAST_DAMPING or swing.damping > 0.99 * WIDEST / swing.period:
        return None
    if swing.amplitude < SMALLEST or swing.contrast < LEAST_CONTRAST:
        return None
    gains = np.where(whole, swing.gains, 0.0)
    if (gains[whole & (split.fit | split.select)] > 0.0).mean() < PRESENT:
        return None  # a clock or a gate that is wrong for a while rings as well
    after = _with(before, gains)
    quiet = np.zeros(record.days)
    fit, select, t, _, blocks = compared(model, before, after, quiet, quiet + 1.0)
    made = effect.from_table(
        {"period": swing.period, "damping": swing.damping, "amplitude": swing.amplitude}
    )  # fmt: skip
    chance = min(swing.tried * float(np.exp(-max(fit, 0.0))), 1.0)
    return Proposal(
        effect.name, "swing", made, (), (None, None), chance, after, np.empty((0, *record.time.shape)), fit,
        select, t, np.zeros(len(before.errors.squares)), blocks, level_noise=True, gains=gains,
        spreads={
            name: float(getattr(swing, name) * spread)
            for name, spread in zip(("period", "damping", "amplitude"), swing.spreads, strict=True)
        },
    )  # fmt: skip


def _with(before: Evaluation, gains: Floats) -> Evaluation:
    return replace(before, likelihood=before.likelihood + gains)
