"""Benchmark of common alternatives to `posterior`, run side by side with it."""
