"""The configuration: defaults are the paper's, faults are told in one line."""

import pytest

from rivid.config import Config, load_config, parse
from rivid.core.settings import JmapSettings
from rivid.errors import ConfigError


def test_without_a_file_the_paper_holds():
    settings = load_config(None).jmap_settings()
    assert settings == JmapSettings()
    assert (settings.order, settings.d_min, settings.d_max, settings.delay_scale) == (30, 1, 15, 6.5)


def test_bounds_come_from_the_reach():
    raw = {
        "reach": {"length": 3000, "width": 80, "depth": 5},
        "jmap": {"sigma_d": "bounds", "d_max": "bounds", "order": "bounds"},
    }
    settings = parse(raw, Config).jmap_settings()
    assert 1.0 <= settings.delay_scale <= 3.0
    assert settings.d_max < 15
    assert settings.order >= settings.d_max + 3


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        ({"reach": {"lenght": 1}}, ["unknown key reach.lenght", "length", "sample_time"]),
        ({"raech": {}}, ["unknown key raech", "input, jmap, reach, run"]),
        ({"reach": {"length": -1}}, ["reach.length = -1", "greater than 0"]),
        ({"reach": {"length": float("nan")}}, ["reach.length = nan"]),
        ({"reach": {"name": "../x"}}, ["reach.name", "pattern"]),
        ({"reach": {"discharge_range": [800, 100]}}, ["expected lowest, highest"]),
        ({"run": {"estimators": ["jmpa"]}}, ["'jmpa'", "'jmap'"]),
        ({"run": {"estimators": []}}, ["run.estimators"]),
        ({"run": {"window_days": 0}}, ["window_days = 0"]),
        ({"input": {"units": {"u_Qi": "gpm"}}}, ["gpm", "m3/s, cfs"]),
        ({"input": {"units": {"flow": "cfs"}}}, ["unknown column 'flow'"]),
        ({"input": {"time_zone": "Mars/Base"}}, ["Mars/Base", "not a time zone"]),
        ({"jmap": {"sigma_d": 0}}, ["jmap.sigma_d"]),
    ],
)
def test_a_fault_names_the_key_what_came_and_what_is_valid(raw, words):
    with pytest.raises(ConfigError) as caught:
        parse(raw, Config)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_delays_beyond_the_fir_are_told():
    with pytest.raises(ConfigError, match="order >= 33"):
        parse({"jmap": {"d_max": 30}}, Config).jmap_settings()


@pytest.mark.parametrize("text", ["[reach", "a = " + "[" * 5000, "x = 1\nx = 2"])
def test_a_file_that_is_not_toml_is_told(tmp_path, text):
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_config(path)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(ConfigError, match="cannot read"):
        load_config(tmp_path / "none.toml")
