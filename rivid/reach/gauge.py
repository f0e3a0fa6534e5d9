"""Compiled stilling well between the water and the gauge's reading; importing this module loads numba."""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from rivid.types import Floats


def stilled(time: Floats, level: Floats, lag: ArrayLike) -> Floats:
    """Level in a stilling well, ``lag d(well)/dt = level - well``, exact for straight lines between samples.

    For a lag much shorter than a sample it is ``level - lag d(level)/dt``, so that its derivative by the lag
    is right from 0 on. `time` has shape (..., n) [s], `level` (k, ..., n) or (..., n) [m], the result that of
    the level, NaN from the first NaN of a row on; each row starts with both levels equal. `lag`, broadcast to
    (..., n), is the time constant from each sample to the next [s]; 0 is no well.
    """
    lags = np.asarray(lag, float)
    if not lags.any():
        return level
    n = level.shape[-1]
    rows = np.ascontiguousarray(level, float).reshape(-1, time.size // n, n)
    well = np.empty(rows.shape)
    _fill(time.reshape(-1, n), rows, np.broadcast_to(lags, time.shape).reshape(-1, n), well)
    return well.reshape(level.shape)


# Compiled: the well's level depends on the sample before.
@njit(cache=True, error_model="numpy")
def _fill(time: Floats, level: Floats, lag: Floats, well: Floats) -> None:
    """Write the well's level (k, rows, n)."""
    columns, rows, n = level.shape
    keep, rest = np.empty(n), np.empty(n)
    for row in range(rows):
        for k in range(n - 1):
            dt, tau = time[row, k + 1] - time[row, k], lag[row, k]
            keep[k] = np.exp(-dt / tau) if tau > 0.0 else 0.0
            rest[k] = (1.0 - keep[k]) * tau / dt
        for column in range(columns):
            behind = 0.0  # well less water
            well[column, row, 0] = level[column, row, 0]
            for k in range(n - 1):
                rise = level[column, row, k + 1] - level[column, row, k]
                behind = keep[k] * behind - rest[k] * rise
                well[column, row, k + 1] = level[column, row, k + 1] + behind
