import datetime as dt
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from rivid.effects.level import Seiche, SensorDrift, SensorStep, Tide, WindSetup, covariance
from rivid.errors import ConfigError
from tests.effects.worlds import FIRST, world

DATES = (FIRST + dt.timedelta(days=2), FIRST + dt.timedelta(days=3))
MODELS = [
    WindSetup(deviation=0.02, correlation_time=3.0),
    Seiche(period=2700.0, damping=3e-4, amplitude=0.03),
    Seiche(period=1000.0, damping=1e-3, amplitude=0.03),
]


def gauge(effect, here):
    return np.broadcast_to(effect.changes(here).gauge, here.time.shape)


def autocovariance(model, lag):
    """Return the autocovariance from the spectral density of an autoregression."""
    a, innovation = model

    def density(x):
        gain = 1.0 - sum(c * np.exp(-1j * x * (i + 1)) for i, c in enumerate(a))
        return innovation**2 / abs(gain) ** 2 * math.cos(lag * x) / math.pi

    middle = math.acos(np.clip(a[0] / 2 / math.sqrt(-a[1]), -1, 1)) if len(a) == 2 else 0.0
    return quad(density, 0.0, math.pi, points=[middle, 2 * middle], limit=500)[0]


def test_a_gauge_drifts_from_the_first_date_to_the_last():
    here = world(days=6)
    drift = gauge(SensorDrift(drift=0.01, dates=DATES), here)
    for t, z in zip((here.time / 86_400).tolist(), drift.tolist(), strict=True):
        assert z == pytest.approx(0.01 * (t - 2) if 2 <= t < 4 else 0.0, abs=1e-14)
    always = gauge(SensorDrift(drift=-0.02), here)
    assert always == pytest.approx(-0.02 * np.maximum(here.time, 0.0) / 86_400)


def test_a_gauge_steps_at_its_start_and_within_its_dates():
    here = world(days=6)
    t = here.time / 3600.0
    assert gauge(SensorStep(step=0.05, start=30.0), here).tolist() == np.where(t >= 30, 0.05, 0.0).tolist()
    assert gauge(SensorStep(step=0.05), here).tolist() == np.where(t >= 0, 0.05, 0.0).tolist()
    both = gauge(SensorStep(step=-0.05, start=60.0, dates=DATES, hours=(4, 20)), here)
    there = (t >= 60) & (t < 96) & (t % 24 >= 4) & (t % 24 < 20)
    assert both.tolist() == np.where(there, -0.05, 0.0).tolist()


def test_a_gauge_steps_up_and_down_any_number_of_times():
    here = world(days=6)
    t = here.time / 3600.0
    steps, starts = (0.06, -0.02, -0.06), (30.0, 100.5, 31.0)
    slow = sum(step * (t >= start) for step, start in zip(steps, starts, strict=True))
    assert gauge(SensorStep(step=steps, start=starts), here) == pytest.approx(slow, abs=1e-15)
    assert SensorStep.from_events(starts, steps, 0.0) == SensorStep(step=steps, start=starts)
    table = SensorStep(step=steps, start=starts).to_table()
    assert SensorStep.from_table(table).to_table() == table
    assert SensorStep.from_table({"step": 0.1, "start": 3.0}).to_table()["step"] == 0.1
    for wrong in ({"step": steps}, {"step": (), "start": ()}, {"step": steps, "start": (1.0, 2.0)}):
        with pytest.raises(ConfigError, match="expected a start for each step"):
            SensorStep(**wrong)


@pytest.mark.parametrize("effect", MODELS, ids=str)
@pytest.mark.parametrize("sample_time", [133.0, 900.0])
def test_autoregressions_have_the_given_spread_and_memory(effect, sample_time):
    model = coefficients, _ = effect.autoregression(sample_time)
    if isinstance(effect, WindSetup):
        expected = [
            effect.deviation**2 * math.exp(-lag * sample_time / 3600 / effect.correlation_time)
            for lag in (0, 1, 5)
        ]
    else:
        assert abs(np.roots([1.0, *(-c for c in coefficients)])) == pytest.approx(
            math.exp(-effect.damping * sample_time), rel=1e-9
        )
        poles = np.roots([1.0, *(-c for c in coefficients)])
        turn = (2 * math.pi * sample_time / effect.period) % (2 * math.pi)
        assert np.abs(np.angle(poles)).max() == pytest.approx(min(turn, 2 * math.pi - turn), rel=1e-6)
        expected = [effect.amplitude**2 / 2]
    for lag, value in zip((0, 1, 5), expected, strict=False):
        assert autocovariance(model, lag) == pytest.approx(value, rel=1e-6)
    assert covariance(model)[0] == pytest.approx(autocovariance(model, 0), rel=1e-6)
    if len(coefficients) == 2:
        assert covariance(model)[1] == pytest.approx(
            autocovariance(model, 1), rel=1e-6, abs=1e-9 * covariance(model)[0]
        )


