"""Test `rivid run` end to end: the contract, exit codes, and the same bytes in any order of work."""

import contextlib
import csv
import datetime as dt
import json
import multiprocessing.forkserver
import os
import shutil
import subprocess
import sys
import traceback
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from rivid.cli import cli, main
from rivid.errors import NoDataError
from rivid.results.read import load_delays, load_results
from rivid.results.store import DELAYS
from tests.daily import write_days

TABLES = ("delays.csv", "delays.parquet", "fir.parquet", "criterion.parquet", "posterior.parquet")


def rivid(*words):
    """Run a command in this process; return its exit code and its output."""
    result = CliRunner().invoke(cli, [str(w) for w in words], standalone_mode=False)
    if result.exception and not isinstance(result.exception, SystemExit):
        code = getattr(result.exception, "exit_code", None)
        if code is None:
            raise result.exception
        return code, str(result.exception)
    return result.return_value or 0, result.output


def command(*words, cwd=None, preexec_fn=None, stdout=None, stderr=None):
    """Run the command in a fork of this process, which saves the second of the imports."""
    (out, its_out), (err, its_err) = os.pipe(), os.pipe()
    pid = os.fork()
    if pid == 0:
        _become(["rivid", *map(str, words)], stdout or its_out, stderr or its_err, cwd, preexec_fn)
    os.close(its_out)
    os.close(its_err)
    with (
        ThreadPoolExecutor(2) as readers,
        open(out, encoding="utf-8") as one,
        open(err, encoding="utf-8") as two,
    ):
        streams = [*readers.map(lambda file: file.read(), (one, two))]
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return subprocess.CompletedProcess(words, code, *streams)


def _become(words, out, err, cwd, preexec_fn):
    """Run the command to its end with its own streams and directory, without the parent's workers."""
    code = 1
    try:
        for number, file in ((1, out), (2, err)):
            os.dup2(file if isinstance(file, int) else file.fileno(), number)
        sys.stdout, sys.stderr = (open(k, "w", encoding="utf-8", closefd=False) for k in (1, 2))
        server = multiprocessing.forkserver._forkserver
        server._forkserver_address = server._forkserver_alive_fd = server._forkserver_pid = None
        os.chdir(cwd or ".")
        (preexec_fn or int)()
        sys.argv = words
        main()
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(OSError):
            sys.stderr.flush()
        os._exit(code)


def bytes_of(out):
    return {name: (out / name).read_bytes() for name in TABLES}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs") / "data"
    write_days(folder, 12)
    return folder


@pytest.fixture
def data(logs, tmp_path):
    return shutil.copytree(logs, tmp_path / "data")


@pytest.fixture(scope="module")
def finished(logs, tmp_path_factory):
    """Return OUT of a run of jmap and ml, its output, and the bytes of its tables."""
    out = tmp_path_factory.mktemp("finished") / "out"
    words = ("--estimator", "jmap", "--estimator", "ml", "--workers", 1)
    code, output = rivid("run", logs, "--out", out, *words)
    assert code == 0
    return out, output, bytes_of(out)


