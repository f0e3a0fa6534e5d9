"""Benchmark of p(d | y) on simulated reaches with known delays: worlds, scores, page."""
