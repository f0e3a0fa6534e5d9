"""One calm style for all figures: colours, fonts, sheets with fixed margins, deterministic files.

Margins are given in inches, never searched for: layout engines draw every figure twice. Each colour has
one meaning: ink for estimates, vermilion for what asks for attention, blue for hydraulics and the prior,
beige for no data. They keep apart for colour-blind eyes.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, NullLocator

from rivid.atomic import replacing
from rivid.plots.palette import reduced
from rivid.text import shorten, time_unit

INK = "#262B31"
GREY = "#68707A"
LIGHT = "#B4BBC3"
FAINT = "#E4E7EA"
ACCENT = "#D55E00"
WATER = "#0072B2"
NO_DATA = "#F4E8D4"

DPI = 150
WIDTH = 9.2
"""Width of every figure [inch]."""

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "text.color": INK,
    "text.parse_math": False,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.labelsize": 8.5,
    "axes.facecolor": "white",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.borderpad": 0.0,
    "legend.borderaxespad": 0.0,
    "legend.handletextpad": 0.5,
    "legend.columnspacing": 1.4,
    "figure.facecolor": "white",
    "hatch.linewidth": 0.8,
}


@dataclass(frozen=True)
class FigureFile:
    """A figure that has been written.

    Attributes
    ----------
    kind : str
        t50, t50_discharge, tdr, histogram, delay_map, delay_discharge or fir_day.
    estimator : str
        Whose results it shows; empty for all of them.
    path : Path
        The PNG file.
    title, caption : str
        What it is, and how to read it.
    width, height : int
        Size [pixels].
    """

    kind: str
    estimator: str
    path: Path
    title: str
    caption: str
    width: int
    height: int


@contextmanager
def styled() -> Iterator[None]:
    """Matplotlib with this style alone: a user's matplotlibrc changes neither look nor bytes."""
    ours: dict[Any, Any] = {k: v for k, v in matplotlib.rcParamsDefault.items() if k != "backend"}
    with matplotlib.rc_context(ours | STYLE):
        yield


@dataclass(frozen=True)
class Sheet:
    """A figure with one main panel.

    Attributes
    ----------
    figure : Figure
    axes : Axes
        The main panel.
    width, height : float
        Size of the panel [inch].
    """

    figure: Figure
    axes: Axes
    width: float
    height: float


def sheet(
    title: str,
    note: str,
    *,
    height: float = 3.9,
    left: float = 0.68,
    right: float = 0.72,
    top: float = 0.82,
    bottom: float = 0.66,
) -> Sheet:
    """A figure with a title, a line of facts under it, and a panel inside margins given in inches."""
    figure = Figure(figsize=(WIDTH, height), dpi=DPI)
    FigureCanvasAgg(figure)
    w, h = WIDTH - left - right, height - top - bottom
    axes = figure.add_axes((left / WIDTH, bottom / height, w / WIDTH, h / height))
    x = left / WIDTH
    figure.text(x, 1 - 0.13 / height, title, va="top", fontsize=11, fontweight="bold")
    figure.text(x, 1 - 0.36 / height, shorten(note, 130), va="top", fontsize=8.5, color=GREY)
    return Sheet(figure, axes, w, h)


def key(page: Sheet, handles: Sequence[Any]) -> None:
    """The legend, in one line between the heading and the panel, outside the data."""
    if handles:
        page.axes.legend(
            handles=list(handles),
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0 + 0.07 / page.height),
            ncols=len(handles),
        )


def dot(label: str, **look: Any) -> Line2D:
    """A legend entry for marks, with their look."""
    return Line2D([], [], label=label, **({"linestyle": "none"} | look))


def lag_ticks(axes: Axes, low: float, high: float, bins: int = 8) -> None:
    """Whole samples on the y axis, from `low` to `high`."""
    axes.set_ylim(low, high)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=bins, integer=True, steps=[1, 2, 5, 10]))


def second_axis(axes: Axes, sample_time: float, label: str = "minutes", offset: float = 0.0) -> Axes:
    """A right-hand axis in minutes (in hours from two hours on) for a left-hand axis in samples.

    Parameters
    ----------
    axes : Axes
        Panel whose y axis counts samples.
    sample_time : float
        T_s [s].
    label : str
        What the axis shows, with ``minutes`` for the unit.
    offset : float
        Samples added before the conversion.
    """
    low, high = axes.get_ylim()
    unit, seconds = time_unit((high + offset) * sample_time)
    scale = sample_time / seconds
    other = axes.twinx()
    other.set_ylim((low + offset) * scale, (high + offset) * scale)
    other.yaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 3, 5, 10]))
    other.set_ylabel(label.replace("minutes", unit), color=GREY)
    other.tick_params(axis="y", labelcolor=GREY)
    for side in ("left", "bottom", "top"):
        other.spines[side].set_visible(False)
    return other


def say(axes: Axes, text: str) -> None:
    """Write in the middle of an empty panel why it is empty."""
    axes.text(
        0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY, fontsize=11, wrap=True
    )


def no_ticks(axes: Axes) -> None:
    """A panel whose x axis has nothing to count."""
    axes.xaxis.set_major_locator(NullLocator())


def save(figure: Figure, path: Path) -> None:
    """Write a PNG atomically, without dates or software names in it.

    256 colours are more than a grey image with four colours needs, and halve the file: a report holds all.

    Raises
    ------
    RividError
        Where the file cannot be written.
    """
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    with replacing(path) as scratch:
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
        reduced(pixels).save(scratch, "PNG")


def figure_file(page: Sheet, kind: str, estimator: str, path: Path, title: str, caption: str) -> FigureFile:
    """The record of a figure that has been written."""
    width, height = page.figure.get_size_inches() * DPI
    return FigureFile(kind, estimator, path, title, caption, int(width), int(height))
