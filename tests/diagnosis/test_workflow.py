"""The whole workflow on seasons of known truth, and its command."""

import datetime as dt
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from rivid.cli.diagnose import command
from rivid.config import load_config
from rivid.diagnosis.data import as_record
from rivid.diagnosis.response.hydraulic import HydraulicResponse
from rivid.diagnosis.result import read_effects
from rivid.diagnosis.selection import USUAL, breaker
from rivid.diagnosis.workflow import diagnose
from rivid.effects import CATALOGUE, effect_classes
from rivid.errors import ConfigError, NoDataError
from rivid.logs.write import write_days
from rivid.simulation import simulate
from rivid.simulation.scenario import load_scenario
from tests.diagnosis import pools, sizes

SCENARIOS = Path(__file__).parent.parent.parent / "configs" / "scenarios"
UNEVEN = load_scenario(SCENARIOS / "uneven.toml")


def season(days, seed, effects=()):
    return simulate(UNEVEN.model_copy(update={"days": days}), seed, effects=effects)


def answer(season, **changes):
    record = as_record(
        season.dates, season.seconds, season.inflow, season.outflow, season.level, sample_time=133.0, delay=8
    )
    nominal = HydraulicResponse.nominal(
        8200.0, 81.6, 5.7, record.usual_output, sample_time=133.0, flow=record.usual_flow
    )
    return diagnose(record, nominal, effect_classes(), gauge_floor=0.0029, **changes)


def written(season, folder):
    columns = zip(season.inflow, season.outflow, season.level, strict=True)
    days = ({"u_Qi": u, "u_Qo": o, "h_L": h} for u, o, h in columns)
    write_days(
        folder, zip(season.dates, days, strict=True), sample_time=133.0, offset=dt.timedelta(hours=1),
        format="parquet", layout="month",
    )  # fmt: skip
    config = folder.parent / "reach.toml"
    config.write_text('[reach]\nname = "pool"\nlength = 8200\nwidth = 81.6\nbed_level = 124.3\n')
    return config


@pytest.mark.long
def test_the_command_names_what_was_hidden_and_its_model_leaves_no_gap(tmp_path):
    melting = season(40, 77, [CATALOGUE["diurnal_inflow"](amplitude=6.0, hour=15.0)])
    config = written(melting, tmp_path / "logs")
    words = [str(tmp_path / "logs"), "-c", str(config), "-o", str(tmp_path / "out"), "--no-figures", "-q"]
    done = CliRunner().invoke(command, [*words, "--json"], standalone_mode=False, catch_exceptions=False)
    assert done.return_value == 0
    result = json.loads(done.stdout)
    assert result == json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert result["verdict"] == "explained"
    (effect,) = result["effects"]
    assert effect["name"] == "diurnal_inflow" and effect["family"] == "flow" and effect["p_value"] < 0.01
    found = {p["name"]: p for p in effect["parameters"]}
    assert found["amplitude"]["value"] == pytest.approx(6.0, abs=0.8) and found["amplitude"]["unit"] == "m3/s"
    assert found["amplitude"]["low"] < 6.0 < found["amplitude"]["high"]
    assert found["hour"]["value"] == pytest.approx(15.0, abs=0.4)
    gap = result["gap"]
    assert gap["rmse_augmented"][1] < 0.6 * gap["rmse_baseline"][1] and gap["unit"] == "m"
    assert len(gap["heldout_dates"]) == 6  # two blocks of three days in thirteen
    page = (tmp_path / "out" / "diagnosis.html").read_text()
    assert "iurnal" in page

    model = tmp_path / "out" / "model.toml"
    (again,) = read_effects(model, load_config(config))
    assert again.name == "diurnal_inflow"
    augmented = simulate(load_scenario(model).model_copy(update={"days": 2}))
    assert augmented.effects[0].name == "diurnal_inflow"
    second = CliRunner().invoke(
        command, [*words[:-3], str(tmp_path / "second"), "--no-figures", "-q", "--model", str(model)],
        standalone_mode=False, catch_exceptions=False,
    )  # fmt: skip
    assert second.return_value == 0
    result = json.loads((tmp_path / "second" / "diagnosis.json").read_text())
    assert result["verdict"] == "no_gap" and not result["effects"]


@pytest.mark.long
def test_nothing_is_named_where_nothing_is_missing():
    result, evidence = answer(season(40, 78))
    assert result.verdict == "no_gap" and not result.effects, result.reason
    assert evidence.inflow_after_sd.shape == evidence.record.time.shape
    w = evidence.inflow_after[evidence.record.used]
    truth = season(40, 78).weather
    assert np.abs(w).mean() < 2.5 and truth.std() < 2.5


@sizes("every", 3, 1)
def test_twenty_days_are_enough_to_find_that_nothing_is_missing(every):
    record = pools.season(5, days=20)
    classes = dict(list(effect_classes().items())[::every])
    result, evidence = diagnose(record, pools.nominal(record), classes, gauge_floor=pools.GAUGE_FLOOR)
    assert result.verdict == "no_gap" and not result.effects, result.reason
    assert evidence.inflow_after_sd.shape == evidence.record.time.shape


def test_few_days_still_flows_and_an_empty_catalogue_give_no_answer():
    record = pools.season(5, days=20)
    few = record.take(range(9))
    result, evidence = diagnose(few, pools.nominal(few), effect_classes())
    assert result.verdict == "insufficient_data" and evidence is None and "9 days" in result.reason
    still = replace(record, inflow=0.0 * record.inflow + 300.0, outflow=0.0 * record.outflow + 300.0)
    result, evidence = diagnose(still, pools.nominal(still), effect_classes())
    assert result.verdict == "insufficient_data" and evidence is None and "never move" in result.reason
    result, evidence = diagnose(record, pools.nominal(record), {})
    assert result.verdict == "insufficient_data" and evidence is None and "exclude" in result.reason


def test_a_hidden_diurnal_inflow_is_named_with_its_size_and_closes_the_gap():
    hidden = CATALOGUE["diurnal_inflow"]
    record = pools.season(6, days=30, effects=(hidden(amplitude=8.0, hour=15.0),))
    few = {name: CATALOGUE[name] for name in ("diurnal_inflow", "lateral_inflow")}
    result, _ = diagnose(record, pools.nominal(record), few, gauge_floor=pools.GAUGE_FLOOR)
    assert result.verdict == "explained", result.reason
    (effect,) = result.effects
    amplitude = next(p for p in effect.parameters if p.name == "amplitude")
    assert effect.name == "diurnal_inflow" and amplitude.value == pytest.approx(8.0, abs=1.0)
    assert amplitude.low < 8.0 < amplitude.high
    assert result.gap.rmse_augmented[1] < 0.9 * result.gap.rmse_baseline[1]


def test_an_empty_directory_and_an_unknown_name_to_exclude_are_refused(tmp_path):
    def run(*words):
        CliRunner().invoke(command, list(map(str, words)), standalone_mode=False, catch_exceptions=False)

    (tmp_path / "empty").mkdir()
    with pytest.raises(NoDataError):
        run(tmp_path / "empty")
    config = written(season(3, 77), tmp_path / "logs")
    config.write_text(config.read_text() + "[diagnose]\nexclude = ['leek']\n")
    with pytest.raises(ConfigError, match="no effect is called 'leek'"):
        run(tmp_path / "logs", "-c", config)


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
