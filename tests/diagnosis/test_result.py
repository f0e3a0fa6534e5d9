"""The JSON of a diagnosis: probabilities, ranking, the share of the error that is removed."""

import dataclasses
import json
import math

import numpy as np
import pytest

from tests.diagnosis.answers import BYPASS, LOCKS, diagnosis, evidence_of, gap_of

EVIDENCE = evidence_of()


def document(answer):
    return json.loads(answer.to_json())


def test_every_effect_and_every_explanation_has_its_probability():
    answer = diagnosis("partly_explained", EVIDENCE)
    found = document(answer)
    assert [e["probability"] for e in found["effects"]] == [BYPASS.probability, LOCKS.probability]
    ranking = found["ranking"]
    assert len(ranking) == len(answer.ranking) == 7
    assert ranking[0] == {
        "names": [BYPASS.name, LOCKS.name], "unknown": None, "response": "saint-venant", "probability": 0.962,
        "gain": pytest.approx(40 * math.log(0.962e6)), "material": True,
    }  # fmt: skip
    assert ranking[-1]["names"] == [] and ranking[-1]["unknown"] is None and ranking[-1]["gain"] == 0


def test_the_share_removed_needs_no_floor_and_is_null_without_an_error():
    gap = gap_of(EVIDENCE, (BYPASS, LOCKS), each=0.4)
    assert gap.rmse_floor is None
    np.testing.assert_allclose(gap.reduced, 1 - 0.4**4)
    worse = dataclasses.replace(
        gap, rmse_baseline=(0.0, math.nan, 0.02), rmse_augmented=(0.0, 0.01, 0.03), rmse_open_augmented=None
    )
    found = document(diagnosis("explained", EVIDENCE, gap=worse))["gap"]
    assert found["reduced"] == [None, None, pytest.approx(1 - 1.5**2)]
    assert found["rmse_open_augmented"] is None
    assert found["rmse_open_baseline"] == list(gap.rmse_open_baseline)


def test_without_a_ranking_its_fields_are_empty():
    plain = dataclasses.replace(diagnosis("no_gap", EVIDENCE), ranking=(), gap=None)
    found = document(plain)
    assert (found["ranking"], found["small"], found["next_measurement"], found["gap"]) == ([], [], None, None)
