"""Noise of a simulated reach: unknown inflow, random walk, gauge noise and wind, day by day; its fit.

The residual is z = measured level - simulated level. Each day starts anew, and at sample k

    z_k = x_k + s_k + e_k,    x_{k+1} = x_k + (T_s / A) w_k + v_k,

w an unknown inflow and s a noise of the level (wind), both first-order autoregressive, v the walk of the
level error, e white gauge noise; x_0 is unknown. An inflow arrives as a wave, which raises the level before
the pool has filled as far: the innovations of w, times wave / A, enter s as well. The error of the response
is part of v, which has the variance walk_sd^2 + misfit^2 a_k. The activity a_k [m2] is the square of the
recent change of the level's rate by the flows (:func:`rivid.diagnosis.data.activity`). A river reach, with a
discharge as output, has no A and no walk: x is the unknown inflow as it arrives at the gauge, damped by the
reach as by a linear reservoir with the time `wave`,

    x_{k+1} = rho x_k + (1 - rho) w_k,    rho = exp(-T_s / wave),

level_sd its standard deviation and level_memory the memory of w, and s has the error of the response. Without
the damping, an inflow far from the gauge has a memory of days and hardly any variance within hours. The mean
of x is 0, so that a constant inflow is not absorbed. The fit starts from several models: one start can
end in a local optimum.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.signal import lfilter

from rivid.diagnosis.noise.kalman import (
    System,
    filtered,
    gains,
    gather,
    innovation,
    innovations,
    log_likelihoods,
    smoothed,
    start_of,
)
from rivid.errors import RividError
from rivid.types import Bools, Floats


@dataclass(frozen=True)
class NoiseModel:
    """The noise of one reach: a linear filter, the same for all days with the same gaps."""

    gauge_sd: float  # white gauge noise e [m]; for a river reach [m3/s]
    walk_sd: float  # standard deviation of the steps v of the random walk [m per sample]
    # unknown inflow w: standard deviation [m3/s] and memory [s]; correlation exp(-t / memory)
    inflow_sd: float
    inflow_memory: float
    # noise of the level s: standard deviation [m] and memory [s]; for a river reach the unknown inflow [m3/s]
    level_sd: float
    level_memory: float
    sample_time: float  # T_s [s]
    surface_area: float | None  # A [m2]; None for a river reach
    # error of the response over the recent change by the flows: number of samples by which a front is early
    # or late [-]
    misfit: float = 0.0
    # time [s] in which an inflow fills the pool by as much as its wave raises the level at once; for a river
    # reach the time by which it is damped on its way
    wave: float = 0.0
    # share of a level error that remains after a sample, below 1 if losses of the reach grow with its level:
    # forecasts run free from their origin, while the residual is about the observed level
    recall: float = 1.0

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if value is None:
                continue
            positive = f.name in ("gauge_sd", "inflow_memory", "level_memory", "sample_time", "surface_area")
            if not np.isfinite(value) or value < 0 or (positive and value == 0):
                least = "a positive number" if positive else "zero or more"
                raise RividError(
                    f"noise model: {f.name} is {value}: expected {least}; check what it was fitted to"
                )
        if self.surface_area is None and (self.walk_sd or self.inflow_sd):
            raise RividError(
                f"noise model: walk_sd is {self.walk_sd} and inflow_sd {self.inflow_sd}: expected 0 for a "
                "river reach, which has none; use level_sd or give surface_area"
            )

    def whiten(
        self, columns: ArrayLike, like: ArrayLike | None = None, activity: ArrayLike | None = None
    ) -> Floats:
        """Return standardised innovations: white with variance 1 if the columns are this noise.

        The filter is the same linear one for all columns (..., days, n) [m]. A sample is missing where `like`
        (days, n) is NaN; by default, where any of the columns is. The activity of the flows (days, n) [m2] is
        0 by default. The result is 0 at missing samples and, for a pool, at the first one of each day, which
        only sets x.
        """
        given = np.asarray(columns, float)
        stack = np.ascontiguousarray(given.reshape(-1, *given.shape[-2:]))
        _, there = gather(stack.sum(0) if like is None else like)
        if stack.shape[1:] != there.shape:
            raise RividError(
                f"columns have shape {given.shape}: expected (..., days, n) = (..., {there.shape})"
            )
        here = np.ascontiguousarray(there.T)
        white, finite = innovations(stack, here, _moved(activity, there.shape), self.system())
        if not finite:
            raise RividError(
                "a column is not finite where the residual is: simulate it on every sample that is read"
            )
        return np.asarray(white).reshape(given.shape)

    def log_likelihood(self, residual: ArrayLike, activity: ArrayLike | None = None) -> Floats:
        """Return the log-likelihood of each day (days,) of a residual (days, n) [m]; NaN is missing."""
        # For a pool it is that of the differences from the day's first sample, as x_0 is unknown.
        z = np.asarray(residual, float)
        *numbers, diffuse = self.system()
        moved = _moved(activity, z.shape)
        found = log_likelihoods(np.ascontiguousarray(z.T), moved, np.array([numbers]), diffuse)[0]
        if not np.isfinite(found).all():
            raise RividError("the likelihood of a day is not finite: its residual is too large for a number")
        return np.asarray(found)

    def forecast_errors(
        self, residual: ArrayLike, horizon: int, every: int = 27, first: int = 30,
        activity: ArrayLike | None = None,
    ) -> Floats:  # fmt: skip
        """Return the residual at origin + horizon minus its forecast at the origin [m].

        Rows of the residual (days, n) [m] may be longer than a day if days are consecutive; NaN is missing. w
        and s decay over the horizon [samples] with their memories. Origins are the samples first, first +
        every, ... with a target in the row. Shape (days, origins); NaN where the target is missing, or for a
        pool without a sample up to the origin.
        """
        values, there = gather(residual)
        n, m = values.shape[1], self.system()
        K, _, _ = gains(np.ascontiguousarray(there.T), _moved(activity, there.shape), m, False)
        states, _ = filtered(values, K, m)
        origin = np.arange(first, n - horizon, every)
        x, w, s = np.moveaxis(states[:, origin], -1, 0)
        left = (m.rho * self.recall) ** np.arange(horizon, -1, -1)
        rise = m.c * w * (m.phi ** np.arange(horizon) * left[1:]).sum()
        seen = np.logical_or.accumulate(there, axis=1)[:, origin]
        known = there[:, origin + horizon] & (seen | (not m.diffuse))
        # Each rise of the residual decays from its sample on; gauge noise is subtracted at the origin.
        at = np.maximum.accumulate(np.where(there, np.arange(n), 0), axis=1)
        last = np.take_along_axis(values, at, axis=1)
        fell = lfilter([1.0], [1.0, -self.recall], np.diff(last, axis=1, prepend=0.0), axis=1)
        begun = left[0] * (fell[:, origin] + x - last[:, origin])
        errors = fell[:, origin + horizon] - begun - rise - m.psi**horizon * s
        return np.where(known, errors, np.nan)

    def smooth(self, residual: ArrayLike, activity: ArrayLike | None = None) -> tuple[Floats, Floats]:
        """Estimate w, or x + s of a river, and its deviation from a residual of whole days (days, n)."""
        (values, there), m = gather(residual), self.system()
        there = np.ascontiguousarray(there.T)
        K, S, P = gains(there, _moved(activity, values.shape), m, True)
        inflow, variance = smoothed(*filtered(values, K, m), there, K, S, P, m)
        return inflow, np.sqrt(variance)

    def ahead(self, residual: ArrayLike, activity: ArrayLike | None = None) -> tuple[Floats, Floats]:
        """Return the expected residual and the sd of a reading about it, shape (days, n) [m] each."""
        # Each sample is predicted from the samples present before it; after the last one these are forecasts.
        (values, there), m = gather(residual), self.system()
        K, _, P = gains(np.ascontiguousarray(there.T), _moved(activity, values.shape), m, True)
        states, _ = filtered(values, K, m)
        variance = P[0].T + 2.0 * P[2].T + P[5].T + m.gauge
        return states[..., 0] + states[..., 2], np.sqrt(variance)

    def simulate(
        self, days: int, n: int, rng: np.random.Generator, activity: ArrayLike | None = None
    ) -> Floats:
        """Simulate days of this noise (days, n) [m] with x_0 = 0; the activity (days, n) is 0 by default."""
        m = self.system()
        moved = self.misfit**2 * _moved(activity, (days, n)).T
        of_x, of_s = (moved, 0.0 * moved) if m.diffuse else (0.0 * moved, moved)

        def steps_of(sd: float, phi: float) -> Floats:
            share = np.r_[1.0, np.full(n - 1, np.sqrt(1.0 - phi * phi))]
            return np.asarray(rng.normal(0.0, sd, (days, n)) * share)

        flow, v = steps_of(np.sqrt(m.inflow), m.phi), rng.normal(0.0, 1.0, (days, n))
        w = np.asarray(lfilter([1.0], [1.0, -m.phi], flow, axis=1), float)
        rise = m.c * w + v * np.sqrt(self.walk_sd**2 + of_x)
        xx, xw = start_of(m.c, m.phi, m.rho, m.inflow, m.diffuse)
        known = xw / max(m.inflow, 1e-300)
        first = known * w[:, :1] + np.sqrt(max(xx - known * xw, 0.0)) * rng.standard_normal((days, 1))
        x = lfilter([1.0], [1.0, -m.rho], np.concatenate([first, rise[:, :-1]], axis=1), axis=1)
        level = steps_of(np.sqrt(m.level), m.psi)
        level[:, 1:] += (v * np.sqrt(of_s))[:, :-1] + m.wave * flow[:, 1:]
        if m.wave * m.inflow > 0.0:  # at the start s has a share in w, and earlier innovations
            _, _, _, ws, ss = innovation(m.phi, m.psi, m.inflow, m.level, m.wave)
            rest = np.sqrt(max(ss - m.level - ws**2 / m.inflow, 0.0))
            level[:, 0] += ws / m.inflow * flow[:, 0] + rest * rng.standard_normal(days)
        s = np.asarray(lfilter([1.0], [1.0, -m.psi], level, axis=1), float)
        return np.asarray(x + s + rng.normal(0.0, self.gauge_sd, (days, n)))

    def innovation(self) -> Floats:
        """Return the covariance of a sample's innovations of x, w and s, shape (3, 3), without the misfit."""
        m = self.system()
        ww, ws, ss, *_ = innovation(m.phi, m.psi, m.inflow, m.level, m.wave)
        return np.array([[m.walk, 0.0, 0.0], [0.0, ww, ws], [0.0, ws, ss]], float)

    def system(self) -> System:
        """Return the entries of the filter's matrices."""
        return System._make([*map(float, _numbers(**vars(self))), self.surface_area is not None])


