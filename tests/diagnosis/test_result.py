"""Test the JSON of a diagnosis: probabilities, ranking, the removed share of the error."""

import dataclasses
import json
import math

import numpy as np
import pytest

from rivid.config import Config, parse
from rivid.diagnosis.calibrated import write_model
from rivid.diagnosis.response.base import vector_of
from rivid.diagnosis.result import Estimate
from rivid.simulation.scenario import load_scenario
from rivid.simulation.season import Water
from tests.diagnosis.answers import BYPASS, LOCKS, diagnosis, evidence_of, gap_of
from tests.diagnosis.responses import nominal, season

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


def test_the_exported_channel_is_the_calibrated_one(tmp_path):
    """It includes banks, modes and the gate time."""
    record = season(4, days=2)
    response = nominal(record, cells=128)
    moves = np.random.default_rng(2).normal(0.0, 0.02, len(response.parameters))
    response = response.with_parameters(vector_of(response) + moves)
    found = tuple(Estimate(p.name, p.natural, p.unit, p.natural, p.natural) for p in response.parameters)
    answer = dataclasses.replace(diagnosis("no_gap", EVIDENCE), effects=(), reach_parameters=found)
    table = {
        "length": 8200.0,
        "width": 81.6,
        "depth": 4.9,
        "sample_time": 133.0,
        "discharge_range": [50, 900],
    }
    config = parse({"reach": {"name": "reach"} | table}, Config, "test")
    write_model(tmp_path / "model.toml", answer, record, config)
    scenario = load_scenario(tmp_path / "model.toml")
    made, wanted = Water(scenario).channel, response.channel
    levels = np.array([[record.usual_output - 0.5], [record.usual_output + 0.5]])
    cells = np.linspace(0.0, 1.0, 9)
    for channel in (made, wanted):
        assert channel.length == pytest.approx(response.parameters[0].natural, rel=1e-4)
    middle = [np.interp(cells, (np.arange(c.cells) + 0.5) / c.cells, c.bed) for c in (made, wanted)]
    np.testing.assert_allclose(*middle, atol=0.02)
    assert made.surface_area(levels[1]) == pytest.approx(wanted.surface_area(levels[1]), rel=2e-3)
    assert made.surface_area(levels[0]) == pytest.approx(wanted.surface_area(levels[0]), rel=2e-3)
    assert scenario.channel.gate_time == pytest.approx(response.gate_time, rel=1e-3)
