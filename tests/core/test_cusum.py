"""Test CUSUM against a scalar loop, a brute-force search for the onset, and the exact run lengths."""

import statistics
from dataclasses import fields

import numpy as np
import pytest
from scipy.stats import norm

from rivid.core.cusum import cusum
from rivid.core.settings import CusumSettings
from rivid.errors import RividError
from rivid.reach.integrator import theoretical_fir
from tests import examples


def rough_firs(n, M=30, seed=0, jump=4.0):
    """Return impulse responses with an upward jump, and noise."""
    rng = np.random.default_rng(seed)
    d = rng.integers(2, 14, n)
    return -5.0 + jump * (np.arange(M) > d[:, None]) + rng.normal(size=(n, M)), d


def plain(h, s):
    """Compute one day, one coefficient after the other: delay, g, alarm."""
    h = [float(x) for x in h]
    steps = [h[k] - h[k - 1] for k in range(2, len(h))]
    middle = statistics.median(steps)
    sd = s.sd or 1.4826 * statistics.median(abs(x - middle) for x in steps) / 2**0.5
    g, decision, zero, alarm, delay = 0.0, [0.0] * (s.d_min + 1), s.d_min, None, None
    for k in range(s.d_min + 1, len(h)):
        past = h[1:k] if s.mean_lags == 0 else h[1:k][: s.mean_lags]
        mean = s.mean if s.mean is not None else sum(past) / len(past)
        g = max(0.0, g + (h[k] - mean) / sd - s.drift)
        decision.append(g)
        if g == 0.0:
            zero = k
        if g > s.threshold and alarm is None:
            alarm = k
            delay = zero if s.moment == "onset" else k - 1
    return (delay if delay is not None and delay <= s.d_max else None), decision, alarm


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"drift": 0.0, "threshold": 2.0},
        {"mean_lags": 0},
        {"mean_lags": 1, "moment": "alarm"},
        {"mean": -5.0, "sd": 1.0, "drift": 2.0},
        {"d_min": 4, "d_max": 8, "mean_lags": 6},
    ],
)
@pytest.mark.parametrize("seed", range(examples(3, 1)))
def test_it_is_the_loop_over_single_numbers(changes, seed):
    fir, _ = rough_firs(60, seed=seed)
    found, settings = cusum(fir, **changes), CusumSettings(**changes)
    for i in range(60):
        delay, decision, alarm = plain(fir[i], settings)
        np.testing.assert_allclose(found.decision[i], decision, rtol=1e-10, atol=1e-10)
        assert found.delay[i] == delay if delay is not None else np.isnan(found.delay[i])
        assert found.alarm[i] == alarm if alarm is not None else np.isnan(found.alarm[i])
        assert found.identifiable[i] == (delay is not None)


def test_the_onset_is_the_most_likely_start_of_what_raised_the_alarm():
    # of all starts j, select the largest sum of excesses from j + 1 to the alarm
    fir, _ = rough_firs(80, jump=2.0)
    found = cusum(fir, mean=-5.0, sd=1.0, drift=1.0, threshold=3.0, d_max=27)
    z = fir + 5.0 - 1.0
    for i in np.flatnonzero(found.identifiable):
        last = int(found.alarm[i])
        assert found.delay[i] == 1 + np.argmax([z[i, j + 1 : last + 1].sum() for j in range(1, last)])
    assert found.identifiable.sum() > 60


def test_false_alarms_come_as_often_as_the_exact_run_lengths_predict():
    # Brook and Evans (1972): g as a Markov chain on 600 cells from 0 to the threshold
    drift, threshold, M, n, cells = 0.5, 3.0, 101, 4000, 600
    width = 2 * threshold / (2 * cells - 1)
    place = width * np.arange(cells)
    edge = place[None, :] - place[:, None] + drift
    P = norm.cdf(edge + width / 2) - norm.cdf(edge - width / 2)
    P[:, 0] = norm.cdf(edge[:, 0] + width / 2)
    survive = np.zeros(cells)
    survive[0] = 1.0
    for _ in range(M - 2):  # g moves at lags 2 .. M - 1
        survive = survive @ P
    expected = 1.0 - survive.sum()
    fir = np.random.default_rng(4).normal(size=(n, M))
    found = cusum(fir, mean=0.0, sd=1.0, drift=drift, threshold=threshold, d_max=M - 3)
    share = np.isfinite(found.alarm).mean()
    assert abs(share - expected) < 4 * np.sqrt(expected * (1 - expected) / n)


def test_the_scatter_is_that_of_the_noise_for_any_jump():
    # for normal noise the estimate is unbiased except for its small-sample bias
    sd = [cusum(rough_firs(3000, M=200, seed=1, jump=j)[0]).sd for j in (0.0, 3.0, 1e3)]
    for values in sd:
        assert abs(values.mean() - 1.0) < 0.03
    assert abs(sd[2] - sd[0]).max() < 0.2


def test_the_papers_response_decays_before_the_jump_so_the_drift_must_be_tuned():
    h = theoretical_fir(30, 7, 1e-4, 1.2e-4)  # Fig. 10
    assert cusum(h, sd=1e-4, drift=0.8, threshold=0.5).delay == 7
    assert cusum(h, sd=1e-4, drift=0.1, threshold=0.5).delay < 7


def test_days_without_an_answer_have_a_reason_and_leave_the_others_alone():
    fir, _ = rough_firs(5, seed=2, jump=9.0)
    fir[0] = np.nan
    fir[1] = -5.0
    fir[2] = np.random.default_rng(0).permutation(np.linspace(0.0, -3.0, 30))
    fir[2, 1:5] = 9.0
    fir[3] = np.where(np.arange(30) > 20, 30.0, 0.1 * (-1.0) ** np.arange(30))
    found = cusum(fir)
    words = ["no FIR", "does not scatter", "no change above the threshold of 5", "beyond d_max = 15", ""]
    assert all(word in reason for word, reason in zip(words, found.reason, strict=True)), found.reason
    assert found.status.tolist() == ["unidentifiable"] * 4 + ["ok"]
    assert np.isnan(found.delay[:4]).all() and np.isnan(found.decision[:2]).all()
    assert np.isfinite(found.decision[2:]).all()
    assert found.delay[4] == cusum(fir[4]).delay


def test_a_day_does_not_depend_on_its_neighbours_and_may_come_alone():
    fir, _ = rough_firs(333, seed=3)
    whole = cusum(fir)
    for days in (np.random.default_rng(7).permutation(333)[:7], 5):
        again = cusum(fir[days])
        for f in fields(whole):
            np.testing.assert_array_equal(getattr(again, f.name), getattr(whole, f.name)[days])


@pytest.mark.parametrize(
    ("fir", "words"), [(np.zeros((2, 2, 30)), "expected"), (np.zeros(17), "order >= 18, got 17")]
)
def test_an_fir_that_does_not_fit_is_refused(fir, words):
    with pytest.raises(RividError, match=words):
        cusum(fir)
