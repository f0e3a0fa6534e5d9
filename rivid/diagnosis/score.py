"""What the score test is asked, and what it says."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.effects import Dates
from rivid.errors import RividError
from rivid.types import Floats, Ints


@dataclass(frozen=True)
class Candidate:
    """An effect to test.

    Attributes
    ----------
    name : str
    columns : ndarray, shape (k, days, n)
        Whitened columns: the residual's change for one unit of each parameter.
    dates : {"all", "from", "until", "between"}
        Windows of days to scan; whole days always are.
    hours : bool
        Whether the k columns are the same thing in k parts of the day, of which a contiguous run acts with
        one size: k (k + 1) / 2 windows a day.
    sign : {-1, 0, 1}
        The only sign its one parameter can have; 0: any.
    """

    name: str
    columns: ArrayLike
    dates: Dates = "all"
    hours: bool = False
    sign: int = 0


@dataclass(frozen=True)
class Found:
    """What the score test says of one candidate at its best window.

    Attributes
    ----------
    name : str
    statistic : float
        s' V^-1 s; 0 where no window can be told from the nuisance columns.
    p_alone : float
        Chance of as much without any effect, its own windows searched.
    p_family : float
        The same, all candidates and all windows searched.
    days : (int, int)
        First and last day of the best window.
    hours : (int, int) or None
        First part of the day of the best window, and the one after its last.
    estimate, standard_error : ndarray, shape (k,)
        Of the parameters at the best window, in their units; (1,) for a run of hours. Right for a window
        fixed beforehand; the best of many windows exaggerates. The error is from the blocks' scatter.
    left : float
        Share of the column's information that the nuisance columns leave.
    """

    name: str
    statistic: float
    p_alone: float
    p_family: float
    days: tuple[int, int]
    hours: tuple[int, int] | None
    estimate: Floats
    standard_error: Floats
    left: float


@dataclass(frozen=True)
class Scan:
    """A whole library tested at once.

    Attributes
    ----------
    found : tuple of Found
        In the order of the candidates.
    p_value : float
        Of the whole library: the smallest p_family.
    n_blocks, n_flips, n_windows : int
        Blocks flipped, flips, and windows searched.
    """

    found: tuple[Found, ...]
    p_value: float
    n_blocks: int
    n_flips: int
    n_windows: int

    @property
    def ranked(self) -> tuple[Found, ...]:
        """The candidates, the least likely to be chance first."""
        return tuple(sorted(self.found, key=lambda f: (f.p_family, f.p_alone, -f.statistic)))


FEWEST_BLOCKS = 4
"""A window counts if it holds days of this many blocks."""


class Base(NamedTuple):
    """Residual and nuisance of the used days: columns times the root of the days' weights."""

    r: Floats  # (days, n), nuisance projected out
    X: Floats  # (p, days, n), orthonormal over all days
    root: Floats  # (all days,) root of the weights
    day: Ints  # which days are used
    block: Ints  # 0, 1, ... of each used day
    e: Floats  # (blocks, p) X'r~ of each block
    H: Floats  # (blocks, p, p) X'X of each block
    white: float  # mean square of r: 1, were the noise model right


def base_of(residual: ArrayLike, nuisance: ArrayLike, blocks: ArrayLike, weights: ArrayLike | None) -> Base:
    """Project the nuisance columns out of the residual, and sum both by block; arguments as of the scan."""
    r, X = np.asarray(residual, float), np.asarray(nuisance, float)
    if r.ndim != 2 or X.ndim != 3 or X.shape[1:] != r.shape:
        raise RividError(
            f"residual has shape {r.shape}, nuisance {X.shape}: expected (days, n) and (p, days, n)"
        )
    label = np.asarray(blocks)
    weight = np.ones(len(r)) if weights is None else np.asarray(weights, float)
    if label.shape != (len(r),) or weight.shape != (len(r),):
        raise RividError(
            f"blocks have shape {label.shape}, weights {weight.shape}: expected ({len(r)},), one a day"
        )
    if not (weight >= 0.0).all():
        raise RividError("a weight is negative or NaN: expected 0 or more; give 0 to a day that is left out")
    day = np.flatnonzero(weight)
    root = np.sqrt(weight)
    block = np.unique(label[day], return_inverse=True)[1].astype(np.int64)
    many = int(block.max(initial=-1)) + 1
    if many < FEWEST_BLOCKS:
        raise RividError(f"{many} blocks of days: expected {FEWEST_BLOCKS} or more; shorten them or add days")
    r, X = (
        used_columns(r[None], day, root, "the residual")[0],
        used_columns(X, day, root, "a nuisance column"),
    )
    size = np.sqrt((X * X).sum((1, 2)))
    X = X[size > 0.0] / size[size > 0.0, None, None]
    value, vector = np.linalg.eigh(np.einsum("pdn,qdn->pq", X, X, optimize=True))
    solid = value > 1e-10  # columns that are the same count once
    X = np.tensordot((vector[:, solid] / np.sqrt(value[solid])).T, X, 1)
    r = r - np.tensordot(np.tensordot(X, r, 2), X, 1)
    per_day = X.transpose(1, 0, 2)
    e = by_block(per_day @ r[:, :, None], block, many)[..., 0]
    H = by_block(per_day @ per_day.transpose(0, 2, 1), block, many)
    return Base(r, X, root, day, block, e, H, float((r * r).sum() / np.count_nonzero(r)))


