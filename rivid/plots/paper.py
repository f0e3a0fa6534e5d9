"""The paper's figures of a year of logs, 1 to 19, as SVG and PNG.

The figures of the year (9 and 13-18) are those of the report: :mod:`rivid.plots.estimates`.
"""

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from rivid.errors import ConfigError
from rivid.plots import estimates, style
from rivid.plots.draw import typical_day
from rivid.plots.files import FigureFile
from rivid.plots.paper_data import CascadeReach, Year
from rivid.reach.integrator import theoretical_fir
from rivid.results.read import Results, day_numbers, rayleigh
from rivid.text import count, delays, listed, number, response_unit, share
from rivid.types import Floats

OFTEN = 500.0  # the paper counts the days below this discharge [m3/s]
DELAY, ALPHA_I, ALPHA_O, K_Q, K_H = 7, 1e-4, 1.2e-4, 1.0, -1000.0
"""Of the paper's Fig. 10: d [samples], K_i T_s / A and K_o T_s / A [m per m3/s], K_Q [-], K_h [m2/s]."""
SHOWN = 50  # lags of Fig. 10
CURVES: dict[str, tuple[str, dict[str, Any]]] = {  # curves of Fig. 12: the paper's name and the look
    "ml": ("ML", {"color": style.LIGHT, "lw": 0.9, "marker": "o", "ms": 2.6}),
    "map": ("MAP", {"color": style.WATER, "lw": 1.4}),
    "jmap": ("JMAP", {"color": style.INK, "lw": 1.8, "marker": "o", "ms": 3.2, "zorder": 2.2}),
    "jmap-degenerate": ("JMAPdeg", {"color": style.GREY, "lw": 1.4, "ls": estimates.DASHED}),
}
Sheet = Callable[..., tuple[Figure, list[Axes]]]  # of a note, heights, the number of columns, and margins


def draw_paper(
    year: Year,
    estimated: Results,
    cascade: Sequence[CascadeReach],
    folder: Path,
    *,
    day: dt.date | None = None,
    progress: Callable[[str], Any] = lambda num: None,
) -> list[FigureFile]:
    """Draw the paper's figures as ``fig02.png``, ``fig02.svg`` and so on; the same logs give the same bytes.

    `cascade` are the reaches of Fig. 19, at least one; `day` is that of Figs 7 and 12, a typical one by
    default: ConfigError if it has no impulse response. `progress` is called with the number of each of
    :data:`FIGURES` before it is drawn.
    """
    i = choose(estimated, day)
    dam = "downstream" if year.outflow else "upstream"
    files = []
    with style.styled():
        for num, (title, _) in FIGURES.items():
            progress(num)
            figure = figure_of(num, year, estimated, i, cascade)
            path = folder / f"fig{int(num):02d}{'_priors' if num == '11' else ''}.png"
            files.append(style.written(figure, path, title, kind=num, dam=dam))
            style.save_vector(figure, path.with_suffix(".svg"))
    return files


def choose(estimated: Results, day: dt.date | None = None) -> int:
    """The number of the given day, or of a typical one; ConfigError if it has no impulse response."""
    e = estimated.of("jmap")
    if day is None:
        return e.dates.index(typical_day(estimated) or e.dates[0])
    if day not in e.dates or not e.answered[e.dates.index(day)]:
        raise ConfigError(f"no impulse response on {day}: choose a day with status ok in delays.csv")
    return e.dates.index(day)


def figure_of(num: str, year: Year, estimated: Results, i: int, cascade: Sequence[CascadeReach]) -> Figure:
    """One of :data:`FIGURES`; `i` is the number of the day of Figs 7, 11 and 12."""
    title, draw = FIGURES[num]

    def sheet(note: str, heights: Sequence[float] = (3.0,), columns: int = 1, **margins: Any) -> Any:
        margins = {"left": 0.8, "bottom": 0.62} | margins
        return style.sheet(f"Fig. {num} · {title}", note, heights, [1.0] * columns, **margins)

    return draw(sheet, year, estimated, i, cascade)


