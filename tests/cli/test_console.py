"""Test terminal output: eighty columns, colour on terminals only, less with --quiet, more with --verbose."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from rivid import __version__
from rivid.cli import fleet
from rivid.cli.console import Console, abbreviate, files_in, wrap
from tests.cli.conftest import ROOT
from tests.daily import write_days

LONG = "the-very-long-name-of-a-reach-between-two-dams-that-nobody-would-write-by-hand-x"
ANSI = "\x1b["


@pytest.fixture
def logs(tmp_path):
    write_days(tmp_path / "logs", 2)
    return tmp_path / "logs"


@pytest.fixture
def settings(tmp_path):
    path = tmp_path / "long.toml"
    path.write_text(f"[reach]\nname = '{LONG}'\n", encoding="utf-8")
    return path


def wide(text):
    return [line for line in text.splitlines() if len(line) > 80]


def test_runs_with_long_names_fit_eighty_columns(rivid, settings, logs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = ("jmap", "jmap-uniform-estimated", "cusum-map", "direct", "posterior")
    chosen = [word for name in names for word in ("--estimator", name)]
    done = rivid("run", "logs", "--config", settings, *chosen, "--no-figures")
    assert done.code == 0 and "2 data sets" in done.stdout and not wide(done.output)
    for words in (("season", "out"), ("bounds", "--config", settings), ("check", logs, "--config", settings)):
        done = rivid(*words)
        assert done.stdout and not wide(done.stdout), words


def test_failed_days_fit_eighty_columns_and_are_printed_once_with_quiet(rivid, settings, logs, tmp_path):
    day = logs / "2008-03-11.csv"
    day.write_text("\n".join(day.read_text().splitlines()[:200]) + "\n")
    words = ("run", logs, "--config", settings, "--out", tmp_path / "out", "--no-figures", "--quiet")
    done = rivid(*words)
    assert done.code == 3 and "2008-03-11 failed: " in done.stderr and not wide(done.output)
    assert done.stdout == ""
    done = rivid(*words)
    assert (done.code, done.output) == (0, "")  # a known failure
    done = rivid("check", logs, "--quiet")
    assert done.code == 3 and "2008-03-11" in done.output


def test_the_first_run_points_to_check_and_flows_that_are_too_fast_are_named(rivid, logs, tmp_path):
    narrow = tmp_path / "narrow.toml"
    narrow.write_text("[reach]\nlength = 8200\nwidth = 1\ndepth = 4.9\n")
    words = ("run", logs, "--config", narrow, "--out", tmp_path / "out", "--no-figures")
    first, second = rivid(*words).stdout, rivid(*words, "--force").stdout
    assert "hint: `rivid check`" in first and "hint:" not in second and " 0 done before" in second
    assert re.search(
        r"on (\d+) of \1\sdays?\sthe mean inflow, \d+ m3/s, is too fast", " ".join(first.split())
    )


def test_the_summary_of_a_fleet_fits_eighty_columns(capsys):
    names = [f"{LONG[:77]}{i:03d}" for i in range(300)]
    found = {"failing": names, "left_band": names[:1], "unanswered": [], "silent": [], "changed": []}
    found |= {"untested": names, "doubtful": names}
    found |= {"reaches": 300, "data_sets": 9, "before": {"made": "2024-05-01T06:00:00+00:00"}}
    fleet.print_summary(found, 3, Path("out"))
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80 and lines[1].startswith("  300 failing: the-very-long")


def test_the_proposal_of_sniff_fits_eighty_columns(rivid):
    paths = [p for p in (ROOT / "tests/data/exports").glob("*/*.csv") if p.name != "expected.csv"][:4]
    assert len(paths) == 4
    for path in paths:
        proposed = rivid("sniff", path).stdout
        assert not wide(proposed) and tomllib.loads(proposed)


def test_wrap_does_not_split_a_path_and_abbreviate_cuts_the_middle():
    path = "/srv/" + "long/" * 30 + "report.html"
    assert path in wrap(f"report: {path}").split()
    assert max(map(len, wrap("a few words " * 30, 2, 4).splitlines())) <= 80
    assert (len(abbreviate(LONG)), abbreviate(LONG)[:8], abbreviate(LONG)[-6:]) == (40, "the-very", "hand-x")
    assert abbreviate("short") == "short"


# Quiet and verbose


def test_quiet_prints_nothing_if_all_is_well(rivid, logs, tmp_path):
    out, scenario = tmp_path / "out", tmp_path / "short.toml"
    scenario.write_text("days = 3\n")
    for words in (
        ("check", logs),
        ("run", logs, "--out", out, "--estimator", "posterior", "--no-figures"),
        ("figures", out),
        ("simulate", scenario, "--out", tmp_path / "made"),
    ):
        done = rivid(*words, "--quiet")
        assert (done.code, done.output) == (0, ""), words


def test_verbose_adds_files_versions_and_times_on_stderr(rivid, logs, tmp_path):
    plain = rivid("run", logs, "--out", tmp_path / "a", "--no-figures")
    full = rivid("run", logs, "--out", tmp_path / "b", "--no-figures", "--verbose")
    strip = re.compile(r"\([\d.]+ s\)|/[ab]/")
    assert strip.sub("", full.stdout) == strip.sub("", plain.stdout)
    for text in (f"rivid {__version__}, Python 3.", "numpy ", str(logs), "2 files, ", str(tmp_path / "b")):
        assert text in full.stderr and text not in plain.stderr
    phases = re.findall(r"^ +\d+\.\d\d s  (.+)$", full.stderr, re.M)
    assert len(phases) >= 4 and phases[0] == "starting" and "estimating 2 data sets" in phases


def test_steps_are_printed_as_they_begin_or_timed_as_they_end(capsys, monkeypatch):
    now = 100.0
    monkeypatch.setattr("rivid.cli.console.time.perf_counter", lambda: now)
    for options, printed in (
        ({}, "one\ntwo\n"),
        ({"verbose": True}, "    2.50 s  starting\n    0.50 s  one\n    1.00 s  two\n"),
        ({"quiet": True}, ""),
    ):
        with Console(**options).steps() as step:
            now += 2.5
            step("one")
            now += 0.5
            step("two")
            now += 1.0
        assert capsys.readouterr().err == printed


@pytest.mark.parametrize("terminal", [False, True])
def test_a_step_is_shown_with_the_time_since_the_first_and_no_time_left(terminal, capsys, monkeypatch):
    now = 100.0
    monkeypatch.setattr("rivid.cli.console.time.perf_counter", lambda: now)
    monkeypatch.setattr("sys.stderr.isatty", lambda: terminal)
    with Console().steps() as step:
        for k, past in enumerate((2.0, 12.0, 91.0, 510.0)):
            now = 100.0 + past
            step(f"round {k} of 4 at most: refitting {'a very long name ' * (9 if k == 3 else 0)}")
    shown = [
        line.strip() for line in capsys.readouterr().err.replace("\r", "\n").splitlines() if line.strip()
    ]
    assert [line.rpartition(", ")[2] for line in shown] == [
        "round 0 of 4 at most: refitting", "12 s so far", "91 s so far", "8 min so far",
    ]  # fmt: skip
    assert not terminal or max(map(len, shown)) <= 78


def test_files_are_counted_with_the_first_and_the_last(tmp_path):
    assert files_in(tmp_path) == "no files"
    (tmp_path / "a.csv").write_bytes(b"x" * 100_000)
    assert files_in(tmp_path) == "1 file, 0.1 MB: a.csv"
    (tmp_path / "b.csv").write_bytes(b"x" * 100_000)
    assert files_in(tmp_path) == "2 files, 0.2 MB: a.csv to b.csv"
    assert "No such file" in files_in(tmp_path / "none")


def test_colour_is_for_terminals_without_no_color(rivid, logs, tmp_path, monkeypatch):
    words = ("run", logs, "--out", tmp_path / "out", "--no-figures")
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    assert ANSI not in rivid(*words).output  # not a terminal
    assert ANSI in rivid(*words, color=True).output  # as on a terminal
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        with monkeypatch.context() as patch:
            patch.setenv(name, value)
            assert ANSI not in rivid(*words, color=True).output


# Warnings of a run


def test_a_run_in_which_every_day_fails_returns_3_each_time(rivid, tmp_path):
    days = write_days(tmp_path / "data", 5)
    (tmp_path / "rivid.toml").write_text("[reach]\nsample_time = 13\n")
    words = ("run", tmp_path / "data", "--out", tmp_path / "out", "--quiet", "--no-figures")
    first = rivid(*words)
    assert first.code == 3 and f"{days[0]} to {days[-1]} (5 days)" in first.stderr
    assert rivid(*words).code == 3


def test_removed_estimators_and_settings_for_another_sample_time_are_named(rivid, logs, tmp_path):
    words = ("run", logs, "--out", tmp_path / "out", "--no-figures")
    note = "rivid: no configuration: [reach] is taken from Table I\n"
    assert rivid(*words, "--estimator", "ml", "--estimator", "jmap").stderr == note
    assert re.search(r"\bml\b", rivid(*words, "--estimator", "jmap").stderr)
    assert rivid(*words, "--estimator", "jmap").stderr == note
    reach = "[reach]\nlength = 9000\nwidth = 70\ndepth = 4\nsample_time = {}\n"
    for k, (sample_time, more, named) in enumerate(
        ((266, "", True), (266, "[jmap]\nsigma_d = 3\n", False), (133, "", False))
    ):
        (tmp_path / "rivid.toml").write_text(reach.format(sample_time) + more)
        done = rivid("run", logs, "--out", tmp_path / f"out{k}", "--no-figures")
        assert ("`rivid bounds`" in done.stderr.replace("\n", " ")) is named, done.stderr


def test_the_option_estimator_leaves_the_geometry_assumed(rivid, logs, tmp_path):
    """Once all keys of [reach] counted as configured: Table I put delays of other reaches in doubt."""
    for words in ((), ("--estimator", "jmap")):
        assert rivid("run", logs, "--out", tmp_path / "out", "--no-figures", *words).code == 0
        record = json.loads((tmp_path / "out" / "run.json").read_text())
        assert record["assumed"] == ["length", "width", "depth"], words


def test_a_list_of_estimators_is_answered_with_the_repeated_option(rivid, logs):
    done = rivid("run", logs, "--estimator", "jmap,posterior")
    assert "--estimator jmap --estimator posterior" in str(done.exception.message)
