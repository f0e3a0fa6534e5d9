"""Figs 7 and 12: the logs of one day, and what the estimators make of them."""

import datetime as dt
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, MultipleLocator, NullLocator

from rivid.errors import ConfigError
from rivid.plots import style
from rivid.plots.fir_day import typical_day
from rivid.plots.paper.estimates import Estimates
from rivid.plots.paper.sheets import PaperFigure, legend, minutes_above, power_of_ten, save, sheet
from rivid.plots.paper.year import Year
from rivid.plots.tdr import grey_limits
from rivid.text import delays, response_unit
from rivid.types import Floats

CURVES: dict[str, tuple[str, dict[str, Any]]] = {
    "ml": ("ML", {"color": style.LIGHT, "lw": 0.9, "marker": "o", "ms": 2.6}),
    "map": ("MAP", {"color": style.WATER, "lw": 1.4}),
    "jmap-degenerate": ("JMAPdeg", {"color": style.GREY, "lw": 1.4, "ls": (0, (4, 2))}),
    "jmap": ("JMAP", {"color": style.INK, "lw": 1.8, "marker": "o", "ms": 3.2}),
}
"""What Fig. 12 shows, in the order of drawing: the paper's name and the look."""


def choose(estimates: Estimates, day: dt.date | None = None) -> int:
    """The number of the day that stands for the year: the one asked for, or a typical one.

    Raises
    ------
    ConfigError
        Where the day asked for has no impulse response.
    """
    e = estimates.of("jmap")
    chosen = typical_day(estimates.results) if day is None else day
    if chosen is None:
        return 0
    if chosen not in e.dates or (day is not None and not e.answered[e.dates.index(chosen)]):
        raise ConfigError(f"no impulse response on {chosen}: choose a day with status ok in delays.csv")
    return e.dates.index(chosen)


def logs(year: Year, i: int, folder: Path) -> PaperFigure:
    """Fig. 7: the data set of one day."""
    u, h = year.inflow[i], year.level[i]
    title = "A one-day data set"
    page = sheet(
        "7", title,
        f"{year.config.reach.name} · {year.dates[i]} · N = {len(u)} samples, T_s = {year.sample_time:g} s",
        height=1.75, rows=2, gap=(0.0, 0.22), right=0.3,
    )  # fmt: skip
    hours = np.arange(len(u)) * year.sample_time / 3600.0
    flows, level = page.panels
    lines: list[object] = list(
        flows.step(hours, u, where="post", color=style.INK, lw=1.2, label="inflow command u_Qi")
    )
    if year.outflow:
        lines += flows.step(
            hours, year.outflow[i], where="post", color=style.WATER, lw=1.0, label="outflow command u_Qo"
        )
    flows.set_ylabel("flow [m³/s]")
    level.plot(hours, h, color=style.INK, lw=1.0)
    level.set_ylabel("level h_L [m]")
    level.set_xlabel("local time [h]")
    level.yaxis.get_major_formatter().set_useOffset(False)  # type: ignore[attr-defined]
    for axes in page.panels:
        axes.set_xlim(0, hours[-1])
        axes.xaxis.set_major_locator(MultipleLocator(max(3 * round(hours[-1] / 24), 1)))
        axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
        axes.grid(True, axis="y")
        axes.spines["right"].set_visible(False)
    flows.tick_params(labelbottom=False)
    legend(page, lines)
    page.figure.align_ylabels(page.panels)
    caption = "What is known of a day: the commands of both dams, and the level at the downstream one."
    return save(page, folder, "fig07", "7", title, caption)


