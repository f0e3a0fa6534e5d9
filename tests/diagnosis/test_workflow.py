"""Test the whole workflow on short seasons of the linear pool of known truth."""

import datetime as dt
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rivid.diagnosis.answer import USUAL, breaker
from rivid.diagnosis.decision import TEMPER, alike, ranked
from rivid.diagnosis.explanation import FRESH, STEPS, Explanation, Way, fitted
from rivid.diagnosis.fit import ENOUGH, Model
from rivid.diagnosis.noise.model import NoiseModel
from rivid.diagnosis.response.base import vector_of
from rivid.diagnosis.workflow import HOPE, LEAST, _as_twin, _Search, diagnose, find_effects
from rivid.effects import CATALOGUE
from rivid.effects.flow import PassingFlow, RecurringFlow
from rivid.errors import RividError
from tests.diagnosis import pools, responses
from tests.diagnosis.studies import MODEL, OPEN, SPLIT, explained, study_of

DAYS, T_S = 20, 600.0


def season(*hidden, seed=6):
    return pools.season(seed, DAYS, hidden, T_S)


def answer(record, *names, responses=None, **others):
    classes = {name: CATALOGUE[name] for name in names}
    given = pools.nominal(record) if responses is None else responses
    return diagnose(record, given, classes, gauge_floor=pools.GAUGE_FLOOR, most=4, **others)


def number(effect, name):
    return next(p for p in effect.parameters if p.name == name)


class Broken:
    """A response that raises when it is run."""

    name = "broken"
    parameters = ()
    surface_area = 6.7e5

    def baseline(self, record, changes=None):
        raise RividError("no water")

    simulate = settled = with_parameters = baseline


def test_nothing_is_named_where_nothing_is_missing_and_a_broken_response_is_passed_over():
    record = season()
    reports = []
    result, evidence = answer(
        record, "diurnal_inflow", "outflow_lag", "sensor_step", responses=[pools.nominal(record), Broken()],
        report=lambda done, what: reports.append((done, what)),
    )  # fmt: skip
    assert result.verdict == "no_gap" and not result.effects, result.reason
    assert result.reach_response == "integrator-delay" and any("no water" in note for note in result.notes)
    assert sum(row.probability for row in result.ranking) == pytest.approx(1.0, abs=1e-6)
    assert result.ranking[0].names == () and result.ranking[0].unknown is None
    assert {row.unknown for row in result.ranking} >= {None, "flow", "gauge"}
    assert evidence.inflow_after_sd.shape == record.time.shape
    assert np.array_equal(evidence.residual_before, evidence.residual_after, equal_nan=True)
    assert np.abs(evidence.inflow_after[record.used]).mean() < 3.0  # weather of 2 m3/s
    done = [share for share, _ in reports]
    assert done == sorted(done) and done[0] == 0.0 and done[-1] == 1.0


def test_a_daily_wave_is_named_with_its_size_and_hour_and_closes_the_gap():
    record = season(CATALOGUE["diurnal_inflow"](amplitude=20.0, hour=9.0))
    # With the whole catalogue: among two names an unknown daily flow has a prior probability of an eighth,
    # and a probability of 0.1 remains.
    result, evidence = answer(record, *CATALOGUE, floor=(0.01, 0.02, 0.03))
    assert result.verdict == "explained", result.reason
    (effect,) = result.effects
    assert effect.name == "diurnal_inflow" and effect.probability > 0.95 and not effect.tied_with
    for name, truth, off in (("amplitude", 20.0, 3.0), ("hour", 9.0, 0.5)):
        found = number(effect, name)
        assert found.value == pytest.approx(truth, abs=off) and found.low < truth < found.high
    gap = result.gap
    assert gap.rmse_augmented[1] < 0.5 * gap.rmse_baseline[1] and gap.closed > 0.5
    assert [step.added for step in gap.steps] == ["diurnal_inflow"]
    before, after = (w[record.used] for w in (evidence.inflow_before, evidence.inflow_after))
    assert after.std() < 0.5 * before.std()
    wave = 20.0 * np.cos(2 * np.pi * (record.hour - 9.0) / 24.0)[record.used]
    assert np.corrcoef(before, wave)[0, 1] > 0.8


def test_a_dead_band_is_named_with_the_commands_between_which_it_is():
    """Commands are whole m3/s; the gate seldom rests where the command is when a day begins."""
    record = season(CATALOGUE["gate_deadband"](band=14.2))
    result, _ = answer(record, "gate_deadband", "sensor_step", "unlogged_downstream_release", "outflow_lag")
    assert result.verdict == "explained" and [e.name for e in result.effects] == ["gate_deadband"]
    band = number(result.effects[0], "band")
    assert 14.0 < band.value < 15.0 and 13.0 < band.low < 14.2 < band.high < 16.0


@pytest.mark.long
def test_of_two_gains_that_look_alike_the_true_one_is_in_the_answer():
    record = season(CATALOGUE["outflow_gain_error"](error=0.04))
    result, _ = answer(record, "outflow_gain_error", "inflow_gain_error")
    assert result.verdict in ("explained", "cannot_tell"), result.reason
    (effect,) = result.effects
    assert "outflow_gain_error" in (effect.name, *effect.tied_with)
    error = number(effect, "error")
    truth = 0.04 if effect.name == "outflow_gain_error" else 1.0 / 1.04 - 1.0
    assert error.low < truth < error.high
    assert (effect.breaker is not None) == (result.verdict == "cannot_tell")


@pytest.mark.long
def test_an_unknown_gauge_that_errs_as_by_wind_is_wind_where_that_may_be_named():
    record = season(CATALOGUE["wind_setup"](deviation=0.03, correlation_time=2.0))
    result, _ = answer(record, "wind_setup", "diurnal_inflow")
    assert result.verdict == "explained" and [e.name for e in result.effects] == ["wind_setup"]
    assert number(result.effects[0], "deviation").value == pytest.approx(0.03, rel=0.3)
    result, _ = answer(record, "diurnal_inflow")
    assert result.verdict == "unknown" and not result.effects
    assert result.ranking[0].unknown == "gauge"


