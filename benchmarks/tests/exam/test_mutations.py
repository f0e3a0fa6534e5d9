"""The mutations: each takes out what it says, puts it back, and is told where nothing notices it."""

import numpy as np
import pytest

from benchmarks.exam.answering import record_of
from benchmarks.exam.cases import cases
from benchmarks.exam.mutations import FIXED, MUTATIONS, noticed, told
from benchmarks.exam.naive import named_by_regression
from benchmarks.exam.planting import sealed
from rivid.diagnosis import answer as telling
from rivid.diagnosis import candidates as propose
from rivid.diagnosis import workflow
from rivid.effects import CATALOGUE

BY_NAME = {case.name: case for case in cases()}


def state():
    return (
        workflow.diagnose, workflow.guarded, telling._unknown, dict(workflow.TRIM), workflow.split,
        propose.flip_blocks,
    )  # fmt: skip


@pytest.mark.parametrize("mutation", [m for m in MUTATIONS if m != "as it is"])
def test_a_mutation_changes_the_workflow_and_puts_it_back(mutation):
    before = state()
    with MUTATIONS[mutation]():
        assert state() != before
    assert state() == before


def test_as_it_is_changes_nothing():
    before = state()
    with MUTATIONS["as it is"]():
        assert state() == before


def test_days_instead_of_blocks_deals_and_flips_single_days():
    with MUTATIONS["days instead of blocks"]():
        dealt = workflow.split(10)
        assert dealt.role.tolist() == [0, 0, 1, 0, 2] * 2
        assert propose.flip_blocks(np.zeros(10), dealt).tolist() == list(range(10))


@pytest.mark.parametrize("seed", [3, 4])
def test_the_naive_regression_names_a_leak_where_nothing_is_missing(seed):
    logs, truth = sealed(BY_NAME["nothing/uneven"], seed)
    answer, _ = named_by_regression(record_of(logs), None, dict(CATALOGUE))
    assert truth["effects"] == []
    assert "leakage" in [e.name for e in answer.effects]


def test_a_mutation_that_nothing_notices_is_said():
    found = {"as it is": {}, "no step-4 gate": {}, "no trimming of days": {"river/bypass": "no_gap []"}}
    text = told(found)
    assert not noticed(found)
    assert "| no step-4 gate | none | NOT NOTICED |" in text
    assert "| no trimming of days | river/bypass: no_gap [] | as it must be |" in text
    assert not noticed({"as it is": {"nothing/uneven": "explained [leakage]"}})


def test_fixed_seeds_are_those_of_development():
    assert max(fixed.seed for fixed in FIXED) < 1000
