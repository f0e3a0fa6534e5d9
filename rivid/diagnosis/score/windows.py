"""Scores of a candidate in every window of dates and hours, and the variance by which they compare."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.score.base import FEWEST_BLOCKS, Base, used_columns
from rivid.diagnosis.score.types import Candidate
from rivid.errors import RividError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

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