def _who(year: Year) -> str:
    return f"{year.config.reach.name} · {count(len(year.dates), 'day')}"


def _drawing(sheet: Sheet, note: str, height: float) -> tuple[Figure, Axes]:
    """A panel of 100 by 30 without axes."""
    figure, (ax,) = sheet(note, [height], left=0.3, right=0.3, bottom=0.2)
    ax.set(xlim=(0, 100), ylim=(0, 30))
    ax.axis("off")
    return figure, ax


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], colour: str = style.INK) -> None:
    look = {"arrowstyle": "-|>", "color": colour, "lw": 1.3, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=look)


def reach(sheet: Sheet, year: Year, *_: Any) -> Figure:
    r = year.config.reach
    figure, ax = _drawing(sheet, f"{r.name} · L = {r.length / 1000:g} km, not to scale", 2.5)
    x = np.linspace(10, 86, 200)
    bed = 9.0 - 5.0 * (x - 10) / 76
    surface = 17.5 - 1.2 * ((86 - x) / 76) * ((x - 10) / 76 + 0.6)
    ax.fill_between(x, bed, surface, color=style.WATER, alpha=0.18, lw=0)
    ax.plot(x, surface, color=style.WATER, lw=1.4)
    ax.plot([0, *x, 100], [10.0, *bed, 3.0], color=style.INK, lw=1.2)
    for at, foot, crest in ((8.5, 9.3, 25.0), (86.0, 3.9, 21.5)):
        ax.fill([at, at + 1.5, at + 1.5, at], [foot, foot, crest, crest], color=style.GREY, lw=0)
    ax.fill_between([0, 8.5], [9.8, 9.3], 22.5, color=style.WATER, alpha=0.18, lw=0)
    ax.fill_between([87.5, 100], [3.8, 3.0], 9.0, color=style.WATER, alpha=0.18, lw=0)
    _arrow(ax, (5, 20), (15, 20), style.ACCENT)
    _arrow(ax, (82, 7.5), (95, 7.5), style.ACCENT)
    ax.text(11, 26.2, "upstream dam: inflow u_Qi", ha="left")
    ax.text(99, 23.0, "downstream dam: outflow u_Qo,\nset by operators", ha="right", va="bottom")
    ax.plot([82, 82], [surface[np.searchsorted(x, 82)], 4.3], color=style.INK, lw=0.9, ls=":")
    ax.text(81, 11.0, "level h_L", ha="right")
    _arrow(ax, (18, 14.0), (44, 14.0), style.INK)
    ax.text(19, 14.8, "a wave on its way: d + 1 samples to the gauge")
    ax.annotate("", (86, 1.4), (10, 1.4), arrowprops={"arrowstyle": "<|-|>", "color": style.GREY, "lw": 0.9})
    ax.text(48, 0.0, "L", ha="center", color=style.GREY, va="bottom", backgroundcolor="white")
    return figure


