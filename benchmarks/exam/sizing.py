"""Compute 1x of the exam: the smallest size of an effect that a diagnosis is expected to find.

A reference follows the season's logs. It solves Saint-Venant in a smooth channel of the world's mean geometry
and keeps the level near the true one; a linear store and a river have their own equations. The reference
knows the noise: the weather, the gauge, and a misfit. No calibrated response has the unevenness of the true
reach, and its error comes with changes of flow. The level error therefore walks by :data:`MISFIT` of the
level's second difference, see :func:`misfit`.

1x is the larger of two sizes. At the first, the effect is as many standard errors from zero as 80 % power
requires, without the part that the calibration explains: geometry, the gauge's lag, and the response of gates
and fronts in the first samples after a change. At the second, the remaining part makes :data:`SHARE` of the
squared error of a forecast, at one horizon of :data:`HOURS`, over the days on which it acts. A smaller effect
is immaterial for a simulation.
"""

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from benchmarks.exam.river import RiverWater
from benchmarks.exam.worlds import Table, World
from rivid.core.hydraulics import GRAVITY
from rivid.diagnosis.data import Record
from rivid.diagnosis.response.linear import LinearPool
from rivid.effects import Effect, changes_of
from rivid.effects.flow import InflowGainError, StorageAreaSlope
from rivid.effects.level import RatingShift
from rivid.effects.timing import ClockOffset, FlowDependentDelay, WaveAttenuation
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.gauge import stilled
from rivid.reach.saint_venant import Channel, simulate
from rivid.simulation.season import Season
from rivid.types import Floats

NEEDED = 4.3
"""Standard errors: 3.5 for one name in 21 at 1 %, two-sided, and 0.84 for 80 % power."""
EVENT = 12.0
"""Log-likelihood that each event must gain, since its place is searched for among 1e5 samples [nats]."""
DATE = 5.0
"""Log-likelihood that each end of dates must gain: one in 120 days [nats]."""
SHARE = 0.1
"""Share of the squared error of a forecast from which an effect is material."""
HOURS = (0.25, 1.0, 4.0, 24.0)
"""Horizons of the forecasts [h]."""
MISFIT = 0.15
"""Step of the level error over the level's second difference. In twelve worlds without weather and gauge
noise, with the diagnosis's own response calibrated to each, it was 0.03 to 0.34, the median 0.09. Noise makes
a calibration worse."""
CELLS = 24
"""Cells of the reference channel."""
KNOWN = {"length": 0.03, "width": 0.05, "depth": 0.15, "manning": 0.25}
"""Relative standard deviations of the geometry known to a calibration. The fall of the bed is known to 0.2
depths."""
NUDGED = 1e-2
"""Step of the finite differences, in standard deviations of :data:`KNOWN`."""
GAUGE_LAG = 60.0
"""Standard deviation of the unknown lag of a stilling well [s]."""
LAGS, FRONTS = (1, 2, 3), (-1, 0, 1, 2)
"""Lags that a response may correct [samples]: of the outflow, and of the inflow relative to its arrival."""
CORRECTED = 0.75
"""Prior standard deviation of a correction, in T_s over the surface area, as in the diagnosis's response."""
UNEVEN = 0.03
"""Attenuation of waves, and their advance at twice the flow, compared with a smooth channel, in travel times
(standard deviation). 1x is then 0.13 travel times or more, as was measured on uneven channels."""
BANKS = 0.05
"""Standard deviation of the relative growth of the surface with the level, by banks that the configuration
does not describe [1/m]: banks with a run of 1 m per metre on both sides of 40 m."""
ACTS = 0.1
"""A stretch of two days counts if the effect's whitened square is at least this share of the largest one."""

SIZE_OF: dict[str, tuple[str, ...]] = {
    "lateral_inflow": ("inflow",), "diurnal_inflow": ("amplitude",), "rain_inflow": ("peak",),
    "unlogged_upstream_release": ("size",), "unlogged_downstream_release": ("size",),
    "leakage": ("loss",), "inflow_gain_error": ("error",), "outflow_gain_error": ("error",),
    "gate_head_effect": ("gain",), "storage_area_slope": ("slope",), "side_storage": ("area", "exchange"),
    "flow_dependent_delay": ("delay",), "wave_attenuation": ("spread",), "outflow_lag": ("lag",),
    "clock_offset": ("offset",), "gate_deadband": ("band",), "gate_rate_limit": ("rate",),
    "sensor_drift": ("drift",), "sensor_step": ("step",), "wind_setup": ("deviation",),
    "seiche": ("amplitude",), "hunting_governor": ("amplitude",), "bent_rating": ("bend",),
    "siphon": ("size",), "ice_cover": ("late",),
    "silting_well": ("lag",),
}  # fmt: skip
"""Parameters that scale each effect, all by the same factor. The first one is its size."""
INVERSE = frozenset({"gate_rate_limit"})
"""Effects that grow as their parameter decreases."""
NOISES = ("wind_setup", "seiche")
"""Effects drawn at every sample. Their spectrum is known, their course is not."""


