"""Where the fit of a noise may end, and where it starts: one start can end in an optimum of its own."""

from dataclasses import fields, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rivid.diagnosis.noise.model import NoiseModel, entries
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.noise.kalman import Days


WALK_LIMIT = 1e-3
"""Largest level random walk beside a level-type noise [m per sample]: a freer one swallows the wind."""


class Limits(NamedTuple):
    """A model whose `free` fields move between `low` and `high`; `scale` is a sample's usual change."""

    model: NoiseModel
    free: tuple[str, ...]
    low: Floats
    high: Floats
    scale: float

    def at(self, point: Floats) -> NoiseModel:
        """The model at the logarithms of the free fields, shape (f,)."""
        return replace(self.model, **dict(zip(self.free, np.exp(point).tolist(), strict=True)))

    def systems(self, points: Floats) -> Floats:
        """What the filters of many models (q, f) are made of, shape (q, 7)."""
        numbers = {f.name: getattr(self.model, f.name) for f in fields(self.model)}
        numbers |= dict(zip(self.free, np.exp(points).T, strict=True))
        return np.stack(np.broadcast_arrays(*entries(**numbers)), axis=1)


def limits_of(
    days: "Days",
    T: float,
    A: float | None,
    level: bool,
    gauge_floor: float,
    walk_limit: float | None,
    memory_floor: float | None,
) -> Limits:
    """Limits by how much a sample usually changes; arguments as of the fit."""
    there, n = days.there, days.values.shape[1]
    both = there[:, 1:] & there[:, :-1]
    scale = float(np.sqrt(np.mean(np.diff(days.values, axis=1)[both] ** 2) / 2.0))
    longest = 10.0 * n * T  # a day cannot tell a longer memory from an endless one
    most_walk = min(10.0 * scale, walk_limit or (WALK_LIMIT if level else np.inf))
    bounds = {"gauge_sd": (max(gauge_floor, 1e-3 * scale), max(2.0 * gauge_floor, 10.0 * scale))}
    if A is not None:
        bounds["walk_sd"] = (1e-4 * most_walk, most_walk)
        bounds["inflow_sd"] = (1e-5 * scale * A / T, 10.0 * scale * A / T)
        bounds["inflow_memory"] = (memory_floor or 10.0 * T, longest)
    if A is None or level:
        bounds["level_sd"] = (1e-3 * scale, 1e3 * scale)
        bounds["level_memory"] = (3.0 * T, longest)
    low, high = np.array(list(bounds.values())).T
    rest = NoiseModel(scale, 0.0, 0.0, 100.0 * T, 0.0, 100.0 * T, T, A)
    return Limits(rest, tuple(bounds), low, high, scale)


def usual_starts(limits: Limits, pool: bool, level: bool) -> tuple[NoiseModel, ...]:
    """Weak and lasting, strong and short, or hardly any unknown inflow; with and without much wind."""
    z, rest = limits.scale, limits.model
    T, A = rest.sample_time, rest.surface_area
    if not pool or A is None:
        slow = replace(rest, gauge_sd=0.5 * z, level_sd=10.0 * z, level_memory=300.0 * T)
        return slow, replace(rest, level_sd=z, level_memory=10.0 * T)
    w = z * A / T
    weak = replace(rest, walk_sd=0.03 * z, inflow_sd=0.05 * w, inflow_memory=100.0 * T)
    short = replace(rest, gauge_sd=0.5 * z, walk_sd=0.1 * z, inflow_sd=0.3 * w, inflow_memory=30.0 * T)
    walk = replace(rest, gauge_sd=0.5 * z, walk_sd=0.3 * z, inflow_sd=0.01 * w, inflow_memory=600.0 * T)
    if not level:
        return weak, short, walk
    return tuple(  # slow levels are w's or s's doing: the likelihood has a hill for either
        replace(start, walk_sd=walk * z, level_sd=size * z, level_memory=last * T)
        for start in (weak, short)
        for size, last in ((3.0, 80.0), (1.0, 10.0))
        for walk in (0.01, 0.3)
    )
