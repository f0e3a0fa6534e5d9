"""Pools without a usable geometry: integrator with delay, alone or with FIR filters on both flows.

The output is a linear sum of volumes and of lagged flows, so its linearisation about the observed output is
exact. Its volume errors grow without limit; the noise, with its unknown inflow and its random walk, absorbs
them.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.signal import lfilter

from rivid.diagnosis.data import START_UP, Record
from rivid.diagnosis.response.base import (
    FreeParameter,
    RealFlows,
    Response,
    gauge_lag,
    lagged,
    real_flows,
    slopes_by_differences,
    start_level,
)
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.gauge import stilled
from rivid.reach.transport import delayed_volume, held_volume
from rivid.types import Floats

Fronts = Literal["none", "fir"]
NAMES: dict[str, str] = {"none": "integrator-delay", "fir": "fir"}
SLOW = 3600.0  # memory of the slow flow on which the coefficients depend [s]
COEFFICIENT_SD, COEFFICIENT_LIMIT = 5.0, 50.0
"""Prior sd and limit of FIR coefficients, in T_s / A; fronts in a pool of Table I have 5 to 10."""
SHARE_SD = 0.3  # relative prior sd of the share of the water's speed: the depth is known to some 15 percent
DENSE = 6
"""Samples beyond the delay up to which an FIR filter has every lag; then each lag is a seventh longer."""


@dataclass(frozen=True, eq=False)
class LinearPool(Response):
    """A pool with a level of volume over area, and FIR filters on both flows for its fronts.

    ``h = (V_i(t - tau) G - V_o(t)) / A + sum_l a_l Qi[k - l] + sum_l b_l Qo[k - l]``

    with V the volumes that have passed the dams. A wave on the day's mean flow Q has the delay tau, ``tau =
    delay / (1 + s (Q / flow - 1))``, s the share of the water's speed in the wave's. The coefficients depend
    linearly on the slow flow.

    The parameters are the logarithms of the area A, of the delay at the usual flow and of the gain G of the
    inflow over the outflow; s; the coefficients; the lag of the gauge behind h.

    Source: equations (5) and (7); (16) for the FIR filters, here on both flows.
    """

    fronts: Fronts = "none"
    lags: tuple[int, ...] = ()  # lags of the FIR filters [samples]
    flow: float = 0.0  # usual flow and half its usual range [m3/s], used to normalise the slow flow
    flow_range: float = 1.0

    @classmethod
    def nominal(
        cls,
        record: Record,  # for T_s, the usual flows and the lead time, which no lag exceeds
        fronts: Fronts,
        *,
        surface_area: float,  # A [m2]
        delay: float,  # tau at the usual flow [s]
        speed_share: float = 0.0,  # s [-], from 0 to 1
    ) -> "LinearPool":
        """Return a response from the configured geometry."""
        parameters = [
            FreeParameter.positive("surface_area", "m2", surface_area, 0.2),
            FreeParameter.positive("delay", "s", delay, 0.2),
            FreeParameter.positive("inflow_gain", "-", 1.0, 1e-4),  # more is an effect: a meter error
            FreeParameter(
                "speed_share", "-", speed_share, speed_share, SHARE_SD * max(speed_share, 0.1), 0.0, 1.0
            ),
        ]
        alpha = record.sample_time / surface_area
        lags: tuple[int, ...] = ()
        if fronts == "fir":
            first = math.ceil(delay / record.sample_time)
            lags = _lags(first, min(first + START_UP, record.lead))
            sd, limit = COEFFICIENT_SD * alpha, COEFFICIENT_LIMIT * alpha
            for what, share in (("", 1.0), ("_by_flow", 0.5)):
                for side in ("inflow", "outflow"):
                    parameters += [
                        FreeParameter(
                            f"{side}_lag_{lag}{what}", "m per m3/s", 0.0, 0.0, share * sd, -limit, limit
                        )
                        for lag in lags
                    ]
        parameters.append(gauge_lag())
        low, high = np.percentile(record.inflow[record.used], [5.0, 95.0])
        return cls(tuple(parameters), fronts, lags, record.usual_flow, max(0.5 * float(high - low), 1e-9))

    @property
    def name(self) -> str:
        """Canonical name."""
        return NAMES[self.fronts]

    @property
    def surface_area(self) -> float:
        """A [m2]."""
        return self.parameters[0].natural

    def baseline(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Return the level [m] from each row's first readings on, shape (days, n)."""
        flows = real_flows(record, changes)
        area, _, gain = (p.natural for p in self.parameters[:3])
        time, delay = record.time, self.delay(record)
        came = gain * delayed_volume(time, flows.inflow, delay)
        came -= came[:, :1]
        for part in flows.added:
            further = delayed_volume(time, part.flow, (1.0 - part.place) * delay)
            came += further - further[:, :1]
        stored = came - held_volume(time, flows.outflow)
        before = np.concatenate([flows.storage[:, :1], flows.storage[:, :-1]], axis=1)
        level = np.cumsum(np.diff(stored, axis=1, prepend=0.0) / before, axis=1) / area
        values = [p.value for p in self.parameters[4:-1]]
        if any(values):
            for value, flow in zip(values, self._columns(record, flows), strict=True):
                level += value * flow
        level = stilled(time, level - level[:, :1], self.parameters[-1].natural + changes.well)
        return level + start_level(record.output - flows.gauge, 0.0)[:, None] + flows.gauge

    def slopes(self, record: Record, base: Floats, changes: Changes = NO_CHANGES) -> Floats:
        """Return the derivatives of the baseline, shape (p, days, n); exact for the coefficients."""
        last = len(self.parameters) - 1
        first = last - 2 * len(self.lags) * 2
        columns = np.empty((last + 1, *base.shape))
        columns[:first] = slopes_by_differences(self, record, base, changes, range(first))
        if first < last:
            flows, lag = self._columns(record, real_flows(record, changes)), self.parameters[-1].natural
            for column, flow in zip(columns[first:last], flows, strict=True):
                column[:] = stilled(record.time, flow - flow[:, :1], lag + changes.well)  # rows begin at 0
        columns[last:] = slopes_by_differences(self, record, base, changes, range(last, last + 1))
        return columns

    def delay(self, record: Record) -> Floats:
        """Return the delay of each row [s], shape (days, 1)."""
        relative = record.inflow.mean(axis=1, keepdims=True) / self.flow - 1.0
        return np.asarray(
            self.parameters[1].natural / np.maximum(1.0 + self.parameters[3].value * relative, 0.1)
        )

    def _columns(self, record: Record, flows: RealFlows) -> Iterator[Floats]:
        """Yield lagged flows (days, n), plain and times the slow flow, one by one to save memory."""
        # A flow that enters on the way acts as part of the inflow and, with opposite sign, of the outflow.
        inflow, outflow = flows.inflow, flows.outflow
        for part in flows.added:
            inflow = inflow + (1.0 - part.place) * part.flow
            outflow = outflow - part.place * part.flow
        passed = delayed_volume(record.time, inflow, self.delay(record))
        late = np.diff(passed, axis=1) / np.diff(record.time, axis=1)
        mean = 0.5 * (np.concatenate([late[:, :1], late], axis=1) + outflow)
        keep = math.exp(-record.sample_time / SLOW)
        leaky = lfilter([1.0 - keep], [1.0, -keep], mean, axis=1, zi=keep * mean[:, :1])[0]
        slow = (np.asarray(leaky) - self.flow) / self.flow_range
        for factor in (np.ones(1), slow):
            for flow in (inflow - self.flow, outflow - self.flow):
                for lag in self.lags:
                    yield factor * lagged(flow, lag)


def _lags(delay: int, last: int) -> tuple[int, ...]:
    """Return every lag to a little beyond the delay, then increasingly sparse lags up to the last one."""
    lags = list(range(1, min(delay + DENSE, last) + 1))
    while lags[-1] < last:
        lags.append(min(max(lags[-1] + 2, round(lags[-1] * 8 / 7)), last))
    return tuple(lags)
