"""Figures and words for estimators that have no impulse response, or do not judge their delays."""

import dataclasses

import numpy as np

from rivid.plots import style
from rivid.plots.draw import draw_all
from rivid.plots.tdr import bars
from tests.plots.synthetic import dates_of, estimator, results, river


def searched(n=120, at_edges=0.6, name="direct"):
    """A year of a search: no impulse response, most days at its edges."""
    e = estimator(name, dates_of(n), unanswered=0)
    rng = np.random.default_rng(3)
    delay = np.where(rng.random(n) < at_edges, rng.choice([1.0, 15.0], n), rng.integers(2, 15, n))
    e = dataclasses.replace(
        e,
        status=["ok"] * n,
        messages=[""] * n,
        delay=delay,
        at_bound=(delay == 1) | (delay == 15),
        prior_only=np.zeros(n, bool),
        fir=np.empty((n, 0)),
        alpha=np.full(n, np.nan),
        roughness_sd=np.full(n, np.nan),
        condition=np.full(n, np.nan),
    )
    return dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[e])


def test_no_impulse_response_no_image_of_it(tmp_path):
    run = searched()
    kinds = [file.kind for file in draw_all(run, tmp_path)]
    assert kinds == ["histogram", "delay_map", "delay_discharge"]
    assert bars(run.estimators[0]).shape == (1, 120)


def test_legends_and_captions_do_not_say_what_the_estimator_cannot(tmp_path, monkeypatch):
    legends = {}
    save = style.save

    def look(figure, path):
        save(figure, path)
        made = [axes.get_legend() for axes in figure.axes]
        legends[path.stem] = [text.get_text() for one in made if one for text in one.get_texts()]

    monkeypatch.setattr(style, "save", look)
    run = searched()
    e = run.estimators[0]
    files = draw_all(run, tmp_path)
    edge = int(e.at_bound.sum())
    assert legends["histogram_direct"] == ["delay (120)", f"at a bound ({edge})"]
    for name in ("delay_map_direct", "delay_discharge_direct"):
        assert legends[name][:2] == [f"delay ({120 - edge})", f"at a bound ({edge})"]
    assert not any("the data alone" in file.caption for file in files)
    draw_all(results(("jmap",), dates_of(60)), tmp_path)
    assert any(label.startswith("data decide") for label in legends["histogram_jmap"])


def test_a_rivers_figures_say_who_looks_for_a_jump(tmp_path):
    run = river(12, ("jmap",))
    cusum = dataclasses.replace(run.estimators[0], estimator="cusum-ml")
    run = dataclasses.replace(run, estimators=[*run.estimators, cusum])
    said = {(f.kind, f.estimator): f.caption for f in draw_all(run, tmp_path)}
    assert "The CUSUM looks for a jump" in said["histogram", "cusum-ml"]
    assert "The JMAP looks for a jump" in said["histogram", "jmap"]
    assert "where its mean is found to change" in said["fir_day", ""]
