"""Test that tables, proposals, logs and findings are those of the version that wrote the golden values.

``python -m tests.golden.make`` writes the values again, ``--compare`` prints the differences above 1e-9.
"""

import pytest

from tests.golden import cases, make

TOLERANCE = 1e-6
"""Relative difference that another processor or LAPACK may cause; condition numbers reach 1e5."""


@pytest.mark.parametrize("part", ["runs", "corpus", "checks"])
def test_results_are_unchanged(part):
    expected = make.expected(part)
    assert len(expected) > 2
    assert cases.differences(make.made(part), expected, tolerance=TOLERANCE) == []


@pytest.mark.long
@pytest.mark.parametrize("name", cases.DIAGNOSES)
def test_diagnoses_name_what_they_named(name, tmp_path):
    ((key, found),) = cases.diagnoses(tmp_path, names=(name,))
    expected = make.expected("diagnoses")[key]
    assert found["exit"] == expected["exit"]
    answer, old = found["json"], expected["json"]
    assert answer["verdict"] == old["verdict"]
    assert [e["name"] for e in answer["effects"]] == [e["name"] for e in old["effects"]]
    assert answer["reach_response"] == old["reach_response"]
