"""A season: the probabilities of each day with the joined delays, and the law of delay and discharge."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from rivid.core.law import DelayLaw
from rivid.plots import style
from rivid.plots.estimates import DASHED, flow_axis, probability_cells
from rivid.plots.files import FigureFile
from rivid.results.read import day_numbers
from rivid.results.season import NAME, Joined, SeasonDays
from rivid.text import count, day_range, duration
from rivid.types import Floats

DARKEST = 0.36  # opacity of a cell of probability 1: the band lies over it
BAND = 0.16  # opacity of the band
WAYS = {"forward": "each day knows those before it", "both": "each day knows all days"}


def draw(days: SeasonDays, joined: Joined, law: DelayLaw, folder: Path) -> list[FigureFile]:
    """Draw season.png and delay_law.png of at least one day; without a law the days are drawn alone."""
    first, last = days.dates[0], days.dates[-1]
    with style.styled():
        span = f"{count(len(days.dates), 'day')}, {day_range(first, last)}"
        note = f"{days.reach} · {WAYS[joined.direction]} · {span}"
        figure, (ax,) = style.sheet(f"Delay over the season: {NAME}", note, [2.42])
        style.date_axis(ax, first, last)
        season(ax, days, joined)
        style.key(ax)
        files = [style.written(figure, folder / "season.png", "Delay over the season", estimator=NAME)]
        title, shown = "Delay and discharge: the law", int(_known(days).sum())
        formula = f"no law: {law.message}"
        if law.status == "ok":
            formula = f"T = {duration([law.T0])} (Q / {law.Q0:.0f} m³/s)^{-law.b:.2f}"
            formula += f", b {law.b_low:.2f} to {law.b_high:.2f} ({_held(law)})"
        figure, (ax,) = style.sheet(title, f"{days.reach} · {formula} · {count(shown, 'day')}", [2.62])
        delay_law(ax, days, law)
        style.key(ax)
        path = folder / "delay_law.png"
        files.append(style.written(figure, path, title, estimator="posterior"))
    return files


def season(ax: Axes, days: SeasonDays, joined: Joined) -> None:
    """p(d) of each day alone as cells, the joined median and its 90 % band; the x axis are day numbers."""
    x = day_numbers(days.dates)
    middle, low, high = (
        days.place(joined.probability, share) - (0.0 if days.river else 0.5) for share in (0.5, 0.05, 0.95)
    )
    shown = np.concatenate([low, high, days.delay[np.isfinite(days.delay)]])
    style.lag_ticks(ax, float(shown.min()) - 1.3, float(shown.max()) + 1.3, bins=14)
    ax.yaxis.grid(True)
    probability_cells(ax, x[0], days.candidates, np.nan_to_num(days.probability).T, DARKEST)
    ax.fill_between([], [], color=style.INK, alpha=0.7 * DARKEST, lw=0, label="the day alone, p(d)")
    edge = np.array([x[0] - 0.5, *x, x[-1] + 0.5])  # so that a single day is a band too
    ends = [np.r_[v[0], v, v[-1]] for v in (low, high)]
    ax.plot(
        edge, np.r_[middle[0], middle, middle[-1]], color=style.WATER, lw=1.4, zorder=3.2,
        label="joined, median",
    )  # fmt: skip
    ax.fill_between(edge, *ends, color=style.WATER, alpha=BAND, lw=0, zorder=2.5, label="90 %")
    for v in ends:
        ax.plot(edge, v, color=style.WATER, lw=0.5, alpha=0.6, zorder=2.6)
    other = np.isfinite(days.delay) & np.isfinite(joined.delay) & (days.delay != joined.delay)
    size = float(np.clip(70 / np.sqrt(len(x)), 3.0, 5.5))
    for name, at, look in (
        ("another delay than alone", other, {"color": style.ACCENT}),
        ("no information of its own", ~joined.observed, {"color": style.WATER, "markerfacecolor": "white"}),
    ):
        if at.any():
            label = f"{name} ({int(at.sum()):,})"
            style.marks(ax, x[at], middle[at], label, size, marker="o", zorder=3.5, **look)
    ax.set_ylabel("t50 [samples]" if days.river else "delay d [samples]")
    style.second_axis(ax, days.sample_time, "t50 [minutes]" if days.river else "d T_s [minutes]")


def _known(days: SeasonDays) -> Any:
    return np.isfinite(days.travel) & np.isfinite(days.discharge)


def delay_law(ax: Axes, days: SeasonDays, law: DelayLaw) -> None:
    """Travel time of each day against the discharge, and the law with its intervals where there is one."""
    what, shown = "t50" if days.river else "travel time", _known(days)
    ax.set_ylabel(f"{what} [samples]")
    ax.set_xlabel("mean inflow [m³/s]")
    if not shown.any():
        style.message(ax, f"None of the {count(len(days.dates), 'day')} has a travel time and a discharge.")
        ax.set(xticks=[], yticks=[])
        return
    Q, T = days.discharge[shown], days.travel[shown] / days.sample_time
    low, high = (
        end(days.place(days.probability, share)[shown], T)
        for end, share in ((np.minimum, 0.05), (np.maximum, 0.95))
    )
    flow_axis(ax, Q)
    # all days and nearly all of their bars: one uncertain day must not compress the others
    bottom = min(float(T.min()), float(np.quantile(low, 0.02)))
    top = max(float(T.max()), float(np.quantile(high, 0.98)))
    if law.status == "ok":  # the bands include the doubt of the stamps: more than the days scatter
        bottom = min(bottom, float(law.table.day_low.min()) / days.sample_time)
        top = max(top, float(law.table.day_high.max()) / days.sample_time)
    style.lag_ticks(ax, bottom - 0.5, top + 0.5)
    ax.grid(True)
    ax.vlines(Q, low, high, colors=style.LIGHT, linewidths=0.8, alpha=0.6, zorder=1.5)
    size = float(np.clip(60 / np.sqrt(len(Q)), 2.0, 5.0))
    style.marks(
        ax, Q, T, "a day; bar: 5 to 95 % of its probability", size, marker="o", color=style.INK,
        markeredgewidth=0, alpha=0.75, zorder=2.5,
    )  # fmt: skip
    if law.status == "ok":
        _law(ax, law, Q, days.sample_time)
    style.second_axis(ax, days.sample_time, f"{what} [minutes]")


def _held(law: DelayLaw) -> str:
    return f"{100 * law.level:.0f} %"


def _law(ax: Axes, law: DelayLaw, Q: Floats, T_s: float) -> None:
    """The law over the observed discharges, its interval, and that of a single day."""
    q, t = np.geomspace(Q.min(), Q.max(), 200), law.table
    middle, low, high = (v / T_s for v in law.delay(q))
    look: dict[str, Any] = {"color": style.ACCENT, "zorder": 3, "scalex": False, "scaley": False}
    ax.plot(q, middle, lw=3.0, **look | {"color": "white"})  # the edge sets the line off from any marks
    ax.plot(q, middle, lw=1.7, label="law", **look)
    ax.fill_between(q, low, high, color=style.ACCENT, alpha=0.3, lw=0, zorder=2.7, label=f"its {_held(law)}")
    for end, name in ((t.day_low, f"a single day, {_held(law)}"), (t.day_high, None)):
        share = np.interp(np.log(q), np.log(t.discharge), end / t.delay)
        ax.plot(q, share * middle, lw=0.9, ls=DASHED, label=name, **look)