def test_steps_of_the_gauge_are_named_with_their_times():
    steps, starts = (0.08, -0.08, 0.06), (100.0, 210.0, 380.0)
    record = season(CATALOGUE["sensor_step"](step=steps, start=starts))
    result, _ = answer(record, "sensor_step", "diurnal_inflow")
    assert result.verdict == "explained", result.reason
    (effect,) = result.effects
    assert effect.name == "sensor_step" and effect.events == 3
    assert effect.table["start"] == pytest.approx(starts, abs=0.3)
    assert effect.table["step"] == pytest.approx(steps, abs=0.02)
    for k, truth in enumerate(steps):
        found = number(effect, f"step[{k}]")
        assert found.low - 0.01 < truth < found.high + 0.01


def test_a_cause_that_is_in_no_library_gets_no_name():
    """The cause is a daily wave of 40 m3/s; only a late gate, gauge steps and releases may be named."""
    record = season(CATALOGUE["diurnal_inflow"](amplitude=40.0, hour=9.0))
    result, _ = answer(record, "outflow_lag", "sensor_step", "unlogged_upstream_release")
    assert result.verdict == "unknown" and not result.effects, result.reason
    best = result.ranking[0]
    assert best.unknown == "flow" and best.gain > 20.0 and best.probability > 0.5
    assert result.unknown.size_m3s == pytest.approx(40.0 / np.sqrt(2.0), rel=0.3)
    assert result.next_measurement == USUAL["flow"]


def test_a_flow_that_returns_with_a_period_of_its_own_is_unknown_with_that_period():
    hidden = RecurringFlow(waves=(8.0, 0.0, 3.0, 0.0, 0.0, 0.0), period=7.3)
    result, _ = answer(season(hidden), "diurnal_inflow", "lateral_inflow")
    assert result.verdict == "unknown" and not result.effects, result.reason
    assert "a rhythm with a period of 7.3 h" in result.reason
    assert result.unknown.size_m3s == pytest.approx(np.sqrt((8.0**2 + 3.0**2) / 2.0), rel=0.15)
    assert result.ranking[0].unknown == "flow" and result.ranking[0].probability > 0.9


@pytest.mark.parametrize(
    ("name", "size", "truth", "other"),
    [("gate_head_effect", "gain", 0.5, "outflow_gain_error"), ("leakage", "loss", 60.0, "lateral_inflow")],
)
def test_what_follows_the_level_has_a_reference_of_its_own_and_nothing_beside_it(name, size, truth, other):
    """Regression: with the usual level as the reference another effect was named as well."""
    record = season(CATALOGUE[name](**{size: truth, "reference": 0.06}))
    result, _ = answer(record, name, other)
    assert result.verdict == "explained", result.reason
    (effect,) = result.effects
    assert effect.name == name and effect.tied_with == ()
    found, reference = number(effect, size), number(effect, "reference")
    assert found.low < truth < found.high and found.high - found.low < 0.2 * truth
    assert reference.low < pools.LINEAR.level.set_point + 0.06 - record.usual_output < reference.high
    assert reference.high - reference.low < 0.1


def test_a_governor_that_hunts_is_unknown_with_its_period_and_size():
    """A late gate or a flow that follows the level would compensate for a swing that the level repeats."""
    hidden = RecurringFlow(waves=(25.0, 0.0, 0.0, 0.0, 0.0, 0.0), period=1700.0 / 3600.0)
    result, _ = answer(season(hidden), "outflow_lag", "gate_head_effect")
    assert result.verdict == "unknown" and not result.effects, result.reason
    assert "a rhythm with a period of 28.3 min" in result.reason
    assert result.unknown.size_m3s == pytest.approx(25.0 / np.sqrt(2.0), rel=0.15)


LOCK = CATALOGUE["unlogged_downstream_release"](size=60.0, per_day=2.0, duration=1.0)
KNOCKED = CATALOGUE["sensor_step"](step=(0.2, -0.2, 0.1), start=(105.0, 230.0, 371.0))


@pytest.mark.parametrize(
    "hidden, left",
    [pytest.param(LOCK, "pulses of about", marks=pytest.mark.long), (KNOCKED, "jumps of the reading")],
)
def test_events_that_no_effect_of_the_library_makes_are_unknown(hidden, left):
    result, _ = answer(season(hidden), "lateral_inflow", "storage_area_slope", "leakage")
    assert result.verdict == "unknown" and not result.effects, result.reason
    assert any(left in driver for driver in result.unknown.drivers), result.unknown.drivers


def test_an_effect_that_is_known_from_the_start_leaves_no_gap():
    hidden = CATALOGUE["outflow_gain_error"](error=0.04)
    record = season(hidden)
    result, _ = answer(record, "inflow_gain_error", start=(hidden,))
    assert result.verdict == "no_gap" and not result.effects
    assert all(row.names[:1] == ("outflow_gain_error",) for row in result.ranking)


@pytest.mark.long
def test_a_clock_of_two_days_is_named_where_its_dates_are_known():
    """Two days are shorter than any window of the search, and an hour is longer than any of its trials."""
    first = season().dates[15]
    hidden = CATALOGUE["clock_offset"](offset=-3600.0, dates=(first, first + dt.timedelta(days=1)))
    record = season(hidden)
    rough = hidden.with_values(offset=-3300.0)
    (effect,) = answer(record, "clock_offset", "sensor_step", dated=(rough,))[0].effects
    assert effect.name == "clock_offset" and effect.where.dates == hidden.dates
    assert number(effect, "offset").value == pytest.approx(-3600.0, abs=60.0)


