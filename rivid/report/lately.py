"""The delay of the last week of a record, and whether it has moved against the weeks before: numbers.

A week is taken as one observation: its days share weather, flow and programme, so that a test that counts
days would see moves in nothing.
"""

import datetime as dt
from dataclasses import dataclass

import numpy as np

from rivid.report.headline import leading
from rivid.results.passage import has_t50, leading_response
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import day_numbers, estimates_delay, found
from rivid.types import Bools, Floats, Ints

WEEK = 7
"""Days of a week; the last one ends with the record."""

WEEKS = 8
"""So many weeks before the last one are what it is compared with."""

FEWEST_DAYS = 3
"""A week with fewer days that the data carry does not count."""

FEWEST_WEEKS = 4
"""With fewer weeks before, nothing is said of a move."""

BAND_DAYS = 30
"""With fewer days, there is no band."""

TAIL = 0.05
"""Part of the days beyond each end of the band."""

LIMITS = {4: 5.841, 5: 4.604, 6: 4.032, 7: 3.707, 8: 3.499}
"""By the number of weeks before: Student's t with one degree of freedom less that chance passes, on either
side, once in a hundred. A table, since scipy.stats takes longer to load than the page to write."""


@dataclass(frozen=True)
class Trend:
    """The last week against the weeks before, on days that the data carry.

    Attributes
    ----------
    now, before : float
        Median of the last week, and of all days of the weeks before [samples].
    low, high : float
        Lowest and highest median of one of the weeks before [samples].
    days, weeks : int
        Days of the last week; weeks before that count.
    t : float
        Difference of the last week from the mean of the weeks before, over its standard error.
    moved : bool
        The median lies outside those of all weeks before, and t beyond what chance does once in a hundred.
    """

    now: float
    before: float
    low: float
    high: float
    days: int
    weeks: int
    t: float
    moved: bool


@dataclass(frozen=True)
class Lately:
    """The last week of the estimator that speaks for the reach.

    Attributes
    ----------
    estimator : EstimatorResults
    passage, travel : bool
        The values are t50, or travel times with their fraction, not delays d.
    values : ndarray, shape (n,)
        Of every day of the record [samples]; NaN where it has none.
    carried : ndarray of bool, shape (n,)
        Days with a value that is not the prior's or chance's (prior_only).
    week : ndarray of bool, shape (n,)
        Rows of the last week.
    first, last : datetime.date
        Its ends; the record may have begun later than `first`.
    median : float
        Of the last week [samples]; NaN where none of its days has a value.
    trend : Trend or None
        None where the data do not carry a comparison.
    """

    estimator: EstimatorResults
    passage: bool
    travel: bool
    values: Floats
    carried: Bools
    week: Bools
    first: dt.date
    last: dt.date
    median: float
    trend: Trend | None

    @property
    def whole(self) -> bool:
        """Whether the record is no longer than a week."""
        return self.estimator.dates[0] >= self.first

    @property
    def with_value(self) -> Bools:
        """Days of the last week with a value, shape (n,)."""
        given: Bools = self.week & np.isfinite(self.values)
        return given

    @property
    def delay(self) -> float:
        """Median delay d of the last week [samples]; NaN where none of its days has one."""
        inside = self.estimator.delay[self.with_value]
        return float(np.median(inside)) if inside.size else float("nan")

    @property
    def by_prior(self) -> int:
        """Days of the last week whose value the data alone do not give."""
        return int((self.with_value & ~self.carried).sum())


def lately(results: Results) -> Lately | None:
    """The last week of what speaks for the reach: a river's t50, or else the delay of the leading estimator.

    Returns
    -------
    Lately or None
        None where no estimator has a row, or none of a pool's gives delays.
    """
    river = leading_response(results)
    e = river or leading(results)
    if e is None or (river is None and not estimates_delay(e)):
        return None
    days = has_t50(e) if river else found(e)
    travel = not river and e.travel_s is not None
    every = e.t50 if river else e.delay
    if e.travel_s is not None and travel:
        every = e.travel_s / results.sample_time
        days = days & np.isfinite(every)
    values = np.where(days, every, np.nan)
    carried = days if river else days & ~e.prior_only
    ago = weeks_ago(e.dates)
    week = ago == 0
    inside = values[week & days]
    last = e.dates[-1]
    return Lately(
        estimator=e,
        passage=river is not None,
        travel=travel,
        values=values,
        carried=carried,
        week=week,
        first=last - dt.timedelta(days=WEEK - 1),
        last=last,
        median=float(np.median(inside)) if inside.size else float("nan"),
        trend=trend(values[carried], ago[carried]),
    )