def _moved(activity: ArrayLike | None, shape: tuple[int, ...]) -> Floats:
    """Return the activity in the shape of the filter (n, days); zeros if it is None."""
    if activity is None:
        return np.zeros(shape[::-1])
    moved = np.asarray(activity, float)
    if moved.shape != shape or not (np.isfinite(moved) & (moved >= 0.0)).all():
        raise RividError(f"activity has shape {moved.shape}: expected {shape}, finite numbers of 0 or more")
    return np.ascontiguousarray(moved.T)


def _numbers(
    sample_time: float, surface_area: float | None, inflow_memory: Any, level_memory: Any, walk_sd: Any,
    inflow_sd: Any, level_sd: Any, gauge_sd: Any, misfit: Any, wave: Any, recall: float = 1.0,
) -> tuple[Any, ...]:  # fmt: skip
    """Return the first ten fields of a :class:`System`, each a number or an array."""
    T, A = sample_time, surface_area
    phi, psi = np.exp(-T / inflow_memory), np.exp(-T / level_memory)
    if A is not None:
        return (
            T / A, phi, psi, walk_sd**2, inflow_sd**2, level_sd**2, gauge_sd**2, misfit**2, wave / A, 1.0
        )  # fmt: skip
    rho = np.exp(-T / np.maximum(wave, 1e-3 * T))
    damped = (1.0 - rho) * (1.0 + rho * psi) / ((1.0 + rho) * (1.0 - rho * psi))  # variance of x over w's
    return 1.0 - rho, psi, psi, 0.0, level_sd**2 / damped, 0.0, gauge_sd**2, misfit**2, 0.0, rho


