"""Stationary autoregressions of first and second order, and series drawn from them."""

from typing import NamedTuple

import numpy as np

from rivid.effects.base import World
from rivid.types import Floats


class Autoregression(NamedTuple):
    """``x_k = a_1 x_k-1 + a_2 x_k-2 + e_k``.

    Attributes
    ----------
    coefficients : tuple of float
        a_1, or a_1 and a_2; stationary.
    innovation : float
        Standard deviation of e [m].
    """

    coefficients: tuple[float, ...]
    innovation: float

    def covariance(self) -> Floats:
        """Variance, and with two coefficients the covariance of neighbours [m2]; by Yule and Walker."""
        if len(self.coefficients) == 1:
            return np.array([self.innovation**2 / (1.0 - self.coefficients[0] ** 2)])
        a1, a2 = self.coefficients
        variance = self.innovation**2 * (1.0 - a2) / ((1.0 + a2) * ((1.0 - a2) ** 2 - a1 * a1))
        return variance * np.array([1.0, a1 / (1.0 - a2)])


def draw(model: Autoregression, world: World) -> Floats:
    """A series with the law of an autoregression at the world's sample time, shape of the time grid.

    It is drawn at all multiples of the sample time between the first and the last sample. Each sample has
    the value nearest in time: within a day these are neighbours of the series, and rows that are days
    apart are that far apart in it.
    """
    from scipy.signal import lfilter

    T_s = world.sample_time
    steps = (world.time - world.time.min()) / T_s
    at = np.floor(steps + 0.4999).astype(np.intp)  # a half always goes the same way
    shocks = world.rng().standard_normal(int(at.max()) + 1 + len(model.coefficients))
    covariance = model.covariance()
    past = np.sqrt(covariance[0]) * shocks[0]
    before = [past]
    if len(model.coefficients) == 2:  # x_-1 given x_-2
        rho = covariance[1] / covariance[0] if covariance[0] > 0 else 0.0
        before = [rho * past + np.sqrt(covariance[0] * (1.0 - rho * rho)) * shocks[1], past]
    a = np.array(model.coefficients)
    # what the filter remembers of the values before: sum of a_j x_k-j over those j that reach back
    memory = [float(a[i:] @ before[: len(a) - i]) for i in range(len(a))]
    shocks = model.innovation * shocks[len(a) :]
    series, _ = lfilter([1.0], np.concatenate([[1.0], -a]), shocks, zi=memory)
    return np.asarray(series[at])
