"""FIR estimates: maximum likelihood (17), a posteriori (22), and jointly with the delay (Tables V and VI).

The dense linear algebra of many days is elementwise over the last axis ("lanes", one day each), in an order
that depends on the sizes M and N only. So a day's bits do not depend on its neighbours, which batched LAPACK
and FFT calls do not promise, and one numpy call does a step for all days. The number of lanes is padded to a
multiple of :data:`LANE_MULTIPLE`, whole SIMD registers, so that no lane is the ragged end of a vector. Lanes
are next to each other in memory: einsum picks its loops, and with them its roundings, by the layout.

The joint estimate searches all delays. For one day and one alpha the penalties of all candidates differ from
``P0 = D_0' D_0`` (D_0: D with rows 0, 1, 2 zero) by two rows of D_0, since d frees the stencils d + 1 and
d + 2 only:

    U'U + alpha D_d'D_d = A - alpha (e1 e1' + e2 e2'),   A = U'U + alpha P0.

With ``A = R'R``, ``z = R'^-1 U'y`` and ``V = R'^-1 E'`` for all rows e, each candidate is a 2 x 2 solve in
the inner products of V and z, criterion included: no candidate needs its own factorisation, nor a
residual. In :func:`jmap` lags run backwards, from M - 1 to 0: the rows e sit at short lags, so their forward
substitution then has little left to do.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from rivid.core.settings import ALPHA_CAP, DEFAULT_ALPHA, MAX_CONDITION, JmapSettings
from rivid.errors import RividError
from rivid.types import Floats, Ints, Strings

_Result = TypeVar("_Result")

LANE_MULTIPLE = 16
"""Lanes come in multiples of this: two registers of eight doubles."""

BLOCK = 368
"""Most lanes in one block: a year of days. The calls of numpy take as long as the arithmetic of 130 lanes, so
that a year in two blocks takes a quarter longer."""

TOGETHER = 112
"""Lanes for which :func:`gram` sums at once, a multiple of :data:`LANE_MULTIPLE`: M inflows and M sums, which
are at work, stay in the cache (54 kB at M = 30). With fewer, numpy's loops are short."""


def as_days(
    series: Mapping[str, ArrayLike | None], least: int, why: str, *, row: str = "day", one: bool = True
) -> tuple[list[Floats], bool]:
    """Check series and return them as arrays of shape (days, N), and whether they were one of shape (N,).

    `series` are by the names they have in messages, None where one is missing; `least` samples are needed,
    `why` is what needs so many, `row` is what a row is, and `one` whether shape (N,) is accepted. RividError
    for shapes that do not fit, values that are not finite, or too few samples.
    """
    arrays = {name: np.asarray(values, float) for name, values in series.items() if values is not None}
    first, shape = next((name, values.shape) for name, values in arrays.items())
    if len(shape) not in ((1, 2) if one else (2,)):
        expected = f"(N,) or ({row}s, N)" if one else f"({row}s, N)"
        raise RividError(f"{first} has shape {shape}: expected {expected}")
    for name, values in arrays.items():
        if values.shape != shape:
            raise RividError(f"{name} has shape {values.shape}: expected that of {first}, {shape}")
    if shape[-1] < least:
        raise RividError(f"{shape[-1]} samples a {row}: {why} needs {least} or more")
    for name, values in arrays.items():
        bad = np.flatnonzero(~np.isfinite(np.atleast_2d(values)).all(axis=1))
        if len(bad):
            raise RividError(f"{name}: not finite on {len(bad)} {row}s, first on row {bad[0]}: mask them")
    return [np.atleast_2d(values) for values in arrays.values()], len(shape) == 1


def blocks(n_days: int, most: int) -> Iterator[tuple[slice, NDArray[np.intp]]]:
    """Blocks of `most` lanes: their days, and the day of each lane (lanes,); padding repeats the last."""
    for first in range(0, n_days, most):
        last = min(first + most, n_days)
        yield slice(first, last), padded(np.arange(first, last))


