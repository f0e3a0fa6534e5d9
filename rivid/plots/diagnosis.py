"""Figures of a diagnosis.

Before and after have one colour each in all of them: vermilion without the named effects, blue with them.
"""

import datetime as dt
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike
from scipy.stats import t as student

from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.result import LoopDay
from rivid.plots import style
from rivid.plots.files import FigureFile
from rivid.text import count, day_range, shorten
from rivid.types import Bools, Floats

KINDS = ("diagnosis_map", "diagnosis_gap", "diagnosis_day", "diagnosis_inflow", "diagnosis_loop")
"""Names of the files."""
BEFORE, AFTER = style.ACCENT, style.WATER
WITHOUT, WITH = "without the named effects", "with the named effects"
SIGNED = LinearSegmentedColormap.from_list(
    "less and more water", ["#5A3A0B", "#A66F1E", "#DDBE86", "#FAFAF8", "#8CCBC1", "#22867D", "#033E37"], 255
)
"""Brown where water of the logs is missing, teal where there is more than in the logs."""
LOOKS: tuple[dict[str, Any], ...] = (
    {"color": style.INK, "lw": 1.6},
    {"color": BEFORE, "lw": 1.4, "ls": (0, (5, 2))},
    {"color": AFTER, "lw": 1.4},
)
"""Curves of a day: measured, simulated without and with the named effects."""

NAME_LENGTH = 36  # characters of the name next to a bar; the table of the page has the whole name
SHARE = 0.99  # of the cells of the map inside the colour scale: single hours must not dominate it
RANK = 0.8
"""Rank of the plotted day by the error of the simulation without effects: the last is a day of a broken gauge
more often than of a typical gap."""
WHOLE = 0.8  # smallest share of the samples of a full day that the plotted day has
POINTS = 1500  # points of the course of a season at most, about as many as the figure has pixels across
BINS = 8  # bins of a logged series: blocks of a short season fill as many
FEWEST = 4  # blocks of days that a bin needs: with fewer, t gives intervals as wide as the panel


def limits(*curves: Floats, part: float = 1.0) -> float:
    """The largest absolute value, or of each curve its quantile `part`; 1 where there is none."""
    sizes = [np.abs(c[np.isfinite(c)]) for c in curves]
    return max((float(np.quantile(s, part)) for s in sizes if s.size), default=0.0) or 1.0


BARS: dict[str, dict[str, Any]] = {  # bars by the kind of a simulation
    "baseline": {"label": "without any effect", "color": BEFORE},
    "step": {"label": "effects added", "color": AFTER},
    "described": {
        "label": "events timed on the day", "facecolor": "white", "edgecolor": AFTER, "hatch": "/////",
        "linewidth": 0.8,
    },
}  # fmt: skip
Row = tuple[str, str, Sequence[float], Sequence[float] | None]
"""A simulation: kind, name, and errors by horizon on the sealed and, where known, on the open days."""


def draw_gap(folder: Path, rows: Sequence[Row], hours: Sequence[float], unit: str, days: int) -> FigureFile:
    """Draw diagnosis_gap.png: a panel per horizon [h], a bar per simulation, errors in `unit` of `days`."""
    bars, title = [row for row in rows if row[0] != "floor"], "The gap on the days kept apart"
    figure, panels = style.sheet(
        title, f"{count(days, 'day')} · root mean square error", [0.36 * len(bars)], [1.0] * len(hours),
        gap=(0.62, 0.0), left=2.45, right=0.3, top=1.04, bottom=0.62, heading=0.68,
    )  # fmt: skip
    for i, (ax, h) in enumerate(zip(panels, hours, strict=True)):
        errors_ahead(ax, rows, i)
        ax.set_xlabel(f"error [{unit}]")
        ax.set_yticklabels([shorten(row[1], NAME_LENGTH) for row in bars] if i == 0 else [])
        style.heading(ax, f"{h:g} h ahead", fontweight="bold")
    style.figure_key(panels, down=0.58, left=0.68)
    events, known = any(row[0] == "described" for row in rows), any(row[3] is not None for row in rows)
    return style.written(figure, folder / "diagnosis_gap.png", title, events=events, open=known)


