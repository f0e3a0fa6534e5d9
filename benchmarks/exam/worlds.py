"""Draw the worlds of the exam: reach, hydraulics, operators, gauge and weather of each seed.

Proof seeds begin at :data:`FIRST_PROOF`; the seeds below are for development. A proof seed becomes a
development seed once its season has been inspected. The ranges are those of run-of-river and peaking reaches;
none of them was chosen from the answers.
"""

import datetime as dt
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.exam.answering import Logs
from benchmarks.exam.box import THETA, Box, Nodes
from benchmarks.exam.river import RiverWater
from rivid.core.hydraulics import GRAVITY
from rivid.effects import Effect
from rivid.errors import RividError
from rivid.reach.changes import Changes
from rivid.reach.gate import OperatorArrays
from rivid.simulation.scenario import Scenario
from rivid.simulation.season import Season, Water, simulate
from rivid.types import Floats

Table = dict[str, Any]
FIRST_PROOF = 12_660
KINDS = ("linear", "saint_venant", "box")
"""A linear store with a delay; the Saint-Venant equations (1) as solved by rivid; the same equations by
another scheme, in other sections."""
RIVERS = 0.08
"""Share of the worlds that are a free river instead of a pool."""
BOXES = 64
"""Number of boxes. Level changes between samples agree with those of 256 boxes to 0.6 to 1.5 mm (rms, four
worlds); those of 256 boxes agree with rivid's explicit scheme in 96 cells to 0.1 to 0.5 mm."""
CELLS = 120
"""Cells of a channel: more than the diagnosis simulates, so that the errors of its grid are not in the data."""
WIDEST = 0.35
"""Largest range of the level over the depth. A reach with a larger range is no pool with a set point."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between two limits, uniform in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def wave_travel(scenario: Scenario, kinematic: bool = False) -> float:
    """Return the travel time of a gravity wave, or of the kinematic wave, at the mean flow [s]."""
    reach = scenario.reach
    velocity = scenario.flow.mean * reach.length / (reach.surface_area * reach.depth)
    if kinematic:
        return float(reach.length / (velocity * 5.0 / 3.0))
    return float(reach.length / (velocity + np.sqrt(GRAVITY * reach.depth)))


@dataclass(frozen=True)
class World:
    """A reach without hidden effects.

    Attributes
    ----------
    seed : int
    kind : str
        One of :data:`KINDS`, or `river`.
    operators, programme : str
        `crew`, `automatic` or `schedule`; `peaking`, `run_of_river` or `flood`.
    scenario : Scenario
        Without effects.
    off : dict
        Relative errors of the geometry in the user's configuration: length, width, depth.
    """

    seed: int
    kind: str
    operators: str
    programme: str
    scenario: Scenario
    off: dict[str, float]

    @cached_property
    def travel(self) -> float:
        """Travel time of a wave at the mean flow [s]: kinematic in a river, else a gravity wave."""
        return wave_travel(self.scenario, kinematic=self.kind == "river")

    def factors(self) -> Table:
        """Return the factors by which the results are split, as plain values."""
        s = self.scenario
        mean = s.flow.mean
        return {
            "water": self.kind, "operators": self.operators, "programme": self.programme,
            "sample_time_s": s.reach.sample_time, "gauge_step_m": s.level.quantum,
            "gauge_noise_m": s.level.noise, "well_s": s.level.lag, "length_m": s.reach.length, "days": s.days,
            "mean_flow_m3s": mean, "surface_m2": s.reach.surface_area, "depth_m": s.reach.depth,
            "weather_share": s.weather.inflow / mean, "weather_memory_s": s.weather.memory,
            "travel_s": self.travel,
        }  # fmt: skip


def draw(seed: int, attempt: int = 0) -> World:
    """Draw the world of a seed.

    Parameters
    ----------
    seed : int
    attempt : int
        Number of the draw. The next draw is used if the operators cannot hold the level of this one.
    """
    if np.random.default_rng([seed, 45]).random() < RIVERS:
        return _river(seed, attempt)
    rng = np.random.default_rng([seed, 40, attempt])
    kind = str(rng.choice(KINDS))
    operators = str(rng.choice(["crew", "crew", "automatic", "schedule"]))
    programme = str(rng.choice(["peaking", "run_of_river", "flood"]))
    while True:  # until a wave takes between 1.2 and 30 samples
        length, width = log_uniform(rng, 2e3, 2e4), log_uniform(rng, 40.0, 200.0)
        depth, step = rng.uniform(3.0, 12.0), float(round(log_uniform(rng, 60.0, 600.0)))
        velocity = rng.uniform(0.3, 1.2)
        travel = length / (velocity + np.sqrt(GRAVITY * depth))
        if 1.2 * step < travel < 30.0 * step:
            break
    mean = velocity * width * depth
    area = length * width
    # the banks take at most half of the surface width
    side = 0.0 if kind == "linear" else rng.uniform(0.0, min(2.5, 0.25 * width / depth))
    hold = {"crew": (600.0, 1800.0), "automatic": (step, step), "schedule": (3600.0, 7200.0)}[operators]
    # a level error is reduced by at most a third between two looks
    gain = -min(rng.uniform(0.1, 0.35) * area / max(hold[1], 2.0 * travel), 2.0 * mean)
    days = int(rng.integers(30, 121))
    level, fall = round(rng.uniform(20.0, 400.0), 1), rng.uniform(0.05, 0.5) * depth
    table: Table = {
        "name": f"world-{seed}", "days": days, "seed": seed,
        "missing_days": int(rng.integers(0, 1 + days // 15)),
        "first_day": dt.date(2015, 1, 1) + dt.timedelta(days=int(rng.integers(0, 365))),
        "reach": {
            "length": length, "width": width - 2.0 * side * depth, "depth": depth, "surface_area": area,
            "discharge_range": (0.3 * mean, 2.5 * mean), "sample_time": step, "wave_depth": depth,
        },
        **_flows(rng, programme, operators, mean, step),
        "level": {
            "set_point": level, "noise": log_uniform(rng, 0.0005, 0.004),
            "quantum": float(rng.choice([0.001, 0.002, 0.005, 0.01])),
            "drawdown": 0.0 if rng.random() < 0.5 else rng.uniform(0.0, 0.1) * depth / mean * 100.0,
            "drawdown_from": mean, "lag": float(rng.choice([0.0, rng.uniform(10.0, 120.0)])),
            "gaps_per_day": float(rng.choice([0.0, 0.0, 0.5])),
        },
        "weather": {
            "inflow": log_uniform(rng, 0.003, 0.02) * mean, "memory": log_uniform(rng, 3600.0, 43200.0),
            "place": rng.uniform(),
        },
    }  # fmt: skip
    table["operators"] |= {"level_gain": gain, "look": hold}
    if kind != "linear":
        table["channel"] = {
            "bed_level": level - depth - 0.5 * fall, "slope": fall / length,
            "manning": rng.uniform(0.02, 0.045), "side_slope": side, "cells": CELLS,
            "width_modes": rng.normal(0.0, (0.12, 0.08, 0.05, 0.03)).tolist(),
            "bed_modes": (0.05 * depth * rng.normal(size=3)).clip(-1, 1).tolist(),
            "manning_modes": rng.normal(0.0, (0.1, 0.08, 0.06)).tolist(),
            "gate_time": rng.uniform(10.0, 90.0),
        }  # fmt: skip
    off = {
        name: float(rng.normal(0.0, sd)) for name, sd in (("length", 0.02), ("width", 0.04), ("depth", 0.06))
    }
    return World(seed, kind, operators, programme, Scenario.model_validate(table), off)


def _river(seed: int, attempt: int) -> World:
    """Draw a free river below a dam. Its gauge reads discharge, to some thousandths of the mean flow."""
    rng = np.random.default_rng([seed, 46, attempt])
    programme = str(rng.choice(["peaking", "run_of_river", "flood"]))
    while True:  # until a wave takes between 4 and 40 samples
        length, width = log_uniform(rng, 1e4, 6e4), log_uniform(rng, 30.0, 150.0)
        depth, step = rng.uniform(1.5, 5.0), float(rng.choice([300.0, 600.0, 900.0]))
        velocity = rng.uniform(0.6, 1.6)
        if 4.0 * step < length / (velocity * 5.0 / 3.0) < 40.0 * step:
            break
    mean, days = velocity * width * depth, int(rng.integers(30, 121))
    table: Table = {
        "name": f"world-{seed}", "days": days, "seed": seed,
        "missing_days": int(rng.integers(0, 1 + days // 15)),
        "first_day": dt.date(2015, 1, 1) + dt.timedelta(days=int(rng.integers(0, 365))),
        "reach": {
            "length": length, "width": width, "depth": depth, "surface_area": length * width,
            "discharge_range": (0.3 * mean, 2.5 * mean), "sample_time": step, "wave_depth": depth,
        },
        **_flows(rng, programme, "automatic", mean, step),
        "level": {
            "set_point": mean, "noise": log_uniform(rng, 0.001, 0.01) * mean,
            "quantum": float(f"{rng.uniform(0.001, 0.004) * mean:.1g}"),
        },
        "weather": {
            "inflow": log_uniform(rng, 0.003, 0.02) * mean, "memory": log_uniform(rng, 3600.0, 43200.0),
            "place": rng.uniform(),
        },
    }  # fmt: skip
    table["operators"] |= {"level_gain": -1e-3, "look": (step, step)}  # a river is not controlled
    off = {
        name: float(rng.normal(0.0, sd)) for name, sd in (("length", 0.02), ("width", 0.06), ("depth", 0.1))
    }
    return World(seed, "river", "none", programme, Scenario.model_validate(table), off)


def _flows(
    rng: np.random.Generator, programme: str, operators: str, mean: float, step: float
) -> dict[str, Table]:
    """Draw the tables of the river flow, the dispatch programme and the operators."""
    quantum = max(round(mean / 300.0), 0.5)
    swing = {"peaking": rng.uniform(0.3, 0.8), "run_of_river": rng.uniform(0.02, 0.15), "flood": 0.2}
    spell = {"peaking": 0.25, "run_of_river": 0.2, "flood": rng.uniform(0.4, 0.7)}
    alone = operators == "automatic"
    return {
        "flow": {
            "mean": mean, "lowest": 0.3 * mean, "highest": 2.5 * mean, "variability": spell[programme],
            "seasonal": rng.uniform(0.0, 0.4), "memory_days": rng.uniform(3.0, 12.0),
        },
        "programme": {
            "swing": swing[programme] * mean, "corrections": rng.uniform(0.01, 0.04) * mean,
            "quantum": quantum, "ramp": rng.uniform(0.03, 0.15) * mean, "lowest": 0.15 * mean,
            "activity": min(rng.uniform(0.2, 0.5) * step / 133.0, 1.0),
            "correction_memory": rng.uniform(600.0, 3600.0),
        },
        "operators": {
            "quantum": quantum, "lowest": 0.1 * mean,
            "dead_band": 0.0 if alone else rng.uniform(0.01, 0.05),
            "trim_time": rng.uniform(7200.0, 28800.0),
            "notice": 1e9 if operators == "schedule" else rng.uniform(1.0, 5.0) * quantum,
            "feedforward_spread": 0.0 if alone else 0.08, "people": 1 if alone else 9,
        },
    }  # fmt: skip


class BoxWater(Water):
    """Pool simulated by the box scheme in compound sections, uneven according to the scenario's seed."""

    boxes, theta = BOXES, THETA

    @cached_property
    def box(self) -> Box:
        """Model of the reach."""
        c, reach = self.scenario.channel, self.scenario.reach
        assert c is not None
        rng = np.random.default_rng([self.scenario.seed, 41])
        x = np.linspace(0.0, reach.length, self.boxes + 1)

        def uneven(size: float) -> Floats:
            """Draw a random piecewise linear profile along the reach, with mean 0."""
            rough = np.interp(x, np.linspace(0.0, reach.length, 7), rng.normal(0.0, size, 7))
            return np.asarray(rough - rough.mean())

        depth = self.level - c.bed_level
        nodes = Nodes(
            bed=c.bed_level + c.slope * (reach.length - x) + uneven(0.05 * depth),
            bottom=reach.width * np.exp(uneven(0.15)), bank=np.full(self.boxes + 1, c.side_slope),
            bankfull=np.full(self.boxes + 1, rng.uniform(1.02, 1.3) * depth),
            plain=np.full(self.boxes + 1, rng.uniform(0.0, 0.5) * reach.width),
            manning=c.manning * np.exp(uneven(0.12)), usual=np.zeros(self.boxes + 1), growth=np.zeros(self.boxes + 1),
        )  # fmt: skip
        return Box(reach.length, nodes, c.gate_time, wave_travel(self.scenario) / self.boxes, self.theta)

    def arrival(self, flow: Floats, level: Floats) -> Floats:
        """Return the travel time of a small wave for each flow and level [s], see the base class."""
        return np.array([self.box.arrival(q, h) for q, h in zip(flow, level, strict=True)])

    def run(
        self, time: Floats, inflow: Floats, outflow: Floats | OperatorArrays, usual_flow: Floats,
        changes: Changes, start: float,
    ) -> tuple[Floats, Floats, Floats]:  # fmt: skip
        """Simulate the reach, see the base class."""
        return self.box.simulate(time, inflow, outflow, start, changes)


