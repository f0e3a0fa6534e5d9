"""Evidence of every place of the inflow's front, in every structure, from one shared elimination.

The front lies at ``x = d + 1 - w`` samples: a sample's inflow begins to act at lag d + 1 with the share w,
the rest comes a lag later, ``v[k] = w u[k-d-1] + (1 - w) u[k-d-2]``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from rivid.core.posterior_noise import DRIFT_MEMORY, N_DRIFT, N_GAUGE, N_WHITE

Floats = NDArray[np.float64]

SHARES = np.arange(10, 0, -1) / 10.0
"""w of the candidates; the first is the sharp front at a sampling instant."""

MOST_T = 30.0
"""Beyond so many standard errors a jump is sure to be positive, and below minus so many sure not to be."""

SMALLEST_PIVOT = 1e-9
"""A column of which less than this share is left by those before it is not used."""


class Structure(NamedTuple):
    """An equation for the level.

    Attributes
    ----------
    name : str
    taps : int
        Coefficients of the front: v at lag 0 and, with two, at lag 1.
    parameters : int
        All coefficients and the noise variance.
    noises : slice
        Kinds of noise it goes with.
    """

    name: str
    taps: int
    parameters: int
    noises: slice


def structures(with_outflow: bool) -> tuple[Structure, ...]:
    """The equations: first and second order with free coefficients, a store, a store with drifting inflow."""
    plain, drift = slice(0, N_WHITE + N_GAUGE), slice(N_WHITE + N_GAUGE, N_WHITE + N_GAUGE + N_DRIFT)
    o = int(with_outflow)
    return (
        Structure("first order", 2, 5 + 2 * o, slice(None)),
        Structure("second order", 2, 6 + 2 * o, slice(None)),
        Structure("store", 1, 3 + o, plain),
        Structure("drifting store", 1, 3 + o, drift),
    )


def eliminate(G: Floats, scale: Floats, k: int) -> Floats:
    """Schur complement: every column less what column k explains of it; k is dropped.

    Parameters
    ----------
    G : ndarray, shape (K, K, ...)
    scale : ndarray, shape (K, ...)
        Sums of squares before anything was explained. A column with no more than :data:`SMALLEST_PIVOT` of
        it left explains nothing.
    """
    keep = np.arange(len(G)) != k
    pivot = G[k, k]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(pivot > SMALLEST_PIVOT * scale[k], 1.0 / pivot, 0.0)
    row = G[k, keep]
    return G[keep][:, keep] - row[:, None] * (row * inverse)


def log_evidence(
    G: Floats, n_rows: int, with_outflow: bool, first: int, last: int
) -> tuple[list[Floats], list[Floats]]:
    """Log evidence of each structure, kind of noise and place of the front.

    Parameters
    ----------
    G : ndarray, shape (K, K, kinds, days)
        From :func:`rivid.core.posterior_gram.gram`, with at least ``last + 4`` lags of u.
    n_rows : int
    with_outflow : bool
    first, last : int
        The candidates d, ``0 <= first <= last``.

    Returns
    -------
    fronts : list of ndarray, shape (kinds, candidates, shares, days)
        For each of :func:`structures`; minus infinity where u does not move enough.
    nothing : list of ndarray, shape (kinds, days)
        The same without any front.
    """
    scale = np.einsum("iifb->ifb", G).copy()
    o = 2 if with_outflow else 0
    kinds = structures(with_outflow)

    rest = eliminate(G, scale, 0)  # the constant; then o1, o2, y1, y2, y0, u1...
    scale = scale[1:]
    plain, drift = kinds[2].noises, kinds[3].noises
    drifting = _drifting(rest[:, :, drift], o)
    if with_outflow:
        drifting = eliminate(drifting, scale[0:1, drift], 0)  # o1
        rest = eliminate(rest, scale, 0)
        scale = scale[1:]
    # o2, y1, y2, y0, u...
    o -= with_outflow
    lead = o + 2
    store = _contract(rest[:, :, plain], [(lead, 1.0), (o, -1.0)], lead + 1)
    if with_outflow:
        rest, scale = eliminate(rest, scale, 0), scale[1:]
    rest, scale = eliminate(rest, scale, 0), scale[1:]  # y1; left: y2, y0, u...
    first_order = rest[1:, 1:]
    second_order = eliminate(rest, scale, 0)
    left = (first_order, second_order, store, drifting)
    u_scale = scale[2:]
    answers = [
        _scores(R, u_scale[:, s.noises], n_rows, s, first, last) for R, s in zip(left, kinds, strict=True)
    ]
    return [a for a, _ in answers], [b for _, b in answers]


def _contract(R: Floats, response: list[tuple[int, float]], front: int) -> Floats:
    """Rows and columns of a response made of several columns, then of u's lags from column `front` on."""
    n = len(R) - front
    out = np.empty((n + 1, n + 1, *R.shape[2:]))
    out[1:, 1:] = R[front:, front:]
    row = sum(c * R[i, front:] for i, c in response)
    out[0, 1:], out[1:, 0] = row, row
    out[0, 0] = sum(a * b * R[i, j] for i, a in response for j, b in response)
    return out


