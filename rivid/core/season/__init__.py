"""Days of a season joined."""
