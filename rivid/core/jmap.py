"""The paper's estimator: delay and FIR together, by exhaustive search (Tables V and VI).

For one day and one alpha the penalties of all candidates differ from ``P0 = D_0' D_0`` (D_0: D with rows
0, 1, 2 zero) by two rows of D_0, since d frees the stencils d + 1 and d + 2 only:

    U'U + alpha D_d'D_d = A - alpha (e1 e1' + e2 e2'),   A = U'U + alpha P0.

With ``A = R'R``, ``z = R'^-1 U'y`` and ``V = R'^-1 E'`` for all rows e, each candidate is a 2 x 2 solve in
the inner products of V and z, criterion included: no candidate needs its own factorisation, nor a
residual. Days are lanes (:mod:`rivid.core.batched`), and inside this module lags run backwards, from M - 1
to 0: the rows e sit at short lags, so their forward substitution then has little left to do.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core import batched as lanes
from rivid.core.fir import FirResult, motionless, second_difference
from rivid.core.settings import ALPHA_CAP, MAX_CONDITION, JmapSettings
from rivid.types import Floats, Ints

NOISE_FLOOR = 1e-10
"""Smallest noise variance, relative to the mean square of y. Below it the criterion, a difference of two
nearly equal sums of squares, has no correct digits left; 100 dB is beyond any gauge."""

PRIOR_ONLY_SPREAD = 0.08
"""The criterion without the d terms is flat where its best and worst candidate differ by no more than this.
It and the place of the minimum recognise nineteen of twenty days without any relation between u and y
(docs/accuracy.md)."""


@dataclass(frozen=True)
class JmapResult(FirResult):
    """Joint estimate of delay and FIR for each day; a leading axis of days, or none for a single day.

    The noise variance is sigma_w2 of (19); the status "degenerate" means that alpha ran away.

    Attributes
    ----------
    delay : ndarray, shape (days,)
        d [samples]: the inflow first acts on the output at lag d + 1 (8). NaN where `status` is
        "unidentifiable".
    alpha : ndarray, shape (days,)
        sigma_w2 / sigma_hD2 [(m3/s)^2].
    roughness_variance : ndarray, shape (days,)
        sigma_hD2 [(output unit per m3/s)^2].
    candidates : ndarray, shape (K,)
        The delays tried [samples].
    criterion : ndarray, shape (days, K)
        (35) at the final variances, or (28) for a fixed alpha.
    iterations : ndarray of int, shape (days,)
        Iterations of Table VI; 1 for Table V.
    prior_only : ndarray of bool, shape (days,)
        The delay is the prior's: without the d terms the criterion is flat, or has its minimum more than a
        sample away.
    """

    delay: Floats
    alpha: Floats
    roughness_variance: Floats
    candidates: Ints
    criterion: Floats
    iterations: Ints
    prior_only: NDArray[np.bool_]


def jmap(u: ArrayLike, y: ArrayLike, settings: JmapSettings | None = None, **changes: Any) -> JmapResult:
    """Estimate delay and FIR of one day or of many.

    Parameters
    ----------
    u : array_like, shape (N,) or (days, N)
        Inflow deviations from the day's first sample [m3/s].
    y : array_like, same shape
        Output deviations from the day's first sample [m for a level, m3/s for a discharge].
    settings : JmapSettings, optional
        The paper's by default: Table VI with the Rayleigh prior.
    **changes
        Single settings to change, ``jmap(u, y, prior="uniform", alpha=1e4)`` for Table V.

    Returns
    -------
    JmapResult

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or fewer samples than M.

    Notes
    -----
    Source: Table V with (28)-(29) for a fixed alpha; Table VI with (35), (37), (38) otherwise. A day's
    result does not depend on the other days of the call, to the last bit.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> u = np.cumsum(rng.normal(size=400)); u -= u[0]
    >>> h = np.r_[0.0, -1.2 * 0.88 ** np.arange(29)]; h[8:] += 0.88 ** np.arange(22)
    >>> jmap(u, np.convolve(u, h)[:400] + rng.normal(scale=0.3, size=400)).delay
    np.float64(7.0)
    """
    settings = replace(settings or JmapSettings(), **changes)
    (inputs, outputs), single = lanes.as_days(
        {"u": u, "y": y}, settings.order + 1, f"an FIR of order {settings.order}"
    )
    parts = []
    for days, take in lanes.blocks(len(inputs)):
        with np.errstate(invalid="ignore", divide="ignore"):  # lanes that cannot be identified
            block = _Block(inputs[take].T.copy(), outputs[take].T.copy(), settings)
            parts.append(block.result(days.stop - days.start))
    merged: dict[str, Any] = {
        name: np.concatenate([part[name] for part in parts]) if parts else _nothing(name, settings)
        for name in JmapResult.__dataclass_fields__
        if name != "candidates"
    }
    if single:
        merged = {name: values[0] for name, values in merged.items()}
    return JmapResult(candidates=np.arange(settings.d_min, settings.d_max + 1), **merged)


def _nothing(name: str, settings: JmapSettings) -> NDArray[Any]:
    """The column of a call without days."""
    width = {"fir": (0, settings.order), "criterion": (0, settings.d_max - settings.d_min + 1)}
    kind: dict[str, Any] = {"iterations": np.intp, "status": "U14", "prior_only": bool}
    return np.empty(width.get(name, (0,)), kind.get(name, float))


class _Candidates:
    """All candidate delays of one block at one alpha: the 2 x 2 solves of the module's heading."""

    def __init__(self, G: Floats, b: Floats, yy: Floats, alpha: Floats, settings: JmapSettings) -> None:
        D_0 = second_difference(settings.order)
        D_0[:3] = 0.0
        D_0 = D_0[:, ::-1]
        E = D_0[settings.d_max + 2 : settings.d_min : -1]  # every d + 1 and d + 2, the longest first
        A = G.copy()
        P_0 = D_0.T @ D_0
        for k in range(3):  # P_0 is banded; the upper triangle will do
            band = A.reshape(-1, A.shape[-1])[k :: len(A) + 1][: len(A) - k]
            band += alpha * np.diag(P_0, k)[:, None]
        self.R, self.z, self.V = lanes.cholesky(A, b, E)
        # inner products of A^-1: with itself, with its neighbour, and with U'y; the shortest delay first
        first = int(np.flatnonzero(E[0])[0])
        V, z = self.V[first:], self.z[first:]
        own = np.einsum("krb,krb->rb", V, V)[::-1]
        next_ = np.einsum("krb,krb->rb", V[:, :-1], V[:, 1:])[::-1]
        on_y = np.einsum("krb,kb->rb", V, z)[::-1]
        a11, a22 = 1 / alpha - own[:-1], 1 / alpha - own[1:]
        det = a11 * a22 - next_ * next_
        self.c1 = (a22 * on_y[:-1] + next_ * on_y[1:]) / det
        self.c2 = (a11 * on_y[1:] + next_ * on_y[:-1]) / det
        # min over h of ||y - U h||^2 + alpha ||D_d h||^2, shape (K, lanes)
        self.cost = yy - np.einsum("kb,kb->b", self.z, self.z) - (self.c1 * on_y[:-1] + self.c2 * on_y[1:])

    def fir(self, index: Ints) -> Floats:
        """The FIR, backwards, of candidate number `index` of each lane, shape (M, lanes)."""
        lane, last = np.arange(len(index)), self.V.shape[1] - 1
        v = self.z + self.c1[index, lane] * self.V[:, last - index, lane]
        v += self.c2[index, lane] * self.V[:, last - index - 1, lane]
        return lanes.back_substitute(self.R, v)


