"""Test that a hostile configuration is refused in one line, with exit code 2."""

import json
import string

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rivid.config import Config, load_config
from rivid.errors import ConfigError, RividError
from rivid.estimators import build
from tests import examples
from tests.daily import write_days
from tests.run.test_run import command, rivid

TABLES = tuple(Config.model_fields)


def keys_of(table):
    return sorted(type(getattr(Config(), table)).model_fields)


LEAVES = st.one_of(
    st.integers(-(10**30), 10**30),
    st.floats().map(lambda x: f"{x}".replace("e+", "e")),
    st.booleans().map(lambda x: str(x).lower()),
    st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=20).map(json.dumps),
    st.sampled_from(
        ["1e999", "-0.0", "nan", "inf", "-inf", "10_0", "0x7fffffffffffffff", "2008-03-10", "07:32:00"]
    ),
)
VALUES = st.recursive(
    LEAVES.map(str),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda x: f"[{', '.join(x)}]"),
        st.dictionaries(st.text(string.ascii_letters, min_size=1, max_size=5), inner, max_size=2).map(
            lambda x: "{" + ", ".join(f"{k} = {v}" for k, v in x.items()) + "}"
        ),
    ),
    max_leaves=6,
)


@st.composite
def tomls(draw):
    """Draw a configuration of real and invented keys with values of any kind."""
    lines = []
    for table in draw(st.lists(st.sampled_from([*TABLES, "reech"]), min_size=1, max_size=3, unique=True)):
        lines.append(f"[{table}]")
        known = keys_of(table) if table in TABLES else []
        names = st.sampled_from([*known, "workers", "lenght"])
        for key in draw(st.lists(names, min_size=1, max_size=3, unique=True)):
            lines.append(f"{key} = {draw(VALUES)}")
    return "\n".join(lines) + "\n"


def refused_in_one_line(path):
    """Return whether the configuration is refused; fail on anything but a result or one line."""
    try:
        build(load_config(path))
    except RividError as error:
        assert isinstance(error, ConfigError), error
        assert str(error).strip() and len(str(error).splitlines()) == 1, str(error)
        assert len(str(error)) < 2000
        return True
    return False


def test_any_keys_with_any_values(tmp_path, tried):
    path, refused, seen = tmp_path / "c.toml", 0, 0

    @settings(
        max_examples=examples(400), deadline=None, suppress_health_check=list(HealthCheck), derandomize=True
    )
    @given(tomls())
    def attack(text):
        nonlocal refused, seen
        path.write_text(text, encoding="utf-8")
        refused += refused_in_one_line(path)
        seen += 1

    attack()
    assert refused > seen // 2
    tried("generated TOML: unknown keys, numbers of any size, nan, inf, tables for numbers", seen)


DEEP = {
    "arrays": "[reach]\nname = " + "[" * 9000 + "]" * 9000,
    "half open": "[reach]\nname = " + "[" * 100_000,
    "inline tables": "x = " + "{a = " * 3000 + "1" + "}" * 3000,
    "a table": "[" + "a." * 5_000 + "a]\n",
    "a table below a key": "[reach." + "name." * 5000 + "name]\nx = 1\n",
    "a table below a list": "[run." + "estimators." * 5000 + "x]\nx = 1\n",
    "a dotted key": "[input]\nunits." + "u." * 2000 + "u = 1\n",
    "a long number": "[reach]\nlength = " + "9" * 5000,
    "a long name": "[reach]\nname = '" + "x" * 200_000 + "'",
    "a long key": "[reach]\n" + "x" * 200_000 + " = 1",
    "many keys": "[reach]\n" + "\n".join(f"k{i} = 1" for i in range(20_000)),
    "no UTF-8": "[reach]\nname = '\udcff'",
    "a NUL": "[reach]\nname = '\0'",
}


def test_deep_and_long(tmp_path, tried):
    path = tmp_path / "c.toml"
    for kind, text in DEEP.items():
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        assert refused_in_one_line(path), kind
        tried(f"TOML with {kind}")


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs") / "data"
    write_days(folder, 1)
    return folder


def test_the_command_prints_one_line_and_writes_nothing(data, tmp_path, tried):
    path = tmp_path / "c.toml"
    path.write_text(DEEP["a table below a key"])
    for source in (data, data.parent):  # of a reach, and of a fleet
        done = command("run", source, "--config", path, "--out", tmp_path / "out")
        assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr[-500:]
        assert len(done.stderr) < 2000
    for place in ("/dev/zero", "/dev/null/c.toml", "/", "/dev/full"):
        code, output = rivid("run", data, "--config", place, "--out", tmp_path / "out")
        assert code in (2, 10) and len(output.splitlines()) == 1, output
        tried(f"--config {place}")
    assert not (tmp_path / "out" / "delays.csv").exists()
    tried("rivid run with a deep table, of a reach and of a fleet", 2)


OPTIONS = (
    ("--workers", "1000000000"), ("--workers", "-1"), ("--workers", "nan"), ("--workers", "9" * 5000),
    ("--shard", "1/0"), ("--shard", "9" * 5000 + "/2"), ("--shard", "2/1000000000000"),
    ("--estimator", "x" * 10_000), ("--from", "9999-99-99"), ("--from", "99999-01-01"), ("--unknown",),
)  # fmt: skip


def test_hostile_options(data, tmp_path, tried):
    done = command("run", data, "--out", tmp_path / "out", "--no-figures", *OPTIONS[0])
    assert done.returncode == 2 and "Traceback" not in done.stderr
    for words in OPTIONS:
        assert rivid("run", data, "--out", tmp_path / "out", "--no-figures", *words)[0] == 2, words
        tried(" ".join(words)[:40])
    assert not (tmp_path / "out").exists()
