"""Figs 9, 17 and 18: how often each delay, and which delay on which day."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from rivid.plots import style
from rivid.plots.dates import date_axis
from rivid.plots.delay_map import MARKS
from rivid.plots.histogram import shares
from rivid.plots.paper.estimates import Estimates
from rivid.plots.paper.sheets import PaperFigure, delay_ticks, name_panel, save, sheet
from rivid.results.read import EstimatorResults
from rivid.results.selection import candidates, day_numbers, found, kinds, rayleigh
from rivid.text import count, number, time_unit

COLOURS = {"data decide": style.INK, "data do not decide": style.LIGHT, "degenerate": style.GREY}


def panels(estimates: Estimates) -> tuple[tuple[str, str, str], ...]:
    """Letter, estimator and words of the panels of Figs 17 and 18."""
    return (
        ("a", "jmap-uniform", f"uniform prior, alpha = {estimates.alpha:g}"),
        ("b", "jmap-uniform-estimated", "uniform prior, alpha estimated"),
        ("c", "jmap", f"Rayleigh prior, sigma_d = {number(estimates.settings.delay_scale)}"),
    )


def search_histograms(estimates: Estimates, folder: Path) -> PaperFigure:
    """Fig. 9: delays by exhaustive search in the simple models."""
    title = "Delays by exhaustive search"
    shown = [
        (letter, name, words)
        for letter, name, words in (
            ("a", "direct", "direct approach (8)"),
            ("b", "indirect", "indirect approach (10)"),
        )
        if estimates.has(name)
    ]
    s = estimates.settings
    page = sheet(
        "9", title, f"{_who(estimates)} · d from {s.d_min} to {s.d_max} T_s", columns=2, gap=(0.75, 0.0),
        right=0.3, bottom=0.85,
    )  # fmt: skip
    for axes, (letter, name, words) in zip(page.panels, shown, strict=False):
        _histogram(axes, estimates, estimates.of(name), stacked=False)
        name_panel(axes, letter, words)
    if len(shown) == 1:
        style.say(page.panels[1], "No outflow is logged: no direct approach.")
        page.panels[1].set_axis_off()
    _same_height(page.panels[: len(shown)])
    handles: list[object] = [
        Patch(facecolor=style.FAINT, edgecolor=style.ACCENT, hatch="////", linewidth=0, label="at a bound")
    ]
    _legend_at_the_right(page.figure, handles)
    caption = "Share of days at each delay. Hatched bars lie at the bounds: the largest means beyond."
    return save(page, folder, "fig09", "9", title, caption)


def jmap_histograms(estimates: Estimates, folder: Path) -> PaperFigure:
    """Fig. 18: delays of the JMAP with three priors, with the Rayleigh prior itself over the third."""
    title = "How often each delay (JMAP)"
    page = sheet(
        "18",
        title,
        _who(estimates),
        columns=3,
        gap=(0.55, 0.0),
        right=0.25,
        bottom=0.85,
        height=2.9,
        top=0.92,
    )
    for axes, (letter, name, words) in zip(page.panels, panels(estimates), strict=True):
        _histogram(axes, estimates, estimates.of(name), stacked=True)
        name_panel(axes, letter, words)
    s = estimates.settings
    d = np.arange(s.d_min, s.d_max + 1.0)
    prior = page.panels[2].plot(
        d,
        100 * rayleigh(d, s.delay_scale),
        color=style.WATER,
        lw=1.2,
        marker="o",
        ms=2.2,
        label="prior alone",
    )
    _same_height(page.panels)
    handles: list[object] = [
        Patch(color=COLOURS[name], label=name) for name in ("data decide", "data do not decide")
    ]
    handles.append(
        Patch(facecolor=style.FAINT, edgecolor=style.ACCENT, hatch="////", linewidth=0, label="at a bound")
    )
    _legend_at_the_right(page.figure, [*handles, *prior])
    caption = (
        "Dark: without the prior's terms the data say the same delay to within a sample. Light: they do not, "
        "the prior or chance decides."
    )
    return save(page, folder, "fig18", "18", title, caption)


def maps(estimates: Estimates, folder: Path) -> PaperFigure:
    """Fig. 17: the delay of each day for three priors."""
    title = "Delay of each day (JMAP)"
    page = sheet("17", title, _who(estimates), rows=3, gap=(0.0, 0.34), height=1.75, top=0.92)
    s, T = estimates.settings, estimates.results.sample_time
    named: dict[str, object] = {}
    for axes, (letter, name, words) in zip(page.panels, panels(estimates), strict=True):
        e = estimates.of(name)
        x = day_numbers(e.dates)
        date_axis(axes, e.dates[0], e.dates[-1])
        if axes is not page.panels[-1]:
            axes.tick_params(axis="x", which="both", labelbottom=False)
        style.lag_ticks(axes, s.d_min - 1.0, s.d_max + 1.0)
        axes.yaxis.grid(True)
        for kind, days in kinds(e).items():
            if days.any():
                mark = {**MARKS[kind], "linestyle": "none", "markeredgewidth": 0.7}
                axes.plot(x[days], e.delay[days], markersize=2.8, zorder=3, **mark)
                named.setdefault(kind, style.dot(kind, **{**mark, "markersize": 4.5}))
        axes.set_ylabel("delay d [T_s]")
        style.second_axis(axes, T, "[minutes]")
        name_panel(axes, letter, words)
    handles = [named[kind] for kind in MARKS if kind in named]
    _legend_at_the_right(page.figure, handles, edge=0.72)
    caption = "One mark a day; hollow where the data without the prior's terms do not say the same."
    return save(page, folder, "fig17", "17", title, caption)


def _who(estimates: Estimates) -> str:
    dates = estimates.of("jmap").dates
    T = estimates.results.sample_time
    return f"{estimates.results.reach} · {count(len(dates), 'day')} · T_s = {T:g} s"


def _histogram(axes: Axes, estimates: Estimates, e: EstimatorResults, *, stacked: bool) -> None:
    """Share of days per delay; stacked by whether the data decide."""
    places = candidates(e)
    T = estimates.results.sample_time
    below = np.zeros(len(places))
    for name, share in shares(e, places).items():
        colour = COLOURS[name] if stacked else style.INK
        if share.any():
            drawn = axes.bar(places, share, bottom=below, width=0.78, color=colour, linewidth=0)
            for patch in (drawn.patches[0], drawn.patches[-1]):
                patch.set(hatch="////", edgecolor=style.ACCENT)
            below = below + share
    if not found(e).any():
        style.say(axes, "No day has a delay.")
    delay_ticks(axes, float(places[0]), float(places[-1]), T)
    axes.set_xlabel(f"delay d: above in T_s, below in {time_unit(places[-1] * T)[0]}")
    axes.set_ylabel("share of days [%]")
    axes.yaxis.grid(True)
    axes.spines["right"].set_visible(False)


def _same_height(panels: list[Axes]) -> None:
    """One scale for all panels, so that they may be compared."""
    top = max(axes.get_ylim()[1] for axes in panels)
    for axes in panels:
        axes.set_ylim(0, top)
        axes.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))


def _legend_at_the_right(figure: object, handles: list[object], edge: float = 0.25) -> None:
    """In the line of facts, at the right edge."""
    from matplotlib.figure import Figure

    assert isinstance(figure, Figure)
    width, height = (float(v) for v in figure.get_size_inches())
    figure.legend(
        handles=handles, loc="upper right", bbox_to_anchor=(1 - edge / width, 1 - 0.37 / height),
        ncols=len(handles),
    )  # fmt: skip