@pytest.mark.long
def test_a_clock_of_two_days_is_not_named_without_its_dates_or_where_it_is_excluded():
    first = season().dates[15]
    hidden = CATALOGUE["clock_offset"](offset=-3600.0, dates=(first, first + dt.timedelta(days=1)))
    record = season(hidden)
    assert not answer(record, "clock_offset", "sensor_step")[0].effects
    dated = (hidden.with_values(offset=-3300.0),)
    result, _ = answer(record, "outflow_lag", "sensor_step", dated=dated)  # it is not in the library
    assert "clock_offset" not in {name for row in result.ranking for name in row.names}


def test_few_days_still_flows_and_an_empty_library_give_no_answer():
    record = season()
    few = record.take(range(9))
    result, evidence = answer(few, "leakage")
    assert result.verdict == "insufficient_data" and evidence is None and "9 days" in result.reason
    still = replace(record, inflow=0.0 * record.inflow + 300.0, outflow=0.0 * record.outflow + 300.0)
    result, evidence = answer(still, "leakage")
    assert result.verdict == "insufficient_data" and evidence is None and "never move" in result.reason
    result, evidence = answer(record)
    assert result.verdict == "insufficient_data" and evidence is None and "exclude" in result.reason


def test_responses_that_cannot_be_run_are_an_error():
    with pytest.raises(RividError, match="no water"):
        find_effects(season(), [Broken()], {"leakage": CATALOGUE["leakage"]}, most=4)


def test_every_effect_of_the_catalogue_is_tried_or_found_otherwise():
    tried = {name for name, effect in CATALOGUE.items() if effect.trials(season().world())}
    assert set(CATALOGUE) - tried == {"rain_inflow", "sensor_step", "wind_setup", "seiche"}


def test_every_trial_makes_an_effect_of_its_name_again():
    for trial in (t for effect in CATALOGUE.values() for t in effect.trials(season().world())):
        k = max(len(trial.effects), 1)
        made = trial.make(np.full(k, 0.8 * (trial.sign or 1)))
        assert made.name == trial.name
        assert all(hasattr(made, name) for name in trial.free), trial


def test_flows_that_hardly_move_make_no_trial_beyond_the_limits_of_its_effect():
    world = season().world()
    still = replace(world, inflow=world.flow + 1e-3 * (world.inflow - world.flow))
    delays = [one.delay for t in CATALOGUE["flow_dependent_delay"].trials(still) for one in t.effects]
    assert set(delays) == {-100.0, 100.0} and len(delays) == 2


def test_tied_effects_have_a_measurement_that_separates_them():
    leak, head, wave = (CATALOGUE[name] for name in ("leakage", "gate_head_effect", "diurnal_inflow"))
    assert breaker(leak, ()) is None
    assert "Hold the level" in breaker(leak, (head,))
    assert breaker(head, (wave, leak)) == breaker(leak, (head,))
    assert breaker(wave, (CATALOGUE["rain_inflow"],)) == USUAL["flow"]


@pytest.mark.parametrize(
    "one, other, mistaken",
    [
        (("inflow_gain_error",), ("outflow_gain_error",), True),
        (("outflow_gain_error",), ("inflow_gain_error",), True),
        (("inflow_gain_error", "wave_attenuation"), ("wave_attenuation", "outflow_gain_error"), True),
        (("inflow_gain_error",), ("inflow_gain_error",), False),
        (("inflow_gain_error",), ("wind_setup",), False),
        (("inflow_gain_error",), ("outflow_gain_error", "wave_attenuation"), False),
        (("inflow_gain_error", "leakage"), ("outflow_gain_error", "wave_attenuation"), False),
    ],
)
def test_rivals_that_are_easily_mistaken_differ_by_one_confounded_effect(one, other, mistaken):
    assert alike(explained_by(*one), explained_by(*other)) == mistaken


def explained_by(*names):
    return SimpleNamespace(names=names, effects=[CATALOGUE[name] for name in names])


@pytest.mark.parametrize(("response", "levelled"), [("linear", 1), ("another", 0)])
def test_what_the_lead_adds_is_added_to_rivals_of_the_same_response(response, levelled):
    """Regression: a candidate's columns belong to its response; with another response the diagnosis ended."""
    nothing = explained()
    leak = explained("leakage", 9.0, 0.5, parent=nothing)
    lead = explained("rain_inflow", 9.0, 0.5, parent=leak, way=Way("rain_inflow", print))
    model = SimpleNamespace(**{**vars(MODEL), "reach": SimpleNamespace(name=response)})
    rival = explained("gate_head_effect", 9.0, 0.5, parent=nothing, model=model)
    grown = []
    search = SimpleNamespace(
        pool=[nothing, leak, rival, lead], opened=OPEN, dealt=SPLIT, classes=CATALOGUE,
        _grow=lambda one, *_: grown.append(one),
    )  # fmt: skip
    _Search.level_rivals(search, lead)
    assert grown == [rival] * levelled


def test_the_lead_takes_a_share_of_the_error():
    """Regression: ponds gained 600 nats but no error, so a gain that took half of it was not extended."""
    nothing = explained()
    pond = explained("side_storage", 60.0, 0.0, parent=nothing)
    gain = explained("outflow_gain_error", 9.0, 0.5, parent=nothing)
    search = SimpleNamespace(
        ordered=lambda: [pond, gain, nothing], study=lambda: study_of(nothing, pond, gain)
    )  # fmt: skip
    assert _Search.lead(search) is gain
    search.ordered = lambda: [pond, nothing, gain]
    assert _Search.lead(search) is nothing
    waves = explained("", 0.0, 0.5, parent=pond, unknown="flow")  # material, and no likelier
    search.ordered = lambda: [pond, waves, gain, nothing]
    assert _Search.lead(search) is gain


