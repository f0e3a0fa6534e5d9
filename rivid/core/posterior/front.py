"""Evidence of every place of the inflow's front, in every equation, from one shared elimination.

The front lies at ``x = d + 1 - w`` samples: a sample's inflow begins to act at lag d + 1 with the share w,
the rest comes a lag later: ``v[k] = w u[k-d-1] + (1 - w) u[k-d-2]``. The equations:

- first and second order: ``y[k] = a1 y[k-1] (+ a2 y[k-2]) + b1 v[k] + b2 v[k-1] + g1 o[k-1] + g2 o[k-2] + c``
  a front that moves the level as it arrives, and waves that run to and fro behind the dam;
- store: ``y[k] - y[k-1] = b v[k] + g o[k-1] + c``, (7) and (8): nothing but volume;
- drifting store: the same with an unlogged inflow that comes and goes.

In a short and smooth reach the wave runs up and down once more: it comes back after three times its travel
time, and the level may follow that echo more plainly than the front. So an echo is no front: :func:`echoes`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from rivid.core.posterior.noise import DRIFT_MEMORY, N_DRIFT, N_PLAIN, O_LAGS
from rivid.types import Floats

SHARES = np.arange(10, 0, -1) / 10.0
"""w of the candidates; the first is the sharp front at a sampling instant."""

ECHOES = 4
"""Lags at which a front comes back: a sample's travel times thrice, and one for what is blunted."""

LEAST_ECHOED = 2
"""The least delay whose echo is looked for; below, it overlaps the front itself."""

LEAST_FRONT = 0.6
"""What a front tells beside its echo, as a share of what the echo tells beside it, for it to be one."""

SURE_T = 9.0
"""Beyond so many standard errors a jump is positive (a chance of 1e-19 is none)."""

LEAST_T = -30.0
"""More standard errors below zero than these are counted as these."""

SMALLEST_PIVOT = 1e-9
"""A column of which less than this share is left by those before it is not used."""


class Structure(NamedTuple):
    """An equation for the level.

    Attributes
    ----------
    name : str
    order : int
        Coefficients of the level's own lags; none for a store.
    taps : int
        Coefficients of the front: v at lag 0 and, with two, at lag 1.
    parameters : int
        All coefficients and the noise variance.
    noises : slice
        The kinds of noise it goes with.
    """

    name: str
    order: int
    taps: int
    parameters: int
    noises: slice

    @property
    def is_store(self) -> bool:
        """Whether it knows volumes only."""
        return self.order == 0


def structures(with_outflow: bool) -> tuple[Structure, ...]:
    """The equations, in the order in which :func:`log_evidence` gives them."""
    plain, drift = slice(0, N_PLAIN), slice(N_PLAIN, N_PLAIN + N_DRIFT)
    o = int(with_outflow)
    return (
        Structure("first order", 1, 2, 5 + O_LAGS * o, plain),
        Structure("second order", 2, 2, 6 + O_LAGS * o, slice(0, N_PLAIN + N_DRIFT)),
        Structure("store", 0, 1, 3 + o, plain),
        Structure("drifting store", 0, 1, 3 + o, drift),
    )


