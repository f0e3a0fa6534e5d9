"""The time-day representation (Figs 13-16): a grey bar per day, side by side, with the delay over them."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from rivid.estimators import ESTIMATORS
from rivid.plots import style
from rivid.plots.dates import calendar
from rivid.plots.style import FigureFile
from rivid.results.passage import has_t50
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import day_numbers, found
from rivid.text import count, day_range, output_words, response_unit
from rivid.types import Bools, Floats

ROBUST = (1.0, 99.0)
"""Percentiles of all coefficients that are white and black.

One scale for the record: with a scale per day the grey of a bar hangs on its two most extreme, and least
certain, coefficients, and the step at d drowns in stripes.
"""


def grey_limits(fir: Floats) -> tuple[float, float]:
    """Values that are white and black, from impulse responses of shape (days, M)."""
    # the first and last lags gather what a truncated response cannot place: black and white are not for them
    inner = fir[..., 1:-2] if fir.shape[-1] > 6 else fir
    values = inner[np.isfinite(inner)]
    if not values.size:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(values, ROBUST))
    return (low, high) if high > low else (low - 0.5 * abs(low) - 1e-12, high + 0.5 * abs(high) + 1e-12)


def bars(results: EstimatorResults) -> Floats:
    """The image, shape (M, calendar days): NaN on days without a row or an answer."""
    at = (day_numbers(results.dates) - results.dates[0].toordinal()).astype(int)
    image = np.full((max(results.fir.shape[1], 1), at[-1] + 1), np.nan)
    if results.fir.shape[1]:
        image[:, at[results.answered]] = results.fir[results.answered].T
    return image


def draw(results: Results, estimator: EstimatorResults, folder: Path) -> FigureFile:
    """Draw the time-day representation of one estimator.

    Parameters
    ----------
    results : Results
        All of the run, for what its estimators share.
    estimator : EstimatorResults
        With at least one row.
    folder : Path
        Where ``tdr_<estimator>.png`` goes.

    Returns
    -------
    FigureFile

    Notes
    -----
    Source: section VI, Figs 13-16.
    """
    e, dates = estimator, estimator.dates
    answered = int(e.answered.sum())
    page = style.sheet(
        f"Impulse response of each day: {e.estimator}",
        f"{results.reach} · {ESTIMATORS[e.estimator].words} · {count(answered, 'day')} of {len(dates):,}, "
        f"{day_range(dates[0], dates[-1])}",
        height=4.3,
    )
    axes = page.axes
    calendar(page, dates, e.status)
    entries = []
    image = bars(e)
    low, high = grey_limits(e.fir)
    M = e.fir.shape[1]
    axes.set_facecolor(style.NO_DATA)
    delays, passed = found(e), has_t50(e)
    if answered:
        first, last = dates[0].toordinal() - 0.5, dates[-1].toordinal() + 0.5
        axes.imshow(
            _crisp(image),
            cmap="Greys",
            vmin=low,
            vmax=high,
            origin="lower",
            aspect="auto",
            extent=(first, last, -0.5, M - 0.5),
        )
        axes.set_autoscale_on(False)
        if delays.any():
            _delay_marks(page, day_numbers(dates)[delays], e.delay[delays], image.shape[1])
            entries.append(style.dot("delay d", marker="s", color=style.ACCENT, markersize=4))
            entries += _sets(page, e, delays, image.shape[1])
        elif passed.any():
            _delay_marks(page, day_numbers(dates)[passed], e.t50[passed], image.shape[1])
            entries.append(style.dot("t50", marker="s", color=style.ACCENT, markersize=4))
        _grey_scale(page, low, high, response_unit(results.output_unit))
    else:
        style.say(axes, f"None of the {count(len(dates), 'day')} has an answer.")
    if image.shape[1] > answered:
        look = {"marker": "s", "color": style.NO_DATA, "markersize": 6, "markeredgecolor": style.LIGHT}
        entries.append(style.dot("no response", **look))
    axes.set_ylabel("lag k [samples]")
    if M:
        style.lag_ticks(axes, -0.5, M - 0.5)
        style.second_axis(axes, results.sample_time, "lag [minutes]")
    else:
        axes.yaxis.set_ticks([])
    style.key(page, entries)
    path = folder / f"tdr_{e.estimator}.png"
    style.save(page.figure, path)
    return style.figure_file(
        page,
        "tdr",
        e.estimator,
        path,
        "Impulse response of each day",
        _caption(results.output_unit, bool(delays.any()), bool(passed.any()), e.probability is not None),
    )


def _crisp(image: Floats) -> Floats:
    """The image with each lag repeated where days are narrower than pixels.

    Matplotlib then averages neighbours in both directions; lags must not flow into each other as days may.
    """
    return np.repeat(image, -(-400 // len(image)), axis=0) if image.shape[1] > 380 else image


def _delay_marks(page: style.Sheet, x: Floats, delay: Floats, days: int) -> None:
    """A short line across each day's bar at lag d, with a white edge that reads on any grey."""
    half = max(0.5, 0.75 * days / (72 * page.width))  # day; never thinner than 1.5 points
    for colour, width in (("white", 2.9), (style.ACCENT, 1.7)):
        page.axes.hlines(delay, x - half, x + half, colors=colour, linewidths=width)


