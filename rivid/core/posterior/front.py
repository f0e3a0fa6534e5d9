"""Evidence of every place of the inflow's front, in every equation, from one shared elimination.

The front lies at ``x = d + 1 - w`` samples: a sample's inflow begins to act at lag d + 1 with the share w,
the rest comes a lag later: ``v[k] = w u[k-d-1] + (1 - w) u[k-d-2]``. The equations:

- first and second order: ``y[k] = a1 y[k-1] (+ a2 y[k-2]) + b1 v[k] + b2 v[k-1] + g1 o[k-1] + g2 o[k-2] + c``
  a front that moves the level as it arrives, and waves that are reflected behind the dam;
- store: ``y[k] - y[k-1] = b v[k] + g o[k-1] + c``, (7) and (8): a balance of volumes;
- drifting store: the same with an unlogged inflow that varies slowly.

A stilling well, and a gate that needs longer than a sample, delay what the gauge shows of the inflow and of
the outflow alike. Each equation also has inflow and outflow behind a lag of first order (:data:`LAGS`): the
outflow acts at the gauge, so its response in the level shows the lag, and the front is where the water is.

In a short and smooth reach the wave is reflected twice: it comes back after three travel times, and the
level may follow that echo more clearly than the front. :func:`echoes` excludes echoes.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from rivid.core.posterior.noise import DRIFT_MEMORY, N_DRIFT, N_PLAIN, O_LAGS, Y_LAGS
from rivid.types import Bools, Floats, Ints

SHARES = np.arange(10, 0, -1) / 10.0
"""w of the candidates; the first is the sharp front at a sampling instant."""

ECHOES = 4
"""Lags at which a front comes back: three travel times of a sample, and one for dispersion."""

LEAST_ECHOED = 2
"""Smallest delay with a test for an echo; below, the echo overlaps the front itself."""

LEAST_FRONT = 0.6
"""Smallest log likelihood that a front adds to its echo, as a share of what the echo adds to the front."""

LAGS = (0.3, 0.8, 2.0)
"""Time constants of the lag of the gauge [samples]; well below the first, the place moves by less than its
error."""

LAG_TAPS = 4
"""Lags of its response; what comes later is put on the last."""

LAGGED = 0.5
"""Prior share of days with a lag: of the highest log score of the true travel time, together with the values
of :class:`rivid.core.settings.PosteriorSettings`."""

LEAST_LAGGED = 2
"""Smallest delay of a wave behind a lag: below, it is reflected within the time of the lag, and the lag and
the front cannot be separated."""

SURE_T = 9.0
"""Beyond so many standard errors a jump is positive (a chance of 1e-19 is none)."""

LEAST_T = -30.0
"""More standard errors below zero than these are counted as these."""

SMALLEST_PIVOT = 1e-9
"""A column of which less than this share is left by those before it is not used."""


class Structure(NamedTuple):
    """An equation for the level."""

    name: str
    order: int  # coefficients of the level's own lags; none for a store
    taps: int  # coefficients of the front: v at lag 0 and, with two, at lag 1
    parameters: int  # all coefficients and the noise variance
    noises: slice  # the kinds of noise it goes with

    @property
    def is_store(self) -> bool:
        """Whether it is a balance of volumes."""
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


def lag_taps(lag: float) -> Floats:
    """What a gauge with a lag [samples] shows of a unit at lags 0 to ``LAG_TAPS - 1``; the sum is one.

    Between samples the level is a straight line, as in :func:`rivid.reach.gauge.stilled`.

    Examples
    --------
    >>> lag_taps(0.5).round(2).tolist()
    [0.57, 0.37, 0.05, 0.01]
    """
    left = np.exp(-1.0 / lag)
    now = 1.0 - (1.0 - left) * lag
    later = (1.0 - left - now * (1.0 - left)) * left ** np.arange(LAG_TAPS - 1)
    taps = np.append(now, later)
    taps[-1] += 1.0 - taps.sum()
    return np.asarray(taps, float)


@lru_cache(maxsize=32)
def _lagging(lag: float, n_columns: int) -> Floats:
    """Matrix (K, n_columns) from the columns of :func:`rivid.core.posterior.noise.gram` with `more` lags to
    those of inflow and outflow behind a lag."""
    more = LAG_TAPS - 1
    out = np.zeros((n_columns - 2 * more, n_columns))
    lead = 1 + O_LAGS + Y_LAGS + 1
    where = [*range(more - 1, -1, -1)]  # of the outflow's lags O_LAGS + 1 and above
    outflow = [*range(more + 1, more + 1 + O_LAGS), *where]
    for k, c in enumerate(lag_taps(lag)):
        for i in range(O_LAGS):
            out[1 + i, outflow[i + k]] += c
        for i in range(lead, len(out)):
            out[i, more + i + k] += c
    for i in (0, *range(1 + O_LAGS, lead)):
        out[i, more + i] = 1.0
    return out


def log_evidence(
    G: Floats, n_rows: int, with_outflow: bool, first: int, last: int, more: int = 0
) -> tuple[list[Floats], list[Floats]]:
    """Log evidence of each equation, kind of noise and place of the front.

    `G` (K, K, kinds, days) is that of :func:`rivid.core.posterior.noise.gram`, with at least ``last + 4``
    lags of u; the candidates are ``0 <= first <= last``. Returns for each of :func:`structures` an array
    (kinds, candidates, shares, days), minus infinity where u does not move enough, and one without any front
    (kinds, days). With `more` lags in G, the kinds of noise are followed by :data:`LAGS`, each with the kind
    of noise that is likeliest without a lag: it is the gauge's own, behind the lag, and changes little.
    """
    kinds = structures(with_outflow)
    inner = G[more : len(G) - more, more : len(G) - more]
    noises = tuple(s.noises for s in kinds)
    left, u_size = _left(inner, noises, O_LAGS if with_outflow else 0)
    scores = [_scores(R, U, n_rows, s, first, last) for R, U, s in zip(left, u_size, kinds, strict=True)]
    fronts, nothing = [front for front, _ in scores], [none for _, none in scores]
    is_echo = np.zeros((last - first + 1, G.shape[-1]), bool)
    if with_outflow:  # without it an echo cannot be distinguished from a command
        second = left[1][:, :, :N_PLAIN]
        is_echo = echoes(second, fronts[0], fronts[1], u_size[0], n_rows, first, last)
        for wave in fronts[:2]:
            np.copyto(wave, -np.inf, where=is_echo[:, None])
    if more:
        best, worth = zip(*(_likeliest_noise(f) for f in fronts), strict=True)
        own = np.stack([of_kind(G[:, :, s.noises], k) for s, k in zip(kinds[1:], best[1:], strict=True)])
        maps = np.array([_lagging(lag, len(G)) for lag in LAGS])
        half = np.matmul(np.concatenate(maps), own).reshape(*own.shape[:2], *maps.shape)
        lagged = np.moveaxis(np.matmul(half, maps.swapaxes(1, 2)), (3, 4, 0, 2, 1), (0, 1, 2, 3, 4))
        lagged = lagged.reshape(*lagged.shape[:2], -1, lagged.shape[-1])  # K, K, equations' lags, days
        which = tuple(slice(max(j - 1, 0) * len(LAGS), j * len(LAGS)) for j in range(len(kinds)))
        left, u_size = _left(lagged, which, O_LAGS)
        for j, s in enumerate(kinds[1:], 1):  # the first order with the lag's pole is of second order
            front, none = _scores(left[j], u_size[j], n_rows, s, first, last)
            if not s.is_store:
                front[:, : max(LEAST_LAGGED - first, 0)] = -np.inf
                np.copyto(front, -np.inf, where=is_echo[:, None])
            with_lag, without = worth[j] + np.log(LAGGED), np.log(1.0 - LAGGED)
            fronts[j] = np.concatenate([fronts[j] + without, front + with_lag])
            nothing[j] = np.concatenate([nothing[j] + without, none + with_lag])
    return fronts, nothing


def of_kind(G: Floats, kind: Ints) -> Floats:
    """The matrices of one kind of noise for each day, shape (days, K, K)."""
    return np.ascontiguousarray(np.moveaxis(G, (2, 3), (1, 0))[np.arange(G.shape[-1]), kind])


def _likeliest_noise(fronts: Floats) -> tuple[Ints, Floats]:
    """Kind of noise with the likeliest front of each day, and the log evidence of all kinds over its own, as
    a share of the number of kinds."""
    top = fronts.max(axis=(1, 2))
    best = np.argmax(top, axis=0)
    with np.errstate(invalid="ignore"):
        worth = np.log(np.exp(top - top.max(axis=0)).sum(axis=0) / len(top))
    return best, np.where(np.isfinite(worth), worth, -np.log(len(top)))


def _left(G: Floats, noises: tuple[slice, ...], o: int) -> tuple[tuple[Floats, ...], tuple[Floats, ...]]:
    """What is left of the response and u's lags in each of :func:`structures`, with its kinds of noise; the
    sums of squares of u's lags."""
    _, _, plain, drift = noises
    size = np.ascontiguousarray(np.einsum("iifb->ifb", G))
    rest, size = _eliminate(G, size)  # of the constant; left: o1, o2, y1, y2, y0, u1 ...
    drifting = _drifting(rest[:, :, drift], o)
    if o:
        drifting, _ = _eliminate(drifting, np.maximum(size[:1, drift], 1e-300))
        rest, size = _eliminate(rest, size)  # of o1; left: o2, y1, y2, y0, u1 ...
    store = _combined(rest[:, :, plain], {o + 1 if o else 2: 1.0, o - 1 if o else 0: -1.0})
    for _ in range(o - 1):
        rest, size = _eliminate(rest, size)
    rest, size = _eliminate(rest, size)  # of y1; left: y2, y0, u1 ...
    second, _ = _eliminate(rest, size)
    left = (rest[1:, 1:, noises[0]], second[:, :, noises[1]], store, drifting)
    return left, tuple(size[2:][:, kind] for kind in noises)


