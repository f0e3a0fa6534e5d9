"""Compare days joined over a season with single days: seasons that drift or step, and independent days.

Usage: python -m benchmarks.peers.seasons [--days N --seeds N]
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.measure import table
from benchmarks.posterior.score import randomised_coverage
from benchmarks.posterior.worlds import KINDS, Recipe, World, worlds
from rivid.core.posterior.blind import posterior_blind
from rivid.core.posterior.daily import PosteriorResult, posterior
from rivid.core.season import SeasonSettings, season
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import Scenario

Floats = NDArray[np.float64]

WIDE = {"lowest": 60.0, "highest": 800.0, "seasonal": 0.5, "variability": 0.6, "memory_days": 12.0}
"""A highly variable river flow, so that the travel time varies too."""

LEVELS = (0.55, 1.9)
"""Discharge before and after a step, as a share of the reach's mean."""

CHOSEN = {
    "development": ("linear", "linear, rough gauge", "hydraulic", "uneven"),
    "proof": ("linear, wide, other operators", "hydraulic, wide and smooth", "hydraulic, narrow and rough",
              "uneven, other operators"),
}  # fmt: skip

NAMES = ("drifts", "steps in discharge", "steps in length", "independent")


@dataclass(frozen=True)
class Days:
    """A season, its truth, and the estimates of its single days.

    Attributes
    ----------
    name : str
        One of `NAMES`.
    world : World
    discharge : ndarray, shape (days,)
    seen, blind : PosteriorResult
        Estimates with the outflow, and without.
    """

    name: str
    world: World
    discharge: Floats
    seen: PosteriorResult
    blind: PosteriorResult


def _scenario(recipe: Recipe, share: float, days: int, **flow: float) -> Scenario:
    """Return a season of one length, at `share` between the shortest and the longest."""
    length = recipe.length[0] + share * (recipe.length[1] - recipe.length[0])
    scenario = recipe.scenario(length, days)
    mean = flow.get("mean", scenario.flow.mean)
    lowest, highest = (
        min(flow.get("lowest", scenario.flow.lowest), mean),
        max(flow.get("highest", 800.0), mean),
    )
    return scenario.model_copy(
        update={"flow": scenario.flow.model_copy(update=flow | {"lowest": lowest, "highest": highest})}
    )


def _world(name: str, seasons: list[Season]) -> World:
    u, y, o, delay, travel = (
        np.concatenate([getattr(season, key) for season in seasons])
        for key in ("inflow", "level", "outflow", "delay", "travel_time")
    )
    T_s = seasons[0].sample_time
    return World(name, u, y, o, delay, travel / T_s, T_s)


def built(kind: str, seed: int, days: int) -> Iterator[tuple[str, World]]:
    """Yield the seasons of a kind of worlds with their names."""
    for k, name in enumerate(CHOSEN[kind]):
        recipe = KINDS[kind][name]
        rng = np.random.default_rng([seed, k, list(KINDS).index(kind), 9])
        half = days // 2

        def run(scenario: Scenario, rng: np.random.Generator = rng) -> Season:
            return simulate(scenario, int(rng.integers(2**31)))

        yield NAMES[0], _world(name, [run(_scenario(recipe, rng.uniform(0.1, 0.9), days, **WIDE))])
        share, mean = rng.uniform(0.3, 0.9), recipe.scenario(recipe.length[0], 1).flow.mean
        parts = [_scenario(recipe, share, half, mean=mean * level, variability=0.1) for level in LEVELS]
        yield NAMES[1], _world(name, [run(part) for part in parts])
        shares = rng.uniform(0.1, 0.45), rng.uniform(0.55, 0.9)
        yield NAMES[2], _world(name, [run(_scenario(recipe, x, half)) for x in rng.permutation(shares)])
    mixed = {world.name: world for world in worlds(kind, seed, days)}
    for k, name in enumerate(CHOSEN[kind]):
        world, order = mixed[name], np.random.default_rng([seed, k, 8]).permutation(days)
        yield (
            NAMES[3],
            replace(world, **{key: getattr(world, key)[order] for key in ("u", "y", "o", "delay", "travel")}),
        )


