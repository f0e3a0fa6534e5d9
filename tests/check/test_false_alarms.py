"""Test that sound logs give no finding: seasons of every kind of reach, with every natural effect."""

from dataclasses import replace
from pathlib import Path

import pytest

from rivid.check import check, check_days
from rivid.config import load_config
from rivid.simulation import simulate_cascade
from rivid.simulation.scenario import load_scenario
from tests.check.season import days_of, reach_of, sound

SCENARIOS = sorted(path for path in Path("configs/scenarios").rglob("*.toml"))


def alarms(paths, seeds, n):
    """Return the number of seasons, and their findings."""
    count, found = 0, []
    for path in paths:
        scenario = load_scenario(path)
        scenario = scenario.model_copy(update={"days": min(n, scenario.days), "missing_days": n // 12})
        for seed in seeds:
            for season in simulate_cascade(scenario, seed):
                count += 1
                findings = check_days(days_of(season), reach_of(season))
                found += [f"{path.name} {seed}: {finding}" for finding in findings]
    return count, found


@pytest.mark.parametrize(("n", "every"), [(2, 6), pytest.param(24, 1, marks=pytest.mark.long)])
def test_sound_seasons_give_no_finding(tried, n, every):
    count, found = alarms(SCENARIOS[::every], [1], n)
    assert count > 5
    assert found == []
    tried(f"a sound simulated season of {n} days: no finding", count)


@pytest.mark.parametrize("name", ["basse_isere", "hydraulic_short", "effects/leakage"])
def test_sound_seasons_with_and_without_a_logged_outflow_give_no_finding(tried, name):
    days, config = sound(24, name)
    assert check_days(days, config) == []
    assert check_days([replace(day, outflow=None) for day in days], config) == []
    tried("a sound season with and without its outflow: no finding", 2)


@pytest.mark.long
def test_long_sound_seasons_give_few_findings(tried):
    count, found = alarms(SCENARIOS, [11, 12], 366)
    assert len(found) <= 0.02 * count, found
    tried(f"a sound simulated season of up to 366 days: findings on {len(found)} in all", count)


@pytest.mark.parametrize(
    ("logs", "config"),
    [
        pytest.param("basse_isere", "configs/basse_isere.toml", marks=pytest.mark.long),
        ("basse_isere_csv", None),
        pytest.param("glen_canyon", "configs/glen_canyon.toml", marks=pytest.mark.long),
        pytest.param("glen_canyon", "configs/glen_canyon_rm30.toml", marks=pytest.mark.long),
    ],
)
def test_the_sample_data_give_no_finding(tried, logs, config):
    report = check(Path("sample_data") / logs, load_config(Path(config) if config else None))
    assert report.findings == [] and report.exit_code == 0
    tried("sample_data: no finding")


def test_an_unlogged_bypass_opens_the_balance_of_its_days():
    """The bypass ran on these days, as the larger part of the release."""
    report = check(Path("sample_data/glen_canyon"), load_config(Path("configs/glen_canyon_bypass.toml")))
    (finding,) = report.findings
    assert finding.code == "balance.flows" and finding.values["small"] == "u_Qi"
    assert all("2024-07-08" <= str(date) <= "2024-11-18" for date in finding.days)
