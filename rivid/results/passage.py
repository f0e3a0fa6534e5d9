"""t50 of a river over the record: the lag by which half of a step has arrived, and the flow."""

from dataclasses import dataclass

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.results.read import EstimatorResults, Results
from rivid.types import Bools

MOST = 0.8
"""The share of days that a range holds: four days in five."""

FEW = 9
"""With fewer days, no thirds and no range of four days in five."""

CLEAR = 0.7
"""t50 falls with the flow where a day of low flow has the longer t50 in this share of pairs of days."""


@dataclass(frozen=True)
class Thirds:
    """t50 by thirds of the mean inflow.

    Attributes
    ----------
    edges : tuple of float
        Mean inflows [m3/s]: lowest, end of the lower third, begin of the upper third, highest.
    medians : tuple of float
        Median t50 [samples] of the lower, middle and upper third.
    longer : float
        Share of pairs of a day of the lower and a day of the upper third in which the lower has the longer
        t50; 0.5 where the flow does not matter.
    """

    edges: tuple[float, float, float, float]
    medians: tuple[float, float, float]
    longer: float


@dataclass(frozen=True)
class Passage:
    """t50 over the record.

    Attributes
    ----------
    days, with_t50 : int
        Rows; those with a t50.
    median, low, high : float
        Median, and the range of four days in five (of all days, where they are few) [samples].
    thirds : Thirds or None
        None where too few days have a mean inflow, or all the same.
    bounded, between : int
        Days with both bounds (5), and those of them whose t50 lies between them.
    """

    days: int
    with_t50: int
    median: float
    low: float
    high: float
    thirds: Thirds | None
    bounded: int
    between: int


def has_t50(estimator: EstimatorResults) -> Bools:
    """Days with a t50, shape (n,)."""
    return np.isfinite(estimator.t50) & estimator.answered


def leading_response(results: Results) -> EstimatorResults | None:
    """Return the estimator with a t50 that has the highest rank, or else without; None in a pool."""
    if results.output_unit == "m":
        return None
    having = [e for e in results.estimators if e.dates]
    return max(having, key=lambda e: (has_t50(e).any(), ESTIMATORS[e.estimator].t50_rank), default=None)


def passage(results: Results, estimator: EstimatorResults) -> Passage:
    """Condense the t50 of one estimator; NaN where no day has one."""
    e, days = estimator, has_t50(estimator)
    t50 = e.t50[days]
    tails = (1 - MOST) / 2 if t50.size > FEW else 0.0
    low, median, high = (
        (float(q) for q in np.quantile(t50, (tails, 0.5, 1 - tails))) if t50.size else (np.nan,) * 3
    )
    seconds = e.t50 * results.sample_time
    bounded = days & np.isfinite(e.bound_gravity_s) & np.isfinite(e.bound_kinematic_s)
    inside = bounded & (seconds >= e.bound_gravity_s) & (seconds <= e.bound_kinematic_s)
    return Passage(
        days=len(e.dates),
        with_t50=int(days.sum()),
        median=median,
        low=low,
        high=high,
        thirds=thirds(e),
        bounded=int(bounded.sum()),
        between=int(inside.sum()),
    )


def thirds(estimator: EstimatorResults) -> Thirds | None:
    """t50 by thirds of the mean inflow of the days that have both."""
    e = estimator
    days = has_t50(e) & np.isfinite(e.mean_inflow)
    Q, t50 = e.mean_inflow[days], e.t50[days]
    if Q.size < FEW or Q.min() == Q.max():
        return None
    edges = np.quantile(Q, (0, 1 / 3, 2 / 3, 1))
    third = np.searchsorted(edges[1:3], Q)
    parts = [t50[third == k] for k in range(3)]
    if min(part.size for part in parts) < FEW // 3:
        return None
    lower, upper = parts[0], np.sort(parts[2])
    # Mann and Whitney's count of pairs, equal ones by halves
    shorter = np.searchsorted(upper, lower, "left") + np.searchsorted(upper, lower, "right")
    first, second, third_, last = (float(q) for q in edges)
    low, middle, high = (float(np.median(part)) for part in parts)
    return Thirds((first, second, third_, last), (low, middle, high), float(shorter.mean() / 2 / upper.size))
