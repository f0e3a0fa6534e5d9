"""Clocks that are off, and columns that are exchanged, are found with the column, the offset and the days."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.check import check_days
from rivid.config import Config, parse
from tests.check.season import drifting, late, redated, sound

NAMES = {"inflow": "u_Qi", "outflow": "u_Qo", "output": "h_L"}


def the_one(days, config, code):
    # where dates are shifted, one day occurs twice
    (finding,) = (found for found in check_days(days, config) if found.kind != "copy")
    assert finding.code == code and finding.wrong
    return finding


@pytest.mark.parametrize("scenario", ["basse_isere", "uneven"])
@pytest.mark.parametrize("seconds", [3600, -3600])
@pytest.mark.parametrize("column", NAMES)
def test_a_clock_that_is_an_hour_off_from_a_date_on(column, seconds, scenario):
    days, config = sound(40, scenario)
    finding = the_one(late(days, seconds, column, among=slice(25, None)), config, "clock.hour")
    assert finding.values["column"] == NAMES[column]
    assert finding.values["sense"] == ("late" if seconds > 0 else "early")
    assert finding.values["off_s"] == pytest.approx(3600, abs=300)
    assert len(finding.days) >= 13 and set(finding.days) <= {day.date for day in days[25:]}


@pytest.mark.parametrize("n", [3, 40])
@pytest.mark.parametrize("column", NAMES)
def test_a_clock_that_is_an_hour_off_on_every_day_gives_impossible_lags(column, n):
    days, config = sound()
    for seconds in (3600, -3600):
        code = "clock.gate" if column != "inflow" else "clock.before" if seconds > 0 else "clock.slow"
        values = the_one(late(days[:n], seconds, column), config, code).values
        if column != "inflow":
            assert values["column"] == NAMES[column]
            assert values["speed"] == ("fast" if seconds > 0 else "slow")
        elif seconds < 0:
            assert values["longest_s"] == pytest.approx(35 * 60, abs=60)


@pytest.mark.parametrize("per_day", [60, -90])
@pytest.mark.parametrize("column", NAMES)
def test_a_clock_that_drifts(column, per_day):
    days, config = sound()
    values = the_one(drifting(days, per_day, column), config, "drift").values
    assert (values["column"], values["speed"]) == (NAMES[column], "fast" if per_day > 0 else "slow")
    assert values["per_day_s"] == pytest.approx(abs(per_day), abs=5)


@pytest.mark.parametrize("by", [1, -1])
@pytest.mark.parametrize("column", NAMES)
def test_dates_that_are_a_day_off(column, by):
    days, config = sound()
    finding = the_one(redated(days, by, column, among=slice(10, 25)), config, "dates")
    assert finding.values["column"] == NAMES[column]
    assert finding.values["sense"] == ("late" if by > 0 else "early")
    # a day with a shifted neighbour may fit either way
    assert set(finding.days) <= {day.date for day in days[9:26]} and len(finding.days) >= 12


def test_exchanged_columns_from_a_date_on_or_always():
    days, config = sound()
    swapped = [replace(day, inflow=day.outflow, outflow=day.inflow) for day in days]
    assert not the_one(swapped, config, "swapped.flows").days
    the_one(swapped[:1], config, "swapped.flows")
    finding = the_one([*days[:30], *swapped[30:]], config, "swapped.flows")
    assert list(finding.days) == [day.date for day in days[30:]]


def test_a_level_that_is_measured_downwards():
    days, config = sound()
    the_one([replace(day, output=200.0 - day.output) for day in days], config, "swapped.level")


@pytest.mark.parametrize("n", [1, 5])
def test_a_constant_inflow_is_not_exchanged_with_the_outflow(n):
    days, config = sound()
    still = [replace(day, inflow=np.full_like(day.inflow, 300.0)) for day in days[:n]]
    assert {finding.kind for finding in check_days(still, config)} == {"constant"}


def test_a_river_with_exchanged_ends():
    days, config = river()
    assert check_days(days, config) == []
    swapped = [replace(day, inflow=day.output, output=day.inflow) for day in days]
    the_one(swapped, config, "clock.before")


def test_a_river_clock_that_is_an_hour_off_from_a_date_on():
    days, config = river()
    finding = the_one(late(days, 3600, "output", step=900, among=slice(25, None)), config, "clock.hour")
    values = finding.values
    assert (values["column"], values["off_s"], values["sense"]) == ("u_Qi", 3600, "early")
    assert set(finding.days) <= {day.date for day in days[25:]} and len(finding.days) >= 12


def river(n=40):
    """Days of a river: an inflow with a daily peak, routed through eight reservoirs of half an hour each."""
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
