"""Kinds of noise of a river's discharge.

What no log holds (springs, side streams, a drifting rating) wanders; the gauge adds noise of its own. The
noise is ``C(q) / A(q) e``: A makes what wanders white, C is the minimum-phase factor of ``ratio + |A|^2``,
with the ratio of the wandering's variance to the gauge's; without a gauge C is 1.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rivid.core.posterior.noise import spectral_factor
from rivid.core.river.sums import Noises

Floats = NDArray[np.float64]

MEMORY = (0.9, 0.97, 1.0)
"""rho of what wanders, ``A = 1 - rho q^-1``."""
SMOOTH_MEMORY = (0.5, 0.9)
"""r of what wanders smoothly, ``A = (1 - q^-1)(1 - r q^-1)``."""
RATIOS = (0.1, 1.0)
"""Variance of what wanders over that of the gauge."""

SINE = 3
"""Columns of a level and a daily sine."""


@lru_cache(maxsize=1)
def river_noises() -> Noises:
    """(A, C) of every kind of noise."""
    wander = [np.array([1.0, -rho]) for rho in MEMORY]
    wander += [np.convolve([1.0, -1.0], [1.0, -r]) for r in SMOOTH_MEMORY]
    return tuple((a, c) for a in wander for c in (np.ones(1), *(spectral_factor(a, r) for r in RATIOS)))


def daily_sine(n: int, day: float) -> Floats:
    """Cosine and sine of one day's period, shape (2, n)."""
    angle = 2.0 * np.pi * np.arange(n) / day
    return np.stack([np.cos(angle), np.sin(angle)])
