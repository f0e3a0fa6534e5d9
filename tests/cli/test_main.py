"""The command as a process: alone, mistyped, cut off, interrupted."""

import os
import signal
import subprocess
import sys
import time

import pytest

from rivid import __version__
from rivid.cli import COMMANDS
from tests.cli.conftest import ROOT
from tests.daily import write_days

REAL = [sys.executable, "-c", "from rivid.cli import main; main()"]


def command(*words, **options):
    """The real command."""
    return subprocess.run([*REAL, *map(str, words)], capture_output=True, text=True, **options)


def test_alone_it_says_the_two_commands_one_starts_with():
    done = command()
    assert done.returncode == 2 and done.stderr == ""
    named = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("  rivid ")]
    assert named == ["check", "run"]
    assert len(done.stdout.splitlines()) <= 8 and "rivid --help" in done.stdout


def test_it_says_its_version():
    assert command("--version").stdout == f"rivid, version {__version__}\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rnu"], "rivid: No such command 'rnu'. Did you mean 'run'? See `rivid --help`."),
        (["xyzzy"], "rivid: No such command 'xyzzy'. See `rivid --help`."),
        (["run", "--conifg", "x", "y"], "--config"),
        (["run"], "rivid: Missing argument 'DATA_DIR'. See `rivid run --help`."),
        (["run", "logs", "--estimator", "jmpa"], "Did you mean 'jmap'? See `rivid run --help`."),
        (["run", "logs", "--from", "today"], "'today' came, a date like 2008-03-14 is expected."),
        (["run", "logs", "--workers", "0"], "0 is not in the range"),
        (["check", "a", "b"], "unexpected extra argument"),
        (["effects", "leakge"], "Did you mean 'leakage'?"),
        (["figures", "out", "--logs", "x"], "add --paper, or leave them out."),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_is_mistyped_is_told_in_one_line_with_the_nearest(words, said):
    done = command(*words)
    assert done.returncode == 2 and done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("rivid: ") and said in line


@pytest.mark.parametrize("name", COMMANDS)
def test_a_mistyped_option_suggests_the_nearest(rivid, name):
    done = rivid(name, "--hepl")
    assert done.code == 2 and "--help" in done.exception.format_message()


@pytest.mark.parametrize("words", [("effects",), ("run", "--help"), ()])
def test_a_reader_that_goes_away_ends_it_silently(words):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*REAL, *words], stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert done.stderr == "" and done.returncode in (1, 2)


@pytest.mark.parametrize(
    ("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "ended by SIGTERM")]
)
def test_an_interrupted_run_says_one_line(tmp_path, number, word):
    write_days(tmp_path / "logs", 40)
    words = [
        "run",
        tmp_path / "logs",
        "--out",
        tmp_path / "out",
        "--estimator",
        "posterior",
        "--workers",
        "1",
    ]
    child = subprocess.Popen(
        [*REAL, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    while not (tmp_path / "out" / ".rivid").exists():
        time.sleep(0.005)
        assert child.poll() is None
    child.send_signal(number)
    said = child.communicate(timeout=20)[1]
    assert child.returncode == 128 + number
    assert said.startswith(f"rivid: {word}: ") and said.count("\n") == 1


def test_another_command_that_is_interrupted_promises_nothing(tmp_path):
    scenario = ROOT / "configs" / "scenarios" / "cascade.toml"
    child = subprocess.Popen(
        [*REAL, "simulate", str(scenario), "--out", str(tmp_path / "logs")], stderr=subprocess.PIPE, text=True
    )
    time.sleep(0.4)
    assert child.poll() is None
    child.send_signal(signal.SIGINT)
    assert child.communicate(timeout=20)[1] == "rivid: interrupted\n"
    assert child.returncode == 130


def test_a_diagnosis_of_days_that_are_not_there_says_which_are(rivid):
    logs = ROOT / "sample_data" / "basse_isere_csv"
    done = rivid("diagnose", logs, "--from", "2020-01-01", "--quiet")
    assert done.code == 10
    said = f"no day from 2020-01-01 to the last: {logs} has them from 2008-03-10 to 2008-03-16"
    assert str(done.exception) == said


def test_a_diagnosis_of_days_that_fail_says_why(rivid, tmp_path):
    write_days(tmp_path, 1)
    (path,) = tmp_path.glob("*.csv")
    path.write_text("\n".join(path.read_text().splitlines()[:300]))
    done = rivid("diagnose", tmp_path, "--quiet")
    assert done.code == 10
    assert "none of 1 days or files can be used; the first, 2008-03-10: gap of" in str(done.exception)


def test_an_error_on_a_terminal_is_red_and_elsewhere_plain():
    plain = command("run", "nowhere")
    assert plain.stderr == "rivid: nowhere does not exist: expected a directory of logs\n"
    ours, theirs = os.openpty()
    env = {k: v for k, v in os.environ.items() if k != "NO_COLOR"} | {"TERM": "xterm"}
    subprocess.run([*REAL, "run", "nowhere"], stderr=theirs, env=env)
    assert os.read(ours, 1000).startswith(b"\x1b[31mrivid:\x1b[0m nowhere")
    subprocess.run([*REAL, "run", "nowhere"], stderr=theirs, env=env | {"NO_COLOR": "1"})
    assert os.read(ours, 1000).startswith(b"rivid: nowhere")
    os.close(ours)
    os.close(theirs)
