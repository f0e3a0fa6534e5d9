"""rivid.toml, found from DATA_DIR upward; and OUT from it."""

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

MINE = "[reach]\nname = 'mine'\nlength = 8200\nwidth = 81.6\ndepth = 4.9\n"


@pytest.fixture(scope="module")
def days(tmp_path_factory):
    folder = tmp_path_factory.mktemp("days") / "logs"
    write_days(folder, 2)
    return folder


@pytest.fixture
def logs(days, tmp_path, monkeypatch):
    """DATA_DIR two directories below the current one, which is the home."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(days, tmp_path / "reach" / "logs"))


def put(folder, text=MINE):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "rivid.toml"
    path.write_text(text, encoding="utf-8")
    return path


def name_in(out):
    return set(pq.read_table(out / "delays.parquet")["reach"].to_pylist())


@pytest.mark.parametrize("up", [0, 1, 2])
def test_it_is_found_in_the_logs_or_above_them_and_named_on_stderr(logs, rivid, up):
    path = put([logs, *logs.parents][up])
    done = rivid("run", logs, "--no-figures")
    assert done.code == 0 and done.stderr.splitlines() == [f"rivid: configuration: {path}"]
    assert done.stdout.startswith("mine: 2 data sets")
    assert name_in(Path("out")) == {"mine"}


def test_the_nearest_counts_whole(logs, rivid):
    put(logs.parent, "[reach]\nname = 'far'\n[run]\nestimators = ['ml']\n")
    put(logs, "[reach]\nname = 'near'\n")
    assert rivid("run", logs, "--no-figures").code == 0
    table = pq.read_table("out/delays.parquet")
    assert set(table["reach"].to_pylist()) == {"near"} and set(table["estimator"].to_pylist()) == {"jmap"}


def test_config_wins_and_nothing_is_said_then(logs, rivid, tmp_path):
    put(logs, "not = 'read'\n")
    given = put(tmp_path / "elsewhere")
    done = rivid("run", logs, "--no-figures", "--config", given)
    assert done.code == 0 and done.stderr == "" and name_in(Path("out")) == {"mine"}


def test_quiet_says_nothing_of_it(logs, rivid):
    put(logs)
    done = rivid("run", logs, "--no-figures", "--quiet")
    assert done.code == 0 and done.output == "" and name_in(Path("out")) == {"mine"}


@pytest.mark.parametrize("command", ["run", "check", "diagnose", "bounds"])
def test_every_command_that_takes_a_configuration_finds_it(logs, rivid, command):
    path = put(logs.parent, "[reach]\nlenght = 3\n")
    done = rivid(command, logs)
    assert done.code == 2
    assert str(done.exception).startswith(f"{path}: unknown key reach.lenght; valid keys here: ")
    assert str(done.exception).endswith("; did you mean length?")


def test_bounds_looks_from_the_current_directory(logs, rivid, monkeypatch):
    put(logs.parent, MINE.replace("mine", "here"))
    monkeypatch.chdir(logs)
    assert rivid("bounds").stdout.startswith("here: 8200 m long")


def test_a_log_itself_is_looked_beside(logs):
    path = put(logs)
    assert locate.find(logs / "2008-03-10.csv") == path


def test_links_are_followed_before_one_looks_upward(logs, tmp_path):
    path = put(logs.parent)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "link").symlink_to(logs)
    put(tmp_path / "other", "not = 'read'\n")
    assert locate.find(tmp_path / "other" / "link") == path


def test_nothing_above_the_home_directory_is_looked_at(logs, tmp_path, monkeypatch):
    path = put(tmp_path)
    assert locate.find(logs) == path
    monkeypatch.setenv("HOME", str(logs.parent))
    assert locate.find(logs) is None


def test_nothing_beyond_the_filesystem_is_looked_at(logs, tmp_path, monkeypatch):
    put(tmp_path)
    monkeypatch.setattr(locate, "_device", lambda folder: int(folder in (logs, logs.parent)))
    assert locate.find(logs) is None
    assert locate.find(tmp_path) is not None


def test_without_one_or_without_logs_the_defaults_are_taken(logs, rivid, tmp_path):
    assert locate.find(logs) is None and locate.find(tmp_path / "not" / "there") is None
    assert rivid("run", logs, "--no-figures").stdout.startswith("reach: 2 data sets")
    assert rivid("run", tmp_path / "not" / "there").code == 10


# Whose file it is


def facts(uid, mode=stat.S_IFREG | 0o644):
    return os.stat_result((mode, 0, 0, 1, uid, 0, 0, 0, 0, 0))


@pytest.mark.parametrize("uid", [0, os.geteuid()])
def test_mine_and_roots_are_taken(uid):
    locate._refuse_foreign(Path("rivid.toml"), [facts(uid), facts(uid)])


@pytest.mark.parametrize("which", [0, 1], ids=["the link", "what it leads to"])
def test_a_strangers_is_refused_with_what_to_do(which):
    both = [facts(os.geteuid()), facts(os.geteuid())]
    both[which] = facts(54321)
    with pytest.raises(ConfigError, match=r"rivid.toml belongs to user 54321, not to .* --config rivid.toml"):
        locate._refuse_foreign(Path("rivid.toml"), both)


def test_a_strangers_stops_a_run_before_anything_is_written(logs, rivid, monkeypatch):
    path = put(logs.parent, "[run]\nout = 'hostile'\n")
    if os.geteuid() == 0:
        os.chown(path, 54321, -1)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 54321)
    done = rivid("run", logs, "--quiet")
    assert done.code == 2 and "belongs to" in str(done.exception) and "\n" not in str(done.exception)
    assert not (logs.parent / "hostile").exists() and not Path("out").exists()
    assert rivid("run", logs, "--no-figures", "--config", path).code == 0  # asked for by name


def test_one_that_everybody_may_write_to_is_refused(logs, rivid):
    path = put(logs)
    path.chmod(0o666)
    done = rivid("check", logs)
    assert done.code == 2 and f"{path} is writable by everybody" in str(done.exception)
    path.chmod(0o664)
    assert rivid("check", logs).code == 0


# OUT


def test_cron_needs_no_options(logs, rivid, tmp_path, monkeypatch):
    put(logs.parent, MINE + "[run]\nout = 'results'\n")
    monkeypatch.chdir(tmp_path / "reach" / "logs")
    done = rivid("run", logs, "--quiet")
    assert done.code == 0 and done.output == ""
    assert (logs.parent / "results" / "report.html").is_file() and not Path("out").exists()


def test_out_counts_from_a_given_configuration_too_and_the_option_goes_over_it(logs, rivid, tmp_path):
    given = put(tmp_path / "elsewhere", "[run]\nout = '../results'\n")
    words = ("run", logs, "--no-figures", "--config", given)
    assert rivid(*words).code == 0 and (tmp_path / "results" / "delays.csv").is_file()
    assert rivid(*words, "--out", "mine").code == 0 and Path("mine", "delays.csv").is_file()


def test_what_is_done_stays_done_when_out_is_written_into_the_configuration(logs, rivid):
    put(logs)
    rivid("run", logs, "--no-figures", "--out", "results")
    put(logs, MINE + f"[run]\nout = '{Path('results').resolve()}'\n")
    done = rivid("run", logs, "--no-figures")
    assert "0 estimated now, 2 done before" in done.stdout
    assert "out" not in json.loads(Path("results/run.json").read_text())["config"]["run"]


def test_diagnose_goes_where_run_goes(logs, rivid):
    put(logs, MINE + "[run]\nout = 'results'\n")
    done = rivid("diagnose", logs, "--no-figures", "--quiet")
    assert done.code == 3 and done.output == ""
    assert (logs / "results" / "diagnosis.json").is_file()


def test_results_of_other_logs_are_not_replaced_unasked(logs, rivid, tmp_path):
    put(tmp_path, MINE + "[run]\nout = 'results'\n")
    others = Path(shutil.copytree(logs, tmp_path / "others"))
    assert rivid("run", others, "--no-figures").code == 0
    done = rivid("run", logs, "--no-figures")
    assert done.code == 2
    assert f"which holds results of {others}: those of {logs} would replace them" in str(done.exception)
    assert rivid("run", logs, "--no-figures", "--out", "results").code == 0  # asked for
    shutil.rmtree(logs)
    assert rivid("run", others, "--no-figures").code == 0  # those logs are gone


@pytest.mark.parametrize("value", ["''", "' '", '"a\\u0000b"', "3", "true", "['x']"])
def test_an_out_that_is_no_path_names_the_key(logs, rivid, value):
    path = put(logs, f"[run]\nout = {value}\n")
    done = rivid("run", logs)
    assert done.code == 2 and str(done.exception).startswith(f"{path}: run.out")
    assert not Path("out").exists()


def test_a_configuration_that_comes_through_a_pipe_is_read_once(logs, rivid):
    read, write = os.pipe()
    os.write(write, (MINE + "[run]\nout = 'elsewhere'\n").encode())
    os.close(write)
    assert rivid("run", logs, "--no-figures", "--config", f"/dev/fd/{read}").code == 0
    os.close(read)
    assert name_in(Path("out")) == {"mine"}


# Fleets


@pytest.fixture
def fleet(logs, tmp_path):
    for name in ("a", "b"):
        shutil.copytree(logs, tmp_path / "fleet" / name)
    return tmp_path / "fleet"


def test_one_file_above_a_fleet_serves_all_its_reaches(fleet, rivid, tmp_path):
    put(tmp_path, "[run]\nestimators = ['ml']\nout = 'results'\n")
    assert rivid("run", fleet, "--no-figures", "--quiet").code == 0
    for name in ("a", "b"):
        table = pq.read_table(tmp_path / "results" / name / "delays.parquet")
        assert set(table["reach"].to_pylist()) == {name}
        assert set(table["estimator"].to_pylist()) == {"ml"}
    assert (tmp_path / "results" / "fleet.html").is_file()


def test_a_reachs_own_file_goes_over_the_shared_one_key_by_key(fleet, rivid):
    put(fleet, "[run]\nestimators = ['ml']\n[jmap]\norder = 25\n")
    put(fleet / "b", "[jmap]\norder = 20\n")
    assert rivid("run", fleet, "--no-figures", "--out", "results").code == 0
    used = {n: json.loads(Path(f"results/{n}/run.json").read_text())["config"] for n in ("a", "b")}
    assert [used[n]["jmap"]["order"] for n in ("a", "b")] == [25, 20]
    assert used["b"]["run"]["estimators"] == ["ml"]


def test_own_files_are_not_looked_at_where_a_configuration_is_given(fleet, rivid, tmp_path):
    put(fleet / "b", "not = 'read'\n")
    given = put(tmp_path / "elsewhere")
    given.write_text("[run]\nestimators = ['ml']\n")
    assert rivid("run", fleet, "--no-figures", "--config", given).code == 0


def test_a_strangers_file_is_the_fault_of_its_reach_alone(fleet, rivid, monkeypatch):
    put(fleet / "b").chmod(0o666)
    done = rivid("run", fleet, "--no-figures", "--out", "results")
    assert done.code == 2 and "rivid: b: " in done.stderr and "is writable by everybody" in done.stderr
    assert name_in(Path("results/a")) == {"a"} and not Path("results/b/delays.csv").exists()


def test_one_reach_of_a_fleet_alone_does_not_go_among_the_fleets_results(fleet, rivid, tmp_path):
    put(fleet, f"[run]\nout = '{tmp_path / 'results'}'\n")
    assert rivid("run", fleet, "--no-figures").code == 0
    done = rivid("run", fleet / "a", "--no-figures")
    assert done.code == 2 and f"give --out {tmp_path / 'results' / 'a'}" in str(done.exception)


def test_defaults_of_a_directory_of_configurations_may_say_out(fleet, rivid, tmp_path):
    (tmp_path / "confs").mkdir()
    (tmp_path / "confs" / "defaults.toml").write_text("[run]\nout = '../results'\n")
    assert rivid("run", fleet, "--no-figures", "--config", tmp_path / "confs").code == 0
    assert (tmp_path / "results" / "a" / "delays.csv").is_file()


def test_an_ingest_may_leave_the_configuration_where_it_is_found(project, rivid, monkeypatch):
    monkeypatch.setenv("HOME", str(project))
    place = "tests/data/exports/historian"
    words = ("ingest", f"{place}/historian.csv", "--config", f"{place}/config.toml", "--out", "logs")
    assert rivid(*words, "--run-config", "logs/rivid.toml", "--quiet").code == 0
    done = rivid("run", "logs", "--no-figures")
    assert done.code == 0 and f"configuration: {project / 'logs' / 'rivid.toml'}" in done.stderr


def test_a_given_configuration_is_not_looked_for(tmp_path):
    assert locate.configuration(Path("x.toml"), tmp_path, Console()) == Path("x.toml")
