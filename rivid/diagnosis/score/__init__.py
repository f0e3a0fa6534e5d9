"""The score test with block sign flips."""
