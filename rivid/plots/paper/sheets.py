"""Sheets of the paper's figures: several panels, vector and PNG, the same bytes each time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter
from numpy.typing import NDArray

from rivid.atomic import replacing
from rivid.plots import style
from rivid.text import time_unit

VECTOR_DPI = 300
"""Resolution of what stays an image inside a vector file: the bars of a time-day representation."""


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper that has been drawn.

    Attributes
    ----------
    number : str
        As in the paper: "9", "18".
    title, caption : str
        What it shows, in one line each.
    vector, png : Path
        The SVG and the PNG file.
    width, height : int
        Size of the PNG [pixels].
    """

    number: str
    title: str
    caption: str
    vector: Path
    png: Path
    width: int
    height: int


@dataclass(frozen=True)
class Sheet:
    """A figure with panels in a grid.

    Attributes
    ----------
    figure : Figure
    panels : list of Axes
        Row by row.
    width, height : float
        Of each panel [inch].
    """

    figure: Figure
    panels: list[Axes]
    width: float
    height: float


def sheet(
    number: str,
    title: str,
    note: str,
    *,
    height: float = 3.0,
    rows: int = 1,
    columns: int = 1,
    gap: tuple[float, float] = (0.3, 0.3),
    left: float = 0.72,
    right: float = 0.72,
    top: float = 0.82,
    bottom: float = 0.62,
    legend: bool = True,
) -> Sheet:
    """A figure with its number and title, a line of facts, and panels `height` inches high.

    Parameters
    ----------
    number, title, note : str
        Of the heading; the note is one line of facts.
    height : float
        Of each panel [inch].
    rows, columns : int
        Panels.
    gap : tuple of float
        Between columns and between rows [inch].
    left, right, top, bottom : float
        Margins [inch].
    legend : bool
        Whether a legend will stand between the heading and the panels.
    """
    top = top if legend else top - 0.2
    total = top + bottom + rows * height + (rows - 1) * gap[1]
    page = style.sheet(
        f"Fig. {number} · {title}", note, height=total, left=left, right=right, top=top, bottom=bottom
    )
    page.axes.remove()
    width = (style.WIDTH - left - right - (columns - 1) * gap[0]) / columns
    panels = []
    for row in range(rows):
        for column in range(columns):
            x = left + column * (width + gap[0])
            y = total - top - (row + 1) * height - row * gap[1]
            box = (x / style.WIDTH, y / total, width / style.WIDTH, height / total)
            panels.append(page.figure.add_axes(box))
    return Sheet(page.figure, panels, width, height)


def legend(page: Sheet, handles: Sequence[object]) -> None:
    """The legend, in one line between the heading and the first panel."""
    style.key(style.Sheet(page.figure, page.panels[0], page.width, page.height), handles)


def name_panel(axes: Axes, letter: str, words: str) -> None:
    """A letter and a few words above the left edge of a panel."""
    for text, shift, weight in ((letter, 0, "bold"), (words, 13, "normal")):
        axes.annotate(
            text, (0, 1), xycoords="axes fraction", xytext=(shift, 5), textcoords="offset points",
            fontsize=8.5, fontweight=weight, va="bottom",
        )  # fmt: skip


def delay_ticks(axes: Axes, low: float, high: float, sample_time: float) -> None:
    """Delays in sampling periods under a panel, minutes under them."""
    _, seconds = time_unit(high * sample_time)
    axes.set_xlim(low - 0.8, high + 0.8)
    step = -(-int(high - low + 1) // 8)
    axes.xaxis.set_major_locator(FixedLocator([float(d) for d in range(int(low), int(high) + 1, step)]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda d, _: f"{d:.0f}\n{d * sample_time / seconds:.0f}"))
    axes.tick_params(axis="x", length=3)


def power_of_ten(values: NDArray[np.float64]) -> tuple[float, str]:
    """What to multiply small values by, and the unit's factor for the label, so that no axis needs "1e-4".

    Examples
    --------
    >>> power_of_ten(np.array([-3.1e-4, 2e-5])), power_of_ten(np.array([0.4, 2.0]))
    ((10000.0, '10⁻⁴ '), (1.0, ''))
    """
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    if not 0 < largest < 0.1:
        return 1.0, ""
    power = int(np.floor(np.log10(largest)))
    return 10.0**-power, f"10{str(power).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))} "


def minutes_above(axes: Axes, sample_time: float) -> None:
    """Minutes along the top of a panel whose x axis counts samples."""
    unit, seconds = time_unit(axes.get_xlim()[1] * sample_time)
    scale = sample_time / seconds

    def there(samples: Any) -> Any:
        return samples * scale

    def back(duration: Any) -> Any:
        return duration / scale

    other = axes.secondary_xaxis("top", functions=(there, back))
    other.tick_params(labelcolor=style.GREY, color=style.GREY, length=3, pad=1)
    other.spines["top"].set_visible(False)
    axes.annotate(
        unit, (1, 1), xycoords="axes fraction", xytext=(5, 3), textcoords="offset points", color=style.GREY
    )


def save(page: Sheet, folder: Path, stem: str, number: str, title: str, caption: str) -> PaperFigure:
    """Write ``<stem>.png`` and ``<stem>.svg``.

    Raises
    ------
    RividError
        Where a file cannot be written.
    """
    png, vector = folder / f"{stem}.png", folder / f"{stem}.svg"
    style.save(page.figure, png)
    # ids inside an SVG are hashes: of a fixed salt, so that the bytes are the same each time
    with matplotlib.rc_context({"svg.hashsalt": stem, "svg.fonttype": "path"}), replacing(vector) as scratch:
        page.figure.savefig(scratch, format="svg", dpi=VECTOR_DPI, metadata={"Date": None, "Creator": None})
    width, height = page.figure.canvas.get_width_height()
    return PaperFigure(number, title, caption, vector, png, width, height)
