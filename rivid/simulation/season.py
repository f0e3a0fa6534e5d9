"""A season of a scenario: the river and the programme of its inflow, the water, the operators, the truth.

The dispatcher of the upstream dam follows the load. The water is the linear pool of (7), or follows the
equations of Saint-Venant (1).
"""

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rivid.effects import Effect, changes_of
from rivid.effects.base import World
from rivid.errors import ConfigError, RividError
from rivid.reach.changes import AddedFlow, Changes
from rivid.reach.gate import OperatorArrays
from rivid.reach.gauge import stilled
from rivid.reach.integrator import LinearReach, pool_level
from rivid.reach.operators import OperatorSettings, draw_crew, operator_arrays, quantise, roster
from rivid.reach.saint_venant import Channel, arrival_time
from rivid.reach.saint_venant import simulate as saint_venant
from rivid.simulation.scenario import FlowScenario, LevelScenario, ProgrammeScenario, Scenario
from rivid.types import DAY, Floats, Ints

# The inflow

SHAPE_HOURS = np.array([0.5, 5.5, 7.5, 9.5, 11.5, 16.5, 18.5, 20.5, 23.0])
"""Corners of the day's load [h]: night, morning peak, midday, evening peak."""
SHAPE_LOADS = np.array([0.1, 0.0, 1.0, 0.9, 0.55, 0.5, 1.0, 0.9, 0.2])
"""Load at each corner as a share of the day's swing."""
SHAPE_MEAN = float(np.interp(np.arange(0.0, 24.0, 0.01), SHAPE_HOURS, SHAPE_LOADS, period=24.0).mean())
"""Mean of the usual load, taken away so that the day keeps the river's mean."""
LOAD_SPREAD = 0.12
"""Standard deviation of a corner's load from day to day, as a share of the swing."""


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
    p: ProgrammeScenario, time: Floats, means: Floats, weekdays: NDArray[np.intp], rng: np.random.Generator
) -> Floats:
    """Inflow commands u_Qi in whole quanta [m3/s], held from each sample to the next, shape (n,).

    `time`, shape (n,), are sample times from the first day's midnight [s], `means`, shape (days,), the mean
    discharges of the days [m3/s], and `weekdays`, shape (days,), are 0 on Mondays. The load's corners move a
    little every day and are joined across midnight. On top lie corrections, the share of the load's unrest
    that this dam takes. The dispatcher acts on some samples only, in steps that the ramp limits.
    """
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
    wanted = np.round(np.maximum(river + load + unrest, p.lowest) / p.quantum).tolist()
    most = max(round(p.ramp / p.quantum), 1)
    now, units = wanted[0], []
    for want, chance in zip(wanted, rng.random(len(time)).tolist(), strict=True):
        if chance < p.activity:
            now += min(max(want - now, -most), most)
        units.append(now)
    return np.asarray(units) * p.quantum


# The water

TRIAL = 1.0
"""Step of outflow from which the response of a channel's level is computed [m3/s]."""


