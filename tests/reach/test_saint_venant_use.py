"""Test calls of the Saint-Venant solver: batches, pieces, places, nudges, and errors."""

import subprocess
import sys
import tracemalloc

import numba
import numpy as np
import pytest

import rivid.reach.saint_venant.flow as flow_module
from rivid.errors import ConfigError, RividError
from rivid.reach.changes import AddedFlow, Changes
from rivid.reach.saint_venant import Channel, simulate

POOL = Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 24)
TIME = 133.0 * np.arange(200)


def days(seed=0, n=5, samples=200):
    rng = np.random.default_rng(seed)
    inflow = rng.uniform(150, 600, (n, 1)) + np.cumsum(rng.normal(0, 3, (n, samples)), axis=1)
    return inflow, inflow + rng.normal(0, 5, (n, samples)), rng.uniform(4.8, 5.8, n)


def test_a_day_is_the_same_to_the_bit_in_any_batch():
    inflow, outflow, start = days()
    rain = Changes(added=(AddedFlow(0.4, 3.0 + np.sin(TIME / 5000.0)),))
    many = simulate(POOL, TIME, inflow, outflow, start, changes=rain, places=(0.5,))
    for day in range(5):
        one = simulate(POOL, TIME, inflow[day], outflow[day], start[day], changes=rain, places=(0.5,))
        np.testing.assert_array_equal(one.level, many.level[day])
        np.testing.assert_array_equal(one.discharges, many.discharges[day])
    some = simulate(POOL, TIME, inflow[1:3], outflow[1:3], start[1:3], changes=rain)
    np.testing.assert_array_equal(some.level, many.level[1:3])


def test_rows_are_the_same_to_the_bit_in_threads(monkeypatch):
    inflow, outflow, start = days(n=7)
    alone = simulate(POOL, TIME, inflow, outflow, start)
    monkeypatch.setattr(flow_module, "ENOUGH", 0)
    monkeypatch.setattr(numba.config, "NUMBA_NUM_THREADS", 2)
    assert flow_module._threads(7, 1) == 2
    shared = simulate(POOL, TIME, inflow, outflow, start)
    np.testing.assert_array_equal(shared.level, alone.level)
    np.testing.assert_array_equal(shared.end.discharge, alone.end.discharge)
    outflow[[2, 5], 50:] += 600.0
    with pytest.raises(RividError, match="row 2"):
        simulate(POOL, TIME, inflow, outflow, start)
    monkeypatch.setattr(flow_module, "parent_process", lambda: object())  # acts as one of several workers
    assert flow_module._threads(7, 1) == 1


def test_times_and_added_flows_may_differ_from_day_to_day_and_gates_stand_at_the_ends():
    inflow, outflow, start = days(n=2)
    time = TIME + np.array([[0.0], [86400.0]])
    rain = Changes(added=(AddedFlow(0.7, np.where(time > 86400.0 + 3000.0, 20.0, 0.0)),))
    dry = simulate(POOL, time, inflow, outflow, start, places=(0.0, 1.0))
    np.testing.assert_allclose(dry.levels[..., 1], dry.level, rtol=0, atol=1e-12)
    np.testing.assert_allclose(dry.discharges[:, 1:, 0], inflow[:, :-1], rtol=1e-12)
    np.testing.assert_allclose(dry.discharges[:, 1:, 1], outflow[:, :-1], rtol=1e-12)
    assert dry.level[:, 0] == pytest.approx(start, abs=1e-11)
    wet = simulate(POOL, time, inflow, outflow, start, changes=rain)
    np.testing.assert_array_equal(wet.level[0], dry.level[0])
    assert (wet.level[1] - dry.level[1])[-1] > 0.3


