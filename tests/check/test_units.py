"""Test that columns in another unit, and open balances, are found with their factor and their days."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

from rivid.check import check_days
from rivid.config import Config, parse
from tests.check.season import CFS, NAMES, noisy, scaled, sound, the_one

FOOT = 0.3048


def three_weeks():
    days, config = sound()
    return days[:20], config


def configured(config, section, **keys):
    """Return a configuration with keys of a section changed."""
    return config.model_copy(update={section: getattr(config, section).model_copy(update=keys)})


@pytest.mark.parametrize("n", [1, 8])
@pytest.mark.parametrize(
    ("column", "factor", "code", "unit"),
    [
        ("inflow", CFS, "unit.factor", "cfs"),
        ("inflow", 1000, "unit.factor", "L/s"),
        ("outflow", 3600, "unit.factor", "m3/h"),
        ("outflow", 1 / CFS, "unit.twice", "cfs"),
        ("output", 100, "unit.level", "cm"),
        ("output", 1 / FOOT, "unit.level", "ft"),
    ],
)
def test_a_column_in_another_unit(column, factor, code, unit, n):
    days, config = three_weeks()
    finding = the_one(scaled(days[:n], factor, column), config, code, unit=unit)
    assert not finding.days
    if column != "output":
        assert finding.values["large" if factor > 1 else "small"] == NAMES[column]
        assert finding.values["ratio"] == approx(max(factor, 1 / factor), rel=0.15)


def test_a_unit_that_changes_on_a_date():
    days, config = three_weeks()
    for column in ("inflow", "outflow"):
        some = slice(12, 14)
        the_one(scaled(days, CFS, column, among=some), config, "unit.factor", when=some, unit="cfs")
    some = slice(14, None)
    feet = scaled(days, 1 / FOOT, "output", among=some)
    the_one(feet, config, "unit.level_days", when=some, unit="ft", ratio=approx(3.28, abs=0.01))


def test_both_flows_in_another_unit_are_found_by_their_range_or_by_the_level():
    days, config = sound()
    wrong = scaled(days, CFS, "inflow", "outflow")
    values = the_one(wrong, config, "unit.range_unit", low=100, high=800, unit="cfs").values
    assert [flow["column"] for flow in values["flows"]] == ["u_Qi", "u_Qo"]
    the_one(wrong, configured(config, "reach", discharge_range=(100, 5000)), "unit.flows", unit="cfs")


@pytest.mark.parametrize(
    ("first", "area"), [(17, True), pytest.param(11, True, marks=pytest.mark.long), (6, True), (11, False)]
)
def test_both_flows_in_another_unit_from_a_date_on_are_found_by_the_level(first, area):
    days, config = three_weeks()
    some = slice(first, None)
    wrong = noisy(scaled(days, 1000, "inflow", "outflow", among=some), 0.025)
    finding = the_one(wrong, config if area else Config(), "unit.flows_days", when=some, unit="L/s")
    assert finding.values["ratio"] == approx(1000, rel=0.3)


def test_all_units_that_fit_are_listed_with_all_days():
    days, config = sound()
    text = str(the_one(scaled(days, CFS, "inflow", "outflow"), config, "unit.range_unit"))
    assert text.startswith("the median of") and '("cfs" would give' in text and "ML/d would fit, too" in text


@pytest.mark.parametrize(
    "other", [lambda h: 0.0 * h + 118.5 + 0.001 * np.sin(np.arange(len(h))), lambda h: h[::-1]]
)
def test_a_level_of_another_pool_does_not_follow_the_flows(other):
    days, config = three_weeks()
    declared = configured(config, "reach", surface_area=config.reach.surface_area / 10)
    foreign = [replace(day, output=other(day.output)) for day in days]
    assert "balance.level" in {finding.code for finding in check_days(foreign, declared)}
    assert "balance.level" not in {finding.code for finding in check_days(days, config)}


def test_a_canal_that_is_filled_from_a_date_on_has_the_same_unit():
    days, config = three_weeks()
    few = slice(0, 10)
    small = [replace(day, output=130 + (day.output - 130) / 30) for day in days[few]]
    found = check_days([*scaled(small, 1 / 30, "inflow", "outflow"), *days[10:]], config)
    assert "unit" not in {finding.kind for finding in found}


@pytest.mark.parametrize("first", [15, 5])
def test_flows_without_a_level_that_is_explained_are_found_by_their_range_with_dates(first):
    days, config = three_weeks()
    some = slice(first, None)
    pool = [replace(day, outflow=None) for day in scaled(days, 1000, "inflow", among=some)]
    finding = the_one(pool, config, "unit.range_unit", when=some, unit="L/s")
    assert finding.values["flows"][0]["converted"] == approx(300, rel=0.5)


def test_a_declared_unit_that_does_not_fit():
    days, config = three_weeks()
    declared = configured(config, "input", units={"u_Qi": "cfs"})
    wrong = scaled(days, 1 / CFS, "inflow")
    the_one(wrong, declared, "unit.declared", small="u_Qi", unit="m3/s", declared="cfs")
    declared = configured(config, "input", units={"h_L": "ft"})
    the_one(scaled(days, FOOT, "output"), declared, "unit.level", unit="m", declared="ft")


def test_without_a_declared_area_only_large_factors_are_found():
    days, _ = three_weeks()
    assert check_days(scaled(days, 1 / FOOT, "output"), Config()) == []
    the_one(scaled(days, 100, "output"), Config(), "unit.level", unit="cm", is_declared=False)


def test_an_area_or_a_bed_level_that_does_not_fit():
    days, config = three_weeks()
    area = configured(config, "reach", surface_area=6.7e6, length=82_000)
    the_one(days, area, "balance.area", fitting_area=approx(6.7e5, rel=0.1))
    the_one(days, configured(config, "reach", bed_level=424.0), "unit.bed", bed=424)


def test_a_length_ten_times_too_short_is_found_by_the_area():
    days, config = sound(scenario="hydraulic")  # its lags are shorter than those of a wave over 820 m
    short = configured(config, "reach", length=820)
    the_one(days, short, "reach.area", product=approx(820 * 81.6), area=approx(6.7e5))
    keys = config.reach.model_dump(exclude={"surface_area"}, exclude_unset=True)
    alone = parse({"reach": keys | {"length": 820}}, Config)
    the_one(days, alone, "balance.area", area_of="length x width", fitting_area=approx(6.0e5, rel=0.2))


def test_a_missing_part_of_the_outflow_is_found_over_weeks_and_not_on_a_single_day():
    days, config = three_weeks()
    some = slice(6, 13)
    the_one(scaled(days, 0.5, "outflow", among=some), config, "balance.flows", when=some, small="u_Qo")
    assert check_days(scaled(days, 0.5, "outflow", among=slice(10, 11)), config) == []


def test_a_reservoir_that_fills_closes_its_balance():
    days, config = sound(10)
    area = 5e7
    level, filled = 130.0, []
    for day in days:
        kept = np.cumsum(day.inflow - day.outflow / 2) * 133 / area
        filled.append(type(day)(day.date, day.inflow, day.outflow / 2, level + kept, 0, ""))
        level += kept[-1]
    assert check_days(filled, configured(config, "reach", surface_area=area, width=area / 8200)) == []


def test_flows_outside_the_discharge_range_are_a_remark():
    days, config = sound(5)
    narrow = configured(config, "reach", discharge_range=(600, 800))
    values = the_one(days, narrow, "range", wrong=False, column="u_Qi").values
    assert 0.25 < values["share"] <= 1 and values["lowest"] < 600
