"""What a calibrated reach response is: free parameters, and the output that it gives for the logs.

An effect is sought in the difference of two outputs, so an output must not drift away from the measurement:
a volume error of one hour would stay for ever. :meth:`Response.baseline` is therefore linearised about the
observed course, while :meth:`Response.simulate` runs free.
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from rivid.diagnosis.data import Record
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.types import Floats

STEP = 0.01
"""Steps of differences, in prior standard deviations: on a pool, slopes are then right to a hundredth."""
START_SAMPLES = 5
"""Readings whose mean starts a row."""


@dataclass(frozen=True)
class FreeParameter:
    """A number that the calibration may move; all but `name` and `unit` on the scale that it moves on.

    Attributes
    ----------
    name, unit : str
        As people know it; the unit is that of :attr:`natural`.
    value : float
        Where it is: its logarithm where `log`, else itself.
    mean, sd : float
        Gaussian prior.
    low, high : float
        Limits, both allowed.
    log : bool
        Whether the scale is logarithmic.
    """

    name: str
    unit: str
    value: float
    mean: float
    sd: float
    low: float
    high: float
    log: bool = False

    @classmethod
    def positive(cls, name: str, unit: str, nominal: float, sd: float, reach: float = 4.0) -> "FreeParameter":
        """A positive number, known to a share of `sd`, with limits `reach` of these away."""
        if not nominal > 0.0 or not math.isfinite(nominal):
            raise RividError(f"{name} = {nominal} {unit}: expected a positive number")
        at = math.log(nominal)
        return cls(name, unit, at, at, sd, at - reach * sd, at + reach * sd, log=True)

    @property
    def natural(self) -> float:
        """The value in its unit."""
        return self.to_natural(self.value)

    def to_natural(self, value: float) -> float:
        """A number of this scale in the parameter's unit."""
        return math.exp(value) if self.log else value

    def at(self, value: float) -> "FreeParameter":
        """The same parameter elsewhere, inside its limits."""
        return replace(self, value=min(max(float(value), self.low), self.high))


class Response(Protocol):
    """A reach model that can be calibrated.

    Attributes
    ----------
    name : str
        Canonical name.
    parameters : tuple of FreeParameter
        Length p.
    surface_area : float or None
        A [m2], by which an unknown inflow becomes a rise of the level; None for a river reach.
    """

    @property
    def name(self) -> str: ...

    @property
    def parameters(self) -> tuple[FreeParameter, ...]: ...

    @property
    def surface_area(self) -> float | None: ...

    def with_parameters(self, vector: ArrayLike) -> Self:
        """The same model with other values, shape (p,), on the parameters' scale; limits hold."""
        ...

    def settled(self, record: Record) -> Self:
        """The same model with what is not continuous, such as lags in samples, where its values put it."""
        ...

    def baseline(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Output for the logs, linearised about the observed course, shape (days, n) [m or m3/s]."""
        ...

    def simulate(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Output for the logs, free from each row's start, shape (days, n) [m or m3/s]."""
        ...

    def slopes(self, record: Record, base: Floats, changes: Changes = NO_CHANGES) -> Floats:
        """Derivatives of :meth:`baseline`, of which `base` is the value, shape (p, days, n)."""
        ...


def vector_of(response: Response) -> Floats:
    """Values of the free parameters on their scale, shape (p,)."""
    return np.array([parameter.value for parameter in response.parameters])


def placed(parameters: tuple[FreeParameter, ...], vector: ArrayLike) -> tuple[FreeParameter, ...]:
    """Parameters at other values.

    Raises
    ------
    RividError
        Where there are not as many values as parameters, or one is no number.
    """
    values = np.asarray(vector, float)
    if values.shape != (len(parameters),) or not np.isfinite(values).all():
        raise RividError(
            f"parameters {values.tolist()}: expected {len(parameters)} finite numbers, "
            f"for {', '.join(p.name for p in parameters)}"
        )
    return tuple(p.at(v) for p, v in zip(parameters, values, strict=True))


def slopes_by_differences(
    response: Response, record: Record, base: Floats, changes: Changes, which: range
) -> Floats:
    """Derivatives of the baseline by one run each, into the limits; shape (len(which), days, n)."""
    columns = np.empty((len(which), *base.shape))
    start = vector_of(response)
    for row, i in enumerate(which):
        p = response.parameters[i]
        h = STEP * p.sd
        if p.value + h > p.high:
            h = -h
        moved = start.copy()
        moved[i] += h
        columns[row] = (response.with_parameters(moved).baseline(record, changes) - base) / h
    return columns


def start_level(output: Floats, otherwise: float) -> Floats:
    """Mean of each row's first readings, shape (days,); another level where a row has none."""
    levels = np.full(len(output), otherwise)
    for day, row in enumerate(output):
        finite = row[np.isfinite(row)]
        if len(finite):
            levels[day] = finite[:START_SAMPLES].mean()
    return levels


def gauge_of(record: Record, changes: Changes) -> Floats:
    """What the gauge gives above the water, shape (days, n)."""
    try:
        return np.broadcast_to(np.asarray(changes.gauge, float), record.time.shape)
    except ValueError:
        raise RividError(
            f"a gauge offset has shape {np.shape(changes.gauge)}: expected {record.time.shape} as the record"
        ) from None


def without_nudge(time: Floats, level: Floats, nudge: Floats) -> Floats:
    """A nudged level with all that the nudge has added taken away again.

    Parameters
    ----------
    time, level, nudge : ndarray, shape (days, n)
        [s], [m] and the rise [m/s] that was added from each sample to the next.
    """
    free = level.copy()
    free[:, 1:] -= np.cumsum(nudge[:, :-1] * np.diff(time, axis=1), axis=1)
    return free
