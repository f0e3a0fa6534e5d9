"""Test that clock errors and exchanged columns are found with the column, the offset and the days."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.check import check_days
from rivid.config import Config, parse
from tests.check.season import NAMES, late, noisy, redated, sound, the_one

LEVEL_DRIFT, LEVEL_DATES = (pytest.param("output", by, marks=pytest.mark.long) for by in (60, 1))


@pytest.mark.parametrize(("column", "seconds"), [("inflow", 3600), ("outflow", -3600), ("output", 3600)])
def test_a_clock_that_is_an_hour_off_from_a_date_on(column, seconds):
    days, config = sound()
    finding = the_one(
        late(days, seconds, column, among=slice(25, None)), config, "clock.hour", column=NAMES[column],
        sense="late" if seconds > 0 else "early", off_s=pytest.approx(3600, abs=300),
    )  # fmt: skip
    assert len(finding.days) >= 13 and set(finding.days) <= {day.date for day in days[25:]}


@pytest.mark.parametrize(
    ("column", "seconds", "n", "code", "values"),
    [
        ("inflow", 3600, 20, "clock.before", {}),
        ("inflow", -3600, 3, "clock.slow", {"longest_s": pytest.approx(35 * 60, abs=60)}),
        ("outflow", 3600, 3, "clock.gate", {"column": "u_Qo", "speed": "fast"}),
        ("output", -3600, 20, "clock.gate", {"column": "h_L", "speed": "slow"}),
    ],
)
def test_a_clock_that_is_an_hour_off_on_every_day_gives_impossible_lags(column, seconds, n, code, values):
    days, config = sound()
    the_one(late(days[:n], seconds, column), config, code, **values)


def test_a_length_that_is_ten_times_too_short_gives_impossible_lags():
    days, config = sound()
    reach = config.reach.model_dump(exclude={"surface_area"}, exclude_unset=True)
    short = {"reach": reach | {"length": config.reach.length / 10}}
    the_one(days[:3], parse(short, Config), "clock.slow", length=config.reach.length / 10)


@pytest.mark.parametrize(("column", "per_day"), [("inflow", 60), ("outflow", -90), LEVEL_DRIFT])
def test_a_clock_that_drifts(column, per_day):
    days, config = sound()
    the_one(
        late(days, 0, column, per_day=per_day), config, "drift", column=NAMES[column],
        speed="fast" if per_day > 0 else "slow", per_day_s=pytest.approx(abs(per_day), abs=5),
    )  # fmt: skip


@pytest.mark.parametrize(("column", "by"), [("inflow", 1), ("outflow", -1), LEVEL_DATES])
def test_dates_that_are_a_day_off(column, by):
    days, config = sound(30)
    wrong = redated(days, by, column, among=slice(10, 25))
    finding = the_one(wrong, config, "dates", column=NAMES[column], sense="late" if by > 0 else "early")
    # a day with a shifted neighbour may match both states
    assert set(finding.days) <= {day.date for day in days[9:26]} and len(finding.days) >= 12


def test_dates_and_clocks_are_found_by_a_gauge_that_explains_a_third_of_its_moves():
    days, config = sound(30)
    wrong = redated(noisy(days, 0.027), 1, "inflow", slice(12, None))
    finding = the_one(wrong, config, "dates", column="u_Qi", sense="late")
    assert {day.date for day in days[13:29]} <= set(finding.days) <= {day.date for day in days[11:]}
    wrong = late(noisy(days, 0.02), 3600, "inflow", among=slice(12, None))
    finding = the_one(wrong, config, "clock.hour", column="u_Qi", sense="late")
    assert {day.date for day in days[13:]} <= set(finding.days) <= {day.date for day in days[12:]}


def test_exchanged_or_inverted_columns_from_a_date_on_or_always():
    days, config = sound(20)
    swapped = [replace(day, inflow=day.outflow, outflow=day.inflow) for day in days]
    assert not the_one(swapped, config, "swapped.flows").days
    the_one(swapped[:1], config, "swapped.flows")
    the_one([*days[:10], *swapped[10:]], config, "swapped.flows", when=slice(10, None))
    the_one([replace(day, output=200.0 - day.output) for day in days], config, "swapped.level")


@pytest.mark.parametrize("n", [1, 5])
def test_a_constant_inflow_is_not_exchanged_with_the_outflow(n):
    days, config = sound(5)
    still = [replace(day, inflow=np.full_like(day.inflow, 300.0)) for day in days[:n]]
    assert {finding.kind for finding in check_days(still, config)} == {"constant"}


def test_a_river_with_exchanged_ends_or_a_clock_that_is_an_hour_off_from_a_date_on():
    """Use an inflow with a daily peak, routed through eight reservoirs of half an hour each."""
    n, rng = 40, np.random.default_rng(5)
    inflow = (
        300 + 80 * np.sin(2 * np.pi * np.arange(96 * n) / 96) + np.repeat(40 * rng.normal(size=8 * n), 12)
    )
    out = inflow
    for _ in range(8):
        stored, stage = out[0], np.empty_like(out)
        for k, x in enumerate(out):
            stored += 0.4 * (x - stored)
            stage[k] = stored
        out = stage
    out = (out + rng.normal(size=len(out))).round(1).reshape(n, 96)
    inflow = inflow.round().reshape(n, 96)
    days = [
        replace(day, inflow=i, outflow=None, output=o)
        for day, i, o in zip(sound(n)[0], inflow, out, strict=True)
    ]
    reach = {"kind": "river", "length": 30000, "width": 90, "depth": 2.5, "sample_time": 900}
    config = parse({"reach": reach | {"discharge_range": [150, 500]}}, Config)
    assert check_days(days, config) == []
    the_one([replace(day, inflow=day.output, output=day.inflow) for day in days], config, "clock.before")
    shifted = late(days, 3600, "output", step=900, among=slice(25, None))
    finding = the_one(shifted, config, "clock.hour", column="u_Qi", off_s=3600, sense="early")
    assert set(finding.days) <= {day.date for day in days[25:]} and len(finding.days) >= 12
