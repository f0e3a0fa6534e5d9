"""How the delay falls as the discharge grows: the law, how sure it is, and the table that a controller needs.

Beyond the paper. ``T = T0 (Q / Q0)^-b``, a line between the logarithms. A day's travel time errs by its own
uncertainty and by its scatter about the law, with tails of Student's t, so that a wrong day pulls little; its
discharge may err too. Neighbouring days are related: the interval comes from leaving out blocks of days, not
single days.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from rivid.core.law.fit import Fit, alike, block_covariance, bulk, fit_line
from rivid.core.law.settings import LawSettings
from rivid.errors import RividError

Floats = NDArray[np.float64]

IN_A_BLOCK = 4.0
"""Length of a block over the days that stay alike: what is lost between two blocks is a small part."""

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
        Between these lies the delay of a single day as often as the interval holds.
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
        That the intervals hold.
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

        Outside the discharges that were seen this is a guess.
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
        Number of the calendar day, rising: what tells which days are neighbours. Without it, the row.
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
            f"{n} days in {blocks} blocks of {s.block} days: {s.least_blocks} blocks are needed",
        )  # fmt: skip
    Q0 = float(np.exp(np.log(Q).mean()))
    x, y = np.log(Q / Q0), np.log(T)
    own = np.maximum(np.log(high / low) / BAND_SD, s.least_sd)
    if np.ptp(x) < s.least_range:
        return _no_law(
            n, blocks, s, "even_discharge",
            f"the discharge goes from {Q.min():.4g} to {Q.max():.4g} m3/s: too even to tell a law",
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
        nan,
        nan,
        nan,
        nan,
        nan,
        nan,
        nan,
        np.full((2, 2), nan),
        nan,
        n,
        blocks,
        s.level,
        empty,
        status,
        message,
    )
