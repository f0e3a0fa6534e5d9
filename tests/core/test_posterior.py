"""Test p(d | y): its answers, its refusals and their reasons, and its invariances."""

import warnings

import numpy as np
import pytest

from rivid.core.posterior.daily import BLOCK, posterior
from rivid.core.settings import PosteriorSettings
from rivid.errors import RividError
from rivid.reach.gauge import stilled
from tests import examples
from tests.core.posterior_days import linear_days, wave_days

ROWS = ("probability", "beyond", "delay", "right", "in_set", "place", "place_low", "place_high",
        "half", "fir", "fir_sd", "link", "status", "message")  # fmt: skip
WORLDS = pytest.mark.parametrize("days", [linear_days, wave_days])


def same(a, b, rows_a=slice(None), rows_b=slice(None)):
    for name in ROWS:
        np.testing.assert_array_equal(getattr(a, name)[rows_a], getattr(b, name)[rows_b], err_msg=name)


def close(a, b, scale=1.0):
    """Check equality except for rounding; the response is in units `scale` times larger."""
    assert (a.status == b.status).all()
    for name in ("probability", "beyond", "delay", "right", "place", "place_low", "place_high", "link"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=0, atol=2e-4, err_msg=name)
    np.testing.assert_allclose(a.fir * scale, b.fir, rtol=0, atol=2e-4 * np.abs(b.fir).max())


@pytest.mark.parametrize("seed", range(examples(3, 1)))
@pytest.mark.parametrize("place", [3.5, 6.45])
def test_a_store_amid_two_samples_is_answered_with_its_delay_and_its_place(place, seed):
    u, y, o, _ = linear_days(6, seed, place=place, noise=0.001)
    found = posterior(u, y, o)
    assert (found.delay == int(place)).all()
    for d_min, d_max in ((int(place), 9), (1, int(place)), (int(place), int(place))):
        assert (posterior(u, y, o, PosteriorSettings(d_min=d_min, d_max=d_max)).delay == int(place)).all()
    assert (found.place_low < place).sum() >= 5 and (found.place_high > place).sum() >= 5
    assert (found.link > 0.99).all()


@pytest.mark.parametrize("seed", range(examples(6, 2)))
@pytest.mark.parametrize("lag", [0.0, 0.5, 0.8])
def test_behind_a_stilling_well_the_half_response_is_later_than_the_front_by_its_half_time(lag, seed):
    u, y, o, _ = linear_days(6, seed, place=4.5, noise=0.0)
    well = stilled(np.arange(u.shape[1], dtype=float), y, lag)
    y = well + 0.001 * np.random.default_rng(seed).normal(size=y.shape)  # the sensor is behind the well
    found = posterior(u, y, o)
    assert np.nanmedian(found.half) == pytest.approx(4.5 + lag * np.log(2.0), abs=0.15)
    assert np.isnan(posterior(u, y).half).all()  # without outflow no lag is identifiable


@WORLDS
def test_the_probabilities_of_a_day_sum_to_one_and_its_set_is_the_smallest_that_holds_90_percent(days):
    u, y, o, _ = days(8, 4)
    found = posterior(u, y, o)
    np.testing.assert_allclose(found.probability.sum(axis=1), 1.0, atol=1e-12)
    for p, chosen in zip(found.probability, found.in_set, strict=True):
        assert p[chosen].sum() >= 0.9
        assert p[chosen].sum() - p[chosen].min() < 0.9
        assert p[chosen].min() >= p[~chosen].max()
    assert (found.place_low <= found.place).all() and (found.place <= found.place_high).all()


@WORLDS
@pytest.mark.parametrize("side", [0, 1])
def test_a_delay_beyond_the_range_is_refused_at_that_edge(days, side):
    u, y, o, _ = days(6, 2, place=5.5)
    s = [PosteriorSettings(d_min=6, d_max=9), PosteriorSettings(d_min=1, d_max=4)][side]
    found = posterior(u, y, o, s)
    assert (found.status == "at_bound").all()
    assert np.isnan(found.delay).all()
    assert set(found.message) == {f"the delay lies {('below d_min', 'above d_max')[side]}"}
    assert (found.beyond[:, side] > 0.5).all()


