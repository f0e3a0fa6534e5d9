"""The finite impulse response on both flows: no physics, as many numbers as samples."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.signal import lfilter

from rivid.errors import ConfigError
from rivid.reach.models.base import Output, Parameter, ReachResponse
from rivid.types import Floats

MAX_ORDER = 1000
"""Most coefficients for a flow. A long FIR learns anything: it would hide a missing effect in itself."""

ALPHA = 133.0 / 6.7e5
"""T_s / A of Table I [m per m3/s]."""


@dataclass(frozen=True)
class Fir(ReachResponse):
    """An FIR for each flow: ``y[n] = sum_k a[k] u_Qi[n-k] + sum_k b[k] u_Qo[n-k]``, k from 0 to M - 1.

    A pool keeps what came long ago, which no finite memory can: with ``integrating`` the sums give the
    level's change ``y[n] - y[n-1]``, so that the volume stays when the shape of its arrival is forgotten.

    Parameters
    ----------
    inflow_coefficients, outflow_coefficients : tuple of float
        a and b [output unit per m3/s], shapes (M_i,) and (M_o,), at most 1000 of each; b may be empty.
        Of a pool, b is negative.
    sample_time : float
        T_s [s] for which the coefficients are made: they mean nothing at another.
    integrating : bool
        The coefficients give the change of the output.

    Notes
    -----
    Source: equation (16) for the inflow alone; the outflow is its second input here. The typical
    coefficients are those of the integrator with a delay of 7 samples (8).
    """

    NAME: ClassVar[str] = "fir"
    OUTPUT: ClassVar[Output] = "either"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "inflow_coefficients", "output unit per m3/s", -10.0, 10.0, (0.0,) * 8 + (ALPHA,),
            "a, response to a pulse of inflow",
        ),
        Parameter(
            "outflow_coefficients", "output unit per m3/s", -10.0, 10.0, (0.0, -ALPHA),
            "b, response to a pulse of outflow",
        ),
        Parameter("sample_time", "s", 0.01, 86_400.0, 133.0, "T_s of the coefficients"),
    )  # fmt: skip

    inflow_coefficients: tuple[float, ...]
    outflow_coefficients: tuple[float, ...]
    sample_time: float
    integrating: bool = True

    def __post_init__(self) -> None:
        for name, least in (("inflow_coefficients", 1), ("outflow_coefficients", 0)):
            values = getattr(self, name)
            if not isinstance(values, tuple) or not least <= len(values) <= MAX_ORDER:
                came = f"{len(values)} values" if isinstance(values, tuple) else type(values).__name__
                raise ConfigError(f"{self.NAME}: {name}: {came}, expected a tuple of {least} to {MAX_ORDER}")
        super().__post_init__()

    @property
    def order(self) -> int:
        """M, the longer of the two memories [samples]."""
        return max(len(self.inflow_coefficients), len(self.outflow_coefficients))

    def _respond(self, sample_time: float, inflow: Floats, outflow: Floats) -> Floats:
        if abs(sample_time - self.sample_time) > 1e-9 * self.sample_time:
            raise ConfigError(
                f"{self.NAME}: coefficients for sample_time = {self.sample_time:g} s, flows every "
                f"{sample_time:g} s: identify it again, or resample the flows"
            )
        past = [1.0, -1.0] if self.integrating else [1.0]
        y = np.asarray(lfilter(self.inflow_coefficients, past, inflow))
        if self.outflow_coefficients:
            y = y + np.asarray(lfilter(self.outflow_coefficients, past, outflow))
        return y