class Water:
    """The reach of a scenario.

    `area_slope` is the relative change of the surface for each metre of level above the set-point [1/m].
    """

    def __init__(self, scenario: Scenario, area_slope: float = 0.0) -> None:
        self.scenario, self.area_slope = scenario, area_slope

    @cached_property
    def pool(self) -> LinearReach:
        """The linear reach; its gains hold for both kinds."""
        return LinearReach(**self.scenario.reach.model_dump(include=set(LinearReach.__dataclass_fields__)))

    @cached_property
    def channel(self) -> Channel | None:
        """The sections along the reach; None for the linear one."""
        c, reach = self.scenario.channel, self.scenario.reach
        if c is None:
            return None
        shape = Channel.smooth(
            reach.length, reach.width, c.slope, c.manning, c.cells, side_slope=c.side_slope,
            end_bed=c.bed_level, width_modes=c.width_modes, bed_modes=c.bed_modes,
            manning_modes=c.manning_modes,
        )  # fmt: skip
        return shape.with_area_slope(self.area_slope, self.level)

    @property
    def level(self) -> float:
        """The usual level [m]."""
        return self.scenario.level.set_point

    @cached_property
    def surface_area(self) -> float:
        """Water surface at the usual level [m2]."""
        return self.pool.surface_area if self.channel is None else self.channel.surface_area(self.level)

    def drop(self, time: float) -> float:
        """Fall of the level at the dam in a time [s] after 1 m3/s more is let out [m per m3/s].

        In a channel at the highest flow, with the level drawn down as for that: there it is largest.
        """
        if self.channel is None:
            return time / self.surface_area
        aim, flow = self.scenario.level, self.scenario.flow.highest
        level = aim.set_point - aim.drawdown / 100.0 * max(flow - aim.drawdown_from, 0.0)
        clock = np.linspace(0.0, time, 31)
        more = np.full(31, flow + TRIAL)
        try:
            start = saint_venant(self.channel, clock[:1], [flow], [flow], level).end
            fall = level - saint_venant(self.channel, clock, np.full(31, flow), more, start).level
        except RividError as error:
            raise ConfigError(f"channel, at the highest flow and its level: {error}") from None
        return float(fall.max() / TRIAL)

    def arrival(self, flow: Floats, level: Floats) -> Floats:
        """Travel time of a small wave at mean flows [m3/s] and levels [m] of days, shape (days,) [s]."""
        if self.channel is None:
            return self.pool.travel_time(flow)
        return arrival_time(self.channel, flow, level)

    def run(
        self, time: Floats, inflow: Floats, outflow: Floats | OperatorArrays, usual_flow: Floats,
        changes: Changes, start: float,
    ) -> tuple[Floats, Floats, Floats]:  # fmt: skip
        """Level, commanded and real outflow, from the logged inflow and the outflow's commands or operators.

        The linear reach's travel time follows `usual_flow` [m3/s]; `start` is the first level [m]. Raises
        ConfigError or RividError where the flow is impossible.
        """
        if self.channel is None:
            travel = self.pool.travel_time(usual_flow)
            return pool_level(
                self.pool, time, inflow, outflow, travel, start=start, before=float(inflow[0]),
                changes=changes,
            )  # fmt: skip
        c = self.scenario.channel
        assert c is not None
        for name, gain in (("inflow", self.pool.inflow_gain), ("outflow", self.pool.outflow_gain)):
            if gain != 1.0:
                raise ConfigError(
                    f"reach.{name}_gain = {gain:g} with [channel]: expected 1; plant the effect "
                    f"{name}_gain_error instead"
                )
        try:
            flow = saint_venant(
                self.channel, time, inflow, outflow, start, changes=changes,
                gate_time=c.gate_time, courant=c.courant, step=c.step,
            )  # fmt: skip
        except RividError as error:
            raise type(error)(f"channel: {error}") from None
        return flow.level, flow.outflow, flow.released


# The season

EDGE = 0.1
"""Within this many samples of an edge the true delay has two right answers."""


@dataclass(frozen=True, eq=False)
class Season:
    """Days of logs and their truth, in date order; missing days are left out."""

    scenario: Scenario
    seed: int
    dates: tuple[dt.date, ...]  #: one per row
    seconds: Floats  #: sample times after local midnight [s]: k T_s, the day's last step being shorter, (N,)
    inflow: Floats  #: commands u_Qi [m3/s], (days, N)
    outflow: Floats  #: commands u_Qo [m3/s], (days, N)
    level: Floats  #: gauge reading h_L [m]; NaN where it is missing, (days, N)
    true_level: Floats  #: true level [m], (days, N)
    weather: Floats  #: unlogged random inflow [m3/s], (days, N)
    travel_time: Floats  #: true travel time at the day's mean inflow [s], (days,)
    delay: Ints  #: true delay d [samples]; see :func:`true_delay`, (days,)
    delay_other: Ints  #: the other right answer where `near_edge`, the same elsewhere, (days,)
    near_edge: NDArray[np.bool_]  #: the travel time is close to a whole number of samples, (days,)
    real_inflow: Floats  #: what the upstream dam really lets through [m3/s], (days, N)
    real_outflow: Floats  #: the same of the downstream dam [m3/s], (days, N)
    #: sum of all flows other than through the dams that do not depend on the level, weather included [m3/s],
    #: (days, N)
    unlogged: Floats
    effects: tuple[Effect, ...]  #: that were simulated
    world: World  #: input of the effects, lead time included
    place: int  #: number of the reach in its cascade, from 0
    all_outflow: Floats  #: outflow commands of all days, lead time and missing days included [m3/s], (n,)

    @property
    def sample_time(self) -> float:
        """T_s [s]."""
        return self.scenario.reach.sample_time


