"""Short Saint-Venant seasons as records, and the response that is their truth."""

import datetime as dt
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from rivid.diagnosis.data import as_record
from rivid.diagnosis.response.base import vector_of
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.effects import CATALOGUE
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

PLAIN = load_scenario(Path(__file__).parents[2] / "configs" / "scenarios" / "hydraulic.toml")
PLAIN = PLAIN.model_copy(update={"channel": PLAIN.channel.model_copy(update={"cells": 32})})  # for speed
DEPTH = PLAIN.level.set_point - PLAIN.channel.bed_level - 0.5 * 1.64
"""Mean depth of the channel. At the dam it is larger by half of the fall."""
GAUGE = 0.0035


@cache
def season(seed, days=6, effects=(), gauge=GAUGE, lag=0.0):
    """Simulate a season without weather, read by a gauge with white noise; effects are (name, key, value)."""
    level = PLAIN.level.model_copy(update={"noise": gauge, "quantum": 0.0, "lag": lag})
    quiet = PLAIN.weather.model_copy(update={"inflow": 0.0})
    scenario = PLAIN.model_copy(
        update={
            "days": days, "missing_days": 0, "first_day": dt.date(2008, 4, 1), "level": level,
            "weather": quiet,
        }
    )  # fmt: skip
    planted = tuple(CATALOGUE[name](**{key: value}) for name, key, value in effects)
    s = simulate(scenario, seed, effects=planted)
    return as_record(s.dates, s.seconds, s.inflow, s.outflow, s.level, sample_time=s.sample_time, lead=37)


def nominal(record, *, length=8200.0, width=81.6, depth=DEPTH, slope=2e-4, cells=32, **others):
    """Return the response that generated the seasons, or one with other parameters."""
    made = HydraulicResponse.nominal(
        length, width, depth, PLAIN.level.set_point, sample_time=record.sample_time, flow=record.usual_flow,
        slope=slope, cells=cells, **others,
    )  # fmt: skip
    return walls(made)


def walls(response):
    """Return the same reach with vertical banks."""
    steep = [p.name != "bank" for p in response.parameters]
    return response.with_parameters(vector_of(response) * steep)


def few(record, **others):
    """Return the same response without modes and corrections."""
    return nominal(record, width_modes=0, bed_modes=0, corrections=False, **others)


def one_row(flow, T_s=900.0):
    """Return a river's inflow as one long row."""
    record = river_record(np.random.default_rng(0), days=1, T_s=T_s)
    row = np.asarray(flow, float)[None]
    return replace(
        record, time=T_s * np.arange(row.shape[1])[None], inflow=row, outflow=0.0 * row, output=row,
        used=np.ones(row.shape, bool),
    )  # fmt: skip


def river_record(rng, days=5, n=96, T_s=900.0, base=250.0, swing=80.0):
    """Return days of a release that changes every hour; the output is filled in by the test."""
    hours = base + swing * np.cumsum(rng.standard_normal((days * n // 4,))) / 5.0
    inflow = np.clip(np.repeat(hours, 4), 60.0, None).reshape(days, n)
    dates = [dt.date(2024, 5, 1) + dt.timedelta(days=k) for k in range(days)]
    return as_record(dates, T_s * np.arange(n), inflow, None, inflow, sample_time=T_s, lead=42, kind="river")