def _sets(page: style.Sheet, e: EstimatorResults, days: Bools, n: int) -> list[Line2D]:
    """A thin line over the delays that hold 90 %, where they are more than one; its legend entry."""
    if e.delay_low is None or e.delay_high is None:
        return []
    wide = days & (e.delay_high > e.delay_low)
    if not wide.any():
        return []
    page.axes.vlines(
        day_numbers(e.dates)[wide], e.delay_low[wide], e.delay_high[wide], colors=style.ACCENT, alpha=0.6,
        linewidth=float(np.clip(18 * page.width / n, 0.5, 2.0)),
    )  # fmt: skip
    label = f"90 % set, where wider ({int(wide.sum()):,})"
    return [style.dot(label, marker="|", markersize=7, color=style.ACCENT)]


def _grey_scale(page: style.Sheet, low: float, high: float, unit: str) -> None:
    """The scale of greys, at the top right: white for the lowest value, black for the highest."""
    width, height = (float(v) for v in page.figure.get_size_inches())
    box = page.axes.get_position()
    left = box.x0 + box.width - 1.75 / width
    bar = page.figure.add_axes((left, 1 - 0.69 / height, 1.1 / width, 0.1 / height))
    bar.imshow(np.linspace(0, 1, 64)[None, :], cmap="Greys", aspect="auto")
    for axis in (bar.xaxis, bar.yaxis):
        axis.set_ticks([])
    for spine in bar.spines.values():
        spine.set_visible(True)
        spine.set_linewidth(0.5)
    words: dict[str, Any] = {"transform": bar.transAxes, "va": "center", "fontsize": 8}
    bar.text(-0.04, 0.45, f"h[k] in {unit}:   {low:.1e}", ha="right", **words)
    bar.text(1.04, 0.45, f"{high:.1e}", ha="left", **words)


def _caption(unit: str, with_delay: bool, with_t50: bool, with_set: bool) -> str:
    text = (
        "Each column is a day, each row a lag k. White is the lowest coefficient of the record, black the "
        "highest (1st and 99th percentile, the end lags left out). "
    )
    if unit == "m":
        text += "Where the inflow begins to act, the grey jumps from one row to the next."
    else:
        text += "The dark band is the inflow passing; a dispersive river has no jump."
    if with_delay:
        text += (
            " The coloured line is the estimated delay d: the inflow first moves the "
            f"{output_words(unit)} at lag d + 1, the row just above it."
        )
        if with_set:
            text += " The thin upright line joins the delays that together hold 90 % of the probability."
    elif with_t50:
        text += " The coloured line is t50: half of a step has arrived."
    return text
