"""A free river: a wave with diffusion and a delay that decreases with the flow."""

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from rivid.diagnosis.data import Record
from rivid.diagnosis.response.base import FreeParameter, Response, real_flows
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.gauge import stilled
from rivid.types import Floats

CELLS = 24  # cells of the reach: the fluxes of this number represent a spread of a tenth of the delay or more
NARROWEST = 0.1  # smallest ratio of the spread to the delay [-]
GAIN_SD = 0.03  # prior standard deviation of the gain of two gauges, as a share
COURANT = 0.7
"""Courant number of Heun's method: stable up to 1 with upstream fluxes; central ones slowly diverge."""
TABLE, BEYOND = 4096, 2.0
"""Entries of the table of flows by volume, interpolated linearly, and its end over the largest volume."""


@dataclass(frozen=True, eq=False)
class RiverResponse(Response):
    """A diffusive wave with a speed that depends on its own flow; water is conserved.

    The reach is a row of N cells with volumes V_j and the flows of a kinematic wave,

        dV_j/dt = F_{j-1} - F_j,   Q_j = flow (V_j / V_0)^{1 / (1 - exponent)},
        F_j = Q_j + kappa (Q_j - Q_{j+1}),   kappa = (N spread^2 / delay^2 - 1) / 2,

    V_0 = delay flow / (N (1 - exponent)). A small wave on the flow Q takes delay (Q / flow)^-exponent, and
    diffusion spreads it in the ratio `spread` to `delay`. A share of the arriving water is held in banks and
    pools for some time. The ratings of two gauges differ by a gain near 1 and by a constant share of the
    usual flow, which includes a constant lateral inflow.

    The parameters are the logarithms of delay and spread of the wave's arrivals [s] at the usual flow, of the
    mean holding time [s], and of the gain; the exponent, the held share and the constant on a linear scale.

    The exponent of a wide channel with Manning friction is 0.4. Source: Cunge (1969, Journal of Hydraulic
    Research 7, 205-230) for the diffusion of such cells.
    """

    flow: float  # usual flow [m3/s], at which the delay is `delay`
    name: str = field(default="diffusive-wave", init=False)
    surface_area: None = field(default=None, init=False)

    @classmethod
    def nominal(cls, delay: float, spread: float, flow: float, exponent: float = 0.4) -> "RiverResponse":
        """Return a response from rough mean and sd of the arrival times [s] at the usual flow [m3/s]."""
        # The delay decreases with the flow by `exponent` [-]. The prior sd of the constant is that of the
        # gain.
        if not flow > 0.0:
            raise RividError(f"flow = {flow} m3/s: expected a positive usual flow")
        return cls(
            (
                FreeParameter.positive("delay", "s", delay, 0.3),
                FreeParameter("exponent", "-", exponent, exponent, 0.2, -0.2, 0.8),
                FreeParameter.positive("spread", "s", spread, 0.7, reach=1.0),
                FreeParameter("held_share", "-", 0.15, 0.15, 0.15, 0.0, 0.6),
                FreeParameter.positive("held_time", "s", delay, 0.5, reach=2.0),
                FreeParameter.positive("inflow_gain", "-", 1.0, GAIN_SD, reach=3.0),
                FreeParameter("rating_offset", "-", 0.0, 0.0, GAIN_SD, -3.0 * GAIN_SD, 3.0 * GAIN_SD),
            ),
            flow,
        )

    @property
    def longest_wave(self) -> float:
        """Spread of the arrival times along the whole reach [s]."""
        return next(p.natural for p in self.parameters if p.name == "spread")

    def baseline(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Return the discharge at the lower end [m3/s], shape (days, n)."""
        flows = real_flows(record, changes)
        delay, exponent, spread, held, hold, gain, offset = (p.natural for p in self.parameters)
        kappa = 0.5 * (CELLS * max(spread / delay, NARROWEST) ** 2 - 1.0)
        inflow = np.ascontiguousarray(gain * flows.inflow)
        sides = np.zeros((CELLS + 1, *inflow.shape)) if flows.added else np.zeros((0, *inflow.shape))
        for part in flows.added:  # split between two faces; the last one is the lower end
            at = min(int(part.place * CELLS), CELLS - 1)
            sides[at] += (at + 1 - part.place * CELLS) * part.flow
            sides[at + 1] += (part.place * CELLS - at) * part.flow
        most = float((inflow + sides.clip(0.0).sum(axis=0)).max())
        fastest = CELLS / delay * (max(most, self.flow) / self.flow) ** max(exponent, 0.0)
        T = record.sample_time
        steps = max(math.ceil(T * fastest * (1.0 + 2.0 * max(kappa, 0.0)) / COURANT), 1)
        came = np.empty_like(inflow)
        full = delay * self.flow / (CELLS * (1.0 - exponent))
        top = BEYOND * full * (max(most, self.flow) / self.flow) ** (1.0 - exponent)
        flow_of = self.flow * (np.linspace(0.0, top, TABLE) / full) ** (1.0 / (1.0 - exponent))
        if not route(inflow, sides, record.time, steps, flow_of, top, kappa, came):
            raise RividError("the river runs dry: expected losses smaller than its flow")
        behind = stilled(record.time, came, hold)
        passed = (1.0 - held) * came + held * behind + offset * self.flow
        return np.asarray((1.0 + changes.rating) * passed + flows.gauge)


@njit(cache=True, error_model="numpy")
def route(
    inflow: Floats, sides: Floats, time: Floats, steps: int, flow_of: Floats, top: float, kappa: float,
    out: Floats,
) -> bool:  # fmt: skip
    """Write the discharge at the lower end (days, n) at each sample's start; return False if it runs dry.

    `inflow` (days, n) and `sides` (N + 1, days, n), or (0, days, n), which enter at the cells' upper faces
    and at the lower end, are constant over each sample, which is divided into `steps`. A row starts in the
    steady state of its first flows. `flow_of` is the flow out of a cell by its volume, up to `top`.
    """
    days, n = inflow.shape
    unit = top / (len(flow_of) - 1)
    flows, first, second = np.empty(CELLS + 1), np.empty(CELLS), np.empty(CELLS)
    volume, trial, added = np.empty(CELLS), np.empty(CELLS), np.zeros(CELLS)
    for d in range(days):
        through = inflow[d, 0]
        for j in range(CELLS):
            if len(sides) > 0:
                through += sides[j, d, 0]
            if not through > flow_of[1]:
                return False
            i = np.searchsorted(flow_of, through)
            if i >= len(flow_of):
                return False
            volume[j] = i - (flow_of[i] - through) / (flow_of[i] - flow_of[i - 1])
        for k in range(n):
            if len(sides) > 0:
                added[:] = sides[:-1, d, k]
            out[d, k] = at(flow_of, volume[CELLS - 1])
            if len(sides) > 0:
                out[d, k] += 0.5 * (sides[-1, d, k] + sides[-1, d, max(k - 1, 0)])
            dt = (time[d, min(k + 1, n - 1)] - time[d, min(k, n - 2)]) / (steps * unit)
            for _ in range(steps):
                if not rates(volume, inflow[d, k], added, flow_of, kappa, flows, first):
                    return False
                for j in range(CELLS):
                    trial[j] = volume[j] + dt * first[j]
                if not rates(trial, inflow[d, k], added, flow_of, kappa, flows, second):
                    return False
                for j in range(CELLS):
                    volume[j] += 0.5 * dt * (first[j] + second[j])
    return True


@njit(cache=True, error_model="numpy", inline="always")
def at(table: Floats, place: float) -> float:
    """Interpolate a table linearly, with extrapolation beyond its end."""
    i = min(int(place), len(table) - 2)
    return float(table[i] + (place - i) * (table[i + 1] - table[i]))


@njit(cache=True, error_model="numpy")
def rates(
    volume: Floats, inflow: float, added: Floats, flow_of: Floats, kappa: float, flows: Floats, out: Floats
) -> bool:
    """Write the rates (N,) [m3/s] of the volumes, in table entries; return False if a cell is empty."""
    last, least = len(flow_of) - 2, volume[0]
    for j in range(CELLS):  # without branches: these loops compile to vector instructions
        i = min(max(int(volume[j]), 0), last)
        flows[j] = flow_of[i] + (volume[j] - i) * (flow_of[i + 1] - flow_of[i])
        least = min(least, volume[j])
    flows[CELLS] = flows[CELLS - 1]  # no gradient at the lower end
    for j in range(1, CELLS):
        out[j] = added[j] + (1.0 + kappa) * (flows[j - 1] - flows[j]) - kappa * (flows[j] - flows[j + 1])
    out[0] = added[0] + inflow - flows[0] - kappa * (flows[0] - flows[1])
    return bool(least > 0.0)
