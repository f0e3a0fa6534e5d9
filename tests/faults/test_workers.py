"""Test workers killed from outside: no day is lost, and none fails because of it."""

import random
import time

import psutil
import pytest

from rivid.config import Config
from rivid.run.run import run
from tests.daily import write_days
from tests.faults.processes import KILL, family, start
from tests.faults.test_kills import QUICK
from tests.run.test_run import bytes_of


@pytest.fixture(scope="module")
def season(tmp_path_factory):
    folder = tmp_path_factory.mktemp("season")
    write_days(folder / "data", 120)
    run(folder / "data", folder / "whole", Config(), QUICK)
    return folder / "data", bytes_of(folder / "whole")


def is_worker(process):
    """Return whether a process is a child of the process that makes workers."""
    try:
        words = " ".join(process.parent().cmdline())
        return "forkserver" in words
    except (psutil.Error, AttributeError):
        return False


def kill_workers(season, tmp_path, n, seed):
    data, whole = season
    dice, killed = random.Random(seed), 0
    for k in range(n):
        out = tmp_path / str(k)
        child = start("run", data, "--out", out, "--workers", 2, "--quiet", "--no-figures")
        mine = 0
        while child.poll() is None and mine < 1 + k % 2:
            workers = [p for p in family(child) if is_worker(p)]
            if workers:
                time.sleep(dice.uniform(0, 0.05))
                try:
                    dice.choice(workers).send_signal(KILL)
                    mine += 1
                except psutil.NoSuchProcess:
                    continue
                time.sleep(dice.uniform(0, 0.1))
            time.sleep(0.002)
        assert child.wait(timeout=60) == 0, child.stderr.read()
        child.stderr.close()
        assert bytes_of(out) == whole
        killed += mine
    return killed


@pytest.mark.long
def test_workers_killed_at_random_moments_cost_nothing(season, tmp_path, tried):
    killed = kill_workers(season, tmp_path, 30, 6)
    assert killed >= 25
    tried("SIGKILL of a worker at a random moment", killed)
