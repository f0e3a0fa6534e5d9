"""Test section II: numbers of the paper, and exact limits."""

import numpy as np
import pytest

from rivid.core.hydraulics import GRAVITY, propose_delays, travel_bounds
from rivid.errors import ConfigError

TABLE_I = {"length": 8200.0, "width": 81.6, "depth": 4.9}


def test_bounds_of_table_i_are_those_of_section_ii():
    bounds = travel_bounds(np.linspace(100, 800, 50), **TABLE_I)
    gravity, kinematic = bounds.gravity / 133, bounds.kinematic / 133
    assert (gravity.min(), gravity.max()) == (pytest.approx(6.9, abs=0.1), pytest.approx(8.6, abs=0.1))
    assert (np.diff(gravity) < 0).all()
    assert kinematic[0] > 100 and kinematic[-1] == pytest.approx(20, abs=1)
    still = travel_bounds(0.0, **TABLE_I)
    assert still.gravity == pytest.approx(8200 / np.sqrt(GRAVITY * 4.9)) and np.isinf(still.kinematic)
    fast = travel_bounds(5000.0, length=8200, width=20.0, depth=1.0)
    assert fast.froude > 2 and np.isnan(fast.gravity) and np.isnan(fast.kinematic)


def test_bounds_are_5_and_froude_is_6():
    Q, z = 300.0, 5.5
    bounds = travel_bounds(Q, length=8200, width=81.6, depth=z)
    F = Q / (81.6 * z * np.sqrt(GRAVITY * z))
    v = Q / (81.6 * z)
    assert bounds.froude == pytest.approx(F)
    assert bounds.gravity == pytest.approx(8200 / ((1 + 1 / F) * v))
    assert bounds.kinematic == pytest.approx(8200 / (1.5 * v))


@pytest.mark.parametrize("length", [900.0, 2900.0, 12_000.0, 40_000.0])
@pytest.mark.parametrize("kind", ["pool", "river"])
def test_proposals_are_settings_that_can_be_used(length, kind):
    proposal = propose_delays((100, 800), length=length, width=81.6, depth=4.9, sample_time=133, kind=kind)
    assert 1 <= proposal.d_min <= proposal.delay_scale <= proposal.d_max <= proposal.order - 3
    paper = propose_delays((100, 800), **TABLE_I, sample_time=133)
    assert (paper.d_min, paper.d_max, paper.order, paper.delay_scale) == (1, 15, 30, 6.5)


def test_a_channel_without_width_is_refused():
    with pytest.raises(ConfigError, match="width = 0"):
        travel_bounds(100.0, length=8200, width=0, depth=5)
