"""Test every file of the corpus: read to the last digit as declared, and never wrong without a message."""

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
from rivid.logs.days import find_days, read_window
from rivid.logs.exports import ingest

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
    """Return the three values by seconds, None if nothing was measured."""
    rows = csv.DictReader(io.StringIO((HERE / name / "expected.csv").read_text()))
    return {int(r["second"]): [float(r[n]) if r[n] else None for n in NAMES] for r in rows}


def found_in(folder):
    """Read the rows of rivid's own logs without rivid: CSV with offsets."""
    import datetime as dt

    found = {}
    for path in sorted(folder.glob("*.csv")):
        for row in csv.DictReader(io.StringIO(path.read_text())):
            moment = dt.datetime.fromisoformat(row["time"])
            assert str(moment.date()) == path.stem
            found[moment.timestamp()] = [float(row[n]) if row[n] else None for n in NAMES]
    return found


def differences(found, expected):
    """Return the moments at which the logs and the measured values differ, or a value was not measured."""
    wrong = []
    for second, values in found.items():
        true = expected.get(second)
        for name, value, right in zip(NAMES, values, true or (None,) * 3, strict=True):
            if value is not None and (right is None or abs(value - right) > 1e-12 * abs(right)):
                wrong.append((second, name, value, right))
    return wrong


@pytest.mark.parametrize("name", CASES)
def test_the_committed_files_are_what_the_generator_writes(name):
    there = {p.name: p.read_bytes() for p in (HERE / name).iterdir() if p.name != "config.toml"}
    assert there == corpus.contents(name)


@pytest.fixture(scope="module", params=CASES)
def declared(request, tmp_path_factory):
    """Return the name of a case, its folder, and the outcome of the ingest with all declarations."""
    folder = tmp_path_factory.mktemp(request.param)
    config = load_config(HERE / request.param / "config.toml")
    return request.param, folder, ingest(files_of(request.param), folder / "logs", config)


def test_every_value_is_the_one_that_was_measured(declared):
    name, folder, outcome = declared
    assert outcome.exit_code == 0, [day.reason for day in outcome.days]
    found = found_in(folder / "logs")
    expected = {s: v for s, v in expected_of(name).items() if v != [None, None, None]}
    assert sorted(found) == sorted(expected) and differences(found, expected) == []
    for second, row in found.items():
        assert [v is None for v in row] == [v is None for v in expected[second]]


def test_the_account_is_whole(declared):
    name, _, outcome = declared
    entries = outcome.ledger["sources"]
    assert entries
    for entry in entries.values():
        assert entry["read"] == entry["used"] + sum(entry["dropped"].values())
    if name == "exception":  # logged on change: fewer values than samples
        return
    given = load_config(HERE / name / "config.toml").input
    for j, signal in enumerate(NAMES):
        measured = sum(row[j] is not None for row in expected_of(name).values())
        for source in np.atleast_1d(getattr(given, signal)):
            assert entries[source]["used"] == measured


def days_in(folder, config):
    days = find_days(folder, config).days
    return [day.date for day in days], [read_window(folder, [day], config) for day in days]


def test_run_reads_the_logs_with_the_configuration_beside_them(declared):
    name, folder, outcome = declared
    dates, days = days_in(folder / "logs", load_config(outcome.run_config))
    assert dates == [day.date for day in outcome.days]
    assert [day.n_filled for day in days] == [day.filled for day in outcome.days]
    expected = expected_of(name).values()
    for j, signal in enumerate(("inflow", "outflow", "output")):
        samples = np.concatenate([getattr(day, signal) for day in days])
        pairs = [(x, row[j]) for x, row in zip(samples, expected, strict=True) if row[j] is not None]
        np.testing.assert_allclose(*zip(*pairs, strict=True), rtol=1e-12, atol=0)


def test_parquet_holds_the_same_as_csv(declared, tmp_path):
    name, folder, outcome = declared
    given = load_config(HERE / name / "config.toml")
    other = ingest(files_of(name), tmp_path / "other", given, format="parquet")
    assert other.counts == outcome.counts
    config = load_config(other.run_config)
    (dates, ours), (others, theirs) = (
        days_in(path, config) for path in (folder / "logs", tmp_path / "other")
    )
    assert dates == others
    for one, two in zip(ours, theirs, strict=True):
        for signal in ("inflow", "outflow", "output", "n_filled"):
            np.testing.assert_array_equal(getattr(one, signal), getattr(two, signal))


def test_the_command_on_an_ingested_case_finds_identical_logs(declared):
    name, folder, _ = declared
    words = [*files_of(name), "--config", HERE / name / "config.toml", "--out", folder / "logs"]
    for more in ([], ["--json"]):
        result = CliRunner().invoke(cli, ["ingest", *map(str, words), *more], standalone_mode=False)
        assert result.return_value == 0 and "used" in result.output
    assert set(json.loads(result.output)["counts"]) == {"identical"}


NOBODY_CAN_TELL = {("hourly_means", "stamp"), ("hourly_means", "stamp.u_Qi")}
"""A stamp moves values in time and is not visible in the file: `sniff` asks for it every time."""


def ablations():
    """Yield every case without one of its declarations."""
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
    """Neither columns nor zone are declared: the refusal comes before any day is read, with the remedy."""
    with pytest.raises(RividError, match="rivid sniff|time_zone") as caught:
        ingest(files_of(name), tmp_path / "logs", parse({"reach": {"sample_time": 900}}, Config))
    assert caught.value.exit_code == 2 and not (tmp_path / "logs").exists()
