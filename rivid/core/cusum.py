"""Delay as a change in the mean of an FIR: CUSUM on the ML or MAP estimate (section VI).

The inflow first acts on the level at lag d + 1 (8), where the impulse response jumps upwards (Fig. 10).
Page's one-sided test adds up how far the coefficients lie above their mean before the change,

    g[k] = max(0, g[k-1] + (h[k] - mean) / sd - drift),

raises the alarm where g passes the threshold, and dates the change by the last lag at which g was zero.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rivid.core.fir import only_day
from rivid.core.search import WithReason
from rivid.core.settings import CusumSettings
from rivid.errors import RividError
from rivid.types import Floats, Strings

MAD_TO_SD = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation."""


@dataclass(frozen=True)
class CusumResult(WithReason):
    """The first upward change of each FIR, at lag d + 1; identifiable where d is from d_min to d_max."""

    delay: Floats  # d [samples]; NaN where the day is not identifiable, (days,)
    reason: Strings  # why there is no delay; empty where there is one, (days,)
    decision: Floats  # g at each lag [sd], not reset by the alarm; NaN without an FIR, (days, M)
    alarm: Floats  # first lag at which g passes the threshold; NaN where it does not, (days,)
    mean: Floats  # before the change, as used at the alarm or the last lag [output unit per m3/s], (days,)
    sd: Floats  # standard deviation of a coefficient, as used [output unit per m3/s], (days,)


def cusum(fir: ArrayLike, settings: CusumSettings | None = None, **changes: Any) -> CusumResult:
    """Find the delay in impulse responses that were estimated without one.

    `fir`, (M,) or (days, M), is h of :func:`rivid.core.fir.ml` or :func:`rivid.core.fir.map_fir` [output unit
    per m3/s]; a day with NaN has no FIR. `changes` are single settings, ``cusum(fir, drift=1.5)``. RividError
    for a shape that does not fit, or an FIR too short for d_max.

    Source: section VI, on Fig. 13 and 14. The test is E. S. Page, "Continuous inspection schemes",
    Biometrika 41 (1954), 100-115; the estimate of the change time is that of M. Basseville and I. V.
    Nikiforov, "Detection of abrupt changes" (1993), chapter 2. A smooth FIR (MAP) has no jump but a rise that
    begins before lag d + 1, so its change is dated imprecisely, as the paper warns. A day does not depend on
    the other days of the call.

    Examples
    --------
    >>> h = np.array([0.0, -5.0, -5.2, -4.9, -5.1, -5.0, -1.1, -0.9, -1.0, -1.2, -0.9])
    >>> found = cusum(h, d_max=7)
    >>> float(found.delay), float(found.alarm)
    (5.0, 6.0)
    """
    s = (settings or CusumSettings()).changed(changes)
    values = np.asarray(fir, float)
    if values.ndim not in (1, 2):
        raise RividError(f"the FIR has shape {values.shape}: expected (M,) or (days, M)")
    single, values = values.ndim == 1, np.atleast_2d(values)
    n, M = values.shape
    if s.d_max + 3 > M:
        raise RividError(f"d_max = {s.d_max} needs an FIR of order >= {s.d_max + 3}, got {M}: raise order")
    missing = ~np.isfinite(values).all(axis=1)
    h = np.where(missing[:, None], 0.0, values).T
    steps = np.diff(h[1:], axis=0)  # their median deviation is robust against the one jump
    scatter = MAD_TO_SD * np.median(np.abs(steps - np.median(steps, axis=0)), axis=0) / np.sqrt(2.0)
    sd = scatter if s.sd is None else np.full(n, s.sd)
    constant = ~missing & (sd == 0.0)
    mean = _means_before(h, s)
    with np.errstate(divide="ignore", invalid="ignore"):
        above = (h - mean) / sd - s.drift
    above[:, missing | constant] = np.nan

    g = np.zeros((M, n))
    zero = np.full(n, s.d_min)  # last lag at which g is zero
    onset, alarm = np.full(n, np.nan), np.full(n, np.nan)
    for k in range(s.d_min + 1, M):
        g[k] = np.maximum(0.0, g[k - 1] + above[k])
        zero[g[k] == 0.0] = k
        first = (g[k] > s.threshold) & np.isnan(alarm)
        onset[first], alarm[first] = zero[first], k
    g[:, missing | constant] = np.nan

    delay = onset if s.moment == "onset" else alarm - 1.0
    beyond = delay > s.d_max
    reason = np.select(
        [missing, constant, np.isnan(alarm), beyond],
        [
            "no FIR",
            "the FIR does not scatter from lag to lag: give sd",
            f"no change above the threshold of {s.threshold:g}",
            f"the first change is beyond d_max = {s.d_max}",
        ],
        "",
    )
    used = mean[np.where(np.isnan(alarm), M - 1, alarm).astype(np.intp), np.arange(n)]
    mean_used, sd = (np.where(missing, np.nan, values) for values in (used, sd))
    found = CusumResult(np.where(reason == "", delay, np.nan), reason, g.T.copy(), alarm, mean_used, sd)
    return only_day(found) if single else found


def _means_before(h: Floats, s: CusumSettings) -> Floats:
    """The mean before the change as each lag sees it, shape (M, days); lags 0 and 1 have and need none."""
    if s.mean is not None:
        return np.full(h.shape, s.mean)
    n_lags = np.minimum(np.arange(1, len(h) - 1), s.mean_lags or len(h))
    means = np.zeros(h.shape)
    means[2:] = np.cumsum(h[1:], axis=0)[n_lags - 1] / n_lags[:, None]
    return means
