"""Classes of days of an estimator, for figures and report."""

import datetime as dt
from collections.abc import Sequence

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.results.read import EstimatorResults
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
    """Reliability of each delay: each day with a delay is in one class, the most severe that applies.

    Returns
    -------
    dict
        "data decide", "data do not decide", "degenerate" and "at a bound": arrays of shape (n,).
    """
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
