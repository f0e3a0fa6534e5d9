"""Test the gap by regime: each state against a plain loop, and that the states together give the gap."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from rivid.diagnosis import answer
from rivid.diagnosis.answer import AFTER, RISE, STEP, _named, _unknown, after_step, regimes, states
from rivid.diagnosis.blocks import split
from rivid.diagnosis.events import Event
from rivid.diagnosis.fit import HOURS, day_errors
from rivid.diagnosis.localise import Place
from rivid.diagnosis.noise.model import NoiseModel
from rivid.effects.timing import GateDeadband
from tests.diagnosis.answers import evidence_of, record_of

NOISE = NoiseModel(0.002, 0.001, 1.0, 7200.0, 0.0, 100.0, 900.0, 6.7e5)
EVIDENCE = evidence_of(record_of(days=20, n=96))
WHOLE = (("inflow_low", "inflow_middle", "inflow_high"), ("after_step", "calm"), ("night", "day"))


def study_of(evidence=EVIDENCE, coded=None):
    record = evidence.record
    coded = np.zeros(record.time.shape) if coded is None else coded
    return SimpleNamespace(
        record=record, split=split(record.dates),
        first=SimpleNamespace(predicted=evidence.residual_before, noise=NOISE),
        last=SimpleNamespace(predicted=evidence.residual_after, noise=NOISE, coded=coded),
    )  # fmt: skip


@pytest.mark.parametrize("names", WHOLE, ids=lambda names: names[0])
def test_the_states_of_a_kind_together_are_the_gap(names):
    study = study_of()
    found = {r.name: r for r in regimes(study)}
    for which, residual in (("baseline", EVIDENCE.residual_before), ("augmented", EVIDENCE.residual_after)):
        whole = day_errors(study.record, residual, NOISE)
        expected = whole.rmse(study.split.sealed)
        assert np.isfinite(expected).all()
        for h in range(len(HOURS)):
            counts = np.array([found[name].targets[h] for name in names], float)
            errors = np.array([getattr(found[name], f"rmse_{which}")[h] for name in names])
            assert counts.sum() == whole.counts[h, study.split.sealed].sum()
            squares = np.where(counts > 0, counts * errors**2, 0.0).sum()
            assert np.sqrt(squares / counts.sum()) == pytest.approx(expected[h])


def test_terciles_split_the_samples_and_name_their_flows():
    record = EVIDENCE.record
    low, middle, high = states(record)[:3]
    share = [(s[2] & record.used).sum() / record.used.sum() for s in (low, middle, high)]
    assert share == pytest.approx([1 / 3] * 3, abs=0.02)
    assert record.inflow[low[2]].max() < record.inflow[high[2]].min()
    limit = np.quantile(record.inflow[record.used], 2 / 3)
    assert high[1] == f"inflow of {limit:.0f} m³/s or more"


def test_samples_after_a_step_are_those_of_a_plain_loop():
    record = EVIDENCE.record
    found, size = after_step(record)
    low, high = np.quantile(record.outflow[record.used], [0.05, 0.95])
    assert size == pytest.approx(STEP * (high - low))
    rise, after = round(RISE / 900.0), round(AFTER / 900.0)
    for day in (0, 7):
        u = record.outflow[day]
        ends = [k for k in range(rise, len(u)) if abs(u[k] - u[k - rise]) >= size]
        expected = [any(0 <= k - end <= after for end in ends) for k in range(len(u))]
        assert found[day].tolist() == expected
    assert 0.1 < found[record.used].mean() < 0.9


def test_night_is_from_22_to_6():
    record = EVIDENCE.record
    (night,) = (s for s in states(record) if s[0] == "night")
    hours = record.hour[night[2]]
    assert ((hours >= 22.0) | (hours < 6.0)).all()
    assert night[2].mean() == pytest.approx(1 / 3, abs=0.15)  # the lead time is at night


def test_an_error_counts_where_the_forecast_ends():
    record = EVIDENCE.record
    residual = np.where(np.isfinite(record.output), 0.0, np.nan)
    night = next(s[2] for s in states(record) if s[0] == "night")
    # only forecasts that end or begin at night have an error
    residual[night] += 0.05 * np.random.default_rng(2).standard_normal(int(night.sum()))
    study = study_of()
    study.first.predicted = residual
    found = {r.name: r for r in regimes(study)}
    # one of 16 simulations that end by day, an hour ahead, began at night
    assert found["night"].rmse_baseline[0] > 2.0 * found["day"].rmse_baseline[0]
    assert sum(found["night"].targets) > 0


def test_events_of_the_day_are_unknown_to_a_forecast():
    record = EVIDENCE.record
    coded = 0.1 * np.sin(2 * np.pi * record.hour / 6.0)
    plain = {r.name: r for r in regimes(study_of())}
    coded_gap = {r.name: r for r in regimes(study_of(coded=coded))}
    assert coded_gap["day"].rmse_baseline == plain["day"].rmse_baseline
    assert coded_gap["day"].rmse_augmented[0] > 1.5 * plain["day"].rmse_augmented[0]


def test_a_river_has_no_steps_of_an_outflow():
    names = {s[0] for s in states(record_of(kind="river"))}
    assert names == {"inflow_low", "inflow_middle", "inflow_high", "night", "day"}


def test_a_state_that_is_always_there_is_left_out():
    record = EVIDENCE.record
    still = dataclasses.replace(
        record, inflow=np.full(record.time.shape, 200.0), outflow=np.full(record.time.shape, 200.0)
    )
    assert [s[0] for s in states(still)] == ["night", "day"]
    assert not after_step(still)[0].any()


def estimated(errors):
    """Return the estimate of a dead-band of 7 m3/s, with commands that are multiples of 2 m3/s."""
    rng = np.random.default_rng(0)
    outflow = 300.0 + 2.0 * rng.integers(0, 9, EVIDENCE.record.outflow.shape)
    record = dataclasses.replace(EVIDENCE.record, outflow=outflow)
    effect = GateDeadband(band=7.0)
    last = SimpleNamespace(effects=(effect,), events=(), errors_of=lambda index: dict(errors))
    study = SimpleNamespace(
        record=record, last=last, sure=("gate_deadband",), group=(), names=("gate_deadband",),
        steps=(SimpleNamespace(added=effect, events=()),), chance_of=lambda name, times: 0.99,
        p_value=lambda step: 0.01, split=split(record.dates), opened=~split(record.dates).sealed,
    )  # fmt: skip
    (found,) = _named(study, {})
    return found.parameters[0]


@pytest.mark.parametrize("errors", [{("band", None): 0.05}, {}], ids=["free", "not free"])
def test_the_interval_of_a_dead_band_holds_all_bands_between_two_commands(errors):
    """Bands of 6.1 and of 7.9 give the same flows."""
    found = estimated(errors)
    assert found.low < 6.1 < 7.9 < found.high
    assert found.high - found.low < 4.0  # commands of 4 and 10 m3/s would differ


def test_an_interval_ends_at_the_limits_of_its_parameter():
    found = estimated({("band", None): 5.0})
    assert found.low == 0.0 and found.high > 15.0


def left_of(hours=2.0, shape="pulse", rows=(3, 5, 8, 12), evidence=EVIDENCE):
    """What is left where the likeliest explanation has events without a name, which begin in these rows."""
    events = tuple(Event(day, 36_000.0, hours * 3600.0, 40.0, 1.0, False) for day in rows)
    one = SimpleNamespace(kind=SimpleNamespace(name="", shape=shape), events=events)
    days = evidence.record.days
    noise = dataclasses.replace(NOISE, sample_time=evidence.record.sample_time)
    last = SimpleNamespace(
        residual=evidence.residual_after, noise=noise, weights=np.ones(days), effects=(), events=(one,),
        unknown="flow",
    )  # fmt: skip
    study = SimpleNamespace(
        record=evidence.record, split=SimpleNamespace(block=np.arange(days)), last=last, start=(),
        unknown=1.0, stranger=last, unknown_delays=(),
    )  # fmt: skip
    return _unknown(study, evidence)


def test_pulses_give_the_days_of_what_is_left_unless_they_fill_the_time():
    record, found = EVIDENCE.record, left_of()
    assert found.drivers[0] == "4 pulses of about 40 m3/s that last 2 h"
    assert found.where.dates == (record.dates[3], record.dates[12])
    days = slice(3, 13)
    assert found.size_m3s == pytest.approx(EVIDENCE.inflow_after[days][record.used[days]].std(), rel=0.1)
    filled = left_of(hours=40.0)
    assert filled is None or "pulses" not in " ".join(filled.drivers)
    jumps = left_of(shape="jump")
    assert jumps.drivers[0] == "4 jumps of the reading, of 40 m at most" and jumps.where.dates is None


def test_samples_of_an_hour_are_too_few_for_a_swing_and_no_failure():
    found = left_of(evidence=evidence_of(record_of(days=20, n=24)))
    assert found.drivers[0].startswith("4 pulses") and not any("swing" in what for what in found.drivers)


def test_a_place_with_several_windows_gives_their_span_once(monkeypatch):
    dates = EVIDENCE.record.dates
    windows = (dates[2], dates[4]), (dates[9], dates[14])
    place = Place("discharge 283.2 to 365.3 m3/s", -6.11, 0.004, windows)
    monkeypatch.setattr(answer, "strongest", lambda *given: place)
    found = left_of(rows=())
    assert found.where.dates == (dates[2], dates[14]) and found.where.regime == "at 2 times"
    assert found.drivers[-1] == "discharge 283.2 to 365.3 m3/s (6.11 m3/s less)"
