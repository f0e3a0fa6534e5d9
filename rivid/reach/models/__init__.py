"""Reach responses by their canonical names: the models that a simulation or a diagnosis may choose from."""

from rivid.reach.models.base import Parameter, ReachResponse
from rivid.reach.models.diffusive_wave import DiffusiveWave
from rivid.reach.models.fir import Fir
from rivid.reach.models.integrator_delay import IntegratorDelay
from rivid.reach.models.integrator_delay_zero import IntegratorDelayZero
from rivid.reach.models.integrator_resonance import IntegratorResonance
from rivid.reach.models.lag_and_reservoir import LagAndReservoir

MODELS: dict[str, type[ReachResponse]] = {
    model.NAME: model
    for model in (
        IntegratorDelay,
        IntegratorDelayZero,
        IntegratorResonance,
        DiffusiveWave,
        LagAndReservoir,
        Fir,
    )
}
"""Canonical name -> response."""

__all__ = [
    "MODELS",
    "DiffusiveWave",
    "Fir",
    "IntegratorDelay",
    "IntegratorDelayZero",
    "IntegratorResonance",
    "LagAndReservoir",
    "Parameter",
    "ReachResponse",
]
