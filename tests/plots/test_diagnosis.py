"""Test the figures of a diagnosis: their numbers against plain loops, and that all texts are readable."""

import dataclasses
import datetime as dt
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from rivid.errors import RividError
from rivid.plots import diagnosis as plots
from rivid.plots import style
from rivid.report.diagnosis import draw_pictures
from rivid.report.page import caption
from tests.diagnosis.answers import BYPASS, LOCKS, diagnosis, evidence_of, gap_of, record_of
from tests.diagnosis.loops import loop_of, with_loop
from tests.plots.layout import as_file, check, saved

EVIDENCE = evidence_of()
RECORD = EVIDENCE.record
RIVER = evidence_of(record_of(kind="river"), amplitude=40.0)
LONG = evidence_of(record_of(days=400, n=48, gone=range(100, 140), start=dt.date(2023, 11, 20)))
LONG_NAMED = (dataclasses.replace(BYPASS, name="a_very_long_name_of_an_effect_$that$_is_{cut}_here"), LOCKS)
CASES = {
    "events": (diagnosis("partly_explained"), EVIDENCE),
    "no gap": (diagnosis("no_gap"), EVIDENCE),
    "a river": (diagnosis("partly_explained", RIVER), RIVER),
    "thirteen months": (diagnosis("partly_explained", LONG), LONG),
    "a closed loop": (with_loop(diagnosis("explained"), RECORD), EVIDENCE),
    "a closed loop without a name": (with_loop(diagnosis("no_gap"), RECORD), EVIDENCE),
    "three days": (diagnosis("explained"), evidence_of(record_of(days=3))),
    "a long name": (
        diagnosis("partly_explained", effects=LONG_NAMED, gap=gap_of(EVIDENCE, LONG_NAMED, floor=0.3)),
        EVIDENCE,
    ),
}

LONG_CASES = (
    "thirteen months", "three days", "no gap", "a closed loop", "a closed loop without a name",
)  # fmt: skip
"""Cases of `make test-long`."""


@pytest.fixture(scope="module")
def drawn():
    """Return records and figures of a case, drawn once and not written."""
    made = {}

    def of(name):
        if name not in made:
            with saved() as figures:
                made[name] = draw_pictures(Path("out"), *CASES[name]), figures
        return made[name]

    return of


# The numbers


def test_the_hourly_map_holds_plain_means_at_their_place_in_the_calendar():
    values = np.random.default_rng(0).standard_normal(RECORD.output.shape)
    values[3, 40:60] = np.nan
    dates = list(RECORD.dates)
    dates[4:] = [date + dt.timedelta(days=2) for date in dates[4:]]
    image = plots.hourly_map(values, RECORD.hour, RECORD.used, dates)
    assert image.shape == (24, (dates[-1] - dates[0]).days + 1) and np.isnan(image[:, 4:6]).all()
    for day, hour in ((0, 0), (3, 11), (7, 23), (10, 8)):
        inside = RECORD.used[day] & (np.floor(RECORD.hour[day] + 1e-9) == hour) & np.isfinite(values[day])
        expected = values[day][inside].mean() if inside.any() else np.nan
        assert image[hour, (dates[day] - dates[0]).days] == pytest.approx(expected, nan_ok=True)
    assert np.isnan(image[0, 0]), "the start-up of the first day is not valid"