def loop(sheet: Sheet, *_: Any) -> Figure:
    """Fig. 8: reach (8) and operators (9), by the arguments of :func:`theoretical_fir`."""
    figure, ax = _drawing(
        sheet, "reach (8): alpha_i = K_i T_s / A, alpha_o = K_o T_s / A · operators (9)", 2.6
    )

    def block(x: float, y: float, words: str, name: str) -> None:
        box = {"boxstyle": "round,pad=0.55", "facecolor": "white", "edgecolor": style.INK}
        ax.text(x, y, words, ha="center", va="center", bbox=box, parse_math=True, fontsize=11)
        at, side = ((x - 4.5, y), "right") if name == "feedback" else ((x, y + 5.2), "center")
        ax.text(*at, name, ha=side, va="center", color=style.GREY)

    block(38, 23, r"$\alpha_i\,\frac{q^{-d-1}}{1-q^{-1}}$", "inflow to level")
    block(62, 13, r"$\alpha_o\,\frac{q^{-1}}{1-q^{-1}}$", "outflow to level")
    block(24, 13, "$K_Q$", "feedforward")
    block(38, 3.5, "$K_h$", "feedback")
    for x, y in ((38.0, 13.0), (78.0, 23.0)):
        ax.plot(x, y, "o", ms=11, mfc="white", mec=style.INK)
    for start, end in [
        ((6, 23), (32, 23)), ((44, 23), (76.6, 23)), ((79.4, 23), (96, 23)), ((14, 13), (20.5, 13)),
        ((27.5, 13), (36.6, 13)), ((39.4, 13), (55.5, 13)), ((38, 6.6), (38, 11.6)), ((78, 13), (78, 21.6)),
        ((78, 29), (78, 24.4)),
    ]:  # fmt: skip
        _arrow(ax, start, end)
    for xs, ys in (([14, 14], [23, 13]), ([68.5, 78], [13, 13]), ([88, 88, 42], [23, 3.5, 3.5])):
        ax.plot(xs, ys, color=style.INK, lw=1.3)
    signs = ((35.6, 15.0, "+"), (39.4, 9.6, "−"), (75.4, 24.8, "+"), (79.2, 19.4, "−"), (79.2, 26.0, "+"))
    for x, y, words in (*signs, (6, 24.2, "u_Qi"), (45, 14.2, "u_Qo"), (92, 24.2, "h_L")):
        ax.text(x, y, words)
    ax.text(79.5, 28.3, "v: what is not modelled", va="center", color=style.GREY)
    return figure


def daily_range(days: Sequence[Floats]) -> float:
    """Mean over the days of the peak-to-peak variation."""
    return float(np.mean([np.ptp(day) for day in days]))


def _by_day(sheet: Sheet, year: Year, facts: str, values: Floats, label: str, low: float | None) -> Figure:
    """One line over the days of the record, broken where days are missing; from `low` on, where given."""
    figure, (ax,) = sheet(f"{_who(year)} · {facts}", [2.4], left=0.85, right=0.3, top=0.62)
    style.date_axis(ax, year.dates[0], year.dates[-1])
    line = estimates.with_gaps(day_numbers(year.dates), values)
    ax.plot(*line, color=style.INK, lw=1.1, marker="o" if len(values) < 3 else "", ms=3)
    if low is not None:
        ax.set_ylim(low, 1.08 * float(values.max()))
    ax.set_ylabel(label)
    ax.grid(True, axis="y")
    return figure


def discharge(sheet: Sheet, year: Year, *_: Any) -> Figure:
    Q, often = year.discharge, share(int((year.discharge < OFTEN).sum()), len(year.dates))
    facts = f"{Q.min():.0f} to {Q.max():.0f} m³/s, below {OFTEN:.0f} m³/s on {often} of days"
    facts += f"; over a day it moves by {daily_range(year.outflow or year.inflow):.0f} m³/s"
    return _by_day(sheet, year, facts, Q, "discharge [m³/s]", 0)


def level(sheet: Sheet, year: Year, *_: Any) -> Figure:
    h = year.mean_level
    facts = f"{h.min():.2f} to {h.max():.2f} m; over a day it moves by {daily_range(year.level):.2f} m"
    return _by_day(sheet, year, facts, h, "level [m above the datum]", None)


def froude(sheet: Sheet, year: Year, *_: Any) -> Figure:
    F = year.bounds.froude
    facts = f"{F.min():.3f} to {F.max():.3f}; the bounds (5) hold below 2"
    return _by_day(sheet, year, facts, F, "Froude number [-]", 0)


