"""Kinds of noise for the posterior of the delay: moving averages C that whiten by the filter 1 / C.

The level carries the gauge's noise and, as a sum over time, every inflow that is not logged. An equation in
differences of the level then has noise ``C(q) e``: ``C`` is the minimum-phase factor of
``ratio + |a(q)|^2``, where ``a`` turns the level into the equation's noise and ``ratio`` is the variance of
what is added to the flow over that of the gauge.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rivid.types import Floats

CHUNK = 25
"""Samples that one product filters at once."""

GAUGE_RATIOS = (2.0, 0.5, 0.15, 0.045, 0.015)
"""Variance of the equation's own noise over that of the gauge, ``a = 1 - q^-1``."""

DRIFT_RATIOS = (0.01, 0.0015, 0.0003, 0.00005)
"""The same where the unlogged inflow drifts, ``a = (1 - q^-1)(1 - rho q^-1)``."""

DRIFT_MEMORY = 0.98
"""rho: correlation of an unlogged inflow from one sample to the next."""


def spectral_factor(a: Floats, ratio: float) -> Floats:
    """Minimum-phase C with ``|C(z)|^2`` proportional to ``ratio + |a(z)|^2`` on the unit circle.

    Coefficients of powers of q^-1, rising; shape (k,) as `a`, the first of them one. `ratio` is above zero.

    Examples
    --------
    >>> C = spectral_factor(np.array([1.0, -1.0]), 0.5)
    >>> float(((1 + C[1] ** 2) / C[1]).round(9))
    -2.5
    """
    both = np.convolve(a, a[::-1])
    both[len(a) - 1] += ratio
    roots = np.roots(both)
    inside = roots[np.abs(roots) < 1.0]
    return np.asarray(np.real(np.poly(inside)), float)


@lru_cache(maxsize=1)
def noise_bank() -> Floats:
    """The noise polynomials, shape (kinds, 3): white, gauge noise, gauge noise and drifting inflow."""
    gauge, drift = np.array([1.0, -1.0]), np.convolve([1.0, -1.0], [1.0, -DRIFT_MEMORY])
    rows = [np.array([1.0, 0.0, 0.0])]
    rows += [np.append(spectral_factor(gauge, ratio), 0.0) for ratio in GAUGE_RATIOS]
    rows += [spectral_factor(drift, ratio) for ratio in DRIFT_RATIOS]
    return np.array(rows)


N_PLAIN, N_DRIFT = 1 + len(GAUGE_RATIOS), len(DRIFT_RATIOS)
"""How many of the bank are for white noise and the gauge's, and for a drifting inflow in addition."""


