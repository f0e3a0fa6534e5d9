"""A pool modelled by the Saint-Venant equations in a smooth channel with a few calibrated parameters."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.response.base import (
    FreeParameter,
    Response,
    cut,
    gauge_lag,
    gauge_of,
    lagged,
    slopes_by_differences,
    start_level,
    vector_of,
)
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.gauge import stilled
from rivid.reach.saint_venant import Channel, Flow, arrival_time, backwater_lift, fastest_wave, simulate
from rivid.types import Bools, Floats

Run = Callable[[Record, Changes], Floats]


def as_far_as_it_goes(run: Run, record: Record, changes: Changes) -> Floats:
    """Return all rows of a run (days, n), each NaN from where the channel cannot carry the logged flows.

    `run` maps record and changes to an output (days, n); it raises RividError if any row fails.
    """
    try:
        return run(record, changes)
    except RividError:
        pass
    shape = record.time.shape
    output = np.full(shape, np.nan)
    for row in range(record.days):
        done, failed = 0, shape[1] + 1
        end = failed - 1  # most rows run to their end
        while failed - done > 1:
            part = np.s_[row : row + 1, :end]
            few = replace(
                record, dates=record.dates[row : row + 1], time=record.time[part], inflow=record.inflow[part],
                outflow=record.outflow[part], output=record.output[part], used=record.used[part],
            )  # fmt: skip
            try:
                output[row, :end] = run(few, cut(changes, shape, part))[0]
                done = end
            except RividError:
                failed = end
            end = (done + failed) // 2
    return output


SHAPE = ("length", "width", "depth", "fall", "manning", "bank", "gate_time")
BANKS = 1.0, 1.0, 4.0
"""Horizontal run of the banks per metre up, its prior sd and its limit [-]: walls to meadows."""
CELLS, PER_SAMPLE = (48, 96), 12
"""Limits of the number of cells of a channel, and cells for each sample that a wave takes to cross it. Fronts
are wrong by about the time of a wave through a cell. With 64 cells instead of 32, 24 days with nothing hidden
of six pools (1.3, 2.8, 4.5, 6.6, 6.8 and 8.8 samples) were 147, -5, 510, 64, 1,294 and 1,716 nats likelier;
with 96, by another 50, 0, 26, 16, 521 and 615."""
ROUGH_CELLS = 24
"""Cells for differences between similar channels, in steps of a fit and for its columns. Fits of five pools
that took these from 24 or 32 cells ended within 25 nats of each other."""
FINER_CELLS = 34, 48
"""Cells where these do not change as the channel does: two and four times the work. Of nine pools one needed
the first, and two the second: on all of their 92 and 96 cells fits ended 200 and 360 nats higher, after 12
and 4 times the work."""
FALL = 0.15  # initial fall of the bed of a pool, in depths; its uncertainty is larger
HEADROOM = 1.15
"""Wave speed for which time steps are set, over that of the usual state: a depth 2 sd larger gives 1.3 times.
With the solver's own headroom waves up to 1.4 times as fast do not change the steps."""
NARROWEST = 0.1  # least width of the bed over that of the surface
MODES = 6
"""Modes of width and bed. With three, a channel with seven uneven places was 700 nats less likely with
nothing missing, its geometry was at the limits, and a leak compensated for this."""
GATE_LAGS = (1, 2, 3)
"""Lags of the outflow that may be corrected [samples]: response of the last cell and the gate to a step."""
ARRIVAL_LAGS = (-1, 0, 1, 2, 3)
"""Lags of the inflow that may be corrected, about the delay d [samples]: shape of the first front."""
CORRECTION_SD, CORRECTION_LIMIT = 0.75, 3.0
"""Prior sd and limit of a correction, in T_s / A [m per m3/s]. More would absorb an outflow lag."""
LAG_STEP = 0.5  # step of the gauge's lag for its derivative [s]: short compared with the shortest samples


def bed_width(width: float, bank: float, depth: float) -> float:
    """Return the bed width [m] of a channel with a mean surface width and a mean depth."""
    return max(width - 2.0 * bank * depth, NARROWEST * width)


