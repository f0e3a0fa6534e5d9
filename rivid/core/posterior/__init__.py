"""p(d | y) of every day of a pool, with the outflow or without it."""
