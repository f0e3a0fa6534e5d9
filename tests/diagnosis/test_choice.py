"""Test the responses, library and gauge floor of a configured reach."""

import numpy as np
import pytest

from rivid.config import Config
from rivid.diagnosis.choice import gauge_floor_of, library_of, response_of, responses_of
from rivid.effects import CATALOGUE
from rivid.errors import ConfigError
from tests.diagnosis.answers import record_of

POOL = {"name": "pool", "length": 8200, "width": 81.6, "bed_level": 125.0, "sample_time": 900.0}
RIVER = {"name": "river", "kind": "river", "length": 25_000, "width": 100, "depth": 5, "sample_time": 900.0}


def config(reach=None, **diagnose):
    return Config.model_validate({"reach": reach or POOL, "diagnose": diagnose})


def natural(response):
    return {p.name: p.natural for p in response.parameters}


def test_of_a_pool_equations_an_integrator_and_coefficients_compete():
    record = record_of()
    found = responses_of(config(), record)
    assert [r.name for r in found] == ["saint-venant", "integrator-delay", "fir"]
    equations, integrator, _ = map(natural, found)
    assert equations["length"] == pytest.approx(8200.0) and equations["width"] == pytest.approx(81.6)
    dam = equations["depth"] + 0.5 * equations["fall"]
    assert dam == pytest.approx(record.usual_output - 125.0)
    assert integrator["surface_area"] == pytest.approx(8200 * 81.6, rel=0.01)
    speed = 8200.0 / integrator["delay"]
    assert 5.0 < speed < 12.0  # speed of a gravity wave: that of the flow plus sqrt(g h)


def test_of_a_river_a_diffusive_wave_between_gravity_and_kinematic_speed():
    record = record_of(kind="river")
    (response,) = responses_of(config(RIVER), record)
    assert response.surface_area is None
    velocity = record.usual_flow / 500.0
    delay = natural(response)["delay"]
    assert 25_000 / (velocity + np.sqrt(9.81 * 5)) < delay < 25_000 / velocity


def test_a_bed_above_the_water_and_names_that_are_none_are_refused():
    with pytest.raises(ConfigError, match="expected less than the usual level"):
        response_of(config(POOL | {"bed_level": 200.0}), record_of())
    with pytest.raises(ConfigError, match="no effect is called 'leek'"):
        library_of(config(exclude=["leek"]))
    assert set(CATALOGUE) - set(library_of(config(exclude=["leakage", "seiche"]))) == {"leakage", "seiche"}


def test_the_gauge_floor_is_that_of_a_reading_of_whole_steps():
    record = record_of()
    step = 0.01
    record.output[:] = step * np.round(record.output / step)
    assert gauge_floor_of(config(), record) == pytest.approx(step / np.sqrt(12.0))
    assert gauge_floor_of(config(gauge_step=0.05), record) == pytest.approx(0.05 / np.sqrt(12.0))
