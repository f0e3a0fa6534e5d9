"""Sums of products of lags that whitening leaves, for a few kinds of noise at once."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Noises = tuple[tuple[Floats, Floats], ...]
"""(A, C) of each kind: noise ``C(q) / A(q) e``, whitened by A / C."""


class Sums(NamedTuple):
    """Sums of products over the rows of one window; C inflows, B kinds of noise, Z columns beside them.

    Attributes
    ----------
    uu : ndarray, shape (C, B, n_lags + 1, n_lags + 1)
        Lags of the inflow among themselves.
    uy : ndarray, shape (C, B, n_lags + 1)
        With the output.
    uz : ndarray, shape (C, B, n_lags + 1, Z)
        With an orthonormal basis of the columns beside.
    yy : ndarray, shape (B,)
    yz : ndarray, shape (B, Z)
    """

    uu: Floats
    uy: Floats
    uz: Floats
    yy: Floats
    yz: Floats


def whitened_sums(u: Floats, y: Floats, beside: Floats, warm: int, n_lags: int, noises: Noises) -> Sums:
    """The sums of :class:`Sums`.

    Parameters
    ----------
    u : ndarray, shape (C, N)
        Versions of the inflow.
    y : ndarray, shape (N,)
    beside : ndarray, shape (Z - 1, N)
        Columns that are filtered as u and y are; a constant goes before them, and is not.
    warm : int
        The first row that counts, at least `n_lags`.
    n_lags : int
    noises : tuple of (A, C)

    Returns
    -------
    Sums

    Notes
    -----
    Series are filtered from rest as deviations from their first sample. Correlations with the lags go by
    Fourier transform. Lags among themselves follow from the first row: ``uu[i+1, j+1]`` is ``uu[i, j]`` with
    what enters at one end, less what leaves at the other.
    """
    from scipy.signal import lfilter  # slow to import

    N, C = u.shape[-1], len(u)
    series = np.concatenate([u - u[:, :1], (y - y[0])[None], beside])
    white = np.stack([lfilter(a, c, series) for a, c in noises], axis=1)  # (series, B, N)
    inflow, output = white[:C], white[C]
    Z = np.ones((len(noises), N - warm, 1 + len(beside)))
    Z[..., 1:] = np.moveaxis(white[C + 1 :, :, warm:], 0, -1)
    Z = np.linalg.qr(Z)[0]
    aims = np.zeros((len(noises), 1 + Z.shape[-1], N))
    aims[:, 0, warm:] = output[:, warm:]
    aims[:, 1:, warm:] = Z.swapaxes(1, 2)

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
    tail = output[:, warm:]
    return Sums(
        uu,
        crossed[:, :, 0],
        crossed[:, :, 1:].swapaxes(-1, -2),
        np.einsum("bn,bn->b", tail, tail),
        np.matmul(tail[:, None], Z)[:, 0],
    )
