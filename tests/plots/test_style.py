"""Test sheets, legends, date ticks and files."""

import datetime as dt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from rivid.plots import style
from rivid.plots.style import date_ticks
from tests.plots.layout import check, labels


def test_panels_of_a_sheet_have_their_sizes_and_margins_in_inches():
    with style.styled():
        figure, panels = style.sheet(
            "t", "n", (1.0, 2.0), (1, 3), gap=(0.5, 0.25), left=0.7, right=1.0, top=0.8, bottom=0.6
        )
    assert figure.get_size_inches() == pytest.approx((style.WIDTH, 0.8 + 1.0 + 0.25 + 2.0 + 0.6))
    unit = (style.WIDTH - 0.7 - 1.0 - 0.5) / 4
    expected = [(unit, 1.0), (3 * unit, 1.0), (unit, 2.0), (3 * unit, 2.0)]
    assert np.array([style.inches(ax) for ax in panels]) == pytest.approx(np.array(expected))
    assert panels[2].get_position().y0 * 4.65 == pytest.approx(0.6)


def test_a_legend_has_bars_first_and_each_label_once():
    with style.styled():
        figure, (one, two) = style.sheet("t", "n", (1.0,), (1, 1))
        for ax in (one, two):
            style.marks(ax, np.zeros(1), np.zeros(1), "marks", 2.0, marker="o")
            ax.bar([0], [1], label="bars")
        style.key(one)
        assert labels(figure) == ["bars", "marks"]
        style.figure_key([one, two])
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["bars", "marks"]


def test_the_second_axis_is_in_minutes_and_from_two_hours_on_in_hours():
    with style.styled():
        _, (ax,) = style.sheet("t", "n")
        style.lag_ticks(ax, 0, 30)
        minutes, hours = (
            style.second_axis(ax, 133, "lag [minutes]"),
            style.second_axis(ax, 900, "lag [minutes]"),
        )
    assert (minutes.get_ylabel(), hours.get_ylabel()) == ("lag [minutes]", "lag [hours]")
    assert minutes.get_ylim() == pytest.approx((0, 30 * 133 / 60)) and hours.get_ylim() == (0, 7.5)


@pytest.mark.parametrize(
    ("first", "last", "expected"),
    [
        ("2008-03-28", "2008-04-03", ["28 Mar\n2008", *"29 Mar,30 Mar,31 Mar,1 Apr,2 Apr,3 Apr".split(",")]),
        ("2007-11-01", "2008-03-31", ["Nov\n2007", "Dec", "Jan\n2008", "Feb", "Mar"]),
        ("2008-01-30", "2008-04-30", ["Feb\n2008", "Mar", "Apr"]),
        ("2001-05-01", "2004-12-31", ["2001", "2002", "2003", "2004"]),
    ],
)
def test_labels_of_dates_name_days_months_or_years(first, last, expected):
    assert date_ticks(dt.date.fromisoformat(first), dt.date.fromisoformat(last))[2] == expected


def test_months_lie_between_lines_at_their_first_days():
    lines, places, names = date_ticks(dt.date(2008, 1, 1), dt.date(2008, 12, 31))
    feb = dt.date(2008, 2, 1).toordinal()
    assert len(names) == 12 and feb - 0.5 in lines
    assert places[1] == feb - 0.5 + 29 / 2


@given(st.dates(dt.date(1800, 1, 1), dt.date(2200, 1, 1)), st.integers(1, 40_000))
def test_ticks_are_few_in_order_and_inside(first, days):
    last = first + dt.timedelta(days=days - 1)
    lines, places, names = date_ticks(first, last)
    low, high = first.toordinal() - 0.5, last.toordinal() + 0.5
    assert 1 <= len(names) == len(places) == len(set(places)) <= 32
    assert places == sorted(places)
    assert all(low <= at <= high for at in places + lines)


@pytest.mark.parametrize("days", [9, 300, 700, 1700])
def test_labels_of_dates_fit_in_a_narrow_panel(days):
    first = dt.date(2019, 11, 20)
    with style.styled():
        figure, panels = style.sheet("t", "n", (1.0,), (1, 2, 4))
        for ax in panels:
            style.date_axis(ax, first, first + dt.timedelta(days=days - 1))
            ax.set_yticks([])
        figure.canvas.draw()
        check(figure, "dates")


def test_a_file_of_256_colours_is_near_the_figure_and_the_same_twice(tmp_path):
    with style.styled():
        figure, (ax,) = style.sheet("Title", "note")
        ax.imshow(np.linspace(0, 1, 600).reshape(20, 30), cmap="Greys", aspect="auto")
        ax.plot([0, 29], [0, 19], color=style.ACCENT)
        for name in ("a.png", "b.png"):
            style.save(figure, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with Image.open(tmp_path / "a.png") as image:
        assert image.mode == "P" and not image.info.keys() & {"Software", "Creation Time", "date", "Title"}
        got = np.asarray(image.convert("RGB"), int)
    assert got[0, 0].tolist() == [255, 255, 255]
    assert np.abs(got - np.asarray(figure.canvas.buffer_rgba())[..., :3]).max() <= 8


def test_a_year_moves_to_the_next_label_that_stays():
    room = 2 * 4 * style.LETTER + 0.01  # of two years
    for first, last, expected in (
        ("2023-11-01", "2024-02-29", ["Nov\n2023", "Jan\n2024"]),
        ("2023-12-01", "2024-02-29", ["Dec\n2023", "Feb\n2024"]),
    ):
        assert date_ticks(dt.date.fromisoformat(first), dt.date.fromisoformat(last), room)[2] == expected


def test_symbols_and_small_values_are_set_as_mathematics():
    words = style.set_symbols("beta_h of sigma_hD², in T_s")
    assert words == r"$\beta_h$ of $\sigma_{hD}^2$, in $T_s$"
    assert style.power_of_ten(np.array([-3.1e-4, 2e-5])) == (10000.0, "10⁻⁴ ")
    assert style.power_of_ten(np.array([0.4, 2.0])) == (1.0, "")