WALK_LIMIT = 1e-3  # largest random walk with a level-type noise [m per sample]: a larger one absorbs the wind


MOST_MISFIT = 2.0  # largest misfit: fronts that are two samples early or late


class Limits(NamedTuple):
    """A model with `free` fields between `low` and `high`; `scale` is the usual change between samples."""

    model: NoiseModel
    free: tuple[str, ...]
    low: Floats
    high: Floats
    scale: float

    def at(self, point: Floats) -> NoiseModel:
        """Return the model at the logarithms of the free fields, shape (f,)."""
        return replace(self.model, **dict(zip(self.free, np.exp(point).tolist(), strict=True)))

    def systems(self, points: Floats) -> Floats:
        """Return the filter's numbers at points (q, f), shape (q, 10)."""
        given = vars(self.model) | dict(zip(self.free, np.exp(points).T, strict=True))
        return np.stack(np.broadcast_arrays(*_numbers(**given)), axis=1)


def limits_of(
    values: Floats, there: Bools, T: float, A: float | None, level: bool, gauge_floor: float, misfit: bool,
    within: Mapping[str, tuple[float, float]],
) -> Limits:  # fmt: skip
    """Return limits derived from the usual change between samples; arguments as for :func:`fit_noise`."""
    n = values.shape[1]
    both = there[:, 1:] & there[:, :-1]
    scale = float(np.sqrt(np.mean(np.diff(values, axis=1)[both] ** 2) / 2.0))
    longest = 10.0 * n * T  # a longer one is infinite within a day
    most_walk = min(10.0 * scale, WALK_LIMIT if level else np.inf)
    bounds = {"gauge_sd": (max(gauge_floor, 1e-3 * scale), max(2.0 * gauge_floor, 10.0 * scale))}
    if A is not None:
        bounds["walk_sd"] = (1e-4 * most_walk, most_walk)
        bounds["inflow_sd"] = (1e-5 * scale * A / T, 10.0 * scale * A / T)
        bounds["inflow_memory"] = (10.0 * T, longest)
    rounding = A is not None and not level and "level_sd" in within
    if A is None or level or rounding:
        bounds["level_sd"] = (1e-3 * scale, 1e3 * scale)
        bounds["level_memory"] = (3.0 * T if A is None else T, longest)
    if misfit:
        bounds["misfit"] = (1e-3, MOST_MISFIT)
    if "wave" in within and "level_memory" in bounds:
        bounds["wave"] = within["wave"]
    for name, (least, most) in within.items():
        if name in bounds:
            low, high = max(least, min(bounds[name][0], most)), min(most, max(bounds[name][1], least))
            bounds[name] = (low, high)
    low, high = np.array(list(bounds.values())).T
    s = 0.5 * within["level_sd"][1] if rounding else 0.0
    wave = 0.3 * bounds["wave"][1] if "wave" in bounds else 0.0
    rest = NoiseModel(scale, 0.0, 0.0, 100.0 * T, s, 10.0 * T, T, A, 0.1 if misfit else 0.0, wave)
    return Limits(rest, tuple(bounds), low, high, scale)


