"""Delay against mean discharge, with the hydraulic bounds (5)."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from rivid.estimators import ESTIMATORS
from rivid.plots import style
from rivid.plots.delay_map import MARKS
from rivid.plots.style import FigureFile
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import candidates, found, kinds
from rivid.text import count, duration, no_jump, trust
from rivid.types import Floats

GOLDEN = 0.6180339887498949


def spread(n: int) -> Floats:
    """Small vertical shifts of n marks [samples], evenly spread in (-0.3, 0.3), the same each time."""
    steps = np.arange(1, n + 1, dtype=np.float64) * GOLDEN % 1.0
    return 0.6 * steps - 0.3


def draw(results: Results, estimator: EstimatorResults, folder: Path) -> FigureFile:
    """Draw (d + 1) T_s against the mean inflow for an estimator that has candidates.

    Parameters
    ----------
    results : Results
        All of the run, for what its estimators share.
    estimator : EstimatorResults
        With at least one candidate.
    folder : Path
        Where ``delay_discharge_<estimator>.png`` goes.

    Returns
    -------
    FigureFile

    Notes
    -----
    Source: (5). The first sample at which the output moves is d + 1, so the travel time of the wave lies
    between d T_s and (d + 1) T_s.
    """
    e = estimator
    shown = found(e) & np.isfinite(e.mean_inflow)
    n = int(shown.sum())
    page = style.sheet(
        f"Delay and discharge: {e.estimator}",
        f"{results.reach} · {ESTIMATORS[e.estimator].words} · {count(n, 'day')}",
        height=4.1,
    )
    axes = page.axes
    tried = candidates(e)
    if tried.size:
        style.lag_ticks(axes, float(tried[0]) + 0.2, float(tried[-1]) + 1.8, bins=16)
    axes.grid(True)
    handles: list[object] = []
    if n:
        Q = e.mean_inflow
        shift = spread(len(Q))
        size = float(np.clip(70 / np.sqrt(n), 2.0, 5.5))
        for name, days in kinds(e).items():
            days = days & shown
            if days.any():
                mark = {**MARKS[name], "linestyle": "none", "markeredgewidth": 0.7}
                y = (e.delay + 1 + (shift if n > 12 else 0))[days]
                axes.plot(Q[days], y, markersize=size, alpha=0.75, zorder=3, **mark)
                handles.append(
                    style.dot(
                        f"{trust(name, e.estimator)} ({int(days.sum()):,})", **{**mark, "markersize": 4.5}
                    )
                )
        flow_axis(axes, Q[shown])
        handles += bounds_over_flow(page, e, shown, results.sample_time)
    else:
        style.say(axes, f"None of the {count(len(e.dates), 'day')} has a delay and a mean inflow.")
        style.no_ticks(axes)
    axes.set_xlabel("mean inflow of the day [m³/s]")
    axes.set_ylabel("first sample that moves, d + 1")
    if tried.size:
        style.second_axis(axes, results.sample_time, "(d + 1) T_s [minutes]")
    else:
        axes.yaxis.set_ticks([])
    style.key(page, handles)
    path = folder / f"delay_discharge_{e.estimator}.png"
    style.save(page.figure, path)
    return style.figure_file(
        page, "delay_discharge", e.estimator, path, "Delay and discharge", _caption(results, e)
    )


def flow_axis(axes: Axes, Q: Floats) -> None:
    """The mean inflows of the days as the x axis."""
    low, high = float(Q.min()), float(Q.max())
    margin = 0.04 * (high - low) or max(0.1 * abs(high), 1.0)
    axes.set_xlim(low - margin, high + margin)


def bounds_over_flow(
    page: style.Sheet, e: EstimatorResults, shown: NDArray[np.bool_], sample_time: float
) -> list[object]:
    """Both bounds (5) at tau / T_s over discharge; one that is not in the panel is told in words."""
    axes = page.axes
    low, high = axes.get_ylim()
    lines: list[object] = []
    outside: list[str] = []
    for name, seconds, dash in (
        ("gravity wave", e.bound_gravity_s, "-"),
        ("kinematic wave", e.bound_kinematic_s, (0, (4, 2))),
    ):
        known = np.isfinite(e.mean_inflow) & np.isfinite(seconds)
        if not (known & shown).any():
            continue
        Q, tau = e.mean_inflow[known], seconds[known]
        order = np.argsort(Q, kind="stable")
        Q, tau = _smooth(Q[order]), _smooth(tau[order])
        inside = (tau / sample_time >= low) & (tau / sample_time <= high)
        if inside.any():
            if len(Q) == 1:
                Q, tau = np.array(axes.get_xlim()), np.repeat(tau, 2)
            lines += axes.plot(
                Q,
                tau / sample_time,
                color=style.WATER,
                lw=1.2,
                ls=dash,
                label=name,
                scalex=False,
                scaley=False,
            )
        else:
            side = "above" if tau.min() / sample_time > high else "below"
            span = duration([float(tau.min()), float(tau.max())])
            outside.append(f"{name}: {span}, {side} this panel")
    if outside:  # at the top right: where much water flows, few delays are long
        axes.text(
            0.995, 0.98, "\n".join(outside), transform=axes.transAxes, ha="right", va="top", fontsize=8,
            color=style.WATER, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5, "alpha": 0.85},
        )  # fmt: skip
    return lines


def _smooth(values: Floats, groups: int = 60) -> Floats:
    """Medians of equal groups of sorted days: a line, not the scatter of each day's depth."""
    if len(values) <= 2 * groups:
        return values
    return np.array([np.median(part) for part in np.array_split(values, groups)])


def _caption(results: Results, e: EstimatorResults) -> str:
    text = _CAPTION
    if np.isfinite(e.bound_gravity_s).any():
        text += f" {_BOUNDS}"
    return text if results.output_unit == "m" else f"{text} {no_jump(e.estimator)}"


_CAPTION = (
    "Each mark is a day, at the first sample that moves, d + 1, and so at (d + 1) T_s. Marks of equal delay "
    "are spread a little to show how many they are. The wave itself arrives between d T_s and (d + 1) T_s."
)

_BOUNDS = (
    "No wave is faster than the gravity wave (full line); the kinematic wave (dashed) is the slow bound."
)
