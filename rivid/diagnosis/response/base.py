"""Reach response to be calibrated: its free parameters, its output for the logs, and the real flows.

Effects are sought in the difference of two outputs, so an output must not drift away from the measurement: a
volume error of one hour would persist. :meth:`Response.baseline` is therefore linearised about the observed
output, while :meth:`Response.simulate` runs free.
"""

import datetime as dt
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Self, cast

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from rivid.diagnosis.data import Kind, Record
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, AddedFlow, Changes
from rivid.reach.gate import (
    GATE,
    GateArrays,
    exchange_arrays,
    gate_arrays,
    gate_flow,
    gate_start,
    on_grid,
    pond_flow,
)
from rivid.types import Floats

STEP = 0.03
"""Steps of finite differences, in prior standard deviations: in one season 0.1 changed single columns by up
to 3 %, 0.03 by less than 1 %. The number of time steps must not change with a step."""
START_SAMPLES = 5  # number of readings averaged for the initial level of a row


@dataclass(frozen=True)
class FreeParameter:
    """A parameter to be calibrated; all numbers are on its (linear or logarithmic) scale."""

    name: str
    unit: str  # of :attr:`natural`
    value: float  # its logarithm where `log`, else itself
    mean: float  # gaussian prior
    sd: float
    low: float  # limits, both allowed
    high: float
    log: bool = False  # whether the scale is logarithmic

    @classmethod
    def positive(cls, name: str, unit: str, nominal: float, sd: float, reach: float = 4.0) -> "FreeParameter":
        """Return a positive parameter, known to a share of `sd`, with limits `reach` times `sd` away."""
        if not nominal > 0.0 or not math.isfinite(nominal):
            raise RividError(f"{name} = {nominal} {unit}: expected a positive number")
        at = math.log(nominal)
        return cls(name, unit, at, at, sd, at - reach * sd, at + reach * sd, log=True)

    @property
    def natural(self) -> float:
        """The value in the parameter's unit."""
        return self.to_natural(self.value)

    def to_natural(self, value: float) -> float:
        """Convert a number on this scale to the parameter's unit."""
        return math.exp(value) if self.log else value

    def at(self, value: float) -> "FreeParameter":
        """Return the parameter at another value, clipped to its limits."""
        return replace(self, value=min(max(float(value), self.low), self.high))


def gauge_lag() -> FreeParameter:
    """Return the time constant of the gauge's stilling well: 0 for most, up to two minutes against waves."""
    return FreeParameter("gauge_lag", "s", 0.0, 0.0, 60.0, 0.0, 300.0)


