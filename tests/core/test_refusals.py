"""Test that the core refuses settings and arrays in one line that names the fault; and calls without days."""

import numpy as np
import pytest

from rivid.core.cusum import cusum
from rivid.core.fir import jmap, ml
from rivid.core.search import direct, indirect
from rivid.core.season import SeasonSettings
from rivid.core.settings import (
    CusumSettings,
    JmapSettings,
    PosteriorSettings,
    RiverSettings,
    SearchSettings,
)
from rivid.errors import ConfigError, RividError

nan, inf = float("nan"), float("inf")
WRONG = {
    JmapSettings: [
        {"d_max": 28}, {"d_min": 0}, {"d_min": 9, "d_max": 8}, {"alpha": 1e4},
        {"alpha": -1.0, "prior": "uniform"}, {"delay_scale": nan}, {"max_iterations": 1},
        {"prior": "rayleich"}, {"jumps": "none"},
    ],
    SearchSettings: [{"d_min": 0}, {"d_min": 5, "d_max": 4}, {"d_min": -1, "d_max": -1}],
    CusumSettings: [
        {"d_min": 0}, {"threshold": 0.0}, {"drift": -1.0}, {"sd": nan}, {"mean": inf}, {"mean_lags": -1},
        {"moment": "start"},
    ],
    PosteriorSettings: [
        {"d_min": 0}, {"d_max": 8, "d_min": 9}, {"order": 15}, {"store_temperature": 0.9},
        {"wave_error": 0.0}, {"sharp": 1.1}, {"answer_above": -0.1}, {"wave_lag": 1.0},
    ],
    RiverSettings: [
        {"d_min": 0}, {"d_min": 9, "d_max": 9}, {"warm": 50}, {"temperature": 0.5}, {"gain_sd": 0.0},
        {"link_above": 1.5}, {"spread": -1.0},
    ],
    SeasonSettings: [
        {"drifts": ()}, {"drifts": (-1.0,)}, {"exponents": (3.0,)}, {"trust": 1.0}, {"jump": 1.5},
        {"independent": -0.1},
    ],
}  # fmt: skip


@pytest.mark.parametrize(("kind", "values"), [(kind, values) for kind in WRONG for values in WRONG[kind]])
def test_settings_out_of_range_are_refused_by_name(kind, values):
    with pytest.raises(ConfigError, match=next(iter(values))):
        kind(**values)


@pytest.mark.parametrize("estimate", [ml, jmap, indirect])
@pytest.mark.parametrize(
    ("u", "y", "words"),
    [
        (np.zeros(50), np.zeros(49), "has shape .49,.: expected that of"),
        (np.zeros((2, 2, 50)), np.zeros((2, 2, 50)), "has shape .2, 2, 50.: expected"),
        (np.zeros(10), np.zeros(10), "10 samples a day: .* or more"),
        (np.full((2, 50), np.nan), np.zeros((2, 50)), "not finite on 2 days, first on row 0"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(estimate, u, y, words):
    with pytest.raises(RividError, match=words):
        estimate(u, y)


def test_no_days_give_no_days():
    none = np.empty((0, 100))
    assert ml(none, none).fir.shape == jmap(none, none).fir.shape == (0, 30)
    assert jmap(none, none).criterion.shape == direct(none, none, none).criterion.shape == (0, 15)
    assert indirect(none, none).parameters.shape == (0, 3)
    assert cusum(np.empty((0, 30))).decision.shape == (0, 30)
