"""What the pictures of a diagnosis share: several panels on a sheet, dates on a narrow axis, colours."""

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import FixedFormatter, FixedLocator, NullFormatter

from rivid.plots import style
from rivid.plots.dates import Ticks, date_axis, date_ticks
from rivid.types import Floats

BEFORE, AFTER = style.ACCENT, style.WATER
WITHOUT, WITH = "without the named effects", "with the named effects"
LABEL_WIDTH = 0.52
"""Room that a day's label needs [inch]."""

SIGNED = LinearSegmentedColormap.from_list(
    "less and more water", ["#5A3A0B", "#A66F1E", "#DDBE86", "#FAFAF8", "#8CCBC1", "#22867D", "#033E37"], 255
)
"""Brown where water is missing that the logs have, teal where there is more than they have."""


@dataclass(frozen=True)
class Window:
    """Dates on which a named effect acts, both ends included."""

    words: str
    first: dt.date
    last: dt.date


def panel(page: style.Sheet, left: float, bottom: float, width: float, height: float) -> Axes:
    """A panel at a place of the sheet given in inches."""
    w, h = (float(v) for v in page.figure.get_size_inches())
    axes = page.figure.add_axes((left / w, bottom / h, width / w, height / h))
    axes.spines["right"].set_visible(False)
    return axes


def heading(axes: Axes, text: str, *, up: float = 4.0, **look: Any) -> None:
    """A line of words over the left end of a panel."""
    given: dict[str, Any] = {"fontsize": 8.5, "color": style.INK} | look
    axes.annotate(
        text, (0, 1), xycoords="axes fraction", xytext=(0, up), textcoords="offset points", ha="left",
        va="bottom", **given,
    )  # fmt: skip


def narrow_dates(axes: Axes, first: dt.date, last: dt.date, width: float) -> None:
    """Dates as the x axis of a panel `width` inches wide: as many labels as have room."""
    date_axis(axes, first, last)
    ticks = thinned(date_ticks(first, last), max(int(width / LABEL_WIDTH), 1))
    axes.xaxis.set_major_locator(FixedLocator(ticks.lines))
    axes.xaxis.set_major_formatter(NullFormatter())
    axes.xaxis.set_minor_locator(FixedLocator(ticks.places))
    axes.xaxis.set_minor_formatter(FixedFormatter(ticks.labels))


def thinned(ticks: Ticks, most: int) -> Ticks:
    """Every second, third, ... label, so that `most` remain; a year moves on to the next label that stays.

    Examples
    --------
    >>> thinned(Ticks([1.0], [1.0, 2.0, 3.0, 4.0], ["Nov\\n2023", "Dec", "Jan\\n2024", "Feb"]), 2).labels
    ['Nov\\n2023', 'Jan\\n2024']
    >>> thinned(Ticks([1.0], [1.0, 2.0, 3.0], ["Dec\\n2023", "Jan\\n2024", "Feb"]), 2).labels
    ['Dec\\n2023', 'Feb\\n2024']
    """
    every = -(-len(ticks.labels) // most)
    labels, year = [], ""
    for i, label in enumerate(ticks.labels):
        name, _, own = label.partition("\n")
        year = own or year
        if i % every == 0:
            labels.append(f"{name}\n{year}" if year else name)
            year = ""
    alike = len(ticks.lines) == len(ticks.places)
    return Ticks(ticks.lines[::every] if alike else ticks.lines, ticks.places[::every], labels)


def hour_axis(axes: Axes, every: int = 6) -> None:
    """Hours of the day as the x axis."""
    axes.set_xlim(0, 24)
    axes.xaxis.set_major_locator(FixedLocator(list(range(0, 25, every))))


def limits(*curves: Floats, part: float = 1.0) -> float:
    """The largest size of all values, or of a share `part` of each curve; 1 where there is none."""
    sizes = [np.abs(c[np.isfinite(c)]) for c in curves]
    found = [float(np.quantile(s, part)) for s in sizes if s.size]
    return max(found, default=0.0) or 1.0


def shade(axes: Axes, windows: Sequence[Window]) -> None:
    """The dates of each effect as a grey field."""
    for window in windows:
        axes.axvspan(
            window.first.toordinal() - 0.5, window.last.toordinal() + 0.5, color=style.FAINT, lw=0, zorder=0
        )
