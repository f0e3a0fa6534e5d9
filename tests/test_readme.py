"""Test that every command of the README runs, in order, in an empty directory."""

import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.run.test_run import command as forked

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
LONG = re.compile(r"rivid (simulate|diagnose|forecast)|sample_data |basse_isere |\b(probable|year|fleet)\b")
"""Commands that only the test marked long runs: simulations, years, the diagnosis and the fleet."""


def commands():
    """Return the commands of the indented blocks, without their comments."""
    for line in README.splitlines():
        if line.startswith("    ") and re.match(r"(rivid|make|\d+ \d+ \* \* \*) ", line.strip()):
            yield line.split("  #")[0].strip()


def block(language, holding):
    """Return the fenced block that contains a text."""
    (found,) = [b for b in re.findall(rf"```{language}\n(.*?)```", README, re.S) if holding in b]
    return found


@pytest.fixture
def place(tmp_path):
    """Return a directory with the data and the configurations of a clone."""
    for name in ("sample_data", "configs"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def run(line, place):
    """Run a command in a directory, with its redirection."""
    command, _, file = line.rpartition(">") if ">" in line else (line, "", "")
    words = shlex.split(command.rstrip(">"))
    if "dask" in words:  # a fork of a process that has used Dask has its locks, but not its threads
        done = subprocess.run(
            [sys.executable, "-m", "rivid", *words[1:]], cwd=place, capture_output=True, text=True
        )
    else:
        done = forked(*words[1:], cwd=place)
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    if file:
        with open(place / file.strip(), "a" if ">>" in line else "w", encoding="utf-8") as target:
            target.write(done.stdout)
    if line.startswith("rivid sniff"):  # the reader completes the proposal
        settings = place / file.strip()
        proposed = settings.read_text(encoding="utf-8")
        assert proposed.count("[reach]") == 1
        reach = block("toml", "[reach]") + "\n"
        keys = re.findall(r"^#? ?(\w+) = ", proposed[: proposed.index("[input]")], re.M)
        assert sorted(keys) == sorted(tomllib.loads(reach)["reach"])  # it is the one table, filled in
        settings.write_text(re.sub(r"\[reach\]\n.*?\n\n", lambda _: reach, proposed, flags=re.S), "utf-8")
    return done


def test_the_short_commands_run_in_their_order(place, monkeypatch):
    ran = [line for line in commands() if line.startswith("rivid ") and not LONG.search(line)]
    assert len(ran) == 8
    for line in ran:
        run(line, place)
    assert "station-4711" in (place / "results/report.html").read_text(encoding="utf-8")

    monkeypatch.chdir(place)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names = {}
    exec(block("python", "rivid.read_day"), names)
    assert len(names["frame"]) == 28  # of jmap and of posterior

    # the morning run of the README: rivid.toml above the logs, and only the option --quiet
    (place / "data").mkdir()
    shutil.move(place / "logs", place / "data" / "logs")
    settings = (place / "logs_run.toml").read_text(encoding="utf-8")
    (place / "data" / "rivid.toml").write_text(settings + "\n" + block("toml", "[run]"), encoding="utf-8")
    (line,) = [line for line in commands() if line[0].isdigit()]
    assert " -" not in line.replace(" --quiet", "")
    done = run(line.split(".venv/bin/")[1].replace("/data/", "data/"), place)
    assert done.stdout == done.stderr == "" and (place / "data" / "results" / "delays.csv").exists()


@pytest.mark.long
def test_every_command_runs_in_its_order_and_the_hidden_bypass_is_found(place, rendered):
    printed = {line: run(line, place).stdout for line in commands() if line.startswith("rivid ")}
    assert len(printed) >= 18
    found = json.loads((place / "bypass/diagnosis.json").read_text(encoding="utf-8"))
    assert found["effects"][0]["name"] == "unlogged_upstream_release"
    for name in (
        "bypass/diagnosis.html",
        "year/paper/index.html",
        "fleet/fleet.html",
        "year/delay_law.csv",
        "law/delay_by_discharge.csv",
        "next/forecast.html",
    ):
        assert (place / name).exists(), name


def test_every_target_of_make_exists():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"\bmake ([a-z][a-z-]+)", README))
    assert {"run", "test", "figures", "glen-canyon", "docs"} <= named
    for target in named - {"it"}:
        assert re.search(rf"^{target}:", makefile, re.M), target


def test_the_commands_of_make_are_those_of_the_readme():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "rivid run sample_data/basse_isere --config configs/basse_isere.toml" in makefile
    assert re.search(r"^figures: run .*\n\t.*rivid figures .*--paper$", makefile, re.M)


def test_it_is_short():
    assert len(README.splitlines()) <= 150
