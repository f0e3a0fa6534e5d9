"""Seasons with known operators, a plain loop of these operators, and closed loops for pages."""

import dataclasses
import datetime as dt
import math
from functools import cache
from pathlib import Path

import numpy as np

from rivid.diagnosis.data import as_record
from rivid.diagnosis.result import ClosedLoop, LoopDay, LoopErrors, Operators, Regime
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

SCENARIOS = Path(__file__).parents[2] / "configs" / "scenarios"
ALIKE = {"feedforward_spread": 0.0, "level_gain_spread": 0.0, "set_point_spread": 0.0}
"""Habits for which all shifts have the same operator."""


@cache
def season(name, seed, days=60, effects=(), quiet=False, drawdown=0.0, **habits):
    """Simulate a season of a scenario with other settings of its operators."""
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    changed = {
        "days": days, "missing_days": 0, "first_day": dt.date(2008, 2, 1),
        "operators": scenario.operators.model_copy(update=habits),
    }  # fmt: skip
    changed["level"] = scenario.level.model_copy(update={"drawdown": drawdown})
    if quiet:
        changed["weather"] = scenario.weather.model_copy(update={"inflow": 0.0})
        changed["level"] = changed["level"].model_copy(update={"noise": 0.0, "quantum": 0.0})
    return simulate(scenario.model_copy(update=changed), seed, effects=effects)


def record_of(s):
    """Return the logs of a season."""
    return as_record(s.dates, s.seconds, s.inflow, s.outflow, s.level, sample_time=s.sample_time, lead=38)


def rounded(value, step):
    """Round to whole steps, halves to even; return the value itself if the step is 0."""
    return value if step == 0.0 else round(value / step) * step


def operators_by_hand(
    time, inflow, water, *, aim, gain, trim, band, look, notice, quantum, reading, start, K_Q
):
    """Return the commands from `start` on, one by one; `water(k, commands)` is the level that is read."""
    commands, wanted, at, seen, before = [], start, None, inflow[0], None
    for k, t in enumerate(time):
        level = water(k, commands)
        if at is not None and t < at + look and abs(inflow[k] - seen) <= notice:
            commands.append(commands[-1])
            continue
        off = rounded(level, reading) - aim
        error = math.copysign(max(abs(off) - band, 0.0), off)
        if at is not None:
            wanted += K_Q * (inflow[k] - seen) + gain * (error - before) + gain * error * (t - at) / trim
        wanted = max(wanted, 0.0)
        at, seen, before = t, inflow[k], error
        commands.append(rounded(wanted, quantum))
    return np.array(commands)


OPERATORS = Operators(
    feedforward=0.95, lag_s=0.0, level_gain=131.2, trim_time_s=14160.0, dead_band=0.0125, set_point=130.006,
    look_s=1064.0, notice=4.0, quantum=1.0, r2=0.987, r2_inflow=0.967, change=26.0, left=2.99,
)  # fmt: skip
REGIMES = (
    Regime("inflow_low", "inflow below 153 m³/s", (0.0156, 0.079, 0.286), (0.008, 0.027, 0.137), (8, 5, 2)),
    Regime("calm", "longer after a step", (0.0116, 0.059, math.nan), (0.0069, 0.022, math.nan), (9, 4, 0)),
)  # fmt: skip


def loop_of(record, row=3):
    """Return a closed loop that shows a row of a record with a small oscillation added."""
    hour = record.hour[row, record.lead :]
    u, o, h = (v[row, record.lead :] for v in (record.inflow, record.outflow, record.output))
    swing = np.sin(2 * np.pi * hour / 24.0)
    curves = [(h + 0.05 * s * swing, o + 8.0 * s * swing) for s in (0.0, 1.0, 0.3)]
    pairs = [tuple(tuple(c[i].tolist()) for c in curves) for i in range(2)]
    before, after = LoopErrors(0.144, 0.0493, 6.09, 0.0399), LoopErrors(0.065, 0.0316, 3.5, 0.045)
    return ClosedLoop(
        OPERATORS, "", 12, 0.0556, before, after,
        LoopDay(record.dates[row], tuple(hour.tolist()), tuple(u.tolist()), *pairs),
    )  # fmt: skip


def with_loop(answer, record):
    """Return an answer with a closed loop and regimes."""
    gap = None if answer.gap is None else dataclasses.replace(answer.gap, by_regime=REGIMES)
    return dataclasses.replace(answer, gap=gap, closed_loop=loop_of(record))