def alone(kind: str, seed: int, days: int) -> list[Days]:
    """Return each season with the estimates of its single days."""
    found = []
    for name, world in built(kind, seed, days):
        found.append(
            Days(
                name, world, np.median(world.u, axis=1), posterior(world.u, world.y, world.o),
                posterior_blind(world.u, world.y),
            )
        )  # fmt: skip
    return found


def scores(p: Floats, world: World, candidates: NDArray[np.intp]) -> Floats:
    """Return exact, within one, randomised coverage of 90 %, log score and surely wrong, shape (5, days)."""
    every = np.arange(len(p))
    best = candidates[np.argmax(p, axis=1)]
    error = np.minimum(np.abs(best - world.delay), np.abs(best - world.other))
    column = np.clip(world.delay - candidates[0], 0, p.shape[1] - 1)
    other = np.clip(world.other - candidates[0], 0, p.shape[1] - 1)
    # if the travel time is at an edge, both delays are right: add their probabilities, take the likelier one
    held = p[every, column] + np.where(column == other, 0.0, p[every, other])
    likelier = np.where(p[every, other] > p[every, column], other, column)
    covered = randomised_coverage(p, likelier)
    sure = p.max(axis=1) > 0.9
    return np.stack([error == 0, error <= 1, covered, np.log(np.maximum(held, 1e-4)), (error > 0) & sure])


def ways(days: Days, found: PosteriorResult, settings: SeasonSettings) -> dict[str, Floats]:
    """Return the probabilities of the delay of every day: alone, and joined in four ways."""
    D = found.probability.shape[1]
    alone = np.where(np.isfinite(found.probability), found.probability, 1.0 / D)
    joined = {"alone": alone}
    for discharge, variant in ((None, ""), (days.discharge, ", discharge")):
        for both in (False, True):
            words = ("both ways" if both else "forward") + variant
            joined[words] = season(
                found.probability, found.link, discharge, d_min=int(found.candidates[0]), both_ways=both,
                settings=settings,
            ).probability  # fmt: skip
    return joined


def gains(seasons: list[Days], blind: bool, settings: SeasonSettings) -> dict[tuple[str, str], Floats]:
    """Return the scores (5, days) of each kind of season and each way."""
    found: dict[tuple[str, str], list[Floats]] = {}
    for days in seasons:
        result = days.blind if blind else days.seen
        for way, p in ways(days, result, settings).items():
            found.setdefault((days.name, way), []).append(scores(p, days.world, result.candidates))
    return {key: np.concatenate(parts, axis=1) for key, parts in found.items()}


HEAD = [
    "season",
    "days joined",
    "days",
    "exact",
    "within one",
    "coverage of 90 %",
    "log score",
    "wrong with p > 0.9",
]


def rows(found: dict[tuple[str, str], Floats]) -> list[list[str]]:
    """Return a row for each season and way."""
    return [
        [name, way, str(values.shape[1]), *(f"{x:.3f}" for x in values.mean(axis=1))]
        for (name, way), values in found.items()
    ]


def section(kind: str, seeds: range, days: int, settings: SeasonSettings | None = None) -> str:
    """Return the tables of a kind of worlds, in Markdown."""
    s = settings or SeasonSettings()
    seasons = [part for seed in seeds for part in alone(kind, seed, days)]
    parts = []
    for blind, variant in ((False, "with the outflow"), (True, "without the outflow")):
        parts.append(
            f"### {kind.capitalize()} worlds, {variant}\n\n" + table(HEAD, rows(gains(seasons, blind, s)))
        )
    return "\n".join(parts)


def main() -> None:
    """Print the tables of both kinds."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--days", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    for kind in CHOSEN:
        print(section(kind, range(options.seeds), options.days))


if __name__ == "__main__":
    main()
