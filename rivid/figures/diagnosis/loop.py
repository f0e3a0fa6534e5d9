"""One day that was kept apart, with the operators in the loop: level and outflow, before and after."""

import datetime as dt
from collections.abc import Sequence
from pathlib import Path

from matplotlib.ticker import MaxNLocator

from rivid.figures import FigureFile, style
from rivid.figures.diagnosis.panels import AFTER, BEFORE, Floats, heading, hour_axis, panel

LEFT, RIGHT, BOTTOM, TOP = 0.82, 0.3, 0.55, 0.9
PANEL, BETWEEN = 1.6, 0.42
HEIGHT = TOP + 2 * PANEL + BETWEEN + BOTTOM


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
    upper = panel(page, LEFT, BOTTOM + PANEL + BETWEEN, width, PANEL)
    lower = panel(page, LEFT, BOTTOM, width, PANEL)
    two = len(level) > 2
    names = ("measured", "simulated without the named effects" if two else "simulated", "with them")
    looks = (
        {"color": style.INK, "lw": 1.6}, {"color": BEFORE, "lw": 1.4, "ls": (0, (5, 2))},
        {"color": AFTER, "lw": 1.4},
    )  # fmt: skip
    lower.plot(hour, inflow, color=style.LIGHT, lw=1.1, label="inflow")
    for axes, curves in ((upper, level), (lower, outflow)):
        for name, look, curve in zip(names, looks, curves, strict=False):
            axes.plot(hour, curve, label=name if axes is upper else None, **look)  # type: ignore[arg-type]
        hour_axis(axes, 3)
        axes.grid(True)
        axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        axes.ticklabel_format(axis="y", useOffset=False)
    upper.set_ylabel("level at the dam [m]")
    lower.set_ylabel("outflow [m³/s]")
    lower.set_xlabel("hour of the day")
    upper.tick_params(axis="x", labelbottom=False)
    upper.legend(loc="lower left", bbox_to_anchor=(0.0, 1 + 0.06 / PANEL), ncols=3)
    heading(lower, "grey: the logged inflow, all that the simulation is told", color=style.GREY)
    path = folder / "diagnosis_loop.png"
    style.save(page.figure, path)
    title = f"With the operators in the loop: {date}"
    return style.figure_file(page, "diagnosis_loop", "", path, title, _CAPTION)


_CAPTION = (
    "The simulation starts from the day's first measured level and logged outflow, and is then told the "
    "inflow alone: a model of the operators sees its level and decides the outflow. Water that is missing "
    "shows in the outflow more than in the level, which the operators hold."
)