def test_a_season_in_pieces_is_the_season_in_one_to_the_bit():
    inflow, outflow, start = (values[0] for values in days())
    whole = simulate(POOL, TIME, inflow, outflow, start)
    level, state = [], start
    for first, last in ((0, 1), (1, 60), (60, 199)):
        part = slice(first, last + 1)
        piece = simulate(POOL, TIME[part], inflow[part], outflow[part], state)
        level.extend(piece.level[:-1])
        state = piece.end
    np.testing.assert_array_equal([*level, piece.level[-1]], whole.level)
    np.testing.assert_array_equal(state.area, whole.end.area)
    first = simulate(POOL, TIME[:100], inflow[:100], outflow[:100], start).end
    for _ in range(2):  # a continued simulation does not change the state
        again = simulate(POOL, TIME[99:], inflow[99:], outflow[99:], first).level
        np.testing.assert_array_equal(again, whole.level[99:])


@pytest.mark.parametrize("place", [0.0, 0.6])
def test_a_lateral_flow_arrives_from_its_place(place):
    channel = Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 200)
    time = 5.0 * np.arange(300)
    steady = np.full(300, 300.0)
    pulse = Changes(added=(AddedFlow(place, np.where(time < 100.0, 0.0, 5.0)),))
    flow = simulate(channel, time, steady, steady, 5.2, changes=pulse)
    arrival = time[np.argmax(np.diff(flow.level))] + 2.5 - 100.0
    depth = 5.0 + 0.2 * place  # deeper towards the dam
    celerity = 300.0 / (81.6 * depth) + np.sqrt(9.81 * depth)
    assert arrival == pytest.approx((1.0 - place) * 8200.0 / celerity, rel=0.04)


def test_gates_slower_than_the_samples_keep_moving():
    time = 10.0 * np.arange(40)
    outflow = np.full(40, 300.0)
    inflow = np.where(time < 50.0, 300.0, 340.0)
    flow = simulate(POOL, time, inflow, outflow, 5.2, gate_time=20.0, places=(0.0,))
    np.testing.assert_allclose(flow.discharges[5:9, 0], [300.0, 320.0, 330.0, 335.0], rtol=1e-12)


def test_a_nudge_is_returned_and_can_be_undone():
    n = 200
    still = np.zeros(n)
    observed = np.full(n, 5.5)
    observed[50:60] = np.nan
    flow = simulate(POOL, TIME, still, still, 5.0, observed=observed)
    np.testing.assert_allclose(flow.nudge[:50], (5.5 - flow.level[:50]) / 1800.0, rtol=1e-12)
    assert (flow.nudge[50:60] == 0.0).all()
    added = np.concatenate([[0.0], np.cumsum(133.0 * flow.nudge[:-1])])
    np.testing.assert_allclose(flow.level - added, 5.0, rtol=0, atol=1e-9)
    expected = 5.5 - 0.5 * (1.0 - 133.0 / 1800.0) ** 50
    assert flow.level[50] == pytest.approx(expected, abs=1e-9)


def test_a_nudge_holds_a_flow_to_what_was_observed():
    inflow, outflow, start = (values[0] for values in days())
    truth = simulate(POOL, TIME, inflow, outflow, start).level
    lost = outflow + 10.0
    free = simulate(POOL, TIME, inflow, lost, start).level
    held = simulate(POOL, TIME, inflow, lost, start, observed=truth)
    assert np.abs(free - truth).max() > 0.25
    assert np.abs(held.level - truth).max() < 0.15
    surface = POOL.surface_area(5.2)
    assert held.nudge[-50:].mean() * surface == pytest.approx(10.0, rel=0.15)
    np.testing.assert_array_equal(simulate(POOL, TIME, inflow, outflow, start, observed=truth).nudge, 0.0)


def test_memory_grows_by_inputs_and_outputs_alone():
    n = 20_000
    time, flows = 133.0 * np.arange(n), np.full(n, 300.0)
    channel = Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 128)
    simulate(channel, time[:10], flows[:10], flows[:10], 5.2)
    tracemalloc.start()
    simulate(channel, time[:200], flows[:200], flows[:200], 5.2)
    tracemalloc.reset_peak()
    simulate(channel, time, flows, flows, 5.2)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 12 * 8 * n


