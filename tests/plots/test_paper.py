"""The paper's figures: all of them, readable, the same bytes each time, with the numbers of the year."""

import dataclasses
import datetime as dt
import re

import numpy as np
import pytest
from PIL import Image

from rivid.errors import ConfigError
from rivid.plots.paper import FIGURES, cascade, choose, draw_paper
from rivid.plots.paper_data import estimate, of_year
from rivid.plots.style import styled
from rivid.report.build import write_gallery
from tests.plots.layout import check, labels, saved
from tests.plots.years import still, without_outflow, year

NUMBERS = ["2", "3", "4", "5", "6", "7", "9", "10", "11", "12", "13", "14", "15", "16", "17", "18", "19"]


def paper(y, folder):
    with saved() as figures:
        files = draw_paper(y, estimate(y), [of_year(y)], folder)
    return files, figures


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Folder, files and figures of a year."""
    folder = tmp_path_factory.mktemp("paper")
    y = year()
    files, figures = paper(y, folder)
    write_gallery(y, files, folder)
    return folder, files, figures


def test_every_figure_is_there_as_vector_and_as_png_and_readable(drawn):
    folder, files, figures = drawn
    assert [f.kind for f in files] == NUMBERS and len(FIGURES) == len(NUMBERS)
    for f in files:
        vector = f.path.with_suffix(".svg").read_text(encoding="utf-8")
        assert vector.startswith("<?xml") and "<dc:date>" not in vector and "Matplotlib v" not in vector
        with Image.open(f.path) as image:
            assert image.size == (f.width, f.height), f.kind
        check(figures[f.path.stem], f.path.stem)
    stems = {"fig11_priors" if n == "11" else f"fig{int(n):02d}" for n in NUMBERS}
    assert {p.name for p in folder.iterdir()} == {f"{s}.{e}" for s in stems for e in ("png", "svg")} | {
        "index.html"
    }


def test_the_page_shows_every_figure_and_links_to_nothing_else(drawn):
    folder, files, _ = drawn
    page = (folder / "index.html").read_text(encoding="utf-8")
    links = set(re.findall(r'(?:src|href)="([^"#]+)"', page))
    assert links == {p.name for f in files for p in (f.path, f.path.with_suffix(".svg"))}
    assert page.count("<figure") == len(files) and all(f"Fig. {n}." in page for n in NUMBERS)


def test_the_same_logs_give_the_same_bytes(drawn, tmp_path):
    paper(year(), tmp_path)
    for path in tmp_path.iterdir():
        assert (drawn[0] / path.name).read_bytes() == path.read_bytes(), path.name


def test_figures_of_the_year_show_its_estimates(drawn):
    figures, y, e = drawn[2], year(), estimate(year())
    assert figures["fig02"].axes[0].lines[0].get_ydata()[:3] == pytest.approx(y.discharge[:3])
    image = np.asarray(figures["fig13"].axes[0].get_images()[0].get_array())
    assert image[:, 0] == pytest.approx(e.of("ml").fir[0])
    bars = figures["fig09"].axes[0].containers[0]
    share = [100 * np.mean(e.of("direct").delay == d) for d in range(1, 16)]
    assert [bar.get_height() for bar in bars] == pytest.approx(share)
    ends = {ax.get_ylim() for ax in figures["fig18"].axes[:3]}
    assert len(ends) == 1, "one scale for the panels of Fig. 18"
    assert "Rayleigh prior alone" in labels(figures["fig18"])


def test_the_given_day_is_shown_and_an_unknown_one_or_one_without_a_response_is_an_error():
    y = still(year(), 3)
    e = estimate(y)
    assert choose(e, y.dates[7]) == 7 and choose(e) != 3
    for day in (dt.date(1999, 1, 1), y.dates[3]):
        with pytest.raises(ConfigError, match=f"no impulse response on {day}"):
            choose(e, day)


@pytest.mark.parametrize(
    "y",
    [without_outflow(still(year(days=3, missing=0), 0, 1, 2)), year(days=1, missing=0)],
    ids=["without outflow or answers", "one day"],
)
def test_other_years_are_drawn_as_well(y):
    e = estimate(y)
    with styled():
        drawn = [make(y, e, choose(e), [of_year(y)]) for make in FIGURES]
    assert [number for number, _, _ in drawn] == NUMBERS
    panels = next(figure for number, _, figure in drawn if number == "9").axes
    assert panels[1].axison == bool(y.outflow)


def test_a_reach_without_any_estimate_has_its_interval_alone():
    y = year()
    r = dataclasses.replace(of_year(y), delay=np.full(12, np.nan))
    with styled():
        figure = cascade(y, estimate(y), 0, [r])[2]
    assert tuple(figure.axes[0].lines[0].get_ydata()) == (5, 11) and len(labels(figure)) == 3