def bounds_by_flow(sheet: Sheet, year: Year, *_: Any) -> Figure:
    reach, T = year.config.reach, year.sample_time
    low, high = reach.discharge_range
    Q = np.linspace(low, high, 200)
    level = year.mean_level.mean()
    bounds, depth = reach.bounds(Q, level), float(reach.depth_at(level))
    figure, (ax,) = sheet(
        f"{number(reach.length / 1000)} km, {number(reach.width)} m wide, {number(depth)} m deep · "
        f"gravity wave {bounds.gravity[-1] / T:.1f} to {bounds.gravity[0] / T:.1f} T_s, kinematic wave "
        f"{bounds.kinematic[-1] / T:.0f} to {bounds.kinematic[0] / T:.0f} T_s (T_s = {T:g} s)",
    )  # fmt: skip
    travel_times(ax, Q, bounds.gravity, bounds.kinematic, T)
    ax.set_xlim(low, high)
    ax.set_xlabel("flow [m³/s]")
    return figure


def bounds_by_day(sheet: Sheet, year: Year, *_: Any) -> Figure:
    """Fig. 6: the same bounds for each day's mean discharge and Froude number."""
    bounds, T = year.bounds, year.sample_time
    g, k = bounds.gravity / T, bounds.kinematic / T
    figure, (ax,) = sheet(
        f"{_who(year)} · gravity wave {g.min():.1f} to {g.max():.1f} T_s, kinematic wave {k.min():.0f} to "
        f"{k.max():.0f} T_s (T_s = {T:g} s)",
    )  # fmt: skip
    style.date_axis(ax, year.dates[0], year.dates[-1])
    day = day_numbers(year.dates)
    x, gravity = estimates.with_gaps(day, bounds.gravity)
    travel_times(ax, x, gravity, estimates.with_gaps(day, bounds.kinematic)[1], T)
    return figure


def travel_times(ax: Axes, x: Floats, gravity: Floats, kinematic: Floats, sample_time: float) -> None:
    """Both bounds (5) of the travel time [s] over the discharge or the days, in samples and minutes."""
    look: dict[str, Any] = {"color": style.WATER, "marker": "_" if len(x) < 3 else ""}
    ax.plot(x, kinematic / sample_time, label="upper bound: kinematic wave", lw=1.0, alpha=0.6, **look)
    ax.plot(x, gravity / sample_time, label="lower bound: gravity wave", lw=2.2, **look)
    longest = np.nanmax(np.where(np.isfinite(kinematic), kinematic, gravity))
    ax.set_ylim(0, 1.06 * float(longest) / sample_time)
    ax.grid(True, axis="y")
    style.key(ax)
    ax.set_ylabel("travel time [samples]")
    style.second_axis(ax, sample_time, "[minutes]")


def logs(sheet: Sheet, year: Year, _: Results, i: int, *__: Any) -> Figure:
    u, h = year.inflow[i], year.level[i]
    figure, panels = sheet(
        f"{year.config.reach.name} · {year.dates[i]} · N = {len(u)} samples, T_s = {year.sample_time:g} s",
        [1.75, 1.75], gap=(0.0, 0.22), left=0.85, right=0.3,
    )  # fmt: skip
    hours, (flows, below) = np.arange(len(u)) * year.sample_time / 3600.0, panels
    flows.step(hours, u, where="post", color=style.INK, lw=1.2, label="inflow command u_Qi")
    if year.outflow:
        outflow = year.outflow[i]
        flows.step(hours, outflow, where="post", color=style.WATER, lw=1.0, label="outflow command u_Qo")
    flows.set_ylabel("flow [m³/s]")
    below.plot(hours, h, color=style.INK, lw=1.0)
    below.set_ylabel("level h_L [m]")
    below.set_xlabel("local time [h]")
    for ax in panels:
        ax.set_xlim(0, hours[-1])
        ax.xaxis.set_major_locator(MultipleLocator(max(3 * round(hours[-1] / 24), 1)))
        style.few_ticks(ax)
        ax.grid(True, axis="y")
    flows.tick_params(labelbottom=False)
    style.key(flows)
    figure.align_ylabels(panels)
    return figure


