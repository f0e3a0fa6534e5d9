"""Test the data of the paper's figures: logs, estimates and the intervals of a cascade."""

import dataclasses
import json

import numpy as np
import pytest

from rivid.core.fir import jmap, map_fir, ml
from rivid.core.hydraulics import travel_bounds
from rivid.core.search import direct, indirect
from rivid.errors import ConfigError, NoDataError, RividError
from rivid.plots.paper_data import (
    estimate,
    of_year,
    read_run,
    shortest,
    year_of,
)
from tests.plots.years import cut, estimated, season, still, without_outflow, year

# Logs


def test_days_of_each_length_come_together_and_shorter_ones_are_left_out():
    y = cut(year(), 3, 27)
    groups = list(y.groups(30))
    assert sorted(len(days) for days, _ in groups) == [1, 11]
    assert sorted(int(i) for days, _ in groups for i in days) == list(range(12))
    for days, data in groups:
        for k, i in enumerate(days):
            assert np.array_equal(data.u[k], y.inflow[i] - y.inflow[i][0])
            assert np.array_equal(data.y[k], y.level[i] - y.level[i][0])
            assert np.array_equal(data.o[k], y.outflow[i] - y.outflow[i][0])
    assert [len(days) for days, _ in cut(year(), 0, 640).groups(30)] == [11]


def test_the_discharge_is_that_of_the_downstream_dam_where_it_is_logged():
    y = year()
    assert y.discharge == pytest.approx([o.mean() for o in y.outflow])
    assert without_outflow(y).discharge == pytest.approx([u.mean() for u in y.inflow])


def test_the_bounds_take_the_depth_from_the_level_where_the_bed_is_known():
    y = year()
    reach = y.config.reach
    shape = {"length": reach.length, "width": reach.width}
    assert y.bounds.gravity == pytest.approx(travel_bounds(y.discharge, **shape, depth=reach.depth).gravity)
    low = reach.model_copy(update={"bed_level": 124.0})
    y = dataclasses.replace(y, config=y.config.model_copy(update={"reach": low}))
    expected = travel_bounds(y.discharge, **shape, depth=y.mean_level - 124.0)
    assert y.bounds.gravity == pytest.approx(expected.gravity)


def test_days_with_gaps_are_left_out_and_counted():
    s = season()
    level = s.level.copy()
    level[4, 100] = np.nan
    y = year_of(year().config, s.dates, s.inflow, s.outflow, level)
    assert len(y.dates) == 11 and y.left_out == 1 and s.dates[4] not in y.dates


@pytest.mark.parametrize(
    ("record", "error", "message"),
    [
        (None, NoDataError, "holds no finished run"),
        ({}, RividError, "run.json cannot be read"),
        ({"config": {}, "data_dir": "gone"}, NoDataError, "--logs DATA_DIR"),
        ({"config": {"reach": {"kind": "river"}}, "data_dir": "."}, ConfigError, "a river has none"),
    ],
)
def test_a_run_that_cannot_be_read_is_an_error(record, error, message, tmp_path):
    if record is not None:
        (tmp_path / "run.json").write_text(json.dumps(record))
    with pytest.raises(error, match=message):
        read_run(tmp_path)


# Estimates


def test_each_estimator_gives_what_the_core_gives():
    s, e = season(), estimated()
    u, y = s.inflow - s.inflow[:, :1], s.level - s.level[:, :1]
    expected = {
        "jmap": jmap(u, y).delay,
        "jmap-uniform": jmap(u, y, prior="uniform", alpha=1e4).delay,
        "jmap-uniform-estimated": jmap(u, y, prior="uniform").delay,
        "jmap-degenerate": jmap(u, y, inverse_gamma=False).delay,
        "direct": direct(s.inflow, s.outflow, s.level).delay,
        "indirect": indirect(s.inflow, s.level).delay,
    }
    for name, delay in expected.items():
        assert np.array_equal(e.of(name).delay, delay), name
        assert np.array_equal(e.of(name).at_bound, np.isin(delay, (1, 15))), name
    assert np.array_equal(e.of("ml").fir, ml(u, y).fir)
    assert np.array_equal(e.of("map").fir, map_fir(u, y).fir)


def test_a_shorter_day_changes_no_other_and_has_its_own_answer():
    y = cut(year(), 5, 27)
    whole, short = estimated(), estimate(y)
    others = [i for i in range(12) if i != 5]
    alone = jmap(y.inflow[5] - y.inflow[5][0], y.level[5] - y.level[5][0])
    assert np.array_equal(short.of("jmap").fir[others], whole.of("jmap").fir[others])
    assert np.array_equal(short.of("jmap").fir[5], alone.fir)
    assert short.of("jmap").condition[5] == alone.condition


def test_a_day_without_motion_has_no_answer_of_any_estimator():
    e = estimate(still(year(), 4))
    for one in e.estimators:
        assert one.status[4] == "unidentifiable", one.estimator
        assert np.isnan(one.delay[4]) and not one.at_bound[4]
        assert sum(one.answered) == 11, one.estimator


def test_without_a_logged_outflow_there_is_no_direct_approach():
    e = estimate(without_outflow(year()))
    assert "direct" not in (names := [one.estimator for one in e.estimators]) and "indirect" in names


def test_settings_are_those_of_the_configuration():
    y = year()
    j = y.config.jmap.model_copy(update={"order": 24, "d_max": 12, "sigma_d": 5.0, "alpha": 300.0})
    e = estimate(dataclasses.replace(y, config=y.config.model_copy(update={"jmap": j})))
    assert e.of("jmap").fir.shape == (12, 24)
    assert e.delay_scale == 5.0
    for name in ("direct", "indirect", "jmap-uniform", "jmap-uniform-estimated", "jmap"):
        assert e.of(name).candidates.tolist() == list(range(1, 13))


# Cascade


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("held", [0.5, 0.9, 1.0])
def test_no_other_interval_that_holds_as_many_days_is_shorter(seed, held):
    rng = np.random.default_rng(seed)
    d = rng.integers(1, 16, rng.integers(1, 60)).astype(float)
    low, high = shortest(d, held)

    def share(a, b):
        return np.mean((d >= a) & (d <= b))

    assert share(low, high) >= held - 1e-12
    enough = [b - a for a in range(1, 16) for b in range(a, 16) if share(a, b) >= held - 1e-12]
    assert high - low == min(enough)


def test_days_without_an_answer_do_not_count():
    assert shortest(np.array([np.nan, 6.0, 6.0, np.nan])) == (6, 6)
    assert shortest(np.full(3, np.nan)) == (0, 0)


def test_a_reach_of_the_cascade_has_the_delays_of_the_uniform_prior_with_fixed_alpha():
    s = season()
    expected = jmap(s.inflow - s.inflow[:, :1], s.level - s.level[:, :1], prior="uniform", alpha=1e4).delay
    r = of_year(year(), s.delay.astype(float))
    assert np.array_equal(r.delay, expected) and np.array_equal(r.truth, s.delay)
    assert r.empirical == (5, 11) and r.nominal == 8
