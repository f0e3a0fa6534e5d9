"""Test the filter and the forecasts of 1x against slow, independent calculations."""

import numpy as np
import pytest

from benchmarks.exam import sizing
from benchmarks.exam.hiding import referred
from benchmarks.exam.sizing import (
    beyond,
    crossing,
    factor_of,
    filtered,
    misfit,
    resized,
    size_of,
    stretches,
    unit,
)
from rivid.diagnosis.noise.model import NoiseModel
from rivid.effects import CATALOGUE


@pytest.fixture(scope="module")
def ref():
    return referred(9)[1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_filter_with_an_even_walk_is_that_of_the_diagnosis(seed):
    rng = np.random.default_rng(seed)
    noise = NoiseModel(0.004, 0.001, 2.0, 7200.0, 0.0, 3600.0, 133.0, 6e5)
    columns = rng.normal(0.0, 0.01, (3, 4, 200)).cumsum(axis=2)
    white, _, _ = filtered(
        columns, np.full((4, 200), 1e-6), 133.0 / 6e5, float(np.exp(-133.0 / 7200.0)), 4.0, 1.6e-5
    )
    np.testing.assert_allclose(white, noise.whiten(columns), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", [1, 2])
def test_of_a_river_what_enters_arrives(seed):
    rng = np.random.default_rng(seed)
    noise = NoiseModel(1.5, 0.0, 0.0, 3600.0, 4.0, 7200.0, 900.0, None)
    columns = rng.normal(0.0, 3.0, (3, 4, 200))
    white, _, _ = filtered(columns, np.zeros((4, 200)), 0.0, float(np.exp(-900.0 / 7200.0)), 16.0, 2.25)
    np.testing.assert_allclose(white, noise.whiten(columns), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_likelihood_of_the_filter_is_that_of_the_whole_covariance(seed):
    rng = np.random.default_rng(seed)
    n, c, phi, inflow, gauge = 12, 0.3, 0.8, 0.5, 0.2
    walk = rng.uniform(0.01, 1.0, (1, n))
    W = inflow * phi ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    L = np.tril(np.ones((n, n)), -1)  # x_k is the sum of the previous steps
    S = L @ (c * c * W + np.diag(walk[0])) @ L.T + gauge * np.eye(n)
    D = np.diff(np.eye(n), axis=0)  # differences, since x_0 is unknown
    z = rng.normal(size=n)
    direct = (D @ z) @ np.linalg.solve(D @ S @ D.T, D @ z)
    white, _, _ = filtered(z[None, None], walk, c, phi, inflow, gauge)
    assert (white**2).sum() == pytest.approx(direct, rel=1e-8)


def test_the_misfit_follows_changes_of_the_level_s_rate():
    level = np.zeros((1, 60))
    level[0, 30:] = np.arange(30.0)  # it starts to rise
    variance = misfit(level)
    assert variance[0, :26].max() == 0.0 and variance[0, 40:50].max() == pytest.approx(0.0)
    assert variance.sum() >= sizing.MISFIT**2 * 0.99


def test_stretches_are_pairs_of_days_that_follow_each_other(ref):
    grid = stretches(ref.season)
    N = len(ref.season.seconds)
    assert grid.at.shape == (len(grid.at), 2 * N)
    starts = grid.at[:, 0] // N
    assert (np.diff(starts) >= 2).all()
    days = {(date - ref.season.scenario.first_day).days + 1 for date in ref.season.dates}
    assert all({int(k), int(k) + 1} <= days for k in starts)
    np.testing.assert_array_equal(grid.level[0], np.concatenate(ref.season.true_level[[0, 1]])) if starts[
        0
    ] == 1 else None


@pytest.mark.parametrize("many", [0.5, 3.0])
def test_a_factor_goes_down_as_the_change_grows(ref, many):
    z = ref.columns[0] * 0.3 + np.random.default_rng(1).normal(0.0, 1e-3, ref.base.shape).cumsum(axis=1)
    one, by = factor_of(ref, z, noise=False, price=10.0)
    other, same = factor_of(ref, many * z, noise=False, price=10.0)
    assert (other * many, same) == (pytest.approx(one, rel=1e-6), by)


def test_what_the_calibration_does_as_well_is_no_effect(ref):
    rng = np.random.default_rng(2)
    own = rng.normal(0.0, 1e-3, ref.base.shape).cumsum(axis=1)
    alone = beyond(ref, own)[1]
    with_more = beyond(ref, own + 0.2 * ref.columns[0])[1]
    assert with_more == pytest.approx(alone, rel=0.05)
    raw = (ref.filter((0.2 * ref.columns[0])[None])[0] ** 2).sum()
    assert raw > 10.0 * abs(with_more - alone)
    assert beyond(ref, own, own)[1] < 1e-3 * alone


def test_a_unit_is_1x_of_itself(ref):
    one = unit(ref, {"name": "lateral_inflow", "inflow": 30.0, "place": 0.4}, dict(CATALOGUE), 0)
    again = unit(ref, one.table, dict(CATALOGUE), 0)
    assert again.table["inflow"] == pytest.approx(one.table["inflow"], rel=0.02)
    share = one.table["inflow"] / ref.world.scenario.flow.mean
    assert 1e-4 < share < 0.1


def test_several_sizes_grow_together():
    table = {"name": "sensor_step", "step": [0.02, -0.05], "start": [30.0, 90.0]}
    assert resized(table, 2.0) == table | {"step": [0.04, -0.1]}
    assert size_of(table) == -0.05


def test_a_crossing_is_found():
    assert crossing(lambda f: f > 0.37) == pytest.approx(0.37, rel=1e-6)