@pytest.mark.parametrize(
    ("gained", "wanted"), [(99.0, "outflow_gain_error"), (0.5, "side_storage")], ids=["enough", "little"]
)
def test_where_nothing_leads_what_is_material_is_fitted_on_before_what_is_likelier(gained, wanted):
    """Regression: beside a likelier ice cover, a gain error kept dates that were wrong by a day."""
    nothing = explained()
    pond = replace(explained("side_storage", 120.0, 0.0, parent=nothing), count=(1, 0))
    gain = replace(explained("outflow_gain_error", gained, 0.5, parent=nothing), count=(1, 0))
    search = SimpleNamespace(
        ordered=lambda: [nothing, pond, gain], study=lambda: study_of(nothing, pond, gain),
        score=lambda one: float(one.density[OPEN].sum()), likeliest=lambda parent: pond,
    )  # fmt: skip
    assert _Search.probable(search, nothing).names == (wanted,)


def test_explanations_with_no_probability_are_in_the_order_of_their_scores():
    """Regression: far behind unknown waves all were even, and the first was not the likeliest."""
    nothing = explained()
    leak, release = (
        explained(n, g, 0.5, parent=nothing) for n, g in (("leakage", 2e3), ("rain_inflow", 4e3))
    )
    waves = explained("", 9e3, 0.5, parent=nothing, unknown="flow")
    pool = [nothing, leak, release, waves]
    study = study_of(*pool)
    search = SimpleNamespace(
        pool=pool, study=lambda: study, score=study.score, opened=OPEN, dealt=SPLIT
    )  # fmt: skip
    chances = ranked(pool, OPEN, SPLIT.block)
    assert (chances[:3] == 0.0).all()
    assert [(one.names, one.unknown) for one in _Search.ordered(search)] == [
        ((), "flow"), (("rain_inflow",), ""), (("leakage",), ""), ((), ""),
    ]  # fmt: skip


class Rounds:
    """A search without fits: a method that is not replaced returns its first argument."""

    def __init__(self, *given):
        pass

    def __getattr__(self, name):
        return lambda *given, **more: next(iter(given), None)


@pytest.mark.parametrize("found", [True, False])
def test_an_immaterial_lead_is_extended_once_and_no_explanation_twice(monkeypatch, found):
    """The likeliest effect is immaterial; with it, but not alone, another one is material, or none is."""
    first = explained()
    small = explained("wave_attenuation", 50.0, parent=first)
    both = explained("leakage", 60.0, parent=small)
    extended = []

    class Search(Rounds):
        pool = (first, small, both)
        score = staticmethod(lambda one: 0.0)
        begun = staticmethod(lambda: [first])
        ordered = staticmethod(lambda: [small])
        study = staticmethod(lambda: extended)

        def extend(self, parent):
            extended.append(parent.names)
            return parent

        def again(self, parent):
            return parent

        def lead(self):
            return both if found and small.names in extended else first

    monkeypatch.setattr("rivid.diagnosis.workflow._Search", Search)
    find_effects(pools.season(6, DAYS, (), T_S), (), {}, most=4)
    assert extended == [first.names, small.names] + found * [both.names]


@pytest.mark.parametrize(
    ("named", "likelier", "events"),
    [(True, False, ()), (False, False, ()), (False, True, ()), (False, True, ("pulses",))],
)
def test_unknown_waves_that_lead_are_extended_beside_a_name_only(monkeypatch, named, likelier, events):
    """Regression: the likeliest effect was not extended: an immaterial one, a rating behind waves.

    Beside unknown events that lead it stood for the rest of them.
    """
    first = explained()
    small = explained("flow_dependent_delay", 9.0, parent=first)
    parent = explained("leakage", 9.0, parent=first) if named else first
    waves = SimpleNamespace(
        names=parent.names, effects=(*parent.effects, RecurringFlow(waves=(1.0,) * 6)), unknown="flow",
        events=events, added=None,
    )  # fmt: skip
    extended = []

    class Search(Rounds):
        pool = (first, waves)
        score = staticmethod(lambda one: 0.0)
        begun = staticmethod(lambda: [first])
        ordered = staticmethod(lambda: [waves, small if likelier else first])
        study = staticmethod(lambda: extended)
        lead = staticmethod(lambda: first if len(extended) > 1 else waves)
        extend = staticmethod(lambda one: extended.append(one.names) or one)

    monkeypatch.setattr("rivid.diagnosis.workflow._Search", Search)
    find_effects(pools.season(6, DAYS, (), T_S), (), {}, most=4)
    beside = [small.names] if likelier and not events else []
    assert extended == [first.names] + named * [waves.names] + beside


def test_the_likeliest_extension_gets_its_dates_before_the_lead_is_chosen(monkeypatch):
    """Regression: with a begin two weeks early a stretch of a bypass was immaterial, and no lead."""
    first = explained()
    release = explained("unlogged_upstream_release", 9.0, parent=first)
    steps = []

    class Search(Rounds):
        pool = (first, release)
        score = staticmethod(lambda one: 0.0)
        begun = staticmethod(lambda: [first])
        ordered = staticmethod(lambda: [first])
        likeliest = staticmethod(lambda parent: release)
        shifted = staticmethod(lambda one, near=True: steps.append((one, near)) or one)
        study = staticmethod(lambda: steps)

        def lead(self):
            steps.append("lead")
            return first

    monkeypatch.setattr("rivid.diagnosis.workflow._Search", Search)
    assert find_effects(pools.season(6, DAYS, (), T_S), (), {}, most=1)[:2] == [(release, False), "lead"]


