"""Classes of days of an estimator, for figures and report."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.results.read import EstimatorResults, Results
from rivid.types import Bools, Floats


def estimates_delay(estimator: EstimatorResults) -> bool:
    """Whether an estimator answers with delays, even where no day has one."""
    return estimator.candidates.size > 0 or ESTIMATORS[estimator.estimator].has_delay


def candidates(estimator: EstimatorResults) -> Floats:
    """Candidate delays [samples], shape (K,); the estimated ones where the table has none."""
    if estimator.candidates.size:
        return estimator.candidates
    return np.unique(estimator.delay[found(estimator)])


def found(estimator: EstimatorResults) -> Bools:
    """Days with a delay, shape (n,)."""
    return ~np.isnan(estimator.delay) & estimator.answered


def decided(estimator: EstimatorResults) -> Bools:
    """Days with a delay that the data decide, shape (n,): neither prior_only nor degenerate by fault."""
    e = estimator
    degenerate = np.array(
        [s == "degenerate" and not ESTIMATORS[e.estimator].degenerates for s in e.status], bool
    )
    return np.asarray(found(e) & ~e.prior_only & ~degenerate)


def kinds(estimator: EstimatorResults) -> dict[str, Bools]:
    """Days of each reliability class, shape (n,); a day is in the most severe class that applies."""
    e, days = estimator, found(estimator)
    holds = {
        "data decide": days,
        "data do not decide": days & e.prior_only,
        "degenerate": days & np.array([s == "degenerate" for s in e.status], bool),
        "at a bound": days & e.at_bound,
    }
    taken = np.zeros(len(e.dates), bool)
    chosen = {}
    for name in reversed(holds):
        chosen[name] = holds[name] & ~taken
        taken |= chosen[name]
    return dict(reversed(chosen.items()))


def day_numbers(dates: Sequence[dt.date]) -> Floats:
    """Ordinal numbers of dates, shape (n,)."""
    return np.array([date.toordinal() for date in dates], float)


def rayleigh(delays: Floats, scale: float) -> Floats:
    """Rayleigh prior on the candidates, summing to one.

    Parameters
    ----------
    delays : ndarray, shape (K,)
        Candidates d [samples].
    scale : float
        sigma_d [samples].

    Returns
    -------
    ndarray, shape (K,)

    Notes
    -----
    Source: (26), lost in the paper's copy; its terms in (27) and (35) give it back.

    Examples
    --------
    >>> p = rayleigh(np.arange(1.0, 16.0), 6.5)
    >>> p[4:8].round(3), round(float(p.sum()), 6)
    (array([0.094, 0.099, 0.099, 0.094]), 1.0)
    """
    logs = np.log(delays) - delays**2 / (2 * scale**2)
    weights = np.exp(logs - logs.max())
    p: Floats = weights / weights.sum()
    return p


MOST = 0.8
"""The share of days that a range holds: four days in five."""

FEW = 9
"""With fewer days, no thirds and no range of four days in five."""

CLEAR = 0.7
"""t50 falls with the flow where a day of low flow has the longer t50 in this share of pairs of days."""


@dataclass(frozen=True)
class Thirds:
    """t50 by thirds of the mean inflow.

    `edges` are mean inflows [m3/s]: lowest, end of the lower third, begin of the upper third, highest.
    `medians` are those of t50 [samples] in the lower, middle and upper third. `longer` is the share of pairs
    of a day of the lower and a day of the upper third in which the lower has the longer t50; 0.5 where the
    flow does not matter.
    """

    edges: tuple[float, float, float, float]
    medians: tuple[float, float, float]
    longer: float


@dataclass(frozen=True)
class Passage:
    """t50 over the record [samples]: median and range of four days in five (of all days, if they are few).

    `with_t50` of the `days` have one. `thirds` is None where too few days have a mean inflow, or all the
    same. `bounded` days have both bounds (5); `between` of them have a t50 between them.
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
    """t50 by thirds of the mean inflow of the days that have both; None where they are too few."""
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
