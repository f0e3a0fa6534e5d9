"""Test the operators of the downstream dam, one setting at a time."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.errors import ConfigError
from rivid.reach.changes import AddedFlow, Changes
from rivid.reach.integrator import LinearReach, pool_level
from rivid.reach.operators import OperatorSettings, draw_crew, operator_arrays, quantise, roster

T_S, N = 133.0, 1300
TIME = T_S * np.arange(N)
REACH = LinearReach()
TAU = 6.5 * T_S
PLAIN = OperatorSettings(dead_band=0.0, look=(T_S, T_S), notice=0.0, quantum=0.0, trim_time=1e12)


def one_operator(settings):
    return np.array([settings.feedforward]), np.array([settings.level_gain]), np.zeros(1)


def run(inflow, settings, *, aim=130.0, quantum=0.0, noise=None, changes=None, seed=0, duty=None, crew=None):
    """Return the outflow commands and the true level."""
    n = len(inflow)
    aims = np.broadcast_to(aim, n)
    operators = operator_arrays(
        inflow, np.zeros(n) if noise is None else noise, aims, settings,
        crew or one_operator(settings), np.zeros(n, int) if duty is None else duty,
        gauge_quantum=quantum, rng=np.random.default_rng(seed),
    )  # fmt: skip
    level, outflow, _ = pool_level(
        REACH, TIME[:n], inflow, operators, TAU, start=aims[0], before=inflow[0], changes=changes or Changes()
    )
    return outflow, level


def test_with_a_look_at_every_sample_the_outflow_follows_equation_9():
    inflow = 300 + np.round(20 * np.sin(TIME / 8000))
    settings = replace(PLAIN, feedforward=0.9, level_gain=-1000.0)
    outflow, level = run(inflow, settings)
    expected = inflow[0] + 0.9 * (inflow - inflow[0]) + 1000.0 * (level - 130.0)
    np.testing.assert_allclose(outflow, expected, atol=1e-5)


def test_an_inflow_step_dips_the_level_and_the_trim_brings_it_back():
    inflow = np.where(np.arange(N) < 50, 300.0, 400.0)
    outflow, level = run(inflow, replace(OperatorSettings(), dead_band=0.0))
    dip = -100 * TAU / REACH.surface_area
    # K_Q = 1: volume released before the wave arrives
    assert level.min() == pytest.approx(130 + dip, rel=1e-3)
    assert np.abs(level[-100:] - 130).max() < 0.01
    assert np.abs(outflow[-100:] - 400).max() <= 2


def test_without_a_trim_a_lasting_loss_leaves_a_lasting_error():
    inflow = np.full(N, 300.0)
    loss = Changes(added=(AddedFlow(1.0, np.full(N, -15.0)),))
    _, lasting = run(inflow, PLAIN, changes=loss)
    assert lasting[-1] == pytest.approx(130 + 15.0 / PLAIN.level_gain, abs=1e-4)
    _, trimmed = run(inflow, replace(PLAIN, trim_time=7200.0), changes=loss)
    assert abs(trimmed[-1] - 130) < 0.005


def test_errors_inside_the_dead_band_change_nothing():
    inflow = np.full(N, 300.0)
    noise = np.random.default_rng(0).uniform(-0.019, 0.019, N)
    quiet, _ = run(inflow, replace(OperatorSettings(), dead_band=0.02), noise=noise)
    busy, _ = run(inflow, replace(OperatorSettings(), dead_band=0.005), noise=noise)
    assert (quiet == 300).all()
    assert len(np.unique(busy)) > 3


def test_looks_come_within_their_times_or_when_the_inflow_moves():
    inflow = np.full(N, 300.0)
    noise = 0.05 * np.random.default_rng(1).standard_normal(N)  # each look reads another level
    settings = replace(PLAIN, look=(600.0, 1800.0), notice=4.0)
    outflow, _ = run(inflow, settings, noise=noise)
    waits = np.diff(TIME[1:][np.diff(outflow) != 0])
    assert waits.min() >= 600.0 and waits.max() < 1800.0 + T_S
    assert np.ptp(waits) > 600.0
    inflow[5:] = 306.0
    outflow, _ = run(inflow, settings)
    assert outflow[4] == 300.0 and outflow[5] == 306.0
    inflow[5:] = 303.0
    outflow, _ = run(inflow, replace(settings, look=(1800.0, 1800.0), level_gain=-1e-6))
    assert (outflow[:14] == 300.0).all() and outflow[14] == pytest.approx(303.0)


def test_commands_are_whole_quanta():
    quantum = 5.0
    inflow = 300 + np.round(60 * np.sin(TIME / 8000))
    outflow, _ = run(inflow, replace(OperatorSettings(), quantum=quantum), quantum=0.01)
    assert len(np.unique(outflow)) > 10
    np.testing.assert_array_equal(outflow % quantum, 0)
    assert quantise(np.array([136.0163, -0.004]), 0.01).tolist() == [136.02, 0.0]
    assert quantise(np.array([1.2345]), 0.0).tolist() == [1.2345]


def test_the_outflow_keeps_its_limit_and_leaves_it_again():
    inflow = np.where((np.arange(N) > 100) & (np.arange(N) < 500), 5.0, 120.0)
    outflow, level = run(inflow, replace(OperatorSettings(), feedforward=1.3, lowest=2.5))
    assert outflow.min() == 3.0  # the first whole m3/s above the limit
    assert np.abs(level[-50:] - 130).max() < 0.06
    bare, _ = run(inflow, replace(OperatorSettings(), feedforward=1.3))
    assert bare.min() == 0.0


def test_shifts_last_eight_hours_and_the_operator_changes():
    time = np.arange(-86400.0, 5 * 86400.0, T_S)
    duty = roster(time, OperatorSettings(shift_start=5.0), np.random.default_rng(0))
    changes = time[1:][np.diff(duty) != 0]
    assert len(changes) == 18  # three a day, on each of six days
    np.testing.assert_array_equal(np.floor(changes / 3600) % 8, 5)
    assert set(duty) <= set(range(9)) and len(set(duty)) > 4
    assert (roster(time, OperatorSettings(people=1), np.random.default_rng(0)) == 0).all()


def test_operators_have_their_own_gains_and_a_change_of_shift_does_not_jump():
    settings = OperatorSettings(set_point_spread=0.0)
    crew = draw_crew(settings, 1800.0 / REACH.surface_area, np.random.default_rng(1))
    feedforward, level_gain, _ = crew
    assert len(np.unique(level_gain)) == len(np.unique(feedforward)) == 9
    assert (level_gain < 0).all()
    duty = np.repeat([3, 5], [N // 2, N - N // 2])
    outflow, level = run(np.full(N, 300.0), settings, crew=crew, duty=duty)
    assert (outflow == 300).all() and np.allclose(level, 130)


def test_no_operator_makes_the_level_swing():
    settings = OperatorSettings(level_gain=-372.0, level_gain_spread=1.0, people=400)
    _, level_gain, _ = draw_crew(settings, 1800.0 / REACH.surface_area, np.random.default_rng(0))
    assert -level_gain.min() * 1800.0 / REACH.surface_area == pytest.approx(1.0)
    worst = replace(PLAIN, level_gain=float(level_gain.min()), look=(1800.0, 1800.0), notice=1e9)
    _, level = run(np.full(N, 300.0), worst, noise=np.where(TIME > 300 * T_S, 0.2, 0.0))
    assert np.abs(level[-100:] - 129.8).max() < 0.02
    with pytest.raises(ConfigError, match=r"operators.level_gain = -1000 .* expected above -372 m2/s"):
        draw_crew(OperatorSettings(level_gain=-1000.0), 1800.0 / 6.7e5, np.random.default_rng(0))
