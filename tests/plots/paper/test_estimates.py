"""Each estimator of the paper on a year."""

import numpy as np
import pytest

from rivid.core.cusum import cusum
from rivid.core.fir import map_fir, ml
from rivid.core.jmap import jmap
from rivid.core.search import direct, indirect
from rivid.plots.paper.estimates import DELAYS, estimate
from tests.plots.paper.years import cut, season, still, without_outflow, year


def test_each_estimator_gives_what_the_core_gives():
    s, e = season(), estimate(year())
    u, y = s.inflow - s.inflow[:, :1], s.level - s.level[:, :1]
    expected = {
        "jmap": jmap(u, y).delay,
        "jmap-uniform": jmap(u, y, prior="uniform", alpha=1e4).delay,
        "jmap-uniform-estimated": jmap(u, y, prior="uniform").delay,
        "jmap-degenerate": jmap(u, y, inverse_gamma=False).delay,
        "direct": direct(s.inflow, s.outflow, s.level).delay,
        "indirect": indirect(s.inflow, s.level).delay,
        "cusum-ml": cusum(ml(u, y).fir).delay,
    }
    assert set(DELAYS) < set(expected)
    for name, delay in expected.items():
        assert np.array_equal(e.of(name).delay, delay), name
        assert np.array_equal(e.of(name).at_bound, np.isin(delay, (1, 15))), name
    assert np.array_equal(e.of("ml").fir, ml(u, y).fir)
    assert np.array_equal(e.of("map").fir, map_fir(u, y).fir)


def test_a_shorter_day_changes_no_other_and_has_its_own_answer():
    y = cut(year(), 5, 27)
    whole, short = estimate(year()), estimate(y)
    others = [i for i in range(12) if i != 5]
    alone = jmap(y.inflow[5] - y.inflow[5][0], y.level[5] - y.level[5][0])
    assert np.array_equal(short.of("jmap").fir[others], whole.of("jmap").fir[others])
    assert np.array_equal(short.of("jmap").fir[5], alone.fir)
    assert short.of("jmap").condition[5] == alone.condition


def test_a_day_without_motion_has_no_answer_from_anybody():
    e = estimate(still(year(), 4))
    for one in e.results.estimators:
        assert one.status[4] == "unidentifiable", one.estimator
        assert np.isnan(one.delay[4]) and not one.at_bound[4]
        assert sum(one.answered) == 11, one.estimator


def test_without_a_logged_outflow_there_is_no_direct_approach():
    e = estimate(without_outflow(year()))
    assert not e.has("direct") and e.has("indirect")
    with pytest.raises(StopIteration):
        e.of("direct")


def test_settings_are_those_of_the_configuration():
    y = year()
    import dataclasses

    j = y.config.jmap.model_copy(update={"order": 24, "d_max": 12, "sigma_d": 5.0, "alpha": 300.0})
    e = estimate(dataclasses.replace(y, config=y.config.model_copy(update={"jmap": j})))
    assert e.of("jmap").fir.shape == (12, 24) and e.alpha == 300.0
    assert e.results.delay_scale == 5.0
    for name in DELAYS:
        assert e.of(name).candidates.tolist() == list(range(1, 13))
