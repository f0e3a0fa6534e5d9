"""The integrator with a delay and a zero: fronts of flow arrive as jumps of the level."""

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
    arriving,
)
from rivid.reach.models.integrator_delay import IntegratorDelay
from rivid.types import Floats


@dataclass(frozen=True)
class IntegratorDelayZero(ReachResponse):
    """A pool that answers slow flows with its volume and fast ones with a wave.

    ``h(s) = (1 / (A s) + b_i) e^(-tau s) K_i Q_i(s) - (1 / (A s) + b_o) K_o Q_o(s)``

    Parameters
    ----------
    surface_area : float
        A [m2], the area seen by slow flows.
    delay : float
        tau [s].
    inflow_jump, outflow_jump : float
        b_i and b_o [m per m3/s]: by how much the level jumps where a step of flow passes the gauge. A
        wave without friction in a channel of width B and celerity c jumps by ``1 / (B c)``. The zeros of
        the two transfer functions are at ``s = -1 / (A b)``.
    inflow_gain, outflow_gain : float
        K_i and K_o [-].

    Notes
    -----
    Source: Litrico and Fromion, "Simplified modeling of irrigation canals for controller design", Journal
    of Irrigation and Drainage Engineering 130 (2004), 373; also their book "Modeling and Control of
    Hydrosystems" (2009). There b is fixed by geometry and friction; here it is a parameter.
    """

    NAME: ClassVar[str] = "integrator-delay-zero"
    OUTPUT: ClassVar[Output] = "level"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        SURFACE_AREA,
        DELAY,
        Parameter("inflow_jump", "m per m3/s", 0.0, 1.0, 1.0e-3, "b_i, jump of the level with the inflow"),
        Parameter("outflow_jump", "m per m3/s", 0.0, 1.0, 1.8e-3, "b_o, drop of the level with the outflow"),
        INFLOW_GAIN,
        OUTFLOW_GAIN,
    )

    surface_area: float
    delay: float
    inflow_jump: float
    outflow_jump: float
    inflow_gain: float = 1.0
    outflow_gain: float = 1.0

    def _respond(self, sample_time: float, inflow: Floats, outflow: Floats) -> Floats:
        volume = IntegratorDelay(self.surface_area, self.delay, self.inflow_gain, self.outflow_gain)
        front = self.inflow_jump * self.inflow_gain * arriving(inflow, self.delay, sample_time)
        drop = self.outflow_jump * self.outflow_gain * outflow
        return volume.simulate(sample_time, inflow, outflow) + front - drop