def test_a_run_writes_the_contract(finished):
    out, output, _ = finished
    assert "report.html" in output
    with open(out / "delays.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == DELAYS.names and len(rows) == 24 and {r["status"] for r in rows} == {"ok"}
    assert [(r["date"][8:], r["estimator"]) for r in rows[:3]] == [
        ("10", "jmap"),
        ("10", "ml"),
        ("11", "jmap"),
    ]
    jmap = [r for r in rows if r["estimator"] == "jmap"]
    assert all(float(r["delay_s"]) == 133 * float(r["delay_samples"]) for r in jmap)
    assert all(r["n_samples"] == "650" and r["output_unit"] == "m" for r in jmap)
    assert all(7 * 133 < float(r["bound_gravity_s"]) < 9 * 133 for r in jmap)
    assert all(r["delay_samples"] == "" for r in rows if r["estimator"] == "ml")
    assert pq.read_table(out / "fir.parquet").num_rows == 24 * 30
    assert pq.read_table(out / "criterion.parquet").num_rows == 12 * 15
    for name in ("tdr_jmap", "histogram_jmap", "delay_map_jmap", "tdr_ml"):
        assert (out / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert (out / "report.html").stat().st_size > 10_000
    record = json.loads((out / "run.json").read_text())
    assert record["schema_version"] == 1
    assert record["counts"] == {"jmap": {"ok": 12}, "ml": {"ok": 12}}


def test_results_are_read_as_arrays_and_as_a_data_frame(finished, tmp_path):
    jmap, _ = load_results(finished[0]).estimators
    assert jmap.fir.shape == (12, 30) and jmap.criterion.shape == (12, 15)
    assert jmap.candidates.tolist() == list(range(1, 16))
    assert (jmap.candidates[jmap.criterion.argmin(axis=1)] == jmap.delay).all()
    frame = load_delays(finished[0])
    assert list(frame.columns) == DELAYS.names and frame["date"].dt.month.eq(3).all()
    assert frame["delay_samples"].dropna().between(1, 15).all()
    assert str(frame["prior_only"].dtype) == "boolean"
    with pytest.raises(NoDataError, match="rivid run"):
        load_delays(tmp_path)


def test_the_bytes_do_not_depend_on_workers_batches_or_interruptions(data, tmp_path):
    rivid("run", data, "--out", tmp_path / "one", "--no-figures", "--workers", 1)
    rivid("run", data, "--out", tmp_path / "two", "--no-figures", "--workers", 2)
    for last in ("2008-03-11", "2008-03-12", "2008-03-20"):
        rivid("run", data, "--out", tmp_path / "bits", "--no-figures", "--to", last)
    rivid("run", data, "--out", tmp_path / "bits", "--no-figures")
    assert bytes_of(tmp_path / "one") == bytes_of(tmp_path / "two") == bytes_of(tmp_path / "bits")


def test_only_what_is_new_is_estimated_and_the_report_follows_the_tables(data, tmp_path):
    out = tmp_path / "out"
    code, output = rivid("run", data, "--out", out, "--dry-run")
    assert code == 0 and "12 to estimate" in output and not out.exists()
    assert (
        "3 estimated now" in rivid("run", data, "--out", out, "--from", "2008-03-12", "--to", "2008-03-14")[1]
    )
    assert "2008-03-20" not in (out / "report.html").read_text()
    rivid("run", data, "--out", out, "--no-figures")
    assert not (out / "report.html").exists()
    assert "0 estimated now" in rivid("run", data, "--out", out)[1]
    stamp = {p: p.stat().st_mtime_ns for p in (out / "delays.csv", out / "report.html")}
    assert "0 estimated now" in rivid("run", data, "--out", out)[1]
    assert {p: p.stat().st_mtime_ns for p in stamp} == stamp
    day = data / "2008-03-13.csv"
    day.write_text(day.read_text().replace(",118.", ",119."), encoding="utf-8")
    write_days(data, 1, first=dt.date(2008, 3, 22))
    code, output = rivid("run", data, "--out", out, "--no-figures", "--json", "--quiet")
    lines = [json.loads(line) for line in output.splitlines()]
    assert code == 0 and len(lines) == 27  # a line per day and estimator, and the summary
    computed = {(line["date"], line["estimator"]) for line in lines[:-1] if line["computed"]}
    assert computed == set(product(("2008-03-13", "2008-03-22"), ("jmap", "posterior")))
    whole = lines[-1]["summary"]
    assert (whole["data_sets"], whole["computed"], whole["reused"]) == (13, 2, 11)


def test_a_file_is_read_again_where_its_content_may_have_changed(data, tmp_path):
    out, day, config = tmp_path / "out", data / "2008-03-13.csv", tmp_path / "c.toml"
    words = ("run", data, "--out", out, "--no-figures")
    rivid(*words)
    was = day.stat()
    day.write_text(day.read_text().replace(",118.", ",119."), encoding="utf-8")
    os.utime(day, ns=(was.st_atime_ns, was.st_mtime_ns))
    assert day.stat().st_size == was.st_size
    assert "1 estimated now" in rivid(*words)[1]
    assert "0 estimated now" in rivid(*words, "--verify")[1]
    for path in data.iterdir():
        os.utime(path, (1, 1))
    assert "0 estimated now" in rivid(*words)[1]
    config.write_text("[jmap]\nsigma_d = 9\n")
    assert "12 estimated now" in rivid(*words, "--config", config)[1]


def test_a_bad_day_is_a_row_with_its_reason_and_nothing_else_is_lost(data, tmp_path):
    out = tmp_path / "out"
    (data / "2008-03-12.csv").write_text("time,u_Qi,u_Qo,h_L\nnonsense\n")
    (data / "2008-03-15.csv").write_bytes(b"")
    code, _ = rivid("run", data, "--out", out)
    assert code == 3
    jmap, _ = load_results(out).estimators
    assert jmap.status.count("failed") == 2 and jmap.status.count("ok") == 10
    assert "2008-03-12.csv" in jmap.messages[2]
    assert rivid("run", data, "--out", out)[0] == 0, "they had failed before"
    assert rivid("run", data, "--out", out, "--strict")[0] == 3


def test_all_days_failing_still_give_tables_and_a_report(tmp_path):
    data, out = tmp_path / "data", tmp_path / "out"
    data.mkdir()
    for k in (1, 2, 3):
        (data / f"2008-03-0{k}.csv").write_text("time,u_Qi,u_Qo,h_L\n")
    assert rivid("run", data, "--out", out)[0] == 3
    assert load_results(out).estimators[0].status == ["failed"] * 3
    assert (out / "report.html").exists()
    write_days(data / "one", 1)
    assert rivid("run", data / "one", "--out", tmp_path / "one")[0] == 0
    assert load_results(tmp_path / "one").estimators[0].status == ["ok"]


def test_a_constant_inflow_is_unidentifiable(data, tmp_path):
    def with_inflow(date, value):
        path = data / f"{date}.csv"
        rows = [line.split(",") for line in path.read_text().splitlines()]
        rows = [rows[0], *([t, value(i), *rest] for i, (t, _, *rest) in enumerate(rows[1:]))]
        path.write_text("\n".join(map(",".join, rows)) + "\n")

    with_inflow("2008-03-12", lambda i: "300")
    with_inflow("2008-03-14", lambda i: f"{300 + i % 7 * 1e-9:.12f}")
    assert rivid("run", data, "--out", tmp_path / "out", "--no-figures")[0] == 0
    jmap, posterior = load_results(tmp_path / "out").estimators
    assert [jmap.status[i] for i in (2, 4)] == ["unidentifiable"] * 2
    assert "does not move" in jmap.messages[2]
    assert jmap.status.count("ok") == 10 and posterior.status[2] == posterior.status[4] == "unidentifiable"


def test_too_few_samples_for_the_fir_fail_the_day(tmp_path):
    config = tmp_path / "c.toml"
    config.write_text("[reach]\nsample_time = 3600\n[input]\nmax_gap = 7200\n")
    write_days(tmp_path / "data", 2)
    assert (
        rivid("run", tmp_path / "data", "--out", tmp_path / "out", "--config", config, "--no-figures")[0] == 3
    )
    jmap, posterior = load_results(tmp_path / "out").estimators
    assert "24 samples are too few" in jmap.messages[0] and posterior.status[0] == "failed"
    assert "set [run] window_days = 2 or more" in jmap.messages[0]


def test_windows_of_three_days(data, tmp_path):
    config = tmp_path / "c.toml"
    config.write_text("[run]\nwindow_days = 3\n")
    (data / "2008-03-14.csv").unlink()
    assert rivid("run", data, "--out", tmp_path / "out", "--config", config, "--no-figures")[0] == 3
    jmap, posterior = load_results(tmp_path / "out").estimators
    assert [str(d) for d in jmap.dates[:2]] == ["2008-03-12", "2008-03-13"]
    assert [s for s in jmap.status if s == "failed"] == ["failed"] * 2
    assert "2008-03-14" in jmap.messages[2] and "2008-03-14" in posterior.messages[2]
    table = pq.read_table(tmp_path / "out" / "delays.parquet")
    assert set(table["n_samples"].to_pylist()) == {None, 1949}


def test_todays_unfinished_log_is_pending_and_then_done(data, tmp_path):
    out, day = tmp_path / "out", data / "2008-03-21.csv"
    whole = day.read_text()
    day.write_text("\n".join(whole.splitlines()[:300]) + "\n")
    words = ("run", data, "--out", out, "--no-figures")
    assert rivid(*words, "--today", "2008-03-21")[0] == 0
    assert load_results(out).estimators[0].status[-1] == "pending"
    assert rivid(*words, "--today", "2008-03-22")[0] == 3
    assert load_results(out).estimators[0].status[-1] == "failed"
    day.write_text(whole)
    assert rivid(*words, "--today", "2008-03-22")[0] == 0
    assert load_results(out).estimators[0].status[-1] == "ok"


def test_the_terminal_says_the_main_numbers_in_80_columns(data, tmp_path):
    (data / "2008-03-12.csv").write_text("time,u_Qi,u_Qo,h_L\n")
    words = ("--estimator", "jmap", "--estimator", "ml", "--no-figures")
    _, output = rivid("run", data, "--out", tmp_path / "out", *words)
    note, *lines = output.splitlines()
    assert note == "rivid: no configuration: [reach] is taken from Table I"
    assert lines[0].startswith("reach: 12 data sets, 12 estimated now, 0 done before")
    assert "  jmap  11 ok, 1 failed" in lines
    assert any(" samples (" in line and " min) on " in line for line in lines)
    assert any(line.strip().startswith("2008-03-12 failed: ") for line in lines)
    assert lines[-1].startswith("delays: ") and lines[-1].endswith("delays.csv")
    assert all(len(line) <= 80 for line in lines if "failed:" not in line and not line.startswith("delays: "))


def test_nothing_to_work_on_is_exit_10(tmp_path):
    (tmp_path / "empty").mkdir()
    assert rivid("run", tmp_path / "empty", "--out", tmp_path / "out")[0] == 10
    assert rivid("run", tmp_path / "absent", "--out", tmp_path / "out")[0] == 10


def test_a_config_that_contradicts_itself_is_exit_2_in_one_line(data, tmp_path):
    config = tmp_path / "c.toml"
    config.write_text("[jmap]\nd_max = 40\n")
    code, output = rivid("run", data, "--config", config, "--out", tmp_path / "out")
    assert code == 2 and "order >= 43" in output
    assert len(output.splitlines()) == 1


def test_a_damaged_segment_is_found_and_its_days_are_done_again(data, tmp_path):
    out = tmp_path / "out"
    rivid("run", data, "--out", out, "--no-figures")
    before = bytes_of(out)
    (segment,) = (out / ".rivid" / "segments").glob("*.parquet")
    content = bytearray(segment.read_bytes())
    content[len(content) // 3] ^= 1
    segment.write_bytes(bytes(content))
    code, output = rivid("run", data, "--out", out, "--no-figures")
    assert code == 0 and "12 estimated now" in output
    assert bytes_of(out) == before


def test_an_appended_day_in_a_file_of_many_days_is_the_only_new_one(tmp_path):
    data, out = tmp_path / "data", tmp_path / "out"
    data.mkdir()
    dates = write_days(tmp_path / "days", 4)
    texts = [(tmp_path / "days" / f"{d}.csv").read_text().splitlines() for d in dates]
    (data / "all.csv").write_text(
        "\n".join([texts[0][0], *(line for t in texts[:3] for line in t[1:])]) + "\n"
    )
    assert "3 estimated now" in rivid("run", data, "--out", out, "--no-figures")[1]
    (data / "all.csv").write_text("\n".join([texts[0][0], *(line for t in texts for line in t[1:])]) + "\n")
    assert "1 estimated now" in rivid("run", data, "--out", out, "--no-figures")[1]
    rivid("run", tmp_path / "days", "--out", tmp_path / "single", "--no-figures")
    a, b = (load_results(x).estimators[0] for x in (out, tmp_path / "single"))
    assert (a.fir == b.fir).all()
