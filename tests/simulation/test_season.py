"""Test seasons: reproducible, continuous, in balance, with the right true delay."""

import datetime as dt
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import toeplitz

from benchmarks.observables import condition_numbers, observables
from rivid.core.hydraulics import GRAVITY
from rivid.effects import CATALOGUE
from rivid.reach.integrator import LinearReach, pool_level
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import Scenario, load_scenario

SCENARIOS = Path(__file__).parent.parent.parent / "configs" / "scenarios"
FEW = Scenario(days=12, seed=5)


def changed(scenario, **sections):
    """Return the scenario with some keys of some sections changed."""
    return scenario.model_copy(
        update={name: getattr(scenario, name).model_copy(update=keys) for name, keys in sections.items()}
    )


def arrays(season):
    kept = {f.name: getattr(season, f.name) for f in fields(Season)}
    return {name: values for name, values in kept.items() if isinstance(values, np.ndarray | tuple)}


@pytest.fixture(scope="module")
def year():
    return simulate(load_scenario(SCENARIOS / "basse_isere.toml"))


def test_the_sample_year_has_the_character_of_the_papers(year):
    seen = observables(year)
    assert seen.days == 332 and year.inflow.shape == year.outflow.shape == year.level.shape == (332, 650)
    assert year.seconds.tolist() == [133.0 * k for k in range(650)]
    assert 90 <= seen.discharge_lowest <= 130 and 700 <= seen.discharge_highest <= 830
    assert seen.below_500 > 0.8
    assert 135 <= seen.discharge_range <= 165
    assert 0.1 <= seen.level_range <= 0.2  # a few centimetres (III), 0.2 m in the mean (II)
    assert seen.level_drop > 0.1
    assert 1.5e4 <= seen.condition_median <= 3e4
    assert 5e4 <= seen.condition_high <= 1.2e5
    assert set(seen.delays) == {6, 7, 8}


@pytest.mark.parametrize(("name", "delays"), [("short", {2, 3}), ("long", {10, 11, 12})])
def test_other_reaches_have_their_delays(name, delays):
    season = simulate(load_scenario(SCENARIOS / f"{name}.toml"), 1)
    assert set(season.delay) == delays
    assert 0.12 < observables(season).level_range < 0.32


def test_the_same_seed_gives_the_same_season_and_a_change_in_one_place_leaves_other_draws_alone():
    one, again, other = simulate(FEW), simulate(FEW, 5), simulate(FEW, 6)
    for name, values in arrays(one).items():
        np.testing.assert_array_equal(values, arrays(again)[name], err_msg=name)
    assert (one.inflow != other.inflow).mean() > 0.5
    assert (one.level != other.level).mean() > 0.5
    noisy = simulate(changed(FEW, level={"noise": 0.02}))
    np.testing.assert_array_equal(noisy.inflow, one.inflow)
    np.testing.assert_array_equal(noisy.weather, one.weather)
    assert (noisy.outflow != one.outflow).any()


def test_missing_days_are_drawn_and_left_out(year):
    assert len(set(year.dates)) == 332 and list(year.dates) == sorted(year.dates)
    assert {d.year for d in year.dates} == {2008}
    one = simulate(FEW.model_copy(update={"missing_days": 4}))
    full = simulate(FEW)
    assert len(one.dates) == 8
    rows = [full.dates.index(d) for d in one.dates]
    np.testing.assert_array_equal(one.level, full.level[rows])
    coarse = simulate(changed(FEW, reach={"sample_time": 900.0}))
    assert coarse.seconds[-1] == 86400 - 900 and len(coarse.seconds) == 96


def test_commands_and_readings_are_in_whole_quanta(year):
    np.testing.assert_array_equal(year.inflow % 1, 0)
    np.testing.assert_array_equal(year.outflow % 1, 0)
    assert year.inflow.min() >= 40 and year.outflow.min() >= 0
    np.testing.assert_array_equal(year.level, np.round(year.level, 2))
    error = year.level - year.true_level
    assert np.sqrt((error**2).mean()) == pytest.approx(np.hypot(0.003, 0.01 / np.sqrt(12)), rel=0.05)


def test_days_go_on_where_the_day_before_ended(year):
    dates = np.array(year.dates)
    next_day = np.flatnonzero(np.diff(dates) == dt.timedelta(days=1))
    assert len(next_day) > 250
    for name, most in (("true_level", 0.025), ("inflow", 21)):
        values = getattr(year, name)
        within = np.abs(np.diff(values, axis=1)).max()
        across = np.abs(values[next_day + 1, 0] - values[next_day, -1]).max()
        assert across <= within <= most, name


