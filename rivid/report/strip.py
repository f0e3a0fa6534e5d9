"""The last weeks day by day, as a drawing of a few lines that the page holds itself: sharp at any size.

Its colours are those of the page: classes here, rules in report.css. It is written here since a template
with so many small parts takes longer to compile than all of the page to fill.
"""

import datetime as dt
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rivid.report.lately import FEWEST_DAYS, WEEK, WEEKS, Lately, weeks_ago
from rivid.results.read import Results
from rivid.results.selection import kinds
from rivid.text import duration, minutes_first, samples, time_unit, travel_first
from rivid.types import Floats

if TYPE_CHECKING:
    from markupsafe import Markup


WIDTH, HEIGHT = 720.0, 216.0
LEFT, RIGHT, TOP, BOTTOM = 46.0, 46.0, 20.0, 40.0
"""The drawing and its margins, in its own units; text is 11 of them high."""

LEAST = 4.0
"""The delays shown span so many samples at least: a calm record has to look calm."""

LOOKS = {
    "data decide": "sure",
    "data do not decide": "prior",
    "degenerate": "doubt",
    "at a bound": "doubt",
}
"""How far to trust a day, and the class of its mark."""


@dataclass(frozen=True)
class Mark:
    """A day: where it lies, how it looks (sure, prior, doubt, none), what it says, its row in the table."""

    x: float
    y: float
    look: str
    words: str
    row: int | None


@dataclass(frozen=True)
class Strip:
    """The drawing.

    Attributes
    ----------
    marks : tuple of Mark
    medians : tuple of (float, float, float)
        Of each week: x of its ends, y.
    lags, times : tuple of (float, str)
        Ticks at y: samples on the left, `unit` on the right.
    dates : tuple of (float, str)
        Ticks at x.
    week : float
        x where the last week begins.
    floor : float
        y below which days without an answer are marked.
    looks : frozenset of str
        Those of the marks, for the legend.
    unit : str
        minutes or hours.
    """

    marks: tuple[Mark, ...]
    medians: tuple[tuple[float, float, float], ...]
    lags: tuple[tuple[float, str], ...]
    times: tuple[tuple[float, str], ...]
    dates: tuple[tuple[float, str], ...]
    week: float
    floor: float
    looks: frozenset[str]
    unit: str


def strip(results: Results, recent: Lately, rows: dict[dt.date, int]) -> Strip | None:
    """Lay out the last week and the eight before it.

    Parameters
    ----------
    results : Results
        All of OUT.
    recent : Lately
        Of :func:`rivid.report.lately.lately`.
    rows : dict
        The row of the table of days that a day has, where it has one.

    Returns
    -------
    Strip or None
        None where these weeks have fewer than two days with a value.
    """
    e, T_s = recent.estimator, results.sample_time
    ago = weeks_ago(e.dates)
    shown = ago <= WEEKS
    given = np.isfinite(recent.values)
    values = recent.values[shown & given]
    if values.size < 2:
        return None
    low, high = _limits(values)
    floor = HEIGHT - BOTTOM
    first = max(e.dates[-1] - dt.timedelta(days=WEEK * (WEEKS + 1) - 1), e.dates[0])
    step = (WIDTH - LEFT - RIGHT) / ((e.dates[-1] - first).days + 1)

    def x(date: dt.date) -> float:
        return round(LEFT + ((date - first).days + 0.5) * step, 1)

    def y(value: float) -> float:
        return round(TOP + (high - value) / (high - low) * (floor - TOP), 1)

    looks = _looks(recent)
    marks = []
    for i in np.flatnonzero(shown):
        date, value = e.dates[i], float(recent.values[i])
        told, at = e.status[i], floor + 7
        if np.isfinite(value):
            told, at = _told(recent, int(i), T_s), y(value)
        marks.append(Mark(x(date), at, looks[i], f"{date}: {told}", rows.get(date)))
    medians = []
    for w in range(WEEKS + 1):
        days = np.flatnonzero((ago == w) & given)
        if days.size >= FEWEST_DAYS:
            begin = max(first, e.dates[-1] - dt.timedelta(days=WEEK * (w + 1) - 1))
            end = e.dates[-1] - dt.timedelta(days=WEEK * w)
            ends = x(begin) - step / 2, x(end) + step / 2
            medians.append((round(ends[0], 1), round(ends[1], 1), y(float(np.median(recent.values[days])))))
    unit, seconds = time_unit(high * T_s)
    scale = T_s / seconds
    late = 0.0 if recent.passage or recent.travel else 0.5  # d is a time from d to d + 1: its middle
    begins = [e.dates[-1] - dt.timedelta(days=WEEK * (w + 1) - 1) for w in range(WEEKS, -1, -1)]
    return Strip(
        marks=tuple(marks),
        medians=tuple(medians),
        lags=tuple((y(lag), text) for lag, text in ticks(low, high)),
        times=tuple(
            (y(t / scale - late), text) for t, text in ticks((low + late) * scale, (high + late) * scale)
        ),
        dates=tuple((x(date), f"{date:%m-%d}") for date in begins if date >= first)
        or ((x(first), f"{first:%m-%d}"),),
        week=round(x(max(first, recent.first)) - step / 2, 1),
        floor=floor,
        looks=frozenset(mark.look for mark in marks),
        unit=unit,
    )