def theoretical(sheet: Sheet, year: Year, *_: Any) -> Figure:
    h = 1e4 * theoretical_fir(SHOWN, DELAY, ALPHA_I, ALPHA_O, K_Q, K_H)
    figure, (ax,) = sheet(
        "d = 7, K_i T_s / A = 1e-4 s/m², K_o T_s / A = 1.2e-4 s/m², K_Q = 1, K_h = −1000 m²/s",
        [2.9], top=0.85,
    )  # fmt: skip
    ax.axhline(0, color=style.LIGHT, lw=0.7)
    ax.plot(np.arange(SHOWN), h, color=style.INK, lw=1.2, marker="o", ms=3.5)
    for at, up, words in ((0, -1, "the operators act at once"), (DELAY, 5, "the inflow arrives")):
        ax.plot([at, at + 1], h[at : at + 2], color=style.ACCENT, lw=2.2, marker="o", ms=4.5)
        ax.annotate(
            words, (at + 1, h[at + 1]), xytext=(9, up), textcoords="offset points", color=style.ACCENT,
            va="center",
        )  # fmt: skip
    ax.set_xlim(-0.8, SHOWN - 0.2)
    ax.set_xlabel("lag k [samples]")
    ax.set_ylabel("h[k] [10⁻⁴ m per m³/s]")
    ax.grid(True, axis="y")
    style.minutes_above(ax, year.sample_time)
    return figure


def priors(sheet: Sheet, year: Year, estimated: Results, i: int, *__: Any) -> Figure:
    """The Rayleigh prior on d (26) and the inverse-gamma prior on sigma_hD2 (32), as in use.

    The second needs a day: its beta_h comes from that day's ML response.
    """
    s, jmap = year.config.jmap_settings(), estimated.of("jmap")
    M, h = s.order, estimated.of("ml").fir[i]
    nu = float(np.sum(np.convolve(h, (1.0, -2.0, 1.0))[:M] ** 2))  # ||D h_ML||^2
    alpha_h, beta_h = M / 2, nu / 2
    figure, (left, right) = sheet(
        f"{estimated.reach} · sigma_d = {number(s.delay_scale)} T_s · alpha_h = M/2 = {number(alpha_h)}, "
        f"beta_h = ‖D h_ML‖²/2 = {beta_h:.1e} on {jmap.dates[i]}",
        [2.7], 2, gap=(0.75, 0.0), right=0.3, bottom=0.85, top=0.9,
    )  # fmt: skip
    d = np.arange(s.d_min, s.d_max + 1.0)
    left.plot(d, rayleigh(d, s.delay_scale), color=style.WATER, marker="o", ms=3.5, lw=1.2, label="prior")
    uniform = np.full(len(d), 1 / len(d))
    left.plot(d, uniform, color=style.GREY, lw=1.1, ls=estimates.DASHED, label="uniform prior")
    left.set_ylabel("probability")
    estimates.delay_ticks(left, s.d_min, s.d_max, estimated.sample_time)
    style.name_panel(left, "a", "Rayleigh prior on the delay (26)")
    ten = ""
    if np.isfinite(nu) and nu > 0:
        sd = np.linspace(0.01, 2.0, 400) * np.sqrt(beta_h / (alpha_h + 1))
        factor, ten = style.power_of_ten(sd)
        logs = -(alpha_h + 1) * np.log(sd**2) - beta_h / sd**2 + np.log(2 * sd)  # of sigma_hD, not its square
        right.plot(factor * sd, np.exp(logs - logs.max()), color=style.WATER, lw=1.4)
        at = factor * float(jmap.roughness_sd[i])
        right.axvline(at, color=style.ACCENT, lw=1.6, label="estimated by Table VI")
        right.set_xlim(0, factor * sd[-1])
    right.set_yticks([])
    right.xaxis.set_major_locator(MaxNLocator(nbins=6))
    right.set_ylabel("density")
    right.set_xlabel(f"sigma_hD, roughness of the response [{ten}{response_unit(estimated.output_unit)}]")
    style.name_panel(right, "b", "inverse-gamma prior on sigma_hD² (32)")
    for ax in (left, right):
        ax.set_ylim(0, None)
        ax.grid(True, axis="y")
    style.figure_key([left, right], down=0.14)
    return figure