@dataclass(frozen=True, eq=False)
class HydraulicResponse(Response):
    """A pool as equation (1) with Manning friction, short linear corrections, and a gauge with a lag.

    ``h(t) = level of the channel + sum_l a_l u_Qo[k - l] + sum_l b_l u_Qi[k - l]``

    The corrections are small by their prior: without them the difference of a smooth channel from a real one
    would appear as a lag of the gate.

    The parameters are the logarithms of length, width, mean depth at the usual level and n of Manning; the
    fall of the bed [m], linear since it may be 0; the run of the banks; the logarithm of the time of gates;
    modes of the width and of the bed; corrections; the lag of the gauge behind h.

    Source: equation (1); the nudge is a relaxation towards the observed level ("Newtonian nudging"),
    subtracted from the result. It raises the cells as the level at the dam does in a steady state: the water
    stays in balance, and a constant flow moves the baseline as it would move an open loop. With the same rise
    in all cells the water upstream flowed to the dam within hours, as if through a leak.
    """

    # usual level at the dam [m] and discharge [m3/s]: the nudge raises the cells as a higher level at the dam
    # does at the usual flow
    level: float
    flow: float
    cells: int = ROUGH_CELLS  # number of cells of the channel
    # wave speed over length [1/s] for which the time steps are set: that of the nominal channel, so that the
    # output is smooth in the parameters. 0: that of each day's start
    pace: float = 0.0
    coarse: int = ROUGH_CELLS  # number of cells of the cheaper response
    width_modes: int = 0  # numbers of modes
    bed_modes: int = 0
    outflow_lags: tuple[int, ...] = ()  # lags of the corrections [samples]
    inflow_lags: tuple[int, ...] = ()
    name: str = field(default="saint-venant", init=False)

    @classmethod
    def nominal(
        cls,
        length: float,  # L [m]
        width: float,  # mean width and mean depth at the usual level [m]
        depth: float,
        level: float,  # usual level at the dam [m]
        *,
        sample_time: float,  # T_s [s] and usual discharge [m3/s], for the size and lags of the corrections
        flow: float,
        slope: float | None = None,  # of the bed [-]; default: a fall of :data:`FALL` depths over the reach
        manning: float = 0.03,  # Manning's n [s/m^(1/3)]
        width_modes: int = MODES,  # modes ``cos(j pi x / L)`` of the logarithm of the width and of the bed
        bed_modes: int = MODES,
        corrections: bool = True,  # of first lags of the outflow, and of those about the inflow's arrival
        cells: int | None = None,  # default: by :data:`PER_SAMPLE`
    ) -> "HydraulicResponse":
        """Return a response from the configured geometry."""
        if slope is not None and not 0.0 <= slope * length <= 2.0 * depth:
            raise RividError(
                f"slope = {slope:g}: expected 0 to {2.0 * depth / length:.2g}, a fall of two depths over the "
                "reach; a steeper reach is no pool"
            )
        fall = FALL * depth if slope is None else slope * length
        shape = [
            FreeParameter.positive("length", "m", length, 0.03),
            FreeParameter.positive("width", "m", width, 0.05),
            FreeParameter.positive("depth", "m", depth, 0.15),
            FreeParameter("fall", "m", fall, fall, 0.2 * depth, 0.0, 2.0 * depth),
            FreeParameter.positive("manning", "s/m^(1/3)", manning, 0.25),
            FreeParameter("bank", "-", BANKS[0], *BANKS[:2], 0.0, BANKS[2]),
            FreeParameter.positive("gate_time", "s", 30.0, 0.7, reach=3.0),
        ]
        for j in range(1, width_modes + 1):
            shape.append(FreeParameter(f"width_mode_{j}", "-", 0.0, 0.0, 0.15, -0.5, 0.5))
        for j in range(2, bed_modes + 1):  # the first resembles the fall
            name = f"bed_mode_{j}"
            shape.append(FreeParameter(name, "m", 0.0, 0.0, 0.08 * depth, -0.25 * depth, 0.25 * depth))
        made = cls(
            (*shape, gauge_lag()), level, flow, width_modes=width_modes, bed_modes=bed_modes
        )  # fmt: skip
        samples = float(arrival_time(made.channel, [flow], [level])[0]) / sample_time
        made = replace(
            made, pace=HEADROOM * fastest_wave(made.channel, flow, level) / length,
            cells=cells or min(max(math.ceil(PER_SAMPLE * samples), CELLS[0]), CELLS[1]),
        )  # fmt: skip
        if not corrections:
            return made
        delay = math.ceil(samples) - 1
        lags = tuple(delay + lag for lag in ARRIVAL_LAGS if delay + lag >= 1)
        scale = sample_time / made.channel.surface_area(level)
        sd, limit = CORRECTION_SD * scale, CORRECTION_LIMIT * scale
        names = [f"outflow_lag_{lag}" for lag in GATE_LAGS] + [f"inflow_lag_{lag}" for lag in lags]
        added = (FreeParameter(name, "m per m3/s", 0.0, 0.0, sd, -limit, limit) for name in names)
        parameters = (*made.parameters[:-1], *added, made.parameters[-1])
        return replace(made, parameters=parameters, outflow_lags=GATE_LAGS, inflow_lags=lags)

    @property
    def rough(self) -> "HydraulicResponse":
        """See the base class."""
        return self if self.cells <= self.coarse else replace(self, cells=self.coarse)

    @property
    def finer(self) -> "HydraulicResponse":
        """See the base class."""
        more = (cells for cells in FINER_CELLS if self.coarse < min(cells, self.cells))
        return next((replace(self, coarse=cells) for cells in more), self)

    @property
    def surface_area(self) -> float:
        """Volume per metre of the usual level [m2]: less than the water surface of a sloping reach."""
        return self._lift[1]

    @property
    def longest_wave(self) -> float:
        """See the base class."""
        return HEADROOM / self.pace

    @cached_property
    def _lift(self) -> tuple[Floats, float]:
        return backwater_lift(self.channel, self.flow, self.level)

    @cached_property
    def channel(self) -> Channel:
        """The channel of the parameters."""
        length, width, depth, fall, manning, bank, _ = (p.natural for p in self.parameters[: len(SHAPE)])
        modes = [p.natural for p in self.parameters[len(SHAPE) : self._shape_count]]
        return Channel.smooth(
            length, bed_width(width, bank, depth), fall / length, manning, self.cells, side_slope=bank,
            end_bed=self.level - depth - 0.5 * fall,
            width_modes=modes[: self.width_modes], bed_modes=[0.0, *modes[self.width_modes :]],
        )  # fmt: skip

    def carried(self, record: Record) -> Bools:
        """Return days with flows that the channel carries, even 1 sd steeper and shallower; shape (days,)."""
        steep = vector_of(self)
        for name, way in (("depth", -1.0), ("fall", 1.0)):
            i = SHAPE.index(name)
            steep[i] += way * self.parameters[i].sd
        able = np.ones(record.days, bool)
        for reach in (self, self.with_parameters(steep)):
            able &= np.isfinite(as_far_as_it_goes(reach.baseline, record, NO_CHANGES)[:, -1])
        return able

    def baseline(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Return the level [m], linearised about the observed level, shape (days, n)."""
        return self._read(record, changes, nudged=True)

    def simulate(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Return the level [m] of rows that run free from their first readings, shape (days, n).

        NaN from where a row cannot carry the logged flows: without the missing water it can run dry.
        """
        return as_far_as_it_goes(partial(self._read, nudged=False), record, changes)

    def _read(self, record: Record, changes: Changes, nudged: bool) -> Floats:
        gauge = gauge_of(record, changes)
        flow = self._run(record, changes, gauge, nudged)
        return stilled(record.time, self._level(record, changes, flow), self._lag + changes.well) + gauge

    def slopes(self, record: Record, base: Floats, changes: Changes = NO_CHANGES) -> Floats:
        """Return the derivatives of the baseline (p, days, n), by one run for each channel parameter."""
        shape = self._shape_count
        columns = np.empty((len(self.parameters), *base.shape))
        columns[:shape] = slopes_by_differences(self, record, base, changes, range(shape))
        flow = self._run(record, changes, gauge_of(record, changes), nudged=True)
        if len(self.parameters) > shape + 1:
            corrections = self._columns(record, changes, flow.released)
            columns[shape:-1] = stilled(record.time, corrections, self._lag + changes.well)
        level, lag = self._level(record, changes, flow), self._lag + changes.well
        columns[-1] = stilled(record.time, level, lag + LAG_STEP) - stilled(record.time, level, lag)
        columns[-1] /= LAG_STEP
        return columns

    @property
    def gate_time(self) -> float:
        """Time that a dam takes from one command to the next [s]."""
        return self.parameters[SHAPE.index("gate_time")].natural

    @property
    def _lag(self) -> float:
        return self.parameters[-1].natural

    @property
    def _shape_count(self) -> int:
        return len(SHAPE) + self.width_modes + max(self.bed_modes - 1, 0)

    def _run(self, record: Record, changes: Changes, gauge: Floats, nudged: bool) -> Flow:
        water = record.output - gauge
        channel = self.channel.with_area_slope(changes.area_slope, changes.area_reference)
        return simulate(
            channel, record.time, record.inflow, record.outflow, start_level(water, self.level),
            changes=changes, gate_time=self.gate_time, observed=water if nudged else None,
            lift=self._lift[0] if nudged else 1.0, speed=self.pace * self.channel.length,
        )  # fmt: skip

    def _level(self, record: Record, changes: Changes, flow: Flow) -> Floats:
        """Return the water level of a run with the corrections, its nudge subtracted [m]."""
        level = flow.level.copy()
        level[:, 1:] -= np.cumsum(flow.nudge[:, :-1] * np.diff(record.time, axis=1), axis=1)
        values = [p.value for p in self.parameters[self._shape_count : -1]]
        if any(values):
            level += np.tensordot(values, self._columns(record, changes, flow.released), 1)
        return level

    def _columns(self, record: Record, changes: Changes, outflow: Floats) -> Floats:
        """Return lagged flows minus their first values, shape (corrections, days, n) [m3/s]."""
        inflow = record.inflow if changes.inflow is None else changes.inflow
        return np.stack(
            [lagged(outflow, lag) - outflow[:, :1] for lag in self.outflow_lags]
            + [lagged(inflow, lag) - inflow[:, :1] for lag in self.inflow_lags]
        )
