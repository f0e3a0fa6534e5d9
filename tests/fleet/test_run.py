"""Test a fleet end to end: one pool, one report, and reaches that do not affect each other."""

import csv
import datetime as dt
import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import nullcontext

import pytest

from rivid.fleet import run as fleet_run
from rivid.fleet.outcome import WORST_FIRST, Outcome, keep, kept, worst
from rivid.fleet.report import minute, write_fleet
from rivid.results.store import Store
from tests.daily import write_days
from tests.run.test_run import TABLES, bytes_of, rivid
from tests.run.test_workers import DEADLY

REACHES = ("alpha", "beta", "gamma")
MADE = re.compile(r" on [\d-]{10} [\d:]{5} UTC, from")
"""Creation time of a page, in its footer."""


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet") / "data"
    for seed, name in enumerate(REACHES):
        write_days(folder / name, 6, seed=seed)
    return folder


@pytest.fixture
def data(logs, tmp_path):
    return shutil.copytree(logs, tmp_path / "data")


def fleet_json(out):
    return json.loads((out / "fleet.json").read_text())


@pytest.fixture(scope="module")
def whole(logs, tmp_path_factory):
    """Return OUT of a run of the fleet without figures, and its output."""
    out = tmp_path_factory.mktemp("whole") / "out"
    code, output = rivid("run", logs, "--out", out, "--no-figures", "--workers", 2)
    assert code == 0
    return out, output


def test_each_reach_has_the_tables_it_would_have_alone(data, whole, tmp_path):
    out, output = whole
    assert "3 reaches, 18 data sets, 18 estimated now" in output and "changed" not in output
    config = tmp_path / "beta.toml"
    config.write_text("[reach]\nname = 'beta'\n")
    rivid("run", data / "beta", "--out", tmp_path / "beta", "--no-figures", "--config", config)
    assert bytes_of(out / "beta") == bytes_of(tmp_path / "beta")
    for name in REACHES:
        assert {p.name for p in (out / name).iterdir()} == {*TABLES, ".rivid", "run.json"}
    with open(out / "fleet.csv", encoding="utf-8", newline="") as file:
        found = [(row["reach"], row["data_sets"]) for row in csv.DictReader(file)]
    assert found == [(name, "6") for name in REACHES]


def test_the_page_leads_to_the_reports_of_the_reaches(data, tmp_path):
    out = tmp_path / "out"
    shutil.rmtree(data / "gamma")
    assert rivid("run", data, "--out", out)[0] == 0
    page = (out / "fleet.html").read_text()
    for name in REACHES[:2]:
        assert (out / name / "figures" / "tdr_jmap.png").exists()
        assert f'href="{name}/report.html"' in page


def test_shards_at_any_time_and_in_any_order_make_the_same_fleet(data, whole, tmp_path):
    parts = tmp_path / "parts"
    for part in ("2/2", "1/2"):
        code, output = rivid("run", data, "--out", parts, "--no-figures", "--shard", part)
        assert code == 0 and f"shard {part}" in output
    assert not (parts / "fleet.html").exists()
    code, output = rivid("fleet", parts)
    assert code == 0 and "estimated now" not in output
    for name in REACHES:
        assert bytes_of(parts / name) == bytes_of(whole[0] / name)
    for name in ("fleet.csv", "fleet.parquet"):
        assert (parts / name).read_bytes() == (whole[0] / name).read_bytes()


def test_a_reach_that_fails_leaves_the_others_and_the_worst_code_counts(data, tmp_path):
    out = tmp_path / "out"
    (data / "beta" / "2008-03-12.csv").write_text("time,u_Qi,u_Qo,h_L\n")
    assert rivid("run", data, "--out", out, "--no-figures")[0] == 3
    assert fleet_json(out)["failing"] == ["beta"]
    assert rivid("run", data, "--out", out, "--no-figures")[0] == 0, "it had failed before"
    assert rivid("run", data, "--out", out, "--no-figures", "--strict")[0] == 3
    shutil.rmtree(data / "gamma")
    write_days(data / "not a name", 1)
    code, _ = rivid("run", data, "--out", out, "--no-figures")
    assert code == 2
    assert fleet_json(out)["reaches"] == 3 and {o.reach for o in kept(out)} == {"alpha", "beta"}
    assert (out / "gamma" / "delays.csv").exists(), "results are never deleted"


def test_a_reach_held_by_another_run_has_code_11_and_the_others_are_run(data, tmp_path):
    out = tmp_path / "out"
    with Store(out / "beta"):
        assert rivid("run", data, "--out", out, "--no-figures", "--workers", 1)[0] == 11
    assert [o.code for o in kept(out)] == [0, 11, 0]
    with Store(out):
        assert rivid("run", data, "--out", out, "--no-figures")[0] == 11
        assert rivid("fleet", out)[0] == 11


