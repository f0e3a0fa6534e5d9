"""`rivid bounds`: the proposal, the keys that it lacks, and the limit of the order."""

import json

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
