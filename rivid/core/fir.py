"""FIR estimates without a delay: maximum likelihood (17) and maximum a posteriori (22)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core import batched as lanes
from rivid.core.settings import DEFAULT_ALPHA, MAX_CONDITION
from rivid.types import Floats, Strings


@dataclass(frozen=True)
class FirResult:
    """An FIR for each day; a leading axis of days, or none for a single day.

    Attributes
    ----------
    fir : ndarray, shape (days, M)
        h [output unit per m3/s]; NaN on a day that cannot be identified.
    noise_variance : ndarray, shape (days,)
        Mean square of ``y - U h`` [output unit^2].
    condition : ndarray, shape (days,)
        2-norm condition number of U'U.
    status : ndarray of str, shape (days,)
        "ok" or "unidentifiable".
    """

    fir: Floats
    noise_variance: Floats
    condition: Floats
    status: Strings


def second_difference(order: int) -> Floats:
    """D: the M x M lower-triangular Toeplitz matrix with first column (1, -2, 1, 0, ...), of (20)."""
    return np.eye(order) - 2.0 * np.eye(order, k=-1) + np.eye(order, k=-2)


def ml(u: ArrayLike, y: ArrayLike, order: int = 30, *, free_start: bool = False) -> FirResult:
    """Maximum-likelihood FIR, ``h = (U'U)^-1 U'y`` (17).

    Parameters
    ----------
    u : array_like, shape (N,) or (days, N)
        Inflow deviations from the day's first sample [m3/s].
    y : array_like, same shape
        Output deviations [output unit].
    order : int
        Length M of the FIR.
    free_start : bool
        See :class:`rivid.core.settings.JmapSettings`.

    Returns
    -------
    FirResult

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or fewer samples than M.

    Examples
    --------
    >>> u = np.r_[0.0, 1.0, 0.0, 2.0, -1.0, 0.5, 0.0, 1.0]
    >>> y = np.convolve(u, [0.0, -1.0, 2.0])[:8]
    >>> ml(u, y, order=3).fir.round(9) + 0.0
    array([ 0., -1.,  2.])
    """
    return _regularised(u, y, order, 0.0, free_start)


def map_fir(
    u: ArrayLike, y: ArrayLike, order: int = 30, alpha: float = DEFAULT_ALPHA, *, free_start: bool = False
) -> FirResult:
    """Maximum a posteriori FIR with a smoothness prior, ``h = (U'U + alpha D'D)^-1 U'y`` (22).

    Parameters
    ----------
    u, y, order, free_start
        As for :func:`ml`.
    alpha : float
        Regularisation weight sigma_w2 / sigma_hD2 [(m3/s)^2].

    Returns
    -------
    FirResult
    """
    return _regularised(u, y, order, alpha, free_start)


def half_time(fir: Floats) -> Floats:
    """t50: the lag by which half of a step of the inflow has arrived.

    For a response that keeps the volume of the inflow, as that of a river. A dispersive river has no single
    delay; t50 is estimated best, and it adds up along the river.

    Parameters
    ----------
    fir : ndarray, shape (days, M)
        Impulse responses.

    Returns
    -------
    ndarray, shape (days,)
        t50 [samples], interpolated; a unit response at lag k gives k. NaN where the response does not sum to
        something positive.

    Examples
    --------
    >>> half_time(np.array([[0.0, 0.0, 1.0, 0.0], [0.0, 0.5, 0.5, 0.0]]))
    array([2. , 1.5])
    """
    steps = np.cumsum(fir, axis=1)
    t50 = np.full(len(fir), np.nan)
    for i, step in enumerate(steps):
        if step[-1] > 0:
            half = 0.5 * step[-1]
            k = int(np.argmax(step >= half))
            before = step[k - 1] if k else 0.0
            # a coefficient at lag k acts over the sample around k
            t50[i] = k - 0.5 + (half - before) / (step[k] - before)
    return t50


def motionless(yy: Floats, G: Floats) -> NDArray[np.bool_]:
    """Lanes in which the input or the output never leaves its first value."""
    return np.asarray((yy <= 0.0) | (G[0, 0] <= 0.0))


def _regularised(u: ArrayLike, y: ArrayLike, order: int, alpha: float, free_start: bool) -> FirResult:
    (inputs, outputs), single = lanes.as_days({"u": u, "y": y}, order + 1, f"an FIR of order {order}")
    n = len(inputs)
    D = second_difference(order)
    P = (alpha * (D.T @ D))[:, :, None]
    fir = np.empty((n, order))
    noise, condition = np.empty(n), np.empty(n)
    for days, take in lanes.blocks(n):
        G, b, yy, n_rows = lanes.gram(inputs[take].T.copy(), outputs[take].T.copy(), order, free_start)
        R, z, _ = lanes.cholesky(G + P, b)
        h = lanes.back_substitute(R, z)
        # y'y - 2 b'h + h'G h, with G h = b - alpha D'D h
        rss = yy - np.einsum("ib,ib->b", b, h) - np.einsum("ib,ijb,jb->b", h, P, h)
        here = slice(0, days.stop - days.start)
        condition[days] = lanes.condition_numbers(G[..., here])
        fir[days] = np.where(motionless(yy, G), np.nan, h)[:, here].T
        noise[days] = np.maximum(rss, 0.0)[here] / n_rows
    bad = ~np.isfinite(fir).all(axis=1) | ~(condition <= MAX_CONDITION)
    fir[bad], noise[bad] = np.nan, np.nan
    status = np.where(bad, "unidentifiable", "ok")
    if single:
        return FirResult(fir[0], noise[0], condition[0], status[0])
    return FirResult(fir, noise, condition, status)
