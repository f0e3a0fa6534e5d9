"""The reach as an integrator with a delay, (7) and (10)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rivid.core.hydraulics import GRAVITY
from rivid.types import Floats


@dataclass(frozen=True)
class LinearReach:
    """A pool held by a dam: ``A dh/dt = K_i Q_i(t - tau) - K_o Q_o`` (7), tau a function of the flow.

    Parameters
    ----------
    length, width, depth : float
        Length L, mean width and mean depth of the flow [m].
    wave_depth : float
        Depth z that carries the wave [m]: tau = L / (v + sqrt(g z)).
    surface_area : float
        Water surface A [m2].
    inflow_gain, outflow_gain : float
        K_i and K_o: real flow of a dam over its command.
    """

    length: float = 8200.0
    width: float = 81.6
    depth: float = 4.9
    wave_depth: float = 4.9
    surface_area: float = 6.7e5
    inflow_gain: float = 1.0
    outflow_gain: float = 1.0

    def travel_time(self, flow: ArrayLike) -> Floats:
        """Travel time tau of the gravity wave [s] at a flow [m3/s].

        Notes
        -----
        Source: the lower bound in (5), with a depth of its own for the wave.
        """
        velocity = np.asarray(flow, float) / (self.width * self.depth)
        return np.asarray(self.length / (velocity + np.sqrt(GRAVITY * self.wave_depth)))


def theoretical_fir(
    order: int,
    delay: int,
    alpha_i: float,
    alpha_o: float,
    feedforward: float = 1.0,
    level_gain: float = -1000.0,
) -> Floats:
    """Impulse response of the regulated reach from inflow to level, Fig. 10.

    Parameters
    ----------
    order : int
        Number of coefficients M.
    delay : int
        d [samples].
    alpha_i, alpha_o : float
        K_i T_s / A and K_o T_s / A [m per m3/s].
    feedforward : float
        K_Q [-].
    level_gain : float
        K_h [m2/s], negative: by (9) the outflow grows by ``-K_h`` for each metre of level.

    Returns
    -------
    ndarray, shape (order,)
        h [m per m3/s]: zero at lag 0, a jump at lag 1 and one at lag d + 1, a geometric decay after each.

    Notes
    -----
    Source: equation (10), as the sum of two first-order responses.

    Examples
    --------
    >>> (theoretical_fir(9, 7, 1e-4, 1.2e-4)[[0, 1, 2, 8]] * 1e4).round(3).tolist()
    [0.0, -1.2, -1.056, 0.51]
    """
    lag = np.arange(order)
    decay = level_gain * alpha_o + 1.0
    first = np.where(lag >= 1, decay ** np.maximum(lag - 1, 0), 0.0)
    second = np.where(lag >= delay + 1, decay ** np.maximum(lag - delay - 1, 0), 0.0)
    return np.asarray(alpha_i * second - feedforward * alpha_o * first)