def weeks_ago(dates: list[dt.date]) -> Ints:
    """How many weeks before the last one each day lies, shape (n,); 0 in the last week.

    Examples
    --------
    >>> weeks_ago([dt.date(2008, 12, 24), dt.date(2008, 12, 25), dt.date(2008, 12, 31)])
    array([1, 0, 0])
    """
    days = day_numbers(dates).astype(np.int64)
    return np.asarray((days[-1] - days) // WEEK)


def trend(values: Floats, ago: Ints) -> Trend | None:
    """Compare the last week with the eight before it.

    A week is the mean of its days without the lowest and the highest: one day at a bound moves no week. The
    last week is compared with those before by Student's t for a new observation; the scatter of weeks is not
    taken for less than what their days, were they independent, would give. Where days hang together from one
    to the next (correlation 0.8), chance passes up to three times in a hundred instead of once.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Delay or t50 of days that the data carry [samples].
    ago : ndarray of int, shape (n,)
        As of :func:`weeks_ago`.

    Returns
    -------
    Trend or None
        None with fewer than three days in the last week, or fewer than four weeks before that have three.
    """
    count = np.bincount(ago, minlength=WEEKS + 1)[: WEEKS + 1]
    weeks = np.flatnonzero(count >= FEWEST_DAYS)
    if not len(weeks) or weeks[0] != 0 or len(weeks) <= FEWEST_WEEKS:
        return None
    whole = [values[ago == w] for w in weeks]
    middles = [_middle(days) for days in whole]
    means = np.array([days.mean() for days in middles])
    medians = np.array([np.median(days) for days in whole])
    K = len(weeks) - 1
    among = float(means[1:].var(ddof=1))
    spread = sum(float(days.size * days.var()) for days in middles) / sum(days.size - 1 for days in middles)
    alone = spread / count[weeks]  # the variance of a week's mean, were its days independent
    error = float(np.sqrt(max(among, alone[1:].mean()) / K + max(among, alone[0])))
    change = float(means[0] - means[1:].mean())
    low, high = float(medians[1:].min()), float(medians[1:].max())
    return Trend(
        now=float(medians[0]),
        before=float(np.median(np.concatenate(whole[1:]))),
        low=low,
        high=high,
        days=int(count[0]),
        weeks=K,
        t=change / error if error > 0 else float(np.copysign(np.inf, change)) if change else 0.0,
        moved=not low <= medians[0] <= high and abs(change) > LIMITS[K] * error,
    )


def _middle(days: Floats) -> Floats:
    """A week's values without the lowest and the highest, where that leaves three."""
    return np.sort(days)[1:-1] if days.size >= FEWEST_DAYS + 2 else days


@dataclass(frozen=True)
class Band:
    """Where the days of a record lie: all but a twentieth at each end, `low` to `high` [samples]."""

    low: float
    high: float

    def far(self, values: Floats) -> Bools:
        """Days further outside than the band is wide, and than one sample; False where there is no value."""
        margin = max(self.high - self.low, 1.0)
        return np.asarray((values < self.low - margin) | (values > self.high + margin))


def band(values: Floats) -> Band | None:
    """The band of a record's values, shape (n,) with NaN [samples]; None with fewer than thirty days.

    Examples
    --------
    >>> b = band(np.array([6.0, 7.0] * 20 + [9.0, np.nan]))
    >>> b, b.far(np.array([6.0, 8.0, 9.0, np.nan]))
    (Band(low=6.0, high=7.0), array([False, False,  True, False]))
    """
    given = values[np.isfinite(values)]
    if given.size < BAND_DAYS:
        return None
    low = float(np.quantile(given, TAIL, method="lower"))
    return Band(low, float(np.quantile(given, 1 - TAIL, method="higher")))
