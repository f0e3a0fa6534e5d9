import json
import re
import subprocess
import sys
import tomllib

import pytest

from rivid.cli import cli
from rivid.cli.effects import TITLES
from rivid.effects import CATALOGUE, build
from rivid.errors import ConfigError
from tests.effects.test_users import LADDER


@pytest.fixture
def run(capsys):
    def run(*words):
        assert cli.main(["effects", *map(str, words)], standalone_mode=False) == 0
        return capsys.readouterr().out

    return run


def flat(text):
    return re.sub(r"\s+", " ", text)


def test_the_list_names_every_effect_with_all_units_and_limits_by_family(run):
    text = run()
    assert max(map(len, text.splitlines())) <= 80
    names = [line for line in text.splitlines() if line in CATALOGUE]
    assert names == list(CATALOGUE)
    for one in CATALOGUE.values():
        start = text.index(f"\n{one.name}\n")
        part = flat(text[start : text.find("\n\n", start)])
        assert flat(one.sentence) in part and flat(one.looks) in part
        for key, spec in one.parameters().items():
            assert f"{key} = " in part
            assert f"[{spec.unit}], {spec.low:g} to {spec.high:g}" in part
            assert flat(spec.meaning) in part
    assert all(title in text for title in TITLES.values())


@pytest.mark.parametrize("name", CATALOGUE)
def test_one_effect_in_full_has_an_example_that_loads(run, name):
    text = run(name)
    assert max(map(len, text.splitlines())) <= 80
    example = text[text.index("[[effects]]") :]
    (table,) = tomllib.loads(example)["effects"]
    one = build(table, CATALOGUE)
    assert type(one) is CATALOGUE[name]
    assert {key: getattr(one, key) for key in one.parameters()} == one.defaults()
    assert (one.dates is not None) == (one.hours is not None) == CATALOGUE[name].windowed
    assert flat(one.looks) in flat(text) and "Parameters" not in text


def test_the_json_holds_the_catalogue(run):
    records = json.loads(run("--json"))
    assert [one["name"] for one in records] == list(CATALOGUE)
    for record in records:
        one = CATALOGUE[record["name"]]
        assert (record["family"], record["sentence"], record["looks"], record["windowed"]) == (
            one.family, one.sentence, one.looks, one.windowed,
        )  # fmt: skip
        limits = {p["name"]: (p["unit"], p["low"], p["high"], p["meaning"]) for p in record["parameters"]}
        assert limits == {key: (q.unit, q.low, q.high, q.meaning) for key, q in one.parameters().items()}
        defaults = {p["name"]: p["default"] for p in record["parameters"]}
        assert build({"name": record["name"]} | defaults, CATALOGUE) == one()
    assert json.loads(run("seiche", "--json")) == records[-1]


def test_effects_of_a_file_are_listed_too(run, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(LADDER)
    assert "\nfish_ladder\n    A ladder for fish" in run("--effects-file", path)
    text = run("fish_ladder", "--effects-file", path)
    assert "flow = 0.8  # m3/s" in text and "FishLadder(" not in text


def test_an_unknown_name_lists_the_valid_ones(run):
    with pytest.raises(ConfigError, match="no effect is called 'leak': expected one of lateral_inflow, "):
        run("leak")


def test_the_list_loads_no_slow_library():
    code = (
        "import sys\nfrom rivid.cli import cli\ncli.main(['effects'], standalone_mode=False)\n"
        "slow = 'scipy pandas numba pydantic pyarrow'.split()\n"
        "print('loaded', [m for m in slow if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "loaded []", done.stdout + done.stderr
