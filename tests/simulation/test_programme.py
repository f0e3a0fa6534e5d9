"""Test the river flow and the dispatcher."""

import datetime as dt

import numpy as np
import pytest

from rivid.simulation.scenario import FlowScenario, ProgrammeScenario
from rivid.simulation.season import ar1, daily_flow, programme

DAYS = 140
TIME = (86_400.0 * np.arange(DAYS)[:, None] + 133.0 * np.arange(650)).ravel()


def planned(means=300.0, seed=0, **changes):
    rng = np.random.default_rng(seed)
    flows = np.broadcast_to(np.asarray(means, float), DAYS)
    u = programme(ProgrammeScenario(**changes), TIME, flows, np.arange(DAYS) % 7, rng)
    return u.reshape(DAYS, 650)


def test_an_ar1_is_stationary_with_its_memory():
    x = np.stack([ar1(400, 133.0, 1330.0, np.random.default_rng(k)) for k in range(400)])
    assert x[:, 0].std() == pytest.approx(1.0, abs=0.12)
    assert x[:, -1].std() == pytest.approx(1.0, abs=0.12)
    assert (x[:, 10:] * x[:, :-10]).mean() == pytest.approx(np.exp(-1), abs=0.03)


def test_days_have_the_rivers_mean_and_two_peaks():
    u = planned()
    assert u.mean() == pytest.approx(300, abs=6)
    hour = 133.0 * np.arange(650) / 3600
    usual = u.mean(axis=0)
    morning, midday = usual[(hour > 7) & (hour < 10)].mean(), usual[(hour > 13) & (hour < 16)].mean()
    evening, night = usual[(hour > 18) & (hour < 21)].mean(), usual[(hour > 2) & (hour < 5)].mean()
    assert min(morning, evening) > midday + 25 and midday > night + 25


def test_weekends_swing_less():
    swing = np.ptp(planned(corrections=0.0), axis=1).reshape(-1, 7).mean(axis=0)
    assert swing[5:].mean() < 0.85 * swing[:5].mean()


def test_moves_are_whole_limited_and_come_on_their_share_of_samples():
    fives = planned(quantum=5.0)
    assert (fives % 5 == 0).all() and len(np.unique(fives)) > 20
    moves = np.diff(planned(activity=0.25, ramp=12.0).ravel())
    assert (moves % 1 == 0).all() and np.abs(moves).max() == 12
    assert 0.15 < (moves != 0).mean() < 0.25


def test_a_dry_river_is_not_shifted_below_its_smallest_command():
    u = planned(means=60.0, lowest=40.0)
    assert u.min() >= 40
    assert np.ptp(u, axis=1).mean() < 0.7 * np.ptp(planned(), axis=1).mean()


def test_the_river_has_its_season_and_its_limits():
    flow = FlowScenario(mean=300, seasonal=0.5, peak_day=155, variability=0.3)
    first = dt.date(2007, 1, 1)
    years = np.stack([daily_flow(flow, first, 365, np.random.default_rng(k)) for k in range(60)])
    usual = np.log(years).mean(axis=0)
    assert abs(int(usual.argmax()) + 1 - 155) < 40
    assert usual[154] - usual[154 + 180] == pytest.approx(1.0, abs=0.15)
    assert years.min() >= 100 and years.max() <= 800
    shifted = daily_flow(flow, dt.date(2007, 6, 4), 10, np.random.default_rng(0))  # day 155
    start = daily_flow(flow, first, 10, np.random.default_rng(0))
    assert (shifted > start).all()
