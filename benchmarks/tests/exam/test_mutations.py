"""Test that each mutation removes the part of its name, and restores it."""

import pkgutil

import numpy as np
import pytest

from benchmarks.exam.answering import record_of
from benchmarks.exam.hiding import plant
from benchmarks.exam.mutations import (
    BLOCKS,
    LATENT,
    MATERIAL,
    MUTATIONS,
    answered,
    importers,
    noticed,
    table_of,
)
from benchmarks.exam.naive import named_by_regression
from rivid.diagnosis import blocks, workflow
from rivid.effects import CATALOGUE


def test_the_regression_takes_the_place_of_the_workflow_and_leaves_it():
    before = workflow.diagnose
    with MUTATIONS["naive regression of the differenced level"]():
        assert workflow.diagnose is named_by_regression
    assert workflow.diagnose is before


@pytest.mark.parametrize(
    ("mutation", "target"), [("no materiality", MATERIAL), ("no latent explanation", LATENT)]
)
def test_what_is_taken_out_is_there_and_comes_back(mutation, target):
    module, _, name = target.rpartition(".")
    holder = pkgutil.resolve_name(module)
    before = getattr(holder, name)
    with MUTATIONS[mutation]():
        assert getattr(holder, name) is not before
    assert getattr(holder, name) is before


@pytest.mark.long
@pytest.mark.parametrize("mutation", MUTATIONS)
def test_a_mutated_diagnosis_answers(mutation):
    """Check that a crash raises: the exam would refuse it, which shows nothing about the removed part."""
    logs = plant(11, 15).logs
    assert "error" not in answered(logs, mutation)


def test_days_instead_of_blocks_deals_single_days_wherever_blocks_are_dealt():
    places = importers(BLOCKS)
    assert BLOCKS in places and "rivid.diagnosis.workflow.split" in places
    dates = np.datetime64("2024-05-01") + np.arange(10)
    usual = workflow.split(dates)
    with MUTATIONS["days instead of blocks"]():
        assert np.unique(workflow.split(dates).block).size == 10
    np.testing.assert_array_equal(workflow.split(dates).block, usual.block)
    assert workflow.split is blocks.split and np.unique(usual.block).size < 10


@pytest.mark.parametrize("seed", [11, 17])
def test_the_naive_regression_names_something_where_nothing_is_missing(seed):
    planted = plant(seed, 30)
    answer, _ = named_by_regression(record_of(planted.logs), None, dict(CATALOGUE))
    assert planted.truth["effects"] == []
    assert answer.effects


def test_a_mutation_that_nothing_notices_is_reported():
    found = {"as it is": [], "no materiality": [], "days instead of blocks": ["one effect: first 3/9"]}
    text = table_of(found)
    assert not noticed(found)
    assert "| no materiality | none | NOT NOTICED |" in text
    assert "| days instead of blocks | one effect: first 3/9 | as it must be |" in text
    assert not noticed({"as it is": ["nothing missing: any name 3/9"]})
