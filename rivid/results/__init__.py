"""Tables, store and record of a run, and how they are read."""
