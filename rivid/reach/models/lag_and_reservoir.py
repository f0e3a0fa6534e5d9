"""Lag and reservoir: a river that moves its water, then holds it back for a while."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.signal import lfilter

from rivid.reach.models.base import INFLOW_GAIN, Output, Parameter, ReachResponse, shifted, split_delay
from rivid.types import Floats


@dataclass(frozen=True)
class LagAndReservoir(ReachResponse):
    """A delay, then a linear reservoir: ``K dq/dt = K_i Q_i(t - tau) - q(t)``.

    The storage is ``K q``; a step is answered by ``1 - exp(-(t - tau) / K)``, so the mean delay is tau + K.

    Parameters
    ----------
    lag : float
        tau [s].
    storage : float
        K [s], the time constant of the reservoir.
    inflow_gain : float
        K_i [-]; 1 keeps the water.

    Notes
    -----
    Source: the lag-and-route method of hydrology, a linear reservoir with an extra delay; Koussis and Mazi,
    "Reverse flood and pollution routing with the lag-and-route model", Hydrological Sciences Journal 61
    (2016), 1952-1966.
    """

    NAME: ClassVar[str] = "lag-and-reservoir"
    OUTPUT: ClassVar[Output] = "discharge"
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (
        Parameter("lag", "s", 0.0, 1e6, 20_000.0, "tau, before anything arrives"),
        Parameter("storage", "s", 1.0, 1e7, 3600.0, "K, storage over discharge"),
        INFLOW_GAIN,
    )

    lag: float
    storage: float
    inflow_gain: float = 1.0

    @property
    def mean_delay(self) -> float:
        """Mean of the arrival times of a pulse, tau + K [s]."""
        return self.lag + self.storage

    def _respond(self, sample_time: float, inflow: Floats, outflow: Floats) -> Floats:
        whole, part = split_delay(self.lag, sample_time)
        before, after = part * sample_time / self.storage, (1.0 - part) * sample_time / self.storage
        # Within a sample the reservoir is filled by the older flow first, then by the newer one.
        older, newer = -math.exp(-after) * math.expm1(-before), -math.expm1(-after)
        filled = older * shifted(inflow, whole + 1) + newer * shifted(inflow, whole)
        keep = math.exp(-sample_time / self.storage)
        return self.inflow_gain * np.asarray(lfilter([0.0, 1.0], [1.0, -keep], filled))
