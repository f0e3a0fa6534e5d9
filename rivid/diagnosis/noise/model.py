"""The noise of a simulated reach: unknown inflow, random walk, gauge noise and wind, day by day.

The residual is z = measured level - simulated level. Each day is a fresh start, and at sample k

    z_k = x_k + s_k + e_k,    x_{k+1} = x_k + (T_s / A) w_k + v_k,

w an unknown inflow and s a noise of the level (wind), both first-order autoregressive, v the walk of the
level error, e white gauge noise; nothing is known of x_0. For a river reach, whose output is a discharge,
there is no A, no x and no w: z_k = s_k + e_k, and s is the unknown inflow as it arrives; its mean is 0, so
that a constant inflow stays a thing to find.
"""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rivid.errors import RividError
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.noise.kalman import System

Number = float | Floats


class Smoothed(NamedTuple):
    """What a whole day says of the hidden parts; arrays of shape (days, n).

    Attributes
    ----------
    inflow, inflow_sd : ndarray
        The unknown inflow w and its standard deviation [m3/s]; of a river reach, s.
    level : ndarray
        The level error x [m], without gauge noise and wind; NaN on a day without samples. Of a river
        reach, s [m3/s].
    wind : ndarray
        The noise of the level s [m]; of a river reach, s [m3/s].
    """

    inflow: Floats
    inflow_sd: Floats
    level: Floats
    wind: Floats


