"""Programme, operators and reach together: continuous days of arrays, and the truth."""

from rivid.simulate.observables import Observables, observables
from rivid.simulate.season import Season, simulate, simulate_cascade, true_delay

__all__ = ["Observables", "Season", "observables", "simulate", "simulate_cascade", "true_delay"]
