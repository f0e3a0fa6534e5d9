"""Simulate worlds for p(d | y): those used for its development, and others.

A world is many short seasons of one kind of reach. The length of each season's reach is drawn from the seed,
so that the delays cover the range and their fractions are uniform.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.exam.worlds import WIDEST, BoxWater, draw
from rivid.core.hydraulics import propose_delays
from rivid.core.settings import PosteriorSettings
from rivid.errors import ConfigError, RividError
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import Scenario, load_scenario
from rivid.simulation.season import Water

SCENARIOS = Path(__file__).parents[2] / "configs" / "scenarios"
SEASON = 6
"""Days with one length of the reach."""

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True)
class World:
    """Days of one kind of reach, and their truth.

    Attributes
    ----------
    name : str
    u, y, o : ndarray, shape (days, N)
        Inflow command [m3/s], level [m] and outflow command [m3/s].
    delay : ndarray of int, shape (days,)
        True delay d [samples]. The front of a small wave at the day's mean flow needs `travel` samples, and
        ``d = ceil(travel) - 1`` (:func:`rivid.simulation.true_delay`): a command of sample k is first visible
        at sample k + d + 1. Except for a travel time of whole samples, d is its floor.
    travel : ndarray, shape (days,)
        Travel time of that front, fraction included [samples].
    sample_time : float
        T_s [s].
    well : float
        Time constant of the gauge's stilling well [samples].
    """

    name: str
    u: Floats
    y: Floats
    o: Floats
    delay: Ints
    travel: Floats
    sample_time: float
    well: float = 0.0

    @property
    def other(self) -> Ints:
        """Delay beyond the nearest sampling instant if that is within 0.1 samples, otherwise `delay`."""
        edge = np.round(self.travel)
        near = np.abs(self.travel - edge) < 0.1
        return np.where(near, 2 * edge - 1 - self.delay, self.delay).astype(np.intp)


@dataclass(frozen=True)
class Recipe:
    """A kind of reach.

    Attributes
    ----------
    base : str
        Name of a scenario file.
    length : (float, float)
        Shortest and longest reach [m].
    gain : (float, float)
        K_h [m2/s] of the operators on the shortest and on the longest reach. A short pool responds faster,
        and a high gain would make it oscillate.
    changes : dict
        Tables of the scenario that replace those of the file.
    """

    base: str
    length: tuple[float, float]
    gain: tuple[float, float]
    changes: dict[str, dict[str, Any]] = field(default_factory=dict)

    def scenario(self, length: float, days: int) -> Scenario:
        """Return the scenario of one length."""
        tables = load_scenario(SCENARIOS / f"{self.base}.toml").model_dump(exclude_unset=True)
        for table, values in self.changes.items():
            tables[table] = tables.get(table, {}) | values
        reach = tables["reach"]
        along = (length - self.length[0]) / (self.length[1] - self.length[0])
        gain = self.gain[0] + along * (self.gain[1] - self.gain[0])
        tables["operators"] = tables["operators"] | {"level_gain": gain}
        tables["reach"] = reach | {"length": length, "surface_area": length * reach["width"]}
        return Scenario.model_validate(tables | {"days": days, "missing_days": 0})


QUIET = {"noise": 0.001, "quantum": 0.001}
ROUGH = {"noise": 0.01, "quantum": 0.01}
LINEAR, WAVES = ((2700.0, 14400.0), (-90.0, -480.0)), ((2600.0, 13000.0), (-55.0, -85.0))
UNEVEN = ((2600.0, 12300.0), (-70.0, -140.0))


def _sampled(T_s: float) -> dict[str, dict[str, Any]]:
    """Return the changes for another sample time, with as many dispatch actions per hour."""
    return {"reach": {"sample_time": T_s}, "programme": {"activity": min(0.4 * T_s / 133.0, 1.0)}}


DEVELOPMENT = {
    "linear": Recipe("intermittent", *LINEAR),
    "linear, quiet gauge": Recipe("intermittent", *LINEAR, {"level": QUIET}),
    "linear, rough gauge": Recipe("intermittent", *LINEAR, {"level": ROUGH}),
    "linear, 60 s": Recipe("intermittent", (1250.0, 6500.0), (-40.0, -200.0), _sampled(60.0)),
    "linear, 240 s": Recipe("intermittent", (4900.0, 26000.0), (-160.0, -800.0), _sampled(240.0)),
    "linear, much weather": Recipe("intermittent", *LINEAR, {"weather": {"inflow": 6.0, "memory": 7200.0}}),
    "hydraulic": Recipe("hydraulic", *WAVES),
    "hydraulic, quiet gauge": Recipe("hydraulic", *WAVES, {"level": QUIET}),
    "hydraulic, rough gauge": Recipe("hydraulic", *WAVES, {"level": ROUGH}),
    "hydraulic, 60 s": Recipe("hydraulic", (1300.0, 5900.0), (-30.0, -70.0), _sampled(60.0)),
    "hydraulic, 240 s": Recipe("hydraulic", (4700.0, 22000.0), (-75.0, -85.0), _sampled(240.0)),
    "uneven": Recipe("uneven", *UNEVEN),
    "uneven, much weather": Recipe("uneven", *UNEVEN, {"weather": {"inflow": 5.0, "memory": 7200.0}}),
}
OTHER_HANDS = {
    "feedforward": 0.88, "feedforward_spread": 0.1, "dead_band": 0.04, "trim_time": 36000.0,
    "look": [1500.0, 3600.0], "notice": 10.0,
}  # fmt: skip
PROOF = {
    "linear, narrow": Recipe(
        "intermittent", (2200.0, 11300.0), (-55.0, -280.0),
        _sampled(110.0)
        | {"reach": {"sample_time": 110.0, "width": 65.0, "depth": 4.0, "wave_depth": 5.5},
           "operators": {"feedforward": 0.95, "dead_band": 0.03, "look": [900.0, 2400.0]},
           "weather": {"inflow": 2.5, "memory": 36000.0}},
    ),
    "linear, wide, other operators": Recipe(
        "intermittent", (3400.0, 17500.0), (-60.0, -300.0),
        _sampled(180.0)
        | {"reach": {"sample_time": 180.0, "width": 125.0, "depth": 4.2, "wave_depth": 5.2},
           "operators": OTHER_HANDS, "level": {"noise": 0.005, "quantum": 0.005},
           "weather": {"inflow": 3.0, "memory": 10800.0}},
    ),
    "hydraulic, wide and smooth": Recipe(
        "hydraulic", (3400.0, 14500.0), (-80.0, -130.0),
        _sampled(180.0)
        | {"reach": {"sample_time": 180.0, "width": 125.0, "depth": 4.4},
           "channel": {"slope": 1.2e-4, "manning": 0.022, "bed_level": 124.9},
           "level": {"noise": 0.005, "quantum": 0.005}},
    ),
    "hydraulic, narrow and rough": Recipe(
        "hydraulic", (2100.0, 9300.0), (-35.0, -55.0),
        _sampled(100.0)
        | {"reach": {"sample_time": 100.0, "width": 58.0, "depth": 5.5},
           "channel": {"slope": 3.5e-4, "manning": 0.037, "bed_level": 123.4},
           "flow": {"mean": 190.0, "lowest": 80.0, "highest": 500.0},
           "programme": {"activity": 0.3, "swing": 80.0}, "level": {"noise": 0.002, "quantum": 0.01}},
    ),
    "uneven, other operators": Recipe(
        "uneven", (2500.0, 10500.0), (-22.0, -45.0),
        _sampled(120.0)
        | {"channel": {"width_modes": [0.1, -0.09, 0.06], "bed_modes": [-0.2, 0.25],
                       "manning_modes": [-0.1, 0.1], "side_slope": 2.0, "manning": 0.026},
           "operators": OTHER_HANDS, "level": {"noise": 0.004, "quantum": 0.01},
           "weather": {"inflow": 3.0, "memory": 43200.0, "place": 0.3}},
    ),
    "uneven, deep and smooth": Recipe(
        "uneven", (3000.0, 13500.0), (-60.0, -110.0),
        _sampled(150.0)
        | {"reach": {"sample_time": 150.0, "width": 95.0, "depth": 6.5},
           "channel": {"width_modes": [0.15, 0.05, -0.05], "bed_modes": [0.3, -0.1], "manning": 0.024,
                       "manning_modes": [-0.05, 0.08], "bed_level": 122.5, "gate_time": 60.0},
           "level": {"noise": 0.003, "quantum": 0.005}},
    ),
}  # fmt: skip
N_DRAWN = 40
"""Number of random reaches of each kind."""


def drawn(number: int) -> Recipe:
    """Draw a hydraulic or uneven reach at random; a number always gives the same reach.

    Sample time, gate time, width, depth, slope, roughness, gauge and weather are drawn independently. Lengths
    give travel times of 2 to 13 samples; flows and gains are proportional to the width.
    """
    rng = np.random.default_rng([777, number])
    uneven = bool(rng.random() < 0.5)
    T_s = float(rng.choice([45, 60, 75, 90, 105, 120, 133, 150, 165, 180, 200, 220, 240, 260]))
    width, depth = rng.uniform(55.0, 130.0), rng.uniform(4.3, 6.8)
    wide, step = width / 81.6, T_s * np.sqrt(9.81 * 0.85 * depth) + T_s  # distance of a wave in one sample
    gain = -16.0 * T_s / 133.0 * wide
    channel = {
        "slope": rng.uniform(1e-4, 3e-4), "manning": rng.uniform(0.021, 0.035),
        "bed_level": 129.3 - depth, "gate_time": float(rng.choice([0, 10, 20, 30, 45, 60, 75])),
    }  # fmt: skip
    if uneven:
        modes = {"width_modes": rng.normal(0.0, 0.08, 3), "bed_modes": rng.normal(0.0, 0.2, 2),
                 "manning_modes": rng.normal(0.0, 0.08, 2)}  # fmt: skip
        channel |= {key: a.tolist() for key, a in modes.items()} | {"side_slope": rng.uniform(0.0, 2.5)}
    return Recipe(
        "uneven" if uneven else "hydraulic", (2.27 * step, 12.3 * step), (gain, 1.8 * gain),
        _sampled(T_s)
        | {"reach": {"sample_time": T_s, "width": width, "depth": depth}, "channel": channel,
           "flow": {"mean": 285.0 * wide * rng.uniform(0.75, 1.2), "lowest": 100.0 * wide, "highest": 600.0 * wide},
           "level": {"noise": 10.0 ** rng.uniform(-3.0, -2.1), "quantum": float(rng.choice([0.001, 0.005, 0.01]))},
           "weather": {"inflow": rng.uniform(0.5, 4.0), "memory": float(rng.choice([7200, 21600, 43200])),
                       "place": float(rng.choice([0.3, 0.6, 1.0]))}},
    )  # fmt: skip


KINDS = {
    "development": DEVELOPMENT, "proof": PROOF,
    "drawn development": {f"drawn {k}": drawn(k) for k in range(N_DRAWN)},
    "drawn proof": {f"drawn {k}": drawn(k) for k in range(N_DRAWN, 2 * N_DRAWN)},
}  # fmt: skip


@lru_cache(maxsize=4)
def _worlds(kind: str, seed: int, days: int) -> tuple[World, ...]:
    if kind not in KINDS:
        raise ConfigError(f"kind = {kind!r}: expected one of {', '.join(KINDS)}")
    return tuple(
        _world(name, recipe, np.random.default_rng([seed, k, list(KINDS).index(kind)]), days)
        for k, (name, recipe) in enumerate(KINDS[kind].items())
    )


def _world(name: str, recipe: Recipe, rng: np.random.Generator, days: int) -> World:
    """Simulate seasons on reaches of evenly spread lengths, and join them."""
    parts = -(-days // SEASON)
    share = (rng.permutation(parts) + rng.random(parts)) / parts
    lengths = recipe.length[0] + share * (recipe.length[1] - recipe.length[0])
    seasons: list[Season] = []
    for i, length in enumerate(lengths):
        scenario = recipe.scenario(float(length), min(SEASON, days - i * SEASON))
        first = scenario.first_day.replace(month=int(rng.integers(1, 13)))  # seasons of low and high flow
        seasons.append(simulate(scenario.model_copy(update={"first_day": first}), int(rng.integers(2**31))))
    u, y, o, delay, travel = (
        np.concatenate([getattr(season, key) for season in seasons])
        for key in ("inflow", "level", "outflow", "delay", "travel_time")
    )
    T_s = seasons[0].sample_time
    return World(name, u, y, o, delay, travel / T_s, T_s)


def worlds(kind: str, seed: int, days: int) -> list[World]:
    """Return the worlds of a kind; a seed always gives the same worlds.

    Parameters
    ----------
    kind : str
        One of :data:`KINDS`. Choices may be based on the worlds of development only.
    seed : int
    days : int
        Days of each world. Fewer than a few dozen do not cover all delays.

    Returns
    -------
    list of World

    Raises
    ------
    ConfigError
        If there is no such kind.
    """
    return list(_worlds(kind, seed, days))


def random_worlds(
    seeds: range, days: int, rough: bool = False
) -> list[tuple[World, PosteriorSettings, dict[str, Any]]]:
    """Return exam pools without hidden effects, the settings proposed by `rivid bounds`, and the factors.

    Parameters
    ----------
    seeds : range
        Seeds of the exam's worlds. Rivers, and worlds with operators that do not hold the level, are left
        out.
    days : int
        Days of each world.
    rough : bool
        Whether the gauge has 10 mm of white noise and a resolution of 20 mm.
    """
    found = []
    for seed in seeds:
        for attempt in range(8):
            world = draw(seed, attempt)
            if world.kind == "river":
                break
            level = {"gaps_per_day": 0.0} | ({"noise": 0.01, "quantum": 0.02} if rough else {})
            s = world.scenario.model_copy(
                update={
                    "days": days,
                    "missing_days": 0,
                    "level": world.scenario.level.model_copy(update=level),
                }
            )
            try:
                season = simulate(s, seed, water=BoxWater if world.kind == "box" else Water)
            except RividError:
                continue
            r, T_s, off = s.reach, season.sample_time, {k: 1.0 + v for k, v in world.off.items()}
            if np.ptp(season.true_level) > WIDEST * r.depth:
                continue
            proposed = propose_delays(
                r.discharge_range, length=off["length"] * r.length, sample_time=T_s,
                width=off["width"] * r.surface_area / r.length, depth=off["depth"] * r.depth,
            )  # fmt: skip
            gate = s.channel.gate_time if s.channel else 0.0
            found.append((
                World(
                    world.kind, season.inflow, season.level, season.outflow, season.delay,
                    season.travel_time / T_s, T_s, s.level.lag / T_s,
                ),
                PosteriorSettings(d_max=proposed.d_max, order=proposed.order),
                replace(world, scenario=s).factors() | {"lag": (s.level.lag + gate) / T_s},
            ))  # fmt: skip
            break
    return found