def used_columns(columns: Floats, day: Ints, root: Floats, what: str) -> Floats:
    """Columns (k, days, n) on the used days, times the root of their weights."""
    picked = columns[:, day] * root[day, None]
    if not np.isfinite(picked).all():
        raise RividError(
            f"{what} is not finite on a day with weight: whiten it first, or give the day weight 0"
        )
    return np.asarray(picked, float)


def by_block(per_day: Floats, block: Ints, many: int) -> Floats:
    """Sums over the days of each of many blocks: (days, ...) to (many, ...)."""
    out = np.zeros((many, *per_day.shape[1:]))
    np.add.at(out, block, per_day)
    return out


LEAST_LEFT = 0.02
"""A window counts if the nuisance columns leave this share of its information, in every direction."""

MODEL_SHARE = 0.8
"""How much of V is white noise."""

MOST_EDGES = 60
"""Dates at which a window may begin or end: every day up to that many, then every second, ..."""

MOST_WINDOWS = 20_000
"""Windows of one candidate: with hours, fewer dates are tried."""


class Windows(NamedTuple):
    """Scores of a candidate's windows that count."""

    scores: Floats  # (windows, blocks, k), V is the identity
    shrink: Floats  # (windows, k, k) takes the sum of scores to that of the data
    place: Ints  # (windows, 4) first and one-after-last used day and part of the day
    sign: int


class _Sums(NamedTuple):
    """Sums of a candidate's days up to each edge; E edges, the last one after the last day."""

    edges: Ints  # (E,)
    v: Floats  # (E, blocks, k) z'r~
    c: Floats  # (E, blocks, p, k) X'z
    q: Floats  # (E, blocks, k, k) z'z
    days: Ints  # (E, blocks) how many


def _sums(base: Base, candidate: Candidate) -> _Sums:
    z = np.asarray(candidate.columns, float)
    shape = (len(base.root), base.r.shape[1])
    if z.ndim != 3 or z.shape[1:] != shape:
        raise RividError(
            f"columns of {candidate.name} have shape {z.shape}: expected (k, {shape[0]}, {shape[1]})"
        )
    if candidate.sign and len(z) > 1 and not candidate.hours:
        raise RividError(f"{candidate.name} has a sign and {len(z)} columns: a sign needs one parameter")
    z = used_columns(z, base.day, base.root, f"a column of {candidate.name}").transpose(1, 0, 2)
    days, many = len(z), len(base.e)
    runs = len(z[0]) * (len(z[0]) + 1) // 2 if candidate.hours else 1
    most = MOST_WINDOWS // runs if candidate.dates != "between" else int(np.sqrt(2 * MOST_WINDOWS // runs))
    steps = 1 if candidate.dates == "all" else min(max(most, 2), MOST_EDGES, days)
    edges = np.unique(np.linspace(0, days, steps + 1).round().astype(np.int64))
    later = np.searchsorted(edges, np.arange(days), side="right")  # the first edge after the day

    def up_to(per_day: Floats) -> Floats:
        out = np.zeros((len(edges), many, *per_day.shape[1:]))
        np.add.at(out, (later, base.block), per_day)
        return np.asarray(out.cumsum(0), float)

    turned = z.transpose(0, 2, 1)
    return _Sums(
        edges,
        up_to((z @ base.r[:, :, None])[..., 0]),
        up_to(base.X.transpose(1, 0, 2) @ turned),
        up_to(z @ turned),
        up_to(np.ones(days)).round().astype(np.int64),
    )


