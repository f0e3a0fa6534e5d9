"""What commands say: eighty columns, colour on terminals only, less with --quiet, more with --verbose."""

import re
import tomllib
from pathlib import Path

import click
import pytest

from rivid.cli import fleet
from rivid.cli.console import Console, abbreviate, files_in, wrap
from tests.cli.conftest import ROOT
from tests.daily import text_of, write_days

YEAR = ROOT / "sample_data" / "basse_isere"
LONG = "the-very-long-name-of-a-reach-between-two-dams-that-nobody-would-write-by-hand-x"
ANSI = "\x1b["


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    path = tmp_path_factory.mktemp("settings") / "long.toml"
    path.write_text(f"[reach]\nname = '{LONG}'\n", encoding="utf-8")
    return path


@pytest.fixture
def logs(tmp_path):
    write_days(tmp_path / "logs", 2)
    return tmp_path / "logs"


def wide(text):
    return [line for line in text.splitlines() if len(line) > 80]


def test_a_year_of_a_reach_with_a_long_name_fits_eighty_columns(rivid, settings, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = ("jmap", "jmap-uniform-estimated", "cusum-map", "direct", "posterior")
    asked = [word for name in names for word in ("--estimator", name)]
    done = rivid("run", YEAR, "--config", settings, *asked, "--no-figures")
    assert done.code == 0 and "332 data sets" in done.stdout and not wide(done.output)
    done = rivid("season", "out")
    assert done.code == 0 and "posterior-season" in done.stdout and not wide(done.output)


def test_days_that_fail_are_told_within_eighty_columns(rivid, settings, logs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    day = logs / "2008-03-11.csv"
    day.write_text("\n".join(day.read_text().splitlines()[:200]) + "\n")
    done = rivid("run", logs, "--config", settings, "--no-figures")
    assert done.code == 3 and "2008-03-11 failed: " in done.stderr and not wide(done.output)


@pytest.mark.parametrize("name", ["bounds", "check"])
def test_what_bounds_and_check_print_fits_eighty_columns(rivid, settings, name):
    done = rivid(name, YEAR, "--config", settings)
    assert done.stdout and not wide(done.output)


def test_the_words_of_a_fleet_fit_eighty_columns(capsys):
    names = [f"{LONG[:77]}{i:03d}" for i in range(300)]
    told = {
        "reaches": 300,
        "data_sets": 9,
        "failing": names,
        "left_band": names[:1],
        "silent": [],
        "changed": [],
    }
    fleet.print_summary(told, 3, Path("out"))
    said = capsys.readouterr().out
    assert not wide(said) and said.splitlines()[1].startswith("  300 fail: the-very-long")


def test_what_sniff_proposes_fits_eighty_columns(rivid):
    paths = [p for p in (ROOT / "tests/data/exports").glob("*/*.csv") if p.name != "expected.csv"]
    assert len(paths) > 5
    for path in paths:
        proposed = rivid("sniff", path).stdout
        assert not wide(proposed) and tomllib.loads(proposed)


def test_wrapped_leaves_a_path_whole():
    path = "/srv/" + "long/" * 30 + "report.html"
    assert path in wrap(f"report: {path}").split()
    assert max(map(len, wrap("a few words " * 30, 2, 4).splitlines())) <= 80


def test_a_long_name_is_shortened_in_its_middle():
    assert (
        len(abbreviate(LONG)) == 40
        and abbreviate(LONG).startswith("the-very")
        and abbreviate(LONG).endswith("hand-x")
    )
    assert abbreviate("short") == "short"


# Quiet and verbose


def test_quiet_says_nothing_when_all_is_well(rivid, logs, tmp_path):
    out = tmp_path / "out"
    asked = ("--estimator", "posterior", "--no-figures")
    for words in (
        ("check", logs),
        ("run", logs, "--out", out, *asked),
        ("figures", out),
        ("simulate", ROOT / "configs" / "scenarios" / "basse_isere.toml", "--out", tmp_path / "made"),
    ):
        done = rivid(*words, "--quiet")
        assert (done.code, done.output) == (0, ""), words


def test_quiet_still_says_what_is_wrong(rivid, logs, tmp_path):
    (logs / "2008-03-12.csv").write_text(text_of(__import__("datetime").date(2008, 3, 11)))
    done = rivid("run", logs, "--out", tmp_path / "out", "--no-figures", "--quiet")
    assert done.code == 3 and done.stdout == "" and done.stderr.startswith("  2008-03-12 failed: ")
    done = rivid("run", logs, "--out", tmp_path / "out", "--no-figures", "--quiet")
    assert (done.code, done.output) == (0, "")  # it is known by now
    done = rivid("check", logs, "--quiet")
    assert done.code == 3 and "2008-03-12" in done.output


def test_verbose_tells_files_versions_and_time_and_leaves_stdout_alone(rivid, logs, tmp_path):
    plain = rivid("run", logs, "--out", tmp_path / "a", "--no-figures")
    full = rivid("run", logs, "--out", tmp_path / "b", "--no-figures", "--verbose")
    strip = re.compile(r"\([\d.]+ s\)|/[ab]/")
    assert strip.sub("", full.stdout) == strip.sub("", plain.stdout)
    assert plain.stderr == ""
    from rivid import __version__

    assert f"rivid {__version__}, Python 3." in full.stderr and "numpy " in full.stderr
    assert str(logs) in full.stderr and "2 files, " in full.stderr and str(tmp_path / "b") in full.stderr
    phases = re.findall(r"^ +\d+\.\d\d s  (.+)$", full.stderr, re.M)
    assert phases == [
        "starting", "finding what is new", "estimating 2 data sets",
        "bringing tables, figures and report up to date",
    ]  # fmt: skip


def test_times_of_phases_are_those_between_them(capsys, monkeypatch):
    clock = iter([10.0, 12.5, 13.0])
    monkeypatch.setattr("rivid.cli.console.time.perf_counter", lambda: next(clock))
    console = Console(verbose=True)
    console.phase("first")
    console.phase("second")
    assert capsys.readouterr().err == "    2.50 s  first\n    0.50 s  second\n"


def test_steps_are_named_as_they_come_or_timed_when_they_are_over(capsys):
    for console in (Console(), Console(verbose=True), Console(quiet=True)):
        with console.steps("starting") as step:
            step("one")
            step("two")
        said = capsys.readouterr().err
        timed = re.findall(r"s  (.+)$", said, re.M)
        expected = [] if console.quiet else ["starting", "one", "two"] if console.verbose else ["one", "two"]
        assert (timed if console.verbose else said.splitlines()) == expected


def test_files_are_counted_with_first_and_last(tmp_path):
    assert files_in(tmp_path) == "no files"
    (tmp_path / "a.csv").write_bytes(b"x" * 100_000)
    assert files_in(tmp_path) == "1 file, 0.1 MB: a.csv"
    (tmp_path / "b.csv").write_bytes(b"x" * 100_000)
    assert files_in(tmp_path) == "2 files, 0.2 MB: a.csv to b.csv"
    assert files_in(tmp_path / "none").startswith("cannot be read: No such file")


# Colour


def test_colour_is_for_terminals_and_for_those_who_want_it(rivid, logs, tmp_path, monkeypatch):
    words = ("run", logs, "--out", tmp_path / "out", "--no-figures")
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    assert ANSI not in rivid(*words).output  # no terminal
    assert ANSI in rivid(*words, color=True).output  # as on one
    monkeypatch.setenv("NO_COLOR", "1")
    assert ANSI not in rivid(*words, color=True).output
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "dumb")
    assert ANSI not in rivid(*words, color=True).output


def test_quiet_and_verbose_together_are_a_usage_error():
    with pytest.raises(click.UsageError):
        Console(quiet=True, verbose=True)


def test_where_every_day_fails_it_is_never_all_well(rivid, tmp_path):
    days = write_days(tmp_path / "data", 5)
    (tmp_path / "rivid.toml").write_text("[reach]\nsample_time = 13\n")
    first = rivid("run", tmp_path / "data", "--out", tmp_path / "out", "--quiet", "--no-figures")
    assert first.code == 3 and first.stderr.count(" failed: ") == 1
    assert f"{days[0]} to {days[-1]} (5 days) failed: " in first.stderr and "for one" in first.stderr
    again = rivid("run", tmp_path / "data", "--out", tmp_path / "out", "--quiet", "--no-figures")
    assert again.code == 3 and "every data set fails" in again.stderr


def test_estimators_that_are_not_asked_any_more_are_named(rivid, logs, tmp_path):
    words = ("run", logs, "--out", tmp_path / "out", "--no-figures")
    assert "leave the tables" not in rivid(*words, "--estimator", "ml", "--estimator", "jmap").stderr
    assert "leave the tables: ml" in rivid(*words, "--estimator", "jmap").stderr
    assert "leave the tables" not in rivid(*words, "--estimator", "jmap").stderr


def test_delays_in_samples_of_the_paper_are_told_for_a_reach_of_another_sample_time(rivid, tmp_path):
    write_days(tmp_path / "data", 3)
    reach = "[reach]\nlength = 9000\nwidth = 70\ndepth = 4\nsample_time = {}\n"
    for sample_time, more, told in ((266, "", True), (266, "[jmap]\nsigma_d = 3\n", False), (133, "", False)):
        (tmp_path / "rivid.toml").write_text(reach.format(sample_time) + more)
        done = rivid("run", tmp_path / "data", "--out", tmp_path / f"out{told}{more}", "--no-figures")
        assert ("rivid bounds` proposes those of this reach" in done.stderr.replace("\n", " ")) is told, (
            done.stderr
        )