def usual_starts(limits: Limits, level: bool) -> tuple[NoiseModel, ...]:
    """Return starts with weak lasting, strong short or hardly any unknown inflow; with and without wind."""
    z, rest = limits.scale, limits.model
    T, A = rest.sample_time, rest.surface_area
    if A is None:
        slow = replace(rest, gauge_sd=0.5 * z, level_sd=10.0 * z, level_memory=300.0 * T)
        return slow, replace(rest, level_sd=z, level_memory=10.0 * T)
    w = z * A / T
    weak = replace(rest, walk_sd=0.03 * z, inflow_sd=0.05 * w, inflow_memory=100.0 * T)
    short = replace(rest, gauge_sd=0.5 * z, walk_sd=0.1 * z, inflow_sd=0.3 * w, inflow_memory=30.0 * T)
    walk = replace(rest, gauge_sd=0.5 * z, walk_sd=0.3 * z, inflow_sd=0.01 * w, inflow_memory=600.0 * T)
    if not level:
        return weak, short, walk
    return tuple(  # slow changes of level are due to w or s: a likelihood maximum for either
        replace(start, walk_sd=walk * z, level_sd=size * z, level_memory=last * T)
        for start in (weak, short)
        for size, last in ((3.0, 80.0), (1.0, 10.0))
        for walk in (0.01, 0.3)
    )


