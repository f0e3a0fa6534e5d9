"""A forecast as a shift engineer needs it: what is under way, when it arrives, and the band of the output."""

from pathlib import Path
from typing import Any

import matplotlib.dates
import numpy as np
from matplotlib.axes import Axes

from rivid.forecast import LEVELS, Forecast
from rivid.plots import style
from rivid.plots.files import FigureFile
from rivid.text import duration

mdates: Any = matplotlib.dates  # it has no types
BEFORE = 1.0  # time that is shown before the origin, over that after it
OUTER, INNER = 0.16, 0.3  # opacities of the 90 and the 50 % band


def draw(found: Forecast, name: str, unit: str, folder: Path) -> FigureFile:
    s, title = found.series, "The next hours"
    note = f"{name} · from {s.moment(s.now):%Y-%m-%d %H:%M} · half of a wave arrives after "
    with style.styled():
        figure, (above, below) = style.sheet(
            title, note + duration([found.delay_s]), [2.2, 1.5], gap=(0.65, 0.5),
            left=0.95, right=0.45,  # levels have up to seven digits
        )  # fmt: skip
        output(above, found, unit)
        flows(below, found)
        for ax in (above, below):
            style.key(ax)
            ax.yaxis.grid(True)
            ax.axvline(mdates.date2num(s.moment(s.now)), color=style.GREY, lw=0.8)
            locator = mdates.AutoDateLocator(tz=s.begin.tzinfo, minticks=4, maxticks=9)
            formatter = mdates.ConciseDateFormatter(locator, tz=s.begin.tzinfo, show_offset=False)
            formatter.zero_formats[3] = "%d %b"  # at midnight; the note above has the year
            ax.xaxis.set_major_locator(locator)
            ax.xaxis.set_major_formatter(formatter)
        above.tick_params(axis="x", labelbottom=False)
        return style.written(
            figure, folder / "forecast.png", title, held=found.announced < found.quantiles.shape[1],
            repeated=found.repeated is not None,
        )  # fmt: skip


def _shown(found: Forecast) -> tuple[slice, np.ndarray]:
    """Samples that are shown, and their places on the axis."""
    s = found.series
    ahead = len(s.time) - 1 - s.now
    part = slice(max(s.now - round(BEFORE * ahead), 0), None)
    begin = mdates.date2num(s.moment(0))
    return part, begin + (s.time - s.time[0])[part] / 86400.0


def output(ax: Axes, found: Forecast, unit: str) -> None:
    """The measured output, and after the origin the median with its bands."""
    s, (part, x) = found.series, _shown(found)
    later = x[-found.quantiles.shape[1] :]
    ax.plot(x, s.output[part], color=style.INK, lw=1.1, label="measured")
    for (low, high), alpha in (((0, 4), OUTER), ((1, 3), INNER)):
        share = f"{LEVELS[high] - LEVELS[low]:.0%}".replace("%", " %")
        ends = found.quantiles[low], found.quantiles[high]
        ax.fill_between(later, *ends, color=style.WATER, alpha=alpha, lw=0, label=share)
    ax.plot(later, found.quantiles[2], color=style.WATER, lw=1.4, label="median")
    ax.set_xlim(x[0], x[-1])
    ax.set_ylabel("level [m]" if unit == "m" else "discharge [m³/s]")


def flows(ax: Axes, found: Forecast) -> None:
    """The flows of the dams, dashed where they are held, and the known inflow as half of it arrives."""
    s, (part, x) = found.series, _shown(found)
    known = np.arange(len(s.time))[part] <= s.now + found.announced
    series = [("inflow", s.inflow, style.WATER), ("outflow", s.outflow, style.ACCENT)]
    for label, values, colour in series[: 2 if s.outflow.any() else 1]:
        ax.plot(x, np.where(known, values[part], np.nan), color=colour, lw=1.1, label=label)
        ax.plot(x, np.where(~known, values[part], np.nan), color=colour, lw=1.0, ls="--")
    arrives = x[known] + found.delay_s / 86400.0
    ax.plot(
        arrives, s.inflow[part][known], color=style.WATER, lw=0.9, alpha=0.45, label="inflow as it arrives"
    )
    if not known.all():
        ax.plot([], [], color=style.GREY, lw=1.0, ls="--", label="held")
    if found.repeated is not None:
        later = slice(-int((~known).sum()), None)
        label = "of the day before"
        ax.plot(x[later], found.repeated[later], color=style.WATER, lw=1.0, ls=":", label=label)
    ax.set_xlim(x[0], x[-1])
    ax.set_ylabel("flow [m³/s]")
