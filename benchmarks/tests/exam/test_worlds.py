"""Test the worlds and their hidden effects: reproducible by seed, and equal to the truth."""

import datetime as dt
from collections import Counter

import numpy as np
import pytest

from benchmarks.exam import hiding
from benchmarks.exam.answering import record_of
from benchmarks.exam.hiding import (
    DRAWN,
    FOREIGN,
    LARGEST,
    REMOVED,
    TWINS,
    TYPES,
    names_of,
    plant,
    possible,
    record_of_seed,
    sealed,
)
from benchmarks.exam.sizing import SIZE_OF, size_of
from benchmarks.exam.worlds import KINDS, draw
from rivid.diagnosis.choice import gauge_floor_of, responses_of
from rivid.diagnosis.explanation import FRESH, fitted, settled
from rivid.diagnosis.fit import Model
from rivid.effects import CATALOGUE

SEEDS = (2, 4, 9, 49, 11)
CLASSES = dict(CATALOGUE) | hiding.outside.classes()
DAYS = 20


@pytest.fixture(scope="module")
def planted():
    return {seed: plant(seed, DAYS) for seed in SEEDS}


@pytest.mark.parametrize("seed", SEEDS[:3])
def test_the_same_seed_plants_the_same_and_another_one_does_not(planted, seed):
    again = plant(seed, DAYS)
    assert again.truth == planted[seed].truth
    for name in ("inflow", "outflow", "output"):
        np.testing.assert_array_equal(getattr(again.logs, name), getattr(planted[seed].logs, name))
    assert len({p.truth["world"]["length_m"] for p in planted.values()}) == len(SEEDS)


def pool_and_river():
    worlds = [draw(seed) for seed in range(12)]
    return tuple(next(w for w in worlds if (w.kind == "river") == river) for river in (False, True))


def test_a_river_hides_nothing_that_needs_a_pool():
    pool, river = (set(possible(world, CLASSES)) for world in pool_and_river())
    assert river < pool and {"leakage", "outflow_gain_error", "seiche", "silting_well"} <= pool - river
    assert {"unlogged_upstream_release", "ice_cover"} <= river


def test_kinds_of_water_operators_and_programmes_are_all_drawn():
    worlds = [draw(seed) for seed in range(80)]
    for name, many in (("kind", len(KINDS) + 1), ("operators", 4), ("programme", 3)):
        counts = Counter(getattr(world, name) for world in worlds)
        assert len(counts) == many and min(counts.values()) >= 5


@pytest.mark.parametrize("seed", SEEDS)
def test_the_truth_is_what_was_planted_and_the_configuration_has_none_of_it(planted, seed):
    one = planted[seed]
    truth, settings = one.truth, one.logs.config
    assert [t["name"] for t in truth["effects"]] == [e.name for e in one.season.effects]
    assert all(1.0 <= times <= hiding.MOST_TIMES for times in truth["times"])
    for table, times, unit in zip(truth["effects"], truth["times"], truth["units"], strict=True):
        grown = unit / times if table["name"] == "gate_rate_limit" else unit * times
        assert size_of(table) == pytest.approx(grown, rel=1e-4)
    assert all(nats is None or nats > 5.0 for nats in truth["nats"])
    assert set(settings) == {"reach", "diagnose"}
    assert set(settings["diagnose"]) == {"exclude"} and settings["diagnose"]["exclude"] == truth["excluded"]
    assert settings["reach"]["name"] == "reach"
    assert one.logs.output.shape == one.logs.inflow.shape == (len(one.logs.dates), len(one.logs.seconds))


def test_a_seed_gives_record_configuration_and_truth(planted):
    record, config, truth = record_of_seed(9)
    assert truth["seed"] == 9 and record.days == len(record.dates) > DAYS
    assert config.reach.sample_time == record.sample_time


def test_other_operators_act_on_the_same_river_from_half_way_on(planted):
    one = next(p for p in planted.values() if p.truth["kind"] == "operators")
    logs, season = one.logs, one.season
    rows = [season.dates.index(date) for date in logs.dates]
    half = len(rows) // 2
    gaps = np.diff([date.toordinal() for date in logs.dates])
    assert gaps[half - 1] >= 2
    np.testing.assert_array_equal(logs.inflow[:half], season.inflow[rows[:half]])
    np.testing.assert_array_equal(logs.outflow[:half], season.outflow[rows[:half]])
    assert np.abs(logs.outflow[half:] - season.outflow[rows[half:]]).max() > 0.0