def simulate(
    scenario: Scenario, seed: int | None = None, *, effects: Sequence[Effect] = (),
    upstream: "Season | None" = None, water: type[Water] = Water,
) -> Season:  # fmt: skip
    """Simulate a season of one reach in closed loop; see :func:`simulate_cascade` for several.

    The same `seed`, the scenario's own by default, gives the same season; each part of it (river, programme,
    operators, gauge, weather, missing days, each effect) has a stream of its own. `effects` are beside those
    of the scenario. The outflow commands of the reach `upstream` are this reach's inflow. `water` is
    :class:`Water`, or a subclass with equations of its own. ConfigError where the operators' loop would
    swing, or the flow is impossible.
    """
    seed = scenario.seed if seed is None else seed
    place = 0 if upstream is None else upstream.place + 1
    river_rng, load_rng, operators_rng, gauge_rng, weather_rng, missing_rng = (
        np.random.default_rng([seed, stream, *([place] if place else [])]) for stream in range(6)
    )
    T_s = scenario.reach.sample_time
    days = scenario.days + 1  # one day of lead time, so that the first day begins like any other
    first = scenario.first_day - dt.timedelta(days=1)
    seconds = np.arange(0.0, DAY, T_s)
    time = (np.arange(-1, scenario.days)[:, None] * DAY + seconds).ravel()
    steps = np.diff(time, append=scenario.days * DAY)

    if upstream is None:
        means = daily_flow(scenario.flow, first, days, river_rng)
        weekdays = (first.weekday() + np.arange(days)) % 7
        inflow = programme(scenario.programme, time + DAY, means, weekdays, load_rng)
    else:
        inflow = upstream.all_outflow
    usual = _day_around(inflow, steps, len(seconds))

    w = scenario.weather
    weather = w.inflow * ar1(len(time), T_s, w.memory, weather_rng)
    world = World(
        time=time, inflow=inflow, outflow=None, first_day=scenario.first_day, sample_time=T_s,
        level=scenario.level.set_point, flow=scenario.flow.mean, seed=(seed, 6, place),
    )  # fmt: skip
    planted = (*scenario.planted(), *effects)
    for effect in planted:
        if not effect.acts_on_pool:
            raise ConfigError(f"{effect.name} acts on rivers alone: expected effects of a reach with a level")
    asked = changes_of(planted, world)
    reach = water(scenario, asked.area_slope)
    changes = replace(asked, added=(*asked.added, AddedFlow(w.place, weather)), area_reference=reach.level)

    gauge = scenario.level
    noise = gauge.noise * gauge_rng.standard_normal(len(time)) + asked.gauge
    settings = OperatorSettings(**scenario.operators.model_dump())
    aim = gauge.set_point - gauge.drawdown / 100.0 * np.maximum(usual - gauge.drawdown_from, 0.0)
    aim += _set_points(gauge, steps, seed, place)
    crew = draw_crew(settings, reach.drop(settings.look[1]), operators_rng)
    duty = roster(time, settings, operators_rng)
    operators = operator_arrays(
        inflow, noise, aim, settings, crew, duty, gauge_quantum=gauge.quantum, rng=operators_rng
    )
    true, commands, released = reach.run(time, inflow, operators, usual, changes, float(aim[0]))
    level = quantise(stilled(time, true, gauge.lag + asked.well) + noise, gauge.quantum)
    level[_silent(gauge, time, steps, gauge_rng)] = np.nan

    kept = np.sort(missing_rng.permutation(scenario.days)[scenario.missing_days :])
    real = inflow if changes.inflow is None else changes.inflow
    unlogged = np.sum([np.broadcast_to(part.flow, time.shape) for part in changes.added], axis=0)
    logged, regulated, read, true_level, slow, real_in, real_out, entered = (
        values.reshape(days, -1)[kept + 1]
        for values in (inflow, commands, level, true, weather, real, released, unlogged)
    )
    arrival = reach.arrival(
        np.average(logged, axis=1, weights=steps[: len(seconds)]), true_level.mean(axis=1)
    )
    delay, delay_other, near_edge = true_delay(arrival, T_s)
    return Season(
        scenario=scenario, seed=seed,
        dates=tuple(scenario.first_day + dt.timedelta(days=int(k)) for k in kept), seconds=seconds,
        inflow=logged, outflow=regulated, level=read, true_level=true_level, weather=slow,
        real_inflow=real_in, real_outflow=real_out, unlogged=entered,
        travel_time=arrival, delay=delay, delay_other=delay_other, near_edge=near_edge,
        effects=planted, world=world, place=place, all_outflow=commands,
    )  # fmt: skip


