"""Test the counts and times of the benchmark of the diagnosis."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from benchmarks import diagnosis


class Reach:
    def baseline(self, time_):
        time.sleep(0.01)

    def fit(self):
        time.sleep(0.01)
        self.baseline(np.zeros((3, 5)))


def test_time_counts_for_the_part_at_work_and_simulations_by_their_days(monkeypatch):
    for name in ("baseline", "fit"):
        monkeypatch.setattr(Reach, name, getattr(Reach, name))  # restored at the end
    monkeypatch.setattr(diagnosis, "PARTS", {"water": ((Reach, "baseline"),), "noise": ((Reach, "fit"),)})
    monkeypatch.setattr(diagnosis, "RUNS", ((Reach, "baseline"),))
    began = time.perf_counter()
    watch = diagnosis.Watch()
    Reach().fit()
    Reach().baseline(np.zeros((7, 5)))
    watch.turn()
    assert watch.runs == [3, 7]
    assert 0.02 <= watch.seconds["water"] and 0.01 <= watch.seconds["noise"] and watch.seconds["rest"] > 0.0
    assert sum(watch.seconds.values()) == pytest.approx(time.perf_counter() - began, abs=5e-3)


def test_threads_count_their_own_time(monkeypatch):
    monkeypatch.setattr(Reach, "baseline", Reach.baseline)
    monkeypatch.setattr(diagnosis, "PARTS", {"water": ((Reach, "baseline"),)})
    monkeypatch.setattr(diagnosis, "RUNS", ())
    watch = diagnosis.Watch()
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(Reach().baseline, [None, None]))
    watch.turn()
    assert watch.seconds["water"] >= 0.02 and watch.seconds["rest"] >= 0.01


def test_functions_that_are_wrapped_are_there():
    for holder, name in (*diagnosis.RUNS, *(one for part in diagnosis.PARTS.values() for one in part)):
        assert callable(getattr(holder, name))


@pytest.mark.parametrize("name", diagnosis.CASES)
def test_a_case_has_its_days_and_its_samples(name):
    logs = diagnosis.case(name)
    changes = diagnosis.CASES[name][1]
    assert len(logs.dates) == changes.get("days", 60)
    river = logs.settings.reach.kind == "river"
    assert logs.settings.reach.sample_time == changes.get("sample_time", 900.0 if river else 133.0)
    assert (logs.outflow is None) == river
