"""Estimates of each day, drawn on Axes: responses, delays over the record and against the discharge, t50.

The report, the figures of the paper and the library draw with these functions;
:func:`rivid.plots.style.key` adds the legend.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from rivid.estimators import ESTIMATORS
from rivid.plots import style
from rivid.results import read
from rivid.results.read import EstimatorResults, Results
from rivid.text import count, duration, number, time_unit
from rivid.types import Bools, Floats

ROBUST = (1.0, 99.0)
"""Percentiles of all coefficients of the record that are white and black: with a scale per day, the grey of a
bar would depend on its two most extreme, and least certain, coefficients."""
DARKEST = 0.45  # opacity of a cell of probability 1: marks and lines stay readable on it
GOLDEN = 0.6180339887498949  # multiples modulo 1 are evenly spread for any number of marks
FAR = 6.0
"""Days so many interquartile ranges beyond the quartiles are marked at the edge of a panel of t50, so that
single days do not compress the others."""
WIDER = 2.5  # a bound widens a panel of t50 up to so many times what the days need; beyond, text names it
GROUPS = 60  # a bound over the discharge is the line through the medians of so many groups of days
DASHED = (0, (4, 2))

COLOURS = {"data decide": style.INK, "data do not decide": style.LIGHT, "degenerate": style.GREY}
MARKS: dict[str, dict[str, Any]] = {  # mark of a day by the class of its delay (`kinds`)
    "data decide": {"marker": "o", "color": style.INK},
    "data do not decide": {"marker": "o", "color": style.GREY, "markerfacecolor": "white"},
    "degenerate": {"marker": "x", "color": style.GREY},
    "at a bound": {"marker": "^", "color": style.ACCENT},
}
EDGED: dict[str, Any] = {"markeredgewidth": 0.8, "zorder": 3}


def _class_label(kind: str, e: EstimatorResults, days: int, counted: bool) -> str:
    """A class of days in a legend; an estimator that does not judge its delays has delays only."""
    name = "delay" if kind == "data decide" and ESTIMATORS[e.estimator].unchecked else kind
    return f"{name} ({days:,})" if counted else name


def grey_limits(fir: Floats) -> tuple[float, float]:
    """Values that are white and black, from impulse responses of shape (days, M)."""
    # the first and last lags collect what a truncated response cannot place
    inner = fir[..., 1:-2] if fir.shape[-1] > 6 else fir
    values = inner[np.isfinite(inner)]
    if not values.size:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(values, ROBUST))
    return (low, high) if high > low else (low - 0.5 * abs(low) - 1e-12, high + 0.5 * abs(high) + 1e-12)


def tdr(
    ax: Axes,
    day: ArrayLike,
    fir: Floats,
    *,
    lag: Floats | None = None,
    label: str = "delay d",
    low: Floats | None = None,
    high: Floats | None = None,
    sample_time: float | None = None,
    greys: tuple[float, float] | None = None,
    unit: str = "",
) -> None:
    """Time-day representation (section VI, Figs 13-16): each day's response as a grey column, black is high.

    `day`, shape (n,), are whole numbers in increasing order; `fir`, shape (n, M), is NaN on days without a
    response. `lag` [samples], shape (n,), is marked on each day, `label` in the legend, and the set of delays
    from `low` to `high` [samples] where it holds more than one. `sample_time` [s] adds an axis in minutes.
    `greys` are the values that are white and black, by default by the responses themselves; their `unit`
    adds a scale.
    """
    x, M = np.asarray(day, float), fir.shape[1]
    at = (x - x[0]).astype(int)
    days = int(at[-1]) + 1
    answered = np.isfinite(fir).any(axis=1)
    white, black = grey_limits(fir) if greys is None else greys
    width = style.inches(ax)[0]
    ax.set_facecolor(style.NO_DATA)
    if answered.any():
        image = np.full((M, days), np.nan)
        image[:, at[answered]] = fir[answered].T
        if days > 380:  # narrower than pixels: matplotlib averages neighbours; repeated lags stay separate
            image = np.repeat(image, -(-400 // M), axis=0)
        ax.imshow(
            image, cmap="Greys", vmin=white, vmax=black, origin="lower", aspect="auto",
            extent=(x[0] - 0.5, x[-1] + 0.5, -0.5, M - 0.5),
        )  # fmt: skip
        ax.set_autoscale_on(False)
    else:
        style.message(ax, f"None of the {count(len(x), 'day')} has a response.")
    if lag is not None and (marked := answered & np.isfinite(lag)).any():
        half = max(0.5, 0.75 * days / (72 * width))  # day; a mark is at least 1.5 points long
        for colour, thick in (("white", 2.9), (style.ACCENT, 1.7)):  # the white edge contrasts with any grey
            ax.hlines(lag[marked], x[marked] - half, x[marked] + half, colors=colour, linewidths=thick)
        style.entry(ax, label, marker="s", color=style.ACCENT, markersize=4)
        if low is not None and high is not None and (wide := marked & (high > low)).any():
            ax.vlines(
                x[wide], low[wide], high[wide], colors=style.ACCENT, alpha=0.6,
                linewidth=float(np.clip(18 * width / days, 0.5, 2.0)),
            )  # fmt: skip
            wider = f"90 % set, where wider ({int(wide.sum()):,})"
            style.entry(ax, wider, marker="|", markersize=7, color=style.ACCENT)
    if days > answered.sum():
        look = {"marker": "s", "color": style.NO_DATA, "markersize": 6, "markeredgecolor": style.LIGHT}
        style.entry(ax, "no response", **look)
    ax.set_ylabel("lag k [samples]")
    if not M:
        ax.set_yticks([])
        return
    style.lag_ticks(ax, -0.5, M - 0.5)
    if sample_time is not None:
        style.second_axis(ax, sample_time, "lag [minutes]")
    if unit and answered.any():
        _grey_scale(ax, white, black, unit)


def _grey_scale(ax: Axes, low: float, high: float, unit: str) -> None:
    """The scale of greys above the right end of a panel."""
    figure: Any = ax.get_figure(root=True)
    width, height = (float(v) for v in figure.get_size_inches())
    box = ax.get_position()
    bar = style.panel(figure, box.x1 * width - 1.75, box.y1 * height + 0.13, 1.1, 0.1)
    bar.imshow(np.linspace(0, 1, 64)[None, :], cmap="Greys", aspect="auto")
    _framed(bar)
    words: dict[str, Any] = {"transform": bar.transAxes, "va": "center", "fontsize": 8}
    bar.text(-0.04, 0.45, f"h[k] in {unit}:   {low:.1e}", ha="right", **words)
    bar.text(1.04, 0.45, f"{high:.1e}", ha="left", **words)


def _framed(ax: Axes) -> None:
    """A thin frame and no ticks."""
    ax.set(xticks=[], yticks=[])
    for spine in ax.spines.values():
        spine.set(visible=True, linewidth=0.5)


def response(
    ax: Axes, fir: Floats, *, delay: float = np.nan, sd: Floats | None = None, t50: float = np.nan,
    rounded: bool = False,
) -> None:  # fmt: skip
    """The impulse response of one day, shape (M,), with two standard deviations `sd` to either side.

    The jump at `delay` is a coloured step, or a band where the delay is a `rounded` t50; `t50` is a dashed
    line [samples]; NaN for none.
    """
    k = np.arange(len(fir))
    ax.axhline(0, color=style.LIGHT, lw=0.7)
    if sd is not None:
        ax.fill_between(k, fir - 2 * sd, fir + 2 * sd, color=style.LIGHT, alpha=0.5, linewidth=0)
    ax.plot(k, fir, color=style.INK, lw=1.0, marker="o", ms=2.4)
    if np.isfinite(delay):
        delay_band(ax, delay, rounded)
        step = slice(int(delay), int(delay) + (1 if rounded else 2))
        ax.plot(k[step], fir[step], color=style.ACCENT, lw=1.8, marker="o", ms=3.2)
    if np.isfinite(t50):
        ax.axvline(t50, color=style.WATER, lw=1.0, ls=DASHED)
    ax.set_xlim(-0.5, len(fir) - 0.5)
    ax.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))


def delay_band(ax: Axes, delay: float, rounded: bool) -> None:
    """Shade the lags from d to d + 1, where the response jumps, or those that round to d; nothing for NaN."""
    if np.isfinite(delay):
        begin = delay - 0.5 if rounded else delay
        ax.axvspan(begin, begin + 1, color=style.ACCENT, alpha=0.18, linewidth=0, zorder=0)


def grey_bar(ax: Axes, fir: Floats, *, below: float = 0.17, height: float = 0.11, bins: int = 8) -> Axes:
    """Draw a response as a bar of the time-day representation under its panel `ax`, and return the bar.

    Its lower edge is `below` the panel, `height` high [inch]; its axis of lags has up to `bins` intervals.
    """
    figure: Any = ax.get_figure(root=True)
    box, inch = ax.get_position(), 1 / float(figure.get_size_inches()[1])
    bar: Axes = figure.add_axes((box.x0, box.y0 - below * inch, box.width, height * inch))
    low, high = grey_limits(fir)
    extent = (-0.5, len(fir) - 0.5, 0.0, 1.0)
    bar.imshow(fir[None, :], cmap="Greys", aspect="auto", extent=extent, vmin=low, vmax=high)
    _framed(bar)
    bar.xaxis.set_major_locator(MaxNLocator(nbins=bins, integer=True, steps=[1, 2, 5, 10]))
    ax.spines["bottom"].set_visible(False)
    ax.set_xticks([])
    return bar


def delay_ticks(ax: Axes, low: float, high: float, sample_time: float) -> None:
    """Delays in samples on the x axis, minutes or hours under them, in whole ones on narrow panels."""
    margin = max(0.7, 0.02 * (high - low))
    ax.set_xlim(low - margin, high + margin)
    width = style.inches(ax)[0]
    bins, digits = min(round(3.6 * width), 20), int(width > 5)
    ax.xaxis.set_major_locator(MaxNLocator(nbins=bins, integer=True, steps=[1, 2, 5, 10]))
    unit, seconds = time_unit(high * sample_time)
    ax.xaxis.set_major_formatter(lambda d, _: f"{d:.0f}\n{d * sample_time / seconds:.{digits}f}")
    ax.tick_params(axis="x", length=3)
    ax.set_xlabel(f"delay d [samples; below: {unit}]", labelpad=4)


def shares(e: EstimatorResults, places: Floats) -> dict[str, Floats]:
    """Share of days [%] at each candidate by the class of the day; arrays of shape (K,), 100 in all."""
    days = read.found(e)
    prior, doubt = e.prior_only & ~e.degenerate, e.degenerate
    return {
        name: 100 * (e.delay[days & kind, None] == places).sum(axis=0) / max(int(days.sum()), 1)
        for name, kind in (
            ("data decide", ~prior & ~doubt), ("data do not decide", prior), ("degenerate", doubt)
        )
    }  # fmt: skip


def histogram(ax: Axes, results: Results, e: EstimatorResults, *, counted: bool = True) -> None:
    """Share of days at each candidate delay, with the prior or the mean probability over it (Fig. 18).

    The legend has numbers of days where it is `counted`; without them several panels can share it.
    """
    places, days = read.candidates(e), read.found(e)
    top = np.zeros(len(places))
    for name, share in shares(e, places).items():
        if share.any():
            label = _class_label(name, e, round(share.sum() * days.sum() / 100), counted)
            ax.bar(places, share, bottom=top, width=0.78, color=COLOURS[name], linewidth=0, label=label)
            top = top + share
    if days.any():
        edge = max(float(top[0]), float(top[-1]))
        ax.set_ylim(0, max(1.06 * float(top.max()), 1.22 * edge))  # the names of the bounds stay readable
    else:
        style.message(ax, f"None of the {count(len(e.dates), 'day')} has a delay.")
        ax.set_ylim(0, 100)
    if n := int((e.at_bound & days).sum()):
        ax.bar(
            places[[0, -1]], top[[0, -1]], width=0.78, facecolor="none", edgecolor=style.ACCENT, hatch="////",
            linewidth=0, label=_class_label("at a bound", e, n, counted),
        )  # fmt: skip
    line: dict[str, Any] = {"color": style.WATER, "lw": 1.2, "marker": "o", "ms": 2.5}
    if ESTIMATORS[e.estimator].rayleigh and places.size:
        sigma = f" (sigma_d = {number(results.delay_scale)})" if counted else ""
        prior = 100 * read.rayleigh(places, results.delay_scale)
        ax.plot(places, prior, label=f"Rayleigh prior alone{sigma}", **line)
    if e.probability is not None:
        known = np.isfinite(e.probability)
        label = f"mean probability ({count(int(known.sum()), 'day')})"
        ax.plot(places, 100 * e.criterion[known].mean(axis=0), label=label, **line)
    ax.set_ylabel("share of days [%]")
    ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    ax.yaxis.grid(True)
    if not places.size:
        ax.set_xticks([])
        return
    delay_ticks(ax, places[0], places[-1], results.sample_time)
    for bound, side, name in ((places[0], -0.5, "d_min"), (places[-1], 0.5, "d_max")):
        ax.axvline(bound + side, color=style.ACCENT, lw=0.8, ls=(0, (4, 3)))
        ax.annotate(
            name, (bound + side, 1), xycoords=("data", "axes fraction"), xytext=(-4 * np.sign(side), -3),
            textcoords="offset points", ha="right" if side > 0 else "left", va="top", fontsize=8,
            color=style.ACCENT, rotation=90,
        )  # fmt: skip


def delay_map(ax: Axes, results: Results, e: EstimatorResults, *, counted: bool = True) -> None:
    """Delay of each day over the record (Fig. 17), on an x axis of day numbers.

    `counted`: with numbers of days in the legend, and the bounds (5): a wave arrives after (d + 1) T_s, where
    d is a t50 rounded to samples after d T_s.
    """
    x, tried = read.day_numbers(e.dates), read.candidates(e)
    ax.set_ylabel("delay d [samples]")
    if not read.found(e).any():
        style.message(ax, f"None of the {count(len(x), 'day')} has a delay.")
    if not tried.size:
        ax.set_yticks([])
        return
    bins = max(min(round(7 * style.inches(ax)[1]), 16), 4)  # 16 on panels of two inches and more
    style.lag_ticks(ax, float(tried[0]) - 0.8, float(tried[-1]) + 0.8, bins=bins)
    ax.yaxis.grid(True)
    if e.probability is not None:
        at = (x - x[0]).astype(int)
        p = np.zeros((len(e.candidates), at[-1] + 1))
        p[:, at] = np.nan_to_num(e.criterion).T
        probability_cells(ax, float(x[0]), e.candidates, p)
    size = float(np.clip(160 / np.sqrt(len(x)) / 2.4, 2.2, 6.0))
    for name, days in read.kinds(e).items():
        if days.any():
            label = _class_label(name, e, int(days.sum()), counted)
            style.marks(ax, x[days], e.delay[days], label, size, **EDGED, **MARKS[name])
    if counted:
        bounds_over_days(ax, results, e, lead=0.0 if read.rounded(results, e) else 1.0)
    style.second_axis(ax, results.sample_time, "d T_s [minutes]")


def probability_cells(
    ax: Axes, first: float, delay: NDArray[Any], probability: Floats, darkest: float = DARKEST
) -> None:
    """Probabilities as grey cells, the darker the more probable; the limits of the panel stay.

    `first` is the day number of the first column, `delay`, shape (D,), are consecutive [samples], and
    `probability`, shape (D, days), is 0 where there is none.
    """
    image = np.full((*probability.shape, 4), to_rgba(style.INK))
    image[..., 3] = darkest * probability
    extent = (first - 0.5, first + probability.shape[1] - 0.5, delay[0] - 0.5, delay[-1] + 0.5)
    limits = ax.get_xlim(), ax.get_ylim()
    ax.imshow(image, origin="lower", aspect="auto", interpolation="nearest", extent=extent, zorder=1.5)
    ax.set(xlim=limits[0], ylim=limits[1])


def with_gaps(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """A line over days that breaks where days are missing: NaN between day numbers more than 1 apart."""
    breaks = np.flatnonzero(np.diff(x) > 1) + 1
    return np.insert(x, breaks, np.nan), np.insert(y, breaks, np.nan)


def _waves(e: EstimatorResults) -> list[tuple[str, Floats, Any]]:
    """Name, travel time [s] and dashes of both bounds (5)."""
    return [("gravity wave", e.bound_gravity_s, "-"), ("kinematic wave", e.bound_kinematic_s, DASHED)]


def bounds_over_days(ax: Axes, results: Results, e: EstimatorResults, *, lead: float) -> None:
    """Travel times tau (5) over the record, at tau / T_s - `lead` samples: 1 for a delay d, 0 for t50."""
    x, (low, high) = read.day_numbers(e.dates), ax.get_ylim()
    for name, seconds, dash in _waves(e)[: 1 if results.output_unit == "m" else 2]:  # both in a free river
        delay = seconds / results.sample_time - lead
        if np.any((delay >= low) & (delay <= high)):
            ax.plot(
                *with_gaps(x, delay), color=style.WATER, lw=0.9, ls=dash, marker="_" if len(x) < 3 else "",
                label=f"{name}, as a delay" if lead else name, zorder=2, scalex=False, scaley=False,
            )  # fmt: skip


def spread(n: int) -> Floats:
    """Small vertical shifts of n marks [samples], evenly spread in (-0.3, 0.3), the same each time."""
    return 0.6 * (np.arange(1, n + 1, dtype=np.float64) * GOLDEN % 1.0) - 0.3


def flow_axis(ax: Axes, Q: Floats) -> None:
    """The mean inflows of the days as the x axis."""
    low, high = float(Q.min()), float(Q.max())
    margin = 0.04 * (high - low) or max(0.1 * abs(high), 1.0)
    ax.set_xlim(low - margin, high + margin)


def delay_discharge(ax: Axes, results: Results, e: EstimatorResults) -> None:
    """Travel time against the mean inflow, with the bounds (5); without a fraction of a sample the first
    sample that moves, d + 1: the wave needs d T_s to (d + 1) T_s."""
    shown, tried = read.found(e) & np.isfinite(e.mean_inflow), read.candidates(e)
    n, Q, y = int(shown.sum()), e.mean_inflow, e.delay + 1
    what, unit = "first sample that moves, d + 1", "(d + 1) T_s [minutes]"
    if tried.size:
        low, high = float(tried[0]) + 0.2, float(tried[-1]) + 1.8
        if n and e.travel_s is not None:
            y, what, unit = e.travel_s / results.sample_time, "travel time [samples]", "travel time [minutes]"
            low, high = float(y[shown].min()) - 1.0, float(y[shown].max()) + 1.0
        elif n > 12:
            y = y + spread(len(Q))
        style.lag_ticks(ax, low, high, bins=16)
    ax.grid(True)
    ax.set_xlabel("mean inflow of the day [m³/s]")
    ax.set_ylabel(what)
    if n:
        size = float(np.clip(70 / np.sqrt(n), 2.0, 5.5))
        for name, kind in read.kinds(e).items():
            if (days := kind & shown).any():
                look = {"markeredgewidth": 0.7, "zorder": 3, "alpha": 0.75, **MARKS[name]}
                style.marks(ax, Q[days], y[days], _class_label(name, e, days.sum(), True), size, **look)
        flow_axis(ax, Q[shown])
        bounds_over_flow(ax, results, e, shown)
    else:
        style.message(ax, f"None of the {count(len(e.dates), 'day')} has a delay and a mean inflow.")
        ax.set_xticks([])
    if tried.size:
        style.second_axis(ax, results.sample_time, unit)
    else:
        ax.set_yticks([])


def bounds_over_flow(ax: Axes, results: Results, e: EstimatorResults, shown: Bools) -> None:
    """Both bounds (5) at tau / T_s over the discharge; text names one that is outside the panel."""
    low, high = ax.get_ylim()
    outside: list[str] = []
    for name, seconds, dash in _waves(e):
        known = np.isfinite(e.mean_inflow) & np.isfinite(seconds)
        if not (known & shown).any():
            continue
        order = np.argsort(e.mean_inflow[known], kind="stable")
        Q, tau = _medians(e.mean_inflow[known][order]), _medians(seconds[known][order])
        lag = tau / results.sample_time
        if ((lag >= low) & (lag <= high)).any():
            if len(Q) == 1:
                Q, lag = np.array(ax.get_xlim()), np.repeat(lag, 2)
            ax.plot(Q, lag, color=style.WATER, lw=1.2, ls=dash, label=name, scalex=False, scaley=False)
        else:
            span = duration([float(tau.min()), float(tau.max())])
            outside.append(f"{name}: {span}, {'above' if lag.min() > high else 'below'} this panel")
    if outside:  # at the top right: at high discharge few delays are long
        ax.text(
            0.995, 0.98, "\n".join(outside), transform=ax.transAxes, ha="right", va="top", fontsize=8,
            color=style.WATER, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5, "alpha": 0.85},
        )  # fmt: skip


def _medians(values: Floats) -> Floats:
    """Medians of equal groups of sorted days: a line without the scatter of each day's depth."""
    if len(values) <= 2 * GROUPS:
        return values
    return np.array([np.median(part) for part in np.array_split(values, GROUPS)])


