"""Days as rows with lead time; the gap at its horizons."""

import datetime as dt

import numpy as np
import pytest

from rivid.diagnosis.data import START_UP, as_record
from rivid.diagnosis.fit import DayErrors, day_errors, residual_of
from rivid.diagnosis.noise.model import NoiseModel
from rivid.errors import RividError

SECONDS = 900.0 * np.arange(96)
DATES = [dt.date(2024, 3, d) for d in (1, 2, 3, 6, 7)]


def record(**changes):
    rng = np.random.default_rng(0)
    u = np.cumsum(rng.standard_normal((5, 96)), axis=1)
    kept = {"inflow": 300 + u, "outflow": 300 + u, "output": 130 + 0.01 * u} | changes
    return as_record(DATES, SECONDS, **kept, sample_time=900.0, delay=4)


def test_a_row_begins_with_the_end_of_the_day_before_it():
    r = record()
    lead = 4 + START_UP
    assert r.lead == lead and r.time.shape == (5, 96 + lead)
    np.testing.assert_array_equal(r.inflow[1, :lead], r.inflow[0, -lead:])
    np.testing.assert_array_equal(r.output[2, :lead], r.output[1, -lead:])
    assert (np.diff(r.time, axis=1) == 900.0).all()
    assert r.time[3, lead] == 5 * 86_400.0


def test_a_day_that_nothing_precedes_has_a_held_start_that_does_not_count():
    r = record()
    assert np.isnan(r.output[0, : r.lead]).all() and np.isnan(r.output[3, : r.lead]).all()
    assert (r.inflow[3, : r.lead] == r.inflow[3, r.lead]).all()
    assert not r.used[0, : 2 * r.lead].any() and r.used[0, 2 * r.lead :].all()
    assert r.used[1, r.lead :].all() and not r.used[1, : r.lead].any()


def test_some_days_keep_their_times():
    r = record()
    some = r.take([1, 4])
    assert some.dates == (DATES[1], DATES[4])
    np.testing.assert_array_equal(some.time, r.time[[1, 4]])
    assert r.day_number.tolist() == [0, 1, 2, 5, 6]
    world = r.world()
    assert world.first_day == DATES[0] and world.level == pytest.approx(np.median(r.output[r.used]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inflow": np.zeros((5, 90))}, "inflow has shape"),
        ({"outflow": np.full((5, 96), np.nan)}, "outflow of 2024-03-01 has gaps"),
    ],
)
def test_days_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(RividError, match=message):
        record(**changes)
    with pytest.raises(RividError, match="out of order"):
        as_record(
            DATES[::-1], SECONDS, np.zeros((5, 96)), None, np.zeros((5, 96)), sample_time=900.0, delay=4
        )


def test_the_gap_is_the_error_of_a_forecast_by_hand():
    r = record()
    noise = NoiseModel(0.003, 1e-4, 1.0, 20_000.0, 0.0, 1e4, 900.0, 6.7e5)
    z = 0.01 * np.random.default_rng(1).standard_normal(r.output.shape)
    residual = residual_of(r, r.output - z)
    np.testing.assert_allclose(residual[np.isfinite(r.output)], z[np.isfinite(r.output)], atol=1e-12)
    errors = day_errors(r, residual, noise, (1.0, 4.0))
    ahead = noise.forecast_errors(residual, 4, every=4, first=2)
    targets = np.arange(2, residual.shape[1] - 4, 4) + 4
    seen = np.isfinite(ahead) & r.used[:, targets]
    by_hand = np.sqrt((np.where(seen, ahead, 0.0) ** 2).sum() / seen.sum())
    assert errors.rmse()[0] == pytest.approx(by_hand)


def test_days_without_targets_have_no_error():
    errors = DayErrors(np.array([[4.0, 0.0]]), np.array([[1.0, 0.0]]))
    assert errors.rmse([0])[0] == 2.0 and np.isnan(errors.rmse([1])[0])