def errors_ahead(ax: Axes, rows: Sequence[Row], i: int) -> None:
    """Errors at horizon `i`, the first row on top: sealed days bars, open ones marks, the floor a line."""
    ax.spines["left"].set_color(style.LIGHT)
    values = [(kind, float(e[i]), np.nan if known is None else float(known[i])) for kind, _, e, known in rows]
    bars = [row for row in values if row[0] != "floor"]
    y = np.arange(len(bars), dtype=float)[::-1]
    shown = [v for row in values for v in row[1:] if np.isfinite(v)]
    ax.set_xlim(0, 1.28 * (max(shown, default=0.0) or 1.0))
    ax.set_ylim(-0.5, len(bars) - 0.5)
    for at, (kind, value, known) in zip(y, bars, strict=True):
        if np.isfinite(value):
            ax.barh(at, value, 0.62, **BARS[kind])
        if np.isfinite(known):
            ax.plot(
                known, at, "o", ms=4.5, mfc="white", mec=style.INK, mew=1.0, zorder=3,
                label="open days, cross-validated",
            )  # fmt: skip
        ax.annotate(
            _digits(value) if np.isfinite(value) else "too few samples", (np.nanmax([value, known, 0.0]), at),
            xytext=(5, 0), textcoords="offset points", va="center", fontsize=8, zorder=4,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
        )  # fmt: skip
    for kind, floor, _ in values:
        if kind == "floor" and np.isfinite(floor):
            ax.axvline(floor, color=style.INK, lw=1.0, ls=(0, (3, 2)), label="weather and gauge alone")
    ax.xaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    ax.set_yticks(y)
    ax.tick_params(axis="y", length=0)


def _digits(value: float) -> str:
    return f"{value:.0f}" if value >= 19.95 else f"{value:.1f}" if value >= 0.95 else f"{value:.2g}"


def draw_map(folder: Path, evidence: Evidence, *, named: bool) -> FigureFile:
    """Draw diagnosis_map.png: the unexplained inflow without and, where there are any, with named effects."""
    r = evidence.record
    dates, flows = r.dates, (evidence.inflow_before, evidence.inflow_after)[: 1 + named]
    maps = [hourly_map(w, r.hour, r.used, dates) for w in flows]
    figure, panels = style.sheet(
        "When water is missing: the unexplained inflow by hour and date",
        f"{count(len(dates), 'day')}, {day_range(dates[0], dates[-1])} · mean of each hour, above what the "
        "logs and the simulation account for",
        [2.73], [1.0] * len(maps), gap=(0.3, 0.0), left=0.62, right=0.98, top=0.92, bottom=0.55,
    )  # fmt: skip
    top = limits(*maps, part=SHARE)
    for ax, image, words in zip(panels, maps, (WITHOUT, WITH), strict=False):
        ax.patch.set(facecolor="white", hatch="////", edgecolor=style.LIGHT)
        ax.imshow(
            image, cmap=SIGNED, vmin=-top, vmax=top, origin="lower", aspect="auto", interpolation="nearest",
            extent=(dates[0].toordinal() - 0.5, dates[-1].toordinal() + 0.5, 0, 24),
        )  # fmt: skip
        style.date_axis(ax, dates[0], dates[-1])
        ax.set_yticks(range(0, 25, 6))
        style.heading(ax, words if len(maps) == 2 else "")
    panels[0].set_ylabel("hour of the day")
    for ax in panels[1:]:
        ax.tick_params(axis="y", labelleft=False)
    bar = style.panel(figure, style.WIDTH - 0.8, 0.55, 0.13, 2.73)
    scale = np.linspace(-1, 1, 255)[:, None]
    bar.imshow(scale, cmap=SIGNED, aspect="auto", origin="lower", extent=(0, 1, -top, top))
    bar.set_xticks([])
    bar.yaxis.tick_right()
    bar.set_ylabel("unexplained inflow [m³/s]")
    bar.yaxis.set_label_position("right")
    return style.written(figure, folder / "diagnosis_map.png", "When water is missing", named=named)