def test_what_does_not_move_is_unidentifiable_and_has_no_numbers():
    u, y, o, _ = linear_days(4, 1)
    u[1], y[2] = 300.0, 130.0
    found = posterior(u, y, o)
    assert (found.status[1:3] == "unidentifiable").all()
    assert (found.message[1:3] == "inflow or level does not move").all()
    for name in ("probability", "beyond", "delay", "right", "place", "place_low", "place_high", "fir"):
        assert np.isnan(getattr(found, name)[1:3]).all(), name
    assert not found.in_set[1:3].any() and (found.link[1:3] == 0).all()
    same(found, posterior(u[[0, 3]], y[[0, 3]], o[[0, 3]]), [0, 3])
    u[:] = 300.0
    u[:, -1] += 10.0  # it changes only at the end of the day
    found = posterior(u[[0, 3]], y[[0, 3]], o[[0, 3]])
    assert (found.status == "unidentifiable").all() and np.isnan(found.probability).all()
    assert set(found.message) == {"the inflow moves too little"}


def test_a_resting_outflow_is_no_reason_for_a_warning():
    u, y, o, places = linear_days(2, 3)
    o[1] = 260.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = posterior(u, y, o)
    assert np.isfinite(found.fir[0]).all() and np.isfinite(found.probability).any()


@pytest.mark.parametrize("seed", range(examples(4, 1)))
@WORLDS
def test_another_days_inflow_has_no_front_in_the_level(days, seed):
    u, y, o, _ = days(12, seed)
    found = posterior(np.roll(u, 5, axis=0), y, o)
    assert (found.status != "ok").sum() >= 11
    assert "no front of the inflow is seen in the level" in found.message


def test_a_travel_time_at_a_sampling_instant_gives_both_neighbours_and_a_place_between():
    u, y, o, _ = linear_days(8, 6, place=5.0, noise=0.003)
    found = posterior(u, y, o)
    assert np.median(found.probability[:, 3:5].sum(axis=1)) > 0.99
    assert (np.abs(found.place - 5.0) < 0.4).all()
    assert (found.right > found.probability.max(axis=1)).all()


def test_an_uncertain_day_is_refused_with_its_probabilities():
    u, y, o, _ = linear_days(12, 3, place=4.8, noise=0.02)
    found = posterior(u, y, o, PosteriorSettings(answer_above=0.9))
    vague = found.message == "no delay is probable enough"
    assert vague.sum() >= 4
    assert (found.status[vague] == "unidentifiable").all()
    assert np.isnan(found.delay[vague]).all()
    assert (found.right[vague] < 0.9).all() and np.isfinite(found.probability[vague]).all()


@WORLDS
@pytest.mark.parametrize("with_outflow", [True, False])
def test_a_days_bits_do_not_depend_on_the_other_days(days, with_outflow):
    u, y, o, _ = days(BLOCK + 5, 7, N=300)
    o = o if with_outflow else None

    def of(rows):
        return posterior(u[rows], y[rows], None if o is None else o[rows])

    together = of(np.arange(BLOCK + 5))
    same(together, of([3]), [3])
    same(together, of([BLOCK + 4, 0, 2]), [BLOCK + 4, 0, 2])
    same(together, of(np.arange(BLOCK + 4, -1, -1)), slice(None, None, -1))


@WORLDS
def test_units_and_constants_do_not_matter(days):
    u, y, o, _ = days(4, 8)
    plain = posterior(u, y, o)
    close(plain, posterior(u, 100.0 * y - 7.0, o), 100.0)
    close(plain, posterior(35.3 * u, y, 35.3 * o), 1 / 35.3)
    close(plain, posterior(u + 1000.0, y, o - 200.0))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda u, y, o: (u[:, :-1], y, o), "level has shape"),
        (lambda u, y, o: (u, y, o[:1]), "outflow has shape"),
        (lambda u, y, o: (u[0], y[0], o[0]), "expected .days, N."),
        (lambda u, y, o: (u, np.where(y == y[1, 5], np.nan, y), o), "level: not finite on 1 days, first"),
        (lambda u, y, o: (u[:, :50], y[:, :50], o[:, :50]), "50 samples a day: d_max = 15"),
    ],
)  # fmt: skip
def test_impossible_days_are_refused_in_one_line(change, words):
    u, y, o, _ = linear_days(3, 0)
    with pytest.raises(RividError, match=words) as error:
        posterior(*change(u, y, o))
    assert "\n" not in str(error.value)
