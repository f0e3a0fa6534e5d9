"""The mathematics: pure functions on arrays, frozen settings and results.

Imports numpy and scipy.linalg only, knows no files, and holds every default once
(:mod:`rivid.core.settings`).
"""