def resized(table: Table, factor: float) -> Table:
    """Return the table of an effect scaled by `factor`.

    Examples
    --------
    >>> resized({"name": "side_storage", "area": 1e5, "exchange": 30.0}, 2.0)["exchange"]
    60.0
    >>> resized({"name": "gate_rate_limit", "rate": 0.02}, 2.0)["rate"]
    0.01
    """
    name = table["name"]
    factor = 1.0 / factor if name in INVERSE else factor

    def grown(value: Any) -> Any:
        return [grown(one) for one in value] if isinstance(value, list) else float(f"{factor * value:.6g}")

    return table | {key: grown(table[key]) for key in SIZE_OF[name]}


def size_of(table: Table) -> float:
    """Return the size of an effect in the unit of its first parameter; the largest if there are several."""
    return float(max(np.ravel(table[SIZE_OF[table["name"]][0]]), key=abs))


@njit(cache=True, error_model="numpy")
def filtered(
    columns: Floats, walk: Floats, c: float, phi: float, inflow: float, gauge: float
) -> tuple[Floats, Floats, Floats]:
    """Return the standardised innovations and the filtered level error and inflow, shape (p, rows, n) each.

    The model is x_{k+1} = x_k + c w_k + v_k, w_{k+1} = phi w_k + ..., z_k = x_k + e_k. The variance of v is
    walk[row, k]; `inflow` and `gauge` are the variances of w and e. x is unknown at the start of a row.

    c is 0 for a river, with z_k = w_k + v_k + e_k: nothing is stored.
    """
    river = c == 0.0
    p, rows, n = columns.shape
    white, level, flow = np.zeros(columns.shape), np.empty(columns.shape), np.empty(columns.shape)
    x, w = np.empty(p), np.empty(p)
    for r in range(rows):
        w[:] = 0.0
        x[:] = 0.0 if river else 1.0
        x *= columns[:, r, 0]
        xx, xw, ww = gauge, 0.0, inflow
        for k in range(n):
            if river:
                V = ww + walk[r, k] + gauge
                for i in range(p):
                    v = columns[i, r, k] - w[i]
                    white[i, r, k] = v / np.sqrt(V)
                    w[i] += ww / V * v
                ww -= ww * ww / V
            elif k > 0:
                V = xx + gauge
                g0, g1 = xx / V, xw / V
                for i in range(p):
                    v = columns[i, r, k] - x[i]
                    white[i, r, k] = v / np.sqrt(V)
                    x[i] += g0 * v
                    w[i] += g1 * v
                xx, xw, ww = xx - g0 * xx, xw - g0 * xw, ww - g1 * xw
            level[:, r, k], flow[:, r, k] = x, w
            for i in range(p):
                x[i] += c * w[i]
                w[i] *= phi
            xx, xw, ww = xx + c * (2.0 * xw + c * ww) + walk[r, k], phi * (xw + c * ww), phi * phi * ww
            ww += (1.0 - phi * phi) * inflow
    return white, level, flow