def responses(sheet: Sheet, _: Year, estimated: Results, i: int, *__: Any) -> Figure:
    """Fig. 12: the impulse responses of one day, and the JMAP's as a bar."""
    jmap = estimated.of("jmap")
    T, M, unit = estimated.sample_time, jmap.fir.shape[1], response_unit(estimated.output_unit)
    d, deg = jmap.delay[i], estimated.of("jmap-degenerate").delay[i]
    facts = f"{estimated.reach} · {jmap.dates[i]} · condition number of U'U {jmap.condition[i]:.1e}"
    facts += f" · JMAP d = {delays([float(d)], T)}" if np.isfinite(d) else ""
    facts += f", JMAPdeg d = {deg:.0f}" if np.isfinite(deg) else ""
    figure, (ax,) = sheet(facts, [3.3], bottom=1.05, top=1.1)
    ax.axhline(0, color=style.LIGHT, lw=0.7)
    drawn = {name: estimated.of(name).fir[i] for name in CURVES}
    values = np.concatenate(list(drawn.values()))
    factor, ten = style.power_of_ten(values)
    for name, (label, look) in CURVES.items():
        ax.plot(np.arange(M), factor * drawn[name], label=label, **look)
    if np.isfinite(d):
        step = slice(int(d), int(d) + 2)
        look = {"color": style.ACCENT, "lw": 2.4, "marker": "o", "ms": 4, "zorder": 2.3}
        ax.plot([d, d + 1], factor * jmap.fir[i, step], label="jump from d to d + 1", **look)
    if not np.isfinite(values).any():
        style.message(ax, "This day has no impulse response.")
    ax.set_xlim(-0.5, M - 0.5)
    ax.set_ylabel(f"h[k] [{ten}{unit}]")
    ax.grid(True, axis="y")
    bar = estimates.grey_bar(ax, jmap.fir[i], below=0.4, height=0.26, bins=16)
    bar.set_xlabel("lag k [samples]")
    bar.annotate(
        "JMAP", (0, 0.5), xycoords="axes fraction", xytext=(-6, 0), textcoords="offset points", ha="right",
        va="center", fontsize=8,
    )  # fmt: skip
    style.minutes_above(ax, T)
    style.figure_key([ax], down=0.58, left=0.8)
    return figure


def _panels(year: Year) -> list[tuple[str, str]]:
    """Estimator and name of the panels of Figs 17 and 18."""
    return [
        ("jmap-uniform", f"uniform prior, alpha = {year.config.jmap.alpha:g}"),
        ("jmap-uniform-estimated", "uniform prior, alpha estimated"),
        ("jmap", f"Rayleigh prior, sigma_d = {number(year.config.jmap_settings().delay_scale)}"),
    ]


def searches(sheet: Sheet, year: Year, estimated: Results, *_: Any) -> Figure:
    s = year.config.jmap_settings()
    note = f"{_who(year)} · d from {s.d_min} to {s.d_max} T_s"
    figure, panels = sheet(note, columns=2, gap=(0.75, 0.0), right=0.3, bottom=0.85)
    shown = [("direct", "direct approach (8)")] if year.outflow else []
    _histograms(panels, estimated, [*shown, ("indirect", "indirect approach (10)")])
    if not shown:
        style.message(panels[1], "No outflow is logged: no direct approach.")
        panels[1].set_axis_off()
    return figure


