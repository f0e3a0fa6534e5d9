"""Test the runs: results are stored at once, no season is repeated, and the diagnosis has no truth."""

import json
from dataclasses import fields

import pytest

from benchmarks.exam.__main__ import options
from benchmarks.exam.answering import Logs
from benchmarks.exam.running import Desks, append, outstanding, results_of, run
from benchmarks.tests.exam import desks

SEEDS = range(4)
SIMPLE = Desks(desks.planted, desks.answered, desks.floored)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    place = tmp_path_factory.mktemp("exam")
    lines = []
    assert run(SEEDS[:3], processes=1, kept=place, desks=SIMPLE, report=lines.append) == 3
    assert len(lines) == 3
    return place


def test_a_second_call_goes_on_where_the_first_was_stopped(kept):
    assert outstanding(SEEDS, kept=kept) == [3]
    never = Desks(desks.planted, desks.refused, desks.floored)
    assert run(SEEDS[:3], kept=kept, desks=never) == 0


def test_the_floor_is_asked_where_an_effect_was_named(kept):
    found = results_of(kept)
    assert [r["seed"] for r in found] == [0, 1, 2]
    assert [r["answer"]["seen"] for r in found] == [0.0, 1.0, 2.0]
    assert [r["floor"] for r in found] == [None, [1.0, 2.0, 5.0], None]
    assert all("known" not in r["truth"] for r in found)


def test_who_answers_is_another_process_and_gets_logs_and_configuration_only(kept):
    for r in results_of(kept):
        assert r["truth"]["effects"][0]["examiner"] != r["answer"]["candidate"]
        assert r["answer"]["config"] == {"reach": {"name": "reach"}}
    assert {f.name for f in fields(Logs)} == {"dates", "seconds", "inflow", "outflow", "output", "config"}


def test_no_season_begins_after_its_time(tmp_path):
    assert run(SEEDS, processes=1, hours=-1.0, kept=tmp_path, desks=SIMPLE) == 0
    assert results_of(tmp_path) == []


def test_shards_share_all_seeds_and_no_seed_twice(tmp_path):
    parts = [outstanding(range(100, 110), (k, 3), tmp_path) for k in range(3)]
    assert sorted(sum(parts, [])) == list(range(100, 110))


def test_shards_write_files_of_their_own_and_see_each_others_results(tmp_path):
    for k in range(2):
        append({"seed": k, "part": k}, tmp_path / f"shard-{k}-of-2.jsonl")
    assert outstanding(range(4), (0, 2), tmp_path) == [2]
    assert outstanding(range(4), (0, 1), tmp_path) == [2, 3]
    append({"seed": 0, "part": 9}, tmp_path / "shard-1-of-2.jsonl")
    assert [r["part"] for r in results_of(tmp_path)] == [9, 1]


def test_a_line_cut_short_is_asked_again_and_spoils_no_other(tmp_path):
    place = tmp_path / "shard-0-of-1.jsonl"
    append({"seed": 0}, place)
    place.write_text(place.read_text() + json.dumps({"seed": 1, "answer": 5})[:-4])
    assert outstanding(range(3), kept=tmp_path) == [1, 2]
    append({"seed": 1}, place)
    assert [r["seed"] for r in results_of(tmp_path)] == [0, 1]


@pytest.mark.parametrize("words", ["--shard=2/2", "--shard=1", "--shard=-1/2", "--seeds=5:5", "--seeds=a:b"])
def test_a_shard_or_a_range_that_cannot_be_is_refused(words, capsys):
    with pytest.raises(SystemExit):
        options([words])
    assert "expected" in capsys.readouterr().err


def test_a_season_that_cannot_be_simulated_is_reported_and_the_others_are_asked(tmp_path):
    lines = []
    barren = Desks(desks.barren, desks.answered, desks.floored)
    assert run(SEEDS, processes=1, kept=tmp_path, desks=barren, report=lines.append) == 3
    assert sum("1 cannot be simulated: operators.level_gain is too strong" in line for line in lines) == 1
    assert outstanding(SEEDS, kept=tmp_path) == [1]