def hourly_map(values: Floats, hour: Floats, used: Bools, dates: Sequence[dt.date], step: int = 1) -> Floats:
    """Mean of each `step` hours of each calendar day, (24 / step, calendar days), of samples (days, n)."""
    day, parts = np.array([(date - dates[0]).days for date in dates]), 24 // step
    cell = np.minimum((hour + 1e-9).astype(np.int64) // step, parts - 1) + parts * day[:, None]
    return cell_means(values, cell, used, parts * (int(day[-1]) + 1)).reshape(-1, parts).T


def cell_means(values: Floats, cell: ArrayLike, used: Bools, size: int) -> Floats:
    """Mean of the valid samples of each of `size` cells, shape (size,); NaN where there are none."""
    there = used & np.isfinite(values)
    at = np.asarray(cell)[there]
    total, number = np.bincount(at, values[there], size), np.bincount(at, minlength=size)
    return np.asarray(np.divide(total, number, out=np.full(size, np.nan), where=number > 0))


def daily_means(values: Floats, used: Bools) -> Floats:
    """Mean of the valid samples of each day, shape (days,); NaN where there are none."""
    day = np.arange(len(values))[:, None] + np.zeros(values.shape, np.int64)
    return cell_means(values, day, used, len(values))


Window = tuple[str, dt.date, dt.date]  # an effect and the dates on which it acts, both ends included


def draw_inflow(
    folder: Path, evidence: Evidence, *, named: bool, windows: Sequence[Window] = ()
) -> FigureFile:
    """Draw diagnosis_inflow.png: the course of the unexplained inflow, and its means by hour and driver."""
    r, e = evidence.record, evidence
    dates, hour, used = r.dates, r.hour, r.used
    shown = [(WITHOUT, BEFORE, e.inflow_before, e.inflow_before_sd)]
    shown += [(WITH, AFTER, e.inflow_after, e.inflow_after_sd)] if named else []
    drivers = [("hour of the day", hour), ("inflow [m³/s]", r.inflow)]
    pool = [("outflow [m³/s]", r.outflow), ("level [m]", r.output)]
    drivers += pool if r.kind == "pool" else [("discharge [m³/s]", r.output)]
    small, below = 1.5, 0.55  # height of the panels at the bottom, and the margin under them [inch]
    figure, panels = style.sheet(
        "The unexplained inflow",
        f"{count(len(dates), 'day')}, {day_range(dates[0], dates[-1])} · the inflow that the simulation "
        "lacks to follow the gauge",
        [1.35] * len(shown), gap=(0.0, 0.3), left=0.72, right=0.3, top=0.92, bottom=below + small + 0.98,
    )  # fmt: skip
    curves = [course(flow, sd, dates, hour, used) for _, _, flow, sd in shown]
    top = 1.08 * limits(*(mean for _, mean, _, _ in curves), part=0.998)
    for ax, (words, colour, _, _), (day, mean, half, hours) in zip(panels, shown, curves, strict=True):
        for _, first, last in windows:
            ax.axvspan(first.toordinal() - 0.5, last.toordinal() + 0.5, color=style.FAINT, lw=0, zorder=0)
        banded(ax, day, mean, half, colour, lw=0.8)
        ax.set_ylim(-top, top)
        ax.set_ylabel("inflow [m³/s]")
        step = "hourly means" if hours == 1 else f"means of {hours} h"
        style.heading(ax, f"{words}, {step}" if len(shown) == 2 else f"{step} with the 95 % band")
        style.date_axis(ax, dates[0], dates[-1], labels=ax is panels[-1])
    if windows:
        text = shorten("grey: dates of " + "; ".join(dict.fromkeys(name for name, _, _ in windows)), 80)
        style.heading(panels[-1], text, at=1, fontsize=8, color=style.GREY)

    each = (style.WIDTH - 0.72 - 0.3 - 0.3 * (len(drivers) - 1)) / len(drivers)
    ends = []
    for i, (label, values) in enumerate(drivers):
        ax = style.panel(figure, 0.72 + i * (each + 0.3), below, each, small)
        edges = edges_of(values, used) if i else np.arange(25.0)
        found = [means(flow, values, used, e.split.block, edges) for _, _, flow, _ in shown]
        for (_, colour, _, _), (centre, mean, half) in zip(shown, found, strict=True):
            banded(ax, centre, mean, half, colour, lw=1.1, marker="o", ms=2.6)
            ends += [mean, mean - half, mean + half]
        ax.set_xlabel(label)
        if i:
            style.few_ticks(ax, "x", bins=4)
            ax.tick_params(axis="y", labelleft=False)
        else:
            ax.set(xlim=(0, 24), xticks=range(0, 25, 6))
            ax.set_ylabel("mean [m³/s]")
            style.heading(ax, "Its mean by hour and by logged series", up=6, fontweight="bold")
        if not any(np.isfinite(mean).any() for _, mean, _ in found):
            style.message(ax, "does not vary")
    for ax in figure.axes[len(shown) :]:
        ax.set_ylim(-1.1 * limits(*ends), 1.1 * limits(*ends))
    return style.written(figure, folder / "diagnosis_inflow.png", "The unexplained inflow", named=named)


def banded(ax: Axes, x: Floats, mean: Floats, half: Floats, colour: str, **look: Any) -> None:
    """A curve about zero with a band of `half` to either side."""
    ax.axhline(0, color=style.LIGHT, lw=0.7)
    ax.fill_between(x, mean - half, mean + half, color=colour, alpha=0.25, lw=0)
    ax.plot(x, mean, color=colour, **look)
    ax.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))


