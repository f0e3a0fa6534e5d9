"""The delay of each day over the record (Fig. 17), against the travel time of the wave that carries it."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from rivid.estimators import ESTIMATORS
from rivid.plots import style
from rivid.plots.dates import calendar
from rivid.plots.style import FigureFile
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import candidates, day_numbers, found, kinds
from rivid.text import (
    count,
    day_range,
    no_jump,
    output_words,
    trust,
)
from rivid.types import Floats

MARKS: dict[str, dict[str, Any]] = {
    "data decide": {"marker": "o", "color": style.INK},
    "data do not decide": {"marker": "o", "color": style.GREY, "markerfacecolor": "white"},
    "degenerate": {"marker": "x", "color": style.GREY},
    "at a bound": {"marker": "^", "color": style.ACCENT},
}
"""How a day is marked; the last that holds for it counts."""


DARKEST = 0.45
"""Opacity of a cell whose delay is certain: marks and lines stay readable on it."""


def with_gaps(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """A line over days that breaks where days are missing: NaN between day numbers more than 1 apart."""
    breaks = np.flatnonzero(np.diff(x) > 1) + 1
    return np.insert(x, breaks, np.nan), np.insert(y, breaks, np.nan)


def draw(results: Results, estimator: EstimatorResults, folder: Path) -> FigureFile:
    """Draw the delay of each day for an estimator that has candidates.

    Parameters
    ----------
    results : Results
        All of the run, for what its estimators share.
    estimator : EstimatorResults
        With at least one candidate.
    folder : Path
        Where ``delay_map_<estimator>.png`` goes.

    Returns
    -------
    FigureFile

    Notes
    -----
    Source: Fig. 17; the bounds are (5). A travel time tau compares with (d + 1) T_s, so it is drawn at
    tau / T_s - 1.
    """
    e, dates = estimator, estimator.dates
    n = int(found(e).sum())
    page = style.sheet(
        f"Delay of each day: {e.estimator}",
        f"{results.reach} · {ESTIMATORS[e.estimator].words} · {count(n, 'day')} of {len(dates):,}, "
        f"{day_range(dates[0], dates[-1])}",
    )
    axes = page.axes
    calendar(page, dates, e.status)
    x = day_numbers(dates)
    tried = candidates(e)
    if tried.size:
        style.lag_ticks(axes, float(tried[0]) - 0.8, float(tried[-1]) + 0.8, bins=16)
        axes.yaxis.grid(True)
    _probabilities(axes, x, e)
    size = float(np.clip(160 / np.sqrt(len(dates)) / 2.4, 2.2, 6.0))
    handles: list[object] = []
    for name, days in kinds(e).items():
        if days.any():
            mark = {**MARKS[name], "linestyle": "none", "markeredgewidth": 0.8}
            axes.plot(x[days], e.delay[days], markersize=size, zorder=3, **mark)
            handles.append(
                style.dot(f"{trust(name, e.estimator)} ({int(days.sum()):,})", **{**mark, "markersize": 4.5})
            )
    if not n:
        style.say(axes, f"None of the {count(len(dates), 'day')} has a delay.")
    handles += bound_lines(axes, x, e, results, lead=1.0) if tried.size else []
    axes.set_ylabel("delay d [samples]")
    if tried.size:
        style.second_axis(axes, results.sample_time, "d T_s [minutes]")
    else:
        axes.yaxis.set_ticks([])
    style.key(page, handles)
    path = folder / f"delay_map_{e.estimator}.png"
    style.save(page.figure, path)
    return style.figure_file(
        page, "delay_map", e.estimator, path, "Delay of each day", _caption(e, results.output_unit)
    )


def _probabilities(axes: Axes, x: Floats, e: EstimatorResults) -> None:
    """p(d | y) of each day as a column of cells, the darker the likelier; nothing where there is none."""
    if e.probability is None:
        return
    first, d = int(x[0]), e.candidates
    p = np.zeros((len(d), int(x[-1]) - first + 1))
    p[:, (x - first).astype(int)] = np.nan_to_num(e.criterion).T
    image = np.zeros((*p.shape, 4))
    image[..., :3] = to_rgb(style.INK)
    image[..., 3] = DARKEST * p
    extent = (first - 0.5, x[-1] + 0.5, float(d[0]) - 0.5, float(d[-1]) + 0.5)
    limits = axes.get_xlim(), axes.get_ylim()
    axes.imshow(image, origin="lower", aspect="auto", interpolation="nearest", extent=extent, zorder=1.5)
    axes.set(xlim=limits[0], ylim=limits[1])


def bound_lines(axes: Axes, x: Floats, e: EstimatorResults, results: Results, *, lead: float) -> list[object]:
    """Lines of the travel times (5), where they are within the panel; their legend entries.

    A travel time tau is drawn at tau / T_s - `lead` samples: 1 for a delay d, 0 for t50.
    """
    low, high = axes.get_ylim()
    lines: list[object] = []
    bounds: list[tuple[str, Floats, Any]] = [("gravity wave", e.bound_gravity_s, "-")]
    if results.output_unit != "m":  # in a free river the flow arrives with the kinematic wave
        bounds.append(("kinematic wave", e.bound_kinematic_s, (0, (4, 2))))
    for name, seconds, dash in bounds:
        delay = seconds / results.sample_time - lead
        if np.any((delay >= low) & (delay <= high)):
            lines += axes.plot(
                *with_gaps(x, delay), color=style.WATER, lw=0.9, ls=dash, marker="_" if len(x) < 3 else "",
                label=f"{name}, as a delay" if lead else name, zorder=2, scalex=False, scaley=False,
            )  # fmt: skip
    return lines


def _caption(e: EstimatorResults, unit: str) -> str:
    name, text = e.estimator, "One mark per day. "
    if np.isfinite(e.bound_gravity_s).any():
        text += (
            "The blue line is the travel time of the wave at the day's discharge, as a delay: "
            f"travel time / T_s - 1, because the {output_words(unit)} first moves at lag d + 1. "
        )
    if ESTIMATORS[name].unjudged:
        text += "Triangles lie at d_min or d_max."
    elif ESTIMATORS[name].has_probability:
        text += (
            "Grey cells are the probability of each delay, the darker the likelier; a day of grey cells "
            "without a mark has no delay that is probable enough. Triangles lie at d_min or d_max."
        )
    else:
        text += (
            "Hollow marks are days whose data alone favour another delay, or none; "
            "triangles lie at d_min or d_max."
        )
    return text if unit == "m" else f"{text} {no_jump(name)}"
