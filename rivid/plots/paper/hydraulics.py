"""Figs 2-6: discharge, level, Froude number and the bounds of the travel time, day by day and by flow."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from rivid.core.hydraulics import travel_bounds
from rivid.plots import style
from rivid.plots.dates import date_axis
from rivid.plots.delay_map import with_gaps
from rivid.plots.paper.sheets import PaperFigure, Sheet, legend, save, sheet
from rivid.plots.paper.year import Year
from rivid.results.selection import day_numbers
from rivid.text import count, number, share
from rivid.types import Floats

OFTEN = 500.0
"""The paper counts the days below this discharge [m3/s]."""


def draw(year: Year, folder: Path) -> list[PaperFigure]:
    """Draw Figs 2-6.

    Parameters
    ----------
    year : Year
    folder : Path
        Where ``fig02.svg`` and so on go, each with its PNG.

    Returns
    -------
    list of PaperFigure
    """
    return [
        discharge(year, folder),
        level(year, folder),
        froude(year, folder),
        bounds_by_flow(year, folder),
        bounds_by_day(year, folder),
    ]


def daily_range(days: tuple[Floats, ...]) -> float:
    """Mean over the days of the peak-to-peak variation."""
    return float(np.mean([np.ptp(day) for day in days]))


def discharge(year: Year, folder: Path) -> PaperFigure:
    """Fig. 2: mean daily discharge."""
    Q = year.discharge
    where = "downstream" if year.outflow else "upstream"
    swing = daily_range(year.outflow or year.inflow)
    facts = (
        f"{Q.min():.0f} to {Q.max():.0f} m³/s, below {OFTEN:.0f} m³/s on "
        f"{share(int((Q < OFTEN).sum()), len(Q))} of days; over a day it moves by {swing:.0f} m³/s"
    )
    page = _by_day(year, "2", "Mean daily discharge", facts, Q, "discharge [m³/s]")
    page.panels[0].set_ylim(0, 1.08 * Q.max())
    caption = f"Mean of each day's command at the dam {where}."
    return save(page, folder, "fig02", "2", "Mean daily discharge", caption)


def level(year: Year, folder: Path) -> PaperFigure:
    """Fig. 3: mean daily level at the downstream dam."""
    h = year.mean_level
    facts = f"{h.min():.2f} to {h.max():.2f} m; over a day it moves by {daily_range(year.level):.2f} m"
    page = _by_day(year, "3", "Mean daily level", facts, h, "level [m above the datum]")
    caption = "Mean of each day's level at the downstream dam."
    return save(page, folder, "fig03", "3", "Mean daily level", caption)


def froude(year: Year, folder: Path) -> PaperFigure:
    """Fig. 4: mean daily Froude number (6)."""
    F = year.bounds.froude
    facts = f"{F.min():.3f} to {F.max():.3f}; the bounds (5) hold below 2"
    page = _by_day(year, "4", "Mean daily Froude number", facts, F, "Froude number [-]")
    page.panels[0].set_ylim(0, 1.08 * float(F.max()))
    caption = "Inertial over gravity forces (6), from the day's mean discharge."
    return save(page, folder, "fig04", "4", "Mean daily Froude number", caption)


def bounds_by_flow(year: Year, folder: Path) -> PaperFigure:
    """Fig. 5: bounds of the travel time (5) against the flow."""
    reach, T = year.config.reach, year.sample_time
    low, high = reach.discharge_range
    Q = np.linspace(low, high, 200)
    bounds = travel_bounds(Q, length=reach.length, width=reach.width, depth=reach.depth)
    title = "Bounds of the travel time against the flow"
    page = sheet(
        "5", title,
        f"{number(reach.length / 1000)} km, {number(reach.width)} m wide, {number(reach.depth)} m deep · "
        f"gravity wave {bounds.gravity[-1] / T:.1f} to {bounds.gravity[0] / T:.1f} T_s, kinematic wave "
        f"{bounds.kinematic[-1] / T:.0f} to {bounds.kinematic[0] / T:.0f} T_s (T_s = {T:g} s)",
    )  # fmt: skip
    axes = page.panels[0]
    _two_bounds(page, Q, bounds.gravity / T, bounds.kinematic / T)
    axes.set_xlim(low, high)
    axes.set_xlabel("flow [m³/s]")
    _travel_time_axis(axes, T)
    caption = "A gravity wave hardly cares how much water flows; a kinematic wave does."
    return save(page, folder, "fig05", "5", title, caption)


def bounds_by_day(year: Year, folder: Path) -> PaperFigure:
    """Fig. 6: the same bounds for each day's mean discharge and Froude number."""
    bounds, T = year.bounds, year.sample_time
    title = "Bounds of the travel time of each day"
    g, k = bounds.gravity / T, bounds.kinematic / T
    page = sheet(
        "6", title,
        f"{_who(year)} · gravity wave {g.min():.1f} to {g.max():.1f} T_s, kinematic wave {k.min():.0f} to "
        f"{k.max():.0f} T_s (T_s = {T:g} s)",
    )  # fmt: skip
    axes = page.panels[0]
    date_axis(axes, year.dates[0], year.dates[-1])
    x, g = with_gaps(day_numbers(year.dates), g)
    _two_bounds(page, x, g, with_gaps(day_numbers(year.dates), k)[1])
    _travel_time_axis(axes, T)
    caption = "The bounds of Fig. 5 for each day's mean discharge (Fig. 2) and Froude number (Fig. 4)."
    return save(page, folder, "fig06", "6", title, caption)


def _who(year: Year) -> str:
    return f"{year.config.reach.name} · {count(len(year.dates), 'day')}"


def _by_day(year: Year, number: str, title: str, facts: str, values: Floats, label: str) -> Sheet:
    """One line over the days of the record, broken where days are missing."""
    page = sheet(number, title, f"{_who(year)} · {facts}", height=2.4, legend=False, right=0.3)
    axes = page.panels[0]
    date_axis(axes, year.dates[0], year.dates[-1])
    alone = "o" if len(values) < 3 else ""
    axes.plot(*with_gaps(day_numbers(year.dates), values), color=style.INK, lw=1.1, marker=alone, ms=3)
    axes.set_ylabel(label)
    axes.grid(True, axis="y")
    axes.spines["right"].set_visible(False)
    return page


def _two_bounds(page: Sheet, x: Floats, gravity: Floats, kinematic: Floats) -> None:
    axes = page.panels[0]
    alone = "_" if len(x) < 3 else ""
    lines = []
    for name, values, width, alpha in (
        ("upper bound: kinematic wave", kinematic, 1.0, 0.6),
        ("lower bound: gravity wave", gravity, 2.2, 1.0),
    ):
        lines += axes.plot(x, values, color=style.WATER, lw=width, alpha=alpha, marker=alone, label=name)
    axes.set_ylim(0, 1.06 * float(np.nanmax(np.where(np.isfinite(kinematic), kinematic, gravity))))
    axes.grid(True, axis="y")
    legend(page, list(lines))


def _travel_time_axis(axes: Axes, sample_time: float) -> None:
    axes.set_ylabel("travel time [T_s]")
    style.second_axis(axes, sample_time, "[minutes]")