def course(
    flow: Floats, sd: Floats, dates: Sequence[dt.date], hour: Floats, used: Bools
) -> tuple[Floats, Floats, Floats, int]:
    """Means over some hours, as few as keep a season to :data:`POINTS` points, with the 95 % band.

    The band of a mean is the mean of the bands: neighbouring errors are correlated, so averaging does not
    narrow it. Returns day numbers, means and half widths of the band, each of shape (points,), NaN where
    samples are missing, and the hours of each mean.
    """
    span = (dates[-1] - dates[0]).days + 1
    step = next(h for h in (1, 2, 3, 6, 12, 24) if 24 / h * span <= POINTS or h == 24)
    there = used & np.isfinite(flow) & np.isfinite(sd)
    mean, deviation = (hourly_map(values, hour, there, dates, step).T.ravel() for values in (flow, sd))
    at = dates[0].toordinal() - 0.5 + (np.arange(len(mean)) + 0.5) * step / 24
    return at, mean, 1.96 * deviation, step


def edges_of(driver: Floats, used: Bools) -> Floats:
    """Edges of :data:`BINS` bins with as many samples each; fewer where values repeat."""
    there = used & np.isfinite(driver)
    if not there.any():
        return np.empty(0)
    return np.unique(np.quantile(driver[there], np.linspace(0.0, 1.0, BINS + 1)))


def means(
    series: Floats, driver: Floats, used: Bools, block: ArrayLike, edges: Floats
) -> tuple[Floats, Floats, Floats]:
    """Mean of the driver, mean of a series in its bins, and half width of the 95 % interval, shape (bins,).

    Days of one `block` (shape (days,)) may be alike; blocks are taken as independent. The variance is that of
    a ratio of sums over blocks, by linearisation, with Student's t on blocks less one. NaN where a bin has no
    samples or, for the interval, fewer than :data:`FEWEST` blocks. The last bin holds its upper edge.
    """
    k = max(len(edges) - 1, 0)
    if not k:
        return np.empty(0), np.empty(0), np.empty(0)
    there = used & np.isfinite(series) & (driver >= edges[0]) & (driver <= edges[-1])
    number = np.unique(np.asarray(block), return_inverse=True)[1]
    J = int(number.max()) + 1
    into = np.digitize(driver[there], edges[1:-1])
    cell = (number[:, None] * k + np.zeros(series.shape, np.int64))[there] + into
    S, N, D = (
        np.bincount(cell, weights, J * k).reshape(J, k)
        for weights in (series[there], np.ones(int(there.sum())), driver[there])
    )
    total = N.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean, centre = S.sum(axis=0) / total, D.sum(axis=0) / total
        seen = (N > 0).sum(axis=0)
        rest = S - mean * N
        variance = (rest**2).sum(axis=0) / total**2 * seen / (seen - 1)
        half = student.ppf(0.975, np.maximum(seen - 1, 1)) * np.sqrt(variance)
    return centre, mean, np.where(seen >= FEWEST, half, np.nan)


def draw_day(folder: Path, evidence: Evidence, *, named: bool) -> FigureFile | None:
    """Draw diagnosis_day.png: measured and simulated output, and the flows; None if no day was kept apart."""
    r, measured, apart = evidence.record, evidence.record.output, evidence.split.sealed
    before, after = evidence.run_before, evidence.run_after
    error = errors(measured, before, r.used)
    i = choose(error, apart, r.used)
    if i is None:
        return None
    river, title = r.kind == "river", f"A day kept apart: {r.dates[i]}"
    unit, factor, name = ("m³/s", 1.0, "discharge") if river else ("mm", 1000.0, "level")
    off = f"{factor * error[i]:.3g} {unit}"
    if named:
        off += f" without and {factor * errors(measured, after, r.used)[i]:.3g} {unit} with the named effects"
    figure, (upper, lower) = style.sheet(
        title, f"Error of the simulated {name}: {off} (root mean square)", [2.22, 1.25], gap=(0.0, 0.42),
        left=0.82, right=0.3, top=0.86, bottom=0.55,
    )  # fmt: skip
    own = np.s_[i, r.lead :]  # without the samples of the day before
    clock, valid = r.hour[own], r.used[own]
    runs = [(WITHOUT, before), (WITH, after)] if named else [("", before)]
    upper.plot(clock, measured[own], label="measured", **LOOKS[0])
    for (words, run), look in zip(runs, LOOKS[1:], strict=False):
        values = np.where(valid, run[own], np.nan)
        upper.plot(clock, values, label=f"simulated {words}".strip(), **look)
    upper.set_ylabel("discharge at the lower end [m³/s]" if river else "level at the dam [m]")
    lower.plot(clock, r.inflow[own], color=style.INK, lw=1.2, label="inflow")
    if not river:
        lower.plot(clock, r.outflow[own], color=style.GREY, lw=1.2, ls=(0, (4, 1.5)), label="outflow")
    lower.set_ylabel("flow [m³/s]")
    for ax in (upper, lower):
        style.key(ax)
    _hours_of_day([upper, lower], bins=6)
    others = error[apart & np.isfinite(error)]
    worse = int((others > error[i]).sum())
    return style.written(
        figure, folder / "diagnosis_day.png", title, output=name, days=len(others), worse=worse
    )


