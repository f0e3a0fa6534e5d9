"""Small dense linear algebra for many days at once, with the day as the last axis.

Every operation is elementwise over the last axis ("lanes", one day each), in an order that depends on
the sizes M and N only. So a day's bits do not depend on its neighbours, which batched LAPACK and FFT
calls do not promise, and one numpy call does a step for all days. The number of lanes is padded to a
multiple of :data:`LANE_MULTIPLE`, whole SIMD registers, so that no lane is the ragged end of a vector.
All arrays are C-contiguous: einsum picks its loops, and with them its roundings, by the layout.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.errors import RividError
from rivid.types import Floats

LANE_MULTIPLE = 16
"""Lanes come in multiples of this: two registers of eight doubles."""

BLOCK = 176
"""Most lanes in one block: its Gram matrices (1.3 MB at M = 30) stay in the second-level cache."""


def as_days(
    series: Mapping[str, ArrayLike | None], least: int, why: str, *, row: str = "day", one: bool = True
) -> tuple[list[Floats], bool]:
    """Check series and return them as arrays of shape (days, N).

    Parameters
    ----------
    series : mapping of str to array_like, shape (N,) or (days, N), or None
        By the names they have in messages; None for a series that is missing.
    least : int
        Fewest samples.
    why : str
        What needs so many.
    row : str
        What a row is.
    one : bool
        Whether a single row of shape (N,) is accepted.

    Returns
    -------
    arrays : list of ndarray, shape (days, N)
    single : bool
        Whether the series had shape (N,).

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or too few samples.
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


def blocks(n_days: int) -> Iterator[tuple[slice, NDArray[np.intp]]]:
    """Cut days into blocks of lanes.

    Yields the days of each block, and which day each of its lanes holds, shape (lanes,); padding lanes repeat
    the block's last day.
    """
    for first in range(0, n_days, BLOCK):
        last = min(first + BLOCK, n_days)
        yield slice(first, last), padded(np.arange(first, last))


def padded(take: NDArray[np.intp]) -> NDArray[np.intp]:
    """The indices, the last one repeated up to a multiple of :data:`LANE_MULTIPLE`."""
    missing = -len(take) % LANE_MULTIPLE
    return np.concatenate([take, np.full(missing, take[-1])])


def gram(u: Floats, y: Floats, order: int, free_start: bool = False) -> tuple[Floats, Floats, Floats, int]:
    """U'U (M, M, lanes), U'y (M, lanes) and y'y (lanes,) of the Toeplitz matrix U of (16), and its rows.

    u and y have shape (N, lanes), M = `order` <= N. U'U is Toeplitz up to a low-rank correction: ``G[i+1,
    j+1] = G[i, j] - u[N-1-i] u[N-1-j]``, so only its first row is a sum over the samples.

    With `free_start` False, u is zero before the first sample, as in (16), and N rows count. True: it is
    unknown. Then only the N - M + 1 rows with all M samples of u count, and a constant is fitted as well
    (rows and output less their means).
    """
    N, lanes = u.shape
    M = order
    first = M - 1 if free_start else 0
    G = np.empty((M, M, lanes))
    b = np.empty((M, lanes))
    for k in range(M):
        row = max(k, first)
        np.einsum("nb,nb->b", u[row:], u[row - k : N - k], out=G[0, k])
        np.einsum("nb,nb->b", y[row:], u[row - k : N - k], out=b[k])
    G[1:, 0] = G[0, 1:]
    tail = u[N - M :][::-1]  # u[N-1-i], i = 0..M-1
    for i in range(M - 1):
        np.multiply(tail[i], tail[: M - 1], out=G[i + 1, 1:])
        np.subtract(G[i, :-1], G[i + 1, 1:], out=G[i + 1, 1:])
        if free_start:  # the row that enters above as the last one leaves below
            G[i + 1, 1:] += u[M - 2 - i] * u[M - 2 :: -1]
    yy = np.einsum("nb,nb->b", y, y)
    n_rows = N - first
    if free_start:
        y = y[first:]
        sums = np.stack([np.einsum("nb->b", u[first - i : N - i]) for i in range(M)])
        total = np.einsum("nb->b", y)
        G -= sums[:, None] * sums / n_rows
        b -= sums * total / n_rows
        raw = np.einsum("nb,nb->b", y, y)
        yy = raw - total * total / n_rows
        yy[yy <= 1e-14 * raw] = 0.0  # a constant, to rounding
    return G, b, yy, n_rows


def cholesky(A: Floats, rhs: Floats, unit: Floats | None = None) -> tuple[Floats, Floats, Floats]:
    """Cholesky factor of A and the forward-substituted right-hand sides, in one sweep.

    Of A (M, M, lanes) the upper triangle is read; `rhs` has shape (M, lanes). `unit` (R, M) holds right-hand
    sides that all lanes share, as rows, with no fewer leading zeros from row to row: what stays zero is not
    worked on.

    Returns R (M, M, lanes) with ``A = R'R``, meaningless below the diagonal; ``R'^-1 rhs`` (M, lanes); and
    ``R'^-1 unit'`` (M, R, lanes). A lane that is not positive definite becomes NaN.
    """
    M, _, lanes = A.shape
    shared = np.empty((0, M)) if unit is None else unit
    starts = [int(np.flatnonzero(row)[0]) if row.any() else M for row in shared]
    first = starts[0] if starts else M
    W = np.empty((M, M + 1, lanes))  # row j: R[j, j:], then z[j]
    V = np.zeros((M, len(shared), lanes))
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(M):
            row = W[j, j:]
            row[:-1], row[-1] = A[j, j:], rhs[j]
            if j:
                row -= np.einsum("kib,kb->ib", W[:j, j:], W[:j, j])
            root = np.sqrt(row[0])
            row /= root
            if j >= first:
                begun = V[j, : bisect_right(starts, j)]
                begun[:] = shared[: len(begun), j, None]
                if j > first:
                    begun -= np.einsum("kib,kb->ib", V[first:j, : len(begun)], W[first:j, j])
                begun /= root
    return W[:, :M], W[:, M], V


def back_substitute(R: Floats, v: Floats) -> Floats:
    """Solve ``R h = v`` with R (M, M, lanes) of :func:`cholesky` and v (M, lanes)."""
    M = len(v)
    h = np.empty(v.shape)  # C order for any v: einsum's order of summation follows the layout
    for j in range(M - 1, -1, -1):
        h[j] = v[j]
        if j < M - 1:
            h[j] -= np.einsum("ib,ib->b", R[j, j + 1 :], h[j + 1 :])
        h[j] /= R[j, j]
    return h


def condition_numbers(G: Floats) -> Floats:
    """2-norm condition number of each symmetric matrix of G (M, M, lanes), shape (lanes,).

    Infinite where the smallest eigenvalue is not positive. LAPACK works one matrix after another here, so a
    lane does not depend on its neighbours.
    """
    eigenvalues = np.linalg.eigvalsh(np.ascontiguousarray(np.moveaxis(G, -1, 0)))
    low, high = eigenvalues[:, 0], eigenvalues[:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(low > 0, high / low, np.inf)