def t50(ax: Axes, results: Results, e: EstimatorResults) -> None:
    """t50 of each day over the record, on an x axis of day numbers, and the bounds (5)."""
    if _t50_days(ax, results, e, read.day_numbers(e.dates), grow=1.0).any():
        ax.yaxis.grid(True)
        bounds_over_days(ax, results, e, lead=0.0)
        style.second_axis(ax, results.sample_time, "t50 [minutes]")


def t50_discharge(ax: Axes, results: Results, e: EstimatorResults) -> None:
    """t50 against the mean inflow, with the median of each third of the days; as :func:`t50`."""
    shown = _t50_days(ax, results, e, e.mean_inflow, grow=0.8)
    ax.set_xlabel("mean inflow of the data set [m³/s]")
    if not shown.any():
        ax.set_xticks([])
        return
    ax.grid(True)
    flow_axis(ax, e.mean_inflow[shown])
    if t := read.thirds(e):
        for (first, last), middle in zip(pairwise(t.edges), t.medians, strict=True):
            for colour, width in (("white", 3.0), (style.ACCENT, 1.8)):  # the white edge sets it off
                ax.hlines(middle, first, last, colors=colour, linewidths=width, zorder=4)
        style.entry(ax, "median of each third of days", ls="-", color=style.ACCENT, lw=1.8)
    bounds_over_flow(ax, results, e, shown)
    style.second_axis(ax, results.sample_time, "t50 [minutes]")


