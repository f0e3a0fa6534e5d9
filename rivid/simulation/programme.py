"""The inflow programme: a season's river, and a dispatcher at the upstream dam who follows the load."""

import datetime as dt
import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rivid.simulation.scenario import FlowScenario, ProgrammeScenario
from rivid.types import DAY, Floats

SHAPE_HOURS = np.array([0.5, 5.5, 7.5, 9.5, 11.5, 16.5, 18.5, 20.5, 23.0])
"""Corners of the day's load [h]: night, morning peak, midday, evening peak."""
SHAPE_LOADS = np.array([0.1, 0.0, 1.0, 0.9, 0.55, 0.5, 1.0, 0.9, 0.2])
"""Load at each corner as a share of the day's swing."""
SHAPE_MEAN = float(np.interp(np.arange(0.0, 24.0, 0.01), SHAPE_HOURS, SHAPE_LOADS, period=24.0).mean())
"""Mean of the usual load, taken away so that the day keeps the river's mean."""
LOAD_SPREAD = 0.12
"""How much a corner's load differs from day to day, as a share of the swing (standard deviation)."""


def ar1(n: int, step: float, memory: float, rng: np.random.Generator) -> Floats:
    """A stationary AR(1) of unit variance, shape (n,).

    `step` is the time between values, `memory` that over which the correlation falls to 1/e (same unit).
    """
    rho = math.exp(-step / memory)
    shocks = rng.standard_normal(n)
    shocks[1:] *= math.sqrt(1.0 - rho * rho)  # the first value has the full variance already
    return np.asarray(lfilter([1.0], [1.0, -rho], shocks))


def daily_flow(flow: FlowScenario, first_day: dt.date, days: int, rng: np.random.Generator) -> Floats:
    """Mean discharge of each day [m3/s], shape (days,), within `flow.lowest` and `flow.highest`.

    The season has one time of high water, and wet and dry spells.
    """
    day_of_year = (first_day - dt.date(first_day.year, 1, 1)).days + np.arange(days)
    season = flow.seasonal * np.cos(2 * np.pi * (day_of_year - flow.peak_day + 1) / 365.25)
    spells = flow.variability * ar1(days, 1.0, flow.memory_days, rng)
    return np.asarray(np.clip(flow.mean * np.exp(season + spells), flow.lowest, flow.highest))


def programme(
    scenario: ProgrammeScenario,
    time: Floats,
    means: Floats,
    weekdays: NDArray[np.intp],
    rng: np.random.Generator,
) -> Floats:
    """Inflow commands u_Qi in whole quanta.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Sample times [s] from the first day's midnight.
    means : ndarray, shape (days,)
        Mean discharge of each day [m3/s].
    weekdays : ndarray of int, shape (days,)
        0 is Monday.

    Returns
    -------
    ndarray, shape (n,)
        Held from each sample to the next [m3/s].

    Notes
    -----
    The load's corners move a little every day and are joined across midnight. On top lie corrections, the
    share of the load's unrest that this dam takes. The dispatcher acts on some samples only, in steps that
    the ramp limits.
    """
    p = scenario
    days = len(means)
    swing = p.swing * np.exp(p.swing_spread * rng.standard_normal(days) - p.swing_spread**2 / 2)
    swing *= np.where(weekdays >= 5, p.weekend, 1.0)
    swing = np.minimum(swing, 2.0 * np.maximum(means - p.lowest, 0.0))  # a dry river has no water to shift
    corners = SHAPE_HOURS * 3600.0 + p.jitter * rng.standard_normal((days, len(SHAPE_HOURS)))
    corners = np.sort(np.clip(corners, 0.0, DAY - 1.0), axis=1) + DAY * np.arange(days)[:, None]
    loads = SHAPE_LOADS + LOAD_SPREAD * rng.standard_normal(corners.shape) - SHAPE_MEAN
    load = np.interp(time, corners.ravel(), (loads * swing[:, None]).ravel())
    river = np.interp(time, DAY * (np.arange(days) + 0.5), means)
    step = float(np.median(np.diff(time)))
    unrest = p.corrections * ar1(len(time), step, p.correction_memory, rng)
    target = np.maximum(river + load + unrest, p.lowest)
    return _dispatch(p, target, rng.random(len(time)) < p.activity)


def _dispatch(p: ProgrammeScenario, target: Floats, acts: NDArray[np.bool_]) -> Floats:
    """Follow the target on the samples where the dispatcher acts, in whole quanta and limited steps."""
    wanted = np.round(target / p.quantum).tolist()
    most = max(round(p.ramp / p.quantum), 1)
    now = wanted[0]
    units = []
    for want, act in zip(wanted, acts.tolist(), strict=True):
        if act:
            now += min(max(want - now, -most), most)
        units.append(now)
    return np.asarray(units) * p.quantum
