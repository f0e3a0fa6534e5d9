"""Every file of the corpus: read as declared to the last digit, and never wrong without a word."""

import csv
import importlib.util
import io
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from rivid.cli import cli
from rivid.config import Config, load_config, parse
from rivid.errors import RividError
from rivid.logs.catalog import find_days
from rivid.logs.ingest.work import ingest
from rivid.logs.read import read_window

HERE = Path(__file__).parent / "data" / "exports"
_spec = importlib.util.spec_from_file_location("corpus", HERE / "make.py")
corpus = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(corpus)
CASES = sorted(corpus.CASES)
NAMES = ("u_Qi", "u_Qo", "h_L")
OURS = {"config.toml", "expected.csv"}


def files_of(name):
    return sorted(path for path in (HERE / name).iterdir() if path.name not in OURS)


def expected_of(name):
    """Seconds to the three values, None where nothing was measured."""
    rows = csv.DictReader(io.StringIO((HERE / name / "expected.csv").read_text()))
    return {int(r["second"]): [float(r[n]) if r[n] else None for n in NAMES] for r in rows}


def found_in(folder):
    """The rows of rivid's own logs, without rivid: CSV with offsets."""
    import datetime as dt

    found = {}
    for path in sorted(folder.glob("*.csv")):
        for row in csv.DictReader(io.StringIO(path.read_text())):
            moment = dt.datetime.fromisoformat(row["time"])
            assert str(moment.date()) == path.stem
            found[moment.timestamp()] = [float(row[n]) if row[n] else None for n in NAMES]
    return found


def differences(found, expected):
    """Moments at which the logs hold another value than was measured, or one where none was."""
    wrong = []
    for second, values in found.items():
        true = expected.get(second)
        for name, value, right in zip(NAMES, values, true or (None,) * 3, strict=True):
            if value is not None and (right is None or abs(value - right) > 1e-12 * abs(right)):
                wrong.append((second, name, value, right))
    return wrong


@pytest.mark.parametrize("name", CASES)
def test_the_committed_files_are_what_the_generator_writes(name):
    there = {path.name: path.read_bytes() for path in (HERE / name).iterdir()}
    assert there == corpus.contents(name)


