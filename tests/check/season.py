"""Simulated days without faults, and one function for each fault."""

from dataclasses import replace
from functools import cache

import numpy as np

from rivid.config import Config, parse
from rivid.logs.read import DataSet
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

CFS = 35.3147


def reach_of(season):
    """The configuration that goes with a simulated season."""
    reach = season.scenario.reach
    keys = ("name", "surface_area", "length", "width", "depth", "sample_time", "discharge_range")
    return parse({"reach": {key: getattr(reach, key) for key in keys}}, Config)


def days_of(season):
    """Its days, as they are read."""
    columns = zip(season.dates, season.inflow, season.outflow, season.level, strict=True)
    return [DataSet(date, u, o, h, 0, "") for date, u, o, h in columns]


@cache
def sound(n=40, scenario="basse_isere", seed=3):
    """Days of a pool without faults, and their configuration."""
    loaded = load_scenario(f"configs/scenarios/{scenario}.toml")
    season = simulate(loaded.model_copy(update={"days": n, "missing_days": 0}), seed)
    return tuple(days_of(season)), reach_of(season)


def scaled(days, factor, *names, among=slice(None)):
    """Columns in another unit, on all days or some."""
    touched = set(range(len(days))[among])
    return [
        replace(day, **{n: getattr(day, n) * factor for n in names}) if k in touched else day
        for k, day in enumerate(days)
    ]


def late(days, seconds, name, step=133, among=slice(None)):
    """A column with late stamps: its clock is fast."""
    whole = np.concatenate([getattr(day, name) for day in days])
    whole = whole[np.clip(np.arange(len(whole)) - round(seconds / step), 0, len(whole) - 1)]
    return _with(days, name, whole, among)


def drifting(days, seconds, name, step=133):
    """A column with a clock that gains so many seconds a day."""
    whole = np.concatenate([getattr(day, name) for day in days])
    at = np.arange(len(whole))
    from_ = np.round(at - at / len(getattr(days[0], name)) * seconds / step).astype(int)
    return _with(days, name, whole[np.clip(from_, 0, len(whole) - 1)], slice(None))


def redated(days, by, name, among=slice(None)):
    """A column with dates `by` days too late."""
    touched = set(range(len(days))[among])
    return [
        replace(day, **{name: getattr(days[(k - by) % len(days)], name)}) if k in touched else day
        for k, day in enumerate(days)
    ]


def held(days, k, first, last, step=133):
    """A gauge that stands still on a day from one hour to another."""
    level = days[k].output.copy()
    a, b = round(first * 3600 / step), round(last * 3600 / step)
    level[a:b] = level[a]
    return [replace(day, output=level) if j == k else day for j, day in enumerate(days)]


def raised(days, k, hour, by, samples=None, step=133):
    """A gauge that reads too much from an hour of a day on, for so many samples."""
    whole = np.concatenate([day.output for day in days])
    at = k * len(days[0].output) + round(hour * 3600 / step)
    whole[at : at + samples if samples else None] += by
    return _with(days, "output", whole, slice(None))


def _with(days, name, whole, among):
    n, touched = len(days[0].inflow), set(range(len(days))[among])
    return [
        replace(day, **{name: whole[k * n : (k + 1) * n]}) if k in touched else day
        for k, day in enumerate(days)
    ]