def padded(take: NDArray[np.intp]) -> NDArray[np.intp]:
    """The indices, the last one repeated up to a multiple of :data:`LANE_MULTIPLE`."""
    return np.pad(take, (0, -len(take) % LANE_MULTIPLE), mode="edge")


def gram(
    u: Floats, y: Floats, take: NDArray[np.intp], G: Floats, b: Floats, free_start: bool = False
) -> tuple[Floats, int]:
    """U'U (M, M, lanes) and U'y (M, lanes) of the Toeplitz matrix U of (16), into G and b.

    u and y have shape (days, N), M <= N; lane l is day ``take[l]``. U'U is Toeplitz up to a low-rank
    correction: ``G[i+1, j+1] = G[i, j] - u[N-1-i] u[N-1-j]``, so only its first row is a sum over samples.

    With `free_start` False, u is zero before the first sample, as in (16), and N rows count. True: it is
    unknown. Then only the N - M + 1 rows with all M samples of u count, and a constant is fitted as well
    (rows and output less their means).

    Returns y'y (lanes,), and how many rows U has.
    """
    N, M = u.shape[1], len(b)
    first = M - 1 if free_start else 0
    sums, total, yy = np.empty(b.shape), np.empty(len(take)), np.empty(len(take))
    for begin in range(0, len(take), TOGETHER):
        some = slice(begin, begin + TOGETHER)
        rows = np.zeros((M - 1 + N, len(take[some])))
        rows[M - 1 :] = u[take[some]].T
        late = sliding_window_view(rows, N - first, axis=0)[::-1][:M].swapaxes(1, 2)  # u[n-k], n >= first
        z = y[take[some]].T[first:].copy()
        G[0, :, some] = np.einsum("knb,nb->kb", late, late[0])
        b[:, some] = np.einsum("knb,nb->kb", late, z)
        yy[some] = np.einsum("nb,nb->b", z, z)
        if free_start:
            sums[:, some], total[some] = np.einsum("knb->kb", late), np.einsum("nb->b", z)
    G[1:, 0] = G[0, 1:]
    tail = u[take, N - M :].T[::-1].copy()  # u[N-1-i], i = 0..M-1
    head = u[take, : M - 1].T[::-1].copy()  # u[M-2-i], i = 0..M-2
    for i in range(M - 1):
        np.multiply(tail[i], tail[: M - 1], out=G[i + 1, 1:])
        np.subtract(G[i, :-1], G[i + 1, 1:], out=G[i + 1, 1:])
        if free_start:  # the row that enters above as the last one leaves below
            G[i + 1, 1:] += head[i] * head
    n_rows = N - first
    if free_start:
        G -= sums[:, None] * sums / n_rows
        b -= sums * total / n_rows
        raw = yy
        yy = raw - total * total / n_rows
        yy[yy <= 1e-14 * raw] = 0.0  # a constant, to rounding
    return yy, n_rows


def cholesky(A: Floats, R: Floats, E: Floats | None = None, V: Floats | None = None) -> None:
    """Cholesky factor and forward-substituted right-hand sides, in one sweep, into R and V.

    A, shape (M, M + 1, lanes), is a matrix, of which the upper triangle is read, and as its last column a
    right-hand side b. R, of the same shape, becomes R with ``A = R'R``, meaningless below the diagonal, and
    as its last column ``R'^-1 b``; a lane that is not positive definite becomes NaN. E, shape (K, M), are
    right-hand sides that all lanes share, as rows: M - L leading zeros, and one more from row to row. V,
    shape (L, K, lanes), becomes the last L rows of ``R'^-1 E'``, the others are zero; where these stay zero,
    V must be.
    """
    M = len(A)
    first = M if V is None else M - len(V)
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(M):
            row = R[j, j:]
            np.subtract(A[j, j:], np.einsum("kib,kb->ib", R[:j, j:], R[:j, j]), out=row)
            root = np.sqrt(row[0])
            row /= root
            if E is not None and V is not None and j >= first:
                begun = V[j - first, : j - first + 1]
                done = np.einsum("kib,kb->ib", V[: j - first, : len(begun)], R[first:j, j])
                np.subtract(E[: len(begun), j, None], done, out=begun)
                begun /= root


