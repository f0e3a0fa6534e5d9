"""Kinds of noise of a river's discharge, and the sums of products that whitening leaves.

What no log holds (springs, side streams, a drifting rating) wanders; the gauge adds noise of its own. The
noise is ``C(q) / A(q) e``: A makes what wanders white, C is the minimum-phase factor of ``ratio + |A|^2``,
with the ratio of the wandering's variance to the gauge's; without a gauge C is 1. Everything is filtered by
A / C.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rivid.core.posterior_noise import spectral_factor

Floats = NDArray[np.float64]

MEMORY = (0.9, 0.97, 1.0)
"""rho of what wanders, ``A = 1 - rho q^-1``."""
SMOOTH_MEMORY = (0.5, 0.9)
"""r of what wanders smoothly, ``A = (1 - q^-1)(1 - r q^-1)``."""
RATIOS = (0.1, 1.0, 10.0)
"""Variance of what wanders over that of the gauge."""

SINE = 3
"""Columns of a level and a daily sine."""


@lru_cache(maxsize=1)
def river_noises() -> tuple[tuple[Floats, Floats], ...]:
    """(A, C) of every kind of noise."""
    wander = [np.array([1.0, -rho]) for rho in MEMORY]
    wander += [np.convolve([1.0, -1.0], [1.0, -r]) for r in SMOOTH_MEMORY]
    return tuple((a, c) for a in wander for c in (np.ones(1), *(spectral_factor(a, r) for r in RATIOS)))


class Sums(NamedTuple):
    """Sums of products over the rows of one window; C hastened inflows, B kinds of noise.

    Attributes
    ----------
    uu : ndarray, shape (C, B, n_lags + 1, n_lags + 1)
        Lags of the inflow among themselves.
    uy : ndarray, shape (C, B, n_lags + 1)
        With the output.
    uz : ndarray, shape (C, B, n_lags + 1, 3)
        With an orthonormal basis of the level and the daily sine.
    yy : ndarray, shape (B,)
    yz : ndarray, shape (B, 3)
    """

    uu: Floats
    uy: Floats
    uz: Floats
    yy: Floats
    yz: Floats


def whitened_sums(u: Floats, y: Floats, warm: int, n_lags: int, day: float) -> Sums:
    """The sums of :class:`Sums`.

    Parameters
    ----------
    u : ndarray, shape (C, N)
        Inflow, each hastened otherwise.
    y : ndarray, shape (N,)
    warm : int
        The first row that counts, at least `n_lags`.
    n_lags : int
    day : float
        Period of the sine [samples].

    Notes
    -----
    Correlations with the lags go by Fourier transform. Lags among themselves follow from the first row:
    ``uu[i+1, j+1]`` is ``uu[i, j]`` with what enters at one end, less what leaves at the other.
    """
    from scipy.signal import lfilter  # slow to import

    N = u.shape[-1]
    angle = 2.0 * np.pi * np.arange(N) / day
    series = np.concatenate([u - u[:, :1], (y - y[0])[None], np.cos(angle)[None], np.sin(angle)[None]])
    white = np.stack([lfilter(a, c, series) for a, c in river_noises()], axis=1)  # (C + 3, B, N)
    inflow, output = white[:-3], white[-3].copy()
    Z = np.ones((output.shape[0], N - warm, SINE))
    Z[..., 1:] = np.moveaxis(white[-2:, :, warm:], 0, -1)
    Z = np.linalg.qr(Z)[0]
    output[:, :warm] = 0.0
    aims = np.zeros((len(output), SINE + 1, N))
    aims[:, 0] = output
    aims[:, 1:, warm:] = Z.swapaxes(1, 2)

    size = 1 << (N - 1).bit_length()
    U = np.conj(np.fft.rfft(inflow, size))
    own = inflow.copy()
    own[..., :warm] = 0.0
    first = np.fft.irfft(np.fft.rfft(own, size) * U, size)[..., : n_lags + 1]
    crossed = np.fft.irfft(np.fft.rfft(aims, size) * U[:, :, None], size)[..., : n_lags + 1]

    uu = np.empty((*inflow.shape[:2], n_lags + 1, n_lags + 1))
    uu[:, :, 0] = first
    enter = inflow[..., warm - 1 :: -1]
    leave = inflow[..., N - 1 : N - n_lags - 2 : -1]
    for i in range(n_lags):
        row = uu[:, :, i, i:-1] + enter[..., i : i + 1] * enter[..., i:n_lags]
        row -= leave[..., i : i + 1] * leave[..., i:n_lags]
        uu[:, :, i + 1, i + 1 :] = row
        uu[:, :, i:, i] = uu[:, :, i, i:]
    tail = output[:, warm:]
    return Sums(
        uu,
        crossed[:, :, 0],
        crossed[:, :, 1:].swapaxes(-1, -2),
        np.einsum("bn,bn->b", tail, tail),
        np.matmul(tail[:, None], Z)[:, 0],
    )
