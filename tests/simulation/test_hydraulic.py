"""Test seasons of the Saint-Venant reach: programme, arrival of the wave, steady operators, cascades."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.observables import observables
from rivid.errors import ConfigError
from rivid.reach.operators import OperatorSettings, draw_crew, operator_arrays
from rivid.reach.saint_venant import Channel, arrival_time
from rivid.reach.saint_venant import simulate as saint_venant
from rivid.simulation import simulate, simulate_cascade
from rivid.simulation.scenario import Scenario, load_scenario
from rivid.simulation.season import Water

SCENARIOS = Path(__file__).parent.parent.parent / "configs" / "scenarios"
PLAIN = load_scenario(SCENARIOS / "hydraulic.toml")
FEW = PLAIN.model_copy(update={"days": 12, "missing_days": 0})


def changed(scenario, **sections):
    """Return the scenario with some keys of some sections changed."""
    return scenario.model_copy(
        update={name: getattr(scenario, name).model_copy(update=keys) for name, keys in sections.items()}
    )


@pytest.fixture(scope="module")
def year():
    return simulate(PLAIN)


@pytest.mark.long
def test_the_hydraulic_season_has_the_character_and_the_programme_of_the_papers(year):
    linear = simulate(load_scenario(SCENARIOS / "basse_isere.toml"))
    np.testing.assert_array_equal(linear.inflow, year.inflow)
    seen = observables(year)
    assert seen.days == 332 and len(year.seconds) == 650
    assert 90 <= seen.discharge_lowest <= 130 and 700 <= seen.discharge_highest <= 830
    assert 135 <= seen.discharge_range <= 165
    assert 0.25 <= seen.level_range <= 0.42
    assert 1.5e4 <= seen.condition_median <= 3e4
    assert set(seen.delays) == {6, 7, 8}


@pytest.mark.long
def test_the_arrival_of_a_wave_agrees_with_a_simulated_step(year):
    water = Water(PLAIN)
    for i in range(0, 332, 110):
        flow, level = year.inflow[i].mean(), year.true_level[i].mean()
        time = 5.0 * np.arange(700)
        inflow = np.where(time >= 500.0, flow + 1.0, flow)
        step = saint_venant(
            Channel.smooth(8200.0, 81.6, 2e-4, 0.03, 200, end_bed=124.3), time, inflow,
            np.full(700, flow), level, gate_time=0.0,
        )  # fmt: skip
        rate = np.diff(step.level)
        seen = time[np.argmax(rate > 0.5 * rate.max())] + 2.5 - 500.0
        assert seen == pytest.approx(water.arrival(np.array([flow]), np.array([level]))[0], rel=0.03)


def test_arrival_in_a_level_rectangle_is_the_celerity_of_the_paper():
    channel = Channel.smooth(8200.0, 81.6, 0.0, 1e-6, 64)
    for flow in (100.0, 400.0, 800.0):
        celerity = flow / (81.6 * 5.0) + np.sqrt(9.80665 * 5.0)
        assert arrival_time(channel, flow, 5.0)[0] == pytest.approx(8200.0 / celerity, rel=1e-4)


@pytest.mark.parametrize("length", [1500.0, 9000.0, 30000.0])
def test_the_crew_is_steady_on_any_length(length):
    level, flow = 5.2, 500.0
    reach = PLAIN.reach.model_copy(update={"length": length})
    shape = {"slope": 0.5e-4, "bed_level": 0.0}
    at = {"set_point": level, "drawdown": 0.0}
    sections = {"channel": shape, "level": at, "flow": {"highest": flow}}
    water = Water(changed(PLAIN.model_copy(update={"reach": reach}), **sections))
    channel, drop = water.channel, water.drop(1800.0)
    settings = OperatorSettings(
        level_gain=-0.999 / drop, level_gain_spread=0.0, dead_band=0.0, quantum=0.0, set_point_spread=0.0,
        people=1, feedforward_spread=0.0,
    )  # fmt: skip
    crew = draw_crew(settings, drop, np.random.default_rng(0))
    time = 133.0 * np.arange(3 * 650)
    inflow = np.full(len(time), flow)
    late = np.where(time > 20_000.0, 0.15, 0.0)  # the gauge starts to read too high: the level must fall
    operators = operator_arrays(
        inflow, late, np.full(len(time), level), settings, crew, np.zeros(len(time), int),
        gauge_quantum=0.0, rng=np.random.default_rng(1),
    )  # fmt: skip
    found = saint_venant(channel, time, inflow, operators, level)
    assert np.abs(found.level[-200:] - (level - 0.15)).max() < 0.01
    assert found.level.min() > level - 0.15 - 0.15


def test_set_point_changes_are_followed():
    moved = changed(FEW, level={"set_points_per_week": 3.0, "set_point_step": 0.15})
    base, other = simulate(FEW), simulate(moved)
    difference = (other.true_level - base.true_level).mean(axis=1)
    assert np.ptp(difference) > 0.08
    np.testing.assert_array_equal(base.inflow, other.inflow)


@pytest.mark.parametrize(
    ("section", "key", "value", "message"),
    [
        (
            "channel",
            "bed_level",
            131.0,
            "at the highest flow and its level: no steady flow of 800 .* check bed",
        ),
        ("operators", "level_gain", -250.0, r"level_gain = -250 .* swing: expected above -98 "),
        ("channel", "step", 200.0, "channel: step = 200 s is unstable"),
        ("reach", "inflow_gain", 1.1, "reach.inflow_gain = 1.1 with .channel.: expected 1"),
        ("flow", "highest", 4000.0, "at the highest flow and its level: no steady flow of 4000"),
    ],
)
def test_impossible_channels_are_named(section, key, value, message):
    with pytest.raises(ConfigError, match=message):
        simulate(changed(FEW, **{section: {key: value}}))


def test_in_a_cascade_each_reach_gets_what_the_one_above_let_out():
    cascade = load_scenario(SCENARIOS / "cascade.toml").model_copy(update={"days": 6, "missing_days": 1})
    reaches = simulate_cascade(cascade)
    assert simulate_cascade(Scenario(days=2))[0].place == 0
    assert [s.scenario.reach.name for s in reaches] == [f"reach-{k}" for k in (1, 2, 3, 4)]
    for above, below in zip(reaches, reaches[1:], strict=False):
        common = [d for d in above.dates if d in below.dates]
        assert len(common) >= 4
        rows = [[s.dates.index(d) for d in common] for s in (above, below)]
        np.testing.assert_array_equal(above.outflow[rows[0]], below.inflow[rows[1]])
    arrivals = [s.travel_time.mean() for s in reaches]
    assert arrivals == sorted(arrivals) and arrivals[-1] > 2 * arrivals[0]
    alone = simulate(cascade.reaches()[0])
    np.testing.assert_array_equal(alone.level, reaches[0].level)
