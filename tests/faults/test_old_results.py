"""Test that old results remain readable, and that results of a newer version are refused and not changed."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rivid.errors import RividError
from rivid.results.read import SCHEMA_VERSION, load_delays, load_results
from tests.daily import write_days
from tests.run.test_run import TABLES, bytes_of, command, rivid

KEPT = Path(__file__).parent / "old_results"
"""A folder for each schema version: OUT of a run of three days of `tests.daily`, as that version wrote it."""


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs") / "data"
    write_days(folder, 3)
    return folder


def test_results_of_every_version_are_kept_here():
    assert sorted(path.name for path in KEPT.iterdir()) == [str(v + 1) for v in range(SCHEMA_VERSION)]


@pytest.mark.parametrize("version", [path.name for path in sorted(KEPT.iterdir())])
def test_old_results_are_read_drawn_and_taken_up(data, tmp_path, tried, version):
    out = shutil.copytree(KEPT / version, tmp_path / "out")
    assert json.loads((out / "run.json").read_text())["schema_version"] == int(version)
    jmap, posterior = load_results(out).estimators
    assert [str(d) for d in jmap.dates] == ["2008-03-10", "2008-03-11", "2008-03-12"]
    assert jmap.status == ["ok"] * 3 and jmap.delay.tolist() == [7, 7, 7]
    assert jmap.fir.shape == (3, 30) and posterior.probability is not None
    assert len(load_delays(out)) == 6
    done = command("figures", out)
    assert done.returncode == 0, done.stderr
    assert (out / "report.html").exists() and (out / "figures" / "tdr_jmap.png").exists()
    words = ("--estimator", "jmap", "--estimator", "posterior", "--no-figures")
    code, output = rivid("run", data, "--out", out, *words)
    assert code == 0 and "damaged" not in output
    assert load_results(out).estimators[0].delay.tolist() == [7, 7, 7]
    rows = load_delays(out)
    middle = rows["delay_s"] + np.where(rows["estimator"] == "jmap", 66.5, 0.0)
    assert np.allclose(rows["travel_time_s"], middle)
    tried(f"results of schema version {version}: read, drawn, and run into")


@pytest.fixture
def newer(data, tmp_path):
    out = shutil.copytree(KEPT / str(SCHEMA_VERSION), tmp_path / "out")
    record = json.loads((out / "run.json").read_text()) | {"schema_version": SCHEMA_VERSION + 1}
    (out / "run.json").write_text(json.dumps(record))
    return out


def test_newer_results_are_refused_and_left_alone(newer, data, tried):
    before = {path: path.read_bytes() for path in newer.rglob("*") if path.is_file()}
    commands = (["run", data, "--out", newer], ["figures", newer], ["season", newer])
    for words in commands:
        done = command(*words)
        (output,) = done.stderr.splitlines()
        assert done.returncode == 1 and "newer rivid" in output and "upgrade rivid" in output
    for read in (load_results, load_delays):
        with pytest.raises(RividError, match="newer rivid"):
            read(newer)
    after = {path: path.read_bytes() for path in newer.rglob("*") if path.is_file()}
    assert {p: b for p, b in after.items() if ".rivid" not in p.parts} == {
        p: b for p, b in before.items() if ".rivid" not in p.parts
    }
    tried("results of a newer schema: run, figures, season, load_results, load_delays", len(commands) + 2)


def test_damaged_results_are_refused_by_readers_and_replaced_by_a_run(data, tmp_path, tried):
    out = shutil.copytree(KEPT / str(SCHEMA_VERSION), tmp_path / "out")
    words = ("--estimator", "jmap", "--estimator", "posterior", "--no-figures")
    contents = ("", "{", "[]", "null", "{}", '{"estimators": 3}', '{"schema_version": "x"}')
    for content in contents:
        (out / "run.json").write_text(content)
        with pytest.raises(RividError, match="run"):
            load_results(out)
    assert rivid("run", data, "--out", out, *words)[0] == 0
    assert load_results(out).estimators[0].delay.tolist() == [7, 7, 7]
    for name in TABLES[1:4]:
        table = pq.read_table(out / name)
        pq.write_table(table.drop_columns(table.column_names[-2:]), out / name)
        with pytest.raises(RividError, match="run again"):
            load_results(out)
        assert rivid("run", data, "--out", out, *words)[0] == 0
    tried("run.json that is empty, no JSON or lacks keys", len(contents))
    tried("a table without its last columns", 3)


def test_segments_with_other_columns_are_dropped_and_their_days_done_again(data, tmp_path, tried):
    out = tmp_path / "out"
    rivid("run", data, "--out", out, "--no-figures")
    before = bytes_of(out)
    (path,) = (out / ".rivid" / "segments").glob("*.parquet")
    table = pq.read_table(path)
    for other in (table.drop_columns("fir_sd"), table.append_column("more", pa.nulls(len(table)))):
        pq.write_table(other, path)
        code, output = rivid("run", data, "--out", out, "--no-figures")
        assert code == 0 and "3 estimated now" in output
        assert bytes_of(out) == before
        (path,) = (out / ".rivid" / "segments").glob("*.parquet")
    tried("a segment with a column less, or one more", 2)
