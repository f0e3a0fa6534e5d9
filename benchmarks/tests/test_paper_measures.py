"""Test the measures of the paper page."""

import numpy as np
import pytest

from benchmarks.paper_measures import (
    READINGS,
    World,
    freed,
    largest_jump,
    reach_alone,
    table_vi,
    two,
    with_ramp,
)
from rivid.core.fir import jmap, second_difference
from rivid.core.search import direct
from tests.plots.years import season


def world():
    s = season()
    truth = s.delay.astype(float)
    return World(s.inflow, s.outflow, s.level, truth, s.delay_other.astype(float))


@pytest.mark.parametrize(
    "how",
    [{"scale": 6.5}, {}, {"scale": 6.5, "inverse_gamma": False}],
    ids=["rayleigh", "uniform", "degenerate"],
)
@pytest.mark.parametrize(("reading", "jumps"), [("free", "both"), ("delay", "delay")])
def test_the_transcription_of_two_readings_is_the_cores_estimator(how, reading, jumps):
    w = world()
    prior = {"delay_scale": how["scale"]} if "scale" in how else {"prior": "uniform"}
    given = prior | {"jumps": jumps, "inverse_gamma": how.get("inverse_gamma", True)}
    expected = jmap(w.u, w.y, **given).delay
    assert [table_vi(u, y, reading, **how) for u, y in zip(w.u, w.y, strict=True)] == expected.tolist()


@pytest.mark.parametrize("delay", [1, 2, 7, 15])
def test_readings_differ_from_the_plain_matrix_at_the_jumps_only(delay):
    plain = second_difference(30)
    rows = {0, 1, 2, delay + 1, delay + 2}
    for reading in READINGS:
        D = freed(30, delay, reading)
        changed = set(np.flatnonzero((plain != D).any(axis=1)).tolist())
        assert changed <= rows, reading
    assert not freed(30, delay, "free")[sorted(rows)].any()
    assert np.linalg.matrix_rank(freed(30, delay, "restart")) == 30


def test_what_our_reading_leaves_free_at_one_it_leaves_free_at_two():
    kept = {d: set(np.flatnonzero(freed(30, d, "free").any(axis=1)).tolist()) for d in (1, 2)}
    assert kept[2] < kept[1]
    rng = np.random.default_rng(5)
    for _ in range(20):
        h = rng.standard_normal(30)
        assert np.sum((freed(30, 2, "free") @ h) ** 2) <= np.sum((freed(30, 1, "free") @ h) ** 2)


def test_the_slope_reading_costs_nothing_for_two_level_responses():
    h = np.r_[0.0, np.full(7, -2.0), np.full(22, 1.0)]
    assert np.abs(freed(30, 7, "slope") @ h).max() == 0
    assert np.abs(freed(30, 7, "restart") @ h).max() > 0


def slow_search(target, columns, u_f, d_max=15):
    """Return the least-squares solution of each candidate, column by column."""
    cost = []
    for d in range(1, d_max + 1):
        late = np.r_[np.zeros(d + 1), u_f[: -d - 1]]
        X = np.stack([late, *columns], axis=1)
        cost.append(np.sum((target - X @ np.linalg.lstsq(X, target, rcond=None)[0]) ** 2))
    return 1 + int(np.argmin(cost))


@pytest.mark.parametrize("approach", ["direct", "indirect"])
def test_the_search_with_a_ramp_is_least_squares_with_two_more_columns(approach):
    w = world()
    found = with_ramp(w, approach)
    N = w.u.shape[1]
    line = [np.ones(N), np.linspace(0.0, 1.0, N)]
    for i in range(len(w.u)):
        u_f = np.cumsum(w.u[i])
        if approach == "direct":
            beside = [np.cumsum(w.outflow[i] - w.outflow[i, 0])]
            target = w.y[i]
        else:
            target = np.cumsum(w.y[i])
            beside = [target, u_f]
        assert found[i] == slow_search(target, [*(np.r_[0.0, x[:-1]] for x in beside), *line], u_f)


def test_an_unbalanced_first_sample_misleads_the_direct_approach_and_a_ramp_repairs_it():
    w = reach_alone(world(), noise=0.001)
    assert direct(w.inflow, w.outflow, w.level).delay.tolist() == w.truth.tolist()
    ramp = 5.0 * 133 / 6.7e5 * np.arange(w.u.shape[1])  # the inflow is 5 m3/s larger than the first sample
    tilted = World(w.inflow, w.outflow, w.level + ramp, w.truth, w.truth)
    assert np.mean(direct(tilted.inflow, tilted.outflow, tilted.level).delay == w.truth) < 0.5
    assert with_ramp(tilted, "direct").tolist() == w.truth.tolist()


def test_the_two_most_frequent_delays_are_in_order_and_may_be_one():
    assert two(np.array([7.0, 7, 6, 6, 6, 1, np.nan])) == ((6, 7), pytest.approx(5 / 7))
    assert two(np.array([3.0, 3.0])) == ((3, 3), 1.0)


def test_the_largest_jump_is_the_delay_of_a_theoretical_response():
    from rivid.reach.integrator import theoretical_fir

    fir = np.stack([theoretical_fir(30, d, 1e-4, 1.2e-4) for d in (1, 6, 15)])
    assert largest_jump(fir).tolist() == [1.0, 6.0, 15.0]
