"""Test `rivid bounds`: the proposal, missing keys, and the limit of the order."""

import json
import re

import pytest

from rivid.config import load_config
from rivid.errors import ConfigError

REACH = "[reach]\nlength = {}\nwidth = 100\ndepth = 3\ndischarge_range = [50, 200]\nsample_time = 60\n"


@pytest.fixture
def settings(tmp_path):
    def write(length=9000):
        path = tmp_path / "reach.toml"
        path.write_text(REACH.format(length))
        return path

    return write


def test_the_proposal_can_be_added_to_the_configuration(rivid, settings):
    path = settings()
    done = rivid("bounds", "--config", path, "--toml")
    assert done.code == 0 and done.stderr == ""
    path.write_text(path.read_text() + done.stdout)
    proposal = json.loads(rivid("bounds", "--config", path, "--json").stdout)["proposal"]
    assert load_config(path).jmap_settings().order == proposal["order"]


def test_keys_taken_from_table_1_are_named(rivid, settings):
    path = settings()
    path.write_text("".join(line for line in path.read_text().splitlines(True) if "range" not in line))
    done = rivid("bounds", "--config", path)
    assert "discharge_range = [100.0, 800.0]" in done.stderr and "width" not in done.stderr
    done = rivid("bounds", "--config", path, "--json")
    assert json.loads(done.stdout)["assumed"] == ["discharge_range"]


def test_an_order_beyond_the_limit_is_not_proposed(rivid, settings):
    path = settings(600_000)
    done = rivid("bounds", "--config", path, "--toml")
    assert done.code == 2 and isinstance(done.exception, ConfigError) and done.stdout == ""
    assert "[reach] sample_time" in str(done.exception)
    assert "[jmap]" not in rivid("bounds", "--config", path).stdout
    enough = int(str(done.exception).split("sample_time to ")[1].split()[0])
    path.write_text(path.read_text().replace("sample_time = 60", f"sample_time = {enough}"))
    assert rivid("bounds", "--config", path, "--toml").code == 0


def test_a_long_response_is_cut_to_the_longest_order_and_asks_for_longer_data_sets(rivid, settings):
    path = settings(120_000)  # d_max = 714: twice that is above the limit
    proposed = rivid("bounds", "--config", path, "--toml").stdout
    assert "order = 1000" in proposed and "[run]\nwindow_days = 2" in proposed
    path.write_text(path.read_text() + proposed)
    assert load_config(path).jmap_settings().order == 1000 and load_config(path).run.window_days == 2
    assert "[run]" not in rivid("bounds", "--config", settings(), "--toml").stdout


@pytest.mark.parametrize("given", ["", "[run]  # of this reach\nwindow_days = 1\nmin_motion = 0.001\n"])
def test_a_river_gets_data_sets_that_hold_its_response(rivid, settings, given):
    """Regression: the length was a comment, and all days failed."""
    path = settings()
    reach = "length = 30_000\nwidth = 60\ndepth = 1.6\ndischarge_range = [55, 220]\nsample_time = 900\n"
    path.write_text(f'{given}[reach]\nkind = "river"\n{reach}')
    shown = rivid("bounds", "--config", path).stdout
    assert "[run]\nwindow_days = 2" in shown and "kinematic wave brings most of the water" in shown
    proposed = path.with_name("proposed.toml")
    proposed.write_text(path.read_text() + rivid("bounds", "--config", path, "--toml").stdout)
    config = load_config(proposed)
    assert ("set window_days = 2" in proposed.read_text()) == bool(given)
    assert config.run.window_days == (1 if given else 2)
    assert rivid("bounds", "--config", path, "--write", path).code == 0
    config, once = load_config(path), path.read_text()
    assert config.run.window_days == 2 and config.run.min_motion == (0.001 if given else 1e-4)
    assert rivid("bounds", "--config", path, "--write", path).code == 0 and path.read_text() == once


def test_samples_longer_than_the_travel_time_are_reported(rivid, settings):
    """Hourly logs with a wave of 18 min once gave "1 to 2 h" without a remark."""
    path = settings()
    for sample_time, coarse in ((60, False), (3600, True)):
        path.write_text(f"{REACH.format(9000)}".replace("= 60", f"= {sample_time}"))
        assert ("no delay can be resolved" in rivid("bounds", "--config", path).stdout) == coarse


@pytest.mark.parametrize("sample_time", [0.05, 0.7, 3.0, 40.0])
def test_the_sample_time_that_it_asks_for_is_enough(rivid, settings, sample_time):
    path = settings(600_000)
    text = path.read_text()
    path.write_text(text.replace("sample_time = 60", f"sample_time = {sample_time}"))
    error = str(rivid("bounds", "--config", path, "--toml").exception)
    enough = error.split("sample_time to ")[1].split()[0]
    path.write_text(text.replace("sample_time = 60", f"sample_time = {enough}"))
    proposed = rivid("bounds", "--config", path, "--toml")
    assert proposed.code == 0 and "order = 1000" in proposed.stdout


def test_the_proposal_replaces_that_of_a_configuration(rivid, settings, tmp_path):
    path = settings()
    path.write_text(
        path.read_text()
        + "[jmap]  # of last year\nd_max = 3\nalpha = 5000  # stays\n[run]\nwindow_days = 2\n"
    )
    done = rivid("bounds", "--config", path, "--write", path)
    assert done.code == 0 and str(path) in done.stdout
    proposal = json.loads(rivid("bounds", "--config", path, "--json").stdout)["proposal"]
    config = load_config(path)
    assert (config.jmap.order, config.jmap.d_max) == (proposal["order"], proposal["d_max"])
    assert config.jmap.alpha == 5000 and config.run.window_days == 2 and "# stays" in path.read_text()
    once = path.read_text()
    rivid("bounds", "--config", path, "--write", path)
    assert path.read_text() == once
    path.write_text(once.replace("[jmap]", "[ jmap ]").replace("order =", "M ="))
    assert rivid("bounds", "--config", path, "--write", path).code == 0 and path.read_text() == once
    new = tmp_path / "new.toml"
    rivid("bounds", "--config", path, "--write", new)
    assert load_config(new).jmap.d_max == proposal["d_max"]


def test_a_proposal_that_is_written_again_has_its_remarks_once(rivid, settings):
    path = settings()
    for sample_time in (3600, 4000):  # longer than the wave's travel time
        path.write_text(re.sub("sample_time = .*", f"sample_time = {sample_time}", path.read_text()))
        assert rivid("bounds", "--config", path, "--write", path).code == 0
    text = path.read_text()
    assert text.count("# log every") == text.count("no delay can be resolved") == 1 and "4000 s: no" in text


def test_settings_that_are_no_table_of_their_own_are_not_written(rivid, settings):
    path = settings()
    for line in ("jmap = { d_max = 3 }\n", "jmap.d_max = 3\n"):
        path.write_text(given := line + REACH.format(9000))
        done = rivid("bounds", "--config", path, "--write", path)
        assert done.code == 2 and "has no line [jmap]" in str(done.exception) and path.read_text() == given