@dataclass(frozen=True)
class NoiseModel:
    """The noise of one reach: a filter that is linear and the same for every day with the same gaps.

    Attributes
    ----------
    gauge_sd : float
        White gauge noise e [m]; of a river reach [m3/s].
    walk_sd : float
        Step of the random walk v [m per sample].
    inflow_sd, inflow_memory : float
        Unknown inflow w: standard deviation [m3/s] and memory [s]; correlation exp(-t / memory).
    level_sd, level_memory : float
        Noise of the level s: standard deviation [m] and memory [s]; of a river reach [m3/s].
    sample_time : float
        T_s [s].
    surface_area : float or None
        A [m2]; None for a river reach.

    Raises
    ------
    RividError
        Where a number makes no sense.
    """

    gauge_sd: float
    walk_sd: float
    inflow_sd: float
    inflow_memory: float
    level_sd: float
    level_memory: float
    sample_time: float
    surface_area: float | None

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
                f"noise model: walk_sd is {self.walk_sd} and inflow_sd {self.inflow_sd}: expected 0 for "
                "a river reach, which has neither; use level_sd or give surface_area"
            )

    def whiten(self, columns: ArrayLike, like: ArrayLike | None = None) -> Floats:
        """Innovations over their standard deviations: white and of variance 1 if the columns are this noise.

        Parameters
        ----------
        columns : array_like, shape (..., days, n)
            Residuals or effect columns [m]; the filter is the same linear one for all.
        like : array_like, shape (days, n), optional
            NaN here is a missing sample. Default: a sample that any of the columns lacks.

        Returns
        -------
        ndarray, shape (..., days, n)
            0 at missing samples and at each day's first one, which only sets the start.

        Raises
        ------
        RividError
            Where shapes do not fit, or a column lacks a sample that `like` has.
        """
        from rivid.diagnosis.noise.kalman import gather, innovations, lanes

        given = np.asarray(columns, float)
        if given.ndim < 2:
            raise RividError(f"columns have shape {given.shape}: expected (..., days, n)")
        stack = np.ascontiguousarray(given.reshape(-1, *given.shape[-2:]))
        days = gather(stack.sum(0) if like is None else like)
        if stack.shape[1:] != days.values.shape:
            raise RividError(
                f"columns have shape {given.shape}: expected (..., days, n) = (..., {days.values.shape})"
            )
        m = self.system()
        white, finite = innovations(stack, *lanes(days.pattern, days.patterns), m.matrix, m.diffuse)
        if not finite:
            raise RividError(
                "a column is not finite where the residual is: simulate it on every sample that is read"
            )
        return np.asarray(white).reshape(given.shape)

    def log_likelihood(self, residual: ArrayLike) -> Floats:
        """Log-likelihood of each day, shape (days,), of a residual (days, n) [m]; NaN is missing.

        For a pool it is that of the differences from the day's first sample, since nothing is known of x_0.
        """
        from rivid.diagnosis.noise.kalman import gather, lanes, log_likelihoods

        days = gather(residual)
        order, ends, there = lanes(days.pattern, days.patterns)
        m, values = self.system(), np.ascontiguousarray(days.values[order].T)
        out = np.empty(len(order))
        out[order] = log_likelihoods(values, ends, there, m.matrix, m.diffuse)[0]
        return out

    def forecast_errors(self, residual: ArrayLike, horizon: int, every: int = 27, first: int = 30) -> Floats:
        """Residual at origin + horizon less its forecast from what is known at the origin [m].

        Parameters
        ----------
        residual : array_like, shape (days, n)
            [m]; NaN is missing. Rows may be longer than a day where days continue.
        horizon : int
            [samples]; w and s decay over it as their memories say.
        every, first : int
            Origins are the samples first, first + every, ... with a target in the row.

        Returns
        -------
        ndarray, shape (days, origins)
            NaN where the target is missing, or nothing was read up to the origin.
        """
        from rivid.diagnosis.noise.kalman import filtered, gains, gather

        days = gather(residual)
        n = days.values.shape[1]
        if horizon < 1 or every < 1 or first < 0 or first + horizon >= n:
            raise RividError(
                f"forecast of {horizon} samples from sample {first} on: a row has {n}; "
                "use a shorter horizon or longer rows"
            )
        m = self.system()
        K, _, _ = gains(np.ascontiguousarray(days.patterns.T), m.matrix, m.diffuse, False)
        states, _ = filtered(days.values, days.pattern, K, m)
        origin = np.arange(first, n - horizon, every)
        x, w, s = np.moveaxis(states[:, origin], -1, 0)
        forecast = x + m.c * w * (m.phi ** np.arange(horizon)).sum() + m.psi**horizon * s
        there = days.there
        seen = np.logical_or.accumulate(there, axis=1)[:, origin]
        known = there[:, origin + horizon] & (seen | (not m.diffuse))
        return np.where(known, days.values[:, origin + horizon] - forecast, np.nan)

    def smooth(self, residual: ArrayLike) -> Smoothed:
        """The hidden parts given whole days of a residual (days, n) [m]; NaN is missing."""
        from rivid.diagnosis.noise.kalman import filtered, gains, gather, smoothed

        days = gather(residual)
        m = self.system()
        there = np.ascontiguousarray(days.patterns.T)
        K, S, P = gains(there, m.matrix, m.diffuse, True)
        states, v = filtered(days.values, days.pattern, K, m)
        mean, variance = smoothed(states, v, days.pattern, there, K, S, P, m)
        x, w, s = np.moveaxis(mean, -1, 0)
        if self.surface_area is None:
            return Smoothed(s, np.sqrt(variance[..., 2]), s, s)
        return Smoothed(w, np.sqrt(variance[..., 1]), x, s)

    def simulate(self, days: int, n: int, rng: np.random.Generator) -> Floats:
        """Days of this noise, shape (days, n) [m], with x_0 = 0."""
        from scipy.signal import lfilter

        m = self.system()

        def memory(sd: float, phi: float) -> Floats:
            steps = rng.normal(0.0, sd, (days, n)) * np.r_[1.0, np.full(n - 1, np.sqrt(1.0 - phi * phi))]
            return np.asarray(lfilter([1.0], [1.0, -phi], steps, axis=1), float)

        rise = m.c * memory(self.inflow_sd, m.phi) + rng.normal(0.0, 1.0, (days, n)) * self.walk_sd
        x = np.concatenate([np.zeros((days, 1)), np.cumsum(rise[:, :-1], axis=1)], axis=1)
        return x + memory(self.level_sd, m.psi) + rng.normal(0.0, self.gauge_sd, (days, n))

    def system(self) -> "System":
        """What the filter is made of."""
        from rivid.diagnosis.noise.kalman import System

        told = entries(*(getattr(self, f.name) for f in fields(self)))
        c, phi, psi, walk, inflow, level, gauge = (float(entry) for entry in told)
        return System(c, phi, psi, walk, inflow, level, gauge, self.diffuse)

    @property
    def diffuse(self) -> bool:
        """Whether nothing is known of where a day starts."""
        return self.surface_area is not None


def entries(
    gauge_sd: Number,
    walk_sd: Number,
    inflow_sd: Number,
    inflow_memory: Number,
    level_sd: Number,
    level_memory: Number,
    sample_time: float,
    surface_area: float | None,
) -> tuple[Number, ...]:
    """c, phi, psi, and the variances of v, w, s and e, of numbers or arrays alike."""
    T, A = sample_time, surface_area
    phi, psi = np.exp(-T / inflow_memory), np.exp(-T / level_memory)
    return 0.0 if A is None else T / A, phi, psi, walk_sd**2, inflow_sd**2, level_sd**2, gauge_sd**2
