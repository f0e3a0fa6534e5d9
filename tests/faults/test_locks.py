"""Test two real runs into one OUT, and the lock of a killed run."""

import signal
import time

import pytest

from rivid.config import Config
from rivid.run.run import run
from tests.daily import write_days
from tests.faults.processes import KILL, STOP, end, is_locked, start, wait_until
from tests.faults.test_kills import QUICK
from tests.run.test_run import bytes_of, command


@pytest.fixture(scope="module")
def season(tmp_path_factory):
    folder = tmp_path_factory.mktemp("season")
    write_days(folder / "data", 40)
    run(folder / "data", folder / "whole", Config(), QUICK)
    return folder / "data", bytes_of(folder / "whole")


def test_a_second_run_is_refused_and_the_lock_of_a_killed_run_does_not_block(season, tmp_path, tried):
    data, whole = season
    out = tmp_path / "out"
    first = start("run", data, "--out", out, "--quiet", "--no-figures")
    assert wait_until(lambda: is_locked(out / ".rivid" / "lock"))
    first.send_signal(STOP)  # it holds OUT until it continues
    for _ in range(2):
        began = time.monotonic()
        second = command("run", data, "--out", out, "--no-figures")
        assert second.returncode == 11 and time.monotonic() - began < 5
        (output,) = second.stderr.splitlines()
        assert "another run is writing" in output
    assert end(first, KILL)[0] == -signal.SIGKILL
    assert (out / ".rivid" / "lock").exists(), "the file is there, the lock is gone"
    assert command("run", data, "--out", out, "--no-figures").returncode == 0
    assert bytes_of(out) == whole
    tried("a second run beside a stopped one; then the first killed, and again", 2)


def test_runs_that_start_together_write_one_result(season, tmp_path, tried):
    data, whole = season
    rounds = 1
    for k in range(rounds):
        out = tmp_path / str(k)
        together = [start("run", data, "--out", out, "--quiet", "--no-figures") for _ in range(3)]
        codes = [child.wait(timeout=60) for child in together]
        for child in together:
            child.stderr.close()
        assert set(codes) <= {0, 11} and 0 in codes
        assert bytes_of(out) == whole
    tried("three runs into one OUT, started together", rounds)
