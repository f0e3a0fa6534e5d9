"""Figures of the season and of the law: every case draws, to the same bytes; what they show is there."""

import dataclasses
import datetime as dt

import numpy as np
import pytest
from PIL import Image

from rivid.plots import law as law_figure
from rivid.plots import season as season_figure
from rivid.plots import style
from rivid.results.season import SeasonDays, join, law_of

ACCENT = (0xD5, 0x5E, 0x00)
WATER = (0x00, 0x72, 0xB2)


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


def pixels(path, colour):
    with Image.open(path) as image:
        return int((np.abs(np.asarray(image.convert("RGB"), int) - colour).max(axis=2) < 12).sum())


def drawn(days, folder):
    with style.styled():
        return season_figure.draw(days, join(days), folder), law_figure.draw(days, law_of(days), folder)


@pytest.mark.parametrize("river", [False, True])
def test_both_figures_show_the_line_and_the_law(river, tmp_path):
    season, law = drawn(days_of(river=river), tmp_path)
    assert (season.path.name, law.path.name) == ("season.png", "delay_law.png")
    for file, colour in ((season, WATER), (law, ACCENT)):
        with Image.open(file.path) as image:
            assert image.size == (file.width, file.height)
        assert pixels(file.path, colour) > 1000
    assert season.caption and law.caption


def test_a_day_whose_answer_changed_is_marked(tmp_path):
    days = days_of(40)
    steady = dataclasses.replace(days, delay=join(days).delay)
    drawn(steady, tmp_path / "same")
    other = steady.delay.copy()
    other[20] += 1
    drawn(dataclasses.replace(steady, delay=other), tmp_path / "other")
    assert pixels(tmp_path / "same/season.png", ACCENT) == 0
    assert pixels(tmp_path / "other/season.png", ACCENT) > 20


def test_the_same_days_give_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        drawn(days_of(60), tmp_path / name)
    for name in ("season.png", "delay_law.png"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


@pytest.mark.parametrize("n", [1, 2, 9])
def test_few_days_are_drawn_without_a_law(n, tmp_path):
    days = days_of(n)
    assert law_of(days).status == "too_few_days"
    season, law = drawn(days, tmp_path)
    assert season.path.exists() and pixels(law.path, ACCENT) == 0


def test_days_without_discharge_or_answer_leave_an_empty_panel_with_words(tmp_path):
    days = days_of(30)
    nothing = np.full(30, np.nan)
    for k, bare in enumerate(
        (
            dataclasses.replace(days, discharge=nothing),
            dataclasses.replace(days, delay=nothing, travel=nothing),
        )
    ):
        season, law = drawn(bare, tmp_path / str(k))
        assert season.path.exists() and pixels(law.path, ACCENT) == 0
