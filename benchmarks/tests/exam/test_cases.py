"""The cases: all effects at all sizes, seeds apart, windows on the blocks they are meant for."""

import datetime as dt
from collections import Counter

import numpy as np
import pytest

from benchmarks.exam.cases import (
    FIRST_SEED,
    QUICK,
    SIZE_OF,
    Case,
    cases,
    resized,
    sizes,
    tasks,
)
from benchmarks.exam.planting import SCENARIOS, configured, scenario_of
from benchmarks.exam.rows import ROWS
from rivid.diagnosis.blocks import split
from rivid.effects import CATALOGUE
from rivid.simulation.scenario import load_scenario

BY_NAME = {case.name: case for case in cases()}


def test_every_effect_of_the_catalogue_is_asked_at_each_size():
    assert set(SIZE_OF) == set(CATALOGUE) == set(sizes())
    for name in CATALOGUE:
        assert all(f"one/{name}/{size}" in BY_NAME for size in ("planted", "x1", "x2", "x4"))


def test_every_case_has_a_row_and_a_name_of_its_own():
    names = Counter(case.name for case in cases())
    assert max(names.values()) == 1
    assert {case.row for case in cases()} == {row.key for row in ROWS}
    assert set(QUICK) <= set(names)


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_every_scenario_is_there_and_plants_what_is_expected(case):
    planted = {effect.name for effect in scenario_of(case).planted()}
    if case.expected:
        assert planted and planted <= set(case.expected)
    assert set(case.without) <= planted
    if case.then is not None:
        other = load_scenario(SCENARIOS / f"{case.then}.toml")
        assert other.model_dump(exclude={"name", "operators"}) == scenario_of(case).model_dump(
            exclude={"name", "operators"}
        )


@pytest.mark.parametrize("name", sorted(SIZE_OF))
def test_a_size_is_so_many_times_what_power_needs(name):
    key = SIZE_OF[name][0]
    values = [
        float(np.max(scenario_of(BY_NAME[f"one/{name}/{size}"]).effects[0][key]))
        for size in ("x1", "x2", "x4")
    ]
    expected = sizes()[name] * (
        1.0 / np.array([1, 2, 4]) if name == "gate_rate_limit" else np.array([1, 2, 4])
    )
    np.testing.assert_allclose(values, expected, rtol=1e-9)


def test_a_larger_effect_keeps_its_other_parameters():
    table = {"name": "unlogged_upstream_release", "size": [12.0, 18.0], "hours": [22, 6]}
    assert resized(table, 0.5) == table | {"size": [6.0, 9.0]}
    assert table["size"] == [12.0, 18.0]


@pytest.mark.parametrize(("name", "roles"), [("fitted_days", {0}), ("open_days", {0, 1})])
def test_days_of_effects_that_must_not_hold_are_those_of_their_roles(name, roles):
    scenario = load_scenario(SCENARIOS / "exam" / f"{name}.toml")
    dates = [scenario.first_day + dt.timedelta(days=k) for k in range(scenario.days)]
    on = [any(e.dates[0] <= d <= e.dates[1] for e in scenario.planted()) for d in dates]
    assert on == [int(role) in roles for role in split(dates).role]


def test_the_configuration_says_nothing_of_what_was_planted():
    said = configured(scenario_of(BY_NAME["one/clock_offset/planted"]))
    assert set(said) == {"reach", "diagnose"}
    assert said["reach"]["name"] == "reach" and said["diagnose"] == {"exclude": []}


def test_wherever_it_is_stopped_all_rows_have_their_share():
    todo = tasks()
    totals = Counter(case.row for case, _ in todo)
    half = Counter(case.row for case, _ in todo[: len(todo) // 2])
    assert all(abs(half[row] / n - 0.5) < 0.2 for row, n in totals.items() if n >= 10)
    assert min(seed for _, seed in todo) == FIRST_SEED


def test_only_takes_names_and_rows():
    assert {case.row for case, _ in tasks(["people"])} == {"people"}
    assert {case.name for case, _ in tasks(["one/seiche"])} == {
        f"one/seiche/{s}" for s in ("planted", "x1", "x2", "x4")
    }
    assert len(tasks(quick=True)) == len(QUICK)
    assert Case("a", "b", "uneven", 3).sized({"name": "leakage", "loss": 2.0}) == {
        "name": "leakage",
        "loss": 2.0,
    }