def test_the_likeliest_effect_is_polished_in_each_round_in_which_something_unknown_leads(monkeypatch):
    """Regression: beside a release, an unknown flow was 29 nats ahead of the daily inflow that was there."""
    first = explained()
    release = explained("unlogged_upstream_release", 9.0, 0.5, parent=first)
    wave = explained("diurnal_inflow", 5.0, 0.5, parent=release)
    unknown = explained("", 6.0, 0.5, parent=release, unknown="flow")
    leads, polished = [release, release, unknown, unknown, wave, wave], []

    class Search(Rounds):
        pool = (first, release, wave, unknown)
        score = staticmethod(lambda one: 0.0)
        begun = staticmethod(lambda: [first])
        ordered = staticmethod(lambda: [wave])
        extend = staticmethod(lambda one: one)
        lead = staticmethod(lambda: leads.pop(0))
        probable = staticmethod(lambda parent: {first: release, release: wave}.get(parent, parent))
        polished = staticmethod(lambda one: polished.append(one) or one)
        study = staticmethod(lambda: polished)

    monkeypatch.setattr("rivid.diagnosis.workflow._Search", Search)
    assert find_effects(pools.season(6, DAYS, (), T_S), (), {}, most=2) == [release, wave]


@pytest.mark.parametrize(
    ("name", "unknown", "again"),
    [("", "", False), ("diurnal_inflow", "", False), ("", "flow", True), ("leakage", "", True)],
)
def test_what_is_polished_is_refitted_from_the_response_of_another_cause_that_leads(
    monkeypatch, name, unknown, again
):
    """Regression: in 332 days an unknown flow was 21 nats ahead of the true daily inflow, by its response."""
    first = explained()
    wave = replace(explained("diurnal_inflow", 5.0, 0.5, parent=first), count=(1, 0))
    leader = explained(name, 6.0, 0.5, parent=first, unknown=unknown)
    refitted = []

    def polished(many, near=None):
        refitted.extend((one, near) for one in many)
        return many

    monkeypatch.setattr("rivid.diagnosis.workflow.screened_instead", lambda *given: [])
    search = SimpleNamespace(
        pool=[first, wave, leader], score=lambda one: float(one.density[OPEN].sum()), lead=lambda: leader,
        report=lambda *given: None, _settled=lambda one: one, _polished=polished,
        _library=lambda one: None, record=None,
    )  # fmt: skip
    assert _Search.polished(search, wave) is leader
    assert ((wave, leader) in refitted) == again


@pytest.mark.parametrize("better", [True, False])
def test_a_settled_response_is_fitted_if_it_is_likelier_on_the_days_on_which_it_settled(monkeypatch, better):
    record = responses.season(1)
    true = responses.few(record, cells=16)
    wrong = true.with_parameters(vector_of(true) + [1.0 * (p.name == "depth") for p in true.parameters])
    here, there = (wrong, true) if better else (true, wrong)
    monkeypatch.setattr(
        "rivid.diagnosis.workflow.settled", lambda model, few, number: replace(model, reach=there)
    )
    noise = NoiseModel(0.004, 0.001, 0.0, 1e4, 0.0, 600.0, record.sample_time, true.surface_area)
    model = Model(here, noise, record.usual_output, record.usual_flow, 0.0, (CATALOGUE["leakage"](),), ((),))
    fitted = []
    search = SimpleNamespace(
        record=record, opened=np.ones(record.days, bool), pool=[], _nominal=lambda model: true,
        _fitted=lambda draft, near, fresh: fitted.append(vector_of(draft.model.reach)),
    )  # fmt: skip
    one = Explanation(model, residual=np.zeros(record.time.shape))
    assert _Search._settled(search, one) is one
    assert len(fitted) == better and all((at == vector_of(there)).all() for at in fitted)


@pytest.mark.parametrize(("worth", "tried"), [(0.9 * HOPE, False), (1.1 * HOPE, True)])
def test_a_rival_is_refitted_if_it_is_a_candidate_beside_the_response_of_the_lead(monkeypatch, worth, tried):
    """In a season with nothing missing, nine rivals of a tide took a third of the time and none came near."""
    first = explained()
    names = ("leakage", "outflow_lag", "gate_head_effect", "diurnal_inflow")
    lead, rival, twin, other = (
        replace(explained(name, 5.0, 0.5, parent=first), count=(1, 0), way=Way(name, None)) for name in names
    )
    assert alike(twin, lead) and not alike(rival, lead) and not alike(other, lead)
    near = [
        SimpleNamespace(effect=one.added, worth=value)
        for one, value in ((lead, 100.0), (rival, 100.0 * worth))
    ]
    monkeypatch.setattr("rivid.diagnosis.workflow.screened_instead", lambda *given: near)
    refitted = []

    def polished(many, near=None):
        refitted.extend((one, near) for one in many)
        return many

    search = SimpleNamespace(
        pool=[first, lead, rival, twin, other], score=lambda one: 0.0, lead=lambda: lead,
        report=lambda *given: None, _settled=lambda one: one, _polished=polished,
        _library=lambda one: None, record=None,
    )  # fmt: skip
    _Search.polished(search, lead)
    assert ((rival, lead) in refitted) == tried
    assert (twin, lead) in refitted and (other, lead) not in refitted
    near.clear()  # without the effect the reach cannot carry the flows: nothing is known of the rivals
    _Search.polished(search, lead)
    assert (other, lead) in refitted


def test_extensions_are_those_of_the_fit_of_the_parent_that_was_extended(monkeypatch):
    """Regression: where a parent was refitted, its extensions were sought at the earlier fit."""
    first, better = explained(), explained(nats=1.0)
    asked = []

    class Search(Rounds):
        pool = (first, better)
        score = staticmethod(lambda one: 0.0)
        begun = staticmethod(lambda: [first])
        ordered = staticmethod(lambda: [better])
        extend = staticmethod(lambda one: better)
        lead = staticmethod(lambda: better)
        study = staticmethod(lambda: asked)

        def again(self, parent):
            asked.append(parent)
            return parent

        probable = again

    monkeypatch.setattr("rivid.diagnosis.workflow._Search", Search)
    find_effects(pools.season(6, DAYS, (), T_S), (), {}, most=4)
    assert asked == [better, better]


