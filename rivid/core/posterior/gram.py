"""Sums of products that every equation of the posterior shares, once for each day and kind of noise."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rivid.core.posterior.noise import prewhiten

Floats = NDArray[np.float64]

Y_LAGS = 2
O_LAGS = 2


def columns(with_outflow: bool) -> tuple[str, ...]:
    """Names of the leading columns of :func:`gram`: constant, outflow's lags, the level's, its value now."""
    outflow = [f"o{k}" for k in range(1, O_LAGS + 1)] if with_outflow else []
    return ("one", *outflow, *(f"y{k}" for k in range(1, Y_LAGS + 1)), "y0")


def gram(u: Floats, y: Floats, o: Floats | None, polynomials: Floats, n_lags: int) -> tuple[Floats, int]:
    """Gram matrices of the regressors, prewhitened by each kind of noise.

    Parameters
    ----------
    u, y : ndarray, shape (days, N)
        Deviations from the day's first sample.
    o : ndarray, shape (days, N), or None
        The same of the outflow, where it is logged.
    polynomials : ndarray, shape (kinds, 3)
        C of each kind of noise.
    n_lags : int
        Lags 1 to `n_lags` of u count.

    Returns
    -------
    G : ndarray, shape (K, K, kinds, days)
        Columns as :func:`columns` names them, then u's lags 1 to `n_lags`.
    n_rows : int
        Rows that count, N - n_lags: those for which every lag lies in the day.

    Notes
    -----
    Products run over the leading columns and u's first lag only. Lags of u among themselves follow from it:
    ``G[i+1, j+1]`` is ``G[i, j]`` with what enters at one end, less what leaves at the other.
    """
    days, N = u.shape
    series = np.stack([y, u] if o is None else [y, u, o], axis=1)
    white = prewhiten(series, polynomials)
    one = prewhiten(np.ones((1, 1, N)), polynomials)[0, :, 0]
    n = N - n_lags
    names = columns(o is not None)
    lead = len(names)
    rows = np.empty((days, len(polynomials), lead + 1, lead + n_lags))
    inflow = white[:, :, 1]
    windows = sliding_window_view(inflow[..., : N - 1], n, axis=-1)[:, :, ::-1]  # row r holds lag r + 1
    X = np.empty((lead + n_lags, n))  # of one day and kind at a time: it stays near the processor
    for day in range(days):
        for kind in range(len(polynomials)):
            for i, name in enumerate(names):
                if name == "one":
                    X[i] = one[kind, n_lags:]
                else:
                    k = int(name[1:])
                    X[i] = white[day, kind, 0 if name[0] == "y" else 2, n_lags - k : N - k]
            X[lead:] = windows[day, kind]
            np.matmul(X[: lead + 1], X.T, out=rows[day, kind])
    G = np.empty((lead + n_lags, lead + n_lags, len(polynomials), days))
    G[: lead + 1] = np.moveaxis(rows, (0, 1), (3, 2))
    G[lead + 1 :, : lead + 1] = G[: lead + 1, lead + 1 :].swapaxes(0, 1)
    enter = np.moveaxis(inflow[..., n_lags - 1 :: -1], (0, 1), (2, 1))  # what lag i + 1 reaches back to
    leave = np.moveaxis(inflow[..., N - 2 : N - n_lags - 2 : -1], (0, 1), (2, 1))
    enter, leave = np.ascontiguousarray(enter), np.ascontiguousarray(leave)
    for i in range(n_lags - 1):
        row = G[lead + i, lead + i : -1] + enter[i + 1] * enter[i + 1 :] - leave[i] * leave[i:-1]
        G[lead + i + 1, lead + i + 1 :] = row
        G[lead + i + 1 :, lead + i + 1] = row
    return G, n