def jmap_histograms(sheet: Sheet, year: Year, estimated: Results, *_: Any) -> Figure:
    note = f"{_who(year)} · T_s = {year.sample_time:g} s"
    figure, panels = sheet(note, [2.9], 3, gap=(0.55, 0.0), right=0.25, bottom=0.85, top=0.92)
    _histograms(panels, estimated, _panels(year))
    return figure


def _histograms(panels: Sequence[Axes], estimated: Results, shown: Sequence[tuple[str, str]]) -> None:
    """Histograms with one scale, so that they can be compared."""
    for letter, ax, (name, words) in zip("abc", panels, shown, strict=False):
        estimates.histogram(ax, estimated, estimated.of(name), counted=False)
        style.name_panel(ax, letter, words)
    top = max(ax.get_ylim()[1] for ax in panels[: len(shown)])
    for ax in panels[: len(shown)]:
        ax.set_ylim(0, top)
    style.figure_key(panels)


def jmap_maps(sheet: Sheet, year: Year, estimated: Results, *_: Any) -> Figure:
    note = f"{_who(year)} · T_s = {year.sample_time:g} s"
    figure, panels = sheet(note, [1.75] * 3, gap=(0.0, 0.34), top=0.92)
    for letter, ax, (name, words) in zip("abc", panels, _panels(year), strict=True):
        style.date_axis(ax, year.dates[0], year.dates[-1], labels=letter == "c")
        estimates.delay_map(ax, estimated, estimated.of(name), counted=False)
        style.name_panel(ax, letter, words)
    style.figure_key(panels)
    return figure


IN_GREY = ("ml", "map", "jmap-uniform", "jmap")  # estimators of Figs 13 to 16, which have one scale of greys


def tdr(name: str, sheet: Sheet, year: Year, estimated: Results, *_: Any) -> Figure:
    """Figs 13-16: the impulse responses of the year by one estimator, the time-day representation."""
    e = estimated.of(name)
    note = f"{estimated.reach} · {count(int(e.answered.sum()), 'day')}"
    note += f" · alpha = {year.config.jmap.alpha:g} (m³/s)²" if name in ("map", "jmap-uniform") else ""
    note += f" · sigma_d = {estimated.delay_scale:g} T_s" if name == "jmap" else ""
    fir = e.fir[e.answered]
    if len(fir):
        note += f" · h[0] > h[1] on {share(int((fir[:, 0] > fir[:, 1]).sum()), len(fir))} of days"
    figure, (ax,) = sheet(note)
    style.date_axis(ax, e.dates[0], e.dates[-1])
    greys = estimates.grey_limits(np.concatenate([estimated.of(one).fir for one in IN_GREY]))
    estimates.tdr(
        ax, day_numbers(e.dates), e.fir, lag=e.delay, sample_time=estimated.sample_time, greys=greys,
        unit=response_unit(estimated.output_unit),
    )  # fmt: skip
    style.key(ax)
    return figure


def cascade(sheet: Sheet, _: Year, __: Results, ___: int, reaches: Sequence[CascadeReach]) -> Figure:
    """Fig. 19: how far the delay varies in each reach of a cascade, estimated and by experience."""

    def halved(found: Sequence[CascadeReach]) -> str:
        names = [r.name for r in found if np.ptp(r.estimated) <= np.ptp(r.empirical) / 2]
        return f"halved on {listed(names)}" if names else "halved nowhere"

    sure = [replace(r, delay=r.posterior) for r in reaches]
    note = f"the operators' interval is {halved(reaches)} (a), {halved(sure)} (b)"
    figure, panels = sheet(note, [3.0], 2, gap=(0.35, 0.0), top=1.2)
    low, high = (f(r.length for r in reaches) / 1000 for f in (min, max))
    room = max(0.15 * (high - low), 0.12 * high)
    every = np.concatenate([r.delay for r in (*reaches, *sure)])
    top = max(1.0, *(r.empirical[1] for r in reaches), float(np.nanmax(every, initial=1)))
    for ax, name, words, found in zip(
        panels, "ab", ("JMAP with uniform prior", "posterior"), (reaches, sure), strict=True
    ):
        for r in found:
            reach_delays(ax, r, shift=0.035 * (high - low + 2 * room))
        ax.set_xlim(low - room, high + room)
        style.lag_ticks(ax, -1.2, top + 1.0)
        ax.set_xlabel("reach length [km]")
        ax.grid(True, axis="y")
        style.name_panel(ax, name, words)
    panels[0].set_ylabel("delay [samples]")
    panels[1].tick_params(labelleft=False)
    style.second_axis(panels[1], reaches[0].sample_time, "[minutes]")
    style.figure_key(panels[:1], down=0.55, left=0.8)
    return figure


