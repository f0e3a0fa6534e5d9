"""Test the configuration: defaults are the paper's, an error is one line."""

import dataclasses
import json

import pytest

from rivid.config import Config, load_config, merged, parse
from rivid.core.settings import CusumSettings, JmapSettings, PosteriorSettings, SearchSettings
from rivid.errors import ConfigError

DIRECT = {"run": {"estimators": ["direct"]}}


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
        ({"raech": {}}, ["unknown key raech", "input, jmap, posterior, reach, run"]),
        ({"reach": {"length": -1}}, ["reach.length = -1", "greater than 0"]),
        ({"reach": {"length": float("nan")}}, ["reach.length = nan"]),
        ({"reach": {"name": "../x"}}, ["reach.name", "letters A to Z"]),
        ({"reach": {"discharge_range": [800, 100]}}, ["expected lowest, highest"]),
        ({"run": {"estimators": ["jmpa"]}}, ["'jmpa'", "did you mean jmap?"]),
        ({"run": {"estimators": []}}, ["run.estimators"]),
        ({"run": {"window_days": 0}}, ["window_days = 0"]),
        ({"input": {"units": {"u_Qi": "gpm"}}}, ["gpm", "m3/s, cfs"]),
        ({"input": {"units": {"flow": "cfs"}}}, ["unknown column 'flow'"]),
        ({"input": {"time_zone": "Mars/Base"}}, ["Mars/Base", "not a time zone"]),
        ({"jmap": {"sigma_d": 0}}, ["jmap.sigma_d"]),
        ({"search": {"dmax": 9}}, ["unknown key search.dmax", "d_max, d_min"]),
        ({"search": {"d_max": 1001}}, ["search.d_max = 1001", "less than or equal to 1000"]),
        ({"search": {"d_min": 0}}, ["search.d_min = 0", "greater than or equal to 1"]),
        ({"posterior": {"wave_temperature": 0.9}}, ["posterior.wave_temperature = 0.9"]),
        ({"posterior": {"answer_above": 1.1}}, ["posterior.answer_above = 1.1"]),
        ({"posterior": {"store_error": 0.0}}, ["posterior.store_error = 0.0"]),
        ({"cusum": {"threshold": 0}}, ["cusum.threshold = 0", "greater than 0"]),
        ({"cusum": {"drift": -0.1}}, ["cusum.drift = -0.1"]),
        ({"cusum": {"sd": float("inf")}}, ["cusum.sd = inf", "finite"]),
        ({"cusum": {"mean": float("nan")}}, ["cusum.mean = nan", "finite"]),
        ({"cusum": {"mean_lags": 1.5}}, ["cusum.mean_lags = 1.5", "integer"]),
        ({"cusum": {"moment": "start"}}, ["cusum.moment = 'start'", "'onset' or 'alarm'"]),
        (DIRECT | {"reach": {"kind": "river"}}, ["direct", "river", "leave it out"]),
        (DIRECT | {"input": {"u_Qo": ""}}, ["direct", 'u_Qo = ""', "name the column"]),
    ],
)
def test_a_fault_names_the_key_what_came_and_what_is_valid(raw, words):
    with pytest.raises(ConfigError) as caught:
        parse(raw, Config)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("text", ["[reach", "a = " + "[" * 5000, "x = 1\nx = 2"])
def test_a_file_that_is_missing_or_not_toml_is_refused(tmp_path, text):
    path = tmp_path / "c.toml"
    with pytest.raises(ConfigError, match="cannot read"):
        load_config(path)
    path.write_text(text)
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_config(path)


def test_searches_and_cusum_have_the_defaults_of_the_core_and_the_delays_of_jmap():
    config = Config()
    assert config.search_settings() == SearchSettings() and config.cusum_settings() == CusumSettings()
    config = parse({"jmap": {"d_min": 2, "d_max": 20}, "cusum": {"d_max": 9, "drift": 1.5}}, Config)
    assert config.search_settings() == SearchSettings(2, 20)
    assert config.cusum_settings() == CusumSettings(d_min=2, d_max=9, drift=1.5)
    bounds = parse({"reach": {"length": 3000, "width": 80, "depth": 5}, "jmap": {"d_max": "bounds"}}, Config)
    assert bounds.search_settings().d_max == bounds.jmap_settings().d_max < 15


