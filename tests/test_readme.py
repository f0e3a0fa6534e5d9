"""Every command of the README runs, in order, in an empty directory."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
SLOW = ("rivid diagnose",)
"""Commands that are run by a test marked long."""


def commands():
    """The commands of the indented blocks, without their comments."""
    for line in README.splitlines():
        if line.startswith("    ") and re.match(r"(rivid|make|\d+ \d+ \* \* \*) ", line.strip()):
            yield line.split("  #")[0].strip()


def block(language, holding):
    """The fenced block that holds a text."""
    (found,) = [b for b in re.findall(rf"```{language}\n(.*?)```", README, re.S) if holding in b]
    return found


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A directory with the data and the configurations of a clone."""
    place = tmp_path_factory.mktemp("reader")
    for name in ("sample_data", "configs"):
        shutil.copytree(ROOT / name, place / name)
    return place


def run(line, place):
    words = [sys.executable, "-m", *shlex.split(line.split(">")[0])]
    mode = "a" if ">>" in line else "w"
    done = subprocess.run(words, cwd=place, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    if ">" in line:
        with open(place / line.split(">")[-1].strip(), mode, encoding="utf-8") as file:
            file.write(done.stdout)
    return done


def test_every_command_runs_in_its_order(place):
    ran = [line for line in commands() if line.startswith("rivid ") and not line.startswith(SLOW)]
    for line in ran:
        run(line, place)
        if line.startswith("rivid sniff"):
            settings_file = place / "reach.toml"
            proposed = settings_file.read_text(encoding="utf-8")
            settings_file.write_text(
                re.sub(
                    r"\[reach\]\n.*?\n\n", lambda _: block("toml", "[reach]") + "\n", proposed, flags=re.S
                ),
                encoding="utf-8",
            )
            assert proposed.count("[reach]") == 1 and "station-4711" in settings_file.read_text(
                encoding="utf-8"
            )
    assert len(ran) >= 18
    for name in (
        "results/report.html",
        "year/paper/index.html",
        "fleet/fleet.html",
        "probable/delay_law.csv",
    ):
        assert (place / name).exists(), name
    assert "station-4711" in (place / "results/report.html").read_text(encoding="utf-8")

    os.chdir(place)
    import matplotlib

    matplotlib.use("Agg")
    names = {"u": None}
    exec(block("python", "rivid.read_day"), names)
    assert len(names["frame"]) == 14

    morning = place / "data"
    morning.mkdir()
    shutil.move(place / "logs", morning / "logs")
    settings = (place / "logs_run.toml").read_text(encoding="utf-8")
    (morning / "rivid.toml").write_text(settings + "\n" + block("toml", "[run]"), encoding="utf-8")
    (line,) = [line for line in commands() if line[0].isdigit()]
    assert " -" not in line.replace(" --quiet", "")  # no option but --quiet
    done = run(line.split(".venv/bin/")[1].replace("/data/", "data/"), place)
    assert done.stdout == done.stderr == ""
    assert (morning / "results" / "delays.csv").exists()


@pytest.mark.long
def test_the_hidden_bypass_is_found(place):
    (line,) = [line for line in commands() if line.startswith(SLOW)]
    assert "unlogged_upstream_release" in run(line, place).stdout
    assert (place / "bypass" / "diagnosis.html").exists()


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
    assert len(README.splitlines()) < 300
