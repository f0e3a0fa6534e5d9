"""The guard: a level that the inflow drives, and effects seen through it."""

from dataclasses import replace

import numpy as np
import pytest

from rivid.diagnosis.candidates import proposals
from rivid.diagnosis.response.base import kernels_of
from rivid.diagnosis.selection import LEAST, MEMORIES, driven_level, guard, guarded
from rivid.effects import CATALOGUE
from tests.diagnosis.pools import fitted, season

LEAK = CATALOGUE["leakage"](loss=150.0)


def proposal(record):
    """Leakage as a proposal, whatever its chance."""
    model, linear, evaluation = fitted(record)
    (trial,) = CATALOGUE["leakage"].trials(record.sample_time)
    free = replace(trial, sign=0)  # its sign is not asked: people may give it either

    def baseline(more):
        return model.baseline(record, tuple(more))

    (found,) = proposals(linear, evaluation, [free], baseline, kernels_of(model.reach, record), flips=199)
    return found, model, linear, evaluation


def simulated(model):
    return lambda record, more: model.baseline(record, tuple(more))


def test_the_driven_level_is_the_least_squares_of_slow_leaky_means():
    record = season(3, days=4)
    inflow = record.inflow - record.usual_flow
    parts = [np.ones_like(inflow), np.stack([np.full(len(row), row.mean()) for row in inflow])]
    for memory in MEMORIES:
        keep = np.exp(-record.sample_time / memory)
        mean = np.empty_like(inflow)
        for d, row in enumerate(inflow):
            state = row[0]
            for k, q in enumerate(row):
                state = keep * state + (1.0 - keep) * q
                mean[d, k] = state
        parts.append(mean)
    X = np.stack([p[record.used] for p in parts], axis=1)
    b = np.linalg.solve(X.T @ X, X.T @ record.output[record.used])
    expected = sum(c * p for c, p in zip(b, parts, strict=True))
    np.testing.assert_allclose(driven_level(record), expected, atol=1e-7)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_true_leak_passes_the_guard(seed):
    found, model, linear, evaluation = proposal(season(seed, effects=(LEAK,)))
    assert found.evaluation.coefficients[0] == pytest.approx(150.0, abs=25.0)
    assert guarded(found, linear, evaluation, simulated(model))


def test_operators_alone_hardly_ever_pass_the_guard(monkeypatch):
    """Eight empty seasons, where a normal number would exceed the limit in one of fifty."""
    monkeypatch.setattr("rivid.diagnosis.candidates.LOOK", 1.1)  # even what is likely chance
    seen = []
    for seed in range(10, 18):
        found, model, linear, evaluation = proposal(season(seed))
        seen.append(guard(found, linear, evaluation, simulated(model)))
    assert sum(t > LEAST for t in seen) <= 1
    assert all(np.isfinite(seen))


def test_effects_that_do_not_depend_on_the_level_always_pass():
    found, _, linear, evaluation = proposal(season(1, effects=(LEAK,)))
    lag = replace(found, name="outflow_lag", effect=CATALOGUE["outflow_lag"](lag=300.0))
    assert guarded(lag, linear, evaluation, pytest.fail)
