"""The unexplained inflow over hour and date, before and after: a map of when water is missing."""

import datetime as dt
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.ticker import FixedLocator

from rivid.plots import style
from rivid.plots.diagnosis.panels import SIGNED, heading, limits, narrow_dates, panel
from rivid.plots.style import FigureFile
from rivid.text import count, day_range
from rivid.types import Bools, Floats

MOST = 0.99
"""Share of the map's cells inside the scale: one odd hour must not make the others pale."""

LEFT, RIGHT, BETWEEN, BOTTOM, TOP = 0.62, 0.98, 0.3, 0.55, 0.92
HEIGHT = 4.2


def hourly(values: Floats, hour: Floats, used: Bools) -> Floats:
    """Means of each hour and day, shape (24, days); NaN where no sample counts.

    Parameters
    ----------
    values : ndarray, shape (days, n)
    hour : ndarray, shape (days, n)
        Hour of the day of each sample, 0 to 24 [h].
    used : ndarray of bool, shape (days, n)
    """
    days = len(values)
    there = used & np.isfinite(values)
    cell = np.minimum((hour + 1e-9).astype(np.int64), 23) + 24 * np.arange(days)[:, None]
    total = np.bincount(cell[there], values[there], 24 * days)
    number = np.bincount(cell[there], minlength=24 * days)
    mean = np.divide(total, number, out=np.full(24 * days, np.nan), where=number > 0)
    return np.asarray(mean.reshape(days, 24).T)


def on_calendar(columns: Floats, dates: Sequence[dt.date]) -> Floats:
    """Columns of days, shape (24, days), at their place in the calendar: missing days are NaN."""
    at = np.array([(date - dates[0]).days for date in dates])
    image = np.full((len(columns), at[-1] + 1), np.nan)
    image[:, at] = columns
    return image


def draw(
    folder: Path, *, dates: Sequence[dt.date], hour: Floats, used: Bools, before: Floats, after: Floats | None
) -> FigureFile:
    """Draw diagnosis_map.png.

    Parameters
    ----------
    folder : Path
    dates : sequence of datetime.date, length days
    hour : ndarray, shape (days, n)
        Hour of the day of each sample [h].
    used : ndarray of bool, shape (days, n)
        Samples that count.
    before, after : ndarray, shape (days, n)
        Unexplained inflow without and with the named effects [m3/s]; None where nothing was named.

    Returns
    -------
    FigureFile
    """
    page = style.sheet(
        "When water is missing: the unexplained inflow by hour and date",
        f"{count(len(dates), 'day')}, {day_range(dates[0], dates[-1])} · mean of each hour, above what the "
        "logs and the simulation account for",
        height=HEIGHT,
        left=LEFT,
    )
    page.axes.remove()
    maps = [on_calendar(hourly(w, hour, used), dates) for w in (before, after) if w is not None]
    words = ["without the named effects", "with the named effects"] if len(maps) == 2 else [""]
    top = limits(*maps, part=MOST)
    width = (style.WIDTH - LEFT - RIGHT - BETWEEN * (len(maps) - 1)) / len(maps)
    first, last = dates[0], dates[-1]
    for i, (image, said) in enumerate(zip(maps, words, strict=True)):
        axes = panel(page, LEFT + i * (width + BETWEEN), BOTTOM, width, HEIGHT - BOTTOM - TOP)
        axes.patch.set(facecolor="white", hatch="////", edgecolor=style.LIGHT)
        axes.imshow(
            image, cmap=SIGNED, vmin=-top, vmax=top, origin="lower", aspect="auto", interpolation="nearest",
            extent=(first.toordinal() - 0.5, last.toordinal() + 0.5, 0, 24),
        )  # fmt: skip
        narrow_dates(axes, first, last, width)
        axes.yaxis.set_major_locator(FixedLocator([0, 6, 12, 18, 24]))
        heading(axes, said)
        if i == 0:
            axes.set_ylabel("hour of the day")
        else:
            axes.tick_params(axis="y", labelleft=False)
    _scale(page, top)
    path = folder / "diagnosis_map.png"
    style.save(page.figure, path)
    return style.figure_file(page, "diagnosis_map", "", path, "When water is missing", _caption(len(maps)))


def _scale(page: style.Sheet, top: float) -> None:
    """The scale of colours at the right, with its unit."""
    bar = panel(page, style.WIDTH - RIGHT + 0.18, BOTTOM, 0.13, HEIGHT - BOTTOM - TOP)
    bar.imshow(
        np.linspace(-1, 1, 255)[:, None], cmap=SIGNED, aspect="auto", origin="lower", extent=(0, 1, -top, top)
    )
    bar.xaxis.set_ticks([])
    bar.yaxis.tick_right()
    bar.set_ylabel("unexplained inflow [m³/s]")
    bar.yaxis.set_label_position("right")


def _caption(maps: int) -> str:
    text = (
        "Each column is a day, each row an hour. Teal: more water came in than the logs say; brown: less. "
        "Hatched: nothing that counts. A band along the hours is something that comes every day; a block is "
        "something that began and ended."
    )
    return text + (
        " Both maps have one scale: what is named is gone from the right one." if maps == 2 else ""
    )
