"""Programme, operators and reach together: continuous days of arrays, and the truth."""

from rivid.simulation.season import Season, simulate, simulate_cascade, true_delay
from rivid.simulation.truth import Observables, observables

__all__ = ["Observables", "Season", "observables", "simulate", "simulate_cascade", "true_delay"]
