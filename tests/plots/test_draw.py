"""Test all figures of a run: files, equal bytes, readable texts, and captions of the shown data."""

import dataclasses
import datetime as dt
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from PIL import Image

from rivid.errors import ConfigError, RividError
from rivid.plots import style
from rivid.plots.draw import KINDS, draw, jobs, typical_day
from rivid.report.page import caption
from tests.plots.layout import as_file, check, labels, saved
from tests.plots.synthetic import cases, dates_of, draw_all, probable, results, river, without_answers

CASES = cases() | {"a year": results()}
LONG = (
    "a week", "five years", "a river, one day", "a river, a year", "a river, all days failed",
    "long names", "probabilities", "one day", "twelve days over new year",
)  # fmt: skip
"""Cases of `make test-long`."""


@pytest.fixture(scope="module")
def drawn():
    """Return records and figures of a case, drawn once and not written."""
    made = {}

    def of(name):
        if name not in made:
            with saved() as figures:
                made[name] = draw_all(CASES[name], Path("out")), figures
        return made[name]

    return of


def test_an_estimator_with_delays_has_four_figures_and_one_without_has_its_image(drawn):
    four = ["tdr", "histogram", "delay_map", "delay_discharge"]
    expected = [("tdr", "ml"), *((kind, "jmap") for kind in four), ("fir_day", "")]
    assert jobs(CASES["a year"]) == expected
    files = drawn("a year")[0]
    assert [(f.kind, f.estimator) for f in files] == expected
    names = [f"{kind}_{name}.png" if name else f"{kind}.png" for kind, name in expected]
    assert [f.path for f in files] == [Path("out", "figures", name) for name in names]
    assert [f.kind for f in drawn("all days failed")[0]] == four
    assert [job for job in jobs(CASES["a river"]) if "t50" in job[0]] == [
        ("t50", "map"),
        ("t50_discharge", "map"),
    ]


def test_each_file_is_small_of_the_stated_size_and_independent_of_the_users_matplotlibrc(tmp_path):
    file = draw(CASES["a year"], ("tdr", "jmap"), tmp_path / "a")
    with matplotlib.rc_context({"font.size": 20, "axes.facecolor": "red", "savefig.dpi": 300}):
        again = draw(CASES["a year"], ("tdr", "jmap"), tmp_path / "b")
        assert matplotlib.rcParams["font.size"] == 20, "the caller's settings return"
    assert file.path.read_bytes() == again.path.read_bytes() and file.path.stat().st_size < 100_000
    with Image.open(file.path) as image:
        assert image.size == (file.width, file.height)
        assert image.convert("RGB").getpixel((0, 0)) == (255, 255, 255)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long) if n in LONG else n for n in CASES])
def test_no_text_is_cut_off_and_no_tick_labels_overlap(name, drawn):
    files, figures = drawn(name)
    assert sorted(figures) == sorted(f.path.stem for f in files)
    for stem, figure in figures.items():
        check(figure, f"{name}: {stem}")


def test_figures_of_an_estimator_that_left_the_run_go_and_other_files_stay(tmp_path):
    for name in ("tdr_jmap", "tdr_jmap-uniform", "fir_day", "diagnosis_fit"):
        (tmp_path / f"{name}.png").write_bytes(b"x")
    style.drop_old(tmp_path, [as_file(tmp_path / "tdr_jmap.png")], KINDS)
    assert {p.stem for p in tmp_path.iterdir()} == {"tdr_jmap", "diagnosis_fit"}


def test_an_estimator_without_responses_or_checks_claims_neither(tmp_path):
    e = dataclasses.replace(
        results(("direct",), dates_of(60)).estimators[0], fir=np.empty((60, 0)), prior_only=np.zeros(60, bool)
    )
    run = dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[e])
    with saved() as figures:
        files = draw_all(run, tmp_path)
    assert [f.kind for f in files] == ["histogram", "delay_map", "delay_discharge"]
    n, edge = int(np.isfinite(e.delay).sum()), int(e.at_bound.sum())
    assert labels(figures["histogram_direct"])[0] == f"delay ({n})"
    for kind in ("delay_map", "delay_discharge"):
        shown = labels(figures[f"{kind}_direct"])
        assert shown[0].startswith("delay (") and f"at a bound ({edge})" in shown
    assert not any("the data alone" in caption(f) for f in files)


