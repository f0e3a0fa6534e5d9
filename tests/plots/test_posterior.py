"""Figures and words for an estimator that gives each delay a probability."""

import dataclasses

import numpy as np
import pytest
from PIL import Image

from rivid.plots import delay_map, fir_day, style
from rivid.plots.draw import draw_all
from tests.plots.synthetic import CANDIDATES, dates_of, estimator, results

REASON = "no delay is right with a probability of 0.7"


def probable(n=30, unsure=(3, 4, 20), unseen=(9,)):
    """Days of delays 6 and 7 with p(d | y) on three candidates; some unsure, some without a front."""
    rng = np.random.default_rng(8)
    e = estimator("posterior", dates_of(n), unanswered=0)
    delay = rng.integers(6, 8, n).astype(float)
    p = np.zeros((n, len(CANDIDATES)))
    for i, d in enumerate(delay.astype(int)):
        share = 0.55 if i in unsure else rng.uniform(0.75, 0.999)
        p[i, [d - 1, d, d - 2]] = share, 0.8 * (1 - share), 0.2 * (1 - share)
    right = p.max(axis=1)
    low, high = delay - (right < 0.8), delay + (right < 0.9)
    status, messages = ["ok"] * n, [""] * n
    for days, reason in ((unsure, REASON), (unseen, "no front is seen")):
        for i in days:
            status[i], messages[i] = "unidentifiable", reason
    p[list(unseen)] = right[list(unseen)] = np.nan
    gone = np.array([s != "ok" for s in status])
    fir, delay = e.fir.copy(), np.where(gone, np.nan, delay)
    fir[gone] = np.nan
    nothing = np.full(n, np.nan)
    e = dataclasses.replace(
        e, status=status, messages=messages, delay=delay, fir=fir, probability=right, delay_low=low,
        fir_sd=np.where(gone[:, None], np.nan, 1e-5) * np.ones_like(fir), delay_high=high, criterion=p,
        at_bound=np.zeros(n, bool), prior_only=np.zeros(n, bool), alpha=nothing, noise_sd=nothing,
        roughness_sd=nothing, condition=nothing, bound_gravity_s=np.full(n, 1000.0),
    )  # fmt: skip
    return dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[e])


@pytest.fixture
def looks(monkeypatch):
    """The figures that were saved, by name."""
    kept = {}
    save = style.save

    def look(figure, path):
        save(figure, path)
        kept[path.stem] = figure

    monkeypatch.setattr(style, "save", look)
    return kept


def legend(figure):
    return [text.get_text() for axes in figure.axes if (one := axes.get_legend()) for text in one.get_texts()]


def test_cells_of_the_delay_map_are_the_probabilities_in_their_places(tmp_path, looks):
    run = probable()
    e = dataclasses.replace(run.estimators[0], dates=[d for d in dates_of(32) if d.day not in (6, 7)][:30])
    with style.styled():
        delay_map.draw(run, e, tmp_path)
    axes = looks["delay_map_posterior"].axes[0]
    (image,) = axes.get_images()
    alpha, extent = np.asarray(image.get_array())[..., 3], image.get_extent()
    first = e.dates[0].toordinal()
    assert alpha.shape == (15, e.dates[-1].toordinal() - first + 1)
    assert extent == [first - 0.5, e.dates[-1].toordinal() + 0.5, 0.5, 15.5]
    shown = np.zeros(alpha.shape[1], bool)
    for i, date in enumerate(e.dates):
        shown[date.toordinal() - first] = True
        expected = np.nan_to_num(e.criterion[i]) * delay_map.DARKEST
        np.testing.assert_allclose(alpha[:, date.toordinal() - first], expected)
    assert (alpha[:, ~shown] == 0).all() and (~shown).sum() == 2
    low, high = axes.get_ylim()
    assert low < 0.5 and high > 15.5, "the cells do not crop the axis"


def test_legends_name_what_is_drawn(tmp_path, looks):
    run = probable()
    e = run.estimators[0]
    files = {file.kind: file for file in draw_all(run, tmp_path)}
    wide = int(((e.delay_high > e.delay_low) & np.isfinite(e.delay)).sum())
    assert wide > 0
    assert legend(looks["tdr_posterior"])[:2] == ["delay d", f"90 % set, where wider ({wide})"]
    assert legend(looks["delay_map_posterior"])[0] == "delay (26)"
    assert legend(looks["histogram_posterior"]) == ["delay (26)", "mean probability (29 days)"]
    assert "hold 90 % of the probability" in files["tdr"].caption
    assert "Grey cells are the probability" in files["delay_map"].caption
    assert not any("the data alone" in file.caption for file in files.values())


def test_the_line_of_the_histogram_is_the_mean_probability(tmp_path, looks):
    run = probable()
    draw_all(run, tmp_path)
    lines = looks["histogram_posterior"].axes[0].get_lines()
    mean = np.nanmean(run.estimators[0].criterion, axis=0)
    assert any(np.allclose(line.get_ydata(), 100 * mean) for line in lines if len(line.get_ydata()) == 15)
    assert mean.sum() == pytest.approx(1)


def test_the_upright_lines_of_the_time_day_representation_join_the_ends_of_the_set(tmp_path, looks):
    run = probable()
    e = run.estimators[0]
    draw_all(run, tmp_path)
    drawn = {
        tuple(np.round(path.vertices[:, 1], 9))
        for one in looks["tdr_posterior"].axes[0].collections
        for path in one.get_paths()
        if len(path.vertices) == 2 and path.vertices[0, 0] == path.vertices[1, 0]
    }
    days = np.isfinite(e.delay) & (e.delay_high > e.delay_low)
    assert drawn == set(zip(e.delay_low[days], e.delay_high[days], strict=True))


def test_the_responses_of_a_day_have_a_band_and_a_probability(tmp_path, looks):
    run = probable()
    e = run.estimators[0]
    with style.styled():
        file = fir_day.draw(run, tmp_path, day=e.dates[0])
    panel = looks["fir_day"].axes[0]
    (band,) = [c for c in panel.collections if len(c.get_paths()[0].vertices) > 30]
    assert np.ptp(band.get_paths()[0].vertices[:, 1]) >= np.ptp(e.fir[0]) + 4e-5 * 0.99
    assert any(f"probability {e.probability[0]:.2f}" in text.get_text() for text in panel.texts)
    assert "two standard deviations" in file.caption and "the outflow is held" in file.caption
    plain = fir_day.draw(results(("jmap",), dates_of(5), unanswered=0), tmp_path)
    assert "two standard deviations" not in plain.caption


def test_the_typical_day_does_not_hang_on_who_has_no_condition_number():
    jmap = results(("jmap",), dates_of(30), unanswered=0)
    e = dataclasses.replace(probable(unsure=(), unseen=()).estimators[0])
    beside = dataclasses.replace(jmap, estimators=[e, *jmap.estimators])
    assert fir_day.typical_day(beside) == fir_day.typical_day(jmap)


def test_pictures_of_every_length_of_record_can_be_drawn(tmp_path):
    for n in (1, 5, 400):
        kept = () if n == 1 else (0, n - 1)
        files = draw_all(probable(n, unsure=kept, unseen=()), tmp_path / str(n))
        assert [file.kind for file in files] == [
            "tdr",
            "histogram",
            "delay_map",
            "delay_discharge",
            "fir_day",
        ]
        for file in files:
            with Image.open(file.path) as image:
                assert image.size == (file.width, file.height)
