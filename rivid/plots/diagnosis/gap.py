"""The gap: how far the simulation is off after an hour, four and a day, before and after each step."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, MaxNLocator

from rivid.plots import style
from rivid.plots.diagnosis.panels import AFTER, BEFORE, heading, panel
from rivid.plots.style import FigureFile
from rivid.text import shorten

ROW = 0.36
LEFT, RIGHT, BETWEEN, BOTTOM, TOP = 2.45, 0.3, 0.62, 0.62, 1.04
LONGEST = 36
"""Letters of a row's name; the page's table has the whole."""


@dataclass(frozen=True)
class Row:
    """A simulation and its errors.

    Attributes
    ----------
    words : str
    errors : tuple of float
        RMSE at each horizon, in the figure's unit; NaN where nothing could be judged.
    described : bool
        Whether its events are timed on the day itself, which no forecast can know.
    """

    words: str
    errors: tuple[float, ...]
    described: bool = False


def draw(
    folder: Path, *, rows: Sequence[Row], hours: Sequence[float], floor: Sequence[float] | None, unit: str,
    days: str,
) -> FigureFile:  # fmt: skip
    """Draw diagnosis_gap.png: a panel for each horizon, a bar for each simulation.

    Parameters
    ----------
    folder : Path
    rows : sequence of Row
        The first is without any effect.
    hours : sequence of float
        Horizons [h], as many as each row has errors.
    floor : sequence of float or None
        What weather and gauge alone leave, where that is known.
    unit : str
        Of the errors.
    days : str
        The days kept apart, in words.

    Returns
    -------
    FigureFile
    """
    height = TOP + BOTTOM + ROW * len(rows)
    page = style.sheet("The gap on the days kept apart", f"{days} · root mean square error", height=height)
    page.axes.remove()
    width = (style.WIDTH - LEFT - RIGHT - BETWEEN * (len(hours) - 1)) / len(hours)
    y = np.arange(len(rows), dtype=float)[::-1]
    for i, h in enumerate(hours):
        axes = panel(page, LEFT + i * (width + BETWEEN), BOTTOM, width, ROW * len(rows))
        axes.spines["left"].set_color(style.LIGHT)
        values = [row.errors[i] for row in rows]
        finite = [v for v in [*values, *(floor[i : i + 1] if floor is not None else ())] if np.isfinite(v)]
        top = max(finite, default=0.0) or 1.0
        axes.set_xlim(0, 1.28 * top)
        axes.set_ylim(-0.5, len(rows) - 0.5)
        for place, row, value in zip(y, rows, values, strict=True):
            if np.isfinite(value):
                axes.barh(place, value, 0.62, **_look(row, row is rows[0]))
            words = _spelt(value) if np.isfinite(value) else "too few samples"
            axes.annotate(
                words, (value if np.isfinite(value) else 0.0, place), xytext=(4, 0),
                textcoords="offset points", va="center", fontsize=8, zorder=4,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
            )  # fmt: skip
        if floor is not None and np.isfinite(floor[i]):
            axes.axvline(floor[i], color=style.INK, lw=1.0, ls=(0, (3, 2)))
        axes.xaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
        axes.set_xlabel(f"error [{unit}]")
        axes.yaxis.set_major_locator(FixedLocator(y.tolist()))
        axes.tick_params(axis="y", length=0)
        axes.set_yticklabels([shorten(row.words, LONGEST) for row in rows] if i == 0 else [])
        heading(axes, f"{h:g} h ahead", fontweight="bold")
    _key(page, rows, floor is not None)
    path = folder / "diagnosis_gap.png"
    style.save(page.figure, path)
    caption = _CAPTION + (_EVENTS if any(row.described for row in rows) else "")
    return style.figure_file(page, "diagnosis_gap", "", path, "The gap on the days kept apart", caption)


def _look(row: Row, first: bool) -> dict[str, Any]:
    if first:
        return {"color": BEFORE}
    if row.described:
        return {"facecolor": "white", "edgecolor": AFTER, "hatch": "/////", "linewidth": 0.8}
    return {"color": AFTER}


def _spelt(value: float) -> str:
    return f"{value:.0f}" if value >= 19.95 else f"{value:.1f}" if value >= 0.95 else f"{value:.2g}"


def _key(page: style.Sheet, rows: Sequence[Row], floor: bool) -> None:
    handles: list[Any] = [Patch(facecolor=BEFORE, label="without any effect")]
    if any(not row.described for row in rows[1:]):
        handles.append(Patch(facecolor=AFTER, label="effects added, as known beforehand"))
    if any(row.described for row in rows):
        handles.append(
            Patch(
                facecolor="white",
                edgecolor=AFTER,
                hatch="/////",
                linewidth=0.8,
                label="events timed on the day",
            )
        )
    if floor:
        handles.append(
            Line2D([], [], color=style.INK, lw=1.0, ls=(0, (3, 2)), label="weather and gauge alone")
        )
    height = float(page.figure.get_size_inches()[1])
    page.figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0.68 / style.WIDTH, 1 - 0.58 / height),
        ncols=len(handles),
    )


_CAPTION = (
    "At many moments of the days that nothing was fitted to or chosen by, the simulation is set to the "
    "measurement and runs on by itself. The bars say how far off it is, root mean square, some hours later."
)
_EVENTS = (
    " Hatched: the size and time of each event are taken from the day itself, which no forecast can know."
)
