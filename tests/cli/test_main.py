"""Test the command as a process: alone, misspelt, truncated, interrupted, with closed streams."""

import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rivid import __version__
from rivid.cli import COMMANDS
from tests.cli.conftest import ROOT
from tests.daily import write_days
from tests.faults.processes import wait_until
from tests.run.test_run import command

REAL = [sys.executable, "-c", "from rivid.cli import main; main()"]
WEEK = ROOT / "sample_data" / "basse_isere_csv"


def test_without_a_command_it_names_the_first_two():
    done = command()
    assert done.returncode == 2 and done.stderr == ""
    named = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("  rivid ")]
    assert named == ["check", "run"] and "rivid --help" in done.stdout
    assert command("--version").stdout == f"rivid, version {__version__}\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rnu"], "; did you mean run? See `rivid --help`."),
        (["run", "--conifg", "x", "y"], "--config"),
        (["run"], "Missing argument 'DATA_DIR'. See `rivid run --help`."),
        (["run", "logs", "--estimator", "jmpa"], "; did you mean jmap? See `rivid run --help`."),
        (["run", "logs", "--from", "today"], "2008-03-14 is expected."),
        (["effects", "leakge"], "; did you mean leakage?"),
        (["figures", "out", "--logs", "x"], "add --paper"),
    ],
)
def test_a_usage_error_is_one_line_with_a_suggestion(words, message):
    done = command(*words)
    assert done.returncode == 2 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("rivid: ") and message in line


def test_a_mistyped_option_suggests_the_nearest(rivid):
    for name in COMMANDS:
        done = rivid(name, "--hepl")
        assert done.code == 2 and "--help" in done.exception.format_message(), name


@pytest.mark.parametrize("words", [("effects",), ("run", "--help"), ()])
def test_a_closed_pipe_ends_it_without_a_message(words):
    read, write = os.pipe()
    os.close(read)
    done = command(*words, stdout=write)
    os.close(write)
    assert done.stderr == "" and done.returncode in (1, 2)


@pytest.mark.parametrize("closed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_closed_streams_change_neither_results_nor_exit_code(tmp_path, closed):
    words = [*REAL, "run", str(WEEK), "--out", str(tmp_path), "--no-figures", "--estimator", "ml", "--quiet"]
    done = subprocess.run(words, capture_output=True, text=True, preexec_fn=lambda: os.close(closed))
    assert (done.returncode, done.stderr) == (0, "") and (tmp_path / "delays.csv").is_file()


def test_a_low_limit_of_open_files_is_named(tmp_path):
    words = [*REAL, "run", str(WEEK), "--out", str(tmp_path), "--quiet", "--workers", "2"]
    few = lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (16, 16))  # noqa: E731
    done = subprocess.run(words, capture_output=True, text=True, preexec_fn=few)
    assert done.returncode == 1 and "ulimit -n" in done.stderr and "standard output" not in done.stderr


def test_the_backend_of_a_notebook_does_not_stop_the_figures(tmp_path):
    code = "import os; from rivid.cli import main\ntry: main()\nfinally: print(os.environ['MPLBACKEND'])"
    words = [sys.executable, "-c", code, "run", WEEK, "--out", tmp_path, "--quiet", "--workers", "1"]
    words += ["--estimator", "ml", "--to", "2008-03-10"]
    env = os.environ | {"MPLBACKEND": "module://no_such_backend"}
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, env=env)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "agg\n")
    assert list((tmp_path / "figures").glob("*.png"))


def test_a_run_that_is_ended_prints_one_line(tmp_path):
    write_days(tmp_path / "logs", 40)
    out = tmp_path / "out"
    words = ["run", tmp_path / "logs", "--out", out, "--estimator", "posterior", "--workers", "1"]
    child = subprocess.Popen(
        [*REAL, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    while not (out / ".rivid").exists():
        time.sleep(0.005)
        assert child.poll() is None
    child.send_signal(signal.SIGTERM)
    stderr = child.communicate(timeout=20)[1]
    assert child.returncode == 128 + signal.SIGTERM
    assert stderr.startswith("rivid: ") and stderr.count("\n") == 1 and "same command" in stderr


def handles(child, number):
    """Return whether a process has a handler for a signal."""
    mask = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{child.pid}/status").read_text())[1]
    return int(mask, 16) >> (number - 1) & 1


def test_another_command_that_is_interrupted_keeps_nothing(tmp_path):
    scenario = ROOT / "configs" / "scenarios" / "cascade.toml"
    words = [*REAL, "simulate", str(scenario), "--out", str(tmp_path / "logs")]
    child = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    assert wait_until(lambda: handles(child, signal.SIGALRM))  # and with it for SIGINT
    time.sleep(0.1)
    assert child.poll() is None
    child.send_signal(signal.SIGINT)
    assert child.communicate(timeout=60)[1] == "rivid: interrupted\n"
    assert child.returncode == 130


def test_a_diagnosis_without_days_names_those_there_are_or_the_failure(rivid, tmp_path):
    done = rivid("diagnose", WEEK, "--from", "2020-01-01", "--quiet")
    assert done.code == 10 and "2008-03-10 to 2008-03-16" in str(done.exception)
    write_days(tmp_path, 1)
    (path,) = tmp_path.glob("*.csv")
    path.write_text("\n".join(path.read_text().splitlines()[:300]))
    done = rivid("diagnose", tmp_path, "--quiet")
    assert done.code == 10 and "2008-03-10: gap of" in str(done.exception)


def test_an_error_on_a_terminal_is_red_and_elsewhere_plain(monkeypatch):
    ours, theirs = os.openpty()
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    command("run", "nowhere", stderr=theirs)
    assert os.read(ours, 1000).startswith(b"\x1b[31mrivid:\x1b[0m nowhere")
    monkeypatch.setenv("NO_COLOR", "1")
    command("run", "nowhere", stderr=theirs)
    assert os.read(ours, 1000).startswith(b"rivid: nowhere")
    os.close(ours)
    os.close(theirs)