@pytest.mark.parametrize("name", CASES)
class TestDeclared:
    @pytest.fixture
    def outcome(self, name, tmp_path):
        return ingest(files_of(name), tmp_path / "logs", load_config(HERE / name / "config.toml"))

    def test_every_value_is_the_one_that_was_measured(self, name, outcome, tmp_path):
        assert outcome.exit_code == 0, [day.reason for day in outcome.days]
        found = found_in(tmp_path / "logs")
        expected = {s: v for s, v in expected_of(name).items() if v != [None, None, None]}
        assert sorted(found) == sorted(expected)
        assert differences(found, expected) == []
        assert {s: [v is None for v in row] for s, row in found.items()} == {
            s: [v is None for v in row] for s, row in expected.items()
        }

    def test_the_account_is_whole(self, name, outcome):
        assert outcome.ledger.sources
        for entry in outcome.ledger.to_json()["sources"].values():
            assert entry["read"] == entry["used"] + sum(entry["dropped"].values())
        if name != "exception":
            measured = [sum(row[j] is not None for row in expected_of(name).values()) for j in range(3)]
            config = load_config(HERE / name / "config.toml")
            for signal, count in zip(NAMES, measured, strict=True):
                sources = getattr(config.input, signal)
                for source in [sources] if isinstance(sources, str) else sources:
                    assert outcome.ledger.to_json()["sources"][source]["used"] == count

    def test_run_reads_the_logs_with_the_configuration_beside_them(self, name, outcome, tmp_path):
        config = load_config(outcome.run_config)
        expected = expected_of(name)
        sources = find_days(tmp_path / "logs", config).days
        assert [source.date for source in sources] == [day.date for day in outcome.days]
        inflow, outflow, level = [], [], []
        for source, day in zip(sources, outcome.days, strict=True):
            data = read_window(tmp_path / "logs", [source], config)
            assert data.n_filled == day.filled
            inflow, outflow, level = (
                [*inflow, *data.inflow],
                [*outflow, *data.outflow],
                [*level, *data.output],
            )
        assert len(inflow) == len(expected)
        for j, samples in enumerate((inflow, outflow, level)):
            pairs = [(s, v[j]) for s, v in zip(samples, expected.values(), strict=True) if v[j] is not None]
            np.testing.assert_allclose(*zip(*pairs, strict=True), rtol=1e-12, atol=0)

    @pytest.mark.parametrize("form", ["csv.gz", "parquet"])
    def test_all_formats_hold_the_same(self, name, outcome, tmp_path, form):
        config = load_config(HERE / name / "config.toml")
        other = ingest(files_of(name), tmp_path / "other", config, format=form)
        assert other.counts == outcome.counts
        read = load_config(other.run_config)
        for a, b in zip(
            find_days(tmp_path / "logs", read).days, find_days(tmp_path / "other", read).days, strict=True
        ):
            one, two = read_window(tmp_path / "logs", [a], read), read_window(tmp_path / "other", [b], read)
            for x, y in ((one.inflow, two.inflow), (one.outflow, two.outflow), (one.output, two.output)):
                np.testing.assert_array_equal(x, y)
            assert one.n_filled == two.n_filled

    def test_the_command_says_it_as_a_table_and_as_json(self, name, tmp_path):
        words = [*map(str, files_of(name)), "--config", str(HERE / name / "config.toml")]
        first = CliRunner().invoke(
            cli, ["ingest", *words, "--out", str(tmp_path / "logs")], standalone_mode=False
        )
        assert first.return_value == 0 and "used" in first.output and "written" in first.output
        again = CliRunner().invoke(
            cli, ["ingest", *words, "--out", str(tmp_path / "logs"), "--json"], standalone_mode=False
        )
        told = json.loads(again.output)
        assert set(told["counts"]) == {"identical"} and again.return_value == 0


NOBODY_CAN_TELL = {("hourly_means", "stamp"), ("hourly_means", "stamp.u_Qi")}
"""A stamp moves values in time and leaves no trace in the file: `sniff` asks for it every time."""


def ablations():
    """Every case with one thing less declared."""
    for name in CASES:
        given = tomllib.loads((HERE / name / "config.toml").read_text())["input"]
        for key, value in given.items():
            yield name, key
            if isinstance(value, dict):
                yield from ((name, f"{key}.{inner}") for inner in value)


@pytest.mark.parametrize(("name", "left_out"), list(ablations()))
def test_whatever_is_not_declared_is_asked_for_or_makes_no_difference(tmp_path, name, left_out):
    raw = tomllib.loads((HERE / name / "config.toml").read_text())
    table = raw["input"]
    *above, last = left_out.split(".")
    for key in above:
        table = table[key]
    del table[last]
    try:
        outcome = ingest(files_of(name), tmp_path / "logs", parse(raw, Config))
    except RividError as error:
        assert error.exit_code == 2 and "\n" not in str(error)
        assert "[input" in str(error) or "input" in str(error)
        return
    wrong = differences(found_in(tmp_path / "logs"), expected_of(name))
    if (name, left_out) in NOBODY_CAN_TELL:
        assert wrong
        return
    assert not wrong
    for day in outcome.days:
        assert day.status == "written" or "[input" in day.reason, day.reason


@pytest.mark.parametrize("name", CASES)
def test_nothing_is_read_where_nothing_is_declared(tmp_path, name):
    """Neither columns nor zone: refused before any day is looked at, with the way out."""
    with pytest.raises(RividError, match="rivid sniff|time_zone") as caught:
        ingest(files_of(name), tmp_path / "logs", parse({"reach": {"sample_time": 900}}, Config))
    assert caught.value.exit_code == 2 and not (tmp_path / "logs").exists()
