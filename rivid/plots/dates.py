"""The days of a record as an x axis: readable ticks for a day or decades, a strip of days without answer.

A day is the unit interval around its ordinal number, so a missing day keeps its width.
"""

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.ticker import FixedFormatter, FixedLocator, NullFormatter

from rivid.plots import style
from rivid.results.selection import day_numbers
from rivid.text import NO_ANSWER

STATUS_COLOURS = {"failed": style.ACCENT, "unidentifiable": style.INK, "pending": style.LIGHT}

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
"""Not strftime: a locale must not change the figures."""

_STRIP = 0.11
_STRIP_GAP = 0.05


@dataclass(frozen=True)
class Ticks:
    """Where an axis of dates has its lines and its labels (day numbers)."""

    lines: list[float]
    places: list[float]
    labels: list[str]


def date_ticks(first: dt.date, last: dt.date) -> Ticks:
    """Ticks for the days from `first` to `last`, about ten to twenty of them.

    Up to 80 days the label stands under its day; beyond, months or years lie between lines. The year stands
    once under its first label.

    Examples
    --------
    >>> date_ticks(dt.date(2008, 3, 14), dt.date(2008, 3, 14)).labels
    ['14 Mar\\n2008']
    """
    span = (last - first).days + 1
    if span <= 80:
        step = next(s for s in (1, 2, 7, 14) if span <= 14 * s)
        days = [first + dt.timedelta(days=k) for k in range(0, span, step)]
        at = [float(day.toordinal()) for day in days]
        return Ticks(at, at, _with_year(days, [f"{day.day} {MONTHS[day.month - 1]}" for day in days]))
    if span <= 900:
        starts = _month_starts(first, last, 1)
        return _between(starts, first, last, lambda day: MONTHS[day.month - 1], years=True)
    if span <= 5500:
        return _between(_month_starts(first, last, 12), first, last, lambda day: str(day.year), years=False)
    every = -(-span // 5500)
    starts = [day for day in _month_starts(first, last, 12) if day.year % every == 0 and first <= day <= last]
    at = [day.toordinal() - 0.5 for day in starts]
    return Ticks(at, at, [str(day.year) for day in starts])


def _month_starts(first: dt.date, last: dt.date, step: int) -> list[dt.date]:
    """First days of the months (or, for step 12, of the years) that touch the record, and the one after."""
    months = range(first.year * 12 + (first.month - 1 if step < 12 else 0), (last.year + 1) * 12 + 13, step)
    starts = [dt.date(m // 12, m % 12 + 1, 1) for m in months if m // 12 <= dt.MAXYEAR]
    after = next(i for i, day in enumerate(starts) if day > last)
    return starts[: after + 1]


def _between(
    starts: list[dt.date], first: dt.date, last: dt.date, name: Callable[[dt.date], str], *, years: bool
) -> Ticks:
    low, high = first.toordinal() - 0.5, last.toordinal() + 0.5
    lines = [at for day in starts if low <= (at := day.toordinal() - 0.5) <= high]
    days, places = [], []
    for day, after in zip(starts, starts[1:], strict=False):
        a, b = max(day.toordinal() - 0.5, low), min(after.toordinal() - 0.5, high)
        if b - a >= 0.028 * (high - low):  # a sliver of a month has no room for its name
            days.append(day)
            places.append((a + b) / 2)
    labels = [name(day) for day in days]
    return Ticks(lines, places, _with_year(days, labels) if years else labels)


def _with_year(days: Sequence[dt.date], labels: Sequence[str]) -> list[str]:
    seen: set[int] = set()
    named = []
    for day, label in zip(days, labels, strict=True):
        named.append(label if day.year in seen else f"{label}\n{day.year}")
        seen.add(day.year)
    return named


def date_axis(axes: Axes, first: dt.date, last: dt.date) -> None:
    """Give `axes` the days from `first` to `last` as its x axis."""
    ticks = date_ticks(first, last)
    axes.set_xlim(first.toordinal() - 0.5, last.toordinal() + 0.5)
    axis = axes.xaxis
    axis.remove_overlapping_locs = False  # a day's label stands at its line
    axis.set_major_locator(FixedLocator(ticks.lines))
    axis.set_major_formatter(NullFormatter())
    axis.set_minor_locator(FixedLocator(ticks.places))
    axis.set_minor_formatter(FixedFormatter(ticks.labels))
    axes.tick_params(axis="x", which="major", length=4, width=0.7)
    axes.tick_params(axis="x", which="minor", length=0, pad=6)


def calendar(page: style.Sheet, dates: Sequence[dt.date], status: Sequence[str]) -> None:
    """Date axis of a page and, where days have no answer, a strip under the panel that marks them.

    The strip's legend, with the number of days per status, stands below it on the right.
    """
    first, last = dates[0], dates[-1]
    axes = page.axes
    found = [name for name in NO_ANSWER if name in status]
    if not found:
        date_axis(axes, first, last)
        return
    box = axes.get_position()
    inch = box.height / page.height
    lift = (_STRIP + _STRIP_GAP) * inch
    axes.set_position((box.x0, box.y0 + lift, box.width, box.height - lift))
    axes.set_xlim(first.toordinal() - 0.5, last.toordinal() + 0.5)
    style.no_ticks(axes)
    strip = page.figure.add_axes((box.x0, box.y0, box.width, _STRIP * inch))
    strip.set_ylim(0, 1)
    strip.yaxis.set_major_locator(FixedLocator([]))
    for side in ("top", "left", "right"):
        strip.spines[side].set_visible(False)
    date_axis(strip, first, last)
    days = (last - first).days + 1
    thick = min(max(72 * page.width / days, 1.4), 40.0)  # points; a day never thinner than can be seen
    entries = []
    x = day_numbers(dates)
    for name in reversed(found):
        at = x[[s == name for s in status]]
        strip.vlines(at, 0, 1, colors=STATUS_COLOURS[name], linewidths=thick)
        entries.append(
            style.dot(f"{name} ({len(at):,})", marker="s", color=STATUS_COLOURS[name], markersize=5)
        )
    page.figure.legend(
        handles=[style.dot("days without an answer:", marker=""), *entries[::-1]],
        loc="lower right",
        bbox_to_anchor=(box.x1, 0.09 * inch),
        ncols=len(entries) + 1,
    )