def season_of(world: World, effects: tuple[Effect, ...] = ()) -> Season:
    """Simulate the season of a world with effects.

    Raises
    ------
    RividError
        If the operators cannot hold the level, or the hydraulics cannot follow them.
    """
    water = {"box": BoxWater, "river": RiverWater}.get(world.kind, Water)
    season = simulate(world.scenario, world.seed, effects=effects, water=water)
    if world.kind != "river" and np.ptp(season.true_level) > WIDEST * world.scenario.reach.depth:
        raise RividError(
            f"the level moves by {np.ptp(season.true_level):.2f} m: its operators do not hold it"
        )
    return season


def logs_of(world: World, season: Season, late: Floats | None = None, without: tuple[str, ...] = ()) -> Logs:
    """Return the data of a user: the logs, and a configuration with the geometry to a few percent.

    Parameters
    ----------
    world : World
    season : Season
    late : ndarray, shape (days, n), optional
        Level added to the readings of the gauge [m]. It is rounded to the gauge's step.
    without : tuple of str
        Effects that are excluded from the diagnosis.
    """
    level, quantum = season.level, world.scenario.level.quantum
    if late is not None:
        level = np.round(level + np.round(late / quantum) * quantum, 9)
    reach = world.scenario.reach
    nominal = {
        name: float(f"{value * (1.0 + world.off[name]):.3g}")
        for name, value in (
            ("length", reach.length), ("width", reach.surface_area / reach.length), ("depth", reach.depth),
        )
    }  # fmt: skip
    pool = world.kind != "river"
    kind = {"surface_area": nominal["length"] * nominal["width"]} if pool else {"kind": "river"}
    settings = {
        "reach": nominal
        | kind
        | {
            "name": "reach", "sample_time": reach.sample_time,
            "discharge_range": [float(f"{q:.2g}") for q in reach.discharge_range],
        },
        "diagnose": {"exclude": list(without)},
    }  # fmt: skip
    outflow = season.outflow if pool else None
    return Logs(season.dates, season.seconds, season.inflow, outflow, level, settings)
