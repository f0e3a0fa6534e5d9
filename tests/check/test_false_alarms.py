"""Sound logs are left in peace: seasons of every kind of reach, with every effect that nature may have."""

from dataclasses import replace
from pathlib import Path

import pytest

from rivid.check import check
from rivid.check.look import look
from rivid.config import load_config
from rivid.simulation import simulate_cascade
from rivid.simulation.scenario import load_scenario
from tests.check.season import days_of, reach_of, sound

SCENARIOS = sorted(path for path in Path("configs/scenarios").rglob("*.toml"))


def alarms(paths, seeds, n):
    """How many seasons, and what is said of those of which anything is."""
    count, said = 0, []
    for path in paths:
        scenario = load_scenario(path)
        scenario = scenario.model_copy(update={"days": min(n, scenario.days), "missing_days": n // 12})
        for seed in seeds:
            for season in simulate_cascade(scenario, seed):
                count += 1
                said += [
                    f"{path.name} {seed}: {finding}" for finding in look(days_of(season), reach_of(season))
                ]
    return count, said


@pytest.mark.parametrize("n", [2, 24])
def test_nothing_is_said_of_sound_seasons(tried, n):
    count, said = alarms(SCENARIOS, [1], n)
    assert said == []
    tried(f"a sound simulated season of {n} days, of every scenario: nothing is said", count)


def test_nothing_is_said_of_sound_seasons_whose_outflow_is_not_logged(tried):
    count, said = 0, []
    for name in ("basse_isere", "uneven", "hydraulic_short", "effects/leakage", "long"):
        days, config = sound(24, name)
        count += 1
        said += look([replace(day, outflow=None) for day in days], config)
    assert said == []
    tried("a sound season without its outflow: nothing is said", count)


@pytest.mark.long
def test_next_to_nothing_is_said_of_long_sound_seasons(tried):
    count, said = alarms(SCENARIOS, [11, 12], 366)
    assert len(said) <= 0.02 * count, said
    tried(f"a sound simulated season of up to 366 days: something was said of {len(said)} in all", count)


@pytest.mark.parametrize(
    ("logs", "config"),
    [
        ("basse_isere", "configs/basse_isere.toml"),
        ("basse_isere_csv", None),
        ("glen_canyon", "configs/glen_canyon.toml"),
        ("glen_canyon", "configs/glen_canyon_rm30.toml"),
    ],
)
def test_nothing_is_said_of_the_samples(tried, logs, config):
    report = check(Path("sample_data") / logs, load_config(Path(config) if config else None))
    assert report.findings == [] and report.exit_code == 0
    tried("sample_data: nothing is said")


def test_a_bypass_that_no_log_holds_is_told_by_the_balance_of_its_days():
    """It really ran then, and was the greater part of the release."""
    report = check(Path("sample_data/glen_canyon"), load_config(Path("configs/glen_canyon_bypass.toml")))
    (finding,) = report.findings
    assert finding.kind == "balance" and "is a part of u_Qi missing?" in finding.text
    assert all("2024-07-08" <= str(date) <= "2024-11-18" for date in finding.days)
