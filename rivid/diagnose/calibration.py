"""A calibrated response: its estimates and their errors, its noise, and what is left."""

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnose.data import Record
from rivid.diagnose.marquardt import at_limit
from rivid.diagnose.noise import NoiseModel
from rivid.diagnose.response import Floats, FreeParameter, Response

R = TypeVar("R", bound=Response)


@dataclass(frozen=True)
class Estimate:
    """A calibrated parameter.

    Attributes
    ----------
    name, unit : str
    value, low, high : float
        In its unit; `low` and `high` bound 95 %, inside the parameter's limits.
    sd : float
        Standard error on the scale of the calibration: a share, where that is logarithmic.
    at_limit : bool
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    sd: float
    at_limit: bool


class Step(NamedTuple):
    """A step that was accepted: cost before and after, under one noise; the round it belongs to."""

    round: int
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class Calibration(Generic[R]):
    """A response fitted to a record.

    Attributes
    ----------
    response : Response
        At its estimates.
    estimates : tuple of Estimate
        Length p.
    covariance : ndarray, shape (p, p)
        Of the parameters on their scale, prior included; zero rows for those at a limit.
    noise : NoiseModel
        Of the residual of the fit days.
    weights : ndarray, shape (days,)
        Of every day of the record; 0 for days that did not fit, or were trimmed.
    cost : float
        C at the end.
    steps : tuple of Step
        All steps taken.
    rounds : int
        Times that the noise was fitted.
    converged : bool
        Whether the last round moved nothing that matters.
    residual : ndarray, shape (days, n)
        Measured less simulated on all rows, lead time included; NaN where nothing was measured.
    jacobian : ndarray, shape (p, days, n)
        Derivatives of the output on all rows [m or m3/s per unit of the parameter's scale].
    """

    response: R
    estimates: tuple[Estimate, ...]
    covariance: Floats
    noise: NoiseModel
    weights: Floats
    cost: float
    steps: tuple[Step, ...]
    rounds: int
    converged: bool
    residual: Floats
    jacobian: Floats

    @property
    def at_limit(self) -> tuple[str, ...]:
        """Names of the parameters that sit at a limit."""
        return tuple(e.name for e in self.estimates if e.at_limit)

    def whitened(self, record: Record, columns: ArrayLike) -> Floats:
        """Columns (..., days, n) whitened on the samples that count, as the fit sees them."""
        return self.noise.whiten(columns, like=np.where(record.used, record.output, np.nan))


def estimate(p: FreeParameter, sd: float) -> Estimate:
    """A parameter with its standard error, on its own scale."""
    low, high = (p.to_natural(min(max(p.value + s * 1.96 * sd, p.low), p.high)) for s in (-1.0, 1.0))
    return Estimate(p.name, p.unit, p.natural, low, high, sd, at_limit(p))