@pytest.mark.parametrize("contested", [True, False])
def test_what_a_refitted_parent_has_is_tried_again_where_that_can_change_what_leads(monkeypatch, contested):
    first, better = explained(), explained(nats=9.0)
    extended = []

    class Search(Rounds):
        pool = (first, better)
        score = staticmethod(lambda one: float(one.density[OPEN].sum()))
        begun = staticmethod(lambda: [first])
        lead = staticmethod(lambda: better)
        ordered = staticmethod(lambda: [better])
        again = staticmethod(lambda parent: better)
        study = staticmethod(lambda: extended)

        def extend(self, parent):
            extended.append(parent)
            return parent

        def contested(self, gain):
            assert gain == pytest.approx(9.0 / TEMPER)
            return contested

    monkeypatch.setattr("rivid.diagnosis.workflow._Search", Search)
    find_effects(pools.season(6, DAYS, (), T_S), (), {}, most=1)
    assert extended == [first, better][: 1 + contested]


def test_a_lead_is_contested_by_the_best_explanation_of_another_kind():
    nothing = explained()
    lead, twin = (explained("leakage", nats, 0.5, parent=nothing) for nats in (90.0, 89.0))
    second = explained("outflow_lag", 60.0, 0.5, parent=nothing)
    dynamics = explained(nats=80.0, unknown="dynamics")
    search = SimpleNamespace(
        pool=[nothing, lead, twin, second, dynamics], opened=OPEN,
        score=lambda one: float(one.density[OPEN].sum()),
    )  # fmt: skip
    apart = search.score(lead) - search.score(second) - LEAST
    assert _Search.contested(search, apart + 0.1) and not _Search.contested(search, apart - 0.1)
    search.pool = [nothing]
    assert not _Search.contested(search, 1e6)


def test_all_extensions_begin_at_the_response_to_which_the_first_one_moves(monkeypatch):
    """All were fitted from a response that the first showed to be biased, then again from a better one."""
    classes = {name: CATALOGUE[name] for name in ("leakage", "outflow_lag", "outflow_gain_error")}
    found = [SimpleNamespace(effect=e(), kind=e, worth=9.0, columns=None) for e in classes.values()]
    other = SimpleNamespace(effect=CATALOGUE["leakage"](), kind="other dates", worth=9.0, columns=None)
    monkeypatch.setattr("rivid.diagnosis.workflow.screened", lambda *given: found[:-1])
    monkeypatch.setattr("rivid.diagnosis.workflow.screened_again", lambda *given: [*found[1:], other])
    biased, better = explained(), explained()

    def grown(again, more=None, worth=9.0):
        """Return the parent and the names of each extension, in the order of their fits."""
        grown, found[0].worth = [], worth

        def grow(parent, ways):
            grown.append((parent, [way.name for way in ways]))
            return [more] * len(ways)

        search = SimpleNamespace(
            record=pools.season(6, DAYS, (), T_S), classes=classes, extended=set(), pool=[], again=again,
            extend=lambda parent, early: _Search.extend(search, parent, early),
            score=lambda one: float(one.density[OPEN].sum()),
            _grow=grow, _with_unknown=lambda parent: (parent, []), _library=lambda parent: None,
            _dated=lambda parent: [], _with_recurring=lambda *given: None,
            _with_unknown_events=lambda *given: None, _settle_failed=lambda *given: None,
        )  # fmt: skip
        return _Search.extend(search, biased), grown

    first, *others = *classes, "leakage"
    assert grown(lambda parent: parent) == (biased, [(biased, [first]), (biased, others)])
    assert grown(lambda parent: better) == (better, [(biased, [first]), (better, [first]), (better, others)])
    fits, some = [(biased, [first]), (biased, others)], [(biased, [first]), (biased, [])]
    for nats, worth, made in ((99.0, 1.1, some), (99.0, 0.9, fits), (0.9, 99.0, fits), (1.1, 99.0, some)):
        more = explained(nats=nats * 9.0 / HOPE * TEMPER)
        assert grown(lambda parent: parent, more, worth * 9.0 / HOPE) == (biased, made)


@pytest.mark.parametrize("sign", [-1, 1])
def test_pulses_that_enter_are_no_unknown_flow_beside_pulses_that_leave(monkeypatch, sign):
    """Regression: beside lock pulses, which paid for them, they were an unknown flow of 0.64."""
    for search in ("screened", "screened_again"):
        monkeypatch.setattr(f"rivid.diagnosis.workflow.{search}", lambda *given: [])
    tried = []
    search = SimpleNamespace(
        record=pools.season(6, DAYS, (), T_S), classes={"rain_inflow": CATALOGUE["rain_inflow"]}, pool=[],
        extended=set(), again=lambda parent: parent, _grow=lambda parent, ways: [parent for _ in ways],
        score=lambda one: 0.0, _settle_failed=lambda *given: None,
        _with_unknown=lambda parent: (parent, []), _library=lambda parent: SimpleNamespace(kernels=None),
        _dated=lambda parent: [], _with_recurring=lambda *given: None,
        _with_unknown_events=lambda parent, effect, *more: tried.append(effect),
    )  # fmt: skip
    _Search.extend(search, explained(events=(SimpleNamespace(kind=SimpleNamespace(sign=sign)),)))
    assert (PassingFlow in tried) == (sign > 0)


def test_an_explanation_is_refitted_once_from_the_response_of_the_same_extension():
    nothing = explained()
    leak = explained("leakage", 9.0, 0.5, parent=nothing)
    fits = []
    search = SimpleNamespace(
        pool=[nothing, leak], tried=[], opened=OPEN, report=lambda *given: None,
        score=lambda one: float(one.density[OPEN].sum()), likeliest=lambda parent: search.pool[1],
        _fitted=lambda one, near, fresh: fits.append((one.names, near)),
    )  # fmt: skip
    assert _Search.again(search, nothing) is _Search.again(search, nothing) is nothing
    assert fits == [((), leak)]
    search.pool[1] = leakier = explained("leakage", 12.0, 0.5, parent=nothing)
    assert _Search.again(search, nothing) is nothing
    assert fits[1:] == [((), leakier)]


