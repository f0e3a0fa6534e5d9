"""Calibrate a reach response: Levenberg-Marquardt on whitened residuals, noise and weights in between.

The cost, with r the whitened residual of the days that fit, w their weights, p the parameters:

    C(p) = 1/2 sum_d w_d sum_k r_dk(p)^2 + 1/2 sum_i ((p_i - mean_i) / sd_i)^2.

Noise and weights stand still while a step is tried, and are fitted anew between steps.
"""

from collections.abc import Callable
from typing import Generic, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.diagnose.calibration import Calibration, R, Step, estimate
from rivid.diagnose.data import Record
from rivid.diagnose.gap import residual_of
from rivid.diagnose.marquardt import Problem, counted
from rivid.diagnose.noise import NoiseModel, day_weights, fit_noise
from rivid.diagnose.response import Floats, vector_of
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes

COARSE = 3
"""Every how many fit days the first stage takes."""
FEWEST_COARSE = 4
"""With fewer days than this the first stage would take, there is none."""
ROUNDS = 12
"""Most rounds (noise, weights, then steps) of a stage."""
STEPS = 3
"""Most steps of a round: more would fit to a noise that is known to be wrong."""
PLAIN_STEPS = 10
"""Most steps under the white noise that a river begins with."""
SETTLED, ROUGH = 0.1, 0.5
"""A round that moves every parameter by less than this share of its standard error is the last; in the first
stage, on few days, a larger share."""
DAMPING, MOST_DAMPING = 1e-3, 1e8


class Refit(Protocol):
    """Fits the noise to a residual (days, n), NaN where missing, with weights (days,)."""

    def __call__(
        self, residual: Floats, weights: Floats, surface_area: float | None, last: NoiseModel | None
    ) -> NoiseModel:
        """`last` is the noise of the round before."""
        ...


def calibrate(
    response: R,
    record: Record,
    fit: ArrayLike | None = None,
    *,
    refit: Refit | None = None,
    changes: Callable[[Record], Changes] | None = None,
    trim: float = 0.0,
    rounds: int = ROUNDS,
) -> Calibration[R]:
    """Fit a response's parameters, its noise and the weights of days.

    Parameters
    ----------
    response : Response
        Where to start, with priors and limits.
    record : Record
    fit : array_like of bool, shape (days,), optional
        Days that fit; default all.
    refit : callable, optional
        Residual, weights, surface area and the last noise, to the next noise. Default:
        :func:`rivid.diagnose.noise.fit_noise`.
    changes : callable, optional
        What effects change on the grid of a record; default nothing.
    trim : float
        Share of the fit days that is left out, the worst ones: for effects present on many days, which would
        bend the response.
    rounds : int
        Most rounds of each of the two stages: every third fit day, then all.

    Raises
    ------
    RividError
        Where no day fits, a share cannot be trimmed, or the start cannot be simulated.
    """
    if not 0.0 <= trim < 0.9:
        raise RividError(f"trim = {trim}: expected a share of days from 0 to 0.9")
    days = np.ones(record.days, bool) if fit is None else np.asarray(fit, bool)
    days = days & record.used.any(axis=1)
    if not days.any():
        raise RividError("no fit day has a reading: nothing to calibrate on; check the split and the logs")
    made = changes or _no_changes
    fitter = _Fitter(response, refit or _refit(record), made, trim, rounds)
    few = np.flatnonzero(days)[::COARSE]
    if len(few) >= FEWEST_COARSE:
        fitter.stage(record.take(few), ROUGH)
        fitter.response = fitter.response.settled(record)
    rows = np.flatnonzero(days)
    converged = fitter.stage(record.take(rows), SETTLED)
    return fitter.result(record, rows, converged)


def _no_changes(record: Record) -> Changes:
    return NO_CHANGES


def _refit(record: Record) -> Refit:
    def fitted(
        residual: Floats, weights: Floats, surface_area: float | None, last: NoiseModel | None
    ) -> NoiseModel:
        starts = () if last is None else (last,)
        return fit_noise(residual, record.sample_time, surface_area, weights=weights, starts=starts)

    return fitted


