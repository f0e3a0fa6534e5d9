"""The score test: p-values of candidate effects in what the fitted model leaves, windows searched.

All arrays are whitened. With nuisance columns X projected out of residual r and column z,

    r~ = r - X b,   z~ = z - X G^-1 X'z,   G = X'X,   b = G^-1 X'r,

block b of days has the score s_b = z~_b' r~_b, and the statistic is s' V^-1 s with s = sum s_b. V is one part
sum s_b s_b', the observed scatter of blocks, and four parts its expectation under white noise. p-values come
from flipping the blocks' signs, the same flips for every candidate and window, maximum over all of them: V
does not change with the flips, so p is valid whatever V is, and dependence between candidates is allowed for
(sign-flipping of effective scores: Hemerik, Goeman and Finos, JRSS B 82, 2020). V only sets how candidates
compare: with the few blocks alone V is small by chance in some of thousands of windows (a column found at
1 % in 84 of 100 sets was then missed in all), with white noise alone one misfit hides the others.

The projection removes a share M_b = z~_b' H_bb z~_b of the variance of s_b, H the projection on X, and none
of the variance of s: the data's s is scaled to the variance of the flips (De Santis and others, 2022).

A window is part of the candidate: z from a date on, up to a date, between two, or in some hours of the day.
Scores, G and z'z are sums over days, so that cumulative sums give every window at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.effects import Dates
from rivid.errors import RividError
from rivid.types import Floats, Ints

FEWEST_BLOCKS = 4
"""A window counts if it holds days of this many blocks."""
LEAST_LEFT = 0.02
"""A window counts if the nuisance columns leave this share of its information, in every direction."""
MODEL_SHARE = 0.8
"""Share of white noise in V."""
MOST_EDGES = 60
"""Dates at which a window may begin or end: every day up to that many, then every second, ..."""
MOST_WINDOWS = 20_000
"""Windows of one candidate: with hours, fewer dates are tried."""
CHUNK = 500_000
"""Numbers in one block of flipped scores: 4 MB stay in the processor's cache."""
FLIPS = 4_999
"""Sign flips: the smallest p is 1 / 5,000."""


@dataclass(frozen=True)
class Candidate:
    """An effect to test."""

    name: str
    columns: ArrayLike  # (k, days, n): whitened columns: the residual's change for one unit of each parameter
    dates: Dates = "all"  # windows of whole days to scan
    # Whether the k columns are parts of the day, of which a contiguous run acts with one size.
    hours: bool = False
    sign: int = 0  # sign of its one parameter; 0: any


def scan(
    residual: ArrayLike,
    nuisance: ArrayLike,
    candidates: Sequence[Candidate],
    *,
    blocks: ArrayLike,
    weights: ArrayLike | None = None,
    flips: int = FLIPS,
    seed: int = 0,
) -> Floats:
    """Family-wise p of each candidate, shape (candidates,): all candidates and their windows searched.

    Parameters
    ----------
    residual : array_like, shape (days, n)
        Whitened residual.
    nuisance : array_like, shape (p, days, n)
        Whitened columns of what is fitted in any case; p may be 0.
    candidates : sequence of Candidate
    blocks : array_like of int, shape (days,)
        Which days flip together: see :func:`rivid.diagnosis.blocks.flip_blocks`.
    weights : array_like, shape (days,), optional
        Weights of days; 0 leaves a day out. Default: 1.
    flips, seed : int
        Number of sign flips, and the seed of their generator.

    Returns
    -------
    ndarray, shape (candidates,)
        1 where no window can be separated from the nuisance columns.

    Raises
    ------
    RividError
        Where shapes do not fit, numbers are missing, or fewer than four blocks are used.
    """
    base = _base(residual, nuisance, blocks, weights)
    signs = np.random.default_rng(seed).choice(np.array([-1.0, 1.0]), (flips, len(base.e)))
    seen, chance = np.empty(len(candidates)), np.empty((len(candidates), flips))
    for i, candidate in enumerate(candidates):
        scores, shrink = _windows(base, candidate)
        observed = _statistic(np.einsum("wij,wj->wi", shrink, scores.sum(1)), candidate.sign)
        seen[i] = _surprise(observed.max(initial=0.0), scores.shape[2])
        chance[i] = _surprise(_flipped(scores, signs, candidate.sign), scores.shape[2])
    family = chance.max(0, initial=0.0)
    return np.array([(1 + (family >= one * (1.0 - 1e-9)).sum()) / (1 + flips) for one in seen])