def test_a_rival_is_refitted_as_long_as_its_steps_can_still_bring_it_to_the_front():
    lead, rival = explained("leakage", 90.0, 0.5), explained("outflow_lag", 50.0, 0.5)
    calls = []

    def fit(one, near, fresh=0, *, enough=ENOUGH):
        calls.append((near, fresh, enough))
        return better

    def refitted(near):
        calls.clear()
        search = SimpleNamespace(
            pool=[lead, rival], score=lambda one: float(one.density[OPEN].sum()), _fitted=fit
        )
        assert _Search._fitted_on(search, rival, near) is better
        return [(start, fresh, pytest.approx(enough)) for start, fresh, enough in calls]

    def behind(one):
        return float((lead.density - one.density)[OPEN].sum()) / FRESH

    better = explained("outflow_lag", 75.0, 0.5)
    assert behind(better) > ENOUGH
    assert refitted(None) == [(rival, FRESH, behind(rival))]
    # from the response of the lead: without new columns first, with them as far as it is still behind then
    assert refitted(lead) == [(lead, 0, behind(rival)), (better, 1, behind(better))]
    better = explained("outflow_lag", 65.0, 0.5)  # behind even if it gains as much again
    assert len(refitted(lead)) == 1
    better = explained("outflow_lag", 100.0, 0.5)
    assert refitted(lead)[1] == (better, 1, ENOUGH)
    better = explained("outflow_lag", 40.0, 0.5)
    assert len(refitted(lead)) == 1


@pytest.mark.parametrize(("gained", "settles"), [(10.0, True), (30.0, False)])
def test_a_candidate_settles_if_its_fit_gives_it_up(gained, settles):
    """Regression: a clock 24 min late for four weeks was no gap."""
    parent, clock = explained(), CATALOGUE["clock_offset"]
    one = explained("clock_offset", TEMPER * gained, parent=parent)
    one = replace(one, model=Model(MODEL.reach, None, 0.0, 0.0, 0.0, (clock(offset=-100.0),), ((),)))
    candidate = SimpleNamespace(
        effect=clock(offset=-1200.0), gain=100.0, make=lambda share: clock(offset=-1200.0 * share)
    )
    settled = []
    search = SimpleNamespace(
        score=lambda one: float(one.density[OPEN].sum()), _settled=lambda *given: settled.append(given)
    )
    _Search._settle_failed(search, parent, candidate, one)
    assert len(settled) == settles
    for again, lacking in settled:
        assert again.model.effects[0].offset == -1200.0 and lacking == pytest.approx(100.0 - gained)


def test_a_refit_from_its_own_response_replaces_an_explanation():
    """The score of the first fit rests on columns of where it began."""
    first = explained("leakage", 90.0, 0.5)
    extended, again = explained("outflow_lag", 95.0, 0.5, parent=first), explained("leakage", 70.0, 0.5)
    search = SimpleNamespace(
        pool=[first, extended], score=lambda one: float(one.density[OPEN].sum()),
        _fitted_on=lambda one, near: again, _made_by=lambda one, way: one,
    )  # fmt: skip
    search._better = lambda one, more: _Search._better(search, one, more)
    assert _Search._polished(search, [first], extended) == [first]  # from another response
    assert search.pool == [first, extended, again]
    search.pool.pop()
    assert _Search._polished(search, [first], first) == [again]
    (extended, kept) = search.pool
    assert kept is again and extended.parent is again


def test_rivals_of_a_lead_with_something_unknown_get_it_too():
    """Regression: the gauge's errors gave the lead 30 nats, and its twin none."""
    nothing = explained()
    leak = explained("leakage", 9.0, 0.5, parent=nothing)
    rival = explained("gate_head_effect", 9.0, 0.5, parent=nothing)
    lead = explained("", 9.0, 0.5, parent=leak, unknown="gauge")
    given = []
    search = SimpleNamespace(
        pool=[nothing, leak, rival, lead], opened=OPEN, dealt=SPLIT, classes=CATALOGUE,
        _latent=lambda one, kind: given.append((one, kind)),
    )  # fmt: skip
    _Search.level_rivals(search, lead)
    assert given == [(rival, "gauge")]


def test_rivals_of_what_a_lead_extends_get_its_effect_from_their_own_model():
    nothing = explained()
    leak = explained("leakage", 9.0, 0.5, parent=nothing)
    rival = explained("gate_head_effect", 9.0, 0.5, parent=nothing)
    way, given = Way("side_storage", print), []
    lead = explained("side_storage", 9.0, 0.5, parent=leak, way=way)
    search = SimpleNamespace(
        pool=[nothing, leak, rival, lead], opened=OPEN, dealt=SPLIT, classes=CATALOGUE,
        _grow=lambda *call: given.append(call),
    )  # fmt: skip
    _Search.level_rivals(search, lead)
    assert given == [(rival, [way])]


def test_twins_of_what_is_probable_are_refitted_from_its_response():
    """Regression: a round raised one of two twins by 12 nats of the response; it was sure, and wrong."""
    nothing = explained()
    lead = explained("inflow_gain_error", 9.0, 0.5, parent=nothing)
    twin = explained("outflow_gain_error", 8.0, 0.5, parent=nothing)
    other = explained("wind_setup", 7.0, 0.5, parent=nothing)
    also = explained("outflow_gain_error", 1.0, 0.5, parent=nothing, unknown="gauge")
    refitted, settled = [], []
    search = SimpleNamespace(
        pool=[nothing, lead, twin, other, also], opened=OPEN, dealt=SPLIT, lead=lambda: lead,
        score=lambda one: float(one.density[OPEN].sum()), _settled=settled.append,
        _twins=lambda one: _Search._twins(search, one),
        _polished=lambda many, near: refitted.extend((one, near) for one in many),
    )  # fmt: skip
    _Search.level_twins(search)
    assert (twin, lead) in refitted and {one for one, _ in refitted} <= {lead, twin}
    assert settled == [twin]
    search.pool[2] = explained("outflow_gain_error", 4.0, 0.5, parent=nothing)  # less than half of the gain
    _Search.level_twins(search)
    assert settled == [twin]


