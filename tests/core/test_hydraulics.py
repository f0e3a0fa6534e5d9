"""Section II: numbers of the paper, and exact limits."""

import numpy as np
import pytest

from rivid.core.hydraulics import GRAVITY, propose_delays, travel_bounds
from rivid.errors import ConfigError

TABLE_I = {"length": 8200.0, "width": 81.6, "depth": 4.9}


def test_gravity_bound_of_table_i_is_7_to_8_5_samples():
    bounds = travel_bounds(np.linspace(100, 800, 50), **TABLE_I)
    samples = bounds.gravity / 133
    assert samples.min() == pytest.approx(6.9, abs=0.1)
    assert samples.max() == pytest.approx(8.6, abs=0.1)
    assert (np.diff(samples) < 0).all()


def test_kinematic_bound_is_20_to_more_than_100_samples():
    bounds = travel_bounds([100.0, 800.0], **TABLE_I)
    assert bounds.kinematic[0] / 133 > 100
    assert bounds.kinematic[1] / 133 == pytest.approx(20, abs=1)


def test_bounds_are_5_and_froude_is_6():
    Q, z = 300.0, 5.5
    bounds = travel_bounds(Q, length=8200, width=81.6, depth=z)
    F = Q / (81.6 * z * np.sqrt(GRAVITY * z))
    v = Q / (81.6 * z)
    assert bounds.froude == pytest.approx(F)
    assert bounds.gravity == pytest.approx(8200 / ((1 + 1 / F) * v))
    assert bounds.kinematic == pytest.approx(8200 / (1.5 * v))
    assert bounds.gravity < bounds.kinematic


def test_still_water_carries_a_gravity_wave_and_no_kinematic_one():
    bounds = travel_bounds(0.0, **TABLE_I)
    assert bounds.gravity == pytest.approx(8200 / np.sqrt(GRAVITY * 4.9))
    assert np.isinf(bounds.kinematic)


def test_beyond_froude_2_there_are_no_bounds():
    bounds = travel_bounds(5000.0, length=8200, width=20.0, depth=1.0)
    assert bounds.froude > 2
    assert np.isnan(bounds.gravity) and np.isnan(bounds.kinematic)


def test_the_proposal_for_table_i_is_the_papers_setting():
    proposal = propose_delays((100, 800), **TABLE_I, sample_time=133)
    assert (proposal.d_min, proposal.d_max, proposal.order) == (1, 15, 30)
    assert proposal.delay_scale == 6.5


@pytest.mark.parametrize("length", [900.0, 2900.0, 12_000.0, 40_000.0])
@pytest.mark.parametrize("kind", ["pool", "river"])
def test_proposals_are_settings_that_can_be_used(length, kind):
    proposal = propose_delays((100, 800), length=length, width=81.6, depth=4.9, sample_time=133, kind=kind)
    assert 1 <= proposal.d_min <= proposal.delay_scale <= proposal.d_max <= proposal.order - 3


def test_a_channel_without_width_is_refused():
    with pytest.raises(ConfigError, match="width = 0"):
        travel_bounds(100.0, length=8200, width=0, depth=5)