def test_an_internal_error_in_one_reach_is_in_its_outcome(data, tmp_path, monkeypatch):
    def run(root, *rest):
        if root.name == "beta":
            raise ZeroDivisionError("of all things")
        return original(root, *rest)

    original = fleet_run.run
    monkeypatch.setattr(fleet_run, "run", run)
    assert rivid("run", data, "--out", tmp_path / "out", "--no-figures", "--workers", 1)[0] == 1
    assert [o.code for o in kept(tmp_path / "out")] == [0, 1, 0]
    assert "of all things" in kept(tmp_path / "out")[1].error


@pytest.mark.long
def test_the_day_that_kills_its_worker_is_alone_and_failed(data, tmp_path):
    (tmp_path / "site").mkdir()
    deadly = DEADLY.replace("str(sources[-1].date)", "root.name + str(sources[-1].date)")
    (tmp_path / "site" / "sitecustomize.py").write_text(deadly.replace('"2008-', '"beta2008-'))
    path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    out = tmp_path / "out"
    words = [sys.executable, "-m", "rivid", "run", data, "--out", out, "--no-figures", "--workers", "2"]
    env = os.environ | {"PYTHONPATH": path}
    done = subprocess.run(words, env=env, capture_output=True, text=True)
    assert done.returncode == 3, done.stderr
    assert [(o.failures, o.data_sets) for o in kept(out)] == [(0, 6), (1, 6), (0, 6)]
    assert "worker process died" in (out / "beta" / "delays.csv").read_text()


def test_a_large_reach_that_is_left_over_is_shared_out(data, whole, tmp_path, monkeypatch):
    out = tmp_path / "out"
    monkeypatch.setattr(fleet_run, "SHARED_ABOVE", 5)
    seen = []
    original = fleet_run.run_reach

    def run_reach(reach, root, options, may_decline=False, engine=None):
        outcome = original(reach, root, options, may_decline, engine)
        seen.append((reach.name, outcome is None, engine is not None))
        return outcome

    class Two(fleet_run.Engine):
        slots = 2

    monkeypatch.setattr(fleet_run, "run_reach", run_reach)
    monkeypatch.setattr(fleet_run, "processes", lambda *_: nullcontext(Two()))
    assert rivid("run", data, "--out", out, "--no-figures")[0] == 0
    assert seen == [
        ("alpha", False, False),
        ("beta", False, False),
        ("gamma", True, False),
        ("gamma", False, True),
    ]
    assert all(bytes_of(out / name) == bytes_of(whole[0] / name) for name in REACHES)


def test_only_what_is_new_is_estimated_and_changed_and_silent_reaches_are_listed(data, whole, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(whole[0], out)
    assert fleet_json(out)["changed"] == [], "there was no report before"
    write_days(data / "beta", 2, first=dt.date(2008, 3, 16))
    _, output = rivid("run", data, "--out", out, "--no-figures")
    assert "20 data sets, 2 estimated now" in output
    assert fleet_json(out)["changed"] == ["beta"] and fleet_json(out)["silent"] == ["alpha", "gamma"]
    page, since = (out / "fleet.html").read_text(), minute(fleet_json(out)["before"]["made"])
    for _ in range(2):  # the report is written again, without a run
        _, output = rivid("fleet", out)
        assert f"1 changed since the report of {since}" in output
        assert MADE.sub("", (out / "fleet.html").read_text()) == MADE.sub("", page)
    _, output = rivid("run", data, "--out", out, "--no-figures", "--json")
    lines = [json.loads(line) for line in output.splitlines()]
    assert sorted(line["reach"] for line in lines[:-1]) == list(REACHES)
    assert lines[-1]["summary"]["reaches"] == 3 and fleet_json(out)["changed"] == []


def test_places_that_are_refused_are_left_alone(data, tmp_path):
    code, output = rivid("run", data, "--out", tmp_path / "out", "--dry-run")
    assert code == 0 and "3 reaches" in output and not (tmp_path / "out").exists()
    for place in ("data/out", ".", "data"):
        code, output = rivid("run", data, "--out", tmp_path / place, "--no-figures")
        assert code == 2 and "lie in each other" in output
    assert not (data / "out").exists()
    assert rivid("fleet", tmp_path / "none")[0] == 10 and not (tmp_path / "none").exists()


def test_the_page_shows_hostile_text_as_text(tmp_path):
    outcomes = [Outcome("a", 2, "<script>alert(1)</script>"), Outcome("b", 0, recent=[("2008-03-10", "<b>")])]
    write_fleet(tmp_path, outcomes, "<i>fleet")
    page = (tmp_path / "fleet.html").read_text()
    assert "<script>" not in page and "<b>" not in page and "<i>fleet" not in page


def test_the_worst_code_is_the_first_of_the_stated_order():
    for i, code in enumerate(WORST_FIRST):
        assert worst(WORST_FIRST[i:][::-1]) == code
    assert worst([]) == 0


def test_outcomes_come_back_as_they_were_kept(tmp_path):
    band = dict(low=1.0, high=2.0, median=1.5, days=7, above=0, below=1)
    one = Outcome("a", 3, week_median=1.0, band=band, moved=True, change=0.5, recent=[("2008-03-10", "why")])
    keep(tmp_path, one)
    (tmp_path / ".rivid" / "outcomes" / "b.json").write_text("nonsense")
    assert kept(tmp_path) == [one]
