"""Scores of p(d | y) on many seeds of both kinds of worlds, counted the way the page shows them."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.posterior.score import Scores, score, together
from benchmarks.posterior.worlds import worlds

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

DELAYS = (2, 12)
"""True delays that are asked about [samples]."""


@dataclass(frozen=True)
class Found:
    """What one world gave over all seeds.

    Attributes
    ----------
    kind, name : str
    sample_time : float
        T_s [s].
    matched, shuffled : Scores
        The days as they are; the inflow of one day with the level and the outflow of another.
    """

    kind: str
    name: str
    sample_time: float
    matched: Scores
    shuffled: Scores

    @property
    def is_linear(self) -> bool:
        """Whether the water is a store behind a delay; else it follows Saint-Venant."""
        return self.name.startswith("linear")


@dataclass(frozen=True)
class Bin:
    """One step of a reliability diagram: mean probability, how often it was true, of how many."""

    said: float
    true: int
    n: int


def asked(scores: Scores, keep: Bools) -> Scores:
    """Some days of the scores."""
    return replace(
        scores, **{f.name: getattr(scores, f.name)[keep] for f in fields(Scores) if f.name != "ms"}
    )


def measure(kind: str, seeds: range, days: int) -> list[Found]:
    """Every world of a kind, days of all seeds together."""
    per_seed = [worlds(kind, seed, days) for seed in seeds]
    found = []
    for same in zip(*per_seed, strict=True):
        keep = [(w.delay >= DELAYS[0]) & (w.delay <= DELAYS[1]) for w in same]
        matched = together([asked(score(w), k) for w, k in zip(same, keep, strict=True)])
        shuffled = together([score(w, shift=days // 2) for w in same])
        found.append(Found(kind, same[0].name, same[0].sample_time, matched, shuffled))
    return found


def reliability(said: Floats, is_true: Bools, edges: Floats) -> list[Bin]:
    """Probabilities put in bins; empty bins are left out."""
    which = np.clip(np.digitize(said, edges) - 1, 0, len(edges) - 2)
    bins = []
    for k in range(len(edges) - 1):
        here = which == k
        if here.any():
            bins.append(Bin(float(said[here].mean()), int(is_true[here].sum()), int(here.sum())))
    return bins
