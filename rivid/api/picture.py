"""Figures in the house style that show themselves in a notebook."""

import datetime as dt
from collections.abc import Sequence
from io import BytesIO

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rivid.plots import style
from rivid.plots.dates import date_axis
from rivid.text import shorten

LEFT, RIGHT, TOP, BOTTOM, BETWEEN = 0.78, 0.72, 0.86, 0.6, 0.34


class Picture(Figure):
    """A figure without pyplot's global state; as the last value of a notebook's cell it is shown."""

    def _repr_png_(self) -> bytes:
        held = BytesIO()
        self.savefig(held, format="png")
        return held.getvalue()


def picture(title: str, note: str, heights: Sequence[float]) -> tuple[Picture, list[Axes]]:
    """A figure with a heading and panels below each other.

    Parameters
    ----------
    title, note : str
        The heading, and a line of facts under it.
    heights : sequence of float
        Of the panels, from the top [inch].

    Returns
    -------
    Picture, list of Axes
    """
    height = TOP + sum(heights) + BETWEEN * (len(heights) - 1) + BOTTOM
    figure = Picture(figsize=(style.WIDTH, height), dpi=style.DPI)
    FigureCanvasAgg(figure)
    figure.text(LEFT / style.WIDTH, 1 - 0.13 / height, title, va="top", fontsize=11, fontweight="bold")
    figure.text(
        LEFT / style.WIDTH, 1 - 0.36 / height, shorten(note, 130), va="top", fontsize=8.5, color=style.GREY
    )
    panels, top = [], height - TOP
    for tall in heights:
        width = style.WIDTH - LEFT - RIGHT
        place = (LEFT / style.WIDTH, (top - tall) / height, width / style.WIDTH, tall / height)
        axes = figure.add_axes(place)
        axes.spines["right"].set_visible(False)
        panels.append(axes)
        top -= tall + BETWEEN
    return figure, panels


def date_axes(panels: Sequence[Axes], first: dt.date, last: dt.date) -> None:
    """Panels whose x axis is days by their ordinal number; the lowest has the labels."""
    for axes in panels:
        date_axis(axes, first, last)
    for axes in panels[:-1]:
        axes.tick_params(axis="x", which="both", labelbottom=False)
