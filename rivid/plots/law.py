"""The travel time of each day against its discharge, and the law of both."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Patch

from rivid.core.law import DelayLaw
from rivid.plots import style
from rivid.plots.discharge import flow_axis
from rivid.plots.style import FigureFile
from rivid.results.season import SeasonDays
from rivid.text import count, duration
from rivid.types import Floats


def draw(days: SeasonDays, law: DelayLaw, folder: Path) -> FigureFile:
    """Draw delay_law.png.

    Parameters
    ----------
    days : SeasonDays
    law : DelayLaw
        Of these days, in seconds; without one the days are drawn, and why there is none.
    folder : Path
        Where ``delay_law.png`` goes.

    Returns
    -------
    FigureFile
    """
    what = "t50" if days.river else "travel time"
    shown = np.isfinite(days.travel) & np.isfinite(days.discharge)
    found = law.status == "ok"
    note = (
        f"T = {duration([law.T0])} (Q / {law.Q0:.0f} m³/s)^{-law.b:.2f}, {law.b_low:.2f} to {law.b_high:.2f}"
        if found
        else f"no law: {law.message}"
    )
    page = style.sheet(
        "Delay and discharge: the law",
        f"{days.reach} · {note} · {count(int(shown.sum()), 'day')}",
        height=4.1,
    )
    axes = page.axes
    handles: list[Any] = []
    if shown.any():
        Q, T = days.discharge[shown], days.travel[shown] / days.sample_time
        low, high = (
            end(days.place(days.probability, share)[shown], T)
            for end, share in ((np.minimum, 0.05), (np.maximum, 0.95))
        )
        flow_axis(axes, Q)
        style.lag_ticks(axes, *_window(T, low, high))
        axes.grid(True)
        axes.vlines(Q, low, high, colors=style.LIGHT, linewidths=0.8, alpha=0.6, zorder=1.5)
        size = float(np.clip(60 / np.sqrt(len(Q)), 2.0, 5.0))
        axes.plot(Q, T, "o", color=style.INK, markersize=size, markeredgewidth=0, alpha=0.75, zorder=2.5)
        handles.append(
            style.dot(
                "a day; bar: 5 to 95 % of its probability", marker="o", color=style.INK, markersize=4,
                markeredgewidth=0,
            )
        )  # fmt: skip
        handles += _law(axes, law, Q, days.sample_time) if found else []
        style.second_axis(axes, days.sample_time, f"{what} [minutes]")
    else:
        style.say(axes, f"None of the {count(len(days.dates), 'day')} has a travel time and a discharge.")
        style.no_ticks(axes)
        axes.yaxis.set_ticks([])
    axes.set_xlabel("mean inflow [m³/s]")
    axes.set_ylabel(f"{what} [samples]")
    style.key(page, handles)
    path = folder / "delay_law.png"
    style.save(page.figure, path)
    return style.figure_file(page, "delay_law", "posterior", path, "Delay and discharge: the law", _CAPTION)


def _window(T: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """All days, and nearly all of their bars: one day that is unsure must not squeeze the others."""
    bottom = min(float(T.min()), float(np.quantile(low, 0.02)))
    top = max(float(T.max()), float(np.quantile(high, 0.98)))
    return bottom - 0.5, top + 0.5


def _law(axes: Any, law: DelayLaw, Q: Floats, T_s: float) -> list[Any]:
    """The law over the discharges seen, its interval, and that of a single day; their legend entries."""
    q = np.geomspace(Q.min(), Q.max(), 200)
    middle, low, high = (v / T_s for v in law.delay(q))
    t = law.table
    axes.fill_between(q, low, high, color=style.ACCENT, alpha=0.3, lw=0, zorder=2.7)
    for colour, width in (("white", 3.0), (style.ACCENT, 1.7)):  # a white edge reads on any marks
        axes.plot(q, middle, color=colour, lw=width, zorder=3, scalex=False, scaley=False)
    dashes = {"color": style.ACCENT, "lw": 0.9, "ls": (0, (4, 2))}
    for end in (t.day_low, t.day_high):
        share = np.interp(np.log(q), np.log(t.discharge), end / t.delay)
        axes.plot(q, share * middle, zorder=3, scalex=False, scaley=False, **dashes)
    held = f"{law.level:.0%}".replace("%", " %")
    return [
        style.dot("law", ls="-", color=style.ACCENT, lw=1.7),
        Patch(color=style.ACCENT, alpha=0.3, lw=0, label=f"its {held}"),
        style.dot(f"a single day, {held}", **dashes),
    ]


_CAPTION = (
    "Each mark is a day at its own travel time; its bar holds 5 to 95 % of its probability. The line is the "
    "law T = T0 (Q / Q0)^-b, the band what is sure of it, and the dashes hold a single day."
)
