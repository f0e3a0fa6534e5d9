"""All figures of a run: which files, the same bytes, nothing cut off."""

import subprocess
import sys

import matplotlib
import pytest
from matplotlib.text import Text
from PIL import Image

from rivid.errors import ConfigError, RividError
from rivid.plots import style
from rivid.plots.draw import draw_all
from tests.plots.synthetic import cases, dates_of, results

CASES = cases()


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    out = tmp_path_factory.mktemp("year")
    return out, draw_all(CASES["a year"], out)


def test_an_estimator_with_delays_has_four_figures_and_one_without_has_its_image(year):
    out, files = year
    four = ("tdr", "histogram", "delay_map", "delay_discharge")
    expected = ["tdr_ml", "tdr_map"] + [f"{k}_{e}" for e in ("jmap", "jmap-degenerate") for k in four]
    assert [f.path for f in files] == [out / "figures" / f"{n}.png" for n in [*expected, "fir_day"]]
    assert sorted(p.name for p in (out / "figures").iterdir()) == sorted(f.path.name for f in files)


def test_each_file_is_a_small_image_of_the_stated_size_without_metadata(year):
    for file in year[1]:
        with Image.open(file.path) as image:
            assert image.size == (file.width, file.height)
            assert not image.info.keys() & {"Software", "Creation Time", "date", "Title"}
            assert image.convert("RGB").getpixel((0, 0)) == (255, 255, 255)
        assert file.path.stat().st_size < 100_000, file.path.name


def test_the_same_results_give_the_same_bytes_whatever_the_users_matplotlibrc(year, tmp_path):
    with matplotlib.rc_context({"font.size": 20, "axes.facecolor": "red", "savefig.dpi": 300}):
        again = draw_all(CASES["a year"], tmp_path)
        assert matplotlib.rcParams["font.size"] == 20, "the caller's settings must come back"
    for first, second in zip(year[1], again, strict=True):
        assert first.path.read_bytes() == second.path.read_bytes(), first.path.name


@pytest.mark.parametrize("name", CASES)
def test_no_text_is_cut_off_and_no_tick_labels_overlap(name, tmp_path, monkeypatch):
    seen = []
    save = style.save

    def look(figure, path):
        save(figure, path)
        renderer = figure.canvas.get_renderer()
        edge = figure.bbox
        texts = [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible()]
        for axes in figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                drawn = [label for label in axis.get_ticklabels(which="both") if label.get_text().strip()]
                inside = [t for t in axis._update_ticks()]
                shown = [w for t in inside for w in (t.label1, t.label2) if w.get_visible() and w.get_text()]
                texts = [t for t in texts if t not in drawn or t in shown]
                boxes = [w.get_window_extent(renderer) for w in shown]
                for i, box in enumerate(boxes):
                    assert not any(box.overlaps(other) for other in boxes[:i]), f"{path.name}: {shown[i]}"
        for text in texts:
            box = text.get_window_extent(renderer)
            where = f"{path.name}: {text.get_text()!r} at {box.extents} in {edge.extents}"
            assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= edge.x1 and box.y1 <= edge.y1, where
        for legend in figure.findobj(matplotlib.legend.Legend):
            box = legend.get_window_extent(renderer)
            assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= edge.x1, f"{path.name}: legend {box.extents}"
        seen.append(path.name)

    monkeypatch.setattr(style, "save", look)
    files = draw_all(CASES[name], tmp_path)
    assert seen == [f.path.name for f in files] and seen


def test_a_run_without_an_answer_is_still_drawn_and_says_so(tmp_path):
    files = draw_all(CASES["all days failed"], tmp_path)
    assert [f.kind for f in files] == ["tdr", "histogram", "delay_map", "delay_discharge"]


def test_figures_of_an_estimator_that_left_the_run_go_and_others_files_stay(tmp_path):
    draw_all(results(("jmap", "jmap-uniform"), dates_of(5)), tmp_path)
    theirs = tmp_path / "figures" / "diagnosis_fit.png"
    theirs.write_bytes(b"x")
    draw_all(results(("jmap",), dates_of(5)), tmp_path)
    names = {p.name for p in (tmp_path / "figures").iterdir()}
    assert "tdr_jmap.png" in names and "diagnosis_fit.png" in names
    assert not any("jmap-uniform" in name for name in names)


def test_a_day_that_is_not_there_is_an_error_that_says_what_to_do(tmp_path):
    import datetime as dt

    with pytest.raises(ConfigError, match="1999-01-01.*choose a day"):
        draw_all(results(("jmap",), dates_of(5)), tmp_path, day=dt.date(1999, 1, 1))


def test_a_folder_that_cannot_be_written_is_said_in_one_line(tmp_path):
    (tmp_path / "figures").write_text("in the way")
    with pytest.raises(RividError, match="cannot write") as error:
        draw_all(results(("jmap",), dates_of(2)), tmp_path)
    assert "\n" not in str(error.value)


def test_importing_the_package_loads_no_matplotlib():
    code = (
        "import sys, rivid.plots.draw, rivid.report.build\n"
        "print(sorted({'matplotlib', 'jinja2'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