class _Block:
    """Up to :data:`lanes.BLOCK` days at work."""

    def __init__(self, u: Floats, y: Floats, settings: JmapSettings) -> None:
        self.settings = s = settings
        self.n = u.shape[1]
        G, b, self.yy, self.N = lanes.gram(u, y, s.order, s.free_start)
        self.G, self.b = np.ascontiguousarray(G[::-1, ::-1]), np.ascontiguousarray(b[::-1])
        self.candidates = np.arange(s.d_min, s.d_max + 1)
        self.penalty = np.zeros(len(self.candidates))
        if s.prior == "rayleigh":  # (26), its terms of (27) and (35)
            self.penalty = self.candidates**2 / s.delay_scale**2 - 2 * np.log(self.candidates)
        self.fir = np.full((s.order, self.n), np.nan)
        self.cost = np.full((len(self.candidates), self.n), np.nan)
        self.index = np.zeros(self.n, np.intp)
        self.s_w, self.s_h = np.full(self.n, np.nan), np.full(self.n, np.nan)
        self.iterations = np.zeros(self.n, np.intp)

    def result(self, n_days: int) -> dict[str, NDArray[Any]]:
        """Estimate, and give the columns of the first `n_days` lanes."""
        s, here = self.settings, slice(0, n_days)
        condition = lanes.condition_numbers(self.G[..., here])
        if s.alpha is not None:
            self._table_v(s.alpha)
            criterion, data_only = self.cost, self.cost / self.s_w
        else:
            terms = self._table_vi()
            data_only = self.cost / self.s_w
            criterion = data_only + self.penalty[:, None] + terms
        bad = motionless(self.yy, self.G)[here] | ~(condition <= MAX_CONDITION)
        bad |= ~np.isfinite(self.fir[:, here]).all(axis=0)
        alpha = self.s_w / self.s_h
        runaway = alpha[here] >= ALPHA_CAP * (1 - 1e-9)
        columns: dict[str, NDArray[Any]] = {
            "delay": self.candidates[self.index].astype(float)[here],
            "fir": self.fir[::-1].T[here],
            "alpha": alpha[here],
            "noise_variance": self.s_w[here],
            "roughness_variance": self.s_h[here],
            "criterion": criterion.T[here],
        }
        for values in columns.values():
            values[bad] = np.nan
        return columns | {
            "iterations": np.where(bad, 0, self.iterations[here]),
            "condition": condition,
            "status": np.where(bad, "unidentifiable", np.where(runaway, "degenerate", "ok")),
            "prior_only": ~bad & self._prior_only(data_only)[here],
        }

    def _prior_only(self, data_only: Floats) -> NDArray[np.bool_]:
        """Where the criterion without the d terms does not single out the delay that was chosen."""
        flat = np.ptp(data_only, axis=0) <= PRIOR_ONLY_SPREAD
        return np.asarray(flat | (abs(np.argmin(data_only, axis=0) - self.index) > 1))

    def _table_v(self, alpha: float) -> None:
        """Uniform prior, fixed alpha: (28)-(29)."""
        search = _Candidates(self.G, self.b, self.yy, np.full(self.n, alpha), self.settings)
        self.cost = search.cost
        self.index = np.argmin(self.cost, axis=0)
        self.fir = search.fir(self.index)
        fidelity = self.cost[self.index, np.arange(self.n)] - alpha * self._roughness(self.fir, self.index)
        self.s_w = self._noise(fidelity, slice(None))
        self.s_h = self.s_w / alpha
        self.iterations[:] = 1

    def _table_vi(self) -> Floats:
        """Both variances estimated in turn with d and h; returns the terms of (35) without d."""
        s, M = self.settings, self.settings.order
        R, z, _ = lanes.cholesky(self.G, self.b)
        h = lanes.back_substitute(R, z)  # (17)
        fidelity = self.yy - np.einsum("kb,kb->b", z, z)
        if s.inverse_gamma:
            Dh = h.copy()
            Dh[:-1] -= 2 * h[1:]
            Dh[:-2] += h[2:]
            alpha_h, beta_h = M / 2, np.einsum("ib,ib->b", Dh, Dh) / 2
        else:  # the flat prior of (31): sigma_hD2 = ||D_d h||^2 / M
            alpha_h, beta_h = -1.0, np.zeros(self.n)
        shape = M + 2 * (alpha_h + 1)

        index = np.full(self.n, int(np.clip(s.d_init, s.d_min, s.d_max)) - s.d_min)
        take = np.arange(self.n)  # which lanes the working arrays hold
        G, b, yy = self.G, self.b, self.yy
        working = np.isfinite(h).all(axis=0) & ~motionless(yy, G)
        for iteration in range(1, s.max_iterations + 1):
            s_w = self._noise(fidelity, take)  # (38)
            s_h = (self._roughness(h, index) + 2 * beta_h[take]) / shape  # (37)
            s_h = np.maximum(s_h, s_w / ALPHA_CAP)
            search = _Candidates(G, b, yy, s_w / s_h, s)
            index = np.argmin(search.cost / s_w + self.penalty[:, None], axis=0)
            h = search.fir(index)
            fidelity = search.cost[index, np.arange(len(take))] - s_w / s_h * self._roughness(h, index)

            settled = (abs(s_h / self.s_h[take] - 1) < s.tolerance) & (
                abs(s_w / self.s_w[take] - 1) < s.tolerance
            )
            now = take[working]
            self.fir[:, now], self.cost[:, now] = h[:, working], search.cost[:, working]
            self.index[now], self.s_w[now], self.s_h[now] = index[working], s_w[working], s_h[working]
            self.iterations[now] = iteration
            working = working & ~settled & np.isfinite(s_w)
            left = np.flatnonzero(working)
            if not len(left):
                break
            if len(left) <= len(take) // 2:  # drop the settled lanes, keep whole registers
                keep = lanes.padded(left)
                G, b, yy, take, h, fidelity, index = (
                    # np.take, unlike G[..., keep], gives C order: lanes stay next to each other
                    np.take(array, keep, axis=-1)
                    for array in (G, b, yy, take, h, fidelity, index)
                )
                working = np.arange(len(keep)) < len(left)
        return np.asarray(2 * beta_h / self.s_h + self.N * np.log(self.s_w) + shape * np.log(self.s_h))

    def _noise(self, fidelity: Floats, take: Ints | slice) -> Floats:
        return np.asarray(np.maximum(fidelity, NOISE_FLOOR * self.yy[take]) / self.N)

    def _roughness(self, h: Floats, index: Ints) -> Floats:
        """||D_d h||^2 of each lane, d being candidate number `index`."""
        x = h[:-3] - 2 * h[1:-2] + h[2:-1]  # rows M-1 .. 3 of D h
        row = np.arange(len(h) - 1, 2, -1)[:, None]
        free = self.settings.d_min + index + 1
        x[(row == free) | (row == free + 1)] = 0.0
        return np.asarray(np.einsum("ib,ib->b", x, x))
