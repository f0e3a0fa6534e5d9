"""Pictures: what they are drawn from against plain loops, and that nothing is cut off or overlaps."""

import datetime as dt

import matplotlib
import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from rivid.errors import RividError
from rivid.plots import style
from rivid.plots.diagnosis import KINDS, binned, heat, loop, one_day, season
from rivid.report.diagnosis_pictures import draw_pictures, drop_pictures
from tests.diagnosis.answers import BYPASS, LOCKS, diagnosis, evidence_of, gap_of, record_of
from tests.diagnosis.loops import loop_of, with_loop

EVIDENCE = evidence_of()
RIVER = evidence_of(record_of(kind="river"), amplitude=40.0)
LONG = evidence_of(record_of(days=400, n=48, gone=range(100, 140), start=dt.date(2023, 11, 20)))
LONG_NAME = "a_very_long_name_of_a_users_own_effect_$that$_nobody_{reads}_to_the_end"
CASES = {
    "explained": (diagnosis("explained"), EVIDENCE),
    "partly explained, with events": (diagnosis("partly_explained"), EVIDENCE),
    "no gap": (diagnosis("no_gap"), EVIDENCE),
    "a river": (diagnosis("partly_explained", RIVER), RIVER),
    "a river without a name": (diagnosis("unknown", RIVER), RIVER),
    "thirteen months": (diagnosis("partly_explained", LONG), LONG),
    "a closed loop": (with_loop(diagnosis("explained"), EVIDENCE.record), EVIDENCE),
    "a closed loop without a name": (with_loop(diagnosis("no_gap"), EVIDENCE.record), EVIDENCE),
    "three days": (diagnosis("explained"), evidence_of(record_of(days=3))),
    "one hundred days": (diagnosis("explained"), evidence_of(record_of(days=100, n=48))),
    "a long name": (
        diagnosis(
            "partly_explained",
            effects=(BYPASS.__class__(**{**BYPASS.__dict__, "name": LONG_NAME}), LOCKS),
            gap=gap_of(
                EVIDENCE, (BYPASS.__class__(**{**BYPASS.__dict__, "name": LONG_NAME}), LOCKS), floor=0.3
            ),
        ),
        EVIDENCE,
    ),
}


def test_the_hourly_map_holds_plain_means():
    rng = np.random.default_rng(0)
    record = EVIDENCE.record
    values = rng.standard_normal(record.output.shape)
    values[3, 40:60] = np.nan
    image = heat.hourly(values, record.hour, record.used)
    for day, hour in ((0, 0), (3, 11), (7, 23), (10, 8)):
        inside = [
            v
            for v, h, u in zip(values[day], record.hour[day], record.used[day], strict=True)
            if u and int(h) == hour and np.isfinite(v)
        ]
        expected = np.mean(inside) if inside else np.nan
        assert image[hour, day] == pytest.approx(expected, nan_ok=True)
    assert np.isnan(image[0, 0]), "the start-up of the first day does not count"


def test_missing_days_keep_their_place_in_the_map():
    dates = [dt.date(2024, 5, d) for d in (1, 2, 6)]
    image = heat.on_calendar(np.arange(72.0).reshape(24, 3), dates)
    assert image.shape == (24, 6)
    assert np.isnan(image[:, 2:5]).all()
    assert (image[:, 5] == np.arange(2, 72, 3)).all()


