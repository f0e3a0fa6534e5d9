"""Seasons of the linear pool as records, its response, and a fitted model: fast and exact."""

import datetime as dt
from functools import cache
from pathlib import Path

import numpy as np

from rivid.diagnosis.blocks import split
from rivid.diagnosis.data import START_UP, as_record
from rivid.diagnosis.explanation import fitted
from rivid.diagnosis.fit import Model
from rivid.diagnosis.response.linear import LinearPool
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

LINEAR = load_scenario(Path(__file__).parents[2] / "configs" / "scenarios" / "intermittent.toml")
GAUGE_FLOOR = 0.01 / np.sqrt(12.0)


@cache
def season(seed, days=25, effects=(), T_s=300.0):
    """Simulate a season of the linear pool as a record."""
    scenario = LINEAR.model_copy(
        update={
            "days": days, "missing_days": 0, "first_day": dt.date(2008, 4, 1),
            "reach": LINEAR.reach.model_copy(update={"sample_time": T_s}),
        }
    )  # fmt: skip
    s = simulate(scenario, seed, effects=effects)
    lead = round(950.0 / T_s) + START_UP
    return as_record(s.dates, s.seconds, s.inflow, s.outflow, s.level, sample_time=T_s, lead=lead)


def nominal(record, fronts="none", **others):
    """Return the response that generated the seasons."""
    return LinearPool.nominal(record, fronts, surface_area=6.7e5, delay=950.0, **others)


def model_of(record, response=None, effects=()):
    """Return a model without a fit."""
    return Model(
        response or nominal(record), None, record.usual_output, record.usual_flow, GAUGE_FLOOR,
        tuple(effects), ((),) * len(effects),
    )  # fmt: skip


def opened(record):
    """Return the days that are used to fit and to score."""
    return ~split(record.dates).sealed


@cache
def explained(record):
    """Return the explanation by the response alone."""
    return fitted(model_of(record), record, opened(record), steps=4, fresh=1)
