"""Test properties of the estimators that hold for any finite input, with hypothesis."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rivid.config import Config, parse
from rivid.core.fir import jmap
from rivid.errors import RividError
from rivid.estimators import ESTIMATORS, Days, build
from tests import examples
from tests.core.test_jmap import season

N = 200
STATUS = {"ok", "degenerate", "unidentifiable"}


def deviations(days):
    """Return the deviations from each day's first sample, the input of the estimators."""
    return days - days[:, :1]


@st.composite
def series(draw, n=N):
    """Draw a finite series: steps, noise, spikes, a ramp or almost nothing, at any scale and offset."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kind = draw(
        st.sampled_from(["steps", "noise", "spike", "ramp", "one step", "flat", "nearly flat", "two"])
    )
    values = {
        "steps": lambda: np.cumsum((rng.random(n) < 0.1) * rng.normal(size=n)),
        "noise": lambda: rng.normal(size=n),
        "spike": lambda: np.eye(n)[draw(st.integers(0, n - 1))],
        "ramp": lambda: np.arange(n) / n,
        "one step": lambda: (np.arange(n) >= draw(st.integers(0, n))).astype(float),
        "flat": lambda: np.zeros(n),
        "nearly flat": lambda: 1 + 1e-13 * rng.normal(size=n),
        "two": lambda: np.where(np.arange(n) % 2, 1.0, -1.0),
    }[kind]()
    scale = 10.0 ** draw(st.integers(-30, 30))
    return scale * (values + draw(st.sampled_from([0.0, 1.0, -1.0, 1e6])))


def is_complete(answer, days):
    """Check that each day has an answer of finite numbers, or the status unidentifiable."""
    assert set(answer.status.tolist()) <= STATUS
    for i in range(days):
        if answer.status[i] == "unidentifiable":
            continue
        for name in ("fir", "noise_variance", "roughness_variance", "criterion", "condition"):
            values = getattr(answer, name)
            if values is not None:
                assert np.isfinite(values[i]).all(), name
        if answer.delay is not None and answer.candidates is not None and np.isfinite(answer.delay[i]):
            assert answer.candidates[0] <= answer.delay[i] <= answer.candidates[-1]
        if answer.probability is not None and np.isfinite(answer.probability[i]):
            assert 0 <= answer.probability[i] <= 1 + 1e-12


@pytest.mark.parametrize("name", ESTIMATORS)
def test_any_finite_input_gives_a_result_or_a_reason(name):
    (estimator,) = build(parse({"run": {"estimators": [name]}}, Config)).values()

    most = 25 if ESTIMATORS[name].has_probability else 60

    @settings(max_examples=examples(most, 10), deadline=None, derandomize=True)
    @given(series(), series(), series())
    def holds(u, y, o):
        u, y, o = (deviations(x[None]) for x in (u, y, o))
        with np.errstate(all="ignore"):
            answer = estimator.estimate(Days(u, y, o, np.array([300.0])))
        is_complete(answer, 1)

    holds()


@settings(max_examples=examples(60, 12), deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.floats(-12, 12), st.sampled_from([-1.0, 1.0]))
def test_scaling_y_scales_h_and_leaves_d(seed, power, sign):
    """In Table VI, 1/scale of y on y acts as one over its square on both variances, and not on alpha."""
    u, y, _ = season(2, seed)
    scale = sign * 10**power
    plain, scaled = jmap(u, y), jmap(u, scale * y)
    size = np.abs(plain.fir).max(axis=1, keepdims=True)
    assert np.array_equal(scaled.delay, plain.delay)
    assert np.allclose(scaled.fir / scale / size, plain.fir / size, rtol=0, atol=1e-6)
    assert np.allclose(scaled.alpha, plain.alpha, rtol=1e-5)
    assert np.allclose(scaled.noise_variance, scale**2 * plain.noise_variance, rtol=1e-6)


@settings(max_examples=examples(60, 12), deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(-(2**20), 2**20), st.integers(-(2**20), 2**20))
def test_adding_a_constant_changes_nothing(seed, to_u, to_y):
    """Estimators use deviations from the day's first sample; these numbers add without rounding."""
    u, y, _ = season(2, seed)
    y = np.round(y * 2**20) / 2**20
    plain = jmap(deviations(u), deviations(y))
    moved = jmap(deviations(u + to_u), deviations(y + to_y))
    for name in ("delay", "fir", "alpha", "criterion", "status"):
        assert np.array_equal(getattr(plain, name), getattr(moved, name)), name


def restful(seed, n=300):
    """Return an inflow that begins at rest, so that a sample can be added before it or removed."""
    u = np.cumsum(np.random.default_rng(seed).normal(size=n))
    u[:3] = u[2]
    return u - u[0]


@settings(max_examples=examples(60, 12), deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(3, 13), st.floats(0.1, 10.0), st.sampled_from([-1, 1]))
def test_shifting_the_inflow_by_a_sample_shifts_d_by_one(seed, delay, gap, by):
    """The prior is uniform, without noise, with d interior: with u one sample later, y comes one sooner."""
    u = restful(seed)
    h = np.zeros(30)
    h[delay + 1 :] = gap * np.linspace(1, 0.2, 30)[: 29 - delay]  # it first acts at lag d + 1 (8)
    h[28:] = 0.0  # a spare lag at the end, for the shifted response
    y = np.convolve(u, h)[:300]
    later = np.r_[0.0, u[:-1]] if by > 0 else np.r_[u[1:], u[-1]]
    assert jmap(u, y, prior="uniform").delay == delay
    assert jmap(later, y, prior="uniform").delay == delay - by


@settings(max_examples=examples(60, 12), deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(2, 14), st.floats(0.3, 2.0))
def test_noise_free_the_delay_is_found(seed, delay, gap):
    """Operators act at once, the inflow after d: two jumps (10). Near the first, d = 1 is never the best."""
    u = restful(seed)
    h = np.r_[0.0, np.linspace(-1.0, -0.4, 29)]
    h[delay + 1 :] += gap
    assert jmap(u, np.convolve(u, h)[:300], prior="uniform").delay == delay


@settings(max_examples=examples(40, 10), deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from([np.nan, np.inf, -np.inf]), st.booleans(), st.integers(0, 648))
def test_a_number_that_is_none_is_refused_with_its_row(seed, value, in_u, at):
    u, y, _ = season(3, seed)
    (u if in_u else y)[1, at] = value
    with pytest.raises(RividError, match="row 1"):
        jmap(u, y)
