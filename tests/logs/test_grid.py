"""Test the grid against a slow calculation at every instant."""

import datetime as dt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rivid.errors import DataError
from rivid.logs.days import make_grid, on_grid
from rivid.logs.spec import spec_of
from tests import examples
from tests.logs.helpers import config

DAY = 86_400


def plain(times, values, instants, held, late):
    """Compute one instant at a time [s]. Held values are averaged second by second."""
    out = []
    if held:
        each = values[np.maximum(np.searchsorted(times, np.arange(DAY), side="right") - 1, 0)]
        ends = np.append(instants[1:], DAY).astype(int)
        return np.array([each[int(a) : b].mean() for a, b in zip(instants, ends, strict=True)])
    for g in instants:
        before = np.flatnonzero(times <= g + late)
        out.append(np.interp(g, times, values) if before.size else values[0])
    return np.array(out)


@settings(max_examples=examples(150), deadline=None)
@given(
    steps=st.lists(st.integers(20, 900), min_size=100, max_size=1200),
    period=st.sampled_from([60.0, 133.0, 300.0, 900.0]),
    held=st.booleans(),
    seed=st.integers(0, 99),
)
def test_held_and_interpolated_values(steps, period, held, seed):
    times = np.cumsum(steps)
    times = times[times < DAY]
    values = np.random.default_rng(seed).normal(size=len(times))
    spec = spec_of(config({"sample_time": period}, max_gap=86_400, max_filled=1))
    signal = spec.signals[0 if held else 2]
    assert signal.held == held
    grid = make_grid(0, DAY * 10**6, period, dt.UTC)
    samples, filled = on_grid(times * 10**6, values, grid, signal, spec)
    np.testing.assert_allclose(
        samples, plain(times, values, grid.times / 1e6, held, period / 100), atol=1e-12
    )
    assert len(samples) == int(np.ceil(DAY / period))


@pytest.mark.parametrize("late", [0, 10, 60, 120])
def test_stamps_between_the_instants_shift_no_flow(late):
    """Regression: means stamped 10 s after the instants came out a sample late: the delay was one short."""
    spec, grid = spec_of(config({"sample_time": 300.0})), make_grid(0, DAY * 10**6, 300.0, dt.UTC)
    values = np.random.default_rng(late).normal(size=288)
    samples, _ = on_grid((np.arange(0, DAY, 300) + late) * 10**6, values, grid, spec.signals[0], spec)
    mixed = ((300 - late) * values[1:] + late * values[:-1]) / 300
    np.testing.assert_allclose(samples[1:], mixed, atol=1e-12)


def test_the_means_of_a_flow_that_rests_are_equal():
    spec, grid = spec_of(config({"sample_time": 300.0})), make_grid(0, DAY * 10**6, 300.0, dt.UTC)
    samples, _ = on_grid(np.arange(0, DAY, 120) * 10**6, np.full(720, 260.3), grid, spec.signals[0], spec)
    assert (samples == 260.3).all()


@settings(max_examples=examples(100), deadline=None)
@given(lost=st.lists(st.integers(1, 648), max_size=60, unique=True), held=st.booleans())
def test_filled_samples_are_the_lost_ones(lost, held):
    spec = spec_of(config(max_gap=86_400))
    grid = make_grid(0, DAY * 10**6, 133.0, dt.UTC)
    kept = np.setdiff1d(np.arange(650), lost)
    values = np.arange(650.0)
    samples, filled = on_grid(grid.times[kept], values[kept], grid, spec.signals[0 if held else 2], spec)
    assert sorted(lost) == np.flatnonzero(filled).tolist()
    if not held:
        np.testing.assert_allclose(samples, values, rtol=1e-9)


@settings(max_examples=examples(100), deadline=None)
@given(first=st.integers(0, 640), count=st.integers(1, 20), limit=st.integers(0, 3000))
def test_the_limit_of_a_gap_is_time_without_a_value(first, count, limit):
    spec = spec_of(config(max_gap=limit))
    grid = make_grid(0, DAY * 10**6, 133.0, dt.UTC)
    kept = np.delete(np.arange(650), np.s_[first : first + count])
    without = 133 * count if first else kept[0] * 133
    if first + count >= 650:
        without = DAY - 133 * first
    try:
        on_grid(grid.times[kept], np.zeros(len(kept)), grid, spec.signals[0], spec)
        refused = False
    except DataError:
        refused = True
    small = without <= (0.5 * 133 if first else 133) + 1.33
    assert refused == (without > limit + 1.33 and not small)


def test_unsteady_clocks_leave_no_gap():
    spec = spec_of(config())
    grid = make_grid(0, DAY * 10**6, 133.0, dt.UTC)
    jitter = np.random.default_rng(1).integers(-20, 21, 650) * 10**6
    jitter[0] = 0
    _, filled = on_grid(grid.times + jitter, np.zeros(650), grid, spec.signals[0], spec)
    assert not filled.any()