def test_means_by_driver_are_plain_means():
    rng = np.random.default_rng(1)
    w, u = rng.standard_normal((2, 30, 40))
    used = rng.random((30, 40)) < 0.8
    edges = plots.edges_of(u, used)
    centre, mean, _ = plots.means(w, u, used, np.arange(30) // 3, edges)
    for k in (0, 3, len(edges) - 2):
        last = k == len(edges) - 2
        inside = used & (u >= edges[k]) & ((u <= edges[k + 1]) if last else (u < edges[k + 1]))
        assert mean[k] == pytest.approx(w[inside].mean())
        assert centre[k] == pytest.approx(u[inside].mean())


def test_intervals_of_means_cover_in_95_of_100_seasons_though_days_are_alike():
    seasons, blocks = 400, 12
    covered = np.zeros((seasons, 24))
    hour = np.tile(np.arange(24.0) + 0.5, (36, 1))
    block = np.arange(36) // 3
    for s in range(seasons):
        rng = np.random.default_rng([2, s])
        w = 0.7 + rng.standard_normal((blocks, 24))[block] + 0.5 * rng.standard_normal(hour.shape)
        _, mean, half = plots.means(w, hour, np.ones(hour.shape, bool), block, np.arange(25.0))
        covered[s] = np.abs(mean - 0.7) <= half
    # hours are independent here, so all seasons x 24 intervals count
    assert abs(covered.mean() - 0.95) < 4 * np.sqrt(0.95 * 0.05 / covered.size)


def test_a_bin_with_few_blocks_has_no_interval_and_a_constant_no_bins():
    w, u, used, block = np.ones((6, 10)), np.zeros((6, 10)), np.ones((6, 10), bool), np.arange(6)
    assert len(plots.edges_of(u, used)) == 1
    assert plots.means(w, u, used, block, plots.edges_of(u, used))[1].size == 0
    u[:2] = 1.0
    _, mean, half = plots.means(w, u, used, block, np.array([-0.5, 0.5, 1.5]))
    assert np.isfinite(half[0]) and np.isnan(half[1]) and mean[1] == 1.0
    assert np.isnan(plots.means(w, u, ~used, block, np.array([0.0, 1.0]))[1]).all()


def test_the_course_has_means_and_bands_and_breaks_at_gaps():
    day, mean, half, hours = plots.course(
        EVIDENCE.inflow_before, EVIDENCE.inflow_before_sd, RECORD.dates, RECORD.hour, RECORD.used
    )
    at = 5 * 24 + 7
    inside = RECORD.used[5] & (np.floor(RECORD.hour[5]) == 7)
    assert mean[at] == pytest.approx(EVIDENCE.inflow_before[5][inside].mean())
    assert half[at] == pytest.approx(1.96 * 0.6) and hours == 1
    assert day[at] == pytest.approx(RECORD.dates[5].toordinal() - 0.5 + 7.5 / 24)
    assert np.isnan(mean[0]), "start-up"
    r = LONG.record
    long = plots.course(LONG.inflow_before, LONG.inflow_before_sd, r.dates, r.hour, r.used)
    assert len(long[1]) <= plots.POINTS + 24 and long[3] > 1


def test_the_day_is_nearly_whole_and_four_fifths_up_the_errors():
    error = np.array([9.0, 1, 2, 3, 4, 5, 6, np.nan, 8])
    apart = np.array([False, True, True, True, True, True, True, True, True])
    used = np.ones((9, 10), bool)
    used[8, :5] = False
    assert plots.choose(error, apart, used) == 5
    assert plots.choose(error, np.zeros(9, bool), used) is None
    used[:, 1:] = False
    used[0] = True
    assert plots.choose(error, apart, used) is not None, "where all days are short, one of them is shown"


def test_errors_of_days_are_root_mean_squares_of_valid_samples():
    used = np.array([[True, True, False], [False, False, False]])
    measured = np.array([[1.0, np.nan, 9.0], [1, 1, 1]])
    error = plots.errors(measured, np.full((2, 3), 4.0), used)
    assert error[0] == 3.0 and np.isnan(error[1])


def test_the_mean_of_the_hour_about_a_sample_is_a_plain_mean():
    hour = np.arange(0, 24, 0.25)
    values = np.random.default_rng(4).standard_normal(len(hour))
    values[40] = np.nan
    mean = plots.hourly(values, hour)
    for k in (0, 41, len(hour) - 1):
        assert mean[k] == pytest.approx(np.nanmean(values[np.abs(hour - hour[k]) <= 0.5]))
    assert np.isnan(mean[40])


# The figures


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.long) if n in LONG_CASES else n for n in CASES]
)
def test_no_text_is_cut_off_and_no_texts_overlap(name, drawn):
    files, figures = drawn(name)
    assert sorted(figures) == sorted(f.path.stem for f in files) and set(figures) <= set(plots.KINDS)
    for stem, figure in figures.items():
        boxes = check(figure, f"{name}: {stem}")
        for i, (box, words) in enumerate(boxes):
            for other, others in boxes[:i]:
                assert not box.overlaps(other), f"{name}: {stem}: {words!r} lies over {others!r}"


def test_the_files_are_small_of_the_stated_size_and_the_same_twice(drawn, tmp_path):
    kinds = [f.kind for f in drawn("events")[0]]
    assert kinds == ["diagnosis_gap", "diagnosis_day", "diagnosis_map", "diagnosis_inflow"]
    with style.styled():
        one = plots.draw_map(tmp_path / "a", EVIDENCE, named=True)
        two = plots.draw_map(tmp_path / "b", EVIDENCE, named=True)
    assert one.path.read_bytes() == two.path.read_bytes() and one.path.stat().st_size < 200_000
    with Image.open(one.path) as image:
        assert image.size == (one.width, one.height)
        assert image.convert("RGB").getpixel((0, 0)) == (255, 255, 255)