def windows_of(base: Base, candidate: Candidate) -> Windows:
    """Scores of all windows of a candidate that count, scaled so that V is the identity."""
    sums = _sums(base, candidate)
    k = sums.v.shape[2]
    last = len(sums.edges) - 1
    pairs = {
        "all": [(0, last)],
        "from": [(i, last) for i in range(last)],
        "until": [(0, j) for j in range(1, last + 1)],
        "between": [(i, j) for i in range(last) for j in range(i + 1, last + 1)],
    }[candidate.dates]
    first, end = np.array(pairs).T
    enough = ((sums.days[end] > sums.days[first]).sum(1)) >= FEWEST_BLOCKS + (0 if candidate.hours else k - 1)
    first, end = first[enough], end[enough]
    v, c, q = (a[end] - a[first] for a in (sums.v, sums.c, sums.q))
    runs = [(0, k)]
    if candidate.hours:
        runs = [(i, j) for i in range(k) for j in range(i + 1, k + 1)]
        v, c, q = _up_to(v), _up_to(c), _up_to(_up_to(q))
    scores, shrink, place = [], [], []
    for h0, h1 in runs:
        if candidate.hours:
            part = q[h1, h1] - q[h0, h1] - q[h1, h0] + q[h0, h0]
            run = (v[h1] - v[h0])[..., None], (c[h1] - c[h0])[..., None], part[..., None, None]
            t, s, good = _standard(base, *run)
        else:
            t, s, good = _standard(base, v, c, q)
        scores.append(t)
        shrink.append(s)
        hours = np.broadcast_to([h0, h1], (int(good.sum()), 2))
        place.append(np.column_stack([sums.edges[first[good]], sums.edges[end[good]], hours]))
    return Windows(np.concatenate(scores), np.concatenate(shrink), np.concatenate(place), candidate.sign)


def _up_to(parts: Floats) -> Floats:
    """Sums over the first parts of the day, (..., k) to (k + 1, ...)."""
    sums = np.zeros((parts.shape[-1] + 1, *parts.shape[:-1]))
    np.cumsum(np.moveaxis(parts, -1, 0), axis=0, out=sums[1:])
    return sums


