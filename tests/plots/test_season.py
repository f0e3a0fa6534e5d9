"""Test the figures of the season and of the law: curves, marks and intervals."""

import dataclasses
import datetime as dt

import numpy as np
import pytest

from rivid.plots import season, style
from rivid.results.season import SeasonDays, join, law_of
from tests.plots.layout import check, saved


def days_of(n=120, *, river=False, seed=3):
    rng = np.random.default_rng(seed)
    Q = 300.0 * np.exp(0.5 * np.sin(np.arange(n) / 9.0))
    T = 7.2 * (Q / 300.0) ** -0.25 * np.exp(0.02 * rng.standard_normal(n))
    candidates = np.arange(1, 16)
    d = (T + 0.5 * river).astype(int)
    p = np.full((n, 15), 0.01)
    p[np.arange(n), d - 1] = 0.86
    p[rng.random(n) < 0.08] = np.nan
    gone = np.isnan(p).any(axis=1)
    first = dt.date(2024, 3, 1)
    return SeasonDays(
        "reach", 133.0, river, 1, [first + dt.timedelta(days=k) for k in range(n)], candidates, p,
        np.where(gone, np.nan, d), np.where(gone, np.nan, 133.0 * T), Q,
    )  # fmt: skip


@pytest.fixture
def ax():
    with style.styled():
        yield style.sheet("title", "note")[1][0]


def test_the_line_is_the_joined_median_and_the_band_holds_ninety_per_cent(ax):
    days = days_of()
    joined = join(days)
    season.season(ax, days, joined)
    line = next(line for line in ax.lines if line.get_label() == "joined, median")
    expected = [days.place(joined.probability, share) - 0.5 for share in (0.05, 0.5, 0.95)]
    assert line.get_ydata()[1:-1] == pytest.approx(expected[1])
    band = next(c for c in ax.collections if c.get_label() == "90 %").get_paths()[0].vertices[:, 1]
    assert (band.min(), band.max()) == pytest.approx((expected[0].min(), expected[2].max()))
    alpha = np.asarray(ax.get_images()[0].get_array())[..., 3]
    np.testing.assert_allclose(alpha, season.DARKEST * np.nan_to_num(days.probability).T)
    unseen = int((~joined.observed).sum())
    assert unseen and f"no information of its own ({unseen})" in style.entries(ax)


def test_a_day_whose_answer_changed_is_marked(ax):
    days = days_of(40)
    steady = join(days).delay.copy()
    steady[20] += 1
    season.season(ax, dataclasses.replace(days, delay=steady), join(days))
    assert "another delay than alone (1)" in style.entries(ax)
    assert any(list(line.get_xdata()) == [days.dates[20].toordinal()] for line in ax.lines)


@pytest.mark.parametrize("river", [False, True])
def test_the_law_is_drawn_over_the_days_in_samples(river, ax):
    days = days_of(river=river)
    law = law_of(days)
    season.delay_law(ax, days, law)
    line = next(line for line in ax.lines if line.get_label() == "law")
    q = line.get_xdata()
    assert line.get_ydata() == pytest.approx(law.delay(q)[0] / 133.0)
    shown = np.isfinite(days.travel)
    assert (q[0], q[-1]) == pytest.approx((days.discharge[shown].min(), days.discharge[shown].max()))
    assert any(np.array_equal(one.get_ydata(), days.travel[shown] / 133.0) for one in ax.lines)


def test_the_band_of_the_law_is_that_of_its_table(ax):
    days = dataclasses.replace(days_of(), doubt=(133.0, 66.5))
    law = law_of(days)
    season.delay_law(ax, days, law)
    band = next(c for c in ax.collections if c.get_label() == "its 90 %").get_paths()[0].vertices
    for at, *ends in zip(law.table.discharge, law.table.low, law.table.high, strict=True):
        near = band[np.abs(band[:, 0] / at - 1) < 0.01, 1]
        assert (near.min(), near.max()) == pytest.approx(np.array(ends) / 133.0, rel=0.01)


@pytest.mark.parametrize("n", [1, pytest.param(120, marks=pytest.mark.long)])
def test_both_files_are_readable_and_the_same_twice(n, tmp_path):
    days = days_of(n)
    law = law_of(days)
    assert (law.status == "ok") == (n == 120)
    with saved(write=True) as figures:
        made = [season.draw(days, join(days), law, tmp_path / name) for name in "ab"]
    assert [(f.kind, f.estimator) for f in made[0]] == [
        ("season", "posterior-season"), ("delay_law", "posterior"),
    ]  # fmt: skip
    for one, two in zip(*made, strict=True):
        assert one.path.read_bytes() == two.path.read_bytes()
    for name, figure in figures.items():
        check(figure, name)


@pytest.mark.parametrize("missing", ["discharge", "travel"])
def test_days_without_discharge_or_travel_time_leave_an_empty_panel(missing, ax):
    days = dataclasses.replace(days_of(30), **{missing: np.full(30, np.nan)})
    season.delay_law(ax, days, law_of(days))
    assert "None of the 30 days" in ax.texts[0].get_text() and not ax.lines
