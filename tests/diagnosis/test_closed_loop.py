"""Test the identified law of the operators, and the closed loop against plain loops and the truth."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from rivid.diagnosis import closed_loop as loops
from rivid.diagnosis import operators
from rivid.diagnosis.blocks import split
from rivid.diagnosis.closed_loop import closed_loop, run_day, without_fronts
from rivid.diagnosis.fit import Model
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.operators import Law, SetPoint, identify, looks, step_of, validate
from rivid.diagnosis.response.base import cut, gauge_of
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.response.linear import LinearPool
from rivid.diagnosis.result import Diagnosis
from rivid.effects import CATALOGUE, changes_of
from rivid.errors import RividError
from rivid.reach.changes import NO_CHANGES, AddedFlow, Changes, Gate, Leak, Pond
from tests.diagnosis import sizes
from tests.diagnosis.loops import ALIKE, operators_by_hand, record_of, season
from tests.diagnosis.responses import walls

CASES = [
    ("intermittent", 1, {}),
    ("uneven", 3, {"feedforward": 0.6, "trim_time": 5000.0}),
    ("hydraulic", 5, {"quantum": 5.0, "dead_band": 0.0}),
]


@pytest.mark.parametrize(("name", "seed", "habits"), CASES, ids=lambda v: str(v))
def test_the_law_is_that_of_the_operators_of_the_logs(name, seed, habits):
    s = season(name, seed, 45, **(ALIKE | habits))
    record, true = record_of(s), s.scenario.operators
    dealt = split(record.dates)
    law = identify(record.take(dealt.fit))
    assert law.feedforward == pytest.approx(true.feedforward, abs=0.02)
    assert law.lag == 0
    assert law.level_gain == pytest.approx(-true.level_gain, rel=0.12)
    assert law.trim_time == pytest.approx(true.trim_time, rel=0.2)
    assert law.dead_band == pytest.approx(true.dead_band, abs=0.0051)
    assert float(law.set_point.at(np.array(200.0))) == pytest.approx(130.0, abs=0.0051)
    assert (law.quantum, law.gauge_quantum) == (true.quantum, 0.01)
    assert true.look[0] < law.look < true.look[1]
    assert law.notice == (4.0 if true.notice == 4.0 else np.inf)
    checked = validate(law, record.take(dealt.select))
    # with one operator, the only difference is rounding to the quantum at both ends
    assert checked.left < 1.6 * true.quantum / np.sqrt(6.0)
    assert checked.r2 > max(0.99, checked.r2_inflow)


def test_a_set_point_that_follows_the_flow_is_found():
    record = record_of(season("intermittent", 2, drawdown=0.2, **ALIKE))
    law = identify(record.take(split(record.dates).fit))
    aims = law.set_point.at(np.array([150.0, 300.0, 550.0]))
    assert aims == pytest.approx([130.0, 130.0, 130.0 - 0.2 * 1.5], abs=0.03)  # lower from 400 m3/s on
    assert law.level_gain == pytest.approx(270.0, rel=0.12)


@sizes("lag", 3, 9)
def test_operators_who_wait_for_the_wave_are_found_by_their_lag(lag):
    record = record_of(season("intermittent", 7, **ALIKE))
    n = record.time.shape[1]
    early = np.roll(record.inflow, -lag, axis=1)  # commanded earlier by this much than in reality
    late = dataclasses.replace(record, inflow=early, used=record.used & (np.arange(n) < n - lag))
    law = identify(late.take(split(record.dates).fit))
    assert law.lag == lag and law.feedforward == pytest.approx(1.0, abs=0.02)
    assert law.level_gain == pytest.approx(270.0, rel=0.12)


def test_whitened_least_squares_are_those_of_the_dense_covariance():
    rng = np.random.default_rng(8)
    days, m = 4, 60
    noise = NoiseModel(0.5, 0.8, 0.3, 12.0, 0.0, 100.0, 1.0, 1.0)
    q, e = np.cumsum(rng.standard_normal((2, days, m)), axis=2)
    trims = np.cumsum(e, axis=1)
    command = 0.9 * q + 3.0 * e + 0.2 * trims + noise.simulate(days, m, rng)
    command[2, 50:] = np.nan
    tried = [(SetPoint(0.0), 0.0)]
    found = operators._least_squares(command, q[None], e[None], trims[None], tried, noise, np.ones(days))
    # white noise, a walk, and an integrated rate with memory; each day from an unknown level
    k = np.arange(m)
    steps = np.tril(np.ones((m, m)), -1)
    V = 0.25 * np.eye(m) + 0.64 * steps @ steps.T
    V += 0.09 * steps @ np.exp(-np.abs(k[:, None] - k) / 12.0) @ steps.T
    A, b = np.zeros((3, 3)), np.zeros(3)
    for day in range(days):
        there = np.isfinite(command[day])
        X = np.stack([q[day], e[day], trims[day]], axis=1)[there]
        W = np.linalg.inv(V[np.ix_(there, there)])
        one = np.ones((there.sum(), 1))
        W = W - W @ one @ one.T @ W / (one.T @ W @ one)
        A, b = A + X.T @ W @ X, b + X.T @ W @ command[day, there]
    assert found[2] == pytest.approx(np.linalg.solve(A, b), rel=1e-6)


def test_what_the_law_explains_is_that_of_a_plain_loop_over_moves():
    record = record_of(season("intermittent", 9, 20))
    law = identify(record)
    found = validate(law, record)
    n = round(3600.0 / record.sample_time)
    seen, left = [], []
    for day in range(record.days):
        u, o, h = record.inflow[day], record.outflow[day], record.output[day]
        aim = float(law.set_point.at(np.array(u[record.lead :].mean())))
        off = [0.0 if np.isnan(x) else np.sign(x - aim) * max(abs(x - aim) - law.dead_band, 0.0) for x in h]
        passed = np.concatenate([[0.0], np.cumsum(np.array(off)[:-1] * np.diff(record.time[day]))])
        last = 0
        force = []
        for k in range(len(u)):
            last = k if k and o[k] != o[k - 1] else last
            force.append(last)
            if last != k or not record.used[day, k] or k < n or force[k - n] == 0:
                continue
            j = force[k - n]
            seen.append(o[k] - o[j])
            by = law.feedforward * (u[k - law.lag] - u[j - law.lag]) + law.level_gain * (off[k] - off[j])
            left.append(seen[-1] - by - law.level_gain / law.trim_time * (passed[k] - passed[j]))
    assert len(seen) > 1000
    assert found.change == pytest.approx(np.sqrt(np.mean(np.square(seen))))
    assert found.left == pytest.approx(np.sqrt(np.mean(np.square(left))))
    assert found.r2 == pytest.approx(1.0 - np.mean(np.square(left)) / np.mean(np.square(seen)))


def test_steps_of_logs_and_the_time_between_looks_without_notice_are_found():
    rng = np.random.default_rng(10)
    for step in (0.01, 0.05, 0.5, 1.0, 5.0, 20.0):
        assert step_of(step * np.round(rng.normal(100.0, 30.0, 500))) == step
    assert step_of(rng.normal(100.0, 30.0, 500)) == 0.0 and step_of(np.ones(3)) == 0.0
    s = season("intermittent", 11, 30, **(ALIKE | {"notice": 1e9, "look": (900.0, 901.0)}))
    look, notice = looks(record_of(s), 0)
    assert look == 7 * 133.0 and notice == np.inf  # the first sample at 900 s or later


LAW = Law(
    feedforward=0.9, lag=2, level_gain=200.0, trim_time=9000.0, dead_band=0.01, set_point=SetPoint(130.02),
    look=900.0, notice=5.0, quantum=1.0, lowest=0.0, gauge_quantum=0.01,
)  # fmt: skip


def linear(record, fronts="none"):
    return LinearPool.nominal(record, fronts, surface_area=6.7e5, delay=931.0)


@pytest.mark.parametrize("row", [0, 4])
def test_a_day_of_the_linear_pool_is_that_of_a_plain_loop(row):
    record = record_of(season("intermittent", 12, 8))
    day = record.take([row])
    side, loss = 7.0 * np.cos(day.time / 20_000.0), 12.0
    changes = Changes(added=(AddedFlow(1.0, side),), leaks=(Leak(1.0, np.full((1, 1), loss), 129.9),),
                      gauge=0.02 * np.sin(day.time / 9000.0))  # fmt: skip
    reach = linear(record)
    level, outflow = run_day(reach, LAW, day, changes)
    first = int(np.argmax(day.used[0]))
    assert first == (record.lead - 1 if row else 2 * record.lead)
    assert np.isnan(level[:first]).all() and np.isnan(outflow[:first]).all()
    level, outflow = level[first:], outflow[first:]
    u, t = day.inflow[0], day.time[0]
    gauge = changes.gauge[0]
    measured = np.nanmean((day.output[0] - 0.0)[first - 4 : first + 1])
    state = {"h": measured - gauge[first]}
    levels = []

    def water(i, commands):
        k = first + i
        if i:
            dt, h = t[k] - t[k - 1], state["h"]
            came = 0.0  # volume that left between t - 931 s and dt later: the delay is seven samples of 133 s
            for a, b, flow in zip(t[:-1], t[1:], u[:-1], strict=True):
                came += flow * max(0.0, min(b, t[k] - 931.0) - max(a, t[k - 1] - 931.0))
            gone = commands[-1] + loss * (h - 129.9) - side[0, k - 1]
            state["h"] = h + (came - gone * dt) / 6.7e5
        levels.append(state["h"] + gauge[k])
        return levels[-1]

    late = np.concatenate([[u[0]] * LAW.lag, u[: -LAW.lag]])[first:]
    by_hand = operators_by_hand(
        t[first:], late, water, aim=130.02, gain=200.0, trim=9000.0, band=0.01, look=900.0, notice=5.0,
        quantum=1.0, reading=0.01, start=day.outflow[0, first], K_Q=0.9,
    )  # fmt: skip
    assert np.ptp(outflow) > 20.0
    assert np.array_equal(outflow, by_hand)
    assert level == pytest.approx(np.array(levels), abs=1e-7)
    assert outflow[0] == day.outflow[0, first]


def channel(s, record):
    """Return the response that is the truth of a plain hydraulic season."""
    bed, reach = s.scenario.channel, s.scenario.reach
    level = s.scenario.level.set_point
    made = HydraulicResponse.nominal(
        reach.length, reach.width, level - bed.bed_level - 0.5 * bed.slope * reach.length, level,
        sample_time=record.sample_time, flow=record.usual_flow, slope=bed.slope, manning=bed.manning,
        width_modes=0, bed_modes=0, cells=bed.cells,
    )  # fmt: skip
    return walls(made)


PROMPT = {"look": (1.0, 2.0), "notice": 0.0, "dead_band": 0.0}


def test_the_true_reach_and_the_true_law_give_the_true_days():
    effects = (CATALOGUE["outflow_lag"](lag=600.0), CATALOGUE["diurnal_inflow"](amplitude=8.0))
    s = season("hydraulic", 13, 5, effects, quiet=True, **(ALIKE | PROMPT))
    record = record_of(s)
    law = Law(1.0, 0, 85.0, 10_800.0, 0.0, SetPoint(130.0), 1.0, 0.0, 1.0, 0.0, 0.0)
    changes = cut(changes_of(effects, record.world(130.0, s.scenario.flow.mean)), record.time.shape, [3])
    day = record.take([3])
    level, outflow = run_day(channel(s, record), law, day, changes)
    first = int(np.argmax(day.used[0]))
    # The start differs by the trim that the operators made before midnight, less than a quantum,
    assert np.nanmax(np.abs(outflow - day.outflow[0])) <= 2.0
    off = np.abs(level - day.output[0])[first:]
    hour = 3600.0 / record.sample_time
    # and by waves of the day before, which is known from 84 minutes before midnight on
    assert off.max() < 0.015 and off[round(2 * hour) :].max() < 0.004
    _, without = run_day(channel(s, record), law, day, NO_CHANGES)
    assert np.nanmax(np.abs(without - day.outflow[0])) > 6.0


@pytest.mark.parametrize("kind", ["channel", "fir"])
def test_corrections_by_lagged_flows_agree_with_the_outflow_that_was_decided(kind):
    s = season("hydraulic", 15, 6) if kind == "channel" else season("intermittent", 15, 6)
    record = record_of(s)
    reach = channel(s, record) if kind == "channel" else linear(record, kind)
    rng = np.random.default_rng(16)
    values = [p.value for p in reach.parameters]
    alpha = record.sample_time / 6.7e5
    for i, p in enumerate(reach.parameters):
        if "_lag_" in p.name:
            values[i] = (0.5 if kind == "channel" else 0.3) * alpha * rng.standard_normal()
    reach = reach.with_parameters(values)
    day = record.take([2])
    changes = Changes(gauge=np.full((1, 1), 0.01))
    law = dataclasses.replace(LAW, level_gain=85.0)
    level, commands = run_day(reach, law, day, changes)
    day = dataclasses.replace(day, outflow=np.where(np.isnan(commands), day.outflow, commands))
    first = int(np.argmax(day.used[0]))
    alone = reach.simulate(day, changes)[0]
    assert np.ptp((level - alone)[first:]) < 2.5e-3, "only a constant apart, that sets the first level"
    plain = without_fronts(reach).simulate(day, changes)[0]
    assert np.ptp((level - plain)[first:]) > 6e-3, "the corrections matter here"


def test_changes_are_cut_with_all_their_parts():
    shape = (3, 5)
    grid = np.arange(15.0).reshape(shape)
    changes = Changes(
        inflow=grid, gate=Gate(lag=grid, rate=np.full(1, 2.0)), added=(AddedFlow(0.3, grid[:1]),),
        leaks=(Leak(0.5, grid, 130.0),), ponds=(Pond(1.0, 5e4, grid),), area_slope=0.1, area_reference=130.0,
    )  # fmt: skip
    part = cut(changes, shape, np.s_[1:2, 2:])
    assert part.inflow.tolist() == [[7.0, 8.0, 9.0]] == part.gate.lag.tolist() == part.leaks[0].loss.tolist()
    assert part.added[0].flow.tolist() == [[2.0, 3.0, 4.0]] and part.added[0].place == 0.3
    assert part.ponds[0].exchange.shape == (1, 3) and part.ponds[0].area == 5e4
    assert part.gate.rate.tolist() == [2.0] and (part.area_slope, part.area_reference) == (0.1, 130.0)
    whole = cut(NO_CHANGES, shape, np.s_[1:2])
    assert whole.inflow is None and whole.added == () and whole.gate_is_plain


def study_of(record, reach, effects=(), after=()):
    def model(more):
        whole = Model(reach, None, 130.0, record.usual_flow, 0.003, more, ((),) * len(more))
        return SimpleNamespace(whole=whole)

    return SimpleNamespace(
        record=record, split=split(record.dates), first=model(tuple(effects)), last=model(tuple(after))
    )


def test_a_hidden_diurnal_inflow_shows_in_the_outflow_and_adding_it_closes_the_loop():
    hidden = CATALOGUE["diurnal_inflow"](amplitude=15.0)
    record = record_of(season("intermittent", 17, effects=(hidden,)))
    found = closed_loop(study_of(record, linear(record), after=(hidden,)))
    assert found.reason == "" and found.days == int(split(record.dates).sealed.sum())
    assert found.operators.r2 > 0.9
    before, after = found.baseline, found.augmented
    # the operators pass on the wave of 15 m3/s: its root mean square is missing in the outflow
    lacking = np.sqrt(before.outflow**2 - after.outflow**2)
    assert lacking == pytest.approx(15.0 / np.sqrt(2.0), rel=0.2)
    assert after.outflow < 0.6 * before.outflow and after.level < before.level
    assert before.open_level > 0.2 > after.open_level
    assert after.spread == pytest.approx(found.spread_measured, rel=0.35)
    shown = found.shown
    assert len(shown.level) == len(shown.outflow) == 3
    assert {len(c) for c in (shown.hour, shown.inflow, *shown.level, *shown.outflow)} == {650}
    i = record.dates.index(shown.date)
    assert split(record.dates).sealed[i]
    assert np.array(shown.level[0])[-1] == record.output[i, -1]
    plain = json.loads(Diagnosis("no_gap", "", "integrator-delay", closed_loop=found).to_json())
    assert "shown" not in plain["closed_loop"]
    assert plain["closed_loop"]["operators"]["trim_time_s"] == found.operators.trim_time_s
    assert plain["closed_loop"]["baseline"]["outflow"] == before.outflow


def test_errors_are_those_of_the_days_one_by_one():
    record = record_of(season("intermittent", 18, 30))
    reach = linear(record)
    study = study_of(record, reach)
    found = closed_loop(study)
    law = identify(record.take(study.split.fit))
    off_level, off_outflow, opened, spread = [], [], [], []
    for i in np.flatnonzero(study.split.sealed):
        day = record.take([i])
        level, outflow = run_day(reach, law, day, NO_CHANGES)
        there = day.used[0]
        off_level += list((level - day.output[0])[there])
        off_outflow += list((outflow - day.outflow[0])[there])
        spread += list(level[there] - level[there].mean())
        free = reach.simulate(day)[0]
        k = int(np.argmax(there))
        off = np.nanmean((day.output[0] - free)[k - 4 : k + 1])
        opened += list((free + off - day.output[0])[there])
    expected = [np.sqrt(np.mean(np.square(x))) for x in (opened, off_level, off_outflow, spread)]
    assert dataclasses.astuple(found.baseline) == pytest.approx(expected)
    assert found.baseline == found.augmented


def test_without_operators_or_a_reach_that_can_be_run_there_is_no_loop(monkeypatch):
    logged = record_of(season("intermittent", 18, 30))
    shuffled = logged.outflow[np.random.default_rng(20).permutation(logged.days)]
    found = closed_loop(study_of(dataclasses.replace(logged, outflow=np.roll(shuffled, 200, axis=1)), None))
    assert found.baseline is None and found.shown is None and found.operators.r2 < 0.5
    assert "expected 50 % or more" in found.reason
    still = np.full(logged.time.shape, 200.0)
    found = closed_loop(study_of(dataclasses.replace(logged, outflow=still), None))
    assert found.operators is None and "hardly moves" in found.reason
    assert closed_loop(study_of(dataclasses.replace(logged, kind="river"), None)) is None
    assert gauge_of(logged, NO_CHANGES).shape == logged.time.shape

    def dry(*_):
        raise RividError("the reach runs dry")

    monkeypatch.setattr(loops, "run_day", dry)
    found = closed_loop(study_of(logged, linear(logged)))
    assert found.baseline is None and found.reason.endswith("to the end of 0 days only.")
