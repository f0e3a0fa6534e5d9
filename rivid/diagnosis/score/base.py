"""What all candidates share: residual and nuisance columns of the used days, and their sums by block."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.errors import RividError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

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