def test_contradictions_are_refused_with_their_table():
    for table in ("search", "cusum", "posterior"):
        with pytest.raises(ConfigError, match=rf"\[{table}\] d_min = 9 and d_max = 4: expected 1 <= d_min"):
            getattr(parse({table: {"d_min": 9, "d_max": 4}}, Config), f"{table}_settings")()
    assert parse({"search": {"d_max": 28}}, Config).search_settings().d_max == 28, "it has no FIR"
    for table, d_max in (("cusum", 28), ("posterior", 30)):
        expected = rf"\[{table}\] d_max = {d_max} needs an FIR of order >= 31, .*order = 30"
        with pytest.raises(ConfigError, match=expected):
            getattr(parse({table: {"d_max": d_max}}, Config), f"{table}_settings")()
    with pytest.raises(ConfigError, match="order >= 33"):
        parse({"jmap": {"d_max": 30}}, Config).jmap_settings()


def test_an_indirect_search_needs_no_outflow():
    config = parse({"input": {"u_Qo": ""}, "run": {"estimators": ["indirect"]}}, Config)
    assert config.run.estimators == ["indirect"]


def test_only_the_tables_that_are_worked_with_count():
    assert set(Config().as_used()) == set(Config.model_fields) - {"search", "cusum"}
    pairs = (("direct", "search"), ("indirect", "search"), ("cusum-map", "cusum"), ("posterior", "posterior"))
    for name, table in pairs:
        used = parse({"run": {"estimators": ["jmap", name]}}, Config).as_used()
        assert set(used) & {"search", "cusum", "posterior"} == {table}


def test_the_posteriors_delays_and_order_are_jmaps_where_not_given():
    config = parse({"jmap": {"order": 40, "d_min": 2, "d_max": 20}}, Config)
    made = config.posterior_settings()
    assert (made.d_min, made.d_max, made.order) == (2, 20, 40)
    own = parse({"jmap": {"order": 40}, "posterior": {"d_min": 3, "d_max": 39}}, Config).posterior_settings()
    assert (own.d_min, own.d_max, own.order) == (3, 39, 40)
    bounds = parse({"reach": {"sample_time": 300}, "jmap": {"d_max": "bounds"}}, Config)
    assert bounds.posterior_settings().d_max == bounds.jmap_settings().d_max < 15
    assert Config().posterior_settings() == PosteriorSettings()


def test_every_setting_of_the_posterior_has_its_key_and_comes_back_from_toml(tmp_path):
    fields = {f.name: f.default for f in dataclasses.fields(PosteriorSettings) if f.name != "order"}
    assert set(Config().posterior.model_dump()) == set(fields)
    odd = {name: value + (1 if isinstance(value, int) else 1e-3) for name, value in fields.items()}
    path = tmp_path / "c.toml"
    path.write_text("[posterior]\n" + "".join(f"{name} = {value!r}\n" for name, value in odd.items()))
    config = load_config(path)
    made = config.posterior_settings()
    assert {name: getattr(made, name) for name in odd} == odd
    assert parse(json.loads(config.model_dump_json(exclude_none=True)), Config) == config


def test_a_name_with_accents_is_refused_in_words():
    with pytest.raises(ConfigError, match="reach.name = 'Isère aval': expected letters A to Z.*`note`"):
        parse({"reach": {"name": "Isère aval"}}, Config)


def test_own_keys_replace_shared_ones_within_their_tables():
    shared = {"jmap": {"order": 30, "d_max": 15}, "run": {}}
    assert merged(shared, {"jmap": {"d_max": 20}}) == {"jmap": {"order": 30, "d_max": 20}, "run": {}}