def test_captions_name_what_is_shown(drawn, tmp_path):
    pool, water = (
        {(f.kind, f.estimator): caption(f) for f in drawn(name)[0]} for name in ("a year", "a river")
    )
    assert not any("river" in text for text in pool.values())
    assert "the data alone" in pool["histogram", "jmap"]
    for kind in ("histogram", "delay_map", "delay_discharge"):
        assert "a dispersive river has none" in water[kind, "jmap"]
    assert "half of a step" in water["tdr", "map"] and "a faster wave" in water["t50_discharge", "map"]
    cusum = dataclasses.replace(river(3, ("jmap",)).estimators[0], estimator="cusum-ml")
    run = dataclasses.replace(river(3, ("jmap",)), estimators=[cusum])
    with saved():
        texts = [caption(draw(run, job, tmp_path)) for job in (("histogram", "cusum-ml"), ("fir_day", ""))]
    assert all("CUSUM" in text for text in texts)
    sure = {f.kind: caption(f) for f in drawn("probabilities")[0]}
    assert "90 % of the probability" in sure["tdr"] and "two standard deviations" in sure["fir_day"]
    assert not any("the data alone" in text for text in sure.values())


def test_the_note_of_a_day_names_delay_and_probability(tmp_path):
    run = probable()
    e = run.estimators[0]
    with saved() as figures:
        draw(run, ("fir_day", ""), tmp_path, day=e.dates[0])
    note = " ".join(text.get_text() for text in figures["fir_day"].axes[0].texts)
    assert f"d = {e.delay[0]:.0f} samples" in note and f"probability {e.probability[0]:.2f}" in note


# The day that is shown


def test_the_typical_day_is_answered_by_most_of_median_delay_and_condition():
    run = results(("ml", "jmap"), dates_of(5), unanswered=0)
    made, delay = [], np.full(5, 7.0)
    for e in run.estimators:
        status = ["unidentifiable" if e.estimator == "jmap" else "ok", *["ok"] * 4]
        condition = np.array([5e4, 9e4, 1e4, 5e4, 6e4])
        made.append(dataclasses.replace(e, status=status, condition=condition, delay=delay))
        made[-1].fir[:] = 1.0
    run = dataclasses.replace(run, estimators=made)
    assert typical_day(run) == dt.date(2008, 1, 4)  # of 9e4, 1e4, 5e4, 6e4 the nearest to their median
    delay[3] = 6.0
    assert typical_day(run) == dt.date(2008, 1, 5)
    assert typical_day(without_answers(results(("jmap",), dates_of(3)))) is None


def test_the_typical_day_does_not_depend_on_an_estimator_without_condition_number():
    jmap = results(("jmap",), dates_of(30), unanswered=0)
    e = probable(unsure=(), unseen=()).estimators[0]
    both = dataclasses.replace(jmap, estimators=[e, *jmap.estimators])
    assert typical_day(both) == typical_day(jmap)


def test_a_chosen_day_is_drawn_and_one_without_a_response_is_an_error(tmp_path):
    run = results(("ml", "map", "jmap"), dates_of(9), unanswered=0)
    with saved():
        file = draw(run, ("fir_day", ""), tmp_path, day=dt.date(2008, 1, 5))
    assert file.kind == "fir_day" and "2008-01-05" in file.title
    with pytest.raises(ConfigError, match=r"1999-01-01.*choose a day"):
        draw(run, ("fir_day", ""), tmp_path, day=dt.date(1999, 1, 1))


def test_a_folder_that_cannot_be_written_is_named_in_one_line(tmp_path):
    (tmp_path / "figures").write_text("in the way")
    with pytest.raises(RividError, match="cannot write") as error:
        draw_all(results(("jmap",), dates_of(2)), tmp_path)
    assert "\n" not in str(error.value)


def test_the_modules_of_the_parent_of_the_drawing_workers_load_no_matplotlib():
    code = "import sys, rivid.run.drawing; sys.exit(len({'matplotlib', 'jinja2'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
