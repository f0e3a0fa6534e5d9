"""The integrator with a resonance: a short pool in which a wave runs to and fro."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.signal import lfilter

from rivid.reach.models.base import (
    INFLOW_GAIN,
    OUTFLOW_GAIN,
    SURFACE_AREA,
    Output,
    Parameter,
    ReachResponse,
)
from rivid.reach.models.integrator_delay import IntegratorDelay
from rivid.types import Floats


@dataclass(frozen=True)
class IntegratorResonance(ReachResponse):
    """A pool as one volume plus its first standing wave.

    ``A h(s) = (K_i Q_i - K_o Q_o) / s - g (K_i Q_i + K_o Q_o) s / (s^2 + 2 zeta omega s + omega^2)``

    Parameters
    ----------
    surface_area : float
        A [m2].
    period : float
        2 pi / omega [s]: about the time of a wave down the pool and back, ``L/(c+v) + L/(c-v)``.
    damping : float
        zeta [-]: the share of the wave that friction takes; above 1 nothing swings.
    strength : float
        g [-]. Without friction the first of the waves in a closed channel has 2; 1 gives the peak below.
    inflow_gain, outflow_gain : float
        K_i and K_o [-].

    Notes
    -----
    Source: van Overloop and others, "Identification of resonance waves in open water channels", Control
    Engineering Practice 18 (2010), 863-872: area, frequency and a damping ``1 / (2 omega A M_r)`` that is
    read from the resonance peak M_r; here with g = 1 the peak is the same for small damping. The wave
    stands beside the integrator, as in the sum over the waves of a channel, not behind it: so heavy
    damping leaves the plain integrator. The wave is high at one end when it is low at the other: an inflow
    upstream first lowers what the volume alone would give downstream, and no delay is needed.
    """

    NAME: ClassVar[str] = "integrator-resonance"
    OUTPUT: ClassVar[Output] = "level"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        SURFACE_AREA,
        Parameter("period", "s", 1.0, 1e6, 2370.0, "period of the wave, once to and fro"),
        Parameter("damping", "-", 0.0, 1000.0, 0.1, "zeta, relative damping of the wave"),
        Parameter("strength", "-", 0.0, 4.0, 1.0, "g, the wave against the volume"),
        INFLOW_GAIN,
        OUTFLOW_GAIN,
    )

    surface_area: float
    period: float
    damping: float
    strength: float = 1.0
    inflow_gain: float = 1.0
    outflow_gain: float = 1.0

    def _respond(self, sample_time: float, inflow: Floats, outflow: Floats) -> Floats:
        volume = IntegratorDelay(self.surface_area, 0.0, self.inflow_gain, self.outflow_gain)
        level = volume.simulate(sample_time, inflow, outflow)
        step, decay = self._wave(sample_time)
        pushed = self.inflow_gain * inflow + self.outflow_gain * outflow
        wave = np.asarray(lfilter([0.0, step, -step], [1.0, *decay], pushed))
        return level - self.strength / self.surface_area * wave

    def _wave(self, T_s: float) -> tuple[float, tuple[float, float]]:
        """The wave sampled with held inputs: its step response after T_s, and its two recursion terms.

        The step response of ``s / (s^2 + 2 zeta omega s + omega^2)`` is the damped sine x(t), whose samples
        obey ``x[k] + a_1 x[k-1] + a_2 x[k-2] = 0``: no integration, and no error, is needed.
        """
        omega, zeta = 2.0 * math.pi / self.period, self.damping
        if zeta <= 1.0:
            swing = omega * math.sqrt(1.0 - zeta * zeta) * T_s
            shrink = math.exp(-zeta * omega * T_s)
            x = T_s * shrink * float(np.sinc(swing / math.pi))
            return x, (-2.0 * shrink * math.cos(swing), shrink * shrink)
        # Two real rates; the slow one is written without the difference that would cancel.
        root = math.sqrt(zeta * zeta - 1.0)
        slow, fast = omega / (zeta + root), omega * (zeta + root)
        first, second = math.exp(-slow * T_s), math.exp(-fast * T_s)
        x = -first * math.expm1((slow - fast) * T_s) / (fast - slow)
        return x, (-(first + second), first * second)
