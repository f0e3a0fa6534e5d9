"""Simulated days without faults, functions that add one fault each, and a check of the finding."""

from dataclasses import replace
from functools import cache

import numpy as np

from rivid.check import check_days
from rivid.config import Config, parse
from rivid.logs.days import DataSet
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

CFS = 35.3147
STEP = 133
NAMES = {"inflow": "u_Qi", "outflow": "u_Qo", "output": "h_L"}


def reach_of(season):
    """Return the configuration of a simulated season."""
    reach = season.scenario.reach
    keys = ("name", "surface_area", "length", "width", "depth", "sample_time", "discharge_range")
    return parse({"reach": {key: getattr(reach, key) for key in keys}}, Config)


def days_of(season):
    """Return the days of a season as they are read."""
    columns = zip(season.dates, season.inflow, season.outflow, season.level, strict=True)
    return [DataSet(date, u, o, h, 0, "") for date, u, o, h in columns]


@cache
def sound(n=40, scenario="intermittent", seed=3):
    """Return days of a pool without faults, and their configuration."""
    loaded = load_scenario(f"configs/scenarios/{scenario}.toml")
    season = simulate(loaded.model_copy(update={"days": n, "missing_days": 0}), seed)
    return tuple(days_of(season)), reach_of(season)


def the_one(days, config, code, wrong=True, when=None, **values):
    """Check that there is one finding, with this code, these days and values; copies are ignored."""
    found = [one for one in check_days(days, config) if one.kind != "copy" or code.startswith("copy")]
    assert [one.code for one in found] == [code]
    (finding,) = found
    assert finding.wrong is wrong
    assert {key: finding.values.get(key) for key in values} == values
    if when is not None:
        assert sorted(finding.days) == [day.date for day in days[when]]
    return finding


def changed(days, names, change, among=slice(None)):
    """Return the days with columns changed on all days or some; `change` takes and returns a whole column."""
    n, touched = len(days[0].inflow), set(range(len(days))[among])
    for name in names:
        whole = change(np.concatenate([getattr(day, name) for day in days]))
        days = [
            replace(day, **{name: whole[k * n : (k + 1) * n]}) if k in touched else day
            for k, day in enumerate(days)
        ]
    return days


def scaled(days, factor, *names, among=slice(None)):
    """Return the days with columns in another unit."""
    return changed(days, names, lambda x: x * factor, among)


def late(days, seconds, name, step=STEP, among=slice(None), per_day=0.0):
    """Return the days with a column stamped late (its clock is fast), by `seconds`, or by more each day."""
    n = len(days[0].inflow)

    def shifted(x):
        k = np.arange(len(x))
        return x[np.clip(np.round(k - (seconds + per_day * k / n) / step).astype(int), 0, len(x) - 1)]

    return changed(days, [name], shifted, among)


def redated(days, by, name, among=slice(None)):
    """Return the days with the dates of a column `by` days late."""
    return changed(days, [name], lambda x: np.roll(x, by * len(days[0].inflow)), among)


def noisy(days, size):
    """Return the days with the level of a gauge that explains less of its moves."""
    rng = np.random.default_rng(2)
    return [replace(day, output=day.output + size * rng.normal(size=len(day.output))) for day in days]


def held(days, k, first, last):
    """Return the days with a gauge that is stuck on day k from one hour to another."""

    def still(x):
        a, b = (k * len(days[0].inflow) + round(hour * 3600 / STEP) for hour in (first, last))
        x[a:b] = x[a]
        return x

    return changed(days, ["output"], still, slice(k, k + 1))


def raised(days, k, hour, by, samples=None):
    """Return the days with a gauge that reads too high from an hour of day k, for `samples` or always."""

    def higher(x):
        at = k * len(days[0].output) + round(hour * 3600 / STEP)
        x[at : at + samples if samples else None] += by
        return x

    return changed(days, ["output"], higher)
