"""Test the search for rivid.toml from DATA_DIR upward, and the default of OUT."""

import json
import os
import shutil
import stat
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from rivid.cli import locate
from rivid.cli.console import Console
from rivid.errors import ConfigError
from tests.daily import write_days

MINE = "[reach]\nname = 'mine'\nsample_time = 133\nlength = 8200\nwidth = 81.6\ndepth = 4.9\n"


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    folder = tmp_path_factory.mktemp("days") / "logs"
    write_days(folder, 2)
    return folder


@pytest.fixture
def logs(days, tmp_path, monkeypatch):
    """Return DATA_DIR, two directories below the current one, which is the home directory."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(days, tmp_path / "reach" / "logs"))


@pytest.fixture
def fleet(logs, tmp_path):
    for name in ("a", "b"):
        shutil.copytree(logs, tmp_path / "fleet" / name)
    return tmp_path / "fleet"


def put(folder, text=MINE):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "rivid.toml"
    path.write_text(text, encoding="utf-8")
    return path


def column(out, name):
    return set(pq.read_table(out / "delays.parquet")[name].to_pylist())


def test_the_default_out_does_not_replace_results_of_other_logs(logs, tmp_path, rivid):
    other = shutil.copytree(logs, tmp_path / "other" / "logs")
    assert rivid("run", logs, "--no-figures").code == 0
    done = rivid("run", other, "--no-figures")
    assert done.code == 2 and f"the default OUT, out, holds results of {logs}" in str(done.exception)
    assert rivid("run", logs, "--no-figures").code == 0
    assert rivid("run", other, "--no-figures", "--out", "mine").code == 0


def test_the_nearest_applies_as_a_whole_and_is_named_on_stderr(logs, rivid):
    put(logs.parent, "[reach]\nname = 'far'\n[run]\nestimators = ['ml']\n")
    path = put(logs, MINE.replace("mine", "near"))
    done = rivid("run", logs, "--no-figures")
    assert done.code == 0 and str(path) in done.stderr and len(done.stderr.splitlines()) == 1
    assert column(Path("out"), "reach") == {"near"} and column(Path("out"), "estimator") == {
        "jmap",
        "posterior",
    }


def test_every_command_that_takes_a_configuration_finds_it(logs, rivid, monkeypatch):
    path = put(logs.parent, "[reach]\nlenght = 3\n")
    for command in ("run", "check", "diagnose", "bounds"):
        done = rivid(command, logs)
        assert done.code == 2 and f"{path}: unknown key reach.lenght" in str(done.exception)
    put(logs.parent, MINE.replace("mine", "here"))
    monkeypatch.chdir(logs)
    assert rivid("bounds").stdout.startswith("here: 8200 m long")


def test_the_search_resolves_links_and_ends_at_the_home_directory_and_at_the_filesystem(
    logs, tmp_path, monkeypatch, capsys
):
    path = put(tmp_path)
    put(tmp_path / "other", "not = 'read'\n")
    (tmp_path / "other" / "link").symlink_to(logs)
    for data_dir in (logs, logs / "2008-03-10.csv", tmp_path / "other" / "link"):
        assert locate.find(data_dir) == path
    given = tmp_path / "x.toml"
    assert locate.configuration(given, logs, Console()) == given
    assert locate.configuration(None, logs, Console(quiet=True)) == path and capsys.readouterr().err == ""
    with monkeypatch.context() as patch:
        patch.setattr(locate, "_device", lambda folder: int(folder in (logs, logs.parent)))
        assert locate.find(logs) is None and locate.find(tmp_path) == path
    monkeypatch.setenv("HOME", str(logs.parent))
    assert locate.find(logs) is None and locate.find(tmp_path / "not" / "there") is None


# Ownership


def facts(uid, mode=stat.S_IFREG | 0o644):
    return os.stat_result((mode, 0, 0, 1, uid, 0, 0, 0, 0, 0))


def test_a_file_of_another_user_or_that_everybody_can_write_to_is_refused():
    path, mine = Path("rivid.toml"), facts(os.geteuid())
    locate._refuse_foreign(path, [mine, facts(0)])
    locate._refuse_foreign(path, [facts(os.geteuid(), stat.S_IFREG | 0o664)])
    for both in ([facts(54321), mine], [mine, facts(54321)]):
        with pytest.raises(ConfigError, match=r"belongs to user 54321, .* --config rivid.toml"):
            locate._refuse_foreign(path, both)
    with pytest.raises(ConfigError, match="writable by everybody"):
        locate._refuse_foreign(path, [facts(os.geteuid(), stat.S_IFREG | 0o666)])


def test_a_foreign_file_stops_a_run_before_anything_is_written(logs, rivid, monkeypatch):
    path = put(logs.parent, "[run]\nout = 'hostile'\n")
    if os.geteuid() == 0:
        os.chown(path, 54321, -1)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 54321)
    done = rivid("run", logs, "--quiet")
    assert done.code == 2 and "belongs to" in str(done.exception) and "\n" not in str(done.exception)
    assert not (logs.parent / "hostile").exists() and not Path("out").exists()
    assert rivid("run", logs, "--no-figures", "--config", path).code == 0  # named by the user


# OUT


def test_cron_needs_no_options_and_out_is_no_part_of_the_configuration(logs, rivid, monkeypatch):
    path = put(logs.parent, MINE + "[run]\nout = 'results'\n")
    monkeypatch.chdir(logs)
    done = rivid("run", logs, "--quiet")
    assert (done.code, done.output) == (0, "")
    assert (logs.parent / "results" / "report.html").is_file() and not Path("out").exists()
    path.write_text(MINE + f"[run]\nout = '{logs.parent / 'results'}'\n")
    summary = json.loads(rivid("run", logs, "--no-figures", "--json").stdout.splitlines()[-1])["summary"]
    assert (summary["computed"], summary["reused"]) == (0, 2)


def test_out_is_relative_to_the_configuration_and_the_option_wins(logs, tmp_path):
    given = put(tmp_path / "elsewhere", "[run]\nout = '../results'\n")
    assert locate.results(None, given, logs).resolve() == tmp_path / "results"
    assert locate.results(Path("mine"), given, logs) == Path("mine")
    assert locate.results(None, None, logs) == locate.results(None, put(logs), logs) == Path("out")
    (tmp_path / "elsewhere" / "defaults.toml").write_text("[run]\nout = '../fleet'\n")
    assert locate.results(None, tmp_path / "elsewhere", logs).resolve() == tmp_path / "fleet"


def test_results_of_other_logs_are_replaced_only_by_the_option(logs, rivid, tmp_path):
    put(tmp_path, MINE + "[run]\nout = 'results'\n")
    others = Path(shutil.copytree(logs, tmp_path / "others"))
    assert rivid("run", others, "--no-figures").code == 0
    done = rivid("run", logs, "--no-figures")
    assert done.code == 2 and f"holds results of {others}" in str(done.exception)
    assert rivid("run", logs, "--no-figures", "--out", "results").code == 0
    shutil.rmtree(logs)
    assert rivid("run", others, "--no-figures").code == 0


def test_an_invalid_out_names_the_key(logs, rivid):
    for value in ("' '", '"a\\u0000b"', "3"):
        path = put(logs, f"[run]\nout = {value}\n")
        done = rivid("run", logs)
        assert done.code == 2 and str(done.exception).startswith(f"{path}: run.out")
        assert not Path("out").exists()


def test_a_configuration_from_a_pipe_is_read_once(logs, rivid):
    read, write = os.pipe()
    os.write(write, (MINE + "[run]\nout = 'elsewhere'\n").encode())
    os.close(write)
    assert rivid("run", logs, "--no-figures", "--config", f"/dev/fd/{read}").code == 0
    os.close(read)
    assert column(Path("out"), "reach") == {"mine"}


# Fleets


def test_a_file_above_a_fleet_applies_to_all_and_that_of_a_reach_overrides_keys(fleet, rivid, tmp_path):
    put(tmp_path, "[run]\nestimators = ['ml']\nout = 'results'\n[jmap]\norder = 25\n")
    put(fleet / "b", "[jmap]\norder = 20\n")
    assert rivid("run", fleet, "--no-figures", "--quiet").code == 0
    for name, order in (("a", 25), ("b", 20)):
        out = tmp_path / "results" / name
        assert column(out, "reach") == {name} and column(out, "estimator") == {"ml"}
        assert json.loads((out / "run.json").read_text())["config"]["jmap"]["order"] == order
    assert (tmp_path / "results" / "fleet.html").is_file()


def test_a_foreign_file_stops_only_its_reach_and_is_ignored_if_a_configuration_is_given(
    fleet, rivid, tmp_path
):
    put(fleet / "b", "not = 'read'\n").chmod(0o666)
    given = put(tmp_path / "elsewhere", "[run]\nestimators = ['ml']\n")
    assert rivid("run", fleet, "--no-figures", "--config", given, "--out", "given").code == 0
    done = rivid("run", fleet, "--no-figures", "--out", "results")
    assert done.code == 2 and "rivid: b: " in done.stderr and "writable by everybody" in done.stderr
    assert column(Path("results/a"), "reach") == {"a"} and not Path("results/b/delays.csv").exists()


def test_one_reach_of_a_fleet_does_not_overwrite_the_results_of_the_fleet(fleet, rivid, tmp_path):
    put(fleet, f"[run]\nout = '{tmp_path / 'results'}'\n")
    assert rivid("run", fleet, "--no-figures").code == 0
    done = rivid("run", fleet / "a", "--no-figures")
    assert done.code == 2 and f"--out {tmp_path / 'results' / 'a'}" in str(done.exception)


def test_the_configuration_written_by_ingest_is_found_by_run(project, rivid, monkeypatch):
    monkeypatch.setenv("HOME", str(project))
    place = "tests/data/exports/historian"
    words = ("ingest", f"{place}/historian.csv", "--config", f"{place}/config.toml", "--out", "logs")
    assert rivid(*words, "--run-config", "logs/rivid.toml", "--quiet").code == 0
    done = rivid("run", "logs", "--no-figures")
    assert done.code == 0 and str(project / "logs" / "rivid.toml") in done.stderr
