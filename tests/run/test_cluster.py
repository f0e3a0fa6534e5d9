"""Test Dask: the same bytes as processes, on this machine and on a standing scheduler, after any failure."""

import os
import re
import signal
import subprocess
import sys
import time

import psutil
import pytest

from rivid.config import Config
from rivid.errors import ConfigError, RividError
from rivid.fleet.outcome import kept
from rivid.results.read import load_results
from rivid.run import dask as cluster
from rivid.run.dask import Dask
from rivid.run.run import Options, run, work
from tests.daily import write_days
from tests.faults.processes import family, remaining, start, wait_until
from tests.run.test_run import bytes_of, rivid
from tests.run.test_workers import DEADLY

TABLES_ONLY = Options(figures=False)


def command(*words, **more):
    return subprocess.run(
        [sys.executable, "-m", "rivid", *map(str, words)], capture_output=True, text=True, timeout=120, **more
    )


@pytest.fixture(scope="module")
def season(tmp_path_factory):
    folder = tmp_path_factory.mktemp("season")
    write_days(folder / "data", 40)
    run(folder / "data", folder / "whole", Config(), TABLES_ONLY)
    return folder / "data", bytes_of(folder / "whole")


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Return the file of a standing scheduler with one worker of two threads, not started by this process."""
    folder = tmp_path_factory.mktemp("scheduler")
    file = folder / "scheduler.json"
    running = []
    for words in (["scheduler", "--port", "0"], ["worker", "--nthreads", "2", "--no-nanny"]):
        words = [sys.executable, "-m", "dask", *words, "--scheduler-file", file, "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
        running.append(subprocess.Popen(words, **quiet))
    assert wait_until(file.exists, 30)
    yield file
    for process in running[::-1]:
        process.terminate()
        process.wait(timeout=20)


@pytest.mark.long
def test_workers_of_this_machine_write_the_same_tables(season, tmp_path):
    data, whole = season
    done = command("run", data, "--out", tmp_path, "--engine", "dask", "--workers", 2, "--no-figures")
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert bytes_of(tmp_path) == whole


def test_a_standing_scheduler_writes_the_same_tables_and_stays(season, scheduler, tmp_path, monkeypatch):
    data, whole = season
    monkeypatch.chdir(tmp_path)  # relative paths that are valid only here
    words = ("run", os.path.relpath(data), "--out", "file", "--scheduler", scheduler, "--no-figures")
    assert rivid(*words)[0] == 0
    with Dask(re.search(r"tcp://[^\"]+", scheduler.read_text())[0]) as engine:
        run(data, tmp_path / "address", Config(), TABLES_ONLY, engine=engine)
    assert bytes_of(tmp_path / "file") == bytes_of(tmp_path / "address") == whole


def test_a_finished_run_contacts_no_scheduler(season, tmp_path):
    data, _ = season
    run(data, tmp_path, Config(), TABLES_ONLY)
    with Dask("tcp://127.0.0.1:1") as engine:
        assert run(data, tmp_path, Config(), TABLES_ONLY, engine=engine).computed == 0


@pytest.mark.long
def test_a_fleet_has_the_same_tables(season, scheduler, tmp_path):
    data, _ = season
    for name in ("alpha", "beta"):
        (tmp_path / "logs" / name).mkdir(parents=True)
        for log in data.iterdir():
            (tmp_path / "logs" / name / log.name).hardlink_to(log)
    out = tmp_path / "out"
    done = command("run", tmp_path / "logs", "--out", out, "--scheduler", scheduler, "--no-figures")
    assert done.returncode == 0, done.stderr
    assert [(o.reach, o.code, o.data_sets) for o in kept(out)] == [("alpha", 0, 40), ("beta", 0, 40)]
    assert command("run", tmp_path / "logs", "--out", tmp_path / "plain", "--no-figures").returncode == 0
    for name in ("alpha", "beta"):
        assert bytes_of(out / name) == bytes_of(tmp_path / "plain" / name)


@pytest.mark.long
def test_the_day_that_kills_its_worker_is_alone_and_failed(tmp_path):
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(DEADLY)
    write_days(tmp_path / "data", 9)
    path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    done = command(
        *("run", tmp_path / "data", "--out", tmp_path / "out", "--engine", "dask", "--no-figures"),
        env=os.environ | {"PYTHONPATH": path},
    )
    assert done.returncode == 3, done.stderr
    for one in load_results(tmp_path / "out").estimators:
        assert [s == "failed" for s in one.status] == [str(d) == "2008-03-13" for d in one.dates]


def workers_of(child):
    """Return the worker processes, below Dask's own."""
    return [p for p in family(child) if "spawn_main" in " ".join(words_of(p))]


