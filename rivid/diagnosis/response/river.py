"""A free river: its inflow comes later and spread out, the sooner the more it is."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from rivid.core.posterior.response import hayami
from rivid.diagnosis.data import Record
from rivid.diagnosis.response.base import FreeParameter, placed, real_flows, slopes_by_differences
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.transport import arrived_volume, held_volume
from rivid.types import Floats

SHORTEST = 30.0
"""A shorter mean delay is none [s]."""
FINE = 4
"""Cells in a sample, and points in a cell: the kernel is smooth in its parameters whatever their size."""
SLOW = 0.5
"""Memory of the flow that sets the delay, in delays: the flow that a wave meets on its way."""


@dataclass(frozen=True, eq=False)
class RiverResponse:
    """A diffusive wave with a delay that follows the flow; it keeps its water.

    What departs at t arrives at ``t + tau(Q) x``, ``tau(Q) = delay (Q / flow)^(-exponent)``, with Q the slow
    flow and x spread about 1 as the arrivals of a diffusive wave are; times a gain near 1.

    Attributes
    ----------
    parameters : tuple of FreeParameter
        Logarithms of delay and spread of the wave's arrivals [s] at the usual flow, of the mean time [s] for
        which water is held, and of the gain; the exponent and the share that is held, plain.
    flow : float
        Usual flow [m3/s], at which the delay is `delay`.

    Notes
    -----
    Source: Hayami (1951) for the wave; the exponent of a wide channel with Manning friction is 0.4.
    """

    parameters: tuple[FreeParameter, ...]
    flow: float
    name: str = field(default="diffusive-wave", init=False)
    surface_area: None = field(default=None, init=False)

    @classmethod
    def nominal(
        cls,
        delay: float,
        spread: float,
        flow: float,
        *,
        exponent: float = 0.4,
        delay_sd: float = 0.3,
        spread_sd: float = 0.7,
        exponent_sd: float = 0.2,
        gain_sd: float = 0.03,
    ) -> "RiverResponse":
        """From a rough delay.

        Parameters
        ----------
        delay, spread : float
            Mean and standard deviation of the arrivals at the usual flow [s].
        flow : float
            Usual flow [m3/s].
        exponent : float
            By which the delay falls with the flow [-].
        delay_sd, spread_sd, gain_sd : float
            How well delay, spread and the gain 1 are known, as shares.
        exponent_sd : float
            [-].

        Raises
        ------
        RividError
            Where a value is impossible.
        """
        if not flow > 0.0:
            raise RividError(f"flow = {flow} m3/s: expected a positive usual flow")
        return cls(
            (
                FreeParameter.positive("delay", "s", delay, delay_sd),
                FreeParameter("exponent", "-", exponent, exponent, exponent_sd, -0.2, 1.2),
                FreeParameter.positive("spread", "s", spread, spread_sd, reach=3.0),
                FreeParameter("held_share", "-", 0.15, 0.15, 0.15, 0.0, 0.6),
                FreeParameter.positive("held_time", "s", delay, 0.5, reach=2.0),
                FreeParameter.positive("inflow_gain", "-", 1.0, gain_sd, reach=3.0),
            ),
            flow,
        )

    def with_parameters(self, vector: ArrayLike) -> "RiverResponse":
        """The same with other values; see :class:`rivid.diagnosis.response.base.Response`."""
        return replace(self, parameters=placed(self.parameters, vector))

    def settled(self, record: Record) -> "RiverResponse":
        """Itself: nothing of it comes in steps."""
        return self

    def baseline(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Discharge at the lower end [m3/s], shape (days, n): means about each sample."""
        flows = real_flows(record, changes)
        delay, exponent, _, _, _, gain = (p.natural for p in self.parameters)
        whole = flows.inflow + sum((1.0 - part.place) * part.flow for part in flows.added)
        slow = _trailing(record.time, whole, SLOW * delay)  # a wave is as fast as all water makes it
        later = delay * ((np.maximum(slow, 0.05 * self.flow) / self.flow) ** -exponent - 1.0)
        came = gain * self._arrived(record, flows.inflow, later, 1.0)
        for part in flows.added:
            came += self._arrived(record, part.flow, later, 1.0 - part.place)
        return came + flows.gauge

    def simulate(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """The same: a river forgets."""
        return self.baseline(record, changes)

    def slopes(self, record: Record, base: Floats, changes: Changes = NO_CHANGES) -> Floats:
        """Derivatives of the baseline, shape (p, days, n)."""
        return slopes_by_differences(self, record, base, changes, range(len(self.parameters)))

    def _arrived(self, record: Record, flow: Floats, later: Floats, way: float) -> Floats:
        """What has come of a flow that has a share of the way to go, means about the samples.

        Each sample's water first moves by what its flow makes the wave later; none overtakes what left
        before, and the volume stays. Then all spreads by one kernel, on a grid of its own.
        """
        T = record.sample_time
        time, days = record.time, len(record.time)
        ends = np.concatenate(
            [time[:, :1] - 0.5 * T, 0.5 * (time[:, 1:] + time[:, :-1]), time[:, -1:] + 0.5 * T], axis=1
        )
        cell = T / FINE
        grid = cell * np.arange(math.ceil(float((ends[:, -1] - ends[:, 0]).max()) / cell - 1e-6) + 1)
        departed = arrived_volume(
            ends[:, :1] + grid, np.maximum.accumulate(time + way * later, axis=1), held_volume(time, flow),
            flow[:, 0], flow[:, -1],
        )  # fmt: skip
        rate = np.diff(departed, axis=1) / cell
        first = flow[:, :1]  # holds before the row
        came = first + _convolved(rate - first, self._kernel(cell, rate.shape[1], way))
        arrived = np.concatenate([np.zeros((days, 1)), np.cumsum(came * cell, axis=1)], axis=1)
        at_ends = np.stack([np.interp(ends[row] - ends[row, 0], grid, arrived[row]) for row in range(days)])
        return np.asarray(np.diff(at_ends, axis=1) / np.diff(ends, axis=1))

    def _kernel(self, cell: float, n: int, way: float) -> Floats:
        """Weights of the cells before, shape (n,): from means of cells to means of cells [-].

        A wave on a share of the way has that share of the delay, of the variance, and of what is held.
        """
        delay, _, spread, held, hold, _ = (p.natural for p in self.parameters)
        if way * delay < SHORTEST:
            return np.asarray(np.eye(1, n)[0])
        time = np.asarray(cell / FINE * np.arange(n * FINE + 1), float)
        mean, cv = way * delay, spread / (math.sqrt(way) * delay)
        first, _ = hayami(time / mean, cv)
        keep = math.exp(-cell / FINE / hold)
        behind = lfilter([0.5 * (1.0 - keep)] * 2, [1.0, -keep], first)
        share = way * held
        arrived = (1.0 - share) * first + share * behind
        twice = np.concatenate([[0.0], np.cumsum(0.5 * (arrived[1:] + arrived[:-1])) * cell / FINE])[::FINE]
        return np.asarray(np.diff(twice, n=2, prepend=0.0, append=2 * twice[-1] - twice[-2])[:n] / cell)


def _trailing(time: Floats, flow: Floats, memory: float) -> Floats:
    """Leaky mean of a held flow over the time before each sample, from the row's first value."""
    slow = np.empty_like(flow)
    slow[:, 0] = flow[:, 0]
    keep = np.exp(-np.diff(time, axis=1) / memory)
    for k in range(1, flow.shape[1]):
        slow[:, k] = keep[:, k - 1] * slow[:, k - 1] + (1.0 - keep[:, k - 1]) * flow[:, k - 1]
    return slow


def _convolved(values: Floats, kernel: Floats) -> Floats:
    """Values (days, n) through a causal kernel (n,), zero before the first."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = values.shape[1]
    size = next_fast_len(2 * n, real=True)
    return np.asarray(irfft(rfft(values, size) * rfft(kernel, size), size)[:, :n])