def test_a_run_does_not_load_numba():
    code = (
        "import sys\nimport rivid.run.run, rivid.run.run, rivid.report.build, rivid.check\n"
        "print('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"courant": 0.9}, ["courant = 0.9", "at most 0.6"]),
        ({"courant": 0.0}, ["courant = 0.0", "more than 0"]),
        ({"step": 60.0}, ["step = 60 s is unstable", "dx = 341.7 m", "at most 26", "fewer cells"]),
        ({"step": -1.0}, ["step = -1.0"]),
        ({"gate_time": -5.0}, ["gate_time = -5.0"]),
        ({"places": (0.5, 1.2)}, ["places holds 1.2"]),
    ],
)
def test_settings_that_cannot_work_are_refused_in_one_line(settings, words):
    flows = np.full(200, 300.0)
    with pytest.raises(ConfigError) as caught:
        simulate(POOL, TIME, flows, flows, 5.2, **settings)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message
    if "step = 60 s is unstable" in words:
        named = float(message.split("at most ")[1].split(" s")[0])
        assert np.ptp(simulate(POOL, TIME, flows, flows, 5.2, step=0.999 * named).level) < 1e-9


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"length": -1.0}, "length = -1.0"),
        ({"bottom_width": np.full(6, -80.0)}, "bottom_width = -80.0 in cell 0"),
        ({"bottom_width": np.zeros(6)}, "bottom_width = 0.0 in cell 0"),
        ({"bottom_width": np.ones(5)}, r"bottom_width has shape \(5,\)"),
        ({"side_slope": np.array([0, 0, -1.0, 0, 0, 0])}, "side_slope = -1.0 in cell 2"),
        ({"manning": np.full(6, np.nan)}, "manning = nan in cell 0"),
        ({"bed": np.zeros(3)}, "bed has 3 cells"),
    ],
)
def test_an_impossible_channel_is_refused(change, words):
    good = {
        "length": 8200.0, "bed": np.zeros(6), "bottom_width": np.full(6, 80.0),
        "side_slope": np.zeros(6), "manning": np.full(6, 0.03),
    }  # fmt: skip
    Channel(**good)
    with pytest.raises(ConfigError, match=words):
        Channel(**(good | change))


def test_a_channel_of_too_many_cells_is_refused():
    with pytest.raises(ConfigError, match="2049 cells: expected at most 2048"):
        simulate(Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 2049), [0.0], [300.0], [300.0], 5.2)


def test_a_reach_that_runs_dry_or_has_no_steady_start_is_refused():
    outflow = np.where(TIME < 2000.0, 300.0, 900.0)
    inflow, more = np.stack([np.full(200, 300.0)] * 2), np.stack([np.full(200, 300.0), outflow])
    with pytest.raises(RividError, match=r"runs dry at \d+ s, row 1, \d+ m below.*raise the start level"):
        simulate(POOL, TIME, inflow, more, 5.2)
    flows = np.full(200, 800.0)
    with pytest.raises(RividError, match="no steady flow of 800 m3/s has the start level 1.5 m"):
        simulate(POOL, TIME, flows, flows, 1.5)
    state = simulate(POOL, TIME, flows, flows, 5.2).end
    with pytest.raises(RividError, match=r"\(1, 24\): expected \(1, 32\)"):
        simulate(Channel.smooth(8200.0, 81.6, 1e-4, 0.025, 32), TIME, flows, flows, state)


@pytest.mark.parametrize(
    ("time", "inflow", "words"),
    [
        (TIME[::-1], np.full(200, 300.0), "time does not increase"),
        (TIME, np.full(199, 300.0), r"time has shape \(200,\)"),
        (TIME, np.where(TIME == 133.0, np.nan, 300.0), "inflow is nan in row 0, sample 1"),
    ],
)
def test_inputs_that_do_not_fit_are_named(time, inflow, words):
    with pytest.raises(RividError, match=words):
        simulate(POOL, time, inflow, np.full(np.shape(inflow), 300.0), 5.2)
