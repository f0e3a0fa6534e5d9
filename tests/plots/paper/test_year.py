"""The logs behind the paper's figures."""

import json

import numpy as np
import pytest

from rivid.core.hydraulics import travel_bounds
from rivid.errors import ConfigError, NoDataError, RividError
from rivid.plots.paper.year import read_run, year_of
from tests.plots.paper.years import cut, season, still, without_outflow, year


def test_days_of_each_length_come_together_and_none_is_lost():
    y = cut(year(), 3, 27)
    groups = list(y.groups(30))
    assert sorted(len(days) for days, *_ in groups) == [1, 11]
    assert sorted(int(i) for days, *_ in groups for i in days) == list(range(12))
    for days, inflow, outflow, level in groups:
        for row, i in enumerate(days):
            assert np.array_equal(inflow[row], y.inflow[i]) and np.array_equal(level[row], y.level[i])
            assert np.array_equal(outflow[row], y.outflow[i])


def test_days_too_short_for_the_estimator_are_left_out_of_the_groups():
    assert [len(days) for days, *_ in cut(year(), 0, 640).groups(30)] == [11]


def test_an_inflow_that_hardly_moves_is_held_still_as_in_a_run():
    y = year()
    inflow = [u.copy() for u in y.inflow]
    inflow[2] = inflow[2][0] + 1e-6 * np.sin(np.arange(len(inflow[2])))
    (_, u, _, _) = next(still(y).groups(30))
    assert np.ptp(u, axis=1).min() > 1
    import dataclasses

    (_, u, _, _) = next(dataclasses.replace(y, inflow=tuple(inflow)).groups(30))
    assert np.ptp(u[2]) == 0


def test_the_discharge_is_that_of_the_downstream_dam_where_it_is_logged():
    y = year()
    assert y.discharge == pytest.approx([o.mean() for o in y.outflow])
    assert without_outflow(y).discharge == pytest.approx([u.mean() for u in y.inflow])


def test_the_bounds_take_the_depth_from_the_level_where_the_bed_is_known():
    y = year()
    reach = y.config.reach
    shape = {"length": reach.length, "width": reach.width}
    assert y.bounds.gravity == pytest.approx(travel_bounds(y.discharge, **shape, depth=reach.depth).gravity)
    import dataclasses

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


def test_a_directory_without_a_run_is_named(tmp_path):
    with pytest.raises(NoDataError, match="holds no finished run"):
        read_run(tmp_path)


def test_a_record_that_is_no_record_is_named(tmp_path):
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(RividError, match="run.json cannot be read"):
        read_run(tmp_path)


def test_logs_that_have_moved_are_asked_for(tmp_path):
    record = {"config": {}, "data_dir": str(tmp_path / "gone")}
    (tmp_path / "run.json").write_text(json.dumps(record))
    with pytest.raises(NoDataError, match="--logs DATA_DIR"):
        read_run(tmp_path)


def test_a_river_has_no_such_figures(tmp_path):
    record = {"config": {"reach": {"kind": "river"}}, "data_dir": str(tmp_path)}
    (tmp_path / "run.json").write_text(json.dumps(record))
    with pytest.raises(ConfigError, match="a river has none"):
        read_run(tmp_path)
