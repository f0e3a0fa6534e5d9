"""Figures of the library's results: a heading and panels below each other, shown by a notebook."""

import datetime as dt
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rivid.plots import style
from rivid.plots.dates import date_axis
from rivid.plots.tdr import grey_limits
from rivid.text import response_unit, shorten
from rivid.types import Floats

Panel = tuple[float, Callable[[Axes], None]]
"""Height [inch], and the function that draws the panel."""
Curve = tuple[Floats, str, str]
"""Values, colour and label."""

LEFT, RIGHT, TOP, BOTTOM, BETWEEN = 0.78, 0.72, 0.86, 0.6, 0.34
"""Margins of a figure, and the gap between panels [inch]."""


class Picture(Figure):
    """A figure without pyplot's global state that a notebook shows as the value of a cell."""

    def _repr_png_(self) -> bytes:
        held = BytesIO()
        self.savefig(held, format="png")
        return held.getvalue()


def picture(title: str, note: str, panels: Sequence[Panel], between: float = BETWEEN) -> Picture:
    """Return a figure with a heading and panels below each other.

    Parameters
    ----------
    title, note : str
        The heading, and a line of facts under it.
    panels : sequence of (float, callable)
        Height [inch] and drawing function of each, from the top.
    between : float
        Gap between panels [inch].
    """
    height = TOP + sum(tall for tall, _ in panels) + between * (len(panels) - 1) + BOTTOM
    with style.styled():
        figure = Picture(figsize=(style.WIDTH, height), dpi=style.DPI)
        FigureCanvasAgg(figure)
        left, width = LEFT / style.WIDTH, (style.WIDTH - LEFT - RIGHT) / style.WIDTH
        figure.text(left, 1 - 0.13 / height, title, va="top", fontsize=11, fontweight="bold")
        figure.text(left, 1 - 0.36 / height, shorten(note, 130), va="top", fontsize=8.5, color=style.GREY)
        top = height - TOP
        for tall, draw in panels:
            axes = figure.add_axes((left, (top - tall) / height, width, tall / height))
            axes.spines["right"].set_visible(False)
            draw(axes)
            top -= tall + between
    return figure


def _legend(axes: Axes) -> None:
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


def samples(axes: Axes, hours: Floats, curves: Sequence[Curve], label: str, held: bool = False) -> None:
    """Draw series of a day against the hour; `held`: as steps with a legend, without tick labels."""
    for values, colour, name in curves:
        axes.plot(hours, values, color=colour, lw=1.0, label=name, drawstyle="steps-post" if held else None)
    axes.set_ylabel(label)
    axes.set_xlim(0, float(hours[-1]))
    if held:
        _legend(axes)
        axes.tick_params(labelbottom=False)
    else:
        axes.ticklabel_format(axis="y", useOffset=False)
        axes.set_xlabel("hours")


def daily(
    axes: Axes, dates: Sequence[dt.date], curves: Sequence[Curve], label: str,
    *, marks: bool = True, dated: bool = True,
) -> None:  # fmt: skip
    """Draw daily values against the date; `dated`: with tick labels."""
    at = [date.toordinal() for date in dates]
    look: dict[str, Any] = {"marker": "o", "ms": 1.8} if marks else {}
    for values, colour, name in curves:
        axes.plot(at, values, color=colour, lw=1.0, label=name, **look)
    if any(name for _, _, name in curves):
        _legend(axes)
    else:
        axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_ylabel(label)
    date_axis(axes, dates[0], dates[-1])
    axes.tick_params(axis="x", which="both", labelbottom=dated)


def jump(axes: Axes, delay: float) -> None:
    """Mark the step from d to d + 1, where the response jumps."""
    if np.isfinite(delay):
        axes.axvspan(delay, delay + 1, color=style.ACCENT, alpha=0.18, linewidth=0, zorder=0)


def response(axes: Axes, fir: Floats, sd: Floats | None, delay: float, unit: str) -> None:
    """Draw an impulse response with its jump and, where given, two standard deviations to either side."""
    k = np.arange(len(fir))
    axes.axhline(0, color=style.LIGHT, lw=0.7)
    if sd is not None:
        axes.fill_between(k, fir - 2 * sd, fir + 2 * sd, color=style.LIGHT, alpha=0.5, linewidth=0)
    axes.plot(k, fir, color=style.INK, lw=1.0, marker="o", ms=2.4)
    jump(axes, delay)
    axes.set_ylabel(f"response [{response_unit(unit)}]" if unit else "response")
    axes.set_xlim(-0.5, len(k) - 0.5)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))


def by_delay(
    axes: Axes, candidates: Any, values: Floats, delay: float, order: int, label: str, empty: str = ""
) -> None:
    """Draw a criterion (a line) or probabilities (bars) of the delays; `empty`: why there are none."""
    if label == "probability" and np.isfinite(values).any():
        axes.bar(candidates + 0.5, values, 0.8, color=style.INK)
        axes.set_ylim(0, 1)
    elif label == "probability":
        style.say(axes, empty)
    else:
        axes.plot(candidates, values, color=style.INK, lw=1.0, marker="o", ms=2.6)
    jump(axes, delay)
    axes.set_ylabel(label)
    axes.set_xlabel("lag and delay [samples]")
    axes.set_xlim(-0.5, order - 0.5)


def responses(axes: Axes, fir: Floats, delay: Floats) -> None:
    """Draw a column for each day and a row for each lag; black is high, the line is the delay."""
    low, high = grey_limits(fir)
    days, order = fir.shape
    axes.set_facecolor(style.NO_DATA)
    axes.imshow(
        fir.T, cmap="Greys", aspect="auto", origin="lower", interpolation="nearest",
        extent=(-0.5, days - 0.5, -0.5, order - 0.5), vmin=low, vmax=high,
    )  # fmt: skip
    axes.plot(np.arange(days), delay + 0.5, color=style.ACCENT, lw=1.2, marker="o", ms=2.0)
    axes.set_xlabel("day")
    axes.set_ylabel("lag [samples]")


def horizon_errors(
    axes: Axes, hours: Sequence[float], before: Sequence[float], after: Sequence[float], unit: str
) -> None:
    """Draw two bars for each prediction horizon."""
    if not hours:
        style.say(axes, "no days kept apart for validation")
        return
    at = np.arange(len(hours))
    axes.bar(at - 0.2, before, 0.38, color=style.ACCENT)
    axes.bar(at + 0.2, after, 0.38, color=style.WATER)
    axes.set_xticks(at, [f"{h:g} h ahead" for h in hours])
    axes.set_ylabel(f"error [{unit}]")