def misfit(level: Floats) -> Floats:
    """Return the variance of the step of the level error at each sample from a level [m], shapes (rows, n).

    A front that comes slightly early, late or steep causes an error that is a share of its height. The rate
    of the level is wrong where it changes, by :data:`MISFIT` of the change, spread over the adjacent samples.
    """
    bend = np.pad(np.diff(level, n=2, axis=1) ** 2, ((0, 0), (3, 3)))
    n = level.shape[1]
    spread = sum(bend[:, k : k + n] for k in range(5)) / 5.0
    return np.asarray(MISFIT**2 * spread)


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of a season without hidden effects, on stretches of two days.

    Attributes
    ----------
    world : World
    season : Season
        Without effects.
    at : ndarray of int, shape (rows, n)
        Samples of each stretch on the season's grid, lead time included.
    level : ndarray, shape (rows, n)
        True level [m].
    base : ndarray, shape (rows, n)
        Level of the reference without changes [m].
    walk : ndarray, shape (rows, n)
        Variance of the steps of the misfit [m2].
    columns : ndarray, shape (p, rows, n)
        Change of the level by one prior standard deviation of each parameter of a calibration [m].
    unknown : ndarray, shape (q, rows, n)
        The same for what no calibration has: the true reach differs in its waves and banks.
    run : callable
        Simulate the level with changes on the season's grid [m], shape (rows, n).
    """

    world: World
    season: Season
    at: np.ndarray
    level: Floats
    base: Floats
    walk: Floats
    columns: Floats
    unknown: Floats
    run: Callable[[Changes], Floats]

    @property
    def rise(self) -> float:
        """Rise of the output in a sample per inflow [m per m3/s]; 0 in a river, which stores nothing."""
        reach = self.world.scenario.reach
        return 0.0 if self.world.kind == "river" else reach.sample_time / reach.surface_area

    @property
    def days_each(self) -> float:
        """Days of the season per stretch."""
        return len(self.season.dates) / len(self.at)

    def filter(self, columns: Floats) -> tuple[Floats, Floats, Floats]:
        """Apply :func:`filtered` with the world's noise."""
        s = self.world.scenario
        T = s.reach.sample_time
        gauge = s.level.noise**2 + s.level.quantum**2 / 12.0
        return filtered(
            columns, self.walk, self.rise, float(np.exp(-T / s.weather.memory)),
            s.weather.inflow**2, gauge,
        )  # fmt: skip

    def change(self, changes: Changes) -> Floats:
        """Return the change of the reading by changes on the season's grid [m], shape (rows, n)."""
        part = cut(changes, self.season.world.time.shape, self.at)
        return np.asarray(self.run(changes) - self.base + part.gauge)


