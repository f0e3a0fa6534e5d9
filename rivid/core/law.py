"""The law of delay and discharge, ``T = T0 (Q / Q0)^-b``: a robust line of ln T against ln Q.

Both variables have errors (York), far days count less (Student's t), and the intervals come from a jackknife
over blocks of neighbouring days.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from rivid.core.settings import Checked, Limits, Part, Positive
from rivid.errors import RividError
from rivid.types import Floats


@dataclass(frozen=True)
class LawSettings(Checked):
    """Settings of the law of delay and discharge.

    Parameters
    ----------
    discharge_error : float
        Relative standard error of a day's discharge [-]; without it a law is too flat.
    tails : float
        Degrees of freedom of Student's t, above 2: the fewer, the less a far day pulls.
    block : int
        Smallest number of calendar days that are left out together; more where the residuals are correlated
        for longer than a quarter of that, as long as `least_blocks` remain.
    least_blocks : int
        Fewer blocks give no law, 4 or more.
    least_range : float
        Smallest range of ln Q [-].
    least_sd : float
        Smallest standard deviation of a day's ln T [-].
    level : float
        Probability of the intervals.
    classes : int
        Rows of the table.
    """

    discharge_error: Part = 0.0
    tails: Annotated[float, Limits(gt=2)] = 4.0
    block: Annotated[int, Limits(ge=1)] = 14
    least_blocks: Annotated[int, Limits(ge=4)] = 6
    least_range: Positive = 0.1
    least_sd: Positive = 1e-4
    level: Annotated[float, Limits(gt=0, lt=1)] = 0.9
    classes: Annotated[int, Limits(ge=1)] = 5


ROUNDS = 200
"""Largest number of iterations; a dozen are usual."""

CONVERGED = 1e-8
"""Change of the slope and of the scatter that ends the iteration."""

LEAST_FIRMNESS = 0.2
"""Where most points lie far off it means nothing; it is 0.71 under Student's t of 4, 1 without tails."""

STEPS = 38
"""Of the search for the scatter, golden section: to 1e-8 of its range."""


class Fit(NamedTuple):
    """``y = offset + slope x``.

    `firmness` is the mean slope of Student's influence function over the mean weight, below 1: the weights
    follow the line, so that it is less certain than they indicate.
    """

    offset: float
    slope: float
    scatter: float  # standard deviation of the bulk beyond each point's own uncertainty
    weight: Floats  # 1 / variance of each point's distance, times its weight by Student's t
    firmness: float
    instrument: Floats  # true x, estimated: the line solves sum weight (1, instrument) residual = 0


def fit_line(x: Floats, y: Floats, own: Floats, x_error: float, tails: float) -> Fit:
    """Robust line through points of shape (n,).

    `own` is the standard deviation of each y's own error, `x_error` that of every x, `tails` the degrees of
    freedom of Student's t.
    """
    width = bulk(tails)
    own, x_error = width * own, width * x_error
    slope, offset = 0.0, float(np.median(y))
    scatter = float(1.4826 * np.median(np.abs(y - offset)))
    weight, variance, believed = np.ones(len(x)), own**2, x
    for _ in range(ROUNDS):
        before = slope, scatter
        residual = y - offset - slope * x
        variance = own**2 + scatter**2 + (slope * x_error) ** 2
        weight = (tails + 1.0) / (tails + residual**2 / variance) / variance
        believed = _believed(x, y, weight, own**2 + scatter**2, x_error, slope)
        offset, slope = _solved(x, y, weight, believed)
        scatter = _scatter(y - offset - slope * x, np.hypot(own, slope * x_error), tails)
        if abs(slope - before[0]) + abs(scatter - before[1]) < CONVERGED:
            break
    square = (y - offset - slope * x) ** 2 / variance
    pull = (tails + 1.0) * (tails - square) / (tails + square) ** 2 / variance
    firmness = max(float(pull.sum() / weight.sum()), LEAST_FIRMNESS)
    return Fit(offset, slope, scatter / width, weight, firmness, believed)


@lru_cache(maxsize=8)
def bulk(tails: float) -> float:
    """Scale of Student's t that fits a normal variable of unit variance best.

    Errors are given as standard deviations of a normal bulk; the tails are for days that are wrong.

    Examples
    --------
    >>> round(bulk(4.0), 3), round(bulk(1e6), 3)
    (0.831, 1.0)
    """
    z, p = np.polynomial.hermite_e.hermegauss(80)
    p = p / p.sum()
    low, high = 0.0, 1.0
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        pull = float(p @ ((tails + 1.0) * z**2 / (tails * middle**2 + z**2)))
        low, high = (middle, high) if pull > 1.0 else (low, middle)
    return 0.5 * (low + high)


