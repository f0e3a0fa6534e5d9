"""A season of a simulated reach: continuous days of commands and levels, and the truth behind them."""

import datetime as dt
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rivid.reach.operators import OperatorSettings, draw_crew, quantise, regulate, roster
from rivid.reach.response import NO_HOOKS, AddedFlow, Floats, Hooks, LinearReach, level_response, supply
from rivid.scenario import LevelScenario, Scenario
from rivid.simulate.programme import DAY, ar1, daily_flow, programme

Ints = NDArray[np.intp]
EDGE = 0.1
"""Within this many samples of an edge the true delay has two right answers."""


@dataclass(frozen=True)
class Season:
    """Days of logs and their truth, in date order; missing days are left out.

    Attributes
    ----------
    scenario : Scenario
        What was simulated.
    seed : int
        With what seed.
    dates : tuple of datetime.date
        One per row.
    seconds : ndarray, shape (N,)
        Sample times after local midnight [s]: k T_s, the last step of the day being shorter.
    inflow, outflow : ndarray, shape (days, N)
        Commands u_Qi and u_Qo [m3/s].
    level : ndarray, shape (days, N)
        What the gauge gave, h_L [m]; NaN where it gave nothing.
    true_level : ndarray, shape (days, N)
        The water itself [m].
    weather : ndarray, shape (days, N)
        The inflow that no log holds [m3/s].
    travel_time : ndarray, shape (days,)
        True travel time at the day's mean inflow [s].
    delay : ndarray of int, shape (days,)
        True delay d [samples]; see :func:`true_delay`.
    delay_other : ndarray of int, shape (days,)
        The other right answer where `near_edge`, the same elsewhere.
    near_edge : ndarray of bool, shape (days,)
        The travel time is close to a whole number of samples.
    """

    scenario: Scenario
    seed: int
    dates: tuple[dt.date, ...]
    seconds: Floats
    inflow: Floats
    outflow: Floats
    level: Floats
    true_level: Floats
    weather: Floats
    travel_time: Floats
    delay: Ints
    delay_other: Ints
    near_edge: NDArray[np.bool_]

    @property
    def sample_time(self) -> float:
        """T_s [s]."""
        return self.scenario.reach.sample_time


def simulate(scenario: Scenario, seed: int | None = None, *, hooks: Hooks = NO_HOOKS) -> Season:
    """Simulate a season in closed loop.

    Parameters
    ----------
    scenario : Scenario
    seed : int, optional
        Instead of the scenario's own. The same seed gives the same season; each part of it (river,
        programme, people, gauge, weather, missing days) has a stream of its own.
    hooks : Hooks
        What is changed from outside. Times count from the first day's midnight; those of the day of lead
        time before it are negative.

    Returns
    -------
    Season

    Raises
    ------
    ConfigError
        Where the operators' loop would swing.
    """
    seed = scenario.seed if seed is None else seed
    river_rng, load_rng, people_rng, gauge_rng, weather_rng, missing_rng = (
        np.random.default_rng([seed, stream]) for stream in range(6)
    )
    reach = LinearReach(**scenario.reach.model_dump(include=set(LinearReach.__dataclass_fields__)))
    settings = OperatorSettings(**scenario.operators.model_dump())
    T_s = scenario.reach.sample_time
    days = scenario.days + 1  # one day of lead time, so that the first day begins like any other
    first = scenario.first_day - dt.timedelta(days=1)
    seconds = np.arange(0.0, DAY, T_s)
    time = (np.arange(-1, scenario.days)[:, None] * DAY + seconds).ravel()
    steps = np.diff(time, append=scenario.days * DAY)

    means = daily_flow(scenario.flow, first, days, river_rng)
    weekdays = (first.weekday() + np.arange(days)) % 7
    inflow = programme(scenario.programme, time + DAY, means, weekdays, load_rng)
    usual = _day_around(inflow, steps, len(seconds))
    travel = reach.travel_time(usual)

    w = scenario.weather
    weather = w.inflow * ar1(len(time), T_s, w.memory, weather_rng)
    hooks = Hooks(
        hooks.inflow, hooks.outflow, (*hooks.added, AddedFlow(w.place, lambda _: weather)), hooks.gauge
    )
    gauge = scenario.level
    noise = gauge.noise * gauge_rng.standard_normal(len(time))
    aim = gauge.set_point - gauge.drawdown / 100.0 * np.maximum(usual - gauge.drawdown_from, 0.0)
    outflow = regulate(
        time, inflow, supply(reach, time, inflow, travel, inflow[0], hooks), noise, aim, settings,
        draw_crew(settings, reach.surface_area, people_rng), roster(time, settings, people_rng),
        surface_area=reach.surface_area, outflow_gain=reach.outflow_gain, gauge_quantum=gauge.quantum,
        rng=people_rng, hooks=hooks,
    )  # fmt: skip
    water = aim[0] + level_response(reach, time, inflow, outflow, travel, before=inflow[0], hooks=hooks)
    seen = water if hooks.gauge is None else hooks.gauge(time, water)
    level = quantise(seen + noise, gauge.quantum)
    level[_silent(gauge, time, steps, gauge_rng)] = np.nan

    kept = np.sort(missing_rng.permutation(scenario.days)[scenario.missing_days :])
    logged, regulated, read, true_level, unlogged = (
        values.reshape(days, -1)[kept + 1] for values in (inflow, outflow, level, water, weather)
    )
    arrival = reach.travel_time(np.average(logged, axis=1, weights=steps[: len(seconds)]))
    delay, delay_other, near_edge = true_delay(arrival, T_s)
    return Season(
        scenario=scenario, seed=seed,
        dates=tuple(scenario.first_day + dt.timedelta(days=int(k)) for k in kept), seconds=seconds,
        inflow=logged, outflow=regulated, level=read, true_level=true_level, weather=unlogged,
        travel_time=arrival, delay=delay, delay_other=delay_other, near_edge=near_edge,
    )  # fmt: skip


def true_delay(travel_time: Floats, sample_time: float) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """The delay in samples that a travel time is.

    Parameters
    ----------
    travel_time : ndarray, shape (days,)
        Arrival of the first sign of a change of inflow [s].
    sample_time : float
        T_s [s].

    Returns
    -------
    delay : ndarray of int, shape (days,)
        ``d = ceil(arrival / T_s) - 1``: the change is seen first at lag d + 1.
    delay_other : ndarray of int, shape (days,)
        The delay on the other side of the edge where it is near, else the same.
    near_edge : ndarray of bool, shape (days,)
        The arrival is within 0.1 T_s of a sample.

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


def _silent(gauge: LevelScenario, time: Floats, steps: Floats, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Samples that the gauge does not give."""
    silent = np.zeros(len(time), bool)
    starts = np.flatnonzero(rng.random(len(time)) < gauge.gaps_per_day * steps / DAY)
    lengths = rng.exponential(gauge.gap_length, len(starts))
    for start, length in zip(starts, lengths, strict=True):
        silent[start : max(np.searchsorted(time, time[start] + length), start + 1)] = True
    return silent
