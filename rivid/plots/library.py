"""Figures of the library's results: a heading and panels below each other, shown by a notebook."""

import datetime as dt
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from rivid.plots import estimates, style
from rivid.plots.style import Picture
from rivid.text import response_unit
from rivid.types import Floats

Panel = tuple[float, Callable[[Axes], Any]]  # height [inch], and the function that draws the panel
Curve = tuple[Floats, str, str]  # values, colour and label


def picture(title: str, note: str, panels: Sequence[Panel], between: float) -> Picture:
    """Return a figure with a title, a note, and panels below each other, `between` apart [inch]."""
    with style.styled():
        heights = [tall for tall, _ in panels]
        figure, axes = style.sheet(title, note, heights, gap=(0.0, between), left=0.78, top=0.86, bottom=0.6)
        for ax, (_, draw) in zip(axes, panels, strict=True):
            draw(ax)
            style.key(ax)
    return figure


def samples(axes: Axes, hours: Floats, curves: Sequence[Curve], label: str, held: bool = False) -> None:
    """Draw series of a day against the hour; `held`: as steps with a legend, without tick labels."""
    for values, colour, name in curves:
        axes.plot(hours, values, color=colour, lw=1.0, label=name, drawstyle="steps-post" if held else None)
    axes.set_ylabel(label)
    axes.set_xlim(0, float(hours[-1]))
    if held:
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
    for values, colour, name in curves:
        axes.plot(at, values, color=colour, lw=1.0, label=name, marker="o" if marks else "", ms=1.8)
    if not any(name for _, _, name in curves):
        axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_ylabel(label)
    style.date_axis(axes, dates[0], dates[-1], labels=dated)


def response(
    axes: Axes, fir: Floats, sd: Floats | None, delay: float, unit: str, rounded: bool = False
) -> None:
    """Draw an impulse response with its delay and, where given, two standard deviations to either side."""
    estimates.response(axes, fir, delay=delay, sd=sd, rounded=rounded)
    axes.set_ylabel(f"response [{response_unit(unit)}]" if unit else "response")


def by_delay(
    axes: Axes, candidates: Any, values: Floats, delay: float, order: int, label: str, empty: str = "",
    rounded: bool = False,
) -> None:  # fmt: skip
    """Draw a criterion (a line) or probabilities (bars) of the delays; `empty`: why there are none.

    `rounded`: a delay stands for the lags that round to it, not for those from d to d + 1.
    """
    if label == "probability" and np.isfinite(values).any():
        axes.bar(candidates + (0.0 if rounded else 0.5), values, 0.8, color=style.INK)
        axes.set_ylim(0, 1)
    elif label == "probability":
        style.message(axes, empty)
    else:
        axes.plot(candidates, values, color=style.INK, lw=1.0, marker="o", ms=2.6)
    estimates.delay_band(axes, delay, rounded)
    axes.set_ylabel(label)
    axes.set_xlabel("lag and delay [samples]")
    axes.set_xlim(-0.5, order - 0.5)


def responses(axes: Axes, fir: Floats, delay: Floats) -> None:
    """Draw the time-day representation of days without dates."""
    estimates.tdr(axes, np.arange(len(fir)) + 1, fir, lag=delay)
    axes.set_xlabel("day")


def horizon_errors(
    axes: Axes, hours: Sequence[float], before: Sequence[float], after: Sequence[float], unit: str
) -> None:
    """Draw two bars for each prediction horizon."""
    if not hours:
        style.message(axes, "no days kept apart for validation")
        return
    at = np.arange(len(hours))
    axes.bar(at - 0.2, before, 0.38, color=style.ACCENT)
    axes.bar(at + 0.2, after, 0.38, color=style.WATER)
    axes.set_xticks(at, [f"{h:g} h ahead" for h in hours])
    axes.set_ylabel(f"error [{unit}]")
