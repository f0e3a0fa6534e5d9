"""Clocks that are off, and columns that are swapped, are named with the column, how much, and when."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.check.look import look
from rivid.config import Config, parse
from tests.check.season import drifting, late, redated, sound

NAMES = {"inflow": "u_Qi", "outflow": "u_Qo", "output": "h_L"}


def the_one(days, config, kind):
    # where dates are shifted, one day stands there twice
    (finding,) = (found for found in look(days, config) if found.kind != "copy")
    assert finding.kind == kind and finding.wrong
    return finding


@pytest.mark.parametrize("scenario", ["basse_isere", "uneven"])
@pytest.mark.parametrize("seconds", [3600, -3600])
@pytest.mark.parametrize("column", NAMES)
def test_an_hour_from_a_date_on(column, seconds, scenario):
    days, config = sound(40, scenario)
    finding = the_one(late(days, seconds, column, among=slice(25, None)), config, "clock")
    assert f"{NAMES[column]} is stamped " in finding.text
    assert f"min too {'late' if seconds > 0 else 'early'} against the others" in finding.text
    assert 55 <= int(finding.text.split(" is stamped ")[1].split()[0]) <= 65
    assert "summer time" in finding.text
    told = set(finding.days)
    assert len(told) >= 13 and told <= {day.date for day in days[25:]}


@pytest.mark.parametrize("n", [3, 40])
@pytest.mark.parametrize("column", NAMES)
def test_an_hour_on_every_day_is_told_by_what_no_water_does(column, n):
    days, config = sound()
    for seconds in (3600, -3600):
        said = the_one(late(days[:n], seconds, column), config, "clock").text
        if column == "inflow":
            assert ("before u_Qi" if seconds > 0 else "where a wave needs 35 min at most") in said
        else:
            assert (
                "though the gauge stands at the gate" in said and f"is the clock of {NAMES[column]}" in said
            )
            assert ("min fast?" if seconds > 0 else "min slow?") in said


@pytest.mark.parametrize("per_day", [60, -90])
@pytest.mark.parametrize("column", NAMES)
def test_a_clock_that_drifts(column, per_day):
    days, config = sound()
    said = the_one(drifting(days, per_day, column), config, "drift").text
    assert f"the clock of {NAMES[column]} goes {'fast' if per_day > 0 else 'slow'}" in said
    assert abs(int(said.split(" s a day")[0].split()[-1]) - abs(per_day)) <= 5


@pytest.mark.parametrize("by", [1, -1])
@pytest.mark.parametrize("column", NAMES)
def test_dates_that_are_a_day_off(column, by):
    days, config = sound()
    finding = the_one(redated(days, by, column, among=slice(10, 25)), config, "dates")
    assert f"the dates of {NAMES[column]} are a day too {'late' if by > 0 else 'early'}" in finding.text
    # a day whose neighbour is shifted too may be as good either way
    assert set(finding.days) <= {day.date for day in days[9:26]} and len(finding.days) >= 12


def test_swapped_columns_from_a_date_on_or_always():
    days, config = sound()
    swapped = [replace(day, inflow=day.outflow, outflow=day.inflow) for day in days]
    finding = the_one(swapped, config, "swapped")
    assert "are inflow and outflow swapped?" in finding.text and not finding.days
    assert "are inflow and outflow swapped?" in the_one(swapped[:1], config, "swapped").text
    finding = the_one([*days[:30], *swapped[30:]], config, "swapped")
    assert list(finding.days) == [day.date for day in days[30:]]


def test_a_level_that_is_measured_downwards():
    days, config = sound()
    downwards = [replace(day, output=200.0 - day.output) for day in days]
    assert "is it measured downwards" in the_one(downwards, config, "swapped").text


def test_a_river_whose_ends_are_swapped():
    """A river as a row of reservoirs: 4 h, fifteen-minute samples."""
    days, config = river()
    assert look(days, config) == []
    swapped = [replace(day, inflow=day.output, output=day.inflow) for day in days]
    assert (
        "h before u_Qi: is u_Qi's clock fast, or are columns swapped?"
        in the_one(swapped, config, "clock").text
    )


def test_an_hour_in_a_river_from_a_date_on():
    days, config = river()
    moved = late(days, 3600, "output", step=900, among=slice(25, None))
    finding = the_one(moved, config, "clock")
    assert "u_Qi is stamped 60 min too early against Q_L" in finding.text
    assert set(finding.days) <= {day.date for day in days[25:]} and len(finding.days) >= 12


def river(n=40):
    """Days of a river: an inflow with a peak each day, routed through eight reservoirs of half an hour."""
    pool, _ = sound(n)
    rng = np.random.default_rng(5)
    t = np.arange(96 * n) / 96
    inflow = 300 + 80 * np.sin(2 * np.pi * t) + np.repeat(40 * rng.normal(size=8 * n), 12)
    out = inflow.copy()
    for _ in range(8):
        stage = np.empty_like(out)
        stored = out[0]
        for k, x in enumerate(out):
            stored += 0.4 * (x - stored)
            stage[k] = stored
        out = stage
    out = out + rng.normal(size=len(out))
    days = [
        replace(day, inflow=inflow[96 * k :][:96].round(), outflow=None, output=out[96 * k :][:96].round(1))
        for k, day in enumerate(pool)
    ]
    reach = {"kind": "river", "length": 30000, "width": 90, "depth": 2.5, "sample_time": 900}
    return days, parse({"reach": reach | {"discharge_range": [150, 500]}}, Config)