def _standard(base: Base, v: Floats, c: Floats, q: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Scores with V = 1 and the data's shrinkage, of the windows that count, and which those are."""
    C = c.sum(1)  # (windows, p, k)
    raw = q.sum(1)
    Q = raw - np.einsum("wpk,wpl->wkl", C, C)
    s = v - np.einsum("bp,wpk->wbk", base.e, C)
    a = c - np.tensordot(C, base.H, (1, 2)).transpose(0, 2, 3, 1)  # c - H C of each window and block
    kept = Q - np.einsum("wbpk,wbpl->wkl", a, a)  # E[sum s_b s_b'], where E[s s'] = Q
    shown = np.einsum("wbk,wbl->wkl", s, s)
    V = MODEL_SHARE * base.white * kept + (1.0 - MODEL_SHARE) * shown
    good = (least_share(Q, raw) > LEAST_LEFT) & (least_share(kept, Q) > LEAST_LEFT)
    L, q_root, kept_root = (np.linalg.cholesky(m[good]) for m in (V, Q, kept))
    inverse = np.linalg.inv(L)
    shrink = inverse @ kept_root @ np.linalg.inv(q_root) @ L
    return np.einsum("wkl,wbl->wbk", inverse, s[good]), shrink, good


def least_share(part: Floats, whole: Floats) -> Floats:
    """Smallest share of `part` in `whole` over all directions (windows,); 0 where there is none."""
    size = np.sqrt(np.maximum(np.einsum("wkk->wk", whole), 0.0))
    sound = (size > 0.0).all(1)
    scale = np.where(size > 0.0, size, 1.0)
    part, whole = (m / scale[:, :, None] / scale[:, None, :] for m in (part, whole))
    value, vector = np.linalg.eigh(whole)
    sound &= value[:, 0] > 1e-12
    root = vector / np.sqrt(np.maximum(value, 1e-12))[:, None, :]
    share = np.linalg.eigvalsh(root.transpose(0, 2, 1) @ part @ root)[:, 0]
    return np.where(sound, share, 0.0)


def found_at(
    base: Base,
    candidate: Candidate,
    statistic: float,
    w: Windows,
    top: int,
    p_alone: float,
    p_family: float,
) -> Found:
    """The candidate's estimate at its best window, with the error that the blocks' scatter gives."""
    z = used_columns(np.asarray(candidate.columns, float), base.day, base.root, candidate.name)
    first, end, h0, h1 = w.place[top] if top >= 0 else (0, len(base.day), 0, len(z))
    if candidate.hours:
        z = z[h0:h1].sum(0, keepdims=True)
    k, n_blocks = len(z), len(base.e)
    inside = (np.arange(len(base.day)) >= first) & (np.arange(len(base.day)) < end)
    z = z * inside[:, None]
    raw = np.einsum("kdn,ldn->kl", z, z)
    z = z - np.tensordot(np.tensordot(z, base.X, ((1, 2), (1, 2))), base.X, 1)
    Q = np.einsum("kdn,ldn->kl", z, z)
    left = float(max(least_share(Q[None], raw[None])[0], 0.0))
    hours = (int(h0), int(h1)) if candidate.hours else None
    days = int(base.day[first]), int(base.day[end - 1])
    if top < 0:
        nothing = np.full(k, np.nan)
        return Found(candidate.name, 0.0, p_alone, p_family, days, hours, nothing, nothing, left)
    estimate = np.linalg.solve(Q, np.tensordot(z, base.r, 2))
    rest = base.r - np.tensordot(estimate, z, 1)
    u = by_block(np.einsum("kdn,dn->dk", z, rest), base.block, n_blocks)
    inverse = np.linalg.inv(Q)
    covariance = inverse @ (u.T @ u) @ inverse * n_blocks / (n_blocks - k)
    return Found(
        candidate.name,
        statistic,
        p_alone,
        p_family,
        days,
        hours,
        estimate,
        np.sqrt(np.diag(covariance)),
        left,
    )


CHUNK = 500_000
"""Numbers in one block of flipped scores: 4 MB stay near the processor."""


def statistic_of(sums: Floats, sign: int) -> Floats:
    """s'V^-1 s of sums of standard scores (..., k); 0 where the sign is wrong."""
    if sign:
        sums = np.maximum(sign * sums, 0.0)
    return np.asarray(np.einsum("...k,...k->...", sums, sums), float)


def flipped(w: Windows, signs: Floats) -> Floats:
    """Largest statistic over the windows for each flip (flips,)."""
    most = np.zeros(len(signs))
    many, n_blocks, k = w.scores.shape
    step = max(1, CHUNK // (len(signs) * k))
    for i in range(0, many, step):
        t = w.scores[i : i + step]
        if k == 1:  # the largest square is that of the largest or of the smallest sum
            sums = t[:, :, 0] @ signs.T
            if w.sign >= 0:
                np.maximum(most, sums.max(0), out=most)
            if w.sign <= 0:
                np.maximum(most, -sums.min(0), out=most)
            continue
        sums = signs @ t.transpose(1, 0, 2).reshape(n_blocks, -1)
        most = np.maximum(most, statistic_of(sums.reshape(len(signs), len(t), k), w.sign).max(1))
    return most * most if k == 1 else most


def surprise(statistic: Floats, k: int) -> Floats:
    """-log of the chance of more by chi-square: one scale for candidates of different k, no more."""
    from scipy.special import gammaincc

    return np.asarray(-np.log(np.maximum(gammaincc(0.5 * k, 0.5 * statistic), 1e-300)), float)


def p_of(chance: Floats, seen: float) -> float:
    """Share of flips with at least as much, the data among them."""
    return float((1 + (chance >= seen * (1.0 - 1e-9)).sum()) / (1 + len(chance)))


FLIPS = 4_999
"""Sign flips: the smallest p is 1 / 5,000."""


def scan(
    residual: ArrayLike,
    nuisance: ArrayLike,
    candidates: Sequence[Candidate],
    *,
    blocks: ArrayLike,
    weights: ArrayLike | None = None,
    flips: int = FLIPS,
    seed: int = 0,
) -> Scan:
    """Test a library of candidates, windows included, with one family-wise p for all.

    Parameters
    ----------
    residual : array_like, shape (days, n)
        Whitened residual.
    nuisance : array_like, shape (p, days, n)
        Whitened columns of what is fitted anyway; p may be 0.
    candidates : sequence of Candidate
    blocks : array_like of int, shape (days,)
        Which days flip together: see :func:`rivid.diagnosis.blocks.flip_blocks`.
    weights : array_like, shape (days,), optional
        Weights of days; 0 leaves a day out. Default: 1.
    flips, seed : int
        How many sign flips, and the seed of their generator.

    Raises
    ------
    RividError
        Where shapes do not fit, numbers are missing, or fewer than four blocks are used.
    """
    base = base_of(residual, nuisance, blocks, weights)
    n_blocks = len(base.e)
    signs = np.random.default_rng(seed).choice(np.array([-1.0, 1.0]), (flips, n_blocks))
    best: list[tuple[float, Windows, int]] = []
    chance = np.empty((len(candidates), flips))
    for i, candidate in enumerate(candidates):
        w = windows_of(base, candidate)
        k = w.scores.shape[2]
        observed = statistic_of(np.einsum("wij,wj->wi", w.shrink, w.scores.sum(1)), w.sign)
        top = int(np.argmax(observed)) if len(observed) else -1
        best.append((float(observed[top]) if top >= 0 else 0.0, w, top))
        chance[i] = surprise(flipped(w, signs), k)
    seen = np.array([surprise(np.array([t]), w.scores.shape[2])[0] for t, w, _ in best])
    family = chance.max(0, initial=0.0)
    found = []
    for i, candidate in enumerate(candidates):
        statistic, w, top = best[i]
        p_alone = p_of(chance[i], seen[i])
        p_family = p_of(family, seen[i])
        found.append(found_at(base, candidate, statistic, w, top, p_alone, p_family))
    p_value = min((f.p_family for f in found), default=1.0)
    return Scan(tuple(found), p_value, n_blocks, flips, sum(len(w.place) for _, w, _ in best))
