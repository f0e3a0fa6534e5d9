"""Delay by exhaustive search in the paper's simple models (Table IV): the direct and the indirect approach.

For every candidate d the parameters are those of least squares, and the delay is the d of the smallest sum
of squares. In both models one column of the regression depends on d alone, the filtered inflow at lag
d + 1. So the other columns are projected out of everything once, and each candidate is one projection on
what is left of its column. Residuals are formed sample by sample, never as a difference of sums of squares:
filtered signals grow like ramps, and the differences between candidates are small against them.

Days are lanes (:mod:`rivid.core.fir`): a day's bits do not depend on its neighbours.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core.fir import as_days, blocks, only_day
from rivid.core.settings import SearchSettings
from rivid.types import Floats, Ints, Strings

BLOCK = 176
"""Most lanes in one block: with more, the signals (0.9 MB each at N = 649) leave the cache."""

MIN_INDEPENDENCE = 1e-16
"""A column of which the others leave no larger part (of its squared length) counts as their combination: at
1e-16 its coefficient keeps eight digits, at 1e-32 none. Days of the sample year leave 3e-7 or more."""

DIRECT_PARAMETERS = ("alpha_i", "alpha_o")
"""theta of (12): K_i T_s / A and K_o T_s / A [m per m3/s]."""

INDIRECT_PARAMETERS = ("K_h alpha_o + 1", "-K_Q alpha_o", "alpha_i")
"""theta of (14): [-], then [m per m3/s] twice."""


class WithReason:
    """Base of results with a reason where a day has no delay."""

    reason: Strings

    @property
    def identifiable(self) -> NDArray[np.bool_]:
        """Whether there is a delay, shape (days,)."""
        return np.asarray(self.reason == "")

    @property
    def status(self) -> Strings:
        """ "ok" or "unidentifiable", shape (days,)."""
        return np.where(self.identifiable, "ok", "unidentifiable")


@dataclass(frozen=True)
class SearchResult(WithReason):
    """Delay of each day by exhaustive search, the smallest of equals; no axis of days for a single day.

    A day is identifiable where (13) or (15) has one solution for every candidate.
    """

    delay: Floats  # d [samples]: the inflow first acts at lag d + 1; NaN where not identifiable, (days,)
    reason: Strings  # why there is no delay; empty where there is one, (days,)
    candidates: Ints  # the delays tried [samples], (K,)
    criterion: Floats  # J of (11) [m2] or of (14) [m2: the filter is a plain sum], (days, K)
    parameters: Floats  # theta at the delay that was found, in the order of `names`, (days, P)
    names: tuple[str, ...]  # :data:`DIRECT_PARAMETERS` or :data:`INDIRECT_PARAMETERS`
    noise_variance: Floats  # mean square of the residual v at that delay, 2 J [m2], (days,)


def direct(
    inflow: ArrayLike, outflow: ArrayLike, level: ArrayLike, settings: SearchSettings | None = None,
    **changes: Any,
) -> SearchResult:  # fmt: skip
    """The direct approach: the reach (8) fitted as if its outflow did not depend on the level.

    ``h_L[k] = alpha_i u_Qi^f[k-1-d] - alpha_o u_Qo^f[k-1] + v[k]``, where f is the integrator filter
    ``x^f[k] = x^f[k-1] + x[k]``.

    The series, all (N,) or (days, N), are u_Qi and u_Qo [m3/s] and h_L [m]. The bounds of d are the paper's,
    1 and 15, by default; ``direct(u, o, h, d_max=20)`` changes single ones. RividError for shapes that do not
    fit, values that are not finite, or too few samples for the longest delay.

    Source: (8), (11)-(13), Table IV. Readings where the paper leaves a choice:

    - Delta x is x less the day's first sample, and zero before it ("initial condition and stationary point",
      Table III). What is out of balance at the first sample, and the gauge's error in it, so stay in v. The
      filter starts from zero there.
    - All N rows count for every candidate, as in the sums of (11); all candidates fit the same samples.
    - theta may have any sign and size: a delay at d_min or d_max may lie beyond.
    - A day is not identifiable if (13) is singular for any candidate, since then not all of D is compared.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> u, o = np.cumsum(rng.normal(size=(2, 300)), axis=1)
    >>> late = np.r_[np.zeros(8), np.cumsum(u - u[0])[:-8]]
    >>> h = 2e-4 * (late - np.r_[0.0, np.cumsum(o - o[0])[:-1]])
    >>> found = direct(u, o, h)
    >>> found.delay, found.parameters.round(9).tolist()
    (np.float64(7.0), [0.0002, 0.0002])
    """
    s = (settings or SearchSettings()).changed(changes)
    series = {"inflow": inflow, "outflow": outflow, "level": level}
    days, single = as_days(series, s.d_max + 2 + len(DIRECT_PARAMETERS), f"d_max = {s.d_max}")
    u, o, h = (values - values[:, :1] for values in days)
    moving = {"level": h, "inflow": u, "outflow": o}
    found = _search(h, [-np.cumsum(o, axis=1)], moving, DIRECT_PARAMETERS, s)
    found = replace(found, parameters=found.parameters[:, ::-1].copy())  # in the order of (12)
    return only_day(found) if single else found


def indirect(
    inflow: ArrayLike, level: ArrayLike, settings: SearchSettings | None = None, **changes: Any
) -> SearchResult:
    """The indirect approach: reach and operators together (10), from the inflow to the level.

    ``h_L^f[k] = (K_h alpha_o + 1) h_L^f[k-1] - K_Q alpha_o u_Qi^f[k-1] + alpha_i u_Qi^f[k-d-1] + v[k]``: (10)
    divided by ``1 - q^-1``, so that what is left over is v itself. The arguments are as for :func:`direct`.

    Source: (10), (14)-(15), Table IV, with the readings of :func:`direct`. The level enters both sides, so a
    noisy gauge biases theta; the paper fits it all the same. K_h, K_Q and alpha_o cannot be separated.
    """
    s = (settings or SearchSettings()).changed(changes)
    series = {"inflow": inflow, "level": level}
    days, single = as_days(series, s.d_max + 2 + len(INDIRECT_PARAMETERS), f"d_max = {s.d_max}")
    u, h = (values - values[:, :1] for values in days)
    h_f, moving = np.cumsum(h, axis=1), {"level": h, "inflow": u}
    found = _search(h_f, [h_f, np.cumsum(u, axis=1)], moving, INDIRECT_PARAMETERS, s)
    return only_day(found) if single else found


def _search(
    target: Floats, shared: list[Floats], moving: dict[str, Floats], names: tuple[str, ...], s: SearchSettings
) -> SearchResult:
    """Table IV for (days, N): columns `shared` at lag 1, then the filtered u at lag d + 1, and so theta.

    `moving` holds the signals that must move, by name; of its "inflow", u, the candidates' columns are made.
    """
    u = moving["inflow"]
    n, candidates = len(u), np.arange(s.d_min, s.d_max + 1)
    J, theta = np.empty((n, len(candidates))), np.empty((n, len(candidates), len(names)))
    least = np.empty(n)
    signals = [target, *shared, np.cumsum(u, axis=1)]  # x^f = x / (1 - q^-1)
    for days, take in blocks(n, BLOCK):
        of_block = _fit([x[take].T.copy() for x in signals], candidates)
        J[days], theta[days], least[days] = (x[..., : days.stop - days.start].T for x in of_block)
    last = s.d_max + 1
    why = [(~x.any(axis=1), f"the {name} never moves") for name, x in moving.items()]
    why += [
        (~u[:, :-last].any(axis=1), f"the inflow moves in the last d_max + 1 = {last} samples only"),
        (~(least > MIN_INDEPENDENCE), "the regression's columns move as one: no unique solution"),
    ]
    reason = np.select([mask for mask, _ in why], [words for _, words in why], "")
    bad = reason != ""
    J[bad], theta[bad] = np.nan, np.nan
    best = np.where(bad, 0, np.argmin(J, axis=1))
    every = np.arange(n)
    return SearchResult(
        delay=np.where(bad, np.nan, candidates[best]), reason=reason, candidates=candidates, criterion=J,
        parameters=theta[every, best], names=names, noise_variance=2 * J[every, best],
    )  # fmt: skip


def _fit(signals: list[Floats], candidates: Ints) -> tuple[Floats, Floats, Floats]:
    """(13) or (15) and J for every candidate, by modified Gram-Schmidt; the signals are (N, lanes).

    Gives J (K, lanes), theta (P, K, lanes), and the least part of a column that those before it leave.
    """
    target, *shared, u_f = signals
    (N, n_lanes), P = target.shape, len(shared) + 1
    J, theta = np.empty((len(candidates), n_lanes)), np.empty((P, len(candidates), n_lanes))
    least = np.ones(n_lanes)
    with np.errstate(invalid="ignore", divide="ignore"):  # columns that never move
        basis: list[Floats] = []
        R = np.zeros((P, P, n_lanes))  # column j is what is left of it, plus the basis times R[:, j]
        for j, x in enumerate(shared):
            column = _lagged(x, 1)
            R[:j, j], rest = _project(column, basis)
            least = np.minimum(least, _dot(rest, rest) / _dot(column, column))
            basis.append(rest)
        on_basis, left = _project(target, basis)
        for i, d in enumerate(candidates):
            column = _lagged(u_f, d + 1)
            R[:-1, -1], rest = _project(column, basis)
            length = _dot(rest, rest)
            least = np.minimum(least, length / _dot(column, column))
            theta[:-1, i], theta[-1, i] = on_basis, _dot(rest, left) / length
            v = left - theta[-1, i] * rest
            J[i] = 0.5 * _dot(v, v) / N
            for j in range(P - 1, 0, -1):
                theta[:j, i] -= R[:j, j] * theta[j, i]
    return J, theta, least


def _lagged(x: Floats, lag: int) -> Floats:
    """``x[k - lag]``, zero before the first sample, shape (N, lanes)."""
    late = np.zeros(x.shape)
    late[lag:] = x[:-lag]
    return late


def _dot(a: Floats, b: Floats) -> Floats:
    """Inner product of each lane."""
    return np.asarray(np.einsum("nb,nb->b", a, b))


def _project(column: Floats, basis: list[Floats]) -> tuple[Floats, Floats]:
    """Coefficients of the column on the orthogonal basis, and what the basis leaves of it."""
    rest = column.copy()
    on = np.empty((len(basis), column.shape[1]))
    for j, direction in enumerate(basis):
        on[j] = _dot(direction, rest) / _dot(direction, direction)
        rest -= on[j] * direction
    return on, rest
