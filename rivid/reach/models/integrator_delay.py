"""The integrator with a delay, (7)-(8): the paper's reach."""

from dataclasses import dataclass
from typing import ClassVar

from rivid.reach.models.base import (
    DELAY,
    INFLOW_GAIN,
    OUTFLOW_GAIN,
    SURFACE_AREA,
    Output,
    Parameter,
    ReachResponse,
    arriving_mean,
)
from rivid.reach.response import integrator_delay
from rivid.types import Floats


@dataclass(frozen=True)
class IntegratorDelay(ReachResponse):
    """A pool as one volume: ``A dh/dt = K_i Q_i(t - tau) - K_o Q_o(t)`` (7).

    Parameters
    ----------
    surface_area : float
        A [m2].
    delay : float
        tau [s], any part of a sample.
    inflow_gain, outflow_gain : float
        K_i and K_o [-]. With A free as well, only the two ratios to A can be told from data.

    Notes
    -----
    Source: equations (7) and (8). The model is that of Schuurmans, Bosgra and Brouwer, "Open-channel flow
    model approximation for controller design", Applied Mathematical Modelling 19 (1995).

    Examples
    --------
    >>> pool = IntegratorDelay(surface_area=1e5, delay=250.0)
    >>> pool.simulate(100.0, [10.0, 10.0, 10.0, 10.0, 10.0]).round(4).tolist()
    [0.0, 0.0, 0.0, 0.005, 0.015]
    """

    NAME: ClassVar[str] = "integrator-delay"
    OUTPUT: ClassVar[Output] = "level"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (SURFACE_AREA, DELAY, INFLOW_GAIN, OUTFLOW_GAIN)

    surface_area: float
    delay: float
    inflow_gain: float = 1.0
    outflow_gain: float = 1.0

    def _respond(self, sample_time: float, inflow: Floats, outflow: Floats) -> Floats:
        # A held flow that arrives between two samples fills a straight line: its mean is all that counts,
        # and (8) with d = 0 does the rest.
        came = arriving_mean(inflow, self.delay, sample_time)
        alpha = sample_time / self.surface_area
        return integrator_delay(came, outflow, 0, self.inflow_gain * alpha, self.outflow_gain * alpha)