def _drifting(R: Floats, o: int) -> Floats:
    """The store's equation less rho times the same a sample before: outflow, response, u's lags."""
    rho = DRIFT_MEMORY
    K = len(R)
    lead = o + 3
    T = np.zeros((int(o > 0) + 1 + K - lead - 1, K))
    if o:
        T[0, 0], T[0, 1] = 1.0, -rho
    at = int(o > 0)
    T[at, o + 2], T[at, o], T[at, o + 1] = 1.0, -1.0 - rho, rho
    for k in range(K - lead - 1):
        T[at + 1 + k, lead + k], T[at + 1 + k, lead + k + 1] = 1.0, -rho
    half = np.einsum("ij,jkfb->ikfb", T, R)
    return np.einsum("ikfb,lk->ilfb", half, T)


def _scores(R: Floats, u_scale: Floats, n: int, s: Structure, first: int, last: int) -> tuple[Floats, Floats]:
    """Profile likelihood less half ln n for each parameter, with the chance that the front is positive."""

    def diagonal(k: int, start: int) -> Floats:
        """R[l, l + k] for the lags l = start .. of each candidate."""
        i = np.arange(start + first, start + last + 1)
        return R[i, i + k]

    yy = R[0, 0]
    aa, ab, bb = diagonal(0, 1), diagonal(1, 1), diagonal(0, 2)
    a0, b0 = R[1 + first : 2 + last, 0], R[2 + first : 3 + last, 0]
    if s.taps == 2:
        ac, bc, cc, c0 = diagonal(2, 1), diagonal(1, 2), diagonal(0, 3), R[3 + first : 4 + last, 0]
    out = np.empty((len(aa), len(SHARES), *yy.shape))
    penalty = 0.5 * s.parameters * np.log(n) + np.log(yy.shape[0])
    floor = 1e-13 * yy
    dead = ~(aa > SMALLEST_PIVOT * u_scale[first : last + 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        for i, w in enumerate(SHARES):
            v = 1.0 - w
            g00 = w * w * aa + 2.0 * w * v * ab + v * v * bb
            r0 = w * a0 + v * b0
            if s.taps == 1:
                theta, spread = r0 / g00, g00
                rss = yy - r0 * theta
            else:
                g11 = w * w * bb + 2.0 * w * v * bc + v * v * cc
                g01 = w * w * ab + w * v * (ac + bb) + v * v * bc
                r1 = w * b0 + v * c0
                spread = g00 - g01 * g01 / g11
                theta = (r0 - g01 / g11 * r1) / spread
                rss = yy - r1 * r1 / g11 - theta * theta * spread
            rss = np.maximum(rss, floor)
            t = theta * np.sqrt(spread * n / rss)
            score = -0.5 * n * np.log(rss) - penalty + log_ndtr(np.clip(t, -MOST_T, MOST_T))
            out[:, i] = np.where(dead | ~np.isfinite(score), -np.inf, score)
        without = 0.5 * (s.parameters - s.taps) * np.log(n) + np.log(yy.shape[0])
        nothing = np.where(yy > 0.0, -0.5 * n * np.log(yy) - without, -np.inf)
    return np.moveaxis(out, 2, 0), nothing
