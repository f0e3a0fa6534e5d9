"""The law of delay and discharge, ``T = T0 (Q / Q0)^-b``: a robust line of ln T against ln Q.

Far days count less (Student's t), and the intervals come from a jackknife over blocks of neighbouring days.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from rivid.errors import RividError
from rivid.types import Floats

LEVEL = 0.9
"""Probability of the intervals."""

TAILS = 4.0
"""Degrees of freedom of Student's t: the fewer, the less a far day pulls."""

BULK = 0.8310034937840101
"""Scale m of this t that fits a normal variable z of unit variance best: E[5 z^2 / (4 m^2 + z^2)] = 1. The
bulk of the days is normal, the tails are for days that are wrong."""

OWN = 1e-4 * BULK
"""Smallest scale of a day's ln T [-], far below the scatter of any record."""

BLOCK = 14
"""Smallest number of calendar days that are left out together; more where the residuals are correlated for
longer than a quarter of that, as long as :data:`LEAST_BLOCKS` remain."""

LEAST_BLOCKS = 6
"""Fewer blocks give no law."""

LEAST_RANGE = 0.1
"""Smallest range of ln Q [-]."""

CLASSES = 5
"""Rows of the table."""

ROUNDS = 200
"""Largest number of iterations; a dozen are usual."""

CONVERGED = 1e-8
"""Change of the slope and of the scatter that ends the iteration."""

LEAST_FIRMNESS = 0.2
"""Where most points lie far off it means nothing; it is 0.71 under Student's t of 4, 1 without tails."""

STEPS = 38
"""Of the search for the scatter, golden section: to 1e-8 of its range."""

IN_A_BLOCK = 4.0
"""Length of a block over the correlation time: the correlation lost between two blocks is then small."""


class Fit(NamedTuple):
    """``y = offset + slope x``.

    `firmness` is the mean slope of Student's influence function over the mean weight, below 1: the weights
    follow the line, so that it is less certain than they indicate.
    """

    offset: float
    slope: float
    scatter: float  # standard deviation of the bulk
    weight: Floats  # 1 / variance of each point's distance, times its weight by Student's t
    firmness: float


def fit_line(x: Floats, y: Floats) -> Fit:
    """Robust line through points of shape (n,)."""
    slope, offset = 0.0, float(np.median(y))
    scatter = float(1.4826 * np.median(np.abs(y - offset)))
    for _ in range(ROUNDS):
        before = slope, scatter
        variance = OWN**2 + scatter**2
        weight = (TAILS + 1.0) / (TAILS + (y - offset - slope * x) ** 2 / variance) / variance
        middle, height = np.average(x, weights=weight), np.average(y, weights=weight)
        centred = weight * (x - middle)
        slope = float(centred @ (y - height) / (centred @ (x - middle)))
        offset = float(height - slope * middle)
        scatter = _scatter(y - offset - slope * x)
        if abs(slope - before[0]) + abs(scatter - before[1]) < CONVERGED:
            break
    square = (y - offset - slope * x) ** 2 / variance
    pull = (TAILS + 1.0) * (TAILS - square) / (TAILS + square) ** 2 / variance
    firmness = max(float(pull.sum() / weight.sum()), LEAST_FIRMNESS)
    return Fit(offset, slope, scatter / BULK, weight, firmness)


def _scatter(residual: Floats) -> float:
    """Most likely scatter beside :data:`OWN`, under Student's t."""

    def log_likelihood(scatter: Floats) -> Floats:
        variance = OWN**2 + scatter[:, None] ** 2
        far = np.log1p(residual**2 / (TAILS * variance))
        return np.asarray(-0.5 * (np.log(variance) + (TAILS + 1.0) * far).sum(axis=1))

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
    X = np.stack([np.ones_like(x), x])
    blocks = int(block.max()) + 1
    A, c = np.zeros((blocks, 2, 2)), np.zeros((blocks, 2))
    np.add.at(A, block, np.einsum("in,jn,n->nij", X, X, fit.weight))
    np.add.at(c, block, (X * fit.weight * y).T)
    without = np.linalg.solve(A.sum(axis=0) - A, (c.sum(axis=0) - c)[..., None])[..., 0]
    away = (without - np.array([fit.offset, fit.slope])) / fit.firmness
    return np.asarray((blocks - 1) / blocks * away.T @ away)