def reach_delays(ax: Axes, r: CascadeReach, shift: float) -> None:
    """Intervals of the delay of one reach at its length, `shift` apart on the x axis [km]."""
    x, first = r.length / 1000, not ax.lines
    ax.plot([x - 1.3 * shift] * 2, r.empirical, color=style.LIGHT, lw=9, solid_capstyle="butt", zorder=2)
    ax.plot([x + shift] * 2, r.estimated, color=style.INK, lw=2.2, zorder=3)
    for edge in r.estimated:
        ax.plot([x + 0.6 * shift, x + 1.4 * shift], [edge] * 2, color=style.INK, lw=2.2, zorder=3)
    at, days = np.unique(r.delay[np.isfinite(r.delay)], return_counts=True)
    if len(days):
        places = np.full(len(at), x + 2.2 * shift)
        ax.scatter(places, at, s=140 * days / days.sum(), color=style.ACCENT, lw=0, zorder=3)
    if first:
        ax.fill_between([], [], color=style.LIGHT, label="operators' interval (nominal ± 3 T_s)")
        nine = "estimated: nine days of ten"
        style.entry(ax, nine, marker="|", color=style.INK, markersize=9, markeredgewidth=2)
        style.entry(ax, "share of days", marker="o", color=style.ACCENT, markersize=6, markeredgewidth=0)
    if len(r.truth):
        low, high = float(r.truth.min()) - 0.3, float(r.truth.max()) + 0.3
        ax.fill_betweenx([low, high], x - 0.35 * shift, x + 0.35 * shift, color=style.WATER, label="true")
    ax.annotate(
        r.name, (x, 0), xycoords=("data", "axes fraction"), xytext=(0, 4), textcoords="offset points",
        ha="center", fontsize=8, color=style.GREY,
    )  # fmt: skip


FIGURES: dict[str, tuple[str, Callable[..., Figure]]] = {
    "1": ("The reach", reach),
    "2": ("Mean daily discharge", discharge),
    "3": ("Mean daily level", level),
    "4": ("Mean daily Froude number", froude),
    "5": ("Bounds of the travel time against the flow", bounds_by_flow),
    "6": ("Bounds of the travel time of each day", bounds_by_day),
    "7": ("A one-day data set", logs),
    "8": ("The reach and its operators", loop),
    "9": ("Delays by exhaustive search", searches),
    "10": ("A theoretical impulse response", theoretical),
    "11": ("The priors in use", priors),
    "12": ("Impulse responses and delay of one day", responses),
    "13": ("Responses of the ML estimator", partial(tdr, "ml")),
    "14": ("Responses of the MAP estimator", partial(tdr, "map")),
    "15": ("Responses of the JMAP, uniform prior, alpha fixed", partial(tdr, "jmap-uniform")),
    "16": ("Responses of the JMAP, Rayleigh prior", partial(tdr, "jmap")),
    "17": ("Delay of each day (JMAP)", jmap_maps),
    "18": ("How often each delay (JMAP)", jmap_histograms),
    "19": ("Delays of the reaches of a cascade", cascade),
}
"""Title and function of each figure, in the paper's order."""
