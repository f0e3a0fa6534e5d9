"""The diffusive wave: a free river that moves, spreads and keeps its water."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter
from scipy.special import erfc, erfcx

from rivid.reach.models.base import INFLOW_GAIN, Output, Parameter, ReachResponse
from rivid.types import Floats


@dataclass(frozen=True)
class DiffusiveWave(ReachResponse):
    """A long channel: ``dQ/dt + C dQ/dx = D d2Q/dx2``, from the inflow at x = 0 to the discharge at L.

    A pulse of inflow arrives with the density of an inverse Gaussian,
    ``L / (2 sqrt(pi D t^3)) exp(-(L - C t)^2 / (4 D t))``: mean L / C, variance ``2 D L / C^3``.

    Parameters
    ----------
    length : float
        L [m].
    celerity : float
        C [m/s], about 1.5 times the velocity of the water.
    diffusivity : float
        D [m2/s], about Q / (2 B S) with width B and slope S; 0 is a pure delay.
    inflow_gain : float
        K_i [-]; 1 keeps the water.

    Notes
    -----
    Source: Hayami, "On the propagation of flood waves" (1951), the linear diffusion analogy in a channel
    without end. Only the three ratios L / C, D L / C^3 and K_i can be told from data.
    """

    NAME: ClassVar[str] = "diffusive-wave"
    OUTPUT: ClassVar[Output] = "discharge"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        Parameter("length", "m", 1.0, 1e7, 48_000.0, "length L of the river reach"),
        Parameter("celerity", "m/s", 1e-3, 50.0, 2.0, "C, speed of a rise of discharge"),
        Parameter("diffusivity", "m2/s", 0.0, 1e7, 1000.0, "D, spreading of a rise of discharge"),
        INFLOW_GAIN,
    )

    length: float
    celerity: float
    diffusivity: float
    inflow_gain: float = 1.0

    @property
    def mean_delay(self) -> float:
        """Mean of the arrival times of a pulse, L / C [s]."""
        return self.length / self.celerity

    @property
    def spread(self) -> float:
        """Standard deviation of the arrival times of a pulse, sqrt(2 D L / C^3) [s]."""
        return math.sqrt(2.0 * self.diffusivity * self.length / self.celerity**3)

    def arrived(self, time: ArrayLike) -> Floats:
        """Share of a step of inflow that has arrived: the cumulative distribution of the kernel.

        Parameters
        ----------
        time : array_like
            Time since the step [s].

        Returns
        -------
        ndarray
            From 0 to 1; with ``diffusivity = 0`` it jumps at L / C.
        """
        t = np.asarray(time, float)
        if self.diffusivity == 0.0:
            return np.where(t >= self.mean_delay * (1.0 - 1e-12), 1.0, 0.0)  # L / C may be rounded up
        share = np.zeros_like(t)
        late = t > 0.0
        root = 2.0 * np.sqrt(self.diffusivity * t[late])
        ahead = (self.length - self.celerity * t[late]) / root
        behind = (self.length + self.celerity * t[late]) / root
        # The textbook has exp(C L / D) erfc(behind), which overflows for a sharp front. Since
        # behind^2 - C L / D = ahead^2, the scaled erfcx says the same with small numbers.
        share[late] = 0.5 * erfc(ahead) + 0.5 * np.exp(-ahead * ahead) * erfcx(behind)
        return share

    def kernel(self, sample_time: float, n_samples: int) -> Floats:
        """What each past sample of a held inflow gives to the discharge now.

        Parameters
        ----------
        sample_time : float
            T_s [s].
        n_samples : int
            Most coefficients; the kernel ends before where all has arrived.

        Returns
        -------
        ndarray, shape (K,)
            Differences of :meth:`arrived`: their sum is what has arrived after K - 1 samples, so no water
            is lost or made by sampling.
        """
        share = self.arrived(sample_time * np.arange(n_samples))
        share = np.minimum(np.maximum.accumulate(share), 1.0)  # rounding must not make water
        end = int(np.searchsorted(share, 1.0)) + 1
        return np.diff(share[:end], prepend=0.0)

    def _respond(self, sample_time: float, inflow: Floats, outflow: Floats) -> Floats:
        kernel = self.kernel(sample_time, inflow.shape[-1])
        return np.asarray(lfilter(self.inflow_gain * kernel, [1.0], inflow))
