"""t50 of a river: over the record, and against the mean inflow, with the hydraulic bounds (5)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.plots import style
from rivid.plots.dates import calendar
from rivid.plots.delay_map import MARKS, bound_lines
from rivid.plots.discharge import bounds_over_flow, flow_axis
from rivid.plots.style import FigureFile
from rivid.results.passage import CLEAR, has_t50, thirds
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import day_numbers
from rivid.text import count, day_range, duration
from rivid.types import Bools, Floats

FAR = 6.0
"""Days so many interquartile ranges beyond the quartiles are marked at the edge: one must not squeeze all."""

ROOM = 2.5
"""A bound widens the panel up to so many times what the days need; beyond, it is cut or told in words."""


def window(t50: Floats, bounds: list[Floats]) -> tuple[float, float]:
    """Lags [samples] the panel shows: the days, and the bounds that leave them enough room.

    Parameters
    ----------
    t50 : ndarray, shape (n,)
        At least one [samples].
    bounds : list of ndarray
        Travel times [samples], the nearest first.

    Examples
    --------
    >>> low, high = window(np.array([24.0, 26.0, 30.0]), [np.array([22.0, 33.0]), np.array([8.0, 9.0])])
    >>> round(low, 1), round(high, 1)
    (21.3, 33.7)
    """
    first, third = (float(q) for q in np.quantile(t50, (0.25, 0.75)))
    reach = FAR * (third - first) or np.inf
    near = t50[(t50 >= first - reach) & (t50 <= third + reach)]
    low, high = float(near.min()), float(near.max())
    most = ROOM * max(high - low, 2.0)
    for tau in bounds:
        wider = min(low, float(tau.min())), max(high, float(tau.max()))
        if wider[1] - wider[0] <= most:
            low, high = wider
    margin = max(0.06 * (high - low), 0.6)
    return low - margin, high + margin


def draw(results: Results, estimator: EstimatorResults, folder: Path) -> FigureFile:
    """Draw t50 of each day over the record.

    Parameters
    ----------
    results : Results
        A river's.
    estimator : EstimatorResults
        With at least one row.
    folder : Path
        Where ``t50_<estimator>.png`` goes.

    Returns
    -------
    FigureFile

    Notes
    -----
    Source: the bounds are (5). A travel time tau compares with t50 directly, at tau / T_s.
    """
    e, dates = estimator, estimator.dates
    shown = has_t50(e)
    page = style.sheet(
        f"t50 of each day: {e.estimator}",
        f"{results.reach} · half of a step has arrived · {ESTIMATORS[e.estimator].words} · "
        f"{count(int(shown.sum()), 'day')} of {len(dates):,}, {day_range(dates[0], dates[-1])}",
    )
    calendar(page, dates, e.status)
    handles = _panel(page, results, e, shown, day_numbers(dates), grow=1.0)
    if shown.any():
        page.axes.yaxis.grid(True)
        handles += bound_lines(page.axes, day_numbers(dates), e, results, lead=0.0)
        _time_axis(page, results.sample_time)
    style.key(page, handles)
    path = folder / f"t50_{e.estimator}.png"
    style.save(page.figure, path)
    return style.figure_file(page, "t50", e.estimator, path, "t50 of each day", _MAP_CAPTION)


def draw_discharge(results: Results, estimator: EstimatorResults, folder: Path) -> FigureFile:
    """Draw t50 against the mean inflow; parameters as of :func:`draw`, the file is ``t50_discharge_...``."""
    e = estimator
    shown = has_t50(e) & np.isfinite(e.mean_inflow)
    page = style.sheet(
        f"t50 and discharge: {e.estimator}",
        f"{results.reach} · half of a step has arrived · {ESTIMATORS[e.estimator].words} · "
        f"{count(int(shown.sum()), 'day')}",
        height=4.1,
    )
    axes = page.axes
    handles = _panel(page, results, e, shown, e.mean_inflow, grow=0.8)
    if shown.any():
        axes.grid(True)
        flow_axis(axes, e.mean_inflow[shown])
        handles += _medians(page, e)
        handles += bounds_over_flow(page, e, shown, results.sample_time)
        _time_axis(page, results.sample_time)
    else:
        style.no_ticks(axes)
    axes.set_xlabel("mean inflow of the data set [m³/s]")
    style.key(page, handles)
    path = folder / f"t50_discharge_{e.estimator}.png"
    style.save(page.figure, path)
    caption = _flow_caption(results, e)
    return style.figure_file(page, "t50_discharge", e.estimator, path, "t50 and discharge", caption)


def _panel(
    page: style.Sheet, results: Results, e: EstimatorResults, shown: Bools, x: Floats, *, grow: float
) -> list[object]:
    """The days as marks over x, on an axis of lags; their legend entries."""
    axes = page.axes
    axes.set_ylabel("t50 [samples]")
    if not shown.any():
        style.say(axes, f"None of the {count(len(e.dates), 'day')} has a t50.")
        axes.yaxis.set_ticks([])
        return []
    bounds = [tau[np.isfinite(tau)] / results.sample_time for tau in (e.bound_kinematic_s, e.bound_gravity_s)]
    low, high = window(e.t50[shown], [tau for tau in bounds if tau.size])
    style.lag_ticks(axes, low, high, bins=10)
    outside = shown & ((e.t50 < low) | (e.t50 > high))
    degenerate = shown & ~outside & np.array([s == "degenerate" for s in e.status], bool)
    plain = shown & ~outside & ~degenerate
    looks: list[tuple[str, Bools, Mapping[str, Any]]] = [
        ("t50", plain, MARKS["data decide"]),
        ("degenerate", degenerate, MARKS["degenerate"]),
        ("beyond this panel", outside, MARKS["at a bound"]),
    ]
    size = grow * float(np.clip(160 / np.sqrt(len(e.dates)) / 2.4, 2.4, 6.0))
    handles: list[object] = []
    for name, days, look in looks:
        if days.any():
            mark = {**look, "linestyle": "none", "markeredgewidth": 0.8}
            y = np.clip(e.t50[days], low, high)
            axes.plot(x[days], y, markersize=size, alpha=0.8, zorder=3, **mark)
            handles.append(style.dot(f"{name} ({int(days.sum()):,})", **{**mark, "markersize": 4.5}))
    return handles


def _medians(page: style.Sheet, e: EstimatorResults) -> list[object]:
    """The median of each third of the mean inflow, as a bar across it."""
    t = thirds(e)
    if t is None:
        return []
    for first, last, middle in zip(t.edges, t.edges[1:], t.medians, strict=False):
        for colour, width in (("white", 3.0), (style.ACCENT, 1.8)):  # a white edge reads on any marks
            page.axes.hlines(middle, first, last, colors=colour, linewidths=width, zorder=4)
    return [style.dot("median of each third of days", ls="-", color=style.ACCENT, lw=1.8)]


def _time_axis(page: style.Sheet, sample_time: float) -> None:
    style.second_axis(page.axes, sample_time, "t50 [minutes]")


def _flow_caption(results: Results, e: EstimatorResults) -> str:
    t = thirds(e)
    text = "Each mark is a data set: t50 against its mean inflow."
    if t is not None:
        low, _, high = (duration([m * results.sample_time]) for m in t.medians)
        text += f" The bars are the medians of the thirds of days, {low} at low and {high} at high flow"
        text += ": more water, a faster wave." if t.longer >= CLEAR else "."
    if not np.isfinite(e.bound_gravity_s).any():
        return text
    return (
        f"{text} The blue lines are the bounds of the travel time by the hydraulics: no wave is faster than "
        "the gravity wave, the kinematic wave is the slow bound."
    )


_MAP_CAPTION = (
    "One mark per day, at the lag by which half of a step of the inflow has arrived at the lower end. It is "
    "a travel time at the middle of the response and compares directly with the travel times of the waves at "
    "the day's discharge (blue, where they are known)."
)
