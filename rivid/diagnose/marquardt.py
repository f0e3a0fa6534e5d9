"""Levenberg and Marquardt's step on whitened residuals, with Gaussian priors and limits."""

from typing import NamedTuple

import numpy as np

from rivid.diagnose.data import Record
from rivid.diagnose.noise import NoiseModel
from rivid.diagnose.response import Floats, FreeParameter, Response
from rivid.errors import RividError
from rivid.reach.changes import Changes

AT_LIMIT = 1e-9
"""This close to a limit, as a share of the way between both, is at it."""


class Problem:
    """The cost on some days, under one noise and one set of weights.

    Parameters
    ----------
    record : Record
    changes : Changes
        What effects change on its grid.
    noise : NoiseModel
    weights : ndarray, shape (days,)
    """

    def __init__(self, record: Record, changes: Changes, noise: NoiseModel, weights: Floats) -> None:
        self.record, self.changes, self.noise = record, changes, noise
        self.root = np.sqrt(weights)[:, None]
        self.like = np.where(record.used, record.output, np.nan)

    def whiten(self, columns: Floats) -> Floats:
        """Columns (..., days, n) whitened and weighted."""
        return self.noise.whiten(columns, like=self.like) * self.root

    def try_baseline(self, response: Response) -> Floats | None:
        """The output, or None where the water cannot flow so."""
        try:
            return response.baseline(self.record, self.changes)
        except RividError:
            return None

    def cost(self, response: Response, base: Floats) -> float:
        """The cost of a response that gives `base`."""
        r = self.whiten(counted(self.record, base))
        return 0.5 * float(np.vdot(r, r)) + 0.5 * float((_deviation(response) ** 2).sum())

    def linear(self, response: Response, base: Floats) -> "Linear":
        """The problem made linear about a response that gives `base`."""
        return self.linear_of(response, base, response.slopes(self.record, base, self.changes))

    def linear_of(self, response: Response, base: Floats, slopes: Floats) -> "Linear":
        """The same with known derivatives, shape (p, days, n)."""
        r = self.whiten(counted(self.record, base)).ravel()
        X = self.whiten(slopes).reshape(len(slopes), -1)
        sd = np.array([p.sd for p in response.parameters])
        return Linear(X @ X.T, X @ r, sd, _deviation(response), response.parameters)


class Linear(NamedTuple):
    """Normal equations ``(X X' + prior) step = X r - prior``."""

    G: Floats
    g: Floats
    sd: Floats
    deviation: Floats
    parameters: tuple[FreeParameter, ...]

    @property
    def information(self) -> Floats:
        """Second derivatives of the cost."""
        return self.G + np.diag(self.sd**-2.0)

    def move(self, damping: float) -> Floats:
        """The damped step; what would leave the limits stays on them, and the rest is solved again."""
        H, slope = self.information, self.g - self.deviation / self.sd
        H = H + damping * np.diag(np.diag(H))
        low = np.array([p.low - p.value for p in self.parameters])
        high = np.array([p.high - p.value for p in self.parameters])
        held = np.zeros(len(slope), bool)
        step = np.zeros(len(slope))
        for _ in range(len(slope)):
            free = ~held
            step[free] = np.linalg.solve(
                H[np.ix_(free, free)], slope[free] - H[np.ix_(free, held)] @ step[held]
            )
            out = free & ((step < low) | (step > high))
            if not out.any():
                break
            step[out] = np.clip(step[out], low[out], high[out])
            held |= out
            if held.all():
                break
        return step

    def covariance(self) -> Floats:
        """Inverse of the information of the parameters that are not at a limit; zero for the others."""
        free = np.array([not at_limit(p) for p in self.parameters])
        covariance = np.zeros_like(self.G)
        if free.any():
            covariance[np.ix_(free, free)] = np.linalg.inv(self.information[np.ix_(free, free)])
        return covariance

    def small(self, step: Floats, share: float) -> bool:
        """Whether a step moves every parameter by less than a share of what would matter.

        That is its standard error, and a hundredth of what was known before: a model that does not fit has
        far smaller standard errors than it has errors.
        """
        error = np.sqrt(np.diag(np.linalg.inv(self.information))) + 0.01 * self.sd
        return bool((np.abs(step) < share * error).all())


def counted(record: Record, base: Floats) -> Floats:
    """The residual on the samples that count, NaN elsewhere."""
    return np.where(record.used, record.output - base, np.nan)


def _deviation(response: Response) -> Floats:
    """How far each parameter is from its prior mean, in prior standard deviations."""
    return np.array([(p.value - p.mean) / p.sd for p in response.parameters])


def at_limit(p: FreeParameter) -> bool:
    """Whether a parameter sits at one of its limits."""
    return min(p.value - p.low, p.high - p.value) <= AT_LIMIT * (p.high - p.low)
