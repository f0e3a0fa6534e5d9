"""One day that was kept apart, with the operators in the loop: level and outflow, before and after."""

import datetime as dt
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator

from rivid.plots import style
from rivid.plots.diagnosis.panels import AFTER, BEFORE, heading, hour_axis, panel
from rivid.plots.style import FigureFile
from rivid.types import Floats

LEFT, RIGHT, BOTTOM, TOP = 0.82, 0.3, 0.55, 0.9
PANEL, LOWEST, BETWEEN = 1.6, 1.0, 0.42
HEIGHT = TOP + 2 * (PANEL + BETWEEN) + LOWEST + BOTTOM


def draw(
    folder: Path, *, date: dt.date, hour: Floats, inflow: Floats, level: Sequence[Floats],
    outflow: Sequence[Floats], words: str,
) -> FigureFile:  # fmt: skip
    """Draw diagnosis_loop.png.

    Parameters
    ----------
    folder : Path
    date : datetime.date
    hour, inflow : ndarray, shape (n,)
        Hour of the day [h] and logged inflow [m3/s].
    level, outflow : sequence of ndarray of shape (n,)
        Measured, simulated without the named effects and, where something was named, with them [m], [m3/s];
        NaN where nothing counts.
    words : str
        What all days say, for the line under the title.

    Returns
    -------
    FigureFile
    """
    page = style.sheet(
        f"With the operators in the loop: {date}", words, height=HEIGHT, left=LEFT,
    )  # fmt: skip
    page.axes.remove()
    width = style.WIDTH - LEFT - RIGHT
    bottom = BOTTOM + LOWEST + BETWEEN
    upper = panel(page, LEFT, bottom + PANEL + BETWEEN, width, PANEL)
    lower = panel(page, LEFT, bottom, width, PANEL)
    lowest = panel(page, LEFT, BOTTOM, width, LOWEST)
    two = len(level) > 2
    names = ("measured", "simulated without the named effects" if two else "simulated", "with them")
    looks = (
        {"color": style.INK, "lw": 1.6}, {"color": BEFORE, "lw": 1.4, "ls": (0, (5, 2))},
        {"color": AFTER, "lw": 1.4},
    )  # fmt: skip
    lower.plot(hour, inflow, color=style.LIGHT, lw=1.1)
    for name, look, high, flow in zip(names, looks, level, outflow, strict=False):
        upper.plot(hour, high, label=name, **look)  # type: ignore[arg-type]
        lower.plot(hour, flow, **look)  # type: ignore[arg-type]
    lowest.axhline(0, color=style.INK, lw=1.0)
    for look, flow in zip(looks[1:], outflow[1:], strict=False):
        lowest.plot(hour, hourly(flow - outflow[0], hour), **look)  # type: ignore[arg-type]
    for axes in (upper, lower, lowest):
        hour_axis(axes, 3)
        axes.grid(True)
        axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.tick_params(axis="x", labelbottom=axes is lowest)
    upper.set_ylabel("level at the dam [m]")
    lower.set_ylabel("outflow [m³/s]")
    lowest.set_ylabel("[m³/s]")
    lowest.set_xlabel("hour of the day")
    upper.legend(loc="lower left", bbox_to_anchor=(0.0, 1 + 0.06 / PANEL), ncols=3)
    heading(lower, "grey: the logged inflow, all that the simulation is told", color=style.GREY)
    heading(lowest, "outflow, simulated less measured, mean of an hour", color=style.GREY)
    path = folder / "diagnosis_loop.png"
    style.save(page.figure, path)
    title = f"With the operators in the loop: {date}"
    return style.figure_file(page, "diagnosis_loop", "", path, title, _CAPTION)


def hourly(values: Floats, hour: Floats) -> Floats:
    """Mean of the hour about each sample, shape (n,); NaN where a sample counts for nothing."""
    there = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(there, values, 0.0))])
    number = np.concatenate([[0], np.cumsum(there)])
    low = np.searchsorted(hour, hour - 0.5, side="left")
    high = np.searchsorted(hour, hour + 0.5, side="right")
    mean = (total[high] - total[low]) / np.maximum(number[high] - number[low], 1)
    return np.where(there, mean, np.nan)


_CAPTION = (
    "The simulation starts from the day's first measured level and logged outflow, and is then told the "
    "inflow alone: a model of the operators sees its level and decides the outflow. Water that is missing "
    "shows in the outflow more than in the level, which the operators hold."
)
