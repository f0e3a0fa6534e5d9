"""Test `rivid simulate`, its files, and the sample data generated with it."""

import datetime as dt
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from benchmarks.observables import observables
from rivid.cli.simulate import command
from rivid.config import load_config
from rivid.errors import ConfigError
from rivid.logs.days import find_days, read_window
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario

ROOT = Path(__file__).parent.parent.parent
SAMPLE = ROOT / "sample_data"
SHORT = 'days = 4\nseed = 1\nmissing_days = 1\n[output]\nformat = "csv"\n'


def call(*words):
    return CliRunner().invoke(command, [str(w) for w in words], standalone_mode=False, catch_exceptions=False)


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SHORT)
    return path


def contents(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir()}


def test_logs_lie_in_the_directory_and_the_truth_next_to_it(scenario, tmp_path):
    done = call(scenario, "--out", tmp_path / "logs")
    season = simulate(load_scenario(scenario))
    assert sorted(contents(tmp_path / "logs")) == [f"{date}.csv" for date in season.dates]
    truth = json.loads((tmp_path / "logs_truth.json").read_text())
    assert [day["date"] for day in truth["days"]] == [str(date) for date in season.dates]
    assert [day["delay_samples"] for day in truth["days"]] == season.delay.tolist()
    assert truth["seed"] == 1 and truth["scenario"]["missing_days"] == 1
    assert truth["alpha_i"] == pytest.approx(133 / 6.7e5)
    assert "seed 1: 3 days" in done.stdout and "3 files in" in done.stdout


def test_twice_gives_the_same_bytes_and_another_seed_does_not(scenario, tmp_path):
    call(scenario, "--out", tmp_path / "a")
    call(scenario, "--out", tmp_path / "b")
    call(scenario, "--out", tmp_path / "a")  # overwrites itself
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert (tmp_path / "a_truth.json").read_bytes() == (tmp_path / "b_truth.json").read_bytes()
    call(scenario, "--out", tmp_path / "c", "--seed", 2, "--truth", tmp_path / "elsewhere" / "t.json")
    assert json.loads((tmp_path / "elsewhere" / "t.json").read_text())["seed"] == 2
    assert not (tmp_path / "c_truth.json").exists()
    assert not set(contents(tmp_path / "c").values()) & set(contents(tmp_path / "a").values())


def test_truth_and_other_logs_are_not_mixed_with_the_logs(scenario, tmp_path):
    with pytest.raises(ConfigError, match="would lie among the logs"):
        call(scenario, "--out", tmp_path / "logs", "--truth", tmp_path / "logs" / "deep" / "t.json")
    assert not (tmp_path / "logs").exists()
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "1999-01-01.csv").write_text("mine")
    (tmp_path / "logs" / "README.md").write_text("stays")
    with pytest.raises(ConfigError, match="holds other logs, such as 1999-01-01.csv"):
        call(scenario, "--out", tmp_path / "logs")
    assert sorted(contents(tmp_path / "logs")) == ["1999-01-01.csv", "README.md"]


def test_days_shorten_a_season(scenario, tmp_path):
    call(scenario, "--out", tmp_path / "logs", "--days", 3, "--quiet")
    assert len(contents(tmp_path / "logs")) == 3


def test_the_sample_year_is_made_by_its_scenario():
    scenario = load_scenario(ROOT / "configs" / "scenarios" / "basse_isere.toml")
    season = simulate(scenario)
    zone = dt.timezone(scenario.offset)
    for month in (1, 8):
        table = pq.read_table(
            SAMPLE / "basse_isere" / f"2008-{month:02}.parquet", page_checksum_verification=True
        )
        rows = [i for i, date in enumerate(season.dates) if date.month == month]
        for name, values in (("u_Qi", season.inflow), ("u_Qo", season.outflow), ("h_L", season.level)):
            np.testing.assert_array_equal(table[name].to_numpy(), values[rows].ravel(), err_msg=name)
        assert table["time"][0].as_py() == dt.datetime.combine(season.dates[rows[0]], dt.time(), zone)
    truth = json.loads((SAMPLE / "basse_isere_truth.json").read_text())
    assert [day["delay_samples"] for day in truth["days"]] == season.delay.tolist()
    assert observables(season).table() in (SAMPLE / "basse_isere" / "README.md").read_text()


def test_the_week_is_a_week_of_the_year():
    config = load_config(ROOT / "configs" / "basse_isere.toml")
    year, week = (find_days(SAMPLE / name, config) for name in ("basse_isere", "basse_isere_csv"))
    assert sum(p.stat().st_size for p in (SAMPLE / "basse_isere").iterdir()) < 1_000_000
    assert len(year.days) == 332 and not year.bad_files and not week.bad_files
    assert [str(s.date) for s in week.days] == [f"2008-03-{day}" for day in range(10, 17)]
    same = {source.date: source for source in year.days}
    for source in week.days:
        mine = read_window(SAMPLE / "basse_isere_csv", [source], config)
        theirs = read_window(SAMPLE / "basse_isere", [same[source.date]], config)
        for name in ("inflow", "outflow", "output"):
            np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name), err_msg=name)


def test_true_levels_and_flows_are_written_with_the_truth(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(
        "days = 3\n[channel]\n[operators]\nlevel_gain = -80\n"
        "[[effects]]\nname = 'rain_inflow'\nper_month = 90\n[[effects]]\nname = 'sensor_step'\nstart = 12\n"
    )
    done = call(path, "--out", tmp_path / "logs")
    season = simulate(load_scenario(path))
    water = pq.read_table(tmp_path / "logs_truth.parquet", page_checksum_verification=True)
    assert water.num_rows == 3 * 650
    np.testing.assert_array_equal(water["level_m"].to_numpy(), season.true_level.ravel())
    np.testing.assert_array_equal(water["inflow_m3s"].to_numpy(), season.inflow.ravel())
    assert (water["unlogged_m3s"].to_numpy() - water["weather_m3s"].to_numpy()).max() > 1.0
    truth = json.loads((tmp_path / "logs_truth.json").read_text())
    rain, step = truth["effects"]
    assert rain["name"] == "rain_inflow" and len(rain["events"]) > 2
    assert step["name"] == "sensor_step" and "events" not in step
    assert "effects: rain_inflow, sensor_step" in done.stdout


def test_a_cascade_has_a_directory_and_truths_for_each_reach(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(
        "days = 2\n[output]\nformat = 'csv'\n"
        "[[cascade]]\nreach = {name = 'upper'}\n[[cascade]]\nreach = {name = 'lower', length = 9000}\n"
    )
    call(path, "--out", tmp_path / "logs")
    assert sorted(p.name for p in (tmp_path / "logs").iterdir()) == ["lower", "upper"]
    for name in ("lower", "upper"):
        assert len(contents(tmp_path / "logs" / name)) == 2
        assert (tmp_path / f"logs_truth_{name}.json").exists()
        assert (tmp_path / f"logs_truth_{name}.parquet").exists()
    with pytest.raises(ConfigError, match="expected a .json"):
        call(path, "--out", tmp_path / "more", "--truth", tmp_path / "t.parquet")