def test_the_bars_of_the_gap_are_the_errors_of_each_step(drawn):
    gap = CASES["events"][0].gap
    expected = [gap.rmse_baseline]
    for step in gap.steps:
        expected += [step.rmse] + ([step.rmse_described] if step.rmse_described is not None else [])
    for i, ax in enumerate(drawn("events")[1]["diagnosis_gap"].axes):
        widths = [bars[0].get_width() for bars in ax.containers]
        assert widths == pytest.approx([1000 * e[i] for e in expected])


def test_the_figure_of_the_inflow_shows_the_planted_amplitude(drawn):
    ax = drawn("events")[1]["diagnosis_inflow"].axes[2]
    hour, mean = next(line.get_data() for line in ax.lines if len(line.get_xdata()) == 24)
    _, _, half = plots.means(
        EVIDENCE.inflow_before, RECORD.hour, RECORD.used, EVIDENCE.split.block, np.arange(25.0)
    )
    assert (np.abs(mean - 6.0 * np.cos(2 * np.pi * (hour - 4.0) / 24)) < 2.5 * half).all()


def test_without_named_effects_there_is_one_curve_and_one_map(drawn):
    one, two = drawn("no gap"), drawn("events")
    kinds = ("diagnosis_map", "diagnosis_inflow")
    counts = [[len(figures[kind].axes) for kind in kinds] for _, figures in (one, two)]
    assert counts == [[2, 5], [3, 6]]
    captions = [{f.kind: caption(f) for f in files} for files, _ in (one, two)]
    assert "right one" not in captions[0]["diagnosis_map"] and "right one" in captions[1]["diagnosis_map"]
    for texts in captions:  # a number of days, and a word if it is 0
        assert re.search(r"On (none|[1-9]\d*) of the \d+ days kept apart", texts["diagnosis_day"])


def test_a_river_has_a_discharge_and_no_level_or_outflow(drawn):
    figures = drawn("a river")[1].values()
    words = " ".join(text.get_text() for figure in figures for text in figure.findobj(Text))
    assert "discharge at the lower end [m³/s]" in words and "error [m³/s]" in words
    assert "level" not in words and "outflow" not in words and "mm" not in words


@pytest.mark.parametrize(("named", "curves"), [(True, 3), (False, 2)])
def test_the_closed_loop_is_drawn_from_its_day(named, curves, tmp_path):
    day = loop_of(RECORD).shown
    with style.styled(), saved() as figures:
        plots.draw_loop(tmp_path, day, "words", named=named)
    upper, lower, lowest = figures["diagnosis_loop"].axes
    assert [len(ax.lines) for ax in (upper, lower, lowest)] == [curves, curves + 1, curves]
    for line, values in zip(upper.lines, day.level, strict=False):
        assert np.array_equal(line.get_ydata(), values, equal_nan=True)
    assert np.array_equal(lower.lines[0].get_ydata(), day.inflow, equal_nan=True)
    off = np.array(day.outflow[1]) - np.array(day.outflow[0])
    expected = plots.hourly(off, np.array(day.hour))
    assert np.array_equal(lowest.lines[1].get_ydata(), expected, equal_nan=True)


def test_figures_of_an_earlier_diagnosis_go_and_others_stay(tmp_path):
    (tmp_path / "figures").mkdir()
    for name in ("diagnosis_map", "diagnosis_gap", "tdr_ml"):
        (tmp_path / "figures" / f"{name}.png").write_bytes(b"x")
    style.drop_old(tmp_path / "figures", [as_file(tmp_path / "figures" / "diagnosis_map.png")], plots.KINDS)
    assert {p.stem for p in (tmp_path / "figures").iterdir()} == {"diagnosis_map", "tdr_ml"}


def test_a_gap_without_numbers_and_no_evidence_draw_nothing(tmp_path):
    gap = dataclasses.replace(gap_of(EVIDENCE), rmse_baseline=(float("nan"),) * 3)
    assert draw_pictures(tmp_path, diagnosis("no_gap", gap=gap), None) == []
    assert draw_pictures(tmp_path, diagnosis("insufficient_data"), None) == []


def test_a_folder_that_cannot_be_written_is_named_in_one_line(tmp_path):
    (tmp_path / "figures").write_text("in the way")
    with pytest.raises(RividError, match="cannot write") as error:
        draw_pictures(tmp_path, *CASES["no gap"])
    assert "\n" not in str(error.value)
