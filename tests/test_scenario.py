"""Test that scenarios are validated when they are read, and that the message names the key."""

import datetime as dt
from pathlib import Path

import pytest

from rivid.errors import ConfigError
from rivid.reach.integrator import LinearReach
from rivid.reach.operators import OperatorSettings
from rivid.simulation.scenario import Scenario, load_scenario

SCENARIOS = Path(__file__).parent.parent / "configs" / "scenarios"


def written(tmp_path, text):
    path = tmp_path / "s.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", sorted(SCENARIOS.rglob("*.toml")), ids=lambda p: p.stem)
def test_the_included_scenarios_can_be_read_and_set_every_key(path):
    scenario = load_scenario(path)
    assert scenario.reach.sample_time == (900 if "river" in path.stem else 133)
    if "extends" in path.read_text():
        assert path.parent in (SCENARIOS, SCENARIOS / "exam") or scenario.effects
        return
    for name in ("flow", "programme", "operators", "level", "weather", "output"):
        section = getattr(scenario, name)
        assert section.model_fields_set == set(type(section).model_fields), name


def test_an_empty_file_is_the_reach_of_table_i(tmp_path):
    scenario = load_scenario(written(tmp_path, ""))
    assert scenario == Scenario()
    assert (scenario.reach.length, scenario.reach.surface_area) == (8200.0, 6.7e5)


def test_scenario_defaults_equal_those_of_the_core():
    assert OperatorSettings(**Scenario().operators.model_dump()) == OperatorSettings()
    shared = set(LinearReach.__dataclass_fields__)
    assert LinearReach(**Scenario().reach.model_dump(include=shared)) == LinearReach()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[reach]\nlenght = 8", "unknown key reach.lenght; valid keys here: bed_level, depth, "),
        ("sed = 3", "unknown key sed; valid keys here: calibration, cascade, channel, days, "),
        ("[operators]\nlevel_gain = 1000", "operators.level_gain = 1000: input should be less than 0"),
        (
            "[operators]\nlook = [1800, 600]",
            "operators.look = [1800, 600]: expected the shortest and the longest",
        ),
        ("[operators]\npeople = 0", "operators.people = 0"),
        ("[reach]\nkind = 'river'", "only a pool can be simulated"),
        ("[reach]\nwave_depth = nan", "reach.wave_depth = nan"),
        ("[flow]\nlowest = 400", "lowest = 400, mean = 300, highest = 800: expected them in this order"),
        ("[level]\nquantum = -0.01", "level.quantum = -0.01"),
        ("[weather]\nplace = 1.5", "weather.place = 1.5"),
        ("[output]\nformat = 'xlsx'", "output.format = 'xlsx': input should be 'csv', 'csv.gz' or 'parquet'"),
        ("days = 10\nmissing_days = 10", "missing_days = 10: leaves no day of 10"),
        ("first_day = 9999-12-01\ndays = 40", "days = 40: passes the end of the calendar after 9999-12-01"),
        ("first_day = 'soon'", "first_day = 'soon'"),
        ("utc_offset = 'Paris'", "utc_offset = 'Paris': expected an offset from UTC like +01:00"),
        ("name = '../x'", "name = '../x'"),
        ("days = ", "is not valid TOML"),
        ("[reach]\nwidth = -80", "reach.width = -80: input should be greater than 0"),
        ("[channel]\ncourant = 0.9", "channel.courant = 0.9: input should be less than or equal to 0.6"),
        ("[channel]\nmanning = 0", "channel.manning = 0"),
        ("[channel]\ncells = 2", "channel.cells = 2"),
        ("[[effects]]\nname = 'leek'", "no effect is called 'leek': expected name = one of lateral_inflow, "),
        ("[[effects]]\nname = 'leakage'\nloss = -1", "leakage: loss = -1: expected a number from 0 to"),
        ("[[effects]]\nname = 'leakage'\nlos = 1", "leakage: unknown key 'los': expected loss, reference"),
        ("effects_file = 'none.py'\n[[effects]]\nname = 'leakage'", "none.py"),
        ("extends = 3", "extends = 3: expected the name of a scenario file"),
        ("extends = 's.toml'", "extends itself"),
        (
            "[[cascade]]\n[[cascade]]",
            "cascade has reaches ['reach', 'reach']: expected a reach.name of its own",
        ),
        ("[[cascade]]\nreach = {length = -1}", "reach.length = -1"),
    ],
)
def test_faults_are_one_line_that_names_the_key(tmp_path, text, reason):
    with pytest.raises(ConfigError) as error:
        load_scenario(written(tmp_path, text))
    assert reason in str(error.value)
    assert str(error.value).startswith(str(tmp_path)) and "\n" not in str(error.value)


def test_offsets():
    for text, hours in (("+01:00", 1), ("-03:30", -3.5), ("+00:00", 0)):
        assert Scenario(utc_offset=text).offset == dt.timedelta(hours=hours)


def test_a_scenario_replaces_keys_of_the_one_that_it_extends(tmp_path):
    (tmp_path / "base.toml").write_text("days = 9\n[reach]\nlength = 5000\nwidth = 50\n")
    scenario = load_scenario(written(tmp_path, 'extends = "base.toml"\n[reach]\nwidth = 60\n'))
    assert (scenario.days, scenario.reach.length, scenario.reach.width) == (9, 5000.0, 60.0)
    with pytest.raises(ConfigError, match="cannot read .*none.toml"):
        load_scenario(written(tmp_path, 'extends = "none.toml"'))


def test_reaches_of_a_cascade_differ_in_the_given_keys(tmp_path):
    text = (
        "[reach]\nwidth = 50\n[channel]\nslope = 3e-4\n"
        "[[cascade]]\nreach = {name = 'a'}\n"
        "[[cascade]]\nreach = {name = 'b', width = 70}\nchannel = {cells = 20}\n"
    )
    one, two = load_scenario(written(tmp_path, text)).reaches()
    assert (one.reach.width, one.channel.cells, one.channel.slope) == (50.0, 128, 3e-4)
    assert (two.reach.width, two.channel.cells, two.channel.slope) == (70.0, 20, 3e-4)
    assert not one.cascade and one.reach.name == "a"


def test_effects_of_users_come_from_a_file_next_to_the_scenario():
    scenario = load_scenario(SCENARIOS / "outside" / "hunting.toml")
    (effect,) = scenario.planted()
    assert effect.name == "hunting_governor" and effect.period == 2400.0
