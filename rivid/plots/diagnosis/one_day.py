"""One day that was kept apart: measured, simulated before and after, and the flows that caused it."""

import datetime as dt
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator

from rivid.plots import style
from rivid.plots.diagnosis.panels import AFTER, BEFORE, hour_axis, panel
from rivid.plots.style import FigureFile
from rivid.types import Bools, Floats

LEFT, RIGHT, BOTTOM, TOP = 0.82, 0.3, 0.55, 0.86
LOWER, BETWEEN, HEIGHT = 1.25, 0.42, 5.3
RANK = 0.8
"""Of the days kept apart, this share was simulated better than the one shown, before anything was added.

Not the worst of all: that is the day of a broken gauge more often than of a typical gap.
"""
WHOLE = 0.8
"""Share of the samples of a full day that must count."""


def errors(measured: Floats, simulated: Floats, used: Bools) -> Floats:
    """Root mean square of measured less simulated of each day, shape (days,); NaN where nothing counts."""
    there = used & np.isfinite(measured) & np.isfinite(simulated)
    squares = np.where(there, (measured - simulated) ** 2, 0.0).sum(axis=1)
    number = there.sum(axis=1)
    mean = np.divide(squares, number, out=np.full(len(measured), np.nan), where=number > 0)
    return np.asarray(np.sqrt(mean))


def choose(error: Floats, apart: Bools, used: Bools) -> int | None:
    """The day to show: of those kept apart and nearly whole, the one at :data:`RANK` of the errors.

    Parameters
    ----------
    error : ndarray, shape (days,)
        Of the simulation without the effects.
    apart : ndarray of bool, shape (days,)
    used : ndarray of bool, shape (days, n)

    Returns
    -------
    int or None
        A row; None where no day was kept apart.
    """
    number = used.sum(axis=1)
    known = np.flatnonzero(apart & np.isfinite(error))
    if not known.size:
        return None
    whole = known[number[known] >= WHOLE * number.max()]
    days = whole if whole.size else known
    order = days[np.argsort(error[days], kind="stable")]
    return int(order[round(RANK * (len(order) - 1))])


def draw(
    folder: Path, *, dates: Sequence[dt.date], hour: Floats, used: Bools, lead: int, apart: Bools,
    measured: Floats, before: Floats, after: Floats | None, inflow: Floats, outflow: Floats | None,
) -> FigureFile | None:  # fmt: skip
    """Draw diagnosis_day.png.

    Parameters
    ----------
    folder : Path
    dates : sequence of datetime.date, length days
    hour : ndarray, shape (days, n)
        Hour of the day of each sample [h].
    used : ndarray of bool, shape (days, n)
        Samples that count.
    lead : int
        Samples of each row that belong to the day before.
    apart : ndarray of bool, shape (days,)
        Days that nothing was fitted to or chosen by.
    measured, before, after : ndarray, shape (days, n)
        Level [m], or discharge of a river reach [m3/s]: measured, simulated without and with the effects;
        None where nothing was named.
    inflow, outflow : ndarray, shape (days, n)
        [m3/s]; no outflow for a river reach.

    Returns
    -------
    FigureFile or None
        None where no day was kept apart.
    """
    error = errors(measured, before, used)
    i = choose(error, apart, used)
    if i is None:
        return None
    river = outflow is None
    unit, factor, name = ("m³/s", 1.0, "discharge") if river else ("mm", 1000.0, "level")
    off = f"{factor * error[i]:.3g} {unit}"
    if after is not None:
        off += f" without and {factor * errors(measured, after, used)[i]:.3g} {unit} with the named effects"
    page = style.sheet(
        f"A day kept apart: {dates[i]}",
        f"The simulated {name} is off by {off} (root mean square)",
        height=HEIGHT,
        left=LEFT,
    )
    page.axes.remove()
    width = style.WIDTH - LEFT - RIGHT
    upper = panel(page, LEFT, BOTTOM + LOWER + BETWEEN, width, HEIGHT - TOP - BOTTOM - LOWER - BETWEEN)
    lower = panel(page, LEFT, BOTTOM, width, LOWER)
    clock, count = hour[i, lead:], used[i, lead:]

    def shown(values: Floats) -> Floats:
        return np.where(count, values[i, lead:], np.nan)

    upper.plot(clock, measured[i, lead:], color=style.INK, lw=1.6, label="measured")
    upper.plot(
        clock,
        shown(before),
        color=BEFORE,
        lw=1.4,
        ls=(0, (5, 2)),
        label="simulated without the named effects",
    )
    if after is not None:
        upper.plot(clock, shown(after), color=AFTER, lw=1.4, label="simulated with the named effects")
    else:
        upper.get_lines()[-1].set_label("simulated")
    upper.set_ylabel("discharge at the lower end [m³/s]" if river else "level at the dam [m]")
    lower.plot(clock, inflow[i, lead:], color=style.INK, lw=1.2, label="inflow")
    if outflow is not None:
        lower.plot(clock, outflow[i, lead:], color=style.GREY, lw=1.2, ls=(0, (4, 1.5)), label="outflow")
    lower.set_ylabel("flow [m³/s]")
    lower.set_xlabel("hour of the day")
    for axes in (upper, lower):
        hour_axis(axes, 3)
        axes.grid(True)
        axes.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
        axes.ticklabel_format(axis="y", useOffset=False)
        h = axes.get_position().height * HEIGHT
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1 + 0.06 / h), ncols=3)
    upper.tick_params(axis="x", labelbottom=False)
    path = folder / "diagnosis_day.png"
    style.save(page.figure, path)
    return style.figure_file(
        page, "diagnosis_day", "", path, f"A day kept apart: {dates[i]}", _caption(error, apart, i, name)
    )


def _caption(error: Floats, apart: Bools, i: int, name: str) -> str:
    others = error[apart & np.isfinite(error)]
    worse = int((others > error[i]).sum())
    rank = (
        f"of the {len(others)} days kept apart, the simulation without any effect was further off on {worse}"
    )
    return (
        f"The simulation starts from the first measured {name} of the day and is never set right after it; "
        f"it sees only the flows below. {rank[0].upper()}{rank[1:]}."
    )
