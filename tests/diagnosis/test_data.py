"""Test days as rows with lead time, and the gap at its horizons."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest

from rivid.config import Config
from rivid.diagnosis.data import (
    FADED,
    NEAR,
    START_UP,
    activity,
    as_record,
    checked,
    joined,
    lead_of,
    read_record,
    with_activity,
)
from rivid.diagnosis.fit import DayErrors, day_errors, residual_of
from rivid.diagnosis.noise.model import NoiseModel
from rivid.effects.timing import ClockOffset
from rivid.errors import RividError
from rivid.reach.saint_venant import Channel, simulate
from tests.check.season import held, late, raised, scaled, sound

SECONDS = 900.0 * np.arange(96)
DATES = [dt.date(2024, 3, d) for d in (1, 2, 3, 6, 7)]
LEAD = 34


def record(**changes):
    rng = np.random.default_rng(0)
    u = np.cumsum(rng.standard_normal((5, 96)), axis=1)
    kept = {"inflow": 300 + u, "outflow": 300 + u, "output": 130 + 0.01 * u, "lead": LEAD} | changes
    return as_record(DATES, SECONDS, **kept, sample_time=900.0)


def test_a_row_begins_with_the_end_of_the_day_before_it():
    r = record()
    lead = LEAD
    assert r.lead == lead and r.time.shape == (5, 96 + lead)
    np.testing.assert_array_equal(r.inflow[1, :lead], r.inflow[0, -lead:])
    np.testing.assert_array_equal(r.output[2, :lead], r.output[1, -lead:])
    assert (np.diff(r.time, axis=1) == 900.0).all()
    assert r.time[3, lead] == 5 * 86_400.0


def test_commands_before_a_row_are_those_of_earlier_days_and_held_before_these():
    r, rest = record(), 96 - LEAD
    days = r.outflow[:, LEAD:]
    before = np.concatenate([days[0], days[1, :rest]])  # of the third day
    np.testing.assert_array_equal(r.earlier[2], before)
    np.testing.assert_array_equal(r.earlier[1], np.append(np.full(96, days[0, 0]), days[0, :rest]))
    for first in (0, 3):  # nothing precedes these days
        assert (r.earlier[first] == r.outflow[first, 0]).all()
    np.testing.assert_array_equal(r.take([2, 4]).earlier, r.earlier[[2, 4]])


def test_a_day_that_nothing_precedes_has_a_held_start_that_does_not_count():
    r = record()
    assert np.isnan(r.output[0, : r.lead]).all() and np.isnan(r.output[3, : r.lead]).all()
    assert (r.inflow[3, : r.lead] == r.inflow[3, r.lead]).all()
    assert not r.used[0, : 2 * r.lead].any() and r.used[0, 2 * r.lead :].all()
    assert r.used[1, r.lead - 1 :].all() and not r.used[1, : r.lead - 1].any()  # the last one before midnight


@pytest.mark.parametrize("every", [2, 3, 7])
def test_joined_samples_hold_the_mean_of_a_flow_and_of_the_readings_about_them(every):
    rng = np.random.default_rng(1)
    level = 130 + 0.01 * rng.standard_normal((5, 96))
    level[1, 40:50] = np.nan
    one, r = record(output=level), record(output=level, every=every)
    n = -(-96 // every)
    assert r.sample_time == every * 900.0 and r.lead == min(LEAD, n)
    assert r.time.shape == (5, n + min(LEAD, n)) and r.time[0, r.lead + 1] == every * 900.0
    half = (every - 1) // 2
    for day in range(5):
        for k in range(n):
            flow = one.inflow[day, LEAD + k * every : LEAD + min((k + 1) * every, 96)].mean()
            assert r.inflow[day, r.lead + k] == pytest.approx(flow)
            about = level[day, max(k * every - half, 0) : k * every + half + 1]
            mean = about[np.isfinite(about)].mean() if np.isfinite(about).any() else np.nan
            assert r.output[day, r.lead + k] == pytest.approx(mean, nan_ok=True)


@pytest.mark.parametrize(
    ("sample_time", "every"), [(1.0, 150), (10.0, 15), (60.0, 2), (133.0, 1), (900.0, 1)]
)
def test_short_samples_are_joined_and_the_delay_keeps_some_of_them(sample_time, every):
    far = Config.model_validate({"reach": DEEP | {"sample_time": sample_time, "length": 9000.0}})
    assert joined(far, sample_time) == every
    near = Config.model_validate({"reach": DEEP | {"sample_time": sample_time, "length": 1500.0}})
    delay = near.reach.proposal().delay_scale + 1.0
    assert 1 <= joined(near, sample_time) <= max(1, delay / 4)


def test_a_record_of_short_samples_has_a_note_and_the_volumes_of_its_logs(tmp_path):
    rng = np.random.default_rng(2)
    flows = 300.0 + np.round(np.repeat(rng.standard_normal((2, 48)), 60, axis=1) * 9.0, 3)  # each for 30 min
    for date, flow in zip(DATES[:2], flows, strict=True):
        midnight = dt.datetime.combine(date, dt.time())
        rows = (
            f"{midnight + dt.timedelta(seconds=30 * k):%Y-%m-%dT%H:%M:%SZ},{u},{u},130.1"
            for k, u in enumerate(flow)
        )
        (tmp_path / f"{date}.csv").write_text("\n".join(["time,u_Qi,u_Qo,h_L", *rows]) + "\n")
    config = Config.model_validate({"reach": DEEP | {"sample_time": 30.0, "length": 9000.0}})
    found, known = read_record(tmp_path, config)
    assert found.sample_time == 150.0 and "5 samples of 30 s were joined to one of 150 s" in known.notes
    np.testing.assert_allclose(found.inflow[:, found.lead :].mean(axis=1), flows.mean(axis=1))


def test_some_days_keep_their_times():
    r = record()
    some = r.take([1, 4])
    assert some.dates == (DATES[1], DATES[4])
    np.testing.assert_array_equal(some.time, r.time[[1, 4]])
    assert r.day_number.tolist() == [0, 1, 2, 5, 6]
    world = r.world()
    assert world.first_day == DATES[0] and world.level == pytest.approx(np.median(r.output[r.used]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inflow": np.zeros((5, 90))}, "inflow has shape"),
        ({"outflow": np.full((5, 96), np.nan)}, "outflow of 2024-03-01 has gaps"),
    ],
)
def test_days_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(RividError, match=message):
        record(**changes)
    with pytest.raises(RividError, match="out of order"):
        as_record(
            DATES[::-1], SECONDS, np.zeros((5, 96)), None, np.zeros((5, 96)), sample_time=900.0, lead=LEAD
        )


def test_the_gap_is_the_error_of_a_forecast_by_hand():
    r = record()
    noise = NoiseModel(0.003, 1e-4, 1.0, 20_000.0, 0.0, 1e4, 900.0, 6.7e5)
    z = 0.01 * np.random.default_rng(1).standard_normal(r.output.shape)
    residual = residual_of(r, r.output - z)
    np.testing.assert_allclose(residual[np.isfinite(r.output)], z[np.isfinite(r.output)], atol=1e-12)
    errors = day_errors(r, residual, noise, (1.0, 4.0))
    ahead = noise.forecast_errors(residual, 4, every=4, first=2)
    targets = np.arange(2, residual.shape[1] - 4, 4) + 4
    seen = np.isfinite(ahead) & r.used[:, targets]
    by_hand = np.sqrt((np.where(seen, ahead, 0.0) ** 2).sum() / seen.sum())
    assert errors.rmse()[0] == pytest.approx(by_hand)


def test_days_without_targets_have_no_error():
    errors = DayErrors(np.array([[4.0, 0.0]]), np.array([[1.0, 0.0]]))
    assert errors.rmse([0])[0] == 2.0 and np.isnan(errors.rmse([1])[0])


N, DELAY, RAMP = 200, 12, 2e-4
UP = RAMP * np.clip(np.arange(N) - DELAY + 1.0, 0.0, None)
DOWN = RAMP * np.arange(1.0, N + 1.0)
ARRIVED = 1.0 - np.exp(-np.clip(np.arange(N) - DELAY + 1.0, 0.0, None) / 5.0)


def flows(inflow, outflow=None, kind="pool"):
    """Return rows with these changes of the flows, by sample."""
    r = as_record(
        DATES, 432.0 * np.arange(N), np.zeros((5, N)), None if kind == "river" else np.zeros((5, N)),
        np.zeros((5, N)), sample_time=432.0, lead=START_UP, kind=kind,
    )  # fmt: skip
    for flow, moves in ((r.inflow, inflow), (r.outflow, outflow or {})):
        for at, size in moves.items():
            flow[:, at:] += size
    return r


def test_a_step_of_the_inflow_shows_at_the_delay_and_one_of_the_outflow_at_once():
    for moves, seen in ((({60: 30.0}, {}), 60 + DELAY), (({}, {60: 30.0}), 60)):
        found = activity(flows(*moves), UP, DOWN)
        assert found.shape == flows(*moves).time.shape
        there = np.flatnonzero(found[0] > 1e-12)
        half = max(round(NEAR * DELAY), 1)
        assert there.tolist() == list(range(seen - half, seen + half + 1))
        assert found[0].sum() == pytest.approx((30.0 * RAMP) ** 2)  # its energy is conserved


def test_forecasts_do_not_start_from_what_a_row_assumes_of_the_time_before_it():
    """Regression: a flow on its way at the start of a row was weather for its first forecast."""
    rng = np.random.default_rng(2)
    r = as_record(
        DATES[:3], 432.0 * np.arange(N), 300.0 + np.repeat(rng.normal(0.0, 50.0, (3, N // 10)), 10, axis=1),
        np.zeros((3, N)), np.zeros((3, N)), sample_time=432.0, lead=DELAY + 4,
    )  # fmt: skip
    every = np.concatenate([r.inflow[0, : r.lead], *r.inflow[:, r.lead :]])
    came = np.concatenate([np.full(DELAY, every[0]), every])[: len(every)]
    level = np.concatenate([[0.0], RAMP * np.cumsum(came)[:-1]])  # of one simulation over all days
    rows = np.stack([level[day * N :][: N + r.lead] for day in range(3)])
    late = np.concatenate([np.repeat(r.inflow[:, :1], DELAY, axis=1), r.inflow], axis=1)[:, : N + r.lead]
    base = np.concatenate([np.zeros((3, 1)), RAMP * np.cumsum(late, axis=1)[:, :-1]], axis=1)
    r = replace(r, output=rows)
    noise = NoiseModel(1e-3, 1e-5, 5.0, 20_000.0, 0.0, 1e4, 432.0, 432.0 / RAMP)
    seen = with_activity(r, UP, DOWN)
    assert seen.blind in (DELAY, DELAY + 1)
    wrong, right = (
        day_errors(one, residual_of(one, base), noise, (1.0, 4.0)).rmse([1, 2]) for one in (r, seen)
    )
    assert (right < 1e-9).all() and (wrong > 0.005).all()


def test_activity_is_that_of_a_plain_loop_and_grows_with_the_square_of_the_flows():
    moves = {40: 20.0, 46: -8.0, 47: 5.0}, {44: 12.0, 90: -30.0}
    for kind, up, down in (("pool", UP, DOWN), ("river", ARRIVED, np.zeros(N))):
        r = flows(*moves, kind=kind) if kind == "pool" else flows(moves[0], kind=kind)
        found = activity(r, up, down)
        order = 2 if kind == "pool" else 1
        n = r.time.shape[1]
        total = np.zeros(n)
        for flow, kernel in ((r.inflow[0], up), (r.outflow[0], down)):
            level = np.zeros(n)
            for k in range(1, n):
                for j in range(k, n):
                    level[j] += (flow[k] - flow[k - 1]) * (kernel[j - k] if j - k < N else kernel[-1])
            total += np.diff(level, n=order, prepend=np.zeros(order)) ** 2
        rate = np.abs(np.diff(up, n=order, prepend=np.zeros(order)))
        half = max(round(NEAR * float(np.arange(N) @ rate / rate.sum())), 1)
        inner = range(half, min(n, N) - half)
        expected = [total[k - half : k + half + 1].mean() for k in inner]
        assert found[0, inner] == pytest.approx(expected, abs=1e-12)
        twice = replace(r, inflow=3.0 * r.inflow, outflow=3.0 * r.outflow)
        np.testing.assert_allclose(activity(twice, up, down), 9.0 * found, atol=1e-12)
        assert (found >= 0.0).all()


def left_out(days, config):
    """Return the numbers of the days that are left out, and the known findings."""
    left, known = checked(days, config)
    there = [day.date for day in left]
    assert there == sorted(there)
    return [k for k, day in enumerate(days) if day.date not in there], known


@pytest.mark.parametrize("names", [("output",), ("inflow", "outflow", "output")])
def test_copied_days_are_left_out_with_a_note_and_sound_days_are_not(names):
    days, config = sound(22)
    assert left_out(days, config) == ([], ((), ()))
    copy = [replace(day, **{n: getattr(days[3], n) for n in names}) if k == 7 else day
            for k, day in enumerate(days)]  # fmt: skip
    gone, known = left_out(copy, config)
    assert gone == [3, 7] and not known.dated
    (note,) = known.notes
    assert note.startswith("left out; rivid check finds: 2008-01-04, 2008-01-08 (2 days): the same samples")


def test_of_a_stuck_gauge_and_of_a_spike_these_values_are_left_out_alone():
    days, config = sound(22)
    hour = np.arange(len(days[0].output)) * 133 / 3600
    days = raised(held(held(days, 5, 8, 13), 8, 0, 24), 10, 7, -100.0, samples=3)
    left, known = checked(days, config)
    by_date = {day.date: np.isnan(day.output) for day in left}
    assert days[8].date not in by_date and len(left) == 21
    stuck, spike = by_date.pop(days[5].date), by_date.pop(days[10].date)
    assert stuck[(hour > 8.2) & (hour < 12.8)].all() and not stuck[(hour < 7) | (hour > 14)].any()
    assert np.isnan(left[4].output).sum() == 0 and not any(gone.any() for gone in by_date.values())
    assert (days[10].output[spike] < 50).sum() == 3 and spike.sum() <= 5
    assert [note.split(":")[0] for note in known.notes] == ["left out; rivid check finds"] * 2


def test_a_jump_is_left_to_the_search_unless_it_is_on_a_sealed_day():
    days, config = sound(22)
    for day, gone in ((16, []), (13, [13])):
        out, known = left_out(raised(days, day, 10, 0.5), config)
        assert out == gone and known.notes[0].startswith("left out" if gone else "kept")
    copied = [replace(day, output=days[3].output) if k == 0 else day for k, day in enumerate(days)]
    gone, _ = left_out(raised(copied, 16, 10, 0.5), config)  # blocks begin on the first remaining day
    assert gone == [0, 3]
    gone, _ = left_out(raised(copied, 15, 10, 0.5), config)
    assert gone == [0, 3, 15]


@pytest.mark.parametrize("seconds", [3600, pytest.param(-3600, marks=pytest.mark.long)])
def test_the_dates_of_a_shifted_inflow_are_known(seconds):
    days, config = sound(30)
    gone, known = left_out(late(days, seconds, "inflow", among=slice(15, 18)), config)
    (clock,) = known.dated
    assert gone == [] and known.notes[0].startswith("kept; rivid check finds: 2008-01-16 to 2008-01-18")
    assert clock.dates == (days[15].date, days[17].date)
    assert isinstance(clock, ClockOffset) and clock.offset == pytest.approx(seconds, abs=300)
    gone, known = left_out(late(days, seconds, "inflow", among=slice(12, 15)), config)
    assert gone == [12, 13, 14] and not known.dated  # held-out days
    shifted = late(days, seconds, "inflow", among=slice(13, 16))
    copied = [replace(day, output=days[3].output) if k == 0 else day for k, day in enumerate(shifted)]
    assert left_out(copied, config)[0] == [0, 3, 13, 14, 15]  # held-out days, once the first day is left out
    gone, known = left_out(late(days, seconds, "output", among=slice(15, 18)), config)
    assert gone == [] and not known.dated and len(known.notes) == 1


def test_a_unit_of_some_days_leaves_them_out_and_a_unit_of_all_does_not():
    days, config = sound(22)
    assert left_out(scaled(days, 35.3147, "outflow", among=slice(5, 9)), config)[0] == [5, 6, 7, 8]
    gone, known = left_out(scaled(days, 35.3147, "outflow"), config)
    assert gone == [] and known.notes[0].startswith("kept; ")


DEEP = {"length": 6000.0, "width": 90.0, "depth": 10.0, "discharge_range": (200.0, 600.0)}


def test_a_simulation_has_forgotten_its_start_after_the_lead_of_its_pool():
    """After the lead time, the remaining waves of a pulse of the inflow are those given by friction."""
    T_s, inflow = 60.0, np.full((1, 1), 400.0)
    config = Config.model_validate({"reach": DEEP | {"sample_time": T_s}})
    lead = lead_of(config, inflow, T_s)
    pool = Channel.smooth(6000.0, 90.0, 5e-5, 0.03, 24)
    time = T_s * np.arange(2 * lead)
    flow = np.full(len(time), 400.0)
    still = simulate(pool, time, flow, flow, 10.0).level
    pulse = flow.copy()
    pulse[0] = 900.0  # its volume remains: the mean at the end is subtracted
    swing = simulate(pool, time, pulse, flow, 10.0).level - still
    swing -= swing[-lead // 4 :].mean()
    first, last = np.abs(swing[:60]).max(), np.abs(swing[lead:]).max()
    assert np.exp(-FADED) / 4.0 < last / first < 2.0 * np.exp(-FADED)


def test_the_lead_is_no_shorter_than_the_start_up_and_no_longer_than_a_day():
    for width, flow, expected in ((20.0, 600.0, START_UP), (90.0, 0.0, 1440)):
        config = Config.model_validate({"reach": DEEP | {"width": width, "depth": 3.0, "sample_time": 60.0}})
        delay = config.reach.proposal().d_max // 2
        assert lead_of(config, np.full((1, 1), flow), 60.0) == delay + expected