def back_substitute(R: Floats, v: Floats) -> Floats:
    """Solve ``R h = v`` with R of :func:`cholesky`, its last column aside, and v (M, lanes)."""
    M = len(v)
    h = v.copy()  # C order for any v: einsum's order of summation follows the layout
    for j in range(M - 1, -1, -1):
        x = h[j]
        x -= np.einsum("ib,ib->b", R[j, j + 1 : M], h[j + 1 :])
        x /= R[j, j]
    return h


def condition_numbers(G: Floats) -> Floats:
    """2-norm condition number of each symmetric matrix of G (M, M, lanes), shape (lanes,).

    Infinite where the smallest eigenvalue is not positive. LAPACK works one matrix after another here, so a
    lane does not depend on its neighbours.
    """
    eigenvalues = np.linalg.eigvalsh(np.moveaxis(G, -1, 0))
    low, high = eigenvalues[:, 0], eigenvalues[:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(low > 0, high / low, np.inf)


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


def only_day(found: _Result) -> _Result:
    """The result of a single day, without the axis of days."""
    of_days = {
        name: values[0]
        for name, values in vars(found).items()
        if name not in ("candidates", "names") and values is not None
    }
    return replace(found, **of_days)  # type: ignore[type-var]  # all are dataclasses


def second_difference(order: int) -> Floats:
    """D: the M x M lower-triangular Toeplitz matrix with first column (1, -2, 1, 0, ...), of (20)."""
    return np.eye(order) - 2.0 * np.eye(order, k=-1) + np.eye(order, k=-2)


def ml(u: ArrayLike, y: ArrayLike, order: int = 30, *, free_start: bool = False) -> FirResult:
    """Maximum-likelihood FIR, ``h = (U'U)^-1 U'y`` (17): :func:`map_fir` without the prior.

    Examples
    --------
    >>> u = np.r_[0.0, 1.0, 0.0, 2.0, -1.0, 0.5, 0.0, 1.0]
    >>> y = np.convolve(u, [0.0, -1.0, 2.0])[:8]
    >>> ml(u, y, order=3).fir.round(9) + 0.0
    array([ 0., -1.,  2.])
    """
    return map_fir(u, y, order, 0.0, free_start=free_start)


def map_fir(
    u: ArrayLike, y: ArrayLike, order: int = 30, alpha: float = DEFAULT_ALPHA, *, free_start: bool = False
) -> FirResult:
    """Maximum a posteriori FIR with a smoothness prior, ``h = (U'U + alpha D'D)^-1 U'y`` (22).

    `u` and `y`, both (N,) or (days, N), are the deviations of inflow [m3/s] and output [output unit] from the
    day's first sample, `order` is M [samples] and `alpha` sigma_w2 / sigma_hD2 [(m3/s)^2]; `free_start` is
    that of :class:`rivid.core.settings.JmapSettings`. RividError for shapes that do not fit, values that are
    not finite, or fewer samples than M.
    """
    (inputs, outputs), single = as_days({"u": u, "y": y}, order + 1, f"an FIR of order {order}")
    n = len(inputs)
    D = second_difference(order)
    P = (alpha * (D.T @ D))[:, :, None]
    fir = np.empty((n, order))
    noise, condition = np.empty(n), np.empty(n)
    for days, take in blocks(n, BLOCK):
        A, R = np.empty((2, order, order + 1, len(take)))
        G, b = A[:, :-1], A[:, -1]
        yy, n_rows = gram(inputs, outputs, take, G, b, free_start)
        here = slice(0, days.stop - days.start)
        still, condition[days] = motionless(yy, G), condition_numbers(G[..., here])
        G += P
        cholesky(A, R)
        h = back_substitute(R, R[:, -1])
        # y'y - 2 b'h + h'G h, with G h = b - alpha D'D h
        rss = yy - np.einsum("ib,ib->b", b, h) - np.einsum("ib,ijb,jb->b", h, P, h)
        fir[days] = np.where(still, np.nan, h)[:, here].T
        noise[days] = np.maximum(rss, 0.0)[here] / n_rows
    bad = ~np.isfinite(fir).all(axis=1) | ~(condition <= MAX_CONDITION)
    fir[bad], noise[bad] = np.nan, np.nan
    status = np.where(bad, "unidentifiable", "ok")
    found = FirResult(fir, noise, condition, status)
    return only_day(found) if single else found


def half_time(fir: Floats) -> Floats:
    """t50: the lag by which half of a step of the inflow has arrived.

    For responses (days, M) that keep the volume of the inflow, as that of a river. A dispersive river has no
    single delay; t50 is estimated best, and it adds up along the river. It is interpolated [samples],
    (days,): a unit response at lag k gives k. NaN where the response does not sum to something positive.

    Examples
    --------
    >>> half_time(np.array([[0.0, 0.0, 1.0, 0.0], [0.0, 0.5, 0.5, 0.0]]))
    array([2. , 1.5])
    """
    steps = np.cumsum(fir, axis=1)
    every, half = np.arange(len(fir)), 0.5 * steps[:, -1]
    k = np.argmax(steps >= half[:, None], axis=1)
    before = np.where(k > 0, steps[every, k - 1], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # a coefficient at lag k acts over the sample around k
        t50 = k - 0.5 + (half - before) / (steps[every, k] - before)
    return np.where(half > 0.0, t50, np.nan)


def motionless(yy: Floats, G: Floats) -> NDArray[np.bool_]:
    """Lanes in which the input or the output never leaves its first value."""
    return np.asarray((yy <= 0.0) | (G[0, 0] <= 0.0))


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

    The noise variance is sigma_w2 of (19); the status "degenerate" means that alpha ran away
    to its limit, or that the iteration of Table VI has not settled in `max_iterations`.

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
    trace : ndarray, shape (days, rounds, 2), or None
        sigma_w2 and sigma_hD2 after each iteration, by which the paper checks convergence; NaN after a day's
        last one. None unless asked for.
    """

    delay: Floats
    alpha: Floats
    roughness_variance: Floats
    candidates: Ints
    criterion: Floats
    iterations: Ints
    prior_only: NDArray[np.bool_]
    trace: Floats | None = None


def jmap(
    u: ArrayLike, y: ArrayLike, settings: JmapSettings | None = None, *, trace: bool = False, **changes: Any
) -> JmapResult:
    """Estimate delay and FIR of one day or of many.

    `u` and `y`, both (N,) or (days, N), are the deviations of inflow [m3/s] and output [m for a level, m3/s
    for a discharge] from the day's first sample. The settings are the paper's by default, Table VI with the
    Rayleigh prior; `changes` are single ones, ``jmap(u, y, prior="uniform", alpha=1e4)`` for Table V. With
    `trace` the variances of every iteration are kept. RividError for shapes that do not fit, values that are
    not finite, or fewer samples than M.

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
    settings = (settings or JmapSettings()).changed(changes)
    (inputs, outputs), single = as_days(
        {"u": u, "y": y}, settings.order + 1, f"an FIR of order {settings.order}"
    )
    n, parts = len(inputs), []
    if not n:  # a day of zeros, which is not returned
        inputs, outputs = np.zeros((2, 1, inputs.shape[1]))
    for days, take in blocks(len(inputs), BLOCK):
        with np.errstate(invalid="ignore", divide="ignore"):  # lanes that cannot be identified
            block = _Block(inputs, outputs, take, settings)
            parts.append(block.result(min(days.stop, n) - days.start))
    rounds = max(part["trace"].shape[1] for part in parts)
    for part in parts:
        wide = ((0, 0), (0, rounds - part["trace"].shape[1]), (0, 0))
        part["trace"] = np.pad(part["trace"], wide, constant_values=np.nan)
    columns: dict[str, Any] = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    if not trace:
        del columns["trace"]
    found = JmapResult(candidates=np.arange(settings.d_min, settings.d_max + 1), **columns)
    return only_day(found) if single else found


class _Candidates:
    """All candidate delays of one block: the 2 x 2 solves of the module's heading."""

    def __init__(self, A: Floats, R: Floats, yy: Floats, settings: JmapSettings) -> None:
        self.A, self.R, self.yy = A, R, yy
        D_0 = second_difference(settings.order)
        if settings.jumps == "both":
            D_0[:3] = 0.0
        D_0 = D_0[:, ::-1]
        self.E = D_0[settings.d_max + 2 : settings.d_min : -1]  # every d + 1 and d + 2, the longest first
        self.P_0 = [np.diag(D_0.T @ D_0, k)[:, None] for k in range(3)]  # the others are zero
        self.bands = [A.reshape(-1, A.shape[-1])[k :: len(A) + 2][: len(A) - k] for k in range(3)]
        self.of_G = [band.copy() for band in self.bands]
        self.V = np.zeros((settings.d_max + 3, len(self.E), A.shape[-1]))

    def ml(self) -> tuple[Floats, Floats]:
        """The FIR of (17), backwards, and ``||y - U h||^2``."""
        cholesky(self.A, self.R)
        z = self.R[:, -1]
        return back_substitute(self.R, z), self.yy - np.einsum("kb,kb->b", z, z)

    def solve(self, alpha: Floats) -> None:
        """Find the cost of each candidate at these alpha, shape (lanes,)."""
        for band, of_G, of_P_0 in zip(self.bands, self.of_G, self.P_0, strict=True):
            np.add(of_G, alpha * of_P_0, out=band)
        cholesky(self.A, self.R, self.E, self.V)
        for band, of_G in zip(self.bands, self.of_G, strict=True):
            band[:] = of_G
        # inner products of A^-1: with itself, with its neighbour, and with U'y; the shortest delay first
        V, z = self.V, self.R[:, -1]
        own = np.einsum("krb,krb->rb", V, V)[::-1]
        next_ = np.einsum("krb,krb->rb", V[:, :-1], V[:, 1:])[::-1]
        on_y = np.einsum("krb,kb->rb", V, z[-len(V) :])[::-1]
        a11, a22 = 1 / alpha - own[:-1], 1 / alpha - own[1:]
        det = a11 * a22 - next_ * next_
        self.c1 = (a22 * on_y[:-1] + next_ * on_y[1:]) / det
        self.c2 = (a11 * on_y[1:] + next_ * on_y[:-1]) / det
        # min over h of ||y - U h||^2 + alpha ||D_d h||^2, shape (K, lanes)
        self.cost = self.yy - np.einsum("kb,kb->b", z, z) - (self.c1 * on_y[:-1] + self.c2 * on_y[1:])

    def fir(self, index: Ints) -> Floats:
        """The FIR, backwards, of candidate number `index` of each lane, shape (M, lanes)."""
        V, lane, v = self.V[:, ::-1], np.arange(len(index)), self.R[:, -1].copy()
        v[-len(V) :] += self.c1[index, lane] * V[:, index, lane]
        v[-len(V) :] += self.c2[index, lane] * V[:, index + 1, lane]
        return back_substitute(self.R, v)


class _Block:
    """Up to :data:`BLOCK` days at work."""

    def __init__(self, u: Floats, y: Floats, take: NDArray[np.intp], settings: JmapSettings) -> None:
        self.settings = s = settings
        self.n = len(take)
        # in one piece, of a few MB: malloc would return two to the system at the end of each call, and their
        # pages, new again each time, would take a fifth of the time
        self.A, self.R = np.empty((2, s.order, s.order + 1, self.n))
        self.yy, self.N = gram(u, y, take, self.A[::-1, -2::-1], self.A[::-1, -1], s.free_start)
        self.variances = np.full((2, self.n), np.nan)  # sigma_w2 and sigma_hD2
        self.rounds: list[Floats] = []  # the same of each iteration
        self.dof = self.N + 2 * (s.alpha_w + 1)
        self.settled = np.zeros(self.n, bool)
        self.candidates = np.arange(s.d_min, s.d_max + 1)
        self.penalty = np.zeros(len(self.candidates))
        if s.prior == "rayleigh":  # (26), its terms of (27) and (35)
            self.penalty = self.candidates**2 / s.delay_scale**2 - 2 * np.log(self.candidates)
        self.fir = np.full((s.order, self.n), np.nan)
        self.cost = np.full((len(self.candidates), self.n), np.nan)
        self.index = np.zeros(self.n, np.intp)
        self.iterations = np.zeros(self.n, np.intp)

    def result(self, n_days: int) -> dict[str, NDArray[Any]]:
        """Estimate, and give the columns of the first `n_days` lanes."""
        s, here = self.settings, slice(0, n_days)
        condition = condition_numbers(self.A[:, :-1, here])
        if s.alpha is None:
            terms = self._table_vi()
        else:
            self._table_v(s.alpha)
        s_w, s_h = self.variances
        data_only = self.cost / s_w
        criterion = data_only + self.penalty[:, None] + terms if s.alpha is None else self.cost
        bad = motionless(self.yy, self.A)[here] | ~(condition <= MAX_CONDITION)
        bad |= ~np.isfinite(self.fir[:, here]).all(axis=0)
        alpha = s_w / s_h
        flat = np.ptp(data_only, axis=0) <= PRIOR_ONLY_SPREAD
        elsewhere = abs(np.argmin(data_only, axis=0) - self.index) > 1
        astray = (alpha[here] >= ALPHA_CAP * (1 - 1e-9)) | ~self.settled[here]
        columns: dict[str, NDArray[Any]] = {
            "delay": self.candidates[self.index].astype(float)[here],
            "fir": self.fir[::-1].T[here],
            "alpha": alpha[here],
            "noise_variance": s_w[here],
            "roughness_variance": s_h[here],
            "criterion": criterion.T[here],
        }
        for values in columns.values():
            values[bad] = np.nan
        return columns | {
            "iterations": np.where(bad, 0, self.iterations[here]),
            "condition": condition,
            "status": np.where(bad, "unidentifiable", np.where(astray, "degenerate", "ok")),
            "prior_only": ~bad & (flat | elsewhere)[here],
            "trace": np.stack(self.rounds).transpose(2, 0, 1)[here],
        }

    def _table_v(self, alpha: float) -> None:
        """Uniform prior, fixed alpha: (28)-(29)."""
        search = _Candidates(self.A, self.R, self.yy, self.settings)
        search.solve(np.full(self.n, alpha))
        self.cost = search.cost
        self.index = np.argmin(self.cost, axis=0)
        self.fir = search.fir(self.index)
        fidelity = self.cost[self.index, np.arange(self.n)] - alpha * self._roughness(self.fir, self.index)
        s_w = self._noise(fidelity, slice(None))
        self.variances[:] = s_w, s_w / alpha
        self.iterations[:], self.settled[:] = 1, True
        self._note(slice(None))

    def _table_vi(self) -> Floats:
        """Both variances estimated in turn with d and h; returns the terms of (35) without d."""
        s, M = self.settings, self.settings.order
        search = _Candidates(self.A, self.R, self.yy, s)
        h, fidelity = search.ml()
        if s.inverse_gamma:
            Dh = _second_differences(h)
            alpha_h, beta_h = M / 2, np.einsum("ib,ib->b", Dh, Dh) / 2
            alpha_h = alpha_h if s.alpha_h is None else s.alpha_h
            beta_h = beta_h if s.beta_h is None else np.full(self.n, s.beta_h)
        else:  # the flat prior of (31): sigma_hD2 = ||D_d h||^2 / M
            alpha_h, beta_h = -1.0, np.zeros(self.n)
        shape = M + 2 * (alpha_h + 1)

        index = np.full(self.n, int(np.clip(s.d_init, s.d_min, s.d_max)) - s.d_min)
        rough = self._roughness(h, index)
        take = np.arange(self.n)  # which lanes the working arrays hold
        working = np.isfinite(h).all(axis=0) & ~motionless(self.yy, self.A)
        for iteration in range(1, s.max_iterations + 1):
            s_w = self._noise(fidelity, take)  # (38)
            s_h = np.maximum((rough + 2 * beta_h[take]) / shape, s_w / ALPHA_CAP)  # (37)
            search.solve(s_w / s_h)
            index = np.argmin(search.cost / s_w + self.penalty[:, None], axis=0)
            h = search.fir(index)
            rough = self._roughness(h, index)
            fidelity = search.cost[index, np.arange(len(take))] - s_w / s_h * rough

            variances, now = np.stack([s_w, s_h]), take[working]
            settled = (abs(variances / self.variances[:, take] - 1) < s.tolerance).all(axis=0)
            self.fir[:, now], self.cost[:, now] = h[:, working], search.cost[:, working]
            self.index[now], self.variances[:, now] = index[working], variances[:, working]
            self.iterations[now], self.settled[now] = iteration, settled[working]
            self._note(now)
            working = working & ~settled & np.isfinite(s_w)
            left = np.flatnonzero(working)
            if not len(left):
                break
            if len(left) <= len(take) // 2:  # drop the settled lanes, keep whole registers
                keep = padded(left)
                A, R = np.empty((2, M, M + 1, len(keep)))
                np.take(search.A, keep, axis=-1, out=A, mode="clip")  # "raise" would make a copy
                search = _Candidates(A, R, search.yy[keep], s)
                take, rough, fidelity = take[keep], rough[keep], fidelity[keep]
                working = np.arange(len(keep)) < len(left)
        s_w, s_h = self.variances
        terms = 2 * beta_h / s_h + self.dof * np.log(s_w) + shape * np.log(s_h)
        return np.asarray(terms + 2 * s.beta_w / s_w)

    def _note(self, now: Ints | slice) -> None:
        """Keep the variances of the lanes that were worked on."""
        found = np.full((2, self.n), np.nan)
        found[:, now] = self.variances[:, now]
        self.rounds.append(found)

    def _noise(self, fidelity: Floats, take: Ints | slice) -> Floats:
        """(38), or with an inverse-gamma prior on sigma_w2 what (37) is for sigma_hD2."""
        least = np.maximum(fidelity, NOISE_FLOOR * self.yy[take])
        return np.asarray((least + 2 * self.settings.beta_w) / self.dof)

    def _roughness(self, h: Floats, index: Ints) -> Floats:
        """||D_d h||^2 of each lane, d being candidate number `index`."""
        x = _second_differences(h)
        row = np.arange(len(h) - 1, -1, -1)[:, None]
        free = self.settings.d_min + index + 1
        x[(row == free) | (row == free + 1)] = 0.0
        if self.settings.jumps == "both":
            x = x[:-3]
        return np.asarray(np.einsum("ib,ib->b", x, x))


def _second_differences(h: Floats) -> Floats:
    """D h of FIRs that stand backwards, shape (M, lanes): rows M - 1 to 0."""
    x = h.copy()
    x[:-1] -= 2 * h[1:]
    x[:-2] += h[2:]
    return x
