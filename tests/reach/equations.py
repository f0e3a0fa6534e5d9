"""Equation (8) written out, for tests that need a pool without operators."""

import numpy as np


def difference_equation(inflow, outflow, delay, alpha_i, alpha_o):
    """Return the level of the integrator with a delay of d samples; flows are zero before the start."""
    level = np.zeros(np.shape(inflow))
    for k in range(1, level.shape[-1]):
        late = inflow[..., k - delay - 1] if k > delay else 0.0
        level[..., k] = level[..., k - 1] + alpha_i * late - alpha_o * outflow[..., k - 1]
    return level
