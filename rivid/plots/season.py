"""What each day says alone, and what the days say together."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch
from numpy.typing import NDArray

from rivid.plots import style
from rivid.plots.dates import date_axis
from rivid.plots.style import FigureFile
from rivid.results.season import Joined, SeasonDays
from rivid.results.selection import day_numbers
from rivid.text import count, day_range

DARKEST = 0.36
"""Opacity of a cell whose delay is certain: the band lies over it."""

BAND = 0.16
"""Opacity of the band."""

WAYS = {"forward": "each day knows those before it", "both": "each day knows all days"}


def draw(days: SeasonDays, joined: Joined, folder: Path) -> FigureFile:
    """Draw season.png.

    Parameters
    ----------
    days : SeasonDays
        With at least one day.
    joined : Joined
        Of these days.
    folder : Path
        Where ``season.png`` goes.

    Returns
    -------
    FigureFile
    """
    page = style.sheet(
        "Delay over the season: posterior-season",
        f"{days.reach} · {WAYS[joined.direction]} · {count(len(days.dates), 'day')}, "
        f"{day_range(days.dates[0], days.dates[-1])}",
    )
    axes, x = page.axes, day_numbers(days.dates)
    date_axis(axes, days.dates[0], days.dates[-1])
    middle, low, high = (
        days.place(joined.probability, share) - (0.0 if days.river else 0.5) for share in (0.5, 0.05, 0.95)
    )
    shown = np.concatenate([low, high, days.delay[np.isfinite(days.delay)]])
    style.lag_ticks(axes, float(shown.min()) - 1.3, float(shown.max()) + 1.3, bins=14)
    axes.yaxis.grid(True)
    _cells(axes, days)
    edge = np.array([x[0] - 0.5, *x, x[-1] + 0.5])  # so that a single day is a band too
    axes.fill_between(
        edge, *(np.r_[v[0], v, v[-1]] for v in (low, high)), color=style.WATER, alpha=BAND, lw=0, zorder=2.5
    )
    for v in (low, high):
        axes.plot(edge, np.r_[v[0], v, v[-1]], color=style.WATER, lw=0.5, alpha=0.6, zorder=2.6)
    axes.plot(edge, np.r_[middle[0], middle, middle[-1]], color=style.WATER, lw=1.4, zorder=3.2)
    handles: list[Any] = [
        Patch(color=style.INK, alpha=0.7 * DARKEST, lw=0, label="the day alone, p(d)"),
        style.dot("joined, median", ls="-", color=style.WATER, lw=1.4),
        Patch(color=style.WATER, alpha=BAND, lw=0, label="90 %"),
    ]
    other = np.isfinite(days.delay) & np.isfinite(joined.delay) & (days.delay != joined.delay)
    size = float(np.clip(70 / np.sqrt(len(x)), 3.0, 5.5))
    looks: list[tuple[str, NDArray[np.bool_], dict[str, Any]]] = [
        ("another delay than alone", other, {"marker": "o", "color": style.ACCENT}),
        ("the day says nothing", ~joined.observed,
         {"marker": "o", "color": style.WATER, "markerfacecolor": "white"}),
    ]  # fmt: skip
    for name, at, look in looks:
        if at.any():
            axes.plot(x[at], middle[at], ls="none", markersize=size, zorder=3.5, **look)
            handles.append(style.dot(f"{name} ({int(at.sum()):,})", **look, markersize=4.5))
    axes.set_ylabel("t50 [samples]" if days.river else "delay d [samples]")
    style.second_axis(axes, days.sample_time, "t50 [minutes]" if days.river else "d T_s [minutes]")
    style.key(page, handles)
    path = folder / "season.png"
    style.save(page.figure, path)
    return style.figure_file(page, "season", "posterior-season", path, "Delay over the season", _CAPTION)


def _cells(axes: Axes, days: SeasonDays) -> None:
    """p(d) of each day alone, the darker the likelier."""
    x, d = day_numbers(days.dates), days.candidates
    image = np.zeros((len(d), len(x), 4))
    image[..., :3] = to_rgb(style.INK)
    image[..., 3] = DARKEST * np.nan_to_num(days.probability).T
    limits = axes.get_xlim(), axes.get_ylim()
    extent = (x[0] - 0.5, x[-1] + 0.5, float(d[0]) - 0.5, float(d[-1]) + 0.5)
    axes.imshow(image, origin="lower", aspect="auto", interpolation="nearest", extent=extent, zorder=1.5)
    axes.set(xlim=limits[0], ylim=limits[1])


_CAPTION = (
    "Grey cells are what each day says alone, the darker the likelier. The line is the median of what the "
    "days say together, between 5 and 95 %. Vermilion: the day alone gave another delay. Hollow: the day "
    "says nothing of its own."
)