def _t50_days(ax: Axes, results: Results, e: EstimatorResults, x: Floats, *, grow: float) -> Bools:
    """The days as marks over x, on an axis of lags; returns which these are, shape (n,)."""
    shown = read.has_t50(e) & np.isfinite(x)
    ax.set_ylabel("t50 [samples]")
    if not shown.any():
        style.message(ax, f"None of the {count(len(e.dates), 'day')} has a t50.")
        ax.set_yticks([])
        return shown
    bounds = [tau[np.isfinite(tau)] / results.sample_time for tau in (e.bound_kinematic_s, e.bound_gravity_s)]
    low, high = t50_window(e.t50[shown], [tau for tau in bounds if tau.size])
    style.lag_ticks(ax, low, high, bins=10)
    outside = shown & ((e.t50 < low) | (e.t50 > high))
    degenerate = shown & ~outside & e.degenerate
    size = grow * float(np.clip(160 / np.sqrt(len(e.dates)) / 2.4, 2.4, 6.0))
    for name, days, kind in (
        ("t50", shown & ~outside & ~degenerate, "data decide"),
        ("degenerate", degenerate, "degenerate"),
        ("beyond this panel", outside, "at a bound"),
    ):
        if days.any():
            label, y = f"{name} ({int(days.sum()):,})", np.clip(e.t50[days], low, high)
            style.marks(ax, x[days], y, label, size, alpha=0.8, **EDGED, **MARKS[kind])
    return shown


def t50_window(t50: Floats, bounds: Sequence[Floats]) -> tuple[float, float]:
    """Ends of a panel of t50: the days, and the bounds, nearest first, that leave them enough space."""
    first, third = (float(q) for q in np.quantile(t50, (0.25, 0.75)))
    reach = FAR * (third - first) or np.inf
    near = t50[(t50 >= first - reach) & (t50 <= third + reach)]
    low, high = float(near.min()), float(near.max())
    most = WIDER * max(high - low, 2.0)
    for tau in bounds:
        wider = min(low, float(tau.min())), max(high, float(tau.max()))
        if wider[1] - wider[0] <= most:
            low, high = wider
    margin = max(0.06 * (high - low), 0.6)
    return low - margin, high + margin
