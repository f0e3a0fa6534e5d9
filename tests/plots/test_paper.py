"""Test the paper's figures: readable, equal bytes each time, with the numbers of the year."""

import dataclasses
import datetime as dt
import re

import numpy as np
import pytest
from PIL import Image

from rivid.errors import ConfigError
from rivid.plots import paper
from rivid.plots.paper import FIGURES, choose, draw_paper, figure_of
from rivid.plots.paper_data import estimate, of_year
from rivid.plots.style import styled
from rivid.report.build import write_gallery
from tests.plots.layout import check, labels
from tests.plots.years import estimated, still, without_outflow, year

NUMBERS = [str(number) for number in range(1, 20)]


@pytest.fixture(scope="module")
def figures():
    """Return the figures of a year by their number, drawn and not written."""
    return all_of(year(), estimated())


def all_of(y, e):
    day, reach = choose(e), of_year(y)
    with styled():
        drawn = {num: figure_of(num, y, e, day, [reach]) for num in FIGURES}
    assert list(drawn) == NUMBERS
    return drawn


@pytest.mark.parametrize("num", NUMBERS)
def test_no_text_is_cut_off_and_no_tick_labels_overlap(num, figures):
    with styled():
        figures[num].draw_without_rendering()
    check(figures[num], num)


def written(folder):
    """Return the files of the figures in `folder`, with their page."""
    files = draw_paper(year(), estimated(), [of_year(year())], folder)
    write_gallery(year(), files, folder)
    for f in files:
        vector = f.path.with_suffix(".svg").read_text(encoding="utf-8")
        assert vector.startswith("<?xml") and "<dc:date>" not in vector and "Matplotlib v" not in vector
        with Image.open(f.path) as image:
            assert image.size == (f.width, f.height), f.kind
    page = (folder / "index.html").read_text(encoding="utf-8")
    links = re.findall(r'(?:src|href)="([^"#]+)"', page)
    names = {p.name for f in files for p in (f.path, f.path.with_suffix(".svg"))}
    assert set(links) == names and {p.name for p in folder.iterdir()} == names | {"index.html"}
    assert page.count("<figure") == len(files) and all(f"Fig. {f.kind}." in page for f in files)
    return [f.kind for f in files], {p.name: p.read_bytes() for p in folder.iterdir()}


def test_a_figure_and_its_page_are_the_same_bytes_each_time(tmp_path, monkeypatch):
    monkeypatch.setattr(paper, "FIGURES", {"11": paper.FIGURES["11"]})
    kinds, files = written(tmp_path / "a")
    assert kinds == ["11"] and set(files) == {"fig11_priors.png", "fig11_priors.svg", "index.html"}
    assert written(tmp_path / "b")[1] == files


@pytest.mark.long
def test_all_figures_and_their_page_are_the_same_bytes_each_time(tmp_path):
    kinds, files = written(tmp_path / "a")
    assert kinds == NUMBERS and written(tmp_path / "b")[1] == files


def test_figures_of_the_year_show_its_estimates(figures):
    y, e = year(), estimated()
    assert figures["2"].axes[0].lines[0].get_ydata()[:3] == pytest.approx(y.discharge[:3])
    image = np.asarray(figures["13"].axes[0].get_images()[0].get_array())
    assert image[:, 0] == pytest.approx(e.of("ml").fir[0])
    bars = figures["9"].axes[0].containers[0]
    share = [100 * np.mean(e.of("direct").delay == d) for d in range(1, 16)]
    assert [bar.get_height() for bar in bars] == pytest.approx(share)
    ends = {ax.get_ylim() for ax in figures["18"].axes[:3]}
    assert len(ends) == 1, "one scale for the panels of Fig. 18"
    assert "Rayleigh prior alone" in labels(figures["18"])


def test_the_given_day_is_shown_and_an_unknown_one_or_one_without_a_response_is_an_error():
    y = still(year(), 3)
    e = estimate(y)
    assert choose(e, y.dates[7]) == 7 and choose(e) != 3
    for day in (dt.date(1999, 1, 1), y.dates[3]):
        with pytest.raises(ConfigError, match=f"no impulse response on {day}"):
            choose(e, day)


@pytest.mark.parametrize(
    "made",
    [
        pytest.param(
            lambda: without_outflow(still(year(days=3, missing=0), 0, 1, 2)), marks=pytest.mark.long
        ),
        lambda: year(days=1, missing=0),
    ],
    ids=["without outflow or answers", "one day"],
)
def test_other_years_are_drawn_as_well(made):
    y = made()
    panels = all_of(y, estimate(y))["9"].axes
    assert panels[1].axison == bool(y.outflow)


def test_a_reach_without_any_estimate_has_its_interval_alone():
    y = year()
    r = dataclasses.replace(of_year(y), delay=np.full(12, np.nan))
    with styled():
        figure = figure_of("19", y, estimated(), 0, [r])
    assert tuple(figure.axes[0].lines[0].get_ydata()) == (5, 11) and len(labels(figure)) == 3
