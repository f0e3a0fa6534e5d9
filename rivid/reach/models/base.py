"""What all reach responses share: parameters with limits, held inputs, delays between samples.

Every response is linear and starts at rest, so it works on deviations of the flows from what they were
before the first sample. A command is held from its sample to the next, and the output is the value at each
sample, from the right: what starts at a sample is seen at it only if the response jumps.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from rivid.errors import ConfigError, RividError
from rivid.types import Floats

Output = Literal["level", "discharge", "either"]
ON_A_SAMPLE = 1e-9
"""A delay this close to a sample, in samples, is on it: 0.3 s is three samples of 0.1 s."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a response.

    Parameters
    ----------
    name : str
        Name of the field that holds it.
    unit : str
        Its unit, ``-`` for none.
    low, high : float
        Limits, both allowed; for a sequence they hold for each element.
    typical : float or tuple of float
        An order of magnitude, from the reach of Table I where it is a pool's.
    meaning : str
        What it is, in a few words.
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float | tuple[float, ...]
    meaning: str

    def check(self, model: str, value: object) -> None:
        """Refuse a value outside the limits.

        Raises
        ------
        ConfigError
            Naming the response, the parameter, the value and the limits.
        """
        sequence = isinstance(value, tuple) and isinstance(self.typical, tuple)
        for i, part in enumerate(value if isinstance(value, tuple) and sequence else (value,)):
            # A bool counts as a number in Python, never in a configuration; NaN fails the comparison.
            number = isinstance(part, int | float | np.integer | np.floating) and not isinstance(part, bool)
            if not number or not self.low <= part <= self.high:
                name = f"{self.name}[{i}]" if sequence else self.name
                came = f"{part:g}" if number else repr(part)
                raise ConfigError(
                    f"{model}: {name} = {came}: expected a number from {self.low:g} to {self.high:g} "
                    f"[{self.unit}] ({self.meaning})"
                )


SURFACE_AREA = Parameter("surface_area", "m2", 1e2, 1e10, 6.7e5, "water surface A of the pool")
DELAY = Parameter("delay", "s", 0.0, 1e6, 1000.0, "travel time tau of the inflow")
INFLOW_GAIN = Parameter("inflow_gain", "-", 0.1, 10.0, 1.0, "K_i, real inflow over its command")
OUTFLOW_GAIN = Parameter("outflow_gain", "-", 0.1, 10.0, 1.0, "K_o, real outflow over its command")


class ReachResponse(ABC):
    """A reach's answer to its two flows.

    Attributes
    ----------
    NAME : str
        Canonical name.
    OUTPUT : {"level", "discharge", "either"}
        What is given: a level [m], a discharge [m3/s], or what the coefficients are for.
    PARAMETERS : tuple of Parameter
        The parameters, in the order of the fields.
    """

    NAME: ClassVar[str]
    OUTPUT: ClassVar[Output]
    PARAMETERS: ClassVar[tuple[Parameter, ...]]

    def __post_init__(self) -> None:
        for parameter in self.PARAMETERS:
            parameter.check(self.NAME, getattr(self, parameter.name))

    @classmethod
    def typical(cls) -> Self:
        """The response with the typical value of every parameter."""
        return cls(**{parameter.name: parameter.typical for parameter in cls.PARAMETERS})

    def simulate(self, sample_time: float, inflow: ArrayLike, outflow: ArrayLike | None = None) -> Floats:
        """Output at each sample for flows that are held from each sample to the next.

        Parameters
        ----------
        sample_time : float
            T_s [s].
        inflow : array_like, shape (n,) or (days, n)
            Deviation of u_Qi [m3/s] from its value before the first sample.
        outflow : array_like, same shape, or None
            Deviation of u_Qo [m3/s]; None is zero. A response that gives a discharge does not use it.

        Returns
        -------
        ndarray, same shape
            Deviation of the level [m] or the discharge [m3/s]; each day starts at rest.

        Raises
        ------
        ConfigError
            Where the sampling period is not a positive number.
        RividError
            Where the flows have no samples or different shapes.
        """
        if not 0.0 < sample_time < math.inf:
            raise ConfigError(f"sample_time = {sample_time}: expected a positive number of seconds")
        u = np.asarray(inflow, float)
        o = np.zeros_like(u) if outflow is None else np.asarray(outflow, float)
        if u.ndim == 0 or u.shape[-1] == 0 or u.shape != o.shape:
            raise RividError(
                f"inflow of shape {u.shape} and outflow of shape {o.shape}: expected the same shape, "
                "(n,) or (days, n), with samples along the last axis"
            )
        return self._respond(float(sample_time), u, o)

    @abstractmethod
    def _respond(self, sample_time: float, inflow: Floats, outflow: Floats) -> Floats:
        """The response itself, on arrays of one shape."""


def split_delay(delay: float, sample_time: float) -> tuple[int, float]:
    """A delay as whole samples and the part of a sample beyond them.

    Parameters
    ----------
    delay, sample_time : float
        Delay and sampling period [s].

    Returns
    -------
    int, float
        ``delay = (whole + part) * sample_time`` with ``0 <= part < 1``.

    Examples
    --------
    >>> split_delay(300.0, 120.0)
    (2, 0.5)
    """
    samples = delay / sample_time
    whole = math.floor(samples + ON_A_SAMPLE)
    return whole, max(samples - whole, 0.0)


def shifted(values: Floats, samples: int) -> Floats:
    """Values moved back by whole samples along the last axis, zero before the first."""
    moved = np.zeros_like(values)
    n = values.shape[-1]
    if samples < n:
        moved[..., samples:] = values[..., : n - samples]
    return moved


def arriving(values: Floats, delay: float, sample_time: float) -> Floats:
    """What a delayed, held flow is at each sample, from the right.

    Parameters
    ----------
    values : ndarray, shape (..., n)
        The flow where it departs [m3/s].
    delay, sample_time : float
        [s].

    Returns
    -------
    ndarray, shape (..., n)
    """
    whole, part = split_delay(delay, sample_time)
    return shifted(values, whole + (part > ON_A_SAMPLE))


def arriving_mean(values: Floats, delay: float, sample_time: float) -> Floats:
    """Mean of a delayed, held flow from each sample to the next; an integrator needs no more.

    Parameters
    ----------
    values : ndarray, shape (..., n)
        The flow where it departs [m3/s].
    delay, sample_time : float
        [s].

    Returns
    -------
    ndarray, shape (..., n)
    """
    whole, part = split_delay(delay, sample_time)
    return (1.0 - part) * shifted(values, whole) + part * shifted(values, whole + 1)
