"""Test shards of a run: parts that can run together, locks against a whole run, and the same bytes."""

import datetime as dt
import json
from collections import Counter

import pytest

from rivid.errors import ConfigError, LockedError
from rivid.results.store import Store
from rivid.run.run import BLOCK, Shard
from tests.daily import write_days
from tests.faults.processes import start
from tests.run.test_run import bytes_of, rivid


@pytest.mark.parametrize("count", [1, 7, 40])
def test_every_day_is_of_one_shard_whatever_other_days_there_are(count):
    days = [dt.date(1999, 1, 1) + dt.timedelta(days=k) for k in range(40 * BLOCK)]
    shards = [Shard(i + 1, count) for i in range(count)]
    of = Counter(shard.index for day in days for shard in shards if shard.holds(day))
    assert sum(of.values()) == len(days) and set(of) == set(range(1, count + 1))
    assert max(of.values()) - min(of.values()) <= 2 * BLOCK


def test_what_is_no_shard_is_refused(tmp_path):
    for text in "0/4 5/4 1 1/ /4 a/b 1/4/2 -1/4 1.0/4 ²/4 1/100001".split() + ["1" * 30 + "/4"]:
        with pytest.raises(ConfigError, match="expected I/N"):
            Shard.parse(text)
    assert rivid("run", tmp_path, "--shard", "0/4")[0] == 2


def test_shards_and_then_a_run_give_the_bytes_of_a_run(tmp_path):
    data = tmp_path / "data"
    write_days(data, 70)
    (data / "2008-03-12.csv").write_text("time,u_Qi,u_Qo,h_L\n")
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert rivid("run", data, "--out", whole, "--no-figures")[0] == 3
    estimated = 0
    for part in ("3/3", "1/3", "2/3"):
        code, output = rivid("run", data, "--out", parts, "--shard", part)
        assert code == 0, "what failed is reported by the run that merges"
        estimated += int(output.split(" estimated now")[0].split()[-1])
        assert not (parts / "delays.csv").exists() and not (parts / "run.json").exists()
    assert estimated == 70
    code, output = rivid("run", data, "--out", parts, "--no-figures")
    assert code == 3 and "0 estimated now, 70 done before" in output
    assert bytes_of(parts) == bytes_of(whole)


def test_a_shard_without_days_succeeds_and_without_logs_has_no_data(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    assert rivid("run", data, "--out", tmp_path / "out", "--shard", "1/2")[0] == 10
    write_days(data, 2)
    done = [
        rivid("run", data, "--out", tmp_path / "out", "--shard", f"{i}/9", "--json", "--quiet")
        for i in range(1, 10)
    ]
    assert [code for code, _ in done] == [0] * 9
    assert sorted(json.loads(output)["summary"]["computed"] for _, output in done) == [0] * 8 + [2]


def test_shards_hold_out_together_and_keep_a_whole_run_out(tmp_path, monkeypatch):
    out = tmp_path / "out"
    monkeypatch.setattr("rivid.results.store.SHARD_PATIENCE", 0.2)
    with Store(out, "1-of-3"), Store(out, "2-of-3"):
        with pytest.raises(LockedError), Store(out, "2-of-3"):
            pass
        with pytest.raises(LockedError), Store(out):
            pass
        with Store(out, "3-of-3"):
            pass
    with Store(out):
        with pytest.raises(LockedError), Store(out, "1-of-3"):
            pass
    assert not list((out / ".rivid").glob("lock.*"))
    with Store(out, "1-of-3"):
        pass


def test_shards_at_the_same_time_lose_nothing(tmp_path):
    data, out = tmp_path / "data", tmp_path / "out"
    write_days(data, 70)
    jobs = [start("run", data, "--out", out, "-q", "--shard", f"{i}/2") for i in (1, 2)]
    for job in jobs:
        _, output = job.communicate(timeout=60)
        assert job.returncode == 0, output
    assert "0 estimated now, 70 done before" in rivid("run", data, "--out", out, "--no-figures")[1]
