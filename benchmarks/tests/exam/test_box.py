"""Test the box scheme: volume, and agreement with the explicit scheme on a channel of both."""

import numpy as np
import pytest

from benchmarks.exam.box import THETA, Box, Nodes, section, step
from rivid.errors import RividError
from rivid.reach.changes import AddedFlow, Changes, Leak, Pond
from rivid.reach.saint_venant import Channel, simulate

LENGTH, WIDTH, FALL, MANNING = 8000.0, 90.0, 0.8, 0.03


def nodes(boxes=24, *, bank=0.0, plain=0.0, rough=0.0, growth=0.0, seed=0):
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 1.0, boxes + 1)
    bed = FALL * (1.0 - x) + rough * rng.normal(size=boxes + 1)
    many = boxes + 1
    return Nodes(
        bed, WIDTH * np.exp(rough * rng.normal(size=many)), np.full(many, bank), np.full(many, 5.2),
        np.full(many, plain), np.full(many, MANNING), np.full(many, 4.0), np.full(many, growth),
    )  # fmt: skip


def volume(z, n, dx):
    area = np.array([section(z[i] - n.bed[i], n, i)[0] for i in range(len(z))])
    return float((0.5 * (area[1:] + area[:-1])).sum() * dx)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_no_volume_is_lost_or_made(seed):
    rng = np.random.default_rng(seed)
    n = nodes(bank=1.5, plain=60.0, rough=0.05, growth=20.0, seed=seed)
    dx, dt = LENGTH / 24, 60.0
    z, Q, work = np.full(25, 5.5), np.full(25, 300.0), np.empty((10, 25))
    q, before, passed = np.zeros(24), volume(z, n, dx), 0.0
    up = down = 300.0
    for _ in range(300):
        new_up, new_down = (300.0 + 0.9 * (flow - 300.0) + rng.normal(0.0, 5.0) for flow in (up, down))
        q[:] = rng.normal(0.0, 1e-3, 24)
        assert step(z, Q, new_up, new_down, q, dt, dx, n, work, THETA)
        passed += dt * (THETA * (new_up - new_down) + (1.0 - THETA) * (up - down) + q.sum() * dx)
        up, down = new_up, new_down
    assert abs(passed) > 1e3
    assert volume(z, n, dx) - before == pytest.approx(passed, abs=1.0)


@pytest.mark.parametrize("depth", [1.0, 4.9, 5.3, 7.0])
def test_derivatives_of_a_section_are_those_of_differences(depth):
    n = nodes(bank=1.5, plain=60.0, growth=20.0)
    h = 1e-6
    A, B, _, dK = section(depth, n, 0)
    low, high = section(depth - h, n, 0), section(depth + h, n, 0)
    assert (high[0] - low[0]) / (2 * h) == pytest.approx(B, rel=1e-6)
    assert (high[2] - low[2]) / (2 * h) == pytest.approx(dK, rel=1e-5)
    assert A > 0


def commands(seed, n=400, T=120.0):
    """Return flows that change within an hour.

    Steps would make the reach oscillate, and each scheme damps oscillations differently.
    """
    rng = np.random.default_rng(seed)
    time = T * np.arange(n)
    inflow = 300.0 + np.interp(time, np.linspace(2400.0, time[-1], 14), np.r_[0.0, rng.normal(0.0, 40.0, 13)])
    return time, inflow, np.r_[np.full(30, 300.0), inflow[:-30]]


def both(seed, changes):
    time, inflow, outflow = commands(seed)
    box = Box(LENGTH, nodes(64), 60.0, LENGTH / 64 / 7.7).simulate(time, inflow, outflow, 5.0, changes)[0]
    channel = Channel.smooth(LENGTH, WIDTH, FALL / LENGTH, MANNING, 120)
    channel = channel.with_area_slope(changes.area_slope, changes.area_reference)
    explicit = simulate(channel, time, inflow, outflow, 5.0, changes=changes, gate_time=60.0).level
    return box, explicit


@pytest.mark.parametrize("seed", [1, 2])
def test_a_smooth_rectangular_channel_is_that_of_the_explicit_scheme(seed):
    box, explicit = both(seed, Changes())
    moves = explicit.std()
    assert moves > 0.01
    assert np.sqrt(np.mean((box - explicit) ** 2)) < 0.05 * moves


@pytest.mark.parametrize(
    "changes",
    [
        Changes(added=(AddedFlow(0.4, np.r_[np.zeros(100), np.full(300, 6.0)]),)),
        Changes(leaks=(Leak(0.7, np.full(1, 40.0), 4.9),)),
        Changes(ponds=(Pond(0.5, 2e5, np.full(1, 60.0)),)),
        Changes(area_slope=0.3, area_reference=5.0),
    ],
    ids=["inflow", "leak", "pond", "banks"],
)
def test_changes_do_the_same_to_both_schemes(changes):
    box, explicit = (
        with_ - without for with_, without in zip(both(3, changes), both(3, Changes()), strict=True)
    )
    size = np.sqrt(np.mean(explicit**2))
    assert size > 1e-3
    assert np.sqrt(np.mean((box - explicit) ** 2)) < 0.1 * size


def test_a_reach_that_runs_dry_is_refused():
    time, inflow, outflow = commands(1)
    with pytest.raises(RividError, match="run dry"):
        Box(LENGTH, nodes(), 60.0, 30.0).simulate(time, inflow, outflow + 400.0, 5.0, Changes())
