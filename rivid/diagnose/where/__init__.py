"""Where the gap is."""