def responses(estimates: Estimates, i: int, folder: Path) -> PaperFigure:
    """Fig. 12: the impulse responses of one day, and the JMAP's as a bar."""
    jmap = estimates.of("jmap")
    results = estimates.results
    T, M = results.sample_time, jmap.fir.shape[1]
    d, deg = jmap.delay[i], estimates.of("jmap-degenerate").delay[i]
    title = "Impulse responses and delay of one day"
    told = f"{results.reach} · {jmap.dates[i]} · condition number of U'U {jmap.condition[i]:.1e}"
    if np.isfinite(d):
        told += f" · JMAP d = {delays([float(d)], T)}"
    if np.isfinite(deg):
        told += f", JMAPdeg d = {deg:.0f}"
    page = sheet("12", title, told, height=3.3, bottom=1.05, top=1.1)
    axes = page.panels[0]
    axes.axhline(0, color=style.LIGHT, lw=0.7)
    k = np.arange(M)
    drawn = {name: estimates.of(name).fir[i] for name in CURVES}
    # the last lags gather what a truncated response cannot place
    inner = np.concatenate([h[: M - 3] for h in drawn.values()])
    factor, ten = power_of_ten(inner)
    handles = []
    for name, (label, look) in CURVES.items():
        handles += axes.plot(k, factor * drawn[name], label=label, **look)
    if np.isfinite(d):
        jump = factor * jmap.fir[i, int(d) : int(d) + 2]
        look = {"color": style.ACCENT, "lw": 2.4, "marker": "o", "ms": 4}
        handles += axes.plot([d, d + 1], jump, label="jump from d to d + 1", **look)
    if np.isfinite(inner).any():
        low, high = factor * float(np.nanmin(inner)), factor * float(np.nanmax(inner))
        margin = 0.06 * (high - low) or 1.0
        axes.set_ylim(low - margin, high + margin)
    else:
        style.say(axes, "This day has no impulse response.")
    _look(axes, M, f"{ten}{response_unit(results.output_unit)}")
    _bar(page.figure.add_axes((0, 0, 1, 1)), axes, jmap.fir[i], page.height)
    minutes_above(axes, T)
    _legend_at_the_top(page.figure, handles)
    caption = (
        "ML is rough, MAP blurs the jump, JMAP is smooth and keeps it, JMAPdeg (no inverse-gamma prior) is "
        "too smooth. The last lags gather what M lags cannot hold. Below: the JMAP as a bar."
    )
    return save(page, folder, "fig12", "12", title, caption)


def _look(axes: Axes, order: int, unit: str) -> None:
    axes.set_xlim(-0.5, order - 0.5)
    axes.xaxis.set_major_locator(NullLocator())
    axes.set_ylabel(f"h[k] [{unit}]")
    axes.grid(True, axis="y")
    for side in ("right", "bottom"):
        axes.spines[side].set_visible(False)


def _bar(bar: Axes, axes: Axes, h: Floats, height: float) -> None:
    """The grey bar of the JMAP under its panel, with the lags as its axis."""
    box = axes.get_position()
    inch = box.height / height
    bar.set_position((box.x0, box.y0 - 0.4 * inch, box.width, 0.26 * inch))
    low, high = grey_limits(h)
    extent = (-0.5, len(h) - 0.5, 0.0, 1.0)
    bar.imshow(h[None, :], cmap="Greys", aspect="auto", extent=extent, vmin=low, vmax=high)
    bar.yaxis.set_major_locator(NullLocator())
    bar.xaxis.set_major_locator(MaxNLocator(nbins=16, integer=True, steps=[1, 2, 5, 10]))
    bar.set_xlabel("lag k [T_s]")
    bar.annotate(
        "JMAP", (0, 0.5), xycoords="axes fraction", xytext=(-6, 0), textcoords="offset points", ha="right",
        va="center", fontsize=8,
    )  # fmt: skip
    for spine in bar.spines.values():
        spine.set_visible(True)
        spine.set_linewidth(0.5)


def _legend_at_the_top(figure: Any, handles: list[Any]) -> None:
    """In the paper's order, above the minutes."""
    order = ["ML", "MAP", "JMAP", "JMAPdeg", "jump from d to d + 1"]
    handles = sorted(handles, key=lambda line: order.index(str(line.get_label())))
    width, height = (float(v) for v in figure.get_size_inches())
    figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(0.72 / width, 1 - 0.58 / height),
        ncols=len(handles),
    )
