"""What might be missing: effects as columns, events, noises, windows."""