def test_the_water_agrees_with_second_by_second_integration():
    tau, gains = 941, {"inflow_gain": 0.95, "outflow_gain": 1.02}
    still = {"width": 1e12, "wave_depth": (8200 / tau) ** 2 / GRAVITY}  # no velocity: tau is always 941 s
    season = simulate(changed(FEW, weather={"inflow": 0.0}, reach=still | gains))
    steps = np.tile(np.append(np.diff(season.seconds), 83.0).astype(int), 12)
    inflow, outflow = (np.repeat(x.ravel(), steps) for x in (season.inflow, season.outflow))
    balance = 0.95 * inflow[86400 - tau : -tau] - 1.02 * outflow[86400:]
    level = np.concatenate([[0.0], np.cumsum(balance)[:-1]]) / 6.7e5
    at = np.cumsum(steps) - steps
    water = season.true_level.ravel() - season.true_level[1, 0]
    np.testing.assert_allclose(water[650:], level[at[650:] - 86400], atol=1e-8)


def test_the_true_delay_is_where_a_step_is_first_seen(year):
    reach = LinearReach()
    time = 133.0 * np.arange(40)
    for i in np.flatnonzero(~year.near_edge)[::25]:
        level, *_ = pool_level(reach, time, np.ones(40), np.zeros(40), year.travel_time[i])
        assert np.flatnonzero(level)[0] == year.delay[i] + 1


def test_the_level_follows_a_lower_set_point_at_high_flow(year):
    flow, level = year.inflow.mean(axis=1), year.true_level.mean(axis=1)
    expected = 130.0 - 0.002 * np.maximum(flow - 400, 0)
    assert np.abs(level - expected).mean() < 0.03


def test_gaps_of_the_gauge_are_nan_and_nothing_else():
    season = simulate(changed(FEW, level={"gaps_per_day": 4.0, "gap_length": 600.0}))
    share = np.isnan(season.level).mean()
    assert 0.01 < share < 0.08  # 4 a day of about 12 min each
    assert np.isfinite(season.inflow).all() and np.isfinite(season.true_level).all()


def test_weather_has_its_size_and_memory(year):
    assert year.weather.std() == pytest.approx(2.0, rel=0.15)
    lag = round(21600 / 133)
    w = year.weather
    assert (w[:, lag:] * w[:, :-lag]).mean() / 4.0 == pytest.approx(np.exp(-1), abs=0.12)


def test_effects_act_on_water_and_gauge_and_never_on_the_inflow_log():
    base = simulate(FEW)
    spring = simulate(FEW, effects=[CATALOGUE["lateral_inflow"](inflow=25.0, place=0.3)])
    np.testing.assert_array_equal(spring.inflow, base.inflow)
    assert (spring.outflow - base.outflow)[2:].mean() == pytest.approx(25.0, abs=2.0)
    leak = simulate(FEW, effects=[CATALOGUE["outflow_gain_error"](error=0.1)])
    assert leak.outflow[2:].mean() / base.outflow[2:].mean() == pytest.approx(1 / 1.1, abs=0.01)
    settled = simulate(FEW, effects=[CATALOGUE["sensor_step"](step=0.3, start=-24.0)])
    assert (settled.level - settled.true_level).mean() == pytest.approx(0.3, abs=1e-3)
    assert settled.true_level[2:].mean() == pytest.approx(base.true_level[2:].mean() - 0.3, abs=0.02)


def test_condition_numbers_are_those_of_the_toeplitz_matrix(year):
    u = year.inflow[10] - year.inflow[10, 0]
    singular = np.linalg.svd(toeplitz(u, np.zeros(30)), compute_uv=False)
    found = condition_numbers(year.inflow[10:11])[0]
    assert found == pytest.approx((singular[0] / singular[-1]) ** 2, rel=1e-6)


def test_the_true_delays_of_the_sample_year_are_those_of_its_gravity_bound(year):
    bounds = year.scenario.reach.bounds(year.inflow.mean(axis=1))
    np.testing.assert_allclose(year.travel_time, bounds.gravity, rtol=2e-3)
    assert ((year.delay + 1) * year.sample_time >= bounds.gravity - 2.0).all()


def test_the_operators_of_the_sample_year_act_on_every_move_of_the_inflow(year):
    moves = np.diff(year.inflow, axis=1)
    slope = (np.diff(year.outflow, axis=1)[moves != 0] / moves[moves != 0]).mean()
    assert slope == pytest.approx(1.0, abs=0.1)  # K_Q of (9), at once