FEWEST_BLOCKS = 8  # fewest blocks for an estimate of the inflation
KEPT = 0.75
"""Share of squared differences, the smallest ones, used to estimate the inflation: excludes ends of dates."""
KEPT_MEAN = 0.36852  # mean of a chi-square variable with one degree of freedom below its 75 % quantile


def block_inflation(score: Floats, information: Floats, blocks: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """Estimate the variance of block scores over the nominal one, and the correlation of days within blocks.

    Squared differences of means are used, of neighbouring blocks and of days within a block, without the
    largest quarter: an effect that lasts for many blocks cancels, and the ends of its dates are left out.
    Arguments: score (draws, days), information (days,) and blocks (days,); returns two arrays (draws,).
    """
    used = information > 0.0
    g, q = score[:, used], information[used]
    label = np.unique(blocks[used], return_inverse=True)[1]
    first = np.flatnonzero(np.diff(label, prepend=-1))
    inflation = _squares(np.add.reduceat(g, first, axis=1), np.add.reduceat(q, first))
    same = np.diff(label) == 0
    if same.sum() < FEWEST_BLOCKS:
        return inflation, np.zeros(len(g))
    within = _squares(g, q, same)
    days = len(q) / len(first)
    rho = (inflation - within) / np.maximum(inflation + (days - 1.0) * within, 1e-300)
    # Days of a block are not negatively correlated: a factor below that of days is due to chance.
    return np.maximum(inflation, within), np.clip(rho, 0.0, 0.95)


def _squares(g: Floats, q: Floats, kept: Bools | None = None) -> Floats:
    """Return the variance of neighbours' means over the nominal one, from differences; g is (draws, k)."""
    squares = np.diff(g / q, axis=1) ** 2 / (1.0 / q[1:] + 1.0 / q[:-1])
    if kept is not None:
        squares = squares[:, kept]
    many = max(1, round(KEPT * squares.shape[1]))
    smallest = np.partition(squares, many - 1, axis=1)[:, :many]
    return np.asarray(np.maximum(smallest.mean(1) / KEPT_MEAN, 1e-300))


DAY_LIMIT = 1.3  # largest mean square of a day, over the median of the days, at which the day has full weight


STEP = 1e-5  # step of the finite differences, in logarithms: slopes are those half a step ahead


def day_weights(whitened: ArrayLike) -> Floats:
    """Return weights of days (days,): 1 for most, less for a day far noisier than the median.

    min(1, :data:`DAY_LIMIT` x median / mean square) of whitened residuals (days, n), where exact zeros are
    unused samples; 0 for a day without samples.
    """
    r = np.asarray(whitened, float)
    count = (r != 0.0).sum(1)
    square = (r * r).sum(1) / np.maximum(count, 1)
    if not (count > 0).any():
        return np.zeros(len(r))
    allowed = DAY_LIMIT * np.median(square[count > 0])
    return np.where(count > 0, np.minimum(1.0, allowed / np.maximum(square, allowed * 1e-12)), 0.0)


def fit_noise(
    residual: ArrayLike,  # (days, n) [m], for a river reach [m3/s]; NaN is missing
    sample_time: float,
    surface_area: float | None,  # None for a river reach
    *,
    weights: ArrayLike | None = None,  # (days,): of the days' log-likelihoods
    level: bool = False,  # whether a pool has the level-type noise s; a river reach always has it
    gauge_floor: float = 0.0,  # lower limit of gauge_sd [m]: the reading's step / sqrt(12)
    activity: ArrayLike | None = None,  # (days, n) [m2]; with it the noise has a misfit
    # narrower limits of fields; with limits of `level_sd` a pool has a small s as well
    within: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    starts: tuple[NoiseModel, ...] = (),
    alone: bool = False,
) -> NoiseModel:
    """Fit the noise model of greatest likelihood to a residual (days, n), from several starts.

    With the unknown inflow alone, or from one start, the fit can end at an optimum with white w, which hides
    every slow effect: so gauge noise and the memory of w have lower limits, and w and the walk compete. By
    default, days are weighed by :func:`day_weights` of a first fit. With `alone`, the fit begins at `starts`
    only, and ends after :data:`NEAR_STEPS` steps or when a step gains less than some 0.1 nats in 100,000
    samples instead of 1e-3: faster if the starts are near.
    """
    values, there = gather(residual)
    both = there[:, 1:] & there[:, :-1]
    if not np.diff(values, axis=1)[both].any():
        raise RividError("residual has no day that moves: expected a residual that varies; check the logs")
    limits = limits_of(
        values, there, sample_time, surface_area, level, gauge_floor, activity is not None, within
    )
    moved, near = _moved(activity, there.shape), bool(alone and starts)
    if near and "wave" in limits.free and starts[0].wave < sample_time:
        # a wave within a sample hardly changes the likelihood: no step leads to the maximum at a longer one
        longer = replace(starts[0], wave=limits.model.wave)
        if surface_area is not None:
            longer = replace(longer, level_memory=float(limits.high[limits.free.index("wave")]))
        starts += (longer,)

    def climb(days: Floats, begun: tuple[NoiseModel, ...]) -> NoiseModel:
        return _climb(values, there, moved, days, begun, limits, near)

    every = starts if near else usual_starts(limits, level) + starts
    if weights is not None:
        return climb(np.asarray(weights, float), every)
    model = climb(np.ones(len(values)), every)
    w = day_weights(model.whiten(residual, activity=activity))
    return model if (w == 1.0).all() else climb(w, (model,))


NEAR_STEPS = 8
"""Steps from a near start, after which the response is fitted again; also from each of several starts, of
which those within :data:`CLOSE` of the best one are continued."""
CLOSE = 20.0  # log-likelihood by which a start may be behind and still win [nats]: one that was 9 behind did
LANES, FEWEST_LANES = 8, 24
"""The days of a likelihood are padded to a multiple of a vector's length, and to the smallest number for
which the compiled loop uses vectors: 13 days take 0.48 ms, and 24 take 0.22 ms."""


def _climb(
    values: Floats, there: Bools, moved: Floats, weights: Floats, starts: tuple[NoiseModel, ...],
    limits: Limits, near: bool,
) -> NoiseModel:  # fmt: skip
    """Return the model of greatest likelihood from all starts; `near` as `alone` in :func:`fit_noise`."""
    used = weights > 0.0
    samples = weights @ there.sum(1)
    w = weights[used] / samples  # mean per sample: one tolerance fits all
    more = (0, max(-len(w) % LANES, FEWEST_LANES - len(w)))
    w = np.pad(w, more)
    z = np.pad(np.where(there, values, np.nan)[used], (more, (0, 0)), constant_values=np.nan)
    z, moved = np.ascontiguousarray(z.T), np.pad(np.ascontiguousarray(moved[:, used]), ((0, 0), more))
    diffuse = limits.model.surface_area is not None
    around = STEP * np.concatenate([np.zeros((1, len(limits.free))), np.eye(len(limits.free))])

    def cost(p: Floats) -> tuple[float, Floats]:
        """Return minus the mean log-likelihood of a sample, and its slopes by finite differences."""
        days = log_likelihoods(z, moved, limits.systems(p + around), diffuse)
        at, *near = -(days @ w)
        return float(at), (np.array(near) - at) / STEP

    low, high = np.log(limits.low), np.log(limits.high)

    def climb(start: Floats, most: int, least: float) -> Any:
        return minimize(
            cost, start, jac=True, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)),
            options={"maxiter": most, "ftol": least, "gtol": 1e-6},
        )  # fmt: skip

    given = [np.array([max(getattr(start, name), 1e-300) for name in limits.free]) for start in starts]
    ends = [climb(np.clip(np.log(start), low, high), NEAR_STEPS, 1e-6) for start in given]
    if not near:
        least = min(float(end.fun) for end in ends) + CLOSE / samples
        ends = [climb(end.x, 200, 1e-8) for end in ends if end.fun <= least]
    return limits.at(min(ends, key=lambda end: float(end.fun)).x)
