"""Running: results are kept as they come, nothing is asked twice, and truth stays away from who answers."""

import json
from dataclasses import fields

import pytest

from benchmarks.exam import running
from benchmarks.exam.__main__ import options
from benchmarks.exam.answering import Logs
from benchmarks.exam.cases import Case
from benchmarks.exam.running import Desks, keep, outstanding, place_of, results_of, run
from benchmarks.tests.exam import desks

CASES = tuple(Case(f"kind/{name}", "people", "uneven", 2) for name in ("a", "b"))
WORK = [(case, seed) for seed in (5000, 5001) for case in CASES]
SIMPLE = Desks(desks.planted, desks.answered, desks.floored)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    place = tmp_path_factory.mktemp("exam")
    lines = []
    assert run(WORK[:3], processes=1, kept=place, desks=SIMPLE, report=lines.append) == 3
    assert len(lines) == 3
    return place


def test_a_second_call_goes_on_where_the_first_was_stopped(kept):
    assert outstanding(WORK, (0, 1), kept) == WORK[3:]
    never = Desks(desks.planted, desks.refused, desks.floored)
    assert run(outstanding(WORK[:3], (0, 1), kept), kept=kept, desks=never) == 0


def test_results_come_back_with_their_cases(kept):
    found = results_of(WORK, kept)
    assert [(case.name, r["seed"]) for case, r in found] == [(c.name, s) for c, s in WORK[:3]]
    assert [r["answer"]["seen"] for _, r in found] == [5000.0, 5000.0, 5001.0]


def test_who_answers_is_another_process_and_is_told_logs_and_configuration_only(kept):
    for _, r in results_of(WORK, kept):
        assert r["truth"]["effects"][0]["examiner"] != r["answer"]["candidate"]
        assert r["answer"]["config"] == {"reach": {"name": "reach"}}
    assert {f.name for f in fields(Logs)} == {"dates", "seconds", "inflow", "outflow", "output", "config"}


def test_no_case_begins_after_its_time(tmp_path):
    assert run(WORK, processes=1, hours=-1.0, kept=tmp_path, desks=SIMPLE) == 0
    assert not list(tmp_path.rglob("*.json"))


def test_shards_share_all_cases_and_no_case_twice(tmp_path):
    parts = [outstanding(WORK, (k, 3), tmp_path) for k in range(3)]
    assert sorted(map(str, sum(parts, []))) == sorted(map(str, WORK))


def test_a_result_is_whole_or_not_there(tmp_path, monkeypatch):
    place = place_of(WORK[0], tmp_path)
    monkeypatch.setattr(running.json, "dumps", lambda _: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        keep({"case": "a"}, place)
    assert not place.exists()
    monkeypatch.undo()
    keep({"case": "a"}, place)
    assert json.loads(place.read_text()) == {"case": "a"}


@pytest.mark.parametrize("text", ["2/2", "a/2", "1", "-1/2"])
def test_a_shard_that_cannot_be_is_refused(text, capsys):
    with pytest.raises(SystemExit):
        options([f"--shard={text}"])
    assert "expected I/N" in capsys.readouterr().err


def test_a_season_that_cannot_be_simulated_is_told_and_the_others_are_asked(tmp_path):
    lines = []
    barren = Desks(desks.barren, desks.answered, desks.floored)
    assert run(WORK, processes=1, kept=tmp_path, desks=barren, report=lines.append) == 2
    assert sum("cannot be simulated: operators.level_gain is too strong" in line for line in lines) == 2
    assert [seed for _, seed in outstanding(WORK, (0, 1), tmp_path)] == [5001, 5001]
