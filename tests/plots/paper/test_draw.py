"""The paper's figures: all of them, whole, the same bytes each time."""

import datetime as dt
import re

import pytest
from PIL import Image

from rivid.errors import ConfigError
from rivid.plots.paper import STEPS, bars, delays, draw_paper, hydraulics, one_day, theory
from rivid.plots.paper.cascade import of_year
from rivid.plots.paper.estimates import estimate
from rivid.plots.style import styled
from tests.plots.paper.years import still, without_outflow, year

NUMBERS = ["2", "3", "4", "5", "6", "7", "9", "10", "11", "12", "13", "14", "15", "16", "17", "18", "19"]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    steps = []
    y = year()
    figures = draw_paper(y, estimate(y), [of_year(y)], folder, progress=lambda: steps.append(1))
    assert len(steps) == STEPS
    return folder, figures


def test_every_figure_is_there_as_vector_and_as_png(drawn):
    folder, figures = drawn
    assert [f.number for f in figures] == NUMBERS
    for f in figures:
        assert f.vector.read_text(encoding="utf-8").startswith("<?xml")
        with Image.open(f.png) as image:
            assert image.size == (f.width, f.height), f.number
    wanted = {path for f in figures for path in (f.vector, f.png)} | {folder / "index.html"}
    assert set(folder.iterdir()) == wanted


def test_the_page_shows_every_figure_and_links_to_nothing_else(drawn):
    folder, figures = drawn
    page = (folder / "index.html").read_text(encoding="utf-8")
    links = set(re.findall(r'(?:src|href)="([^"#]+)"', page))
    assert links == {path.name for f in figures for path in (f.vector, f.png)}
    assert page.count("<figure") == len(figures)
    assert "prefers-color-scheme: dark" in page and "http:" not in page and "https:" not in page
    for f in figures:
        assert f"Fig. {f.number}." in page


def test_the_same_logs_give_the_same_bytes(drawn, tmp_path):
    folder, figures = drawn
    y = year()
    draw_paper(y, estimate(y), [of_year(y)], tmp_path)
    for path in folder.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


def test_no_file_holds_a_date_or_a_program(drawn):
    folder, _ = drawn
    for path in folder.glob("*.svg"):
        text = path.read_text(encoding="utf-8")
        assert "<dc:date>" not in text and "Matplotlib v" not in text, path.name


def test_the_day_asked_for_is_shown_and_an_unknown_one_is_refused():
    y = year()
    e = estimate(y)
    assert one_day.choose(e, y.dates[7]) == 7
    with pytest.raises(ConfigError, match="no impulse response on 1999-01-01"):
        one_day.choose(e, dt.date(1999, 1, 1))


def test_a_day_without_an_answer_is_refused_and_never_chosen():
    y = still(year(), 3)
    e = estimate(y)
    assert one_day.choose(e) != 3
    with pytest.raises(ConfigError, match="no impulse response"):
        one_day.choose(e, y.dates[3])


def test_without_an_outflow_fig_9_says_why_there_is_no_direct_approach(tmp_path):
    y = without_outflow(year())
    with styled():
        figure = delays.search_histograms(estimate(y), tmp_path)
        assert one_day.logs(y, 0, tmp_path).png.exists()
    assert figure.png.exists() and figure.vector.exists()


def test_a_year_that_cannot_be_identified_is_drawn_all_the_same(tmp_path):
    y = still(year(days=3, missing=0), 0, 1, 2)
    e = estimate(y)
    with styled():
        made = [
            theory.priors(e, 0, tmp_path),
            one_day.responses(e, 0, tmp_path),
            *bars.draw(e, tmp_path),
            delays.maps(e, tmp_path),
            delays.jmap_histograms(e, tmp_path),
            delays.search_histograms(e, tmp_path),
        ]
    assert all(f.png.stat().st_size > 0 for f in made)


def test_a_single_day_is_drawn(tmp_path):
    y = year(days=1, missing=0)
    with styled():
        made = [*hydraulics.draw(y, tmp_path), delays.maps(estimate(y), tmp_path)]
    assert all(f.vector.stat().st_size > 0 for f in made)
