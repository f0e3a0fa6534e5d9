"""The unexplained inflow over the season, with its band, and against what it may go with."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from rivid.plots import style
from rivid.plots.diagnosis.binned import edges_of, means
from rivid.plots.diagnosis.panels import (
    AFTER,
    BEFORE,
    WITH,
    WITHOUT,
    Window,
    heading,
    hour_axis,
    limits,
    narrow_dates,
    panel,
    shade,
)
from rivid.plots.style import FigureFile
from rivid.text import count, day_range, shorten
from rivid.types import Bools, Floats

LEFT, RIGHT, BOTTOM, TOP = 0.72, 0.3, 0.55, 0.92
COURSE, BETWEEN, SMALL, ABOVE, GAP = 1.35, 0.3, 1.5, 0.98, 0.3
POINTS = 1500
"""About as many points on a curve as the figure has pixels across."""


@dataclass(frozen=True, eq=False)
class Series:
    """The unexplained inflow and its standard deviation [m3/s], shape (days, n) each."""

    flow: Floats
    sd: Floats


@dataclass(frozen=True, eq=False)
class Course:
    """Means of some `hours` of a series; arrays of shape (points,), with NaN where samples are missing."""

    day: Floats
    mean: Floats
    low: Floats
    high: Floats
    hours: int


def course(series: Series, dates: Sequence[dt.date], hour: Floats, used: Bools) -> Course:
    """Means over some hours, as many as keep a season to :data:`POINTS` points, with the 95 % band.

    The band of a mean is the mean of the bands: neighbouring errors go together, so no less is sure.
    """
    span = (dates[-1] - dates[0]).days + 1
    step = next(h for h in (1, 2, 3, 6, 12, 24) if 24 / h * span <= POINTS or h == 24)
    parts = 24 // step
    ordinal = np.array([date.toordinal() for date in dates])
    there = used & np.isfinite(series.flow) & np.isfinite(series.sd)
    cell = (ordinal - ordinal[0])[:, None] * parts + np.minimum(hour // step, parts - 1).astype(np.int64)
    size = span * parts
    number = np.bincount(cell[there], minlength=size)

    def mean(values: Floats) -> Floats:
        total = np.bincount(cell[there], values[there], size)
        return np.asarray(np.divide(total, number, out=np.full(size, np.nan), where=number > 0))

    day = ordinal[0] - 0.5 + (np.arange(size) + 0.5) / parts
    middle, half = mean(series.flow), 1.96 * mean(series.sd)
    return Course(day, middle, middle - half, middle + half, step)


def draw(
    folder: Path, *, dates: Sequence[dt.date], hour: Floats, used: Bools, block: NDArray[np.int64],
    before: Series, after: Series | None, drivers: Sequence[tuple[str, Floats]],
    windows: Sequence[Window] = (),
) -> FigureFile:  # fmt: skip
    """Draw diagnosis_inflow.png.

    Parameters
    ----------
    folder : Path
    dates : sequence of datetime.date, length days
    hour : ndarray, shape (days, n)
    used : ndarray of bool, shape (days, n)
        Samples that count.
    block : ndarray of int, shape (days,)
        Days of one block may be alike.
    before, after : Series
        Without and with the named effects; None where nothing was named.
    drivers : sequence of (str, ndarray of shape (days, n))
        What it may go with, besides the hour: a label with unit, and values.
    windows : sequence of Window
        Dates of the named effects.

    Returns
    -------
    FigureFile
    """
    shown = (
        [(WITHOUT, BEFORE, before)] if after is None else [(WITHOUT, BEFORE, before), (WITH, AFTER, after)]
    )
    height = BOTTOM + SMALL + ABOVE + len(shown) * (COURSE + GAP) + TOP - GAP
    page = style.sheet(
        "The unexplained inflow",
        f"{count(len(dates), 'day')}, {day_range(dates[0], dates[-1])} · what would have to flow in for the "
        "simulation to follow the gauge",
        height=height,
        left=LEFT,
    )
    page.axes.remove()
    width = style.WIDTH - LEFT - RIGHT
    curves = [course(series, dates, hour, used) for _, _, series in shown]
    top = 1.08 * limits(*(c.mean for c in curves), part=0.998)
    bottom = BOTTOM + SMALL + ABOVE
    for i, ((words, colour, _), curve) in enumerate(zip(shown, curves, strict=True)):
        at = bottom + (len(shown) - 1 - i) * (COURSE + GAP)
        axes = panel(page, LEFT, at, width, COURSE)
        shade(axes, windows)
        _curve(axes, curve, colour)
        axes.set_ylim(-top, top)
        narrow_dates(axes, dates[0], dates[-1], width)
        axes.set_ylabel("inflow [m³/s]")
        step = "hourly means" if curve.hours == 1 else f"means of {curve.hours} h"
        heading(axes, f"{words}, {step}" if len(shown) == 2 else f"{step} with the 95 % band")
        if i < len(shown) - 1:
            axes.tick_params(axis="x", which="both", labelbottom=False)
        elif windows:
            said = "; ".join(dict.fromkeys(w.words for w in windows))
            _right(axes, shorten(f"grey: dates of {said}", 80))
    _against(page, [("hour of the day", hour), *drivers], shown, used, block)
    path = folder / "diagnosis_inflow.png"
    style.save(page.figure, path)
    return style.figure_file(
        page, "diagnosis_inflow", "", path, "The unexplained inflow", _caption(after is not None)
    )


def _curve(axes: Axes, curve: Course, colour: str) -> None:
    axes.axhline(0, color=style.LIGHT, lw=0.7)
    axes.fill_between(curve.day, curve.low, curve.high, color=colour, alpha=0.25, lw=0)
    axes.plot(curve.day, curve.mean, color=colour, lw=0.8)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))


def _right(axes: Axes, text: str) -> None:
    axes.annotate(
        text, (1, 1), xycoords="axes fraction", xytext=(0, 4), textcoords="offset points", ha="right",
        va="bottom", fontsize=8, color=style.GREY,
    )  # fmt: skip


def _against(
    page: style.Sheet,
    drivers: Sequence[tuple[str, Floats]],
    shown: Sequence[tuple[str, str, Series]],
    used: Bools,
    block: NDArray[np.int64],
) -> None:
    """A small panel for each driver: means with their intervals."""
    each = (style.WIDTH - LEFT - RIGHT - BETWEEN * (len(drivers) - 1)) / len(drivers)
    told = []
    for label, values in drivers:
        edges = np.arange(25.0) if label.startswith("hour") else edges_of(values, used)
        told.append([means(series.flow, values, used, block, edges) for _, _, series in shown])
    ends = [end for of_driver in told for m in of_driver for end in (m.mean, m.low, m.high)]
    top = 1.1 * limits(*ends)
    for i, ((label, _), of_driver) in enumerate(zip(drivers, told, strict=True)):
        axes = panel(page, LEFT + i * (each + BETWEEN), BOTTOM, each, SMALL)
        axes.axhline(0, color=style.LIGHT, lw=0.7)
        for (words, colour, _), m in zip(shown, of_driver, strict=True):
            axes.fill_between(m.centre, m.low, m.high, color=colour, alpha=0.25, lw=0)
            axes.plot(m.centre, m.mean, color=colour, lw=1.1, marker="o", ms=2.6, label=words)
        axes.set_ylim(-top, top)
        axes.set_xlabel(label)
        axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
        if label.startswith("hour"):
            hour_axis(axes)
        else:
            axes.xaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
            axes.ticklabel_format(axis="x", useOffset=False)
        if not any(np.isfinite(m.mean).any() for m in of_driver):
            style.say(axes, "does not vary")
        if i == 0:
            axes.set_ylabel("mean [m³/s]")
            heading(axes, "Mean of it against what it may go with", up=6, fontweight="bold")
        else:
            axes.tick_params(axis="y", labelleft=False)


def _caption(two: bool) -> str:
    text = (
        "Above, its course with the 95 % band. Below, its mean by hour and by what the dams log, with 95 % "
        "intervals that treat whole blocks of days as one. What is explained lies on zero."
    )
    return text + (" Vermilion: without the named effects; blue: with them." if two else "")
