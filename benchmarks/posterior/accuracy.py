"""Compute scores of p(d | y) on many seeds of both kinds of worlds, as shown on the page."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.posterior.score import Scores, score, together
from benchmarks.posterior.worlds import random_worlds, worlds

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

DELAYS = (2, 12)
"""Smallest and largest true delay of the scored days [samples]."""


@dataclass(frozen=True)
class Found:
    """Scores of one world over all seeds.

    Attributes
    ----------
    kind, name : str
    sample_time : float
        T_s [s].
    matched, shuffled : Scores
        Scores of the days as they are, and of the inflow of one day with the level and outflow of another.
    """

    kind: str
    name: str
    sample_time: float
    matched: Scores
    shuffled: Scores

    @property
    def is_linear(self) -> bool:
        """Whether the truth is a store with a delay; otherwise it is Saint-Venant."""
        return self.name.startswith("linear")


@dataclass(frozen=True)
class Bin:
    """One bin of a reliability diagram: mean probability, number of true candidates, number of candidates."""

    stated: float
    true: int
    n: int


def asked(scores: Scores, keep: Bools) -> Scores:
    """Return the scores of a selection of days."""
    return replace(
        scores, **{f.name: getattr(scores, f.name)[keep] for f in fields(Scores) if f.name != "ms"}
    )


def measure(kind: str, seeds: range, days: int) -> list[Found]:
    """Score every world of a kind, with the days of all seeds together."""
    per_seed = [worlds(kind, seed, days) for seed in seeds]
    found = []
    for same in zip(*per_seed, strict=True):
        keep = [(w.delay >= DELAYS[0]) & (w.delay <= DELAYS[1]) for w in same]
        matched = together([asked(score(w), k) for w, k in zip(same, keep, strict=True)])
        shuffled = together([score(w, shift=days // 2) for w in same])
        found.append(Found(kind, same[0].name, same[0].sample_time, matched, shuffled))
    return found


def reliability(stated: Floats, is_true: Bools, edges: Floats) -> list[Bin]:
    """Return the probabilities in bins; empty bins are left out."""
    which = np.clip(np.digitize(stated, edges) - 1, 0, len(edges) - 2)
    bins = []
    for k in range(len(edges) - 1):
        here = which == k
        if here.any():
            bins.append(Bin(float(stated[here].mean()), int(is_true[here].sum()), int(here.sum())))
    return bins


def _between(key: str, bounds: tuple[float, ...], unit: float = 1.0) -> Callable[[dict[str, Any]], str]:
    """Return a function that names the interval of a factor, in units of `unit`."""
    names = [f"{a:g} to {b:g}" for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
    return lambda f: names[int(np.searchsorted(bounds[1:-1], f[key] / unit, side="right"))]


FACTORS: dict[str, Callable[[dict[str, Any]], str]] = {
    "all": lambda f: "",
    "water": lambda f: str(f["water"]),
    "gauge's noise [mm]": _between("gauge_noise_m", (0.5, 1.0, 2.0, 4.0), 1e-3),
    "gauge's step [mm]": lambda f: f"{1e3 * f['gauge_step_m']:.0f}",
    "stilling well [s]": lambda f: "none" if f["well_s"] == 0.0 else _between("well_s", (10, 60, 120))(f),
    "well and gate [samples]": _between("lag", (0.0, 0.3, 0.6, 1.0, 4.0)),
    "length [km]": _between("length_m", (2, 4, 8, 12, 20), 1e3),
    "sample time [s]": _between("sample_time_s", (60, 100, 200, 350, 600)),
    "control": lambda f: str(f["operators"]),
    "programme": lambda f: str(f["programme"]),
}
"""Factors of the exam's worlds by which the scores are split."""


def by_factor(seeds: range, days: int, rough: bool = False) -> dict[tuple[str, str], Scores]:
    """Return the scores of the exam's worlds for each factor and each of its values, in order."""
    every = [(f, score(w, s)) for w, s, f in random_worlds(seeds, days, rough)]
    none = np.zeros((days, 0))  # the candidates differ between worlds
    every = [(f, replace(s, probability=none, is_true=none.astype(bool))) for f, s in every]
    found = {}
    for factor, value in FACTORS.items():
        groups: dict[str, list[Scores]] = {}
        for f, s in every:
            groups.setdefault(value(f), []).append(s)
        found |= {(factor, name): together(groups[name]) for name in sorted(groups, key=_first_number)}
    return found


def _first_number(name: str) -> tuple[float, str]:
    """Return a sort key: intervals by their lower bound."""
    head = name.split(" ")[0]
    return (float(head) if head.replace(".", "").isdigit() else -1.0, name)