def prewhiten(series: Floats, polynomials: Floats) -> Floats:
    """Every series (days, S, N) through every 1 / C, at rest before it: (days, kinds, S, N).

    The `polynomials` have shape (kinds, 3), each begins with one. Samples are filtered in chunks as if each
    began at rest, by one product of a fixed size for each day, so that a day's bits do not depend on its
    neighbours; then the last two samples of a chunk are carried on.
    """
    days, S, N = series.shape
    n_chunks = -(-N // CHUNK)
    padded = np.zeros((days, S, n_chunks * CHUNK))
    padded[..., :N] = series
    chunks = padded.reshape(days, 1, S * n_chunks, CHUNK)
    impulse = np.zeros((len(polynomials), CHUNK + 1))
    impulse[:, 0] = 1.0
    for k in range(1, CHUNK + 1):
        impulse[:, k] = -polynomials[:, 1] * impulse[:, k - 1]
        if k > 1:
            impulse[:, k] -= polynomials[:, 2] * impulse[:, k - 2]
    lag = np.arange(CHUNK)[None, :] - np.arange(CHUNK)[:, None]
    at_rest = np.where(lag >= 0, impulse[:, np.maximum(lag, 0)], 0.0)  # (kinds, from, to)
    filtered = np.matmul(chunks, at_rest).reshape(days, len(polynomials), S, n_chunks, CHUNK)
    last = impulse[:, 1:]  # what f[-1] = 1 leaves behind
    before = -polynomials[:, 2:] * impulse[:, :CHUNK]  # and f[-2] = 1
    for j in range(1, n_chunks):
        ends = filtered[..., j - 1, -2:]
        filtered[..., j, :] += ends[..., 1:] * last[:, None] + ends[..., :1] * before[:, None]
    whole: Floats = filtered.reshape(days, len(polynomials), S, -1)
    return whole[..., :N]


Y_LAGS = 2
O_LAGS = 2


def gram(
    u: Floats, y: Floats, o: Floats | None, polynomials: Floats, n_lags: int, more: int = 0
) -> tuple[Floats, int]:
    """Gram matrices (K, K, kinds, days) of the regressors, prewhitened, and the number of rows.

    u, y and o (None where not logged) are deviations from the day's first sample, shape (days, N). Columns
    are a constant, o's lags, the level's, its value now, and u's lags 1 to `n_lags`; `more` lags of o stand
    before them, the longest first, and `more` of u behind. The rows are those for which every lag lies in the
    day. Products run over the leading columns and u's first lag only. Lags of u among themselves follow from
    it: ``G[i+1, j+1]`` is ``G[i, j]`` with what enters at one end, less what leaves at the other.
    """
    days, N = u.shape
    series = np.stack([y, u] if o is None else [y, u, o], axis=1)
    white = prewhiten(series, polynomials)
    one = prewhiten(np.ones((1, 1, N)), polynomials)[0, :, 0]
    n_lags += more
    n = N - n_lags
    lead = more + 1 + (O_LAGS if o is not None else 0) + Y_LAGS + 1
    rows = np.empty((days, len(polynomials), lead + 1, lead + n_lags))
    inflow = white[:, :, 1]
    windows = sliding_window_view(white[..., : N - 1], n, axis=-1)[..., ::-1, :]  # row r holds lag r + 1
    parts = [(0, Y_LAGS, lead - 1 - Y_LAGS)]  # series, its lags, where they begin
    if o is not None:
        parts.append((2, O_LAGS, more + 1))
    X = np.empty((lead + n_lags, n))  # of one day and kind at a time: it stays near the processor
    for day in range(days):
        for kind in range(len(polynomials)):
            X[more] = one[kind, n_lags:]
            X[lead - 1] = white[day, kind, 0, n_lags:]
            for i, lags, begin in parts:
                X[begin : begin + lags] = windows[day, kind, i, :lags]
            if more:
                X[:more] = windows[day, kind, 2, O_LAGS + more - 1 : O_LAGS - 1 : -1]
            X[lead:] = windows[day, kind, 1]
            np.matmul(X[: lead + 1], X.T, out=rows[day, kind])
    G = np.empty((lead + n_lags, lead + n_lags, len(polynomials), days))
    G[: lead + 1] = np.moveaxis(rows, (0, 1), (3, 2))
    G[lead + 1 :, : lead + 1] = G[: lead + 1, lead + 1 :].swapaxes(0, 1)
    enter = np.moveaxis(inflow[..., n_lags - 1 :: -1], (0, 1), (2, 1))  # what lag i + 1 reaches back to
    leave = np.moveaxis(inflow[..., N - 2 : N - n_lags - 2 : -1], (0, 1), (2, 1))
    enter, leave = np.ascontiguousarray(enter), np.ascontiguousarray(leave)
    for i in range(n_lags - 1):
        row = G[lead + i, lead + i : -1] + enter[i + 1] * enter[i + 1 :] - leave[i] * leave[i:-1]
        G[lead + i + 1, lead + i + 1 :] = row
        G[lead + i + 1 :, lead + i + 1] = row
    return G, n


Noises = tuple[tuple[Floats, Floats], ...]
"""(A, C) of each kind: noise ``C(q) / A(q) e``, whitened by A / C."""


class Sums(NamedTuple):
    """Sums of products over the rows of one window; C inflows, B kinds of noise, Z extra columns."""

    uu: Floats  # lags of the inflow, (C, B, n_lags + 1, n_lags + 1)
    uy: Floats  # with the output, (C, B, n_lags + 1)
    uz: Floats  # with an orthonormal basis of the extra columns, (C, B, n_lags + 1, Z)
    yy: Floats  # (B,)
    yz: Floats  # (B, Z)


def whitened_sums(
    u: Floats, y: Floats, extra: Floats, warm: int, n_lags: int, noises: Noises, stride: int = 1
) -> Sums:
    """The sums of :class:`Sums` for versions u (C, N) of the inflow, y (N,) and `extra` (Z - 1, N).

    The extra columns are filtered as u and y are; a constant goes before them, and is not. `warm` is the
    first row that counts, at least `n_lags`. Series are filtered from rest as deviations from their first
    sample. Correlations with the lags go by Fourier transform. Lags among themselves follow from the first
    row: ``uu[i+1, j+1]`` is ``uu[i, j]`` with what enters at one end, less what leaves at the other.

    With a `stride` q above 1, the lags are 0, q, ..., q `n_lags`, and the inflow is averaged with a triangle
    of q samples to each side: the response is linear between these lags.
    """
    from scipy.signal import lfilter  # slow to import

    N, C = u.shape[-1], len(u)
    if stride > 1:
        hat = np.convolve(np.ones(stride), np.ones(stride)) / stride**2
        padded = np.pad(u, ((0, 0), (stride - 1, stride - 1)), mode="edge")
        u = np.stack([np.convolve(row, hat, "valid") for row in padded])
    series = np.concatenate([u - u[:, :1], (y - y[0])[None], extra])
    white = np.stack([lfilter(a, c, series) for a, c in noises], axis=1)  # (series, B, N)
    inflow, output = white[:C], white[C]
    Z = np.ones((len(noises), N - warm, 1 + len(extra)))
    Z[..., 1:] = np.moveaxis(white[C + 1 :, :, warm:], 0, -1)
    Z = np.linalg.qr(Z)[0]
    aims = np.zeros((len(noises), 1 + Z.shape[-1], N))
    aims[:, 0, warm:] = output[:, warm:]
    aims[:, 1:, warm:] = Z.swapaxes(1, 2)
    tail = output[:, warm:]
    own_sums = np.einsum("bn,bn->b", tail, tail), np.matmul(tail[:, None], Z)[:, 0]
    if stride > 1:  # few lags: their products are formed one by one
        uu = np.empty((C, len(noises), n_lags + 1, n_lags + 1))
        crossed = np.empty((C, *aims.shape[:2], n_lags + 1))
        lags = range(0, stride * (n_lags + 1), stride)
        for kind, aim in enumerate(aims[..., warm:]):
            lagged = np.stack([inflow[:, kind, warm - k : N - k] for k in lags], axis=1)
            uu[:, kind] = np.matmul(lagged, lagged.swapaxes(1, 2))
            crossed[:, kind] = np.matmul(aim, lagged.swapaxes(1, 2))
        return Sums(uu, crossed[:, :, 0], crossed[:, :, 1:].swapaxes(-1, -2), *own_sums)

    size = 1 << (N - 1).bit_length()
    U = np.conj(np.fft.rfft(inflow, size))
    own = inflow.copy()
    own[..., :warm] = 0.0
    first = np.fft.irfft(np.fft.rfft(own, size) * U, size)[..., : n_lags + 1]
    crossed = np.fft.irfft(np.fft.rfft(aims, size) * U[:, :, None], size)[..., : n_lags + 1]

    uu = np.empty((C, len(noises), n_lags + 1, n_lags + 1))
    uu[:, :, 0], uu[:, :, :, 0] = first, first
    enter = inflow[..., warm - 1 :: -1]
    leave = inflow[..., N - 1 : N - n_lags - 2 : -1]
    for i in range(n_lags):
        row = uu[:, :, i, i:-1] + enter[..., i : i + 1] * enter[..., i:n_lags]
        row -= leave[..., i : i + 1] * leave[..., i:n_lags]
        uu[:, :, i + 1, i + 1 :] = row
        uu[:, :, i + 1 :, i + 1] = row
    return Sums(uu, crossed[:, :, 0], crossed[:, :, 1:].swapaxes(-1, -2), *own_sums)


MEMORY = (0.9, 0.97, 1.0)
"""rho of what wanders, ``A = 1 - rho q^-1``."""
SMOOTH_MEMORY = (0.5, 0.9)
"""r of what wanders smoothly, ``A = (1 - q^-1)(1 - r q^-1)``."""
RATIOS = (0.1, 1.0)
"""Variance of what wanders over that of the gauge."""

SINE = 3
"""Columns of a level and a daily sine."""


@lru_cache(maxsize=1)
def river_noises() -> Noises:
    """(A, C) of every kind of noise."""
    wander = [np.array([1.0, -rho]) for rho in MEMORY]
    wander += [np.convolve([1.0, -1.0], [1.0, -r]) for r in SMOOTH_MEMORY]
    return tuple((a, c) for a in wander for c in (np.ones(1), *(spectral_factor(a, r) for r in RATIOS)))


def daily_sine(n: int, day: float) -> Floats:
    """Cosine and sine of one day's period, shape (2, n)."""
    angle = 2.0 * np.pi * np.arange(n) / day
    return np.stack([np.cos(angle), np.sin(angle)])