def _told(recent: Lately, i: int, sample_time: float) -> str:
    """The value of a day."""
    value, d = float(recent.values[i]), float(recent.estimator.delay[i])
    if recent.passage:
        return minutes_first(value, sample_time)
    if recent.travel:
        return f"{duration([value * sample_time])} (delay d = {samples([d])})"
    return travel_first([d], sample_time)


def _limits(values: Floats) -> tuple[float, float]:
    """Ends of the delays shown [samples], with some air."""
    low, high = float(values.min()), float(values.max())
    short = max(LEAST - (high - low) - 1, 0.0) / 2
    return max(low - 0.5 - short, 0.0), high + 0.5 + short


def _looks(recent: Lately) -> list[str]:
    """The class of each day's mark."""
    looks = np.where(np.isfinite(recent.values), "sure", "none").astype(object)
    if not recent.passage:
        for kind, days in kinds(recent.estimator).items():
            looks[days] = LOOKS[kind]
    return [str(look) for look in looks]


def ticks(low: float, high: float, most: int = 6) -> list[tuple[float, str]]:
    """Round numbers inside a range, at most so many, each as a text.

    Examples
    --------
    >>> [text for _, text in ticks(4.5, 9.5)], [text for _, text in ticks(3.1, 4.1)]
    (['5', '6', '7', '8', '9'], ['3.2', '3.4', '3.6', '3.8', '4.0'])
    """
    power, size = next(
        (power, size)
        for power in range(-3, 9)
        for size in (1, 2, 5)
        if (high - low) / (size * 10.0**power) <= most
    )
    step = size * 10.0**power
    found = (k * step for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1))
    return [(value, f"{value:.{max(-power, 0)}f}") for value in found]


def svg(drawn: Strip, words: str, rows: int) -> "Markup":
    """The drawing as an element of the page.

    Parameters
    ----------
    drawn : Strip
    words : str
        What it shows.
    rows : int
        Rows of the table of days that the page has; a mark leads to its own, where it is among them.
    """
    from markupsafe import Markup, escape

    end, floor, week = WIDTH - RIGHT, drawn.floor, drawn.week
    axis = ['<text class="unit" x="0" y="9">samples</text>']
    parts = [
        f'<rect class="week" x="{week}" y="{TOP}" width="{end - week:.1f}" height="{floor - TOP}"/>',
        f'<path class="floor" d="M{LEFT} {floor}H{end}"/>',
        f'<text class="unit" x="{WIDTH}" y="9" text-anchor="end">{drawn.unit}</text>',
    ]
    for y, text in drawn.lags:
        parts.append(f'<path class="grid" d="M{LEFT} {y}H{end}"/>')
        axis.append(f'<text x="{LEFT - 7}" y="{y + 4:.1f}" text-anchor="end">{text}</text>')
    for y, text in drawn.times:
        parts.append(f'<text class="unit" x="{end + 7}" y="{y + 4:.1f}">{text}</text>')
    for x, text in drawn.dates:
        parts.append(f'<text x="{x}" y="{floor + 28}" text-anchor="middle">{text}</text>')
    for begin, to, y in drawn.medians:
        parts.append(f'<path class="median" d="M{begin} {y}H{to}"/>')
    for mark in drawn.marks:
        shape = f"<g><title>{escape(mark.words)}</title>{shown(mark.x, mark.y, mark.look)}</g>"
        leads = mark.row is not None and mark.row < rows
        parts.append(f'<a href="#look-{mark.row}">{shape}</a>' if leads else shape)
    head = f'<svg class="axis" viewBox="0 0 {LEFT:g} {HEIGHT:g}" aria-hidden="true">'
    body = f'<svg viewBox="{LEFT:g} 0 {WIDTH - LEFT:g} {HEIGHT:g}" role="img" aria-label="{escape(words)}">'
    return Markup("\n".join(["<div>", head, *axis, "</svg>", body, *parts, "</svg>", "</div>"]))


def sign(look: str) -> "Markup":
    """A mark, or the line of a median, by itself: for the legend."""
    from markupsafe import Markup

    shape = '<path class="median" d="M0 5h10"/>' if look == "median" else shown(5, 5, look)
    return Markup(f'<svg viewBox="0 0 10 10" aria-hidden="true">{shape}</svg>')


def shown(x: float, y: float, look: str) -> str:
    """A mark: a disc, or a cross for a day without an answer."""
    if look == "none":
        return f'<path class="none" transform="translate({x} {y})" d="M-3-3l6 6m0-6l-6 6"/>'
    return f'<circle class="{look}" cx="{x}" cy="{y}" r="3.4"/>'