class _Base(NamedTuple):
    """Residual and nuisance of the used days: columns times the root of the days' weights."""

    r: Floats  # (days, n), nuisance projected out
    X: Floats  # (p, days, n), orthonormal over all days
    root: Floats  # (all days,) root of the weights
    day: Ints  # which days are used
    block: Ints  # 0, 1, ... of each used day
    e: Floats  # (blocks, p) X'r~ of each block
    H: Floats  # (blocks, p, p) X'X of each block
    white: float  # mean square of r: 1, were the noise model right


def _base(residual: ArrayLike, nuisance: ArrayLike, blocks: ArrayLike, weights: ArrayLike | None) -> _Base:
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
        _used(r[None], day, root, "the residual")[0],
        _used(X, day, root, "a nuisance column"),
    )
    size = np.sqrt((X * X).sum((1, 2)))
    X = X[size > 0.0] / size[size > 0.0, None, None]
    value, vector = np.linalg.eigh(np.einsum("pdn,qdn->pq", X, X, optimize=True))
    solid = value > 1e-10  # columns that are the same count once
    X = np.tensordot((vector[:, solid] / np.sqrt(value[solid])).T, X, 1)
    r = r - np.tensordot(np.tensordot(X, r, 2), X, 1)
    per_day = X.transpose(1, 0, 2)
    e = _by_block(per_day @ r[:, :, None], block, many)[..., 0]
    H = _by_block(per_day @ per_day.transpose(0, 2, 1), block, many)
    return _Base(r, X, root, day, block, e, H, float((r * r).sum() / np.count_nonzero(r)))


def _used(columns: Floats, day: Ints, root: Floats, what: str) -> Floats:
    """Columns (k, days, n) on the used days, times the root of their weights."""
    picked = columns[:, day] * root[day, None]
    if not np.isfinite(picked).all():
        raise RividError(
            f"{what} is not finite on a day with weight: whiten it first, or give the day weight 0"
        )
    return np.asarray(picked, float)


def _by_block(per_day: Floats, block: Ints, many: int) -> Floats:
    """Sums over the days of each of many blocks: (days, ...) to (many, ...)."""
    out = np.zeros((many, *per_day.shape[1:]))
    np.add.at(out, block, per_day)
    return out


def _sums(base: _Base, candidate: Candidate) -> tuple[Floats, Floats, Floats, Ints]:
    """Sums of a candidate's days up to each of E edges: z'r~, X'z, z'z (E, blocks, ...), days (E, blocks)."""
    z = np.asarray(candidate.columns, float)
    shape = (len(base.root), base.r.shape[1])
    if z.ndim != 3 or z.shape[1:] != shape:
        raise RividError(
            f"columns of {candidate.name} have shape {z.shape}: expected (k, {shape[0]}, {shape[1]})"
        )
    if candidate.sign and len(z) > 1 and not candidate.hours:
        raise RividError(f"{candidate.name} has a sign and {len(z)} columns: a sign needs one parameter")
    z = _used(z, base.day, base.root, f"a column of {candidate.name}").transpose(1, 0, 2)
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
    return (
        up_to((z @ base.r[:, :, None])[..., 0]),
        up_to(base.X.transpose(1, 0, 2) @ turned),
        up_to(z @ turned),
        up_to(np.ones(days)).round().astype(np.int64),
    )


