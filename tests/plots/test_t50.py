"""t50 of a river: whose it is, what its numbers are, where its panels end."""

import dataclasses

import numpy as np
import pytest

from rivid.plots import t50
from rivid.plots.draw import draw_all
from rivid.results.passage import leading_response, passage, thirds
from tests.plots.synthetic import dates_of, results, river, without_answers


def test_one_estimator_of_a_river_speaks_map_before_jmap_before_ml(tmp_path):
    for names, first in (
        (("ml", "jmap", "map"), "map"),
        (("ml", "jmap"), "jmap"),
        (("jmap-uniform", "ml"), "ml"),
        (("jmap-uniform",), "jmap-uniform"),
    ):
        files = draw_all(river(12, names), tmp_path)
        drawn = {f.kind: f.estimator for f in files if f.kind.startswith("t50")}
        assert drawn == {"t50": first, "t50_discharge": first}
        on_disk = {p.name for p in (tmp_path / "figures").glob("t50*.png")}
        assert on_disk == {f"t50_{first}.png", f"t50_discharge_{first}.png"}, "those of before are gone"


def test_a_pool_has_no_t50(tmp_path):
    run = results(("map", "jmap"), dates_of(3))
    assert leading_response(run) is None
    assert not any(f.kind.startswith("t50") for f in draw_all(run, tmp_path))


def test_an_estimator_without_a_t50_leaves_the_word_to_the_next():
    run = river(12, ("map", "jmap"))
    silent = without_answers(run).estimators[0]
    assert (
        leading_response(dataclasses.replace(run, estimators=[silent, run.estimators[1]])).estimator == "jmap"
    )
    assert leading_response(without_answers(run)).estimator == "map"


def test_thirds_hold_equal_numbers_of_days_and_count_pairs_as_a_plain_loop_does():
    rng = np.random.default_rng(3)
    n = 300
    run = river(n)
    e = run.estimators[0]
    Q = rng.uniform(200, 400, n)
    lag = np.round(30 - 0.01 * Q + rng.standard_normal(n), 1)
    e = dataclasses.replace(e, status=["ok"] * n, mean_inflow=Q, t50=lag)
    t = thirds(e)
    order = np.argsort(Q)
    low, middle, high = (lag[part] for part in np.split(order, 3))
    assert t.medians == tuple(float(np.median(part)) for part in (low, middle, high))
    pairs = [(a > b) + (a == b) / 2 for a in low for b in high]
    assert t.longer == pytest.approx(np.mean(pairs), abs=1e-12)
    assert low.size == high.size and t.edges[0] == Q.min() and t.edges[3] == Q.max()


def test_days_between_the_bounds_are_counted_in_seconds():
    run = river(4)
    e = dataclasses.replace(
        run.estimators[0],
        status=["ok", "ok", "ok", "failed"],
        t50=np.array([7.0, 8.0, 21.0, 9.0]),
        bound_gravity_s=np.full(4, 7200.0),  # eight samples
        bound_kinematic_s=np.array([18_000.0, 18_000.0, 18_000.0, 18_000.0]),  # twenty
    )
    p = passage(run, e)
    assert (p.days, p.with_t50, p.bounded, p.between) == (4, 3, 3, 1)
    assert (p.low, p.median, p.high) == (7, 8, 21)


def test_one_wild_day_does_not_squeeze_the_others_and_far_bounds_stay_outside():
    lags = np.r_[np.linspace(24, 30, 50), 1.9]
    low, high = t50.window(lags, [np.array([22.0, 33.0]), np.array([8.0, 9.0])])
    assert 20 < low < 22 and 33 < high < 35
    low, high = t50.window(lags, [np.array([60.0, 90.0])])
    assert 22 < low < 24 and 30 < high < 32
    low, high = t50.window(np.full(5, 26.0), [])
    assert low < 26 < high


def test_captions_of_a_rivers_delays_say_that_there_is_no_jump(tmp_path):
    files = {f"{f.kind} {f.estimator}": f for f in draw_all(river(30), tmp_path)}
    for kind in ("histogram", "delay_map", "delay_discharge"):
        assert "a dispersive river has none" in files[f"{kind} jmap"].caption
    assert "a dispersive river has no jump" in files["tdr map"].caption
    assert "half of a step has arrived" in files["tdr map"].caption
    assert "more water, a faster wave" in files["t50_discharge map"].caption
    pool = draw_all(results(("jmap",), dates_of(5)), tmp_path)
    assert not any("river" in f.caption for f in pool)
