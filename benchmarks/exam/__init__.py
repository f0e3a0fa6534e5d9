"""Exam of `rivid diagnose`: effects hidden in simulated seasons, answers judged against targets."""
