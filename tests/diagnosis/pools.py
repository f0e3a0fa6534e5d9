"""Seasons of the linear pool as records, its response, and a calibrated model: quick, and exact."""

import datetime as dt
from functools import cache
from pathlib import Path

import numpy as np

from rivid.diagnosis.blocks import split
from rivid.diagnosis.candidates import Proposal
from rivid.diagnosis.data import as_record
from rivid.diagnosis.fit import Model, calibrate, evaluate
from rivid.diagnosis.response.linear import LinearPool
from rivid.effects import CATALOGUE
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

LINEAR = load_scenario(Path(__file__).parents[2] / "configs" / "scenarios" / "basse_isere.toml")
GAUGE_FLOOR = 0.01 / np.sqrt(12.0)


@cache
def season(seed, days=40, effects=()):
    """A season of the linear pool as a record."""
    scenario = LINEAR.model_copy(
        update={"days": days, "missing_days": 0, "first_day": dt.date(2008, 4, 1)}
    )  # fmt: skip
    s = simulate(scenario, seed, effects=effects)
    return as_record(s.dates, s.seconds, s.inflow, s.outflow, s.level, sample_time=s.sample_time, delay=7)


def nominal(record, fronts="none", **others):
    """The response that made the seasons."""
    return LinearPool.nominal(record, fronts, surface_area=6.7e5, delay=950.0, **others)


def fresh(record, response, effects=()):
    """A model that is not calibrated."""
    return Model(
        response, None, record.usual_output, record.usual_flow, GAUGE_FLOOR, tuple(effects),
        ((),) * len(effects),
    )  # fmt: skip


@cache
def fitted(record):
    """The model calibrated on the fitting days, about it and what it leaves."""
    dealt = split(record.dates)
    model = calibrate(fresh(record, nominal(record)), record.take(dealt.fit))
    linear = model.linear(record, dealt)
    return model, linear, evaluate(linear)


def made(name, fit, select, p=1e-6, t=3.0, improvement=0.2, **others):
    """A proposal by hand."""
    record = season(1, days=20)
    _, _, evaluation = fitted(record)
    window = others.pop("window", (None, None))
    column = np.ones((1, *record.time.shape))
    better = np.full(3, improvement)
    return Proposal(
        name, name, CATALOGUE[name](), (), window, p, evaluation, column, fit, select, t, better, 4, **others
    )  # fmt: skip
