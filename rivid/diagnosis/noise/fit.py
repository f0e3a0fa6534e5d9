"""The noise of greatest likelihood, and the weights of days that are noisier than most."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.noise.starts import Limits, limits_of, usual_starts
from rivid.errors import RividError
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.noise.kalman import Days


DAY_LIMIT = 1.3
"""A day's mean square may be this many times the median's before the day loses weight."""

STEP = 1e-4
"""Of the differences that give slopes, in logarithms."""


def day_weights(whitened: ArrayLike, limit: float = DAY_LIMIT) -> Floats:
    """Weights of days, 1 for most, less for a day far noisier than the median.

    Parameters
    ----------
    whitened : array_like, shape (days, n)
        Whitened residual; exact zeros are samples that do not count.
    limit : float
        A day's mean square may be this many times the median's.

    Returns
    -------
    ndarray, shape (days,)
        min(1, limit x median / mean square); 0 for a day without samples.
    """
    r = np.asarray(whitened, float)
    count = (r != 0.0).sum(1)
    square = (r * r).sum(1) / np.maximum(count, 1)
    if not (count > 0).any():
        return np.zeros(len(r))
    allowed = limit * np.median(square[count > 0])
    return np.where(count > 0, np.minimum(1.0, allowed / np.maximum(square, allowed * 1e-12)), 0.0)


def fit_noise(
    residual: ArrayLike,
    sample_time: float,
    surface_area: float | None,
    *,
    weights: ArrayLike | None = None,
    level: bool = False,
    gauge_floor: float = 0.0,
    walk_limit: float | None = None,
    memory_floor: float | None = None,
    starts: tuple[NoiseModel, ...] = (),
    alone: bool = False,
) -> NoiseModel:
    """The noise model of greatest likelihood, from several starts.

    With the unknown inflow alone, or from one start, the fit can end at "w is white", an optimum that hides
    every slow effect: so gauge noise and the memory of w have lower limits, and w and the walk compete.

    Parameters
    ----------
    residual : array_like, shape (days, n)
        [m]; NaN is missing. For a river reach [m3/s].
    sample_time, surface_area : float
        T_s [s] and A [m2]; A is None for a river reach.
    weights : array_like, shape (days,), optional
        Of each day's log-likelihood. Default: fit, weigh days by :func:`day_weights`, fit again.
    level : bool
        Whether a pool has the level-type noise s (a river reach always has).
    gauge_floor : float
        Lower limit of gauge_sd [m]: the reading's step / sqrt(12).
    walk_limit : float, optional
        Upper limit of walk_sd [m per sample]; default none, or
        :data:`rivid.diagnosis.noise.starts.WALK_LIMIT` with `level`.
    memory_floor : float, optional
        Lower limit of w's memory [s]; default ten samples.
    starts : tuple of NoiseModel
        Further starts, say the model of the last round.
    alone : bool
        Begin at `starts` only: quicker, where they are near.

    Raises
    ------
    RividError
        Where there is too little to fit.
    """
    from rivid.diagnosis.noise.kalman import gather

    days = gather(residual)
    both = days.there[:, 1:] & days.there[:, :-1]
    if not np.diff(days.values, axis=1)[both].any():
        raise RividError("residual has no day that moves: nothing to fit a noise to; check the logs")
    limits = limits_of(days, sample_time, surface_area, level, gauge_floor, walk_limit, memory_floor)
    usual = () if alone and starts else usual_starts(limits, surface_area is not None, level)
    begin = usual + starts
    if weights is not None:
        given = np.asarray(weights, float)
        if given.shape != (len(days.values),) or not (given >= 0.0).all() or not given.any():
            raise RividError(f"weights of days are {given}: expected one a day, 0 or more, and not all 0")
        return _climb(days, given, begin, limits)
    model = _climb(days, np.ones(len(days.values)), begin, limits)
    w = day_weights(model.whiten(residual))
    return model if (w == 1.0).all() else _climb(days, w, (model,), limits)


def _climb(days: "Days", weights: Floats, starts: tuple[NoiseModel, ...], limits: Limits) -> NoiseModel:
    """The likeliest model that the starts lead to."""
    from scipy.optimize import minimize

    from rivid.diagnosis.noise.kalman import lanes, log_likelihoods

    used = weights > 0.0
    w = weights[used] / (weights @ days.there.sum(1))  # a mean a sample: one tolerance fits all
    order, ends, there = lanes(days.pattern[used], days.patterns)
    values = np.ascontiguousarray(days.values[used][order].T)
    free = len(limits.free)
    around = STEP * np.concatenate([np.zeros((1, free)), np.eye(free), -np.eye(free)])

    def cost(p: Floats) -> tuple[float, Floats]:
        """Less the mean log-likelihood of a sample, and its slopes by central differences."""
        likelihoods = np.empty((len(around), len(order)))
        systems = limits.systems(p + around)
        likelihoods[:, order] = log_likelihoods(values, ends, there, systems, limits.model.diffuse)
        here, *near = (-float(w @ row) for row in likelihoods)
        return here, (np.array(near[:free]) - np.array(near[free:])) / (2.0 * STEP)

    low, high = np.log(limits.low), np.log(limits.high)
    found = []
    for start in starts:
        given = np.array([max(getattr(start, name), 1e-300) for name in limits.free])
        found.append(
            minimize(
                cost, np.clip(np.log(given), low, high), jac=True, method="L-BFGS-B",
                bounds=list(zip(low, high, strict=True)),
                options={"maxiter": 200, "ftol": 1e-10, "gtol": 1e-6},
            )
        )  # fmt: skip
    return limits.at(min(found, key=lambda end: float(end.fun)).x)