def log_evidence(
    G: Floats, n_rows: int, with_outflow: bool, first: int, last: int
) -> tuple[list[Floats], list[Floats]]:
    """Log evidence of each equation, kind of noise and place of the front.

    Parameters
    ----------
    G : ndarray, shape (K, K, kinds, days)
        From :func:`rivid.core.posterior.noise.gram`, with at least ``last + 4`` lags of u.
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
    kinds = structures(with_outflow)
    _, _, plain, drift = (s.noises for s in kinds)
    o = O_LAGS if with_outflow else 0
    size = np.ascontiguousarray(np.einsum("iifb->ifb", G))

    rest, size = _eliminate(G, size)  # of the constant; left: o1, o2, y1, y2, y0, u1 ...
    drifting = _drifting(rest[:, :, drift], o)
    if with_outflow:
        drifting, _ = _eliminate(drifting, np.maximum(size[:1, drift], 1e-300))
        rest, size = _eliminate(rest, size)  # of o1; left: o2, y1, y2, y0, u1 ...
    store = _combined(
        rest[:, :, plain], {o + 1 if with_outflow else 2: 1.0, o - 1 if with_outflow else 0: -1.0}
    )
    for _ in range(o - 1):
        rest, size = _eliminate(rest, size)
    rest, size = _eliminate(rest, size)  # of y1; left: y2, y0, u1 ...
    second, _ = _eliminate(rest, size)
    u_size = size[2:]
    left = (rest[1:, 1:, plain], second, store, drifting)
    scores = [
        _scores(R, u_size[:, s.noises], n_rows, s, first, last) for R, s in zip(left, kinds, strict=True)
    ]
    fronts = [front for front, _ in scores]
    if with_outflow:  # without it too little is seen to tell an echo from a command
        is_echo = echoes(second[:, :, plain], fronts[0], fronts[1], u_size[:, plain], n_rows, first, last)
        for wave in fronts[:2]:
            np.copyto(wave, -np.inf, where=is_echo[:, None])
    return fronts, [nothing for _, nothing in scores]


def echoes(
    R: Floats, first_order: Floats, second_order: Floats, u_size: Floats, n: int, first: int, last: int
) -> NDArray[np.bool_]:
    """Which candidates are the echo of another, shape (candidates, days).

    The front of delay d comes back at lags 3 d + 1 to 3 d + 4. Beside free coefficients of these, the second
    order's front at d is likelier than any wave's front at 3 d to 3 d + 3; and what it adds to the echo is
    not much less than what the echo adds to it, so that no true front is taken for the echo of noise. `R`
    holds the second order's products with the first kinds of noise.
    """
    s = structures(True)[1]
    found = np.zeros((last - first + 1, R.shape[-1]), bool)
    waves = np.maximum(first_order.max(axis=(0, 2)), second_order.max(axis=(0, 2)))
    for d in range(max(first, LEAST_ECHOED), (len(R) - 1 - ECHOES) // 3 + 1):
        echo, front = np.arange(3 * d + 1, 3 * d + 1 + ECHOES), np.arange(d + 1, d + 4)
        which = np.concatenate([echo, [0], front])
        part = R[which[:, None], which]
        size = np.concatenate([u_size[echo - 1], np.ones_like(u_size[:1]), u_size[front - 1]])
        for _ in range(ECHOES):
            part, size = _eliminate(part, size)
        scores, without = _scores(part, size[1:], n, s, 0, 0)
        both = scores[:, 0]
        with np.errstate(invalid="ignore"):
            by_front = both - without[:, None] + 0.5 * s.taps * np.log(n)
            by_echo = both - second_order[: len(both), d - first]
            is_front = by_front >= LEAST_FRONT * by_echo
        best = np.where(is_front, both, -np.inf).max(axis=(0, 1)) - 0.5 * ECHOES * np.log(n)
        back = slice(3 * d - first, 3 * d + ECHOES - first)
        found[back] |= best > waves[back]
    return found


def _eliminate(G: Floats, size: Floats) -> tuple[Floats, Floats]:
    """Schur complement: every column less what the first explains of it; the first is dropped.

    `size` holds the sums of squares before anything was explained: a column of which only rounding is left
    explains nothing.
    """
    pivot = G[0, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(pivot > SMALLEST_PIVOT * size[0], 1.0 / pivot, 0.0)
    row = G[0, 1:]
    return G[1:, 1:] - row[:, None] * (row * inverse), size[1:]


def _combined(R: Floats, response: dict[int, float]) -> Floats:
    """Rows and columns of a response made of several columns, then of those behind the last of them."""
    front = max(response) + 1
    out = np.empty((len(R) - front + 1, len(R) - front + 1, *R.shape[2:]))
    out[1:, 1:] = R[front:, front:]
    out[0, 1:] = out[1:, 0] = sum(c * R[i, front:] for i, c in response.items())
    out[0, 0] = sum(a * b * R[i, j] for i, a in response.items() for j, b in response.items())
    return out


def _drifting(R: Floats, o: int) -> Floats:
    """The store's equation less rho times the same a sample before: outflow, response, u's lags."""
    rho, lead = DRIFT_MEMORY, o + 3
    half = _drifted(R, o, rho, lead)
    return _drifted(half.swapaxes(0, 1), o, rho, lead).swapaxes(0, 1)


def _drifted(R: Floats, o: int, rho: float, lead: int) -> Floats:
    """Rows ``o1 - rho o2``, ``y0 - (1 + rho) y1 + rho y2`` and ``u_l - rho u_(l+1)``."""
    outflow = [(R[0] - rho * R[1])[None]] if o else []
    response = R[o + 2] - (1.0 + rho) * R[o] + rho * R[o + 1]
    return np.concatenate([*outflow, response[None], R[lead:-1] - rho * R[lead + 1 :]])


def _scores(R: Floats, u_size: Floats, n: int, s: Structure, first: int, last: int) -> tuple[Floats, Floats]:
    """Profile likelihood less half ln n for each parameter, with the chance that the front is positive."""
    lag = np.arange(first + 1, last + 2)
    yy = R[0, 0]
    aa, ab, bb, a0, b0 = R[lag, lag], R[lag, lag + 1], R[lag + 1, lag + 1], R[lag, 0], R[lag + 1, 0]
    if s.taps == 2:
        ac, bc, cc, c0 = R[lag, lag + 2], R[lag + 1, lag + 2], R[lag + 2, lag + 2], R[lag + 2, 0]
    out = np.empty((len(yy), len(lag), len(SHARES), yy.shape[1]))
    penalty = 0.5 * s.parameters * np.log(n) + np.log(len(yy))
    dead = ~(aa > SMALLEST_PIVOT * u_size[first : last + 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        for i, w in enumerate(SHARES):
            v = 1.0 - w
            g00 = w * w * aa + 2.0 * w * v * ab + v * v * bb
            r0 = w * a0 + v * b0
            without = yy
            if s.taps == 2:
                g11 = w * w * bb + 2.0 * w * v * bc + v * v * cc
                g01 = w * w * ab + w * v * (ac + bb) + v * v * bc
                r1 = w * b0 + v * c0
                slope = g01 / g11
                g00 -= slope * g01
                r0 -= slope * r1
                without = yy - r1 * r1 / g11
            theta = r0 / g00
            rss = np.maximum(without - theta * r0, 1e-13 * yy)
            t = r0 * np.sqrt(n / (g00 * rss))
            score = -0.5 * n * np.log(rss) - penalty
            doubtful = t < SURE_T
            score[doubtful] += log_ndtr(np.maximum(t[doubtful], LEAST_T))
            out[:, :, i] = np.where(dead | ~np.isfinite(score), -np.inf, score).swapaxes(0, 1)
        fewer = 0.5 * (s.parameters - s.taps) * np.log(n) + np.log(len(yy))
        nothing = np.where(yy > 0.0, -0.5 * n * np.log(yy) - fewer, -np.inf)
    return out, nothing