@dataclass(frozen=True)
class DelayTable:
    """The law at a few discharges, one row for each class of as many days; arrays of shape (classes,)."""

    discharge_low: Floats  # edges of the class [m3/s]
    discharge_high: Floats
    discharge: Floats  # median of its days [m3/s]; the law is given there
    delay: Floats  # by the law [unit of the delays], and its interval
    low: Floats
    high: Floats
    day_low: Floats  # interval of the delay of a single day
    day_high: Floats
    observed: Floats  # median of the days' own delays
    n: NDArray[np.intp]  # days


@dataclass(frozen=True)
class DelayLaw:
    """``T = T0 (Q / Q0)^-b``; NaN where the status is not "ok", which `message` then explains."""

    status: str  # "ok", "too_few_days" or "even_discharge"
    message: str
    days: int  # that count
    blocks: int  # of days
    table: DelayTable  # without rows where there is no law
    T0: float = np.nan  # delay at Q0 [unit of the delays], and its interval
    T0_low: float = np.nan
    T0_high: float = np.nan
    b: float = np.nan  # power by which the delay falls as the discharge grows [-], and its interval
    b_low: float = np.nan
    b_high: float = np.nan
    Q0: float = np.nan  # geometric mean of the days' discharges [m3/s]
    covariance: Floats = field(default_factory=lambda: np.full((2, 2), np.nan))  # of (ln T0, b)
    scatter: float = np.nan  # standard deviation of ln T about the law, wrong days apart [-]
    level: float = LEVEL  # probability of the intervals
    # by how much all delays may be too long, and too short: its intervals of delays include it
    doubt: tuple[float, float] = (0.0, 0.0)

    def delay(self, discharge: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Delay by the law at any discharge [m3/s], and its interval, each of the discharge's shape.

        Outside the range of the discharges this is an extrapolation.
        """
        x = np.log(np.asarray(discharge, float) / self.Q0)
        middle = np.log(self.T0) - self.b * x
        V = self.covariance
        sd = np.sqrt(np.maximum(V[0, 0] - 2.0 * x * V[0, 1] + x * x * V[1, 1], 0.0))
        half = _factor(self.blocks) * sd
        long, short = self.doubt
        return np.exp(middle), np.maximum(np.exp(middle - half) - long, 0.0), np.exp(middle + half) + short


def delay_law(discharge: ArrayLike, delay: ArrayLike, *, day: ArrayLike | None = None) -> DelayLaw:
    """Delay against discharge.

    `discharge` [m3/s] and `delay` [samples, or any unit of time] have shape (days,); a day with a NaN, or
    with a value that is not positive, does not count. `day` is the number of the calendar day, rising, which
    shows what days are neighbours; without it, the row. RividError for shapes that do not fit, or days that
    do not rise.

    Source: weights of Student's t, K. L. Lange et al., "Robust statistical modeling using the t
    distribution", JASA 84 (1989), 881-896; a jackknife over blocks, H. R. Kuensch, Ann. Statist. 17 (1989),
    1217-1241.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> Q = rng.uniform(100.0, 800.0, 90)
    >>> law = delay_law(Q, 8.0 * (Q / 300.0) ** -0.3 * np.exp(0.01 * rng.normal(size=90)))
    >>> round(law.b, 2), law.b_low < 0.3 < law.b_high, law.table.n.tolist()
    (0.3, True, [18, 18, 18, 18, 18])
    """
    Q, T, days = _checked(discharge, delay, day)
    block = _blocks(days, BLOCK)
    n, blocks = len(Q), len(np.unique(block))
    if blocks < LEAST_BLOCKS:
        why = f"{n} days in {blocks} block{'s' * (blocks != 1)} of {BLOCK} days: {LEAST_BLOCKS} blocks"
        return DelayLaw("too_few_days", f"{why} are needed", n, blocks, _table([], []))
    Q0 = float(np.exp(np.log(Q).mean()))
    x, y = np.log(Q / Q0), np.log(T)
    if np.ptp(x) < LEAST_RANGE:
        why = f"the discharge goes from {Q.min():.4g} to {Q.max():.4g} m3/s: too constant for a law"
        return DelayLaw("even_discharge", why, n, blocks, _table([], []))
    fit = fit_line(x, y)
    longest = max((int(days[-1] - days[0]) + 1) // LEAST_BLOCKS, BLOCK)
    block = _blocks(days, int(np.clip(np.ceil(IN_A_BLOCK * alike(days, x, y, fit)), BLOCK, longest)))
    blocks = len(np.unique(block))
    V = block_covariance(x, y, fit, block)
    V[0, 1] = V[1, 0] = -V[0, 1]  # of (ln T0, b), b = - slope
    half = _factor(blocks) * np.sqrt(np.diag(V))

    classes, rows = np.array_split(np.argsort(Q, kind="stable"), min(CLASSES, n)), []
    for take in classes:
        at = np.array([1.0, -float(np.median(x[take]))])
        middle = fit.offset - fit.slope * at[1]
        variance = float(at @ V @ at)
        sure = _factor(blocks) * np.sqrt(variance)
        single = _student(TAILS) * np.sqrt(variance + (BULK * fit.scatter) ** 2)
        band = np.exp([middle, middle - sure, middle + sure, middle - single, middle + single])
        rows.append([Q[take].min(), Q[take].max(), np.median(Q[take]), *band, np.median(T[take])])
    return DelayLaw(
        "ok", "", n, blocks, _table(rows, [len(take) for take in classes]),
        T0=float(np.exp(fit.offset)), T0_low=float(np.exp(fit.offset - half[0])),
        T0_high=float(np.exp(fit.offset + half[0])), b=-fit.slope, b_low=float(-fit.slope - half[1]),
        b_high=float(-fit.slope + half[1]), Q0=Q0, covariance=V, scatter=fit.scatter,
    )  # fmt: skip


def _checked(
    discharge: ArrayLike, delay: ArrayLike, day: ArrayLike | None
) -> tuple[Floats, Floats, NDArray[np.intp]]:
    """The days that count."""
    Q, T = np.asarray(discharge, float), np.asarray(delay, float)
    if Q.ndim != 1:
        raise RividError(f"discharge has shape {Q.shape}: expected (days,)")
    days = np.arange(len(Q)) if day is None else np.asarray(day, np.intp)
    for name, shape in (("delay", T.shape), ("day", days.shape)):
        if shape != Q.shape:
            raise RividError(f"{name} has shape {shape}: expected {Q.shape}, that of the discharge")
    if (np.diff(days) <= 0).any():
        raise RividError("day does not rise from row to row: sort the days, and give each once")
    with np.errstate(invalid="ignore"):
        good = np.isfinite(Q) & (Q > 0.0) & np.isfinite(T) & (T > 0.0)
    return Q[good], T[good], days[good]


def _blocks(days: NDArray[np.intp], length: int) -> NDArray[np.intp]:
    """Number of the block of each day: blocks of calendar days, from 0, none empty."""
    return np.asarray(np.unique((days - days[:1]) // length, return_inverse=True)[1], np.intp)


def _student(freedom: float) -> float:
    """Half width of the interval of Student's t."""
    return float(stdtrit(freedom, 0.5 + 0.5 * LEVEL))


def _factor(blocks: int) -> float:
    """Half width of the law's interval in standard deviations: two of the blocks are spent on the line."""
    return _student(max(blocks - 2, 1))


def _table(rows: list[list[float]], n: list[int]) -> DelayTable:
    a, b, middle, delay, low, high, day_low, day_high, observed = np.array(rows).reshape(-1, 9).T
    return DelayTable(a, b, middle, delay, low, high, day_low, day_high, observed, np.array(n, np.intp))
