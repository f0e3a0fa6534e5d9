"""Scenarios are checked when they are read; the message names the key."""

import datetime as dt
from pathlib import Path

import pytest

from rivid.errors import ConfigError
from rivid.reach.operators import OperatorSettings
from rivid.reach.response import LinearReach
from rivid.scenario import Scenario, load_scenario

SCENARIOS = Path(__file__).parent.parent / "configs" / "scenarios"


def written(tmp_path, text):
    path = tmp_path / "s.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda p: p.stem)
def test_the_scenarios_that_come_along_can_be_read_and_say_every_key(path):
    scenario = load_scenario(path)
    assert scenario.reach.sample_time == 133
    for name in ("flow", "programme", "operators", "level", "weather", "output"):
        section = getattr(scenario, name)
        assert section.model_fields_set == set(type(section).model_fields), name


def test_an_empty_file_is_the_reach_of_table_i(tmp_path):
    scenario = load_scenario(written(tmp_path, ""))
    assert scenario == Scenario()
    assert (scenario.reach.length, scenario.reach.surface_area) == (8200.0, 6.7e5)


def test_defaults_stand_in_one_place():
    assert OperatorSettings(**Scenario().operators.model_dump()) == OperatorSettings()
    shared = set(LinearReach.__dataclass_fields__)
    assert LinearReach(**Scenario().reach.model_dump(include=shared)) == LinearReach()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[reach]\nlenght = 8", "unknown key reach.lenght; valid keys here: bed_level, depth, "),
        ("sed = 3", "unknown key sed; valid keys here: days, first_day, flow, "),
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
    ],
)
def test_faults_are_one_line_that_names_the_key(tmp_path, text, reason):
    with pytest.raises(ConfigError) as error:
        load_scenario(written(tmp_path, text))
    assert reason in str(error.value)
    assert str(error.value).startswith(str(tmp_path)) and "\n" not in str(error.value)


@pytest.mark.parametrize(("text", "hours"), [("+01:00", 1), ("-03:30", -3.5), ("+00:00", 0)])
def test_offsets(text, hours):
    assert Scenario(utc_offset=text).offset == dt.timedelta(hours=hours)