def simulate_cascade(scenario: Scenario, seed: int | None = None) -> tuple[Season, ...]:
    """Simulate the reaches of a cascade, from the top, the outflow of each feeding the next (Fig. 19).

    A scenario without a `cascade` has one reach; `seed` is as of :func:`simulate`.
    """
    seasons: list[Season] = []
    for reach in scenario.reaches():
        seasons.append(simulate(reach, seed, upstream=seasons[-1] if seasons else None))
    return tuple(seasons)


def true_delay(travel_time: Floats, sample_time: float) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """The delay in samples that the travel times of days, shape (days,) [s], are.

    ``d = ceil(arrival / T_s) - 1``, since the change is first seen at lag d + 1; the delay on the other side
    of the edge where the arrival is within 0.1 T_s of a sample, else the same; and whether it is.

    Examples
    --------
    >>> d, other, near = true_delay(np.array([6.5, 6.95, 7.05]), 1.0)
    >>> d.tolist(), other.tolist(), near.tolist()
    ([6, 6, 7], [6, 7, 6], [False, True, True])
    """
    x = travel_time / sample_time
    delay = np.ceil(x).astype(np.intp) - 1
    edge = np.round(x)
    near = np.abs(x - edge) < EDGE
    other = np.where(near, 2 * edge - 1 - delay, delay).astype(np.intp)
    return delay, other, near


def _day_around(flow: Floats, steps: Floats, per_day: int) -> Floats:
    """Mean flow of the 24 hours around each sample: the slow flow that travel time and set-point follow."""
    half = per_day // 2
    passed = np.concatenate([[0.0], np.cumsum(flow * steps)])
    clock = np.concatenate([[0.0], np.cumsum(steps)])
    k = np.arange(len(flow))
    low, high = np.maximum(k - half, 0), np.minimum(k - half + per_day, len(flow))
    return np.asarray((passed[high] - passed[low]) / (clock[high] - clock[low]))


def _set_points(gauge: LevelScenario, steps: Floats, seed: int, place: int) -> Floats:
    """Random changes of the level aimed at [m]."""
    if gauge.set_points_per_week == 0.0:
        return np.zeros(len(steps))
    rng = np.random.default_rng([seed, 7, place])
    moves = rng.random(len(steps)) < gauge.set_points_per_week * steps / (7 * DAY)
    asked = gauge.set_point_step * rng.standard_normal(len(steps))
    latest = np.maximum.accumulate(np.where(moves, np.arange(len(steps)), -1))
    return np.where(latest >= 0, asked[latest], 0.0)


def _silent(gauge: LevelScenario, time: Floats, steps: Floats, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Samples without a gauge reading."""
    silent = np.zeros(len(time), bool)
    starts = np.flatnonzero(rng.random(len(time)) < gauge.gaps_per_day * steps / DAY)
    lengths = rng.exponential(gauge.gap_length, len(starts))
    for start, length in zip(starts, lengths, strict=True):
        silent[start : max(np.searchsorted(time, time[start] + length), start + 1)] = True
    return silent
