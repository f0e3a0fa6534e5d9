"""A free river: its inflow comes later and spread out, the sooner the more it is."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from rivid.diagnose.data import Record
from rivid.diagnose.real_flows import real_flows
from rivid.diagnose.response import Floats, FreeParameter, placed, slopes_by_differences
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, Changes
from rivid.reach.models.diffusive_wave import DiffusiveWave

LENGTH = 1000.0
"""Of the wave whose arrivals are the parcels' [m]: any length does."""
PARCELS = 24
"""Parts of the inflow with a delay each, of equal weight: their delays are quantiles of the spread."""
SLOW = 0.5
"""Memory of the flow that sets the delay, in delays: the flow that a wave meets on its way."""


@dataclass(frozen=True, eq=False)
class RiverResponse:
    """A diffusive wave whose delay follows the flow, and which keeps its water.

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
                FreeParameter.positive("held_time", "s", delay, 0.7, reach=3.0),
                FreeParameter.positive("inflow_gain", "-", 1.0, gain_sd, reach=3.0),
            ),
            flow,
        )

    def with_parameters(self, vector: ArrayLike) -> "RiverResponse":
        """The same with other values; see :class:`rivid.diagnose.response.Response`."""
        return replace(self, parameters=placed(self.parameters, vector))

    def settled(self, record: Record) -> "RiverResponse":
        """Itself: nothing of it comes in steps."""
        return self

    def baseline(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """Discharge at the lower end [m3/s], shape (days, n): means about each sample."""
        flows = real_flows(record, changes)
        delay, exponent, spread, held, hold, gain = (p.natural for p in self.parameters)
        share = _quantiles(spread / delay, held, hold / delay)
        slow = _trailing(record.time, flows.inflow, SLOW * delay)
        tau = delay * (np.maximum(slow, 0.05 * self.flow) / self.flow) ** -exponent
        came = gain * _arrived(record, flows.inflow, tau, share)
        for part in flows.added:
            came += _arrived(record, part.flow, (1.0 - part.place) * tau, share)
        return came + flows.gauge

    def simulate(self, record: Record, changes: Changes = NO_CHANGES) -> Floats:
        """The same: a river forgets."""
        return self.baseline(record, changes)

    def slopes(self, record: Record, base: Floats, changes: Changes = NO_CHANGES) -> Floats:
        """Derivatives of the baseline, shape (p, days, n)."""
        return slopes_by_differences(self, record, base, changes, range(len(self.parameters)))


def _quantiles(spread: float, held: float, hold: float) -> Floats:
    """Arrival times of the parcels in delays of the wave, shape (PARCELS,).

    Parameters
    ----------
    spread, hold : float
        Standard deviation of the wave's arrivals, and mean time that held water is held, in its delays.
    held : float
        Share that is held.
    """
    wide = min(spread, 2.0)
    wave = DiffusiveWave(LENGTH, 1.0, 0.5 * LENGTH * wide * wide)  # arrivals of mean LENGTH seconds
    end = (1.0 + 6.0 * wide) ** 2 + 8.0 * hold
    time, step = np.linspace(0.0, end, 8001, retstep=True)
    first = wave.arrived(LENGTH * time)
    keep = math.exp(-float(step) / hold)
    later = lfilter([0.5 * (1.0 - keep)] * 2, [1.0, -keep], first)  # behind a reservoir
    arrived = (1.0 - held) * first + held * later
    at = np.interp((np.arange(PARCELS) + 0.5) / PARCELS, arrived, time)
    # Equal parcels cut the tails off: what that takes from mean and spread is given back.
    mean = 1.0 + held * hold
    variance = wide * wide + held * hold * hold * (2.0 - held)
    scale = math.sqrt(variance / max(float(at.var()), 1e-12))
    return np.asarray(np.maximum(mean + (at - at.mean()) * scale, 0.01))


def _trailing(time: Floats, flow: Floats, memory: float) -> Floats:
    """Leaky mean of a held flow over the time before each sample, from the row's first value."""
    slow = np.empty_like(flow)
    slow[:, 0] = flow[:, 0]
    keep = np.exp(-np.diff(time, axis=1) / memory)
    for k in range(1, flow.shape[1]):
        slow[:, k] = keep[:, k - 1] * slow[:, k - 1] + (1.0 - keep[:, k - 1]) * flow[:, k - 1]
    return slow


def _arrived(record: Record, flow: Floats, tau: Floats, share: Floats) -> Floats:
    """Mean discharge about each sample of what has come, each parcel after its share of tau.

    Parcels keep their order: where tau falls faster than time passes, what left late arrives with what left
    before, and no water is lost or made.
    """
    time, half = record.time, 0.5 * record.sample_time
    days, n = time.shape
    ends = np.concatenate(
        [time[:, :1] - half, 0.5 * (time[:, 1:] + time[:, :-1]), time[:, -1:] + half], axis=1
    )
    passed = np.zeros((days, n))
    np.cumsum(flow[:, :-1] * np.diff(time, axis=1), axis=1, out=passed[:, 1:])
    volume = np.zeros((days, n + 1))
    for x in share:
        arrival = np.maximum.accumulate(time + x * tau, axis=1)
        for row in range(days):
            at = arrival[row]
            volume[row] += np.interp(ends[row], at, passed[row])
            volume[row] += flow[row, 0] * np.minimum(ends[row] - at[0], 0.0)
            volume[row] += flow[row, -1] * np.maximum(ends[row] - at[-1], 0.0)
    return np.asarray(np.diff(volume, axis=1) / np.diff(ends, axis=1) / len(share))