def test_shares_of_what_is_hidden_are_those_that_are_drawn():
    assert sum(TYPES.values()) == pytest.approx(1.0)
    assert set(DRAWN) <= set(CATALOGUE)
    assert set(DRAWN) | set(FOREIGN) == set(SIZE_OF) == set(LARGEST)
    rng = np.random.default_rng(1)
    known = possible(pool_and_river()[0], CLASSES)
    for kind, pool in (
        ("one", set(DRAWN)),
        ("twin", set(TWINS)),
        ("removed", set(REMOVED)),
        ("outside", set(FOREIGN)),
    ):
        names = Counter(names_of(kind, rng, known)[0] for _ in range(400))
        assert set(names) == pool
    assert all(len(set(names_of("two", rng, known))) == 2 for _ in range(50))


@pytest.mark.parametrize("name", [*DRAWN, *FOREIGN])
@pytest.mark.parametrize("seed", [1, 2])
def test_every_effect_can_be_drawn_in_a_world(name, seed):
    world = draw(seed)
    table = hiding.table_of(name, world, np.random.default_rng(seed))
    if name == "silting_well":
        assert table["lag"] > 0.0
    else:
        effect = CLASSES[name].from_table(table)
        assert effect.name == name
    for date in table.get("dates", ()):
        assert 0 <= (date - world.scenario.first_day).days < world.scenario.days
        assert isinstance(date, dt.date)


def test_a_well_that_silts_up_lags_the_more_the_later(planted):
    season = planted[4].season
    table = {"dates": [season.dates[5], season.dates[-1]], "lag": 3000.0}
    shown = np.abs(hiding.silting(table, season)).mean(axis=1)
    assert shown[:5].max() == 0.0
    assert shown[-4:].mean() > 1.2 * shown[5:9].mean() > 0.0


def test_drawn_events_are_told_as_they_were_drawn():
    seed = 2
    one = plant(seed, 40)
    if one.truth["effects"][0]["name"] != "rain_inflow":
        pytest.skip("another effect is hidden in this seed")
    (table,) = one.known
    effect = type(one.season.effects[0]).from_table(table)
    inside = one.season.unlogged - one.season.weather
    world = one.season.world
    flow = effect.changes(world).added[0].flow.reshape(-1, len(one.season.seconds))
    rows = [(date - world.first_day).days + 1 for date in one.season.dates]
    np.testing.assert_allclose(flow[rows], inside, atol=1e-9)
    assert len(table["starts"]) > 1


def test_what_goes_between_processes_has_what_a_knowing_model_needs():
    logs, truth = sealed(11, DAYS)
    assert truth["kind"] == "nothing" and truth["known"] is None
    assert logs.settings.reach.sample_time > 0.0


def test_a_fit_to_short_samples_of_an_uneven_channel_ends_at_its_optimum():
    """Start from a fitted response. From the nominal one the fit ends in another maximum, 260 nats lower."""
    logs, _ = sealed(7036, longest=40)
    record = record_of(logs)
    record = record.take(np.arange(0, record.days, 4))
    reach, every = responses_of(logs.settings, record)[0], np.ones(record.days, bool)
    floor = gauge_floor_of(logs.settings, record)
    few = record.take(np.linspace(0, record.days - 1, 6).astype(int))
    model = settled(Model(reach, None, record.usual_output, record.usual_flow, floor), few, 0)

    def posterior(found):
        left = np.where(record.used, found.residual, np.nan)
        off = [(p.value - p.mean) / p.sd for p in found.model.reach.parameters]
        likely = found.noise.log_likelihood(left, record.activity).sum()
        return float(likely - 0.5 * np.square(off).sum())

    once, found = (fitted(model, record, every, fresh=fresh) for fresh in (1, FRESH))
    again = fitted(found.model, record, every, fresh=FRESH)
    assert posterior(again) - posterior(found) < 5.0 < posterior(found) - posterior(once)