def test_means_by_driver_are_plain_means():
    rng = np.random.default_rng(1)
    w, u = rng.standard_normal((2, 30, 40))
    used = rng.random((30, 40)) < 0.8
    edges = binned.edges_of(u, used)
    m = binned.means(w, u, used, np.arange(30) // 3, edges)
    for k in (0, 3, len(edges) - 2):
        last = k == len(edges) - 2
        inside = used & (u >= edges[k]) & ((u <= edges[k + 1]) if last else (u < edges[k + 1]))
        assert m.mean[k] == pytest.approx(w[inside].mean())
        assert m.centre[k] == pytest.approx(u[inside].mean())


def test_intervals_of_means_cover_in_95_of_100_seasons_though_days_are_alike():
    seasons, blocks = 600, 12
    covered = np.zeros((seasons, 24))
    hour = np.tile(np.arange(24.0) + 0.5, (36, 1))
    block = np.arange(36) // 3
    for s in range(seasons):
        rng = np.random.default_rng([2, s])
        shared = rng.standard_normal((blocks, 24))[block]
        w = 0.7 + shared + 0.5 * rng.standard_normal(hour.shape)
        m = binned.means(w, hour, np.ones(hour.shape, bool), block, np.arange(25.0))
        covered[s] = (m.low <= 0.7) & (m.high >= 0.7)
    share = covered.mean()
    # hours are independent here, so all of seasons x 24 intervals count
    assert abs(share - 0.95) < 4 * np.sqrt(0.95 * 0.05 / covered.size)


def test_a_bin_that_few_blocks_have_gets_no_interval_and_a_constant_no_bins():
    w = np.ones((6, 10))
    u = np.zeros((6, 10))
    used = np.ones(w.shape, bool)
    assert len(binned.edges_of(u, used)) == 1
    m = binned.means(w, u, used, np.arange(6), binned.edges_of(u, used))
    assert m.mean.size == 0
    u[:2] = 1.0
    m = binned.means(w, u, used, np.arange(6), np.array([-0.5, 0.5, 1.5]))
    assert np.isfinite(m.low[0]) and np.isnan(m.low[1]) and m.mean[1] == 1.0
    assert np.isnan(binned.means(w, u, ~used, np.arange(6), np.array([0.0, 1.0])).mean).all()


def test_the_course_keeps_means_and_bands_and_breaks_at_gaps():
    record = EVIDENCE.record
    series = season.Series(EVIDENCE.inflow_before, EVIDENCE.inflow_before_sd)
    c = season.course(series, record.dates, record.hour, record.used)
    at = 5 * 24 + 7
    inside = record.used[5] & (np.floor(record.hour[5]) == 7)
    assert c.mean[at] == pytest.approx(EVIDENCE.inflow_before[5][inside].mean())
    assert c.high[at] - c.low[at] == pytest.approx(2 * 1.96 * 0.6)
    assert c.day[at] == pytest.approx(record.dates[5].toordinal() - 0.5 + 7.5 / 24)
    assert np.isnan(c.mean[0]), "start-up"
    long = season.course(
        season.Series(LONG.inflow_before, LONG.inflow_before_sd), LONG.record.dates, LONG.record.hour,
        LONG.record.used,
    )  # fmt: skip
    assert len(long.mean) <= season.POINTS + 24


def test_the_day_is_kept_apart_nearly_whole_and_four_fifths_up_the_errors():
    error = np.array([9.0, 1, 2, 3, 4, 5, 6, np.nan, 8])
    apart = np.array([False, True, True, True, True, True, True, True, True])
    used = np.ones((9, 10), bool)
    used[8, :5] = False
    assert one_day.choose(error, apart, used) == 5
    assert one_day.choose(error, np.zeros(9, bool), used) is None
    used[:, 1:] = False
    used[0] = True
    assert one_day.choose(error, apart, used) is not None, "days that are all short are better than none"


def test_errors_of_days_are_root_mean_squares_of_what_counts():
    used = np.array([[True, True, False], [False, False, False]])
    measured = np.array([[1.0, np.nan, 9.0], [1, 1, 1]])
    error = one_day.errors(measured, np.full((2, 3), 4.0), used)
    assert error[0] == 3.0 and np.isnan(error[1])


@pytest.mark.parametrize("name", CASES)
def test_no_text_is_cut_off_and_no_tick_labels_overlap(name, tmp_path, monkeypatch):
    seen = []
    save = style.save

    def look(figure, path):
        save(figure, path)
        renderer, edge = figure.canvas.get_renderer(), figure.bbox
        texts = [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible()]
        for axes in figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                drawn = [label for label in axis.get_ticklabels(which="both") if label.get_text().strip()]
                shown = [
                    w
                    for t in axis._update_ticks()
                    for w in (t.label1, t.label2)
                    if w.get_visible() and w.get_text()
                ]
                texts = [t for t in texts if t not in drawn or t in shown]
                boxes = [w.get_window_extent(renderer) for w in shown]
                for i, box in enumerate(boxes):
                    assert not any(box.overlaps(other) for other in boxes[:i]), f"{path.name}: {shown[i]}"
        boxes = []
        for text in texts:
            box = text.get_window_extent(renderer)
            where = f"{path.name}: {text.get_text()!r} at {box.extents} in {edge.extents}"
            assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= edge.x1 and box.y1 <= edge.y1, where
            for other, words in boxes:
                assert not box.overlaps(other), f"{where} lies over {words!r}"
            boxes.append((box, text.get_text()))
        seen.append(path.name)

    monkeypatch.setattr(style, "save", look)
    answer, evidence = CASES[name]
    files = draw_pictures(tmp_path, answer, evidence)
    assert sorted(seen) == sorted(f.path.name for f in files) and seen
    assert {f.kind for f in files} <= set(KINDS)


def test_each_picture_is_small_of_the_stated_size_and_the_same_twice(tmp_path):
    files = draw_pictures(tmp_path / "a", *CASES["explained"])
    with matplotlib.rc_context({"font.size": 20, "axes.facecolor": "red"}):
        again = draw_pictures(tmp_path / "b", *CASES["explained"])
    assert [f.kind for f in files] == ["diagnosis_gap", "diagnosis_day", "diagnosis_map", "diagnosis_inflow"]
    for one, two in zip(files, again, strict=True):
        assert one.path.read_bytes() == two.path.read_bytes()
        assert one.path.stat().st_size < 200_000
        with Image.open(one.path) as image:
            assert image.size == (one.width, one.height)
            assert image.convert("RGB").getpixel((0, 0)) == (255, 255, 255)


def test_the_picture_of_the_inflow_shows_the_amplitude_that_was_planted():
    record = EVIDENCE.record
    m = binned.means(EVIDENCE.inflow_before, record.hour, record.used, EVIDENCE.split.block, np.arange(25.0))
    expected = 6.0 * np.cos(2 * np.pi * (m.centre - 4.0) / 24)
    half = (m.high - m.low) / 2
    assert (np.abs(m.mean - expected) < 2.5 * half).all()


def test_without_named_effects_there_is_one_curve_and_one_map(tmp_path):
    files = {f.kind: f for f in draw_pictures(tmp_path, *CASES["no gap"])}
    assert "right one" not in files["diagnosis_map"].caption
    assert "blue: with them" not in files["diagnosis_inflow"].caption
    assert files["diagnosis_inflow"].height < 900


def test_a_river_speaks_of_discharge_and_has_no_outflow(tmp_path, monkeypatch):
    words = []
    save = style.save

    def look(figure, path):
        save(figure, path)
        words.extend(t.get_text() for t in figure.findobj(Text))

    monkeypatch.setattr(style, "save", look)
    draw_pictures(tmp_path, *CASES["a river"])
    said = " ".join(words)
    assert "discharge at the lower end [m³/s]" in said and "error [m³/s]" in said
    assert "level" not in said and "outflow" not in said and "mm" not in said


def test_the_closed_loop_is_drawn_from_its_day_with_two_or_three_curves(tmp_path, monkeypatch):
    seen = []
    save = style.save

    def look(figure, path):
        save(figure, path)
        if path.name == "diagnosis_loop.png":
            seen.append(figure)

    monkeypatch.setattr(style, "save", look)
    day = loop_of(EVIDENCE.record).shown
    for name, curves in (("a closed loop", 3), ("a closed loop without a name", 2)):
        files = draw_pictures(tmp_path, *CASES[name])
        assert [f.kind for f in files][:2] == ["diagnosis_gap", "diagnosis_loop"]
        upper, lower, lowest = seen[-1].axes
        assert [len(axes.lines) for axes in (upper, lower, lowest)] == [curves, curves + 1, curves]
        for line, values in zip(upper.lines, day.level, strict=False):
            assert np.array_equal(line.get_ydata(), values, equal_nan=True)
        assert np.array_equal(lower.lines[0].get_ydata(), day.inflow, equal_nan=True)
        assert ("with the named effects" in " ".join(t.get_text() for t in seen[-1].texts)) == (curves == 3)
    (off, hour) = (np.array(v) for v in (day.outflow[1], day.hour))
    off = off - np.array(day.outflow[0])
    mean = loop.hourly(off, hour)
    for k in (0, 40, len(off) - 1):
        near = np.abs(hour - hour[k]) <= 0.5
        assert mean[k] == pytest.approx(np.nanmean(off[near]))
    off[40] = np.nan
    assert np.isnan(loop.hourly(off, hour)[40]) and np.isfinite(loop.hourly(off, hour)[41])


def test_pictures_of_an_earlier_diagnosis_go_and_others_stay(tmp_path):
    files = draw_pictures(tmp_path, *CASES["explained"])
    (tmp_path / "figures" / "tdr_ml.png").write_bytes(b"x")
    drop_pictures(tmp_path, files[:1])
    assert sorted(p.name for p in (tmp_path / "figures").iterdir()) == ["diagnosis_gap.png", "tdr_ml.png"]


def test_a_gap_without_numbers_and_no_evidence_draw_nothing(tmp_path):
    nan = (float("nan"),) * 3
    gap = gap_of(EVIDENCE)
    gap = gap.__class__(**{**gap.__dict__, "rmse_baseline": nan})
    assert draw_pictures(tmp_path, diagnosis("no_gap", gap=gap), None) == []
    assert draw_pictures(tmp_path, diagnosis("insufficient_data"), None) == []


def test_a_folder_that_cannot_be_written_is_said_in_one_line(tmp_path):
    (tmp_path / "figures").write_text("in the way")
    with pytest.raises(RividError, match="cannot write") as error:
        draw_pictures(tmp_path, *CASES["no gap"])
    assert "\n" not in str(error.value)