class _Fitter(Generic[R]):
    """The state of a calibration between stages."""

    def __init__(
        self, response: R, refit: Refit, changes: Callable[[Record], Changes], trim: float, rounds: int
    ) -> None:
        self.response, self.refit, self.changes = response, refit, changes
        self.trim, self.rounds = trim, rounds
        self.noise: NoiseModel | None = None
        self.fitted = False
        self.steps: list[Step] = []
        self.count = 0
        self.cost = np.nan
        self.weights = np.zeros(0)

    def stage(self, record: Record, settle: float) -> bool:
        """Rounds on some days until they move little, in standard errors; whether they did."""
        self.weights = np.ones(record.days)
        changes = self.changes(record)
        for _ in range(self.rounds):
            base = self.response.baseline(record, changes)
            self._weigh(record, counted(record, base))
            self.count += 1
            if self._steps(record, changes, base, settle) and self.fitted:
                return True
        return False

    def _weigh(self, record: Record, residual: Floats) -> None:
        """Noise for the weights, then weights for the noise; the trimmed days change with both."""
        area = self.response.surface_area
        if self.trim > 0.0 and (area is None or self.noise is not None):
            # A river's unknown inflow has mean 0: its residual itself tells a bad day, a constant one too. A
            # pool's drifts, and only what is new in it counts.
            told = residual if area is None or self.noise is None else self.noise.whiten(residual)
            self.weights = _untrimmed(told, self.trim)
        kept = self.weights > 0.0
        self.fitted = area is not None or self.noise is not None
        if self.fitted:
            self.noise = self.refit(residual, self.weights, area, self.noise)
        else:
            self.noise = _plain(residual[kept], record.sample_time)
        white = self.noise.whiten(residual)
        self.weights = day_weights(np.where(kept[:, None], white, 0.0))

    def _steps(self, record: Record, changes: Changes, base: Floats, settle: float) -> bool:
        """Steps under one noise; whether the first of them moved nothing that matters."""
        assert self.noise is not None
        problem = Problem(record, changes, self.noise, self.weights)
        damping = DAMPING
        self.cost = problem.cost(self.response, base)
        settled = True
        for _ in range(STEPS if self.fitted else PLAIN_STEPS):
            linear = problem.linear(self.response, base)
            taken = None
            while taken is None and damping < MOST_DAMPING:
                move = linear.move(damping)
                moved = self.response.with_parameters(vector_of(self.response) + move)
                trial = problem.try_baseline(moved)
                after = np.inf if trial is None else problem.cost(moved, trial)
                if trial is not None and after <= self.cost:
                    self.steps.append(Step(self.count, self.cost, after))
                    self.response, base, self.cost, taken = moved, trial, after, move
                    damping = max(damping / 10.0, 1e-9)
                elif linear.small(move, settle):
                    break
                else:
                    damping *= 10.0
            if taken is None or linear.small(taken, settle):
                break
            settled = False
        return settled

    def result(self, record: Record, rows: NDArray[np.intp], converged: bool) -> Calibration[R]:
        """Residual and derivatives on all rows, and errors of the estimates."""
        assert self.noise is not None
        changes = self.changes(record)
        base = self.response.baseline(record, changes)
        jacobian = self.response.slopes(record, base, changes)
        part = record.take(rows)
        problem = Problem(part, changes, self.noise, self.weights)
        linear = problem.linear_of(self.response, base[rows], jacobian[:, rows])
        covariance = linear.covariance()
        weights = np.zeros(record.days)
        weights[rows] = self.weights
        sd = np.sqrt(np.diag(covariance))
        return Calibration(
            response=self.response,
            estimates=tuple(
                estimate(p, float(s)) for p, s in zip(self.response.parameters, sd, strict=True)
            ),
            covariance=covariance, noise=self.noise, weights=weights, cost=float(self.cost),
            steps=tuple(self.steps), rounds=self.count, converged=converged,
            residual=residual_of(record, base), jacobian=jacobian,
        )  # fmt: skip


def _plain(residual: Floats, sample_time: float) -> NoiseModel:
    """White noise as large as a river's residual.

    A wave that comes too early or too late leaves a residual with a long memory; whitened by that, only the
    steepest flanks would count, and the fit would end where these match by chance.
    """
    sd = max(float(np.sqrt(np.nanmean(residual**2))), 1e-9)
    return NoiseModel(sd, 0.0, 0.0, sample_time, 0.0, sample_time, sample_time, None)


def _untrimmed(residual: Floats, trim: float) -> Floats:
    """1 for the days of the smallest mean squares, 0 for the share that is trimmed."""
    there = np.isfinite(residual) & (residual != 0.0)
    square = np.where(there, residual, 0.0) ** 2
    mean = square.sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    kept = max(round((1.0 - trim) * len(mean)), 1)
    weights = np.zeros(len(mean))
    weights[np.argsort(mean, kind="stable")[:kept]] = 1.0
    return weights