def cut(changes: Changes, shape: tuple[int, ...], at: np.ndarray) -> Changes:
    """Return changes on a selection of the samples of their grid."""

    def of(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value if value.size == 1 else np.broadcast_to(value, shape)[at]
        if isinstance(value, tuple):
            return tuple(of(each) for each in value)
        if is_dataclass(value) and not isinstance(value, type):
            return replace(value, **{f.name: of(getattr(value, f.name)) for f in fields(value)})
        return value

    made: Changes = of(changes)
    return made


def channel_of(world: World, **more: float) -> tuple[Channel, float]:
    """Return the smooth channel of a world, with dimensions multiplied by `more`, and its gate time [s].

    `fall` is added to the fall of the bed [m].
    """
    s = world.scenario
    reach, c, level = s.reach, s.channel, s.level.set_point
    fall, manning, side, gate_time = 0.15 * reach.depth, 0.03, 0.0, 30.0
    depth = reach.depth + 0.5 * fall
    if c is not None:
        fall, manning, side, gate_time = c.slope * reach.length, c.manning, c.side_slope, c.gate_time
        depth = level - c.bed_level
    length = reach.length * more.get("length", 1.0)
    channel = Channel.smooth(
        length, reach.width * more.get("width", 1.0), (fall + more.get("fall", 0.0)) / length,
        manning * more.get("manning", 1.0), CELLS, side_slope=side,
        end_bed=level - depth * more.get("depth", 1.0),
    )  # fmt: skip
    return channel, gate_time


def follow(grid: "Stretches", channel: Channel, gate_time: float, changes: Changes) -> Floats:
    """Return the level of a channel kept near the true one, less the volume added for it [m], (rows, n)."""
    time, at = grid.season.world.time[grid.at], grid.at
    flow = simulate(
        channel.with_area_slope(changes.area_slope, changes.area_reference), time,
        grid.season.world.inflow[at], grid.season.all_outflow[at], grid.level[:, 0], changes=changes,
        gate_time=gate_time, observed=grid.level,
    )  # fmt: skip
    free = flow.level.copy()
    free[:, 1:] -= np.cumsum(flow.nudge[:, :-1] * np.diff(time, axis=1), axis=1)
    return np.asarray(free)


def routed(world: World, season: Season, changes: Changes) -> Floats:
    """Return the discharge of a river with changes and without weather [m3/s], on the season's grid."""
    water, grid = RiverWater(world.scenario), season.world
    return water.run(grid.time, grid.inflow, season.all_outflow, grid.inflow, changes, 0.0)[0]


@dataclass(frozen=True, eq=False)
class Stretches:
    """Pairs of consecutive days, and the true level on them."""

    season: Season
    at: np.ndarray
    level: Floats


def stretches(season: Season) -> Stretches:
    """Return disjoint pairs of consecutive days with logs."""
    N = len(season.seconds)
    number = np.array([(date - season.scenario.first_day).days for date in season.dates])
    first: list[int] = []
    for i in range(len(number) - 1):
        if number[i + 1] == number[i] + 1 and (not first or i > first[-1] + 1):
            first.append(i)
    rows = np.array(first)
    at = (number[rows][:, None] + 1) * N + np.arange(2 * N)  # one day of lead time precedes them
    return Stretches(
        season, at, np.concatenate([season.true_level[rows], season.true_level[rows + 1]], axis=1)
    )


def reference(world: World, season: Season) -> Reference:
    """Build the reference of a world's season without effects.

    Raises
    ------
    RividError
        If the smooth channel cannot carry the flows.
    """
    grid = stretches(season)
    if world.kind == "river":
        return _of_river(world, season, grid)
    shape, time = season.world.time.shape, season.world.time[grid.at]
    if world.kind == "linear":
        run, columns = _of_store(world, season, grid)
        base = run(NO_CHANGES)
    else:
        channel, gate_time = channel_of(world)

        def run(changes: Changes) -> Floats:
            return follow(grid, channel, gate_time, cut(changes, shape, grid.at))

        base = run(NO_CHANGES)
        moves = {name: 1.0 + NUDGED * sd for name, sd in KNOWN.items()}
        moves["fall"] = NUDGED * 0.2 * world.scenario.reach.depth
        columns = [
            (follow(grid, channel_of(world, **{name: move})[0], gate_time, NO_CHANGES) - base) / NUDGED
            for name, move in moves.items()
        ]
        columns.append(stilled(time, base, GAUGE_LAG) - base)
    T = season.sample_time
    size = CORRECTED * T / world.scenario.reach.surface_area
    arrives = int(world.travel // T)
    for flow, lags in (
        (season.all_outflow, LAGS), (season.world.inflow, tuple(max(arrives + k, 1) for k in FRONTS)),
    ):  # fmt: skip
        rows = flow[grid.at]
        columns += [size * (np.take(rows, np.maximum(np.arange(rows.shape[1]) - k, 0), axis=1) - rows[:, :1])
                    for k in dict.fromkeys(lags)]  # fmt: skip
    taken = np.array(columns)
    bare = Reference(world, season, grid.at, grid.level, base, misfit(base), taken, taken[:0], run)
    usual = UNEVEN * world.travel
    more = [
        bare.change(changes_of((effect,), season.world))
        for effect in (
            WaveAttenuation(spread=usual), FlowDependentDelay(delay=-usual / world.scenario.flow.mean),
            StorageAreaSlope(slope=BANKS),
        )
    ]  # fmt: skip
    return replace(bare, unknown=np.array(more))


def _of_store(
    world: World, season: Season, grid: Stretches
) -> tuple[Callable[[Changes], Floats], list[Floats]]:
    """Return the simulation of a linear store, and its level change by one prior sd of each parameter."""
    time, at = season.world.time[grid.at], grid.at
    record = Record(
        season.dates[: len(at)], time, season.world.inflow[at], season.all_outflow[at], grid.level,
        np.ones(time.shape, bool), 0, season.sample_time,
    )  # fmt: skip
    reach, flow = world.scenario.reach, record.usual_flow
    velocity = flow / (reach.width * reach.depth)
    celerity = velocity + float(np.sqrt(GRAVITY * reach.wave_depth))
    pool = LinearPool.nominal(
        record, "none", surface_area=reach.surface_area, delay=reach.length / celerity,
        speed_share=velocity / celerity,
    )  # fmt: skip

    def run(changes: Changes) -> Floats:
        part = cut(changes, season.world.time.shape, at)
        return pool.baseline(record, replace(part, gauge=np.zeros(1)))

    slopes = pool.slopes(record, run(NO_CHANGES))
    return run, [slope * p.sd for slope, p in zip(slopes, pool.parameters, strict=True)]


RIVER = {"delay": 0.3, "spread": 0.25, "held": 1.0, "exponent": 0.2, "gain": 0.03}
"""Prior of the calibration of a river: delay, spread and hold-back of waves in travel times, the exponent of
the delay, and the gain and the constant of two ratings. Standard deviations are those of the diagnosis's
response."""


def _of_river(world: World, season: Season, grid: Stretches) -> Reference:
    """Build the reference of a river: the river itself, without weather."""

    def run(changes: Changes) -> Floats:
        return routed(world, season, changes)[grid.at]

    base = run(NO_CHANGES)
    none = base[None][:0]
    bare = Reference(world, season, grid.at, grid.level, base, misfit(base), none, none, run)
    moved = NUDGED * world.travel
    nudges = (
        (ClockOffset(offset=moved * RIVER["delay"]), NUDGED),
        (WaveAttenuation(spread=RIVER["spread"] * world.travel), 1.0),
        (WaveAttenuation(spread=RIVER["held"] * world.travel), 1.0),
        (FlowDependentDelay(delay=-moved * RIVER["exponent"] / world.scenario.flow.mean), NUDGED),
        (InflowGainError(error=RIVER["gain"]), 1.0),
        (RatingShift(error=0.0, offset=RIVER["gain"]), 1.0),
    )
    columns = [bare.change(changes_of((effect,), season.world)) / size for effect, size in nudges]
    return replace(bare, columns=np.array(columns))


@dataclass(frozen=True)
class Unit:
    """1x of an effect.

    Attributes
    ----------
    table : dict
        The effect at 1x.
    by : str
        Criterion that sets this size: `power`, or the horizon at which the effect is material.
    """

    table: Table
    by: str


def beyond(ref: Reference, z: Floats, *others: Floats) -> tuple[Floats, float]:
    """Return the part of a level change that the calibration and other columns do not explain.

    Parameters
    ----------
    ref : Reference
    z : ndarray, shape (rows, n)
        Change of the level [m].
    *others : ndarray, shape (rows, n)
        Columns with free coefficients.

    Returns
    -------
    ndarray, shape (rows, n)
        z without the part explained by the calibration [m].
    float
        Whitened square of the part explained by no column, over the whole season.
    """
    C = np.concatenate([ref.columns, ref.unknown, *(o[None] for o in others)])
    white = ref.filter(np.concatenate([z[None], C]))[0].reshape(1 + len(C), -1)
    w, X = white[0], white[1:]
    more, p = ref.days_each / 2.0, len(ref.columns)
    G, g = X @ X.T, X @ w
    prior = np.full(len(C), 1.0 / more)
    prior[p + len(ref.unknown) :] = 1e-9 * np.diag(G).max()
    b = np.linalg.solve(G + np.diag(prior), g)
    calibrated = np.linalg.solve(G[:p, :p] + np.diag(prior[:p]), g[:p])
    square = w @ w - b @ g  # includes the penalty of the priors
    return z - np.tensordot(calibrated, ref.columns, 1), float(more * max(square, 0.0))


def factor_of(ref: Reference, z: Floats, *, noise: bool, price: float) -> tuple[float, str]:
    """Return the factor by which a level change must be scaled to be 1x, and the criterion that sets it.

    Parameters
    ----------
    ref : Reference
    z : ndarray, shape (rows, n)
        Change of the level [m].
    noise : bool
        Whether only its spectrum is known.
    price : float
        Log-likelihood that its events and dates must gain [nats].
    """
    s, drawn = ref.world.scenario, _drawn(ref)
    left = z
    if not noise:
        left, square = beyond(ref, z)
        power = float(np.sqrt((NEEDED**2 + 2.0 * price) / max(square, 1e-300)))
    both = np.array([left, drawn])
    white, level, flow = ref.filter(both)
    w = white[0]
    if noise:
        power = _spectral(w, ref.days_each / 2.0)
    squares = (w * w).sum(axis=1)
    acts = squares >= ACTS * squares.max()
    T = s.reach.sample_time
    phi = float(np.exp(-T / s.weather.memory))
    material, by = np.inf, ""
    for hours in HOURS:
        h = max(round(3600.0 * hours / T), 1)
        grows = phi**h if ref.rise == 0.0 else ref.rise * (1.0 - phi**h) / (1.0 - phi)
        k = np.arange(round(3600.0 / T) + 2, z.shape[1] - h)  # the filter settles within an hour
        error = both[:, :, k + h] - level[:, :, k] - grows * flow[:, :, k]
        mine, other = (error[:, acts] ** 2).sum(axis=(1, 2))
        size = float(np.sqrt(SHARE / (1.0 - SHARE) * other / max(mine, 1e-300)))
        if size < material:
            material, by = size, f"{hours:g} h"
    return (power, "power") if power > material else (material, by)


def _drawn(ref: Reference) -> Floats:
    """Draw a residual without effects from the world's noise and the misfit [m], shape (rows, n)."""
    s = ref.world.scenario
    rng = np.random.default_rng([ref.world.seed, 43])
    T, (rows, n) = s.reach.sample_time, ref.walk.shape
    phi = float(np.exp(-T / s.weather.memory))
    steps = rng.standard_normal((n, rows)) * s.weather.inflow
    steps[1:] *= np.sqrt(1.0 - phi * phi)
    for k in range(1, n):
        steps[k] += phi * steps[k - 1]
    off = np.sqrt(ref.walk) * rng.standard_normal((rows, n))
    rises = ref.rise * steps.T + off
    x = np.concatenate([np.zeros((rows, 1)), np.cumsum(rises[:, :-1], axis=1)], axis=1)
    if ref.rise == 0.0:
        x = steps.T + off
    return np.asarray(
        x + np.hypot(s.level.noise, s.level.quantum / np.sqrt(12.0)) * rng.standard_normal((rows, n))
    )


def _spectral(white: Floats, more: float) -> float:
    """Return the factor for which Whittle's log-likelihood ratio of a known spectrum is NEEDED^2 / 2."""
    n = white.shape[1]
    ratio = (np.abs(np.fft.rfft(white, axis=1)) ** 2).mean(axis=0)[1:] / n
    rows = len(white) * more

    def gain(factor: float) -> float:
        r = factor**2 * ratio
        return float(rows * (r - np.log1p(r)).sum())

    return crossing(lambda f: gain(f) > 0.5 * NEEDED**2)


def crossing(enough: Callable[[float], bool]) -> float:
    """Return the smallest factor that is enough, by bisection of its logarithm."""
    low, high = 1e-4, 1e4
    for _ in range(30):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


TURNS = 5
"""Largest number of iterations to scale a size to 1x. The level change is not quite proportional to it."""


def unit(ref: Reference, table: Table, classes: dict[str, type[Effect]], ends: int) -> Unit:
    """Compute 1x of an effect in a world.

    Parameters
    ----------
    ref : Reference
    table : dict
        The effect with a first guess of its size.
    classes : dict
        Effects by name.
    ends : int
        Number of ends of its dates within the season.

    Raises
    ------
    RividError
        If the effect changes nothing at any size that the reach permits.
    """
    by, start = "", table
    for _ in range(TURNS):
        effect = classes[table["name"]].from_table(table)
        changes = changes_of((effect,), ref.season.world)
        z = ref.change(changes)
        if not np.isfinite(z).all():
            raise RividError(f"{table['name']}: the level is not finite")
        if np.abs(z).max() < 1e-9:
            table = resized(table, 4.0)
            continue
        events = len(effect.events(ref.season.world)) if hasattr(effect, "events") else 0
        events += np.size(table.get("start", ()))
        factor, by = factor_of(ref, z, noise=table["name"] in NOISES, price=DATE * ends + EVENT * events)
        table = resized(table, min(max(factor, 0.05), 20.0))
        if abs(np.log(factor)) < 0.1:
            return Unit(table, by)
    if not by or not 1e-3 < size_of(table) / size_of(start) < 1e3:
        raise RividError(f"{table['name']}: no size of it shows")
    return Unit(table, by)


def well_unit(ref: Reference, table: Table, shown: Callable[[Table], Floats]) -> Unit:
    """Compute 1x of an error of the gauge. `shown` returns it for a table [m], shape (days, n)."""
    by = ""
    N = len(ref.season.seconds)
    row = {date: i for i, date in enumerate(ref.season.dates)}
    first = [ref.season.world.first_day + dt.timedelta(days=int(k) // N - 1) for k in ref.at[:, 0]]
    rows = np.array([row[date] for date in first])
    for _ in range(TURNS):
        z = shown(table)
        both = np.concatenate([z[rows], z[rows + 1]], axis=1)
        factor, by = factor_of(ref, both, noise=False, price=DATE)
        table = resized(table, min(max(factor, 0.05), 20.0))
        if abs(np.log(factor)) < 0.1:
            break
    return Unit(table, by)