def _windows(base: _Base, candidate: Candidate) -> tuple[Floats, Floats]:
    """Scores (windows, blocks, k) of the windows that count, with V = 1, and factors (windows, k, k)."""
    v, c, q, days = _sums(base, candidate)
    k, last = v.shape[2], len(days) - 1
    pairs = {
        "all": [(0, last)],
        "from": [(i, last) for i in range(last)],
        "until": [(0, j) for j in range(1, last + 1)],
        "between": [(i, j) for i in range(last) for j in range(i + 1, last + 1)],
    }[candidate.dates]
    first, end = np.array(pairs).T
    enough = ((days[end] > days[first]).sum(1)) >= FEWEST_BLOCKS + (0 if candidate.hours else k - 1)
    first, end = first[enough], end[enough]
    v, c, q = (a[end] - a[first] for a in (v, c, q))
    runs = [(0, k)]
    if candidate.hours:
        runs = [(i, j) for i in range(k) for j in range(i + 1, k + 1)]
        v, c, q = _up_to(v), _up_to(c), _up_to(_up_to(q))
    found = []
    for h0, h1 in runs:
        if candidate.hours:
            part = q[h1, h1] - q[h0, h1] - q[h1, h0] + q[h0, h0]
            run = (v[h1] - v[h0])[..., None], (c[h1] - c[h0])[..., None], part[..., None, None]
            found.append(_standard(base, *run))
        else:
            found.append(_standard(base, v, c, q))
    scores, shrink = zip(*found, strict=True)
    return np.concatenate(scores), np.concatenate(shrink)


def _up_to(parts: Floats) -> Floats:
    """Sums over the first parts of the day, (..., k) to (k + 1, ...)."""
    sums = np.zeros((parts.shape[-1] + 1, *parts.shape[:-1]))
    np.cumsum(np.moveaxis(parts, -1, 0), axis=0, out=sums[1:])
    return sums


def _standard(base: _Base, v: Floats, c: Floats, q: Floats) -> tuple[Floats, Floats]:
    """Scores with V = 1 and the data's shrinkage, of the windows that count."""
    C = c.sum(1)  # (windows, p, k)
    raw = q.sum(1)
    Q = raw - np.einsum("wpk,wpl->wkl", C, C)
    s = v - np.einsum("bp,wpk->wbk", base.e, C)
    a = c - np.tensordot(C, base.H, (1, 2)).transpose(0, 2, 3, 1)  # c - H C of each window and block
    kept = Q - np.einsum("wbpk,wbpl->wkl", a, a)  # E[sum s_b s_b'], where E[s s'] = Q
    shown = np.einsum("wbk,wbl->wkl", s, s)
    V = MODEL_SHARE * base.white * kept + (1.0 - MODEL_SHARE) * shown
    good = (_least_share(Q, raw) > LEAST_LEFT) & (_least_share(kept, Q) > LEAST_LEFT)
    L, q_root, kept_root = (np.linalg.cholesky(m[good]) for m in (V, Q, kept))
    inverse = np.linalg.inv(L)
    shrink = inverse @ kept_root @ np.linalg.inv(q_root) @ L
    return np.einsum("wkl,wbl->wbk", inverse, s[good]), shrink


def _least_share(part: Floats, whole: Floats) -> Floats:
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


def _statistic(sums: Floats, sign: int) -> Floats:
    """s'V^-1 s of sums of standard scores (..., k); 0 where the sign is wrong."""
    if sign:
        sums = np.maximum(sign * sums, 0.0)
    return np.asarray(np.einsum("...k,...k->...", sums, sums), float)


def _flipped(scores: Floats, signs: Floats, sign: int) -> Floats:
    """Largest statistic over the windows for each flip (flips,)."""
    most = np.zeros(len(signs))
    many, n_blocks, k = scores.shape
    step = max(1, CHUNK // (len(signs) * k))
    for i in range(0, many, step):
        t = scores[i : i + step]
        if k == 1:  # the largest square is that of the largest or of the smallest sum
            sums = t[:, :, 0] @ signs.T
            if sign >= 0:
                np.maximum(most, sums.max(0), out=most)
            if sign <= 0:
                np.maximum(most, -sums.min(0), out=most)
            continue
        sums = signs @ t.transpose(1, 0, 2).reshape(n_blocks, -1)
        most = np.maximum(most, _statistic(sums.reshape(len(signs), len(t), k), sign).max(1))
    return most * most if k == 1 else most


def _surprise(statistic: Floats, k: int) -> Floats:
    """-log of the chance of more by chi-square: one scale for candidates of different k, no more."""
    from scipy.special import gammaincc

    return np.asarray(-np.log(np.maximum(gammaincc(0.5 * k, 0.5 * statistic), 1e-300)), float)
