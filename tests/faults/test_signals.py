"""Test SIGINT and SIGTERM during a run: it ends soon, with its workers, and keeps its results."""

import datetime as dt
import os
import signal
import time

import pytest

import rivid.run.run as running
from rivid.config import Config
from rivid.run.run import run
from tests.daily import FIRST, write_days
from tests.faults.processes import end, family, forked, is_locked, moments, start, wait_until
from tests.faults.test_kills import DRAWS, QUICK, duration, kept, resume
from tests.run.test_run import bytes_of

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}


@pytest.fixture(scope="module")
def season(tmp_path_factory):
    folder = tmp_path_factory.mktemp("season")
    write_days(folder / "data", 60)
    run(folder / "data", folder / "whole", Config(), QUICK)
    return folder / "data", bytes_of(folder / "whole")


@pytest.mark.long
def test_signals_in_the_middle_of_a_run(season, tmp_path, tried):
    data, whole = season
    came = 0
    for k, share in enumerate(moments(4, 40, 0, duration(data, tmp_path / "timed"))):
        number = list(CODES)[k % 2]
        out = tmp_path / str(k)
        child = start("run", data, "--out", out, "--workers", 2, "--quiet", *DRAWS)
        wait_until(
            lambda out=out, child=child: is_locked(out / ".rivid" / "lock") or child.poll() is not None
        )
        time.sleep(share / 2)
        running_still = child.poll() is None
        code, seconds, alive = end(child, number)
        assert code in ((CODES[number], 0) if running_still else (0,))
        assert seconds < 2 and not alive
        came += code != 0
        assert resume(data, out) == whole
    assert came >= 20
    tried("SIGINT or SIGTERM at a random moment, two workers; then again", came)


def test_ctrl_c_in_a_terminal_prints_one_line(season, tmp_path):
    """A terminal sends SIGINT to all processes of the command, also during their imports."""
    child = start("run", season[0], "--out", tmp_path, "--workers", 2, start_new_session=True)
    assert wait_until(lambda: len(family(child)) >= 2)
    os.killpg(child.pid, signal.SIGINT)
    assert child.wait(timeout=20) == 130
    assert len(child.stderr.read().splitlines()) == 1
    child.stderr.close()


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_a_signal_is_not_lost_while_file_after_file_is_refused(tmp_path, tried, number):
    for k in range(2000):
        (tmp_path / f"{FIRST + dt.timedelta(days=k)}.csv").write_text("time,u_Qi,u_Qo,h_L\n")
    child = start("run", tmp_path, "--out", tmp_path / "out", "--workers", 1, "--quiet")
    assert wait_until(lambda: is_locked(tmp_path / "out" / ".rivid" / "lock"))
    time.sleep(0.7)
    came, seconds, _ = end(child, number)
    assert came == CODES[number] and seconds < 2
    tried("a signal while 2,000 files with a header only are refused")


def test_what_was_done_before_a_signal_is_kept(season, tmp_path, monkeypatch, tried):
    data, whole = season
    monkeypatch.setattr(running, "BATCH_DAYS", 10)
    done = 3
    estimate, left = running.run_batches, done

    def interrupted(batches, segments, engine, progress):
        def count(n):
            nonlocal left
            progress(n)
            left -= 1
            if left == 0:
                signal.raise_signal(signal.SIGINT)

        estimate(batches, segments, engine, count)

    def action():
        signal.signal(signal.SIGINT, signal.default_int_handler)
        monkeypatch.setattr(running, "run_batches", interrupted)
        run(data, tmp_path / "out", Config(), QUICK)

    with forked(action) as code:
        assert code == 1
    assert len(kept(tmp_path / "out")) >= 10 * done
    assert resume(data, tmp_path / "out") == whole
    tried("SIGINT after three of six batches; then again")