def _believed(x: Floats, y: Floats, w: Floats, y_variance: Floats, x_error: float, slope: float) -> Floats:
    """Estimate of the true x, given the line: between the measured x and that of y (York, 13b)."""
    middle, height = np.average(x, weights=w), np.average(y, weights=w)
    variance = y_variance + (slope * x_error) ** 2
    moved = (y_variance * (x - middle) + slope * x_error**2 * (y - height)) / variance
    return np.asarray(middle + moved)


def _solved(x: Floats, y: Floats, w: Floats, z: Floats) -> tuple[float, float]:
    """Offset and slope with ``sum w (1, z) (y - offset - slope x) = 0``."""
    middle, height = np.average(x, weights=w), np.average(y, weights=w)
    centred = w * (z - np.average(z, weights=w))
    slope = float(centred @ (y - height) / (centred @ (x - middle)))
    return float(height - slope * middle), slope


def _scatter(residual: Floats, known: Floats, tails: float) -> float:
    """Most likely scatter in addition to known scales, under Student's t."""

    def log_likelihood(scatter: Floats) -> Floats:
        variance = known**2 + scatter[:, None] ** 2
        far = np.log1p(residual**2 / (tails * variance))
        return np.asarray(-0.5 * (np.log(variance) + (tails + 1.0) * far).sum(axis=1))

    top = 2.0 * float(np.sqrt(np.mean(residual**2))) + 1e-12
    grid = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 12) * top])
    best = int(np.argmax(log_likelihood(grid)))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    for _ in range(STEPS):
        inner = np.array([high - golden * (high - low), low + golden * (high - low)])
        left, right = log_likelihood(inner)
        low, high = (low, inner[1]) if left >= right else (inner[0], high)
    return float(0.5 * (low + high))