@dataclass(frozen=True, eq=False)
class Response(ABC):
    """A reach model that can be calibrated, with p free parameters."""

    parameters: tuple[FreeParameter, ...]

    @property
    @abstractmethod
    def name(self) -> str:
        """Canonical name."""

    @property
    @abstractmethod
    def surface_area(self) -> float | None:
        """A [m2], by which an unknown inflow becomes a rise of the level; None for a river reach."""

    @property
    def longest_wave(self) -> float:
        """Longest wave of the weather [s]: the time in which one on the usual flow crosses the pool."""
        return next(p.natural for p in self.parameters if p.name == "delay")

    @abstractmethod
    def baseline(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Return the output, linearised about the observed output, shape (days, n) [m or m3/s]."""

    @property
    def rough(self) -> "Response":
        """A cheaper response with the same parameters, for differences: on fewer cells, if it has any."""
        return self

    @property
    def finer(self) -> "Response":
        """The same response with a finer :attr:`rough`, or itself if there is none."""
        return self

    def simulate(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Return the output, running free from each row's start: that of a linear model is its baseline."""
        return self.baseline(record, changes)

    def slopes(self, record: Record, base: Floats, changes: Changes = NO_CHANGES) -> Floats:
        """Return the derivatives of :meth:`baseline`, of which `base` is the value, shape (p, days, n)."""
        return slopes_by_differences(self, record, base, changes, range(len(self.parameters)))

    def with_parameters(self, vector: ArrayLike) -> Self:
        """Return the model at other values (p,) on the parameters' scale, clipped to the limits."""
        values = np.asarray(vector, float)
        if values.shape != (len(self.parameters),) or not np.isfinite(values).all():
            raise RividError(
                f"parameters {values.tolist()}: expected {len(self.parameters)} finite numbers, "
                f"for {', '.join(p.name for p in self.parameters)}"
            )
        moved = tuple(p.at(v) for p, v in zip(self.parameters, values, strict=True))
        return replace(self, parameters=moved)


def vector_of(response: Response) -> Floats:
    """Return the values of the free parameters on their scale, shape (p,)."""
    return np.array([parameter.value for parameter in response.parameters])


def slopes_by_differences(
    response: Response, record: Record, base: Floats, changes: Changes, which: range
) -> Floats:
    """Compute derivatives of the baseline by one run each, within the limits; shape (len(which), days, n)."""
    # If the reach cannot carry the flows after a step, the step is taken in the other direction.
    columns = np.empty((len(which), *base.shape))
    start = vector_of(response)
    for row, i in enumerate(which):
        p = response.parameters[i]
        h = STEP * p.sd if p.value + STEP * p.sd <= p.high else -STEP * p.sd
        unit = np.arange(len(start)) == i
        try:
            moved = response.with_parameters(start + h * unit).baseline(record, changes)
        except RividError:
            h = -h
            moved = response.with_parameters(start + h * unit).baseline(record, changes)
        columns[row] = (moved - base) / h
    return columns


def start_level(output: Floats, otherwise: float) -> Floats:
    """Return the mean of each row's first readings (days,), or `otherwise` if a row has none."""
    levels = np.full(len(output), otherwise)
    for day, row in enumerate(output):
        finite = row[np.isfinite(row)]
        if len(finite):
            levels[day] = finite[:START_SAMPLES].mean()
    return levels


def gauge_of(record: Record, changes: Changes) -> Floats:
    """Return the reading of the gauge minus the water level, shape (days, n)."""
    return on_grid("a gauge offset", changes.gauge, record.time.shape)


@dataclass(frozen=True, eq=False)
class RealFlows:
    """The real flows, after all changes to the logged ones."""

    inflow: Floats  # (days, n): through the dams, mean of each sample [m3/s]
    outflow: Floats
    added: tuple[AddedFlow, ...]  # further flows; losses to leaks and ponds are negative
    storage: Floats  # (days, n): water surface over the usual one [-]
    gauge: Floats  # (days, n): reading of the gauge minus the water level


def real_flows(record: Record, changes: Changes) -> RealFlows:
    """Return the real flows; raise RividError for changes of level, outflow or volume in a river reach."""
    shape = record.time.shape
    inflow = record.inflow if changes.inflow is None else on_grid("the real inflow", changes.inflow, shape)
    added = tuple(AddedFlow(part.place, on_grid("an added flow", part.flow, shape)) for part in changes.added)
    gauge = gauge_of(record, changes)
    if record.kind == "river":
        named = (
            ("a gate", not changes.gate_is_plain), ("a leak", bool(changes.leaks)),
            ("a pond", bool(changes.ponds)), ("an area slope", changes.area_slope != 0.0),
            ("a stilling well", bool((changes.well != 0.0).any())),
        )  # fmt: skip
        for what, given in named:
            if given:
                raise RividError(
                    f"{what} in a river reach, which has no level: expected effects on its inflow, added "
                    "flows, or its gauge"
                )
        return RealFlows(inflow, record.outflow, added, np.ones(shape), gauge)
    if (changes.rating != 0.0).any():
        raise RividError(
            "a rating in a pool, where the gauge reads a level: expected effects on its level or flows"
        )
    level = filled(record.time, record.output - gauge, changes.area_reference)
    storage = 1.0 + changes.area_slope * (level - changes.area_reference)
    if not (storage > 0.0).all():
        raise RividError(
            f"area_slope = {changes.area_slope:g} per m leaves no water surface at the observed levels: "
            "expected a smaller one"
        )
    outflow, ponds = record.outflow, np.empty((len(changes.ponds), *shape))
    if changes.ponds or not changes.gate_is_plain:
        outflow, exchange = np.empty(shape), exchange_arrays(changes, shape)
        follow(
            np.diff(record.time, axis=1, append=record.time[:, -1:] + record.sample_time), record.outflow,
            level, gate_arrays(changes, shape), exchange.exchange, exchange.area, outflow, ponds,
        )  # fmt: skip
    taken = [AddedFlow(leak.place, leak.loss * (leak.reference - level)) for leak in changes.leaks]
    taken += [AddedFlow(pond.place, -into) for pond, into in zip(changes.ponds, ponds, strict=True)]
    return RealFlows(inflow, outflow, (*added, *taken), storage, gauge)


def lagged(values: NDArray[Any], lag: int) -> NDArray[Any]:
    """Return the values `lag` samples earlier; the first value of a row is repeated at its start."""
    if lag == 0:
        return values
    return np.concatenate([np.repeat(values[:, :1], lag, axis=1), values[:, :-lag]], axis=1)


def cut(changes: Changes, shape: tuple[int, int], part: Any) -> Changes:
    """Return changes on a part of the grid: `part` is an index that keeps whole rows or samples."""

    def of(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value if value.size == 1 else np.broadcast_to(value, shape)[part]
        if isinstance(value, tuple):
            return tuple(of(each) for each in value)
        if is_dataclass(value) and not isinstance(value, type):
            return replace(value, **{f.name: of(getattr(value, f.name)) for f in fields(value)})
        return value

    return cast(Changes, of(changes))


def filled(time: Floats, output: Floats, otherwise: float) -> Floats:
    """Interpolate gaps of an output linearly, shape (days, n); an empty row is filled with `otherwise`."""
    whole = output.copy()
    for row, at in zip(whole, time, strict=True):
        there = np.isfinite(row)
        row[~there] = np.interp(at[~there], at[there], row[there]) if there.any() else otherwise
    return whole


def kernels_of(response: Response, record: Record) -> dict[str, Floats]:
    """Return the step responses of a reach at the usual state of a record, over the samples of its rows."""
    n = record.time.shape[1]
    return step_responses(response, n, record.sample_time, record.usual_output, record.usual_flow)


def step_responses(
    response: Response, n: int, sample_time: float, level: float, flow: float
) -> dict[str, Floats]:
    """Return changes of the output (n,) after 1 m3/s more of flow [m per m3/s, or -]."""
    # The flow enters at the upper dam or in the middle, or leaves at the lower dam.
    kind: Kind = "river" if response.surface_area is None else "pool"
    steady, shape = np.full((1, n + 1), flow), (1, n + 1)
    still = Record(
        dates=(dt.date(2000, 1, 1),), time=sample_time * np.arange(n + 1.0)[None], inflow=steady,
        outflow=steady if kind == "pool" else np.zeros(shape), output=np.full(shape, level),
        used=np.ones(shape, bool), lead=0, sample_time=sample_time, kind=kind,
    )  # fmt: skip
    before = response.simulate(still)
    more = np.concatenate([[0.0], np.ones(n)])[None]  # the initial state is steady without it

    def after(place: float) -> Floats:
        added = Changes(added=(AddedFlow(place, more),))
        return np.asarray(response.simulate(still, added) - before)[0, 1:]

    return {"up": after(0.0), "middle": after(0.5), "down": -after(1.0)}


# Compiled: the gate's position depends on the previous sample.
@njit(cache=True, error_model="numpy")
def follow(
    steps: Floats, command: Floats, level: Floats, gate: GateArrays, exchange: Floats, area: Floats,
    outflow: Floats, into: Floats,
) -> None:  # fmt: skip
    """Write the gate's real flow (days, n) and the flow into each pond (ponds, days, n) [m3/s]."""
    days, n = command.shape
    ponds = len(area)
    state, height = np.empty(GATE), np.empty(ponds)
    for day in range(days):
        state[:] = gate_start(gate, day, command[day, 0])
        height[:] = level[day, 0]
        for k in range(n):
            dt = steps[day, k]
            outflow[day, k] = gate_flow(gate, day, k, command[day, k], level[day, k], dt, state)
            for j in range(ponds):
                flow = pond_flow(level[day, k], height[j], exchange[j, day, k], area[j], dt)
                height[j] += flow * dt / area[j]
                into[j, day, k] = flow
