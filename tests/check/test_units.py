"""Columns in another unit, and open balances, are found with their factor and their days."""

import numpy as np
import pytest

from rivid.check import check_days
from rivid.config import Config
from tests.check.season import CFS, scaled, sound

UNITS = {
    ("inflow", CFS): ("unit.factor", "u_Qi", "cfs"),
    ("outflow", CFS): ("unit.factor", "u_Qo", "cfs"),
    ("inflow", 1000): ("unit.factor", "u_Qi", "L/s"),
    ("outflow", 3600): ("unit.factor", "u_Qo", "m3/h"),
    ("inflow", 1 / CFS): ("unit.twice", "u_Qo", "cfs"),
    ("output", 100): ("unit.level", None, "cm"),
    ("output", 1000): ("unit.level", None, "mm"),
    ("output", 1 / 0.3048): ("unit.level", None, "ft"),
}


def the_one(days, config, code):
    (finding,) = check_days(days, config)
    assert finding.code == code and finding.wrong
    return finding


def changed(config, section, **keys):
    """A configuration with keys of a section changed."""
    return config.model_copy(update={section: getattr(config, section).model_copy(update=keys)})


@pytest.mark.parametrize("n", [1, 7, 40])
@pytest.mark.parametrize(("column", "factor"), UNITS)
def test_a_column_in_another_unit(column, factor, n):
    days, config = sound()
    code, large, unit = UNITS[column, factor]
    finding = the_one(scaled(days[:n], factor, column), config, code)
    assert not finding.days
    assert (finding.values.get("large"), finding.values["unit"]) == (large, unit)
    if large:
        assert finding.values["ratio"] == pytest.approx(max(factor, 1 / factor), rel=0.15)


@pytest.mark.parametrize("scenario", ["uneven", "short", "hydraulic_long"])
@pytest.mark.parametrize("factor", [100, 1 / 0.3048])
def test_the_unit_of_the_level_in_other_reaches(scenario, factor):
    days, config = sound(20, scenario)
    the_one(scaled(days, factor, "output"), config, "unit.level")


def test_a_unit_that_changes_on_a_date():
    days, config = sound()
    for column in ("inflow", "outflow"):
        finding = the_one(scaled(days, CFS, column, among=slice(25, 27)), config, "unit.factor")
        assert list(finding.days) == [days[25].date, days[26].date] and finding.values["unit"] == "cfs"
    finding = the_one(scaled(days, 1 / 0.3048, "output", among=slice(30, None)), config, "unit.level_days")
    assert list(finding.days) == [day.date for day in days[30:]]
    assert finding.values["unit"] == "ft" and finding.values["ratio"] == pytest.approx(3.28, abs=0.01)


def test_both_flows_in_another_unit_are_found_by_their_range_or_by_the_level():
    days, config = sound()
    values = the_one(scaled(days, CFS, "inflow", "outflow"), config, "unit.range_unit").values
    assert (values["low"], values["high"], values["unit"]) == (100, 800, "cfs")
    assert [flow["column"] for flow in values["flows"]] == ["u_Qi", "u_Qo"]
    wide = changed(config, "reach", discharge_range=(100, 5000))
    values = the_one(scaled(days, CFS, "inflow", "outflow"), wide, "unit.flows").values
    assert values["unit"] == "cfs"


def test_a_declared_unit_that_does_not_fit():
    days, config = sound()
    declared = changed(config, "input", units={"u_Qi": "cfs"})
    values = the_one(scaled(days, 1 / CFS, "inflow"), declared, "unit.declared").values
    assert (values["small"], values["unit"], values["declared"]) == ("u_Qi", "m3/s", "cfs")
    declared = changed(config, "input", units={"h_L": "ft"})
    values = the_one(scaled(days, 0.3048, "output"), declared, "unit.level").values
    assert (values["unit"], values["declared"]) == ("m", "ft")


def test_without_a_declared_area_only_large_factors_are_found():
    days, _ = sound()
    assert check_days(scaled(days, 1 / 0.3048, "output"), Config()) == []
    values = the_one(scaled(days, 100, "output"), Config(), "unit.level").values
    assert values["unit"] == "cm" and not values["is_declared"]


def test_an_area_that_does_not_fit():
    days, config = sound()
    values = the_one(days, changed(config, "reach", surface_area=6.7e6), "balance.area").values
    assert values["fitting_area"] == pytest.approx(6.7e5, rel=0.1)


def test_a_missing_part_of_the_outflow_is_found_over_weeks_and_not_on_a_single_day():
    days, config = sound()
    finding = the_one(scaled(days, 0.5, "outflow", among=slice(10, 20)), config, "balance.flows")
    assert finding.values["small"] == "u_Qo" and list(finding.days) == [day.date for day in days[10:20]]
    assert check_days(scaled(days, 0.5, "outflow", among=slice(10, 11)), config) == []


def test_a_reservoir_that_fills_closes_its_balance():
    days, config = sound(10)
    area = 5e7
    level, filled = 130.0, []
    for day in days:
        kept = np.cumsum(day.inflow - day.outflow / 2) * 133 / area
        filled.append(type(day)(day.date, day.inflow, day.outflow / 2, level + kept, 0, ""))
        level += kept[-1]
    assert check_days(filled, changed(config, "reach", surface_area=area)) == []


def test_a_level_below_the_bed():
    days, config = sound()
    assert the_one(days, changed(config, "reach", bed_level=424.0), "unit.bed").values["bed"] == 424


def test_flows_outside_the_discharge_range_are_a_remark():
    days, config = sound(5)
    findings = check_days(days, changed(config, "reach", discharge_range=(600, 800)))
    assert {finding.code for finding in findings} == {"range"} and not any(f.wrong for f in findings)
    values = findings[0].values
    assert values["column"] == "u_Qi" and 0.25 < values["share"] <= 1 and values["lowest"] < 600