def echoes(
    R: Floats, first_order: Floats, second_order: Floats, u_size: Floats, n: int, first: int, last: int
) -> NDArray[np.bool_]:
    """Which candidates are the echo of another, shape (candidates, days).

    The front of delay d comes back at lags 3 d + 1 to 3 d + 4. With free coefficients of these, the second
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
    for _ in range(2):  # rows, then columns: o1 - rho o2, y0 - (1 + rho) y1 + rho y2, u_l - rho u_(l+1)
        outflow = [(R[0] - rho * R[1])[None]] if o else []
        response = R[o + 2] - (1.0 + rho) * R[o] + rho * R[o + 1]
        R = np.concatenate([*outflow, response[None], R[lead:-1] - rho * R[lead + 1 :]]).swapaxes(0, 1)
    return R


def _scores(R: Floats, u_size: Floats, n: int, s: Structure, first: int, last: int) -> tuple[Floats, Floats]:
    """Profile likelihood less half ln n for each parameter, with the chance that the front is positive."""
    lag = np.arange(first + 1, last + 2)
    yy = R[0, 0]
    w = SHARES[:, None, None]
    v = 1.0 - w
    aa, ab, bb, a0, b0 = (
        part[:, None]
        for part in (R[lag, lag], R[lag, lag + 1], R[lag + 1, lag + 1], R[lag, 0], R[lag + 1, 0])
    )
    dead = ~(aa > SMALLEST_PIVOT * u_size[first : last + 1, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        g00 = w * w * aa + 2.0 * w * v * ab + v * v * bb  # (candidates, shares, kinds, days)
        r0 = w * a0 + v * b0
        without = yy
        if s.taps == 2:
            ac, bc, cc, c0 = (
                part[:, None]
                for part in (R[lag, lag + 2], R[lag + 1, lag + 2], R[lag + 2, lag + 2], R[lag + 2, 0])
            )
            g11 = w * w * bb + 2.0 * w * v * bc + v * v * cc
            r1 = w * b0 + v * c0
            slope = (w * w * ab + w * v * (ac + bb) + v * v * bc) / g11
            g00 -= slope * (slope * g11)
            r0 -= slope * r1
            without = yy - r1 * r1 / g11
        rss = np.maximum(without - r0 * r0 / g00, 1e-13 * yy)
        score = -0.5 * n * np.log(rss) - (0.5 * s.parameters * np.log(n) + np.log(len(yy)))
        t = r0 * np.sqrt(n / (g00 * rss))
        doubtful = t < SURE_T
        score[doubtful] += log_ndtr(np.maximum(t[doubtful], LEAST_T))
        score[np.broadcast_to(dead, score.shape) | ~np.isfinite(score)] = -np.inf
        fewer = 0.5 * (s.parameters - s.taps) * np.log(n) + np.log(len(yy))
        nothing = np.where(yy > 0.0, -0.5 * n * np.log(yy) - fewer, -np.inf)
    return np.ascontiguousarray(np.moveaxis(score, 2, 0)), nothing


MODELS = 4
"""Models (equation, noise, place of the front) that are averaged for a day."""

RIDGE = 1e-11
"""Added to the diagonal of the scaled normal equations: equal columns share their coefficient."""
RESTS = 1e-24
"""Square of a column over that of the largest below which it is rounding: 1 mm beside 1e6 m3/s is 1e-18."""


Fronts = tuple[Floats, int, list[Floats], bool]
"""Of a block of days: G (K, K, kinds, days) and its rows from :func:`rivid.core.posterior.noise.gram`, the
evidence from :func:`log_evidence`, and whether the outflow is logged."""


def averaged_fir(
    fronts: Fronts, belongs: Bools, first: int, temperature: float, order: int
) -> tuple[Floats, Floats]:
    """Mean and standard deviation of h over the likeliest models, shape (days, M), from lag 0.

    `belongs` marks the places of the front (candidates, shares, days) that mean the day's delay;
    `temperature` divides the log evidence. The spread holds that of the coefficients and that between the
    models.
    """
    G, n_rows, evidence, with_outflow = fronts
    days = G.shape[-1]
    parts = [np.where(belongs, f, -np.inf) for f in evidence]
    flat = np.concatenate([part.reshape(-1, days) for part in parts])
    chosen = np.argpartition(-flat, MODELS, axis=0)[:MODELS]
    chosen = np.sort(chosen, axis=0)  # an order of summation that knows no ties
    logs = np.take_along_axis(flat, chosen, axis=0)
    with np.errstate(invalid="ignore"):
        weight = np.exp((logs - logs.max(axis=0)) / temperature)
        weight /= weight.sum(axis=0)
    H, V = np.zeros((MODELS, days, order)), np.zeros((MODELS, days, order))
    start = 0
    for which, (part, s) in enumerate(zip(parts, structures(with_outflow), strict=True)):
        stop = start + part.size // days
        rank, day = np.nonzero((chosen >= start) & (chosen < stop) & np.isfinite(weight))
        if len(rank):
            noise, d, w = np.unravel_index(chosen[rank, day] - start, part.shape[:3])
            bank = G[:, :, s.noises]
            lag = np.maximum(noise - bank.shape[2], -1)  # of :data:`LAGS`; -1 is none
            if (lag >= 0).any():
                own, _ = _likeliest_noise(evidence[which][: bank.shape[2]])
                noise = np.where(lag < 0, noise, own[day])
            matrices = np.moveaxis(bank[:, :, noise, day], 2, 0)
            h, variance = _responses(matrices, s, d + first, SHARES[w], n_rows, order, with_outflow, lag)
            H[rank, day], V[rank, day] = h, variance
        start = stop
    mean = np.einsum("md,mdk->dk", weight, H)
    spread = np.einsum("md,mdk->dk", weight, V + (H - mean) ** 2)
    return mean, np.sqrt(spread)


def _regressors(
    s: Structure, d: Ints, w: Floats, n_columns: int, with_outflow: bool, one: int
) -> tuple[Floats, Floats]:
    """Regressors (models, P, K) on the columns of the Gram matrix, and the response (K,).

    The front's taps come first, then the level's lags, the constant, which is column `one`, and the outflow's
    lags.
    """
    every = np.arange(len(d))
    y1 = one + 1 + (O_LAGS if with_outflow else 0)
    y0 = y1 + Y_LAGS
    rho = DRIFT_MEMORY if s.name == "drifting store" else 0.0
    outflows = (1 if s.is_store else O_LAGS) if with_outflow else 0
    X = np.zeros((len(d), s.taps + s.order + 1 + outflows, n_columns))
    for tap in range(s.taps):
        lag = y0 + 1 + d + tap  # u at lag d + 1 + tap
        X[every, tap, lag] += w
        X[every, tap, lag + 1] += 1.0 - w - rho * w
        X[every, tap, lag + 2] -= rho * (1.0 - w)
    for k in range(s.order):
        X[:, s.taps + k, y1 + k] = 1.0
    X[:, s.taps + s.order, one] = 1.0
    for k in range(outflows):
        X[:, s.taps + s.order + 1 + k, one + 1 + k] = 1.0
        if s.is_store:
            X[:, s.taps + s.order + 1 + k, one + 2 + k] = -rho
    response = np.zeros(n_columns)
    response[y0] = 1.0
    if s.is_store:
        response[[y1, y1 + 1]] = -1.0 - rho, rho
    return X, response


def _responses(
    G: Floats, s: Structure, d: Ints, w: Floats, n_rows: int, order: int, with_outflow: bool, lag: Ints
) -> tuple[Floats, Floats]:
    """h and its variance, shape (models, M), of models of one equation; `G` has shape (models, K, K), `lag`
    is the place in :data:`LAGS`, -1 for none."""
    K, more = G.shape[-1], (LAG_TAPS - 1 if with_outflow else 0)
    X, response = _regressors(s, d, w, K, with_outflow, more)
    shown = np.zeros((len(d), LAG_TAPS))
    shown[:, 0] = 1.0
    for i, each in enumerate(LAGS):
        behind = lag == i
        if behind.any():
            shown[behind] = lag_taps(each)
            X[behind] = np.matmul(X[behind, :, more : K - more], _lagging(each, K))
    G = np.ascontiguousarray(G)
    half = np.matmul(X, G)
    Z, z = np.matmul(half, X.swapaxes(1, 2)), np.matmul(half, response[:, None])[..., 0]
    P = Z.shape[1]
    square = np.diagonal(Z, axis1=1, axis2=2)
    moves = square > RESTS * square.max(axis=1, keepdims=True)
    size = np.sqrt(np.where(moves, square, np.inf))  # what rests has the coefficient 0
    scaled = Z / size[:, None] / size[..., None] + RIDGE * np.eye(P)
    inverse = np.linalg.inv(scaled) / size[:, None] / size[..., None]
    theta = np.matmul(inverse, z[..., None])[..., 0]
    total = np.matmul(np.matmul(response[None, None], G), response[:, None])[:, 0, 0]
    rss = np.maximum(total - np.sum(theta * z, axis=1), 0.0)
    free = s.taps + s.order
    covariance = inverse[:, :free, :free] * (rss / (n_rows - P))[:, None, None]
    a = np.zeros((len(d), 2))
    a[:, : s.order] = theta[:, s.taps : free]
    if s.is_store:
        a[:, 0] = 1.0

    every = np.arange(len(d))
    gradient = np.zeros((len(d), free, order + 3))
    for tap in range(s.taps):  # by each tap: v's lags through 1 / A
        gradient[every, tap, d + 1 + tap] = w
        gradient[every, tap, d + 2 + tap] += 1.0 - w
    gradient = gradient[:, :, :order]
    at_once = gradient[:, : s.taps].copy()
    gradient[:, : s.taps] *= shown[:, :1, None]
    for k in range(1, LAG_TAPS):  # behind the lag
        gradient[:, : s.taps, k:] += shown[:, k, None, None] * at_once[..., :-k]
    _recur(gradient[:, : s.taps], a)
    h = np.sum(theta[:, : s.taps, None] * gradient[:, : s.taps], axis=1)
    for k in range(s.order):  # by each lag of the level: h, later by the lag, through 1 / A
        gradient[:, s.taps + k, k + 1 :] = h[:, : order - k - 1]
    _recur(gradient[:, s.taps :], a)
    variance = np.sum(np.matmul(covariance, gradient) * gradient, axis=1)
    return h, np.maximum(variance, 0.0)


def _recur(x: Floats, a: Floats) -> None:
    """In place, ``x[k] += a1 x[k-1] + a2 x[k-2]`` along the last axis of (models, rows, M)."""
    for k in range(1, x.shape[-1]):
        x[..., k] += a[:, :1] * x[..., k - 1]
        if k > 1:
            x[..., k] += a[:, 1:] * x[..., k - 2]