@pytest.mark.parametrize("effect", MODELS, ids=str)
def test_drawn_series_have_the_law_of_their_autoregression_from_the_first_sample_on(effect):
    model = coefficients, innovation = effect.autoregression(133.0)
    here = world(0, days=1, lead=0)
    here = replace(here, time=here.time[:150], inflow=here.inflow[:150])
    drawn = np.array([gauge(effect, replace(here, seed=(seed,))) for seed in range(1500)])
    for k in (0, 1, 100):  # stationary: the start has the same variance
        for lag in (0, 1, 3, 10):
            products = drawn[:, k] * drawn[:, k + lag]
            error = products.std() / math.sqrt(len(products))
            assert products.mean() == pytest.approx(autocovariance(model, lag), abs=4.5 * error)
    past = [drawn[:, 10 - i : -i or None] for i in range(len(coefficients) + 1)]
    n = min(p.shape[1] for p in past)
    shock = past[0][:, -n:] - sum(c * p[:, -n:] for c, p in zip(coefficients, past[1:], strict=True))
    error = innovation / math.sqrt(2 * shock.size)
    assert shock.std() == pytest.approx(innovation, abs=4.5 * error)
    assert abs((shock[:, 1:] * shock[:, :-1]).mean()) < 4.5 * innovation**2 / math.sqrt(shock.size)


@pytest.mark.parametrize("effect", MODELS[:2], ids=str)
def test_rows_of_days_hold_the_same_series_as_one_row_with_gaps_for_days_left_out(effect):
    one, rows = world(7, days=9), world(7, days=9, rows=True)
    series = gauge(effect, rows)
    assert series.ravel().tolist() == gauge(effect, one).tolist()
    kept = [0, 1, 5, 9]
    some = replace(rows, time=rows.time[kept], inflow=rows.inflow[kept])
    assert gauge(effect, some).tolist() == series[kept].tolist()


def test_the_series_goes_on_across_midnight():
    here = world(3, days=60)
    x = gauge(WindSetup(deviation=0.02, correlation_time=20.0), here)
    midnight = np.flatnonzero(np.diff(here.time) < 100.0)
    innovation = WindSetup(deviation=0.02, correlation_time=20.0).autoregression(133.0)[1]
    assert len(midnight) == 60
    assert np.abs(np.diff(x)[midnight]).max() < 5 * innovation


@pytest.mark.parametrize("effect", [WindSetup(hours=(22, 6)), Seiche(hours=(22, 6))], ids=lambda e: e.name)
def test_wind_and_seiche_act_in_their_hours_and_by_their_size(effect):
    here = world(days=3)
    x, hour = gauge(effect, here), here.time / 3600 % 24
    night = (hour >= 22) | (hour < 6)
    assert (x[~night] == 0.0).all() and (x[night] != 0.0).all()
    size = "amplitude" if effect.name == "seiche" else "deviation"
    assert (gauge(replace(effect, **{size: 0.0}), here) == 0.0).all()


@pytest.mark.parametrize("shares", [(0.03, -0.04, 0.0, 0.01), (0.0, 0.2, -0.1, 0.0)])
def test_the_trial_of_a_tide_is_its_waves(shares):
    """Columns times coefficients are the effect that is built from them."""
    here = world(days=5)
    (trial,) = Tide.trials(here)
    columns = [e.changes(here).gauge / size for e, size in zip(trial.effects, trial.sizes, strict=True)]
    made = trial.make(np.array(shares))
    assert made.changes(here).gauge == pytest.approx(np.tensordot(shares, columns, 1), abs=1e-12)
    hours = here.time / 3600.0
    wave = shares[0] * np.cos(2 * np.pi * hours / 12.4206) + shares[1] * np.sin(2 * np.pi * hours / 12.4206)
    wave += shares[2] * np.cos(2 * np.pi * hours / 12.0) + shares[3] * np.sin(2 * np.pi * hours / 12.0)
    assert made.changes(here).gauge == pytest.approx(wave, abs=1e-12)
