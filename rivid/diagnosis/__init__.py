"""Find the effects that a simulation of the reach lacks."""
