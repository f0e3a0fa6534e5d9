"""Test rows read from disk in chunks: the same tables for any chunk size and order of segments."""

import datetime as dt
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rivid.results import store
from rivid.results.store import (
    SEGMENT,
    Rows,
    Store,
    hash_of,
    read_rows,
    to_table,
    write_segment,
    write_tables,
)
from tests.daily import write_days
from tests.run.test_run import TABLES, bytes_of, rivid

NAMES = ("ml", "posterior")


def segment(keys, seed=0):
    """Return rows of some days, two estimators each, as written by workers."""
    rng = np.random.default_rng(seed)
    rows = []
    for key in keys:
        for name in NAMES:
            date = dt.date(2000, 1, 1) + dt.timedelta(days=key)
            row = {"key": f"{key:04d}", "date": date, "reach": "r", "estimator": name, "status": "failed"}
            row |= {"message": f"=cause {key}", "delay_samples": float(key % 7)}
            if key % 5:
                row |= {"status": "ok", "message": "a remark", "fir": rng.random(4).tolist()}
            if name == "posterior" and key % 3:
                row |= {"probability": 0.5, "first_candidate": 1, "curve": rng.random(3).tolist()}
                row["fir_sd"] = rng.random(4).tolist() if key % 5 else None
            rows.append(row)
    return to_table({name: [row.get(name) for row in rows] for name in SEGMENT.names}, SEGMENT)


@pytest.fixture
def small_chunks(monkeypatch):
    monkeypatch.setattr(store, "CHUNK", 16)


def scattered(folder, seed=0, days=60):
    """Write segments in random order, with one day twice; return the keys in order."""
    folder.mkdir()
    order = np.random.default_rng(seed).permutation(days)
    for part in np.array_split(order, 7):
        write_segment(folder, segment(part.tolist()))
    write_segment(folder, segment([3, 4]))
    return [f"{key:04d}" for key in range(days)]


@pytest.mark.parametrize("seed", range(3))
def test_rows_read_in_chunks_equal_rows_read_at_once(tmp_path, monkeypatch, seed):
    keys = scattered(tmp_path / "segments", seed)
    held, _ = read_rows(tmp_path / "segments")
    held = held.arranged(keys, NAMES)
    (at_once,) = held.chunks()
    monkeypatch.setattr(store, "CHUNK", 16)
    spread, damaged = read_rows(tmp_path / "segments")
    assert not damaged
    spread = spread.arranged(keys, NAMES)
    whole = pa.concat_tables(spread.chunks())
    assert whole.equals(at_once) and len(whole) == 120
    assert hash_of(spread.table) == hash_of(held.table)
    assert [len(chunk) for chunk in spread.chunks()] == [16] * 7 + [8]


def test_only_messages_of_failed_days_are_kept(tmp_path):
    scattered(tmp_path / "segments")
    found, _ = read_rows(tmp_path / "segments")
    for status, message in zip(*(found.table[c].to_pylist() for c in ("status", "message")), strict=True):
        assert (message is not None) == (status == "failed")


@pytest.fixture
def found(tmp_path, small_chunks):
    """Return rows of scattered segments in the order of their keys."""
    keys = scattered(tmp_path / "segments")
    return read_rows(tmp_path / "segments")[0].arranged(keys, NAMES)


def test_tables_written_in_chunks_equal_tables_written_at_once(tmp_path, found):
    write_tables(found.chunks(), tmp_path / "chunks", found.spread)
    write_tables([pa.concat_tables(found.chunks()).combine_chunks()], tmp_path / "whole", found.spread)
    for name in TABLES:
        one, other = tmp_path / "chunks" / name, tmp_path / "whole" / name
        if name.endswith(".csv"):
            assert one.read_bytes() == other.read_bytes()
        else:
            assert pq.read_table(one).equals(pq.read_table(other))
    assert pq.ParquetFile(tmp_path / "chunks" / "delays.parquet").num_row_groups == 8


def test_standard_deviations_may_be_missing_in_a_chunk(tmp_path, small_chunks):
    folder = tmp_path / "segments"
    folder.mkdir()
    write_segment(folder, segment(range(0, 60, 3)))  # none of these days has one
    write_segment(folder, segment([61]))
    found = read_rows(folder)[0].arranged([f"{key:04d}" for key in [*range(0, 60, 3), 61]], NAMES)
    write_tables(found.chunks(), tmp_path / "out", found.spread)
    sd = pq.read_table(tmp_path / "out" / "fir.parquet")["sd"]
    assert sd.null_count == len(sd) - 4


def test_many_rows_become_one_segment_of_many_row_groups(tmp_path, found):
    keys = [f"{key:04d}" for key in range(60)]
    (tmp_path / "one").mkdir()
    path = write_segment(tmp_path / "one", found)
    assert pq.ParquetFile(path).num_row_groups == 8
    again = read_rows(tmp_path / "one")[0].arranged(keys, NAMES)
    assert pa.concat_tables(again.chunks()).equals(pa.concat_tables(found.chunks()))


def test_forget_removes_the_given_keys_only(tmp_path, small_chunks):
    with Store(tmp_path / "out") as held:
        held.segments.rmdir()
        keys = scattered(held.segments)
        held.forget([*keys[::2], "unknown"])
        left = held.read().arranged(keys, NAMES)
    assert left.table["key"].to_pylist() == [key for key in keys[1::2] for _ in NAMES]


def test_no_segments_give_no_rows(tmp_path):
    found, damaged = read_rows(tmp_path)
    assert len(found) == 0 and not damaged
    nothing = found.arranged(["a"], ["ml"])
    assert isinstance(nothing, Rows) and [len(chunk) for chunk in nothing.chunks()] == [0]


def test_runs_give_the_same_tables_for_any_size_of_chunk(tmp_path, monkeypatch):
    write_days(tmp_path / "data", 9)
    words = ("run", tmp_path / "data", "--no-figures", "--estimator", "jmap", "--estimator", "ml", "--out")
    assert rivid(*words, tmp_path / "plain")[0] == 0
    monkeypatch.setattr(store, "CHUNK", 4)
    assert rivid(*words, tmp_path / "small", "--to", "2008-03-13")[0] == 0
    (tmp_path / "data" / "2008-03-10.csv").unlink()
    shutil.copytree(tmp_path / "small", tmp_path / "direct")
    assert rivid(*words, tmp_path / "small")[0] == 0
    assert rivid(*words, tmp_path / "direct", "--force")[0] == 0
    assert bytes_of(tmp_path / "small") == bytes_of(tmp_path / "direct")
    plain = pq.read_table(tmp_path / "plain" / "delays.parquet").slice(2)
    assert pq.read_table(tmp_path / "small" / "delays.parquet").equals(plain)
