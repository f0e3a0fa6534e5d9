"""Fig. 19: intervals, and whose they are."""

import numpy as np
import pytest

from rivid.config import Config, ReachConfig
from rivid.core.jmap import jmap
from rivid.plots.paper.cascade import EMPIRICAL, draw, of_year, own_bounds, shortest
from rivid.plots.style import styled
from tests.plots.paper.years import season, year


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("held", [0.5, 0.8, 0.9, 1.0])
def test_no_other_interval_that_holds_as_many_days_is_shorter(seed, held):
    rng = np.random.default_rng(seed)
    d = rng.integers(1, 16, rng.integers(1, 60)).astype(float)
    low, high = shortest(d, held)

    def share(a, b):
        return np.mean((d >= a) & (d <= b))

    assert share(low, high) >= held - 1e-12
    enough = [b - a for a in range(1, 16) for b in range(a, 16) if share(a, b) >= held - 1e-12]
    assert high - low == min(enough)


def test_days_without_an_answer_do_not_count():
    assert shortest(np.array([np.nan, 6.0, 6.0, np.nan])) == (6, 6)
    assert shortest(np.full(3, np.nan)) == (0, 0)


def test_the_operators_interval_of_the_papers_reach_is_the_papers():
    r = of_year(year())
    assert r.empirical == (5, 11) and r.nominal == 8 and EMPIRICAL == 3


def test_estimates_are_those_of_the_uniform_prior_with_fixed_alpha():
    s = season()
    expected = jmap(s.inflow - s.inflow[:, :1], s.level - s.level[:, :1], prior="uniform", alpha=1e4).delay
    r = of_year(year(), s.delay.astype(float))
    assert np.array_equal(r.delay, expected) and np.array_equal(r.truth, s.delay)


def test_a_reachs_own_bounds_set_its_range():
    config = own_bounds(Config(reach=ReachConfig(length=4500.0)))
    assert (config.jmap.d_max, config.jmap.order, config.jmap.sigma_d) == (7, 14, 3.0)
    assert config.reach.length == 4500.0


def test_a_reach_without_any_estimate_is_drawn_all_the_same(tmp_path):
    import dataclasses

    r = dataclasses.replace(of_year(year()), delay=np.full(12, np.nan))
    with styled():
        figure = draw([r], tmp_path)
    assert figure.png.stat().st_size > 0 and figure.vector.stat().st_size > 0
