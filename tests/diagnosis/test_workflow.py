"""The whole workflow on seasons of known truth, and its command."""

import numpy as np

from rivid.diagnosis.answer import USUAL, breaker
from rivid.effects import CATALOGUE


def test_every_effect_of_the_catalogue_is_tried_or_found_otherwise():
    tried = {name for name, effect in CATALOGUE.items() if effect.trials(133.0)}
    assert set(CATALOGUE) - tried == {"rain_inflow", "sensor_step", "wind_setup", "seiche"}


def test_every_trial_makes_an_effect_of_its_name_again():
    for trial in (t for effect in CATALOGUE.values() for t in effect.trials(133.0)):
        k = max(len(trial.effects), 1)
        made = trial.make(np.full(k, 0.8 * (trial.sign or 1)))
        assert made.name == trial.name
        assert all(hasattr(made, name) for name in trial.free), trial


def test_tied_effects_have_a_measurement_that_separates_them():
    leak, head, wave = (CATALOGUE[name] for name in ("leakage", "gate_head_effect", "diurnal_inflow"))
    assert breaker(leak, ()) is None
    assert "Hold the level" in breaker(leak, (head,)) and breaker(head, (wave, leak)) == breaker(
        leak, (head,)
    )
    assert breaker(wave, (CATALOGUE["rain_inflow"],)) == USUAL["flow"]