def _hours_of_day(panels: Sequence[Axes], bins: int) -> None:
    """Grids and a common axis of hours of panels below each other, with up to `bins` intervals of values."""
    for ax in panels:
        ax.set(xlim=(0, 24), xticks=range(0, 25, 3))
        style.few_ticks(ax, bins=bins)
        ax.grid(True)
        ax.tick_params(axis="x", labelbottom=ax is panels[-1])
    panels[-1].set_xlabel("hour of the day")


def errors(measured: Floats, simulated: Floats, used: Bools) -> Floats:
    """Root mean square of measured less simulated of each day, shape (days,); NaN without valid samples."""
    return np.sqrt(daily_means((measured - simulated) ** 2, used))


def choose(error: Floats, apart: Bools, used: Bools) -> int | None:
    """The day at :data:`RANK` of the errors: of those kept apart, nearly whole where one is; or None."""
    number = used.sum(axis=1)
    known = apart & np.isfinite(error)
    whole = known & (number >= WHOLE * number.max())
    days = np.flatnonzero(whole if whole.any() else known)
    order = days[np.argsort(error[days], kind="stable")]
    return int(order[round(RANK * (len(order) - 1))]) if len(order) else None


def draw_loop(folder: Path, day: LoopDay, words: str, *, named: bool) -> FigureFile:
    """Draw diagnosis_loop.png: level and outflow of a day; `words` are the line under the title."""
    hour, curves = np.array(day.hour), 2 + named
    level, outflow = (np.array(values[:curves]) for values in (day.level, day.outflow))
    title = f"With the operators in the loop: {day.date}"
    figure, (upper, lower, lowest) = style.sheet(
        title, words, [1.6, 1.6, 1.0], gap=(0.0, 0.42), left=0.82, right=0.3, top=0.9, bottom=0.55
    )
    simulated = f"simulated {WITHOUT}" if named else "simulated"
    lower.plot(hour, np.array(day.inflow), color=style.LIGHT, lw=1.1)
    lowest.axhline(0, color=style.INK, lw=1.0)
    names = ("measured", simulated, "with them")
    for i, (name, look, high, flow) in enumerate(zip(names, LOOKS, level, outflow, strict=False)):
        upper.plot(hour, high, label=name, **look)
        lower.plot(hour, flow, **look)
        if i:
            lowest.plot(hour, hourly(flow - outflow[0], hour), **look)
    for ax, label in ((upper, "level at the dam [m]"), (lower, "outflow [m³/s]"), (lowest, "[m³/s]")):
        ax.set_ylabel(label)
    _hours_of_day([upper, lower, lowest], bins=5)
    style.key(upper)
    style.heading(lower, "grey: the logged inflow, the only input of the simulation", color=style.GREY)
    style.heading(lowest, "outflow, simulated less measured, mean of an hour", color=style.GREY)
    return style.written(figure, folder / "diagnosis_loop.png", title)


def hourly(values: Floats, hour: Floats) -> Floats:
    """Mean of the hour about each sample, shape (n,); NaN where the sample itself is NaN."""
    there = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(there, values, 0.0))])
    number = np.concatenate([[0], np.cumsum(there)])
    low = np.searchsorted(hour, hour - 0.5, side="left")
    high = np.searchsorted(hour, hour + 0.5, side="right")
    mean = (total[high] - total[low]) / np.maximum(number[high] - number[low], 1)
    return np.where(there, mean, np.nan)
