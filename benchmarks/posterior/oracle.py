"""Compute an upper limit of the accuracy of a day: the likelihood of the equation of the linear worlds.

The equation is the exact store with an exact delay. The variances and the memory of gauge and weather have
their true values; the gains, a leak and the delay are free. An estimator without these values can hardly be
more accurate.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from benchmarks.posterior.accuracy import DELAYS
from benchmarks.posterior.worlds import KINDS, World, worlds
from rivid.core.posterior.daily import posterior

Floats = NDArray[np.float64]
STEP = 0.1
"""Spacing of the places of the front [samples]."""
LAST = 16
"""Last place of the front [samples]."""
SUREST = 0.9
"""Share of the days that are answered: those of highest probability."""


@dataclass(frozen=True)
class Limit:
    """Shares of exact answers among the surest days, and the number of days."""

    kind: str
    name: str
    oracle: float
    estimator: float
    days: int


def likelihood(world: World, day: int, area: float, gauge: float, weather: float, memory: float) -> Floats:
    """Return the log-likelihood of places of the front, at the middles of steps from 1 to `LAST` samples.

    Parameters
    ----------
    world : World
    day : int
    area : float
        Surface area [m2]. It scales only the weather; the gains are free.
    gauge : float
        Variance of the gauge, including its resolution [m2].
    weather, memory : float
        Standard deviation [m3/s] and memory [s] of the unlogged inflow.
    """
    T, k = world.sample_time, np.arange(world.u.shape[1])
    known = k > LAST
    flow = np.exp(-T * np.abs(k[:, None] - k) / memory) * weather**2
    held = np.cumsum(np.cumsum(flow, axis=0), axis=1) * (T / area) ** 2
    root = cholesky((held + gauge * np.eye(len(k)))[np.ix_(known, known)], lower=True)
    passed = [np.append(0.0, np.cumsum((a[day] - a[day, 0])[:-1])) for a in (world.u, world.o)]
    places = np.arange(1.0, LAST, STEP) + STEP / 2
    arrived = [np.interp(k - x, k, passed[0]) for x in places]
    columns = np.stack(
        [world.y[day] - world.y[day, 0], np.ones(len(k)), 1.0 * k, passed[1], *arrived], axis=1
    )
    Z = solve_triangular(root, columns[known], lower=True)
    basis = np.linalg.qr(Z[:, 1:4])[0]
    rest = Z - basis @ (basis.T @ Z)
    fronts = rest[:, 4:]
    return np.asarray(0.5 * (rest[:, 0] @ fronts) ** 2 / np.sum(fronts**2, axis=0))


def right_and_sure(log: Floats, world: World, day: int) -> tuple[bool, float]:
    """Return whether the likeliest delay is right, and the probability that it is."""
    per_delay = round(1 / STEP)
    p = np.exp(log - log.max())
    p /= p.sum()
    d = int(np.argmax(p.reshape(-1, per_delay).sum(axis=1)))
    near = p[max(per_delay * d - 1, 0) : per_delay * (d + 1) + 1].sum()
    return d + 1 in (world.delay[day], world.other[day]), float(near)


def surest(right: NDArray[np.bool_], sure: Floats) -> float:
    """Return the share of right answers among the surest days."""
    order = np.argsort(-np.nan_to_num(sure), kind="stable")
    return float(right[order[: round(SUREST * len(order))]].mean())


def limits(seed: int, days: int) -> list[Limit]:
    """Return the limits of the linear worlds of both kinds."""
    found = []
    for kind, recipes in KINDS.items():
        for world in worlds(kind, seed, days):
            if not world.name.startswith("linear"):
                continue
            scene = recipes[world.name].scenario(recipes[world.name].length[0], 1)
            r, gauge = scene.reach, scene.level.noise**2 + scene.level.quantum**2 / 12
            keep = np.flatnonzero((world.delay >= DELAYS[0]) & (world.delay <= DELAYS[1]))
            speed = world.u.mean(axis=1) / (r.width * r.depth) + np.sqrt(9.81 * r.wave_depth)
            area = r.width * world.travel * world.sample_time * speed
            logs = [
                likelihood(world, i, area[i], gauge, scene.weather.inflow, scene.weather.memory) for i in keep
            ]
            judged = [right_and_sure(log, world, i) for log, i in zip(logs, keep, strict=True)]
            mine = posterior(world.u[keep], world.y[keep], world.o[keep])
            best = mine.candidates[np.argmax(np.nan_to_num(mine.probability), axis=1)]
            right = (best == world.delay[keep]) | (best == world.other[keep])
            found.append(
                Limit(
                    kind,
                    world.name,
                    surest(np.array([t[0] for t in judged]), np.array([t[1] for t in judged])),
                    surest(right, mine.right),
                    len(keep),
                )  # fmt: skip
            )
    return found