def alike(days: NDArray[np.intp], x: Floats, y: Floats, fit: Fit) -> float:
    """Correlation time of the residuals [days]: 1 for unrelated days.

    One and twice the sum of the correlations between days so far apart, up to the first that is not positive.
    """
    pull = np.full(int(days[-1] - days[0]) + 1, np.nan)
    pull[days - days[0]] = np.sqrt(fit.weight) * (y - fit.offset - fit.slope * x)
    known = np.isfinite(pull)
    pull = np.where(known, pull, 0.0)
    size, total = float((pull**2).sum() / known.sum()), 1.0
    for lag in range(1, len(pull) // 4):
        pairs = int((known[lag:] & known[:-lag]).sum())
        related = float(pull[lag:] @ pull[:-lag]) / (size * pairs) if pairs and size > 0.0 else 0.0
        if related <= 0.0:
            break
        total += 2.0 * related
    return total


def block_covariance(x: Floats, y: Floats, fit: Fit, block: NDArray[np.intp]) -> Floats:
    """Covariance of offset and slope by leaving out one block of neighbours at a time, shape (2, 2).

    The weights stay, so that each line without a block is one small solve; that they would have changed
    makes the line move further, by 1 / `firmness`.
    """
    Z = np.stack([np.ones_like(x), fit.instrument])
    X = np.stack([np.ones_like(x), x])
    blocks = int(block.max()) + 1
    A, c = np.zeros((blocks, 2, 2)), np.zeros((blocks, 2))
    np.add.at(A, block, np.einsum("in,jn,n->nij", Z, X, fit.weight))
    np.add.at(c, block, (Z * fit.weight * y).T)
    without = np.linalg.solve(A.sum(axis=0) - A, (c.sum(axis=0) - c)[..., None])[..., 0]
    away = (without - np.array([fit.offset, fit.slope])) / fit.firmness
    return np.asarray((blocks - 1) / blocks * away.T @ away)


IN_A_BLOCK = 4.0
"""Length of a block over the correlation time: the correlation lost between two blocks is then small."""

BAND_SD = 3.289707
"""Standard deviations between 5 and 95 % of a normal variable."""


@dataclass(frozen=True)
class DelayTable:
    """The law at a few discharges, one row for each class of as many days.

    Attributes
    ----------
    discharge_low, discharge_high : ndarray, shape (classes,)
        Edges of the class [m3/s].
    discharge : ndarray, shape (classes,)
        Median discharge of its days [m3/s]; the law is given there.
    delay, low, high : ndarray, shape (classes,)
        Delay by the law, and its interval [unit of the places].
    day_low, day_high : ndarray, shape (classes,)
        Interval of the delay of a single day.
    observed : ndarray, shape (classes,)
        Median of the days' own places.
    n : ndarray of int, shape (classes,)
        Days.
    """

    discharge_low: Floats
    discharge_high: Floats
    discharge: Floats
    delay: Floats
    low: Floats
    high: Floats
    day_low: Floats
    day_high: Floats
    observed: Floats
    n: NDArray[np.intp]


@dataclass(frozen=True)
class DelayLaw:
    """``T = T0 (Q / Q0)^-b``; NaN where the status is not "ok".

    Attributes
    ----------
    T0, T0_low, T0_high : float
        Delay at Q0 [unit of the places], and its interval.
    b, b_low, b_high : float
        Power by which the delay falls as the discharge grows [-].
    Q0 : float
        Geometric mean of the days' discharges [m3/s].
    covariance : ndarray, shape (2, 2)
        Of (ln T0, b).
    scatter : float
        Standard deviation, wrong days apart, of the days' scatter about the law beyond their own
        uncertainty, in ln T [-].
    days, blocks : int
        Days that count, and blocks of days.
    level : float
        Probability of the intervals.
    table : DelayTable
        No rows without a law.
    status : str
        "ok", "too_few_days" or "even_discharge".
    message : str
        Why there is no law.
    """

    T0: float
    T0_low: float
    T0_high: float
    b: float
    b_low: float
    b_high: float
    Q0: float
    covariance: Floats
    scatter: float
    days: int
    blocks: int
    level: float
    table: DelayTable
    status: str
    message: str

    def delay(self, discharge: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Delay by the law at any discharge [m3/s], and its interval, each of the discharge's shape.

        Outside the range of the discharges this is an extrapolation.
        """
        x = np.log(np.asarray(discharge, float) / self.Q0)
        middle = np.log(self.T0) - self.b * x
        V = self.covariance
        sd = np.sqrt(np.maximum(V[0, 0] - 2.0 * x * V[0, 1] + x * x * V[1, 1], 0.0))
        half = float(_factor(self.blocks, self.level)) * sd
        return np.exp(middle), np.exp(middle - half), np.exp(middle + half)


def delay_law(
    discharge: ArrayLike,
    place: ArrayLike,
    place_low: ArrayLike,
    place_high: ArrayLike,
    *,
    day: ArrayLike | None = None,
    settings: LawSettings | None = None,
) -> DelayLaw:
    """Delay against discharge.

    Parameters
    ----------
    discharge : array_like, shape (days,)
        Median discharge of the day [m3/s].
    place, place_low, place_high : array_like, shape (days,)
        Travel time of the day: median, 5 and 95 % [samples, or any unit of time]. A day with a NaN, or with a
        value that is not positive, does not count.
    day : array_like of int, shape (days,), optional
        Number of the calendar day, rising: it shows which days are neighbours. Without it, the row.
    settings : LawSettings, optional

    Returns
    -------
    DelayLaw

    Raises
    ------
    RividError
        For shapes that do not fit, or days that do not rise.

    Notes
    -----
    Source: errors in both variables, D. York et al., "Unified equations for the slope, intercept, and
    standard errors of the best straight line", Am. J. Phys. 72 (2004), 367-375, (13); weights of Student's t,
    K. L. Lange et al., "Robust statistical modeling using the t distribution", JASA 84 (1989), 881-896; a
    jackknife over blocks, H. R. Kuensch, Ann. Statist. 17 (1989), 1217-1241.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> Q = rng.uniform(100.0, 800.0, 90)
    >>> T = 8.0 * (Q / 300.0) ** -0.3 * np.exp(0.01 * rng.normal(size=90))
    >>> law = delay_law(Q, T, 0.98 * T, 1.02 * T)
    >>> round(law.b, 2), law.b_low < 0.3 < law.b_high, law.table.n.tolist()
    (0.3, True, [18, 18, 18, 18, 18])
    """
    s = settings or LawSettings()
    Q, T, low, high, days = _checked(discharge, place, place_low, place_high, day)
    block = _blocks(days, s.block)
    n, blocks = len(Q), len(np.unique(block))
    if blocks < s.least_blocks:
        return _no_law(
            n, blocks, s, "too_few_days",
            f"{n} days in {blocks} block{'s' * (blocks != 1)} of {s.block} days: "
            f"{s.least_blocks} blocks are needed",
        )  # fmt: skip
    Q0 = float(np.exp(np.log(Q).mean()))
    x, y = np.log(Q / Q0), np.log(T)
    own = np.maximum(np.log(high / low) / BAND_SD, s.least_sd)
    if np.ptp(x) < s.least_range:
        return _no_law(
            n, blocks, s, "even_discharge",
            f"the discharge goes from {Q.min():.4g} to {Q.max():.4g} m3/s: too constant for a law",
        )  # fmt: skip
    fit = fit_line(x, y, own, s.discharge_error, s.tails)
    longest = max((int(days[-1] - days[0]) + 1) // s.least_blocks, s.block)
    block = _blocks(days, int(np.clip(np.ceil(IN_A_BLOCK * alike(days, x, y, fit)), s.block, longest)))
    blocks = len(np.unique(block))
    V = block_covariance(x, y, fit, block)
    V[0, 1] = V[1, 0] = -V[0, 1]  # of (ln T0, b), b = - slope
    half = _factor(blocks, s.level) * np.sqrt(np.diag(V))
    return DelayLaw(
        T0=float(np.exp(fit.offset)), T0_low=float(np.exp(fit.offset - half[0])),
        T0_high=float(np.exp(fit.offset + half[0])), b=-fit.slope, b_low=float(-fit.slope - half[1]),
        b_high=float(-fit.slope + half[1]), Q0=Q0, covariance=V, scatter=fit.scatter, days=n, blocks=blocks,
        level=s.level, table=_table(x, Q, T, fit, V, blocks, s), status="ok", message="",
    )  # fmt: skip


def _checked(
    discharge: ArrayLike, place: ArrayLike, place_low: ArrayLike, place_high: ArrayLike, day: ArrayLike | None
) -> tuple[Floats, Floats, Floats, Floats, NDArray[np.intp]]:
    """The days that count."""
    Q = np.asarray(discharge, float)
    if Q.ndim != 1:
        raise RividError(f"discharge has shape {Q.shape}: expected (days,)")
    values = [Q]
    for name, given in (("place", place), ("place_low", place_low), ("place_high", place_high)):
        values.append(np.asarray(given, float))
        if values[-1].shape != Q.shape:
            raise RividError(
                f"{name} has shape {values[-1].shape}: expected {Q.shape}, that of the discharge"
            )
    days = np.arange(len(Q)) if day is None else np.asarray(day, np.intp)
    if days.shape != Q.shape:
        raise RividError(f"day has shape {days.shape}: expected {Q.shape}, that of the discharge")
    if (np.diff(days) <= 0).any():
        raise RividError("day does not rise from row to row: sort the days, and give each once")
    with np.errstate(invalid="ignore"):
        good = np.all([np.isfinite(v) & (v > 0.0) for v in values], axis=0)
        good &= (values[2] <= values[1]) & (values[1] <= values[3])
    return values[0][good], values[1][good], values[2][good], values[3][good], days[good]


def _blocks(days: NDArray[np.intp], length: int) -> NDArray[np.intp]:
    """Number of the block of each day: blocks of calendar days, from 0, none empty."""
    if not len(days):
        return days
    return np.asarray(np.unique((days - days[0]) // length, return_inverse=True)[1], np.intp)


def _factor(blocks: int, level: float) -> float:
    """Student's t for the interval: two of the blocks are spent on the line."""
    return float(stdtrit(max(blocks - 2, 1), 0.5 + 0.5 * level))


def _table(x: Floats, Q: Floats, T: Floats, fit: Fit, V: Floats, blocks: int, s: LawSettings) -> DelayTable:
    """Classes of as many days."""
    classes = np.array_split(np.argsort(Q, kind="stable"), min(s.classes, len(Q)))
    rows = []
    for take in classes:
        at = np.array([1.0, -float(np.median(x[take]))])
        middle = fit.offset - fit.slope * at[1]
        variance = float(at @ V @ at)
        half = _factor(blocks, s.level) * np.sqrt(variance)
        spread = np.sqrt(variance + (bulk(s.tails) * fit.scatter) ** 2)
        day = float(stdtrit(s.tails, 0.5 + 0.5 * s.level)) * spread
        band = np.exp([middle, middle - half, middle + half, middle - day, middle + day])
        rows.append([Q[take].min(), Q[take].max(), np.median(Q[take]), *band, np.median(T[take])])
    return _columns(np.array(rows), np.array([len(take) for take in classes], np.intp))


def _columns(rows: Floats, n: NDArray[np.intp]) -> DelayTable:
    low, high, middle, delay, delay_low, delay_high, day_low, day_high, observed = rows.T
    return DelayTable(low, high, middle, delay, delay_low, delay_high, day_low, day_high, observed, n)


def _no_law(n: int, blocks: int, s: LawSettings, status: str, message: str) -> DelayLaw:
    empty, nan = _columns(np.empty((0, 9)), np.empty(0, np.intp)), float("nan")
    return DelayLaw(
        nan, nan, nan, nan, nan, nan, nan, np.full((2, 2), nan), nan,
        n, blocks, s.level, empty, status, message,
    )  # fmt: skip
