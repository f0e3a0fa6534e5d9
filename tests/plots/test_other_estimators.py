"""Figures and words for estimators that have no impulse response, or do not judge their delays."""

import dataclasses
import datetime as dt

import numpy as np
import pytest

from rivid.plots import style
from rivid.plots.draw import draw_all
from rivid.plots.tdr import bars
from rivid.report.attention import attention
from rivid.report.headline import headline, leading
from tests.plots.synthetic import dates_of, estimator, results, river
from tests.test_report import Page, simple, write


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


def test_a_pile_at_the_edges_is_one_row_and_a_few_days_are_their_own():
    run = searched()
    e = run.estimators[0]
    (row,) = attention(run)
    assert (row.kind, row.days, row.estimators) == ("at a bound", int(e.at_bound.sum()), ("direct",))
    assert row.reason.startswith("the delay is 1 or 15, the edges of what was tried, on ")
    few = simple([6] * 80 + [15] * 25)
    assert [r.days for r in attention(few)] == [25], "neighbours with one reason, not a pile"
    assert "is 15 samples" in attention(few)[0].reason
    scattered = simple([6, 15] * 13)
    assert len(attention(scattered)) == 13
    many_of_more = simple(([6] * 4 + [15]) * 30)
    assert len(attention(many_of_more)) == 30, "a fifth of the days is no pile"


def test_rows_stay_in_order_of_their_first_days():
    run = searched()
    nan = np.nan
    other = simple([6, nan, 6], ["ok", "failed", "ok"], ["", "no file", ""], start=dt.date(2008, 1, 1))
    rows = attention(dataclasses.replace(run, estimators=[*other.estimators, *run.estimators]))
    assert [row.first for row in rows] == sorted(row.first for row in rows) and len(rows) == 2


def test_the_headline_says_that_a_search_found_nothing_inside(tmp_path):
    run = searched()
    edge = int(run.estimators[0].at_bound.sum())
    said = headline(run)
    assert said[0] == (
        f"On {edge} of 120 days direct finds no delay inside what was tried: its answer is the edge, "
        "d = 1 or 15."
    )
    assert "direct does not tell on which days the data single the delay out; jmap does." in said
    assert not any("first moves" in s or "the data alone" in s for s in said)
    page = Page(write(run, tmp_path)[0])
    assert "For CUSUM: the response shows no change" in page.words


@pytest.mark.parametrize("names", [("direct", "jmap-uniform"), ("cusum-ml", "direct", "jmap-uniform")])
def test_the_headline_speaks_of_an_estimator_that_judges_where_there_is_one(names):
    run = results(names, dates_of(30))
    assert leading(run).estimator == "jmap-uniform"
    assert leading(results(("ml", "direct"), dates_of(30))).estimator == "direct"


def test_a_page_without_such_estimators_does_not_speak_of_them(tmp_path):
    page = Page(write(results(("jmap", "ml"), dates_of(5)), tmp_path)[0])
    assert "CUSUM" not in page.words and "direct" not in page.words
