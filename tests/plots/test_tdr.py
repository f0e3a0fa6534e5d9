"""The time-day representation: each bar in its place, white lowest, black highest, d where it is."""

import dataclasses

import numpy as np
from PIL import Image

from rivid.plots import style, tdr
from tests.plots.synthetic import ORDER, dates_of, estimator, results


def test_a_missing_or_unanswered_day_is_an_empty_column_in_its_place():
    e = estimator("jmap", dates_of(40, missing=10, seed=3), unanswered=0.1)
    image = tdr.bars(e)
    assert image.shape == (ORDER, 50)
    filled = {(e.dates[0].toordinal() + k) for k in np.flatnonzero(~np.isnan(image).all(axis=0))}
    assert filled == {date.toordinal() for date, ok in zip(e.dates, e.answered, strict=True) if ok}
    for i in np.flatnonzero(e.answered):
        np.testing.assert_array_equal(image[:, e.dates[i].toordinal() - e.dates[0].toordinal()], e.fir[i])


def test_one_wild_day_does_not_change_the_greys_of_the_others():
    fir = estimator("jmap", dates_of(300), unanswered=0).fir
    calm = tdr.grey_limits(fir)
    fir[17] *= 1e6
    np.testing.assert_allclose(tdr.grey_limits(fir), calm, rtol=0.1)


def test_limits_exist_for_nothing_and_for_a_constant():
    for fir in (np.empty((0, 30)), np.full((2, 3), np.nan), np.zeros((4, 5)), np.full((4, 5), -3.0)):
        low, high = tdr.grey_limits(fir)
        assert low < high


def _picture(run, folder):
    """The panel's pixels [rows from the bottom, columns, rgb] of a record in which every day answers."""
    e = run.estimators[0]
    with style.styled():
        file = tdr.draw(run, e, folder)
    with Image.open(file.path) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    top, bottom = round(0.82 * style.DPI), round(0.66 * style.DPI)
    left, right = round(0.68 * style.DPI), round(0.72 * style.DPI)
    return pixels[top : len(pixels) - bottom, left : pixels.shape[1] - right][::-1]


def _calm(delay):
    run = results(("jmap",), dates_of(3), unanswered=0)
    e = run.estimators[0]
    fir = np.zeros((3, ORDER))
    fir[:, delay + 1 :] = 1e-4
    e = dataclasses.replace(e, fir=fir, delay=np.full(3, float(delay)), at_bound=np.zeros(3, bool))
    return dataclasses.replace(run, estimators=[e])


def test_the_delay_is_drawn_at_lag_d_below_the_jump_from_white_to_black(tmp_path):
    for delay in (3, 7, 14):
        panel = _picture(_calm(delay), tmp_path)
        rows = np.arange(len(panel))
        lag = (rows + 0.5) / len(panel) * ORDER - 0.5
        red = panel[..., 0] - panel[..., 2]
        marked = lag[(red > 120).mean(axis=1) > 0.9]
        assert marked.size and abs(marked.mean() - delay) < 0.15
        grey = panel.mean(axis=(1, 2))
        assert grey[(lag > delay + 0.6) & (lag < ORDER - 1)].max() < 60, "black above the jump"
        assert grey[(lag > 0) & (lag < delay - 0.6)].min() > 200, "white below it"