def test_a_twin_is_tried_as_the_other_is_with_its_dates_and_number_of_sizes_beside_the_same():
    """Regression: 14 sizes and other dates left the truth 200 nats behind its twin, which had one."""
    when = [(day, day + dt.timedelta(20)) for day in (dt.date(2024, 5, 3), dt.date(2024, 5, 6))]
    release = CATALOGUE["unlogged_upstream_release"](size=4.0, dates=when[0])
    lateral = CATALOGUE["lateral_inflow"](inflow=(3.0, 7.0), place=0.2, dates=when[1])
    pond = CATALOGUE["side_storage"]()
    nothing, frees = explained(), {release: ("size",), lateral: ("inflow", "place"), pond: ("area",)}

    def held(parent, *effects):
        free = tuple(frees[effect] for effect in effects)
        model = Model(nothing.model.reach, None, 0.0, 300.0, 0.0, effects, free)
        return replace(explained(effects[-1].name, 9.0, 0.5, parent=parent), model=model, added=effects[-1])

    one, twin = held(nothing, release), held(nothing, lateral)
    both = held(one, release, pond)
    refitted = {}
    search = SimpleNamespace(
        pool=[nothing, one, twin, both], opened=OPEN, dealt=SPLIT, lead=lambda: nothing,
        _twins=lambda one: _Search._twins(search, one),
        _polished=lambda many, near: refitted.setdefault(id(near), []).extend(many),
    )  # fmt: skip
    _Search.level_twins(search)
    like = replace(lateral, inflow=5.0, dates=when[0])
    alone, beside = refitted[id(one)][-1], refitted[id(both)][-1]
    assert alone.model.effects == (like,) and alone.model.free == (frees[lateral],)
    assert beside.model.effects == (like, pond) and beside.model.free == (frees[lateral], frees[pond])
    assert alone.parent is nothing and beside.parent is twin
    frees[like] = frees[lateral]
    same = held(nothing, like)
    assert _as_twin(one, one, same, nothing) is None  # it is there already
    assert _as_twin(one, one, twin, one) is None


@pytest.mark.long
@pytest.mark.parametrize("near", [True, False])
@pytest.mark.parametrize(("rows", "hours"), [((6, 13), (6.0, 10.0)), ((9, 18), (9.0, 15.0))])
def test_dates_and_hours_of_the_lead_move_to_those_of_what_is_hidden(rows, hours, near):
    start, end = (pools.season(5, DAYS, T_s=T_S).dates[i] for i in (5, 15))
    hidden = CATALOGUE["unlogged_upstream_release"](size=40.0, dates=(start, end), hours=(6.0, 12.0))
    record = pools.season(5, DAYS, effects=(hidden,), T_s=T_S)
    search = _Search(
        record, (pools.nominal(record),), {hidden.name: type(hidden)}, pools.GAUGE_FLOOR, (), lambda *_: None
    )
    parent, *_ = search.begun()
    off = replace(hidden, dates=(record.dates[rows[0]], record.dates[rows[1]]), hours=hours)
    model = replace(parent.model, effects=(off,), free=(("size",),))
    lead = search._fitted(parent.extended(0.0, model=model), parent)
    search.pool.append(lead)
    found = search.shifted(lead, near).added
    opened = {day for day, there in zip(record.dates, search.opened, strict=True) if there}
    days = [{day for day in opened if dates[0] <= day <= dates[1]} for dates in (found.dates, hidden.dates)]
    assert found.hours == hidden.hours and days[0] == days[1]
    assert found.size == pytest.approx(40.0, abs=3.0)


def test_a_response_that_leaves_what_the_sealed_days_allow_begins_where_it_carried_them(monkeypatch):
    """Regression: on one held-out day the fitted reach had no steady flow, and the diagnosis ended."""
    record = pools.season(5, DAYS, T_s=T_S)
    search = _Search(
        record, (pools.nominal(record),), {"leakage": CATALOGUE["leakage"]}, pools.GAUGE_FLOOR, (), print
    )

    def refusing(*given, steps=STEPS, **others):
        if steps > 0 and given[1] is search.record:
            raise RividError("no steady flow")
        return fitted(*given, steps=steps, **others)

    monkeypatch.setattr("rivid.diagnosis.workflow.fitted", refusing)
    (parent,) = search.begun()
    assert parent.density is not None and search.pool == [parent]
    assert search._with_unknown(parent) == (parent, []) and search.varied(parent) is parent


def test_unknown_events_with_which_the_sealed_days_cannot_be_carried_are_left_out(monkeypatch):
    """Regression: effects with names were left out then, and unknown events ended the diagnosis."""
    starts = tuple(24.0 * d + 5.0 * d % 19.0 for d in range(1, 20, 2))
    pulses = PassingFlow(starts=starts, size=60.0, duration=2.0)
    record = pools.season(5, DAYS, effects=(pulses,), T_s=T_S)
    search = _Search(
        record, (pools.nominal(record),), {"leakage": CATALOGUE["leakage"]}, pools.GAUGE_FLOOR, (), print
    )
    (parent,) = search.begun()

    def refusing(*given, **others):
        raise RividError("no steady flow")

    monkeypatch.setattr("rivid.diagnosis.search.fitted", refusing)
    search._with_unknown_events(parent, PassingFlow)
    assert search.pool == [parent]
    monkeypatch.undo()
    search._with_unknown_events(parent, PassingFlow)
    assert [one.unknown for one in search.pool] == ["", "flow"]