def words_of(process):
    try:
        return process.cmdline()
    except psutil.Error:
        return []


@pytest.mark.long
@pytest.mark.parametrize("victim", ["worker", "parent", "interrupt"])
def test_a_kill_at_the_start_loses_nothing(victim, season, tmp_path):
    data, whole = season
    words = ["run", data, "--out", tmp_path, "--engine", "dask", "--workers", 2, "--no-figures"]
    child = start(*words)
    while child.poll() is None and len(workers_of(child)) < 2:
        time.sleep(0.02)
    everyone = family(child)
    process = workers_of(child)[0] if victim == "worker" else child
    process.send_signal(signal.SIGINT if victim == "interrupt" else signal.SIGKILL)
    child.communicate(timeout=60)
    if victim != "worker":
        assert not remaining(everyone)  # within 2 s
        assert child.returncode == (130 if victim == "interrupt" else -signal.SIGKILL)
        run(data, tmp_path, Config(), TABLES_ONLY)
    assert bytes_of(tmp_path) == whole


@pytest.mark.long
def test_killed_workers_cost_nothing_and_few_batches_are_under_way(season, tmp_path, monkeypatch):
    data, whole = season
    monkeypatch.setattr("rivid.run.run.BATCH_DAYS", 2)
    killed, under_way, most = [], set(), 0
    with Dask(workers=2) as engine:
        submit = engine.submit

        def deadly(task, *arguments):
            nonlocal most
            future = submit(task, *arguments)
            under_way.add(future)
            future.add_done_callback(under_way.discard)
            most = max(most, len(under_way))
            if len(killed) < 3 and task is work:
                at_work = [p for p in psutil.Process().children() if "spawn_main" in " ".join(words_of(p))]
                for process in [p for p in at_work if p.pid not in killed][:1]:
                    process.kill()
                    killed.append(process.pid)
            return future

        monkeypatch.setattr(engine, "submit", deadly)
        run(data, tmp_path, Config(), TABLES_ONLY, engine=engine)
    assert len(killed) >= 2 and 2 <= most <= 2 * 2
    assert bytes_of(tmp_path) == whole


def test_a_worker_that_does_not_see_the_logs_fails_no_day(season, scheduler, tmp_path, monkeypatch):
    data, _ = season
    away = data.with_name("away")
    with Dask(str(scheduler)) as engine:
        submit = engine.submit

        def unmounted(task, *arguments):
            if not away.exists():
                data.rename(away)
            return submit(task, *arguments)

        monkeypatch.setattr(engine, "submit", unmounted)
        try:
            with pytest.raises(RividError, match=r"does not see .*data: .* under these paths"):
                run(data, tmp_path, Config(), TABLES_ONLY, engine=engine)
        finally:
            away.rename(data)
    assert not (tmp_path / "delays.csv").exists()


def test_clusters_that_cannot_be_used_are_refused(season, tmp_path, monkeypatch):
    with pytest.raises(RividError, match=r"worker has rivid .*this command is rivid 9.9"):
        cluster._execute("9.9", False, b"")
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with pytest.raises(RividError, match="no Dask scheduler answers at tcp://127.0.0.1:1 "):
        with Dask("tcp://127.0.0.1:1") as engine:
            run(season[0], tmp_path, Config(), TABLES_ONLY, engine=engine)
    with pytest.raises(ConfigError, match="no scheduler file nowhere.json: start"):
        Dask("nowhere.json")
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"pip install 'rivid\[dask\]'"):
        Dask()


@pytest.mark.parametrize(
    "words, expected",
    [
        (["--engine", "processes", "--scheduler", "tcp://a:1"], "--scheduler is for --engine dask"),
        (["--scheduler", "tcp://a:1", "--workers", "2"], "the workers are the scheduler's"),
    ],
)
def test_options_that_contradict_each_other_are_refused(words, expected, season, tmp_path):
    code, message = rivid("run", season[0], "--out", tmp_path / "out", *words)
    assert code == 2 and expected in message
