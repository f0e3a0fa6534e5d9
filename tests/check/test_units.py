"""Columns in another unit, and balances that do not close, are named with their factor and their dates."""

import re

import numpy as np
import pytest

from rivid.check.look import look
from rivid.config import Config
from tests.check.season import CFS, scaled, sound

WORDS = {
    ("inflow", CFS): r'u_Qi is 3[56].* times u_Qo, and 1 m3/s is 35.3 cfs: is u_Qi in cfs\? .* u_Qi = "cfs"',
    ("outflow", CFS): r"u_Qo is 3[456].* times u_Qi, and 1 m3/s is 35.3 cfs: is u_Qo in cfs\?",
    ("inflow", 1000): r"u_Qi is (1,0|1,1|9).* times u_Qo, and 1 m3/s is 1,000 L/s: is u_Qi in L/s\?",
    ("outflow", 3600): r"1 m3/s is 3,600 m3/h: is u_Qo in m3/h\?",
    ("inflow", 1 / CFS): r"u_Qo is 3[456].* times u_Qi, as if u_Qi had been converted from cfs twice",
    ("output", 100): r'h_L moves .* times as much as u_Qi and u_Qo let it .* is h_L in cm, .*h_L = "cm"',
    ("output", 1000): r"is h_L in mm, not in m\?",
    ("output", 1 / 0.3048): r"is h_L in ft, not in m\?",
}


def the_one(findings):
    (finding,) = findings
    assert finding.wrong
    return finding


@pytest.mark.parametrize("n", [1, 7, 40])
@pytest.mark.parametrize(("column", "factor"), WORDS)
def test_a_column_in_another_unit_is_named_with_unit_and_factor(column, factor, n):
    days, config = sound()
    finding = the_one(look(scaled(days[:n], factor, column), config))
    assert finding.kind == "unit" and not finding.days
    assert re.search(WORDS[column, factor], finding.text), finding.text


@pytest.mark.parametrize("scenario", ["uneven", "short", "hydraulic_long"])
@pytest.mark.parametrize("factor", [100, 1 / 0.3048])
def test_the_levels_unit_is_told_in_other_reaches_too(scenario, factor):
    days, config = sound(20, scenario)
    assert "is h_L in" in the_one(look(scaled(days, factor, "output"), config)).text


def test_a_unit_that_changes_on_a_date_is_told_with_its_dates():
    days, config = sound()
    for column in ("inflow", "outflow"):
        finding = the_one(look(scaled(days, CFS, column, among=slice(25, 27)), config))
        assert list(finding.days) == [days[25].date, days[26].date] and "in cfs" in finding.text
    finding = the_one(look(scaled(days, 1 / 0.3048, "output", among=slice(30, None)), config))
    assert list(finding.days) == [day.date for day in days[30:]]
    assert "h_L is 3.28 times that of the other days" in finding.text and "in ft there" in finding.text


def test_both_flows_in_another_unit_are_told_by_their_range_or_by_the_level():
    days, config = sound()
    said = the_one(look(scaled(days, CFS, "inflow", "outflow"), config)).text
    assert "far outside [reach] discharge_range, 100 to 800" in said and '"cfs" would make it' in said
    wide = config.model_copy(
        update={"reach": config.reach.model_copy(update={"discharge_range": (100, 5000)})}
    )
    assert "are both flows in cfs?" in the_one(look(scaled(days, CFS, "inflow", "outflow"), wide)).text


def test_a_unit_that_is_declared_and_is_not_so():
    days, config = sound()
    declared = config.model_copy(update={"input": config.input.model_copy(update={"units": {"u_Qi": "cfs"}})})
    said = the_one(look(scaled(days, 1 / CFS, "inflow"), declared)).text
    assert "is u_Qi in m3/s, not in cfs as [input.units] says?" in said
    declared = config.model_copy(update={"input": config.input.model_copy(update={"units": {"h_L": "ft"}})})
    assert "is h_L in m, not in ft?" in the_one(look(scaled(days, 0.3048, "output"), declared)).text


def test_without_a_declared_area_only_what_is_far_off_is_told():
    days, _ = sound()
    assert look(scaled(days, 1 / 0.3048, "output"), Config()) == []
    said = the_one(look(scaled(days, 100, "output"), Config())).text
    assert "is h_L in cm" in said and "(not declared: that of Table I)" in said


def test_an_area_that_does_not_fit():
    days, config = sound()
    wrong = config.model_copy(update={"reach": config.reach.model_copy(update={"surface_area": 6.7e6})})
    finding = the_one(look(days, wrong))
    assert finding.kind == "balance" and "m2 would fit" in finding.text
    fits = float(finding.text.split(" m2 would fit")[0].split()[-1])
    assert fits == pytest.approx(6.7e5, rel=0.1)


def test_a_part_of_the_outflow_that_is_missing_for_weeks_is_told_and_a_single_day_is_not():
    days, config = sound()
    finding = the_one(look(scaled(days, 0.5, "outflow", among=slice(10, 20)), config))
    assert finding.kind == "balance" and list(finding.days) == [day.date for day in days[10:20]]
    assert "is a part of u_Qo missing?" in finding.text
    assert look(scaled(days, 0.5, "outflow", among=slice(10, 11)), config) == []


def test_a_reservoir_that_fills_closes_its_balance():
    """Half of the inflow stays; the level says so."""
    days, config = sound(10)
    area = 5e7
    level, filled = 130.0, []
    for day in days:
        kept = np.cumsum(day.inflow - day.outflow / 2) * 133 / area
        filled.append(type(day)(day.date, day.inflow, day.outflow / 2, level + kept, 0, ""))
        level += kept[-1]
    reach = config.reach.model_copy(update={"surface_area": area})
    assert look(filled, config.model_copy(update={"reach": reach})) == []


def test_a_level_below_the_bed():
    days, config = sound()
    reach = type(config.reach)(**config.reach.model_dump() | {"bed_level": 424.0})
    said = the_one(look(days, config.model_copy(update={"reach": reach}))).text
    assert "where [reach] bed_level is 424 m" in said
