"""Test kill -9 at every rename and at random moments: the same command again gives the same bytes."""

import os
import signal
import time

import pytest

import rivid.run.run as running
from rivid.config import Config
from rivid.results.store import read_rows
from rivid.run.run import Options, run
from tests.daily import write_days
from tests.faults.processes import KILL, end, forked, moments, start
from tests.run.test_run import bytes_of

QUICK = Options(figures=False)


@pytest.fixture(scope="module")
def season(tmp_path_factory):
    """Return logs, and the tables of an uninterrupted run."""
    folder = tmp_path_factory.mktemp("season")
    write_days(folder / "data", 20)
    run(folder / "data", folder / "whole", Config(), QUICK)
    return folder / "data", bytes_of(folder / "whole")


DRAWS = () if os.environ.get("RIVID_LONG") else ("--no-figures",)
"""In `make test` runs are killed while they start, estimate and write tables, not while they draw."""


def duration(data, out):
    """Return the duration of the undisturbed command [s], from which the moments to kill it are drawn."""
    began = time.monotonic()
    assert end(start("run", data, "--out", out, "--workers", 2, "--quiet", *DRAWS), 0)[0] == 0
    return time.monotonic() - began


def kept(out):
    """Return the keys of the finished days."""
    return set(read_rows(out / ".rivid" / "segments")[0].table["key"].to_pylist())


def resume(data, out):
    """Run again in this process: finished days are not repeated, and nothing of the killed run remains."""
    before = kept(out) if (out / ".rivid").exists() else set()
    summary = run(data, out, Config(), QUICK)
    assert summary.computed_keys.isdisjoint(before)
    assert summary.computed + len(before) == summary.windows
    assert not summary.damaged
    assert not list(out.rglob("*.part"))
    return bytes_of(out)


@pytest.mark.parametrize("moment", ["before", pytest.param("after", marks=pytest.mark.long)])
def test_killed_at_every_rename(season, tmp_path, monkeypatch, tried, moment):
    data, whole = season
    monkeypatch.setattr(running, "BATCH_DAYS", 10)  # several segments
    rename, count = os.replace, 0

    def counting(*where):
        nonlocal count
        count += 1
        rename(*where)

    monkeypatch.setattr(os, "replace", counting)
    run(data, tmp_path / "counted", Config(), QUICK)
    renames, done_twice = count, 0
    assert renames >= 2 + 5 + 2  # segments, tables, run.json before and after

    for k in range(renames):
        left = k

        def deadly(*where):
            nonlocal left
            if left == 0 and moment == "before":
                os.kill(os.getpid(), signal.SIGKILL)
            rename(*where)
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            left -= 1

        out = tmp_path / str(k)
        monkeypatch.setattr(os, "replace", deadly)
        with forked(lambda out=out: run(data, out, Config(), QUICK)) as code:
            assert code == -signal.SIGKILL
        monkeypatch.setattr(os, "replace", rename)
        assert resume(data, out) == whole
        done_twice += run(data, out, Config(), QUICK).computed
    assert done_twice == 0
    tried(f"SIGKILL right {moment} the k-th rename, for every k; then again", renames)


def kill_at_random(data, whole, tmp_path, n, seed):
    """Kill n runs of two workers; every third OUT is killed three times before it may end."""
    killed = 0
    for k, wait in enumerate(moments(seed, n, 0.05, duration(data, tmp_path / "timed"))):
        out = tmp_path / str(k // 3 if k % 6 < 3 else f"{k}_")
        child = start("run", data, "--out", out, "--workers", 2, "--quiet", *DRAWS)
        time.sleep(wait)
        code, _, alive = end(child, KILL)
        assert not alive, f"{alive} outlived their parent"
        assert code in (-KILL, 0), "killed, or it had ended well before"
        killed += code == -KILL
        if k % 6 >= 2:
            assert resume(data, out) == whole
    return killed


@pytest.mark.long
def test_killed_at_random_moments(season, tmp_path, tried):
    killed = kill_at_random(*season, tmp_path, 80, 2)
    assert killed >= 50
    tried("SIGKILL of the run at a random moment, two workers; then again", killed)
