"""Programme, operators and reach together: continuous days of arrays, and the truth."""

from rivid.simulation.season import Season, simulate, simulate_cascade, true_delay

__all__ = ["Season", "simulate", "simulate_cascade", "true_delay"]
