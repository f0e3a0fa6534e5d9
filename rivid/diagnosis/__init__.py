"""Find the effect that a simulation of the reach lacks."""
