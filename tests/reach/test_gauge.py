"""Test the stilling well against small steps in time."""

import numpy as np
import pytest

from rivid.reach.gauge import stilled

TIME = np.cumsum(np.r_[0.0, np.full(40, 133.0), 77.0, np.full(30, 133.0)])
FINE = 2000


def by_small_steps(time, level, lags):
    """Return the level in the well, with each interval in :data:`FINE` implicit midpoint steps."""
    well, rows = level[0], [level[0]]
    for k in range(len(time) - 1):
        h = (time[k + 1] - time[k]) / FINE
        for water in np.interp((np.arange(FINE) + 0.5) / FINE, [0.0, 1.0], level[k : k + 2]):
            well = (well * (lags[k] - 0.5 * h) + h * water) / (lags[k] + 0.5 * h)
        rows.append(well)
    return np.array(rows)


@pytest.mark.parametrize("seed", range(3))
def test_a_well_follows_the_water_as_in_small_steps(seed):
    rng = np.random.default_rng(seed)
    level = np.cumsum(rng.normal(0.0, 0.02, (2, len(TIME))), axis=1)
    lags = np.where(np.arange(len(TIME)) < 30, 60.0, 400.0)
    time = np.broadcast_to(TIME, level.shape)
    well = stilled(time, level, lags)
    for row in range(2):
        np.testing.assert_allclose(well[row], by_small_steps(TIME, level[row], lags), atol=1e-6)
    columns = np.stack([level, 2.0 * level, level[::-1]])
    np.testing.assert_allclose(stilled(time, columns, lags)[1], 2.0 * well, atol=1e-12)
    np.testing.assert_array_equal(stilled(TIME, level[0], lags), well[0])
    assert stilled(time, level, 0.0) is level


def test_the_slope_at_no_lag_is_the_fall_of_the_level():
    level = np.sin(TIME / 900.0)
    slope = (stilled(TIME, level, 0.01) - level) / 0.01
    np.testing.assert_allclose(slope[1:], -np.diff(level) / np.diff(TIME), rtol=1e-9)
    assert slope[0] == 0.0


def test_a_missing_level_stays_missing():
    level = np.where(np.arange(len(TIME)) < 20, 1.0, np.nan)
    np.testing.assert_array_equal(np.isnan(stilled(TIME, level, 60.0)), np.isnan(level))
