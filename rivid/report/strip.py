"""The last weeks day by day, as the numbers of a drawing that the page holds itself: sharp at any size.

The template draws it; colours are classes, with rules in base.css.
"""

import datetime as dt
from typing import Any

import numpy as np

from rivid.report.summary import FEWEST_DAYS, WEEK, WEEKS, LastWeek, weeks_ago
from rivid.results.read import kinds
from rivid.text import time_unit

WIDTH, HEIGHT = 720.0, 216.0
LEFT, RIGHT, TOP, BOTTOM = 46.0, 46.0, 20.0, 40.0  # the margins, in units of which text is 11 high
FRAME = {"left": LEFT, "right": WIDTH - RIGHT, "top": TOP, "width": WIDTH, "height": HEIGHT}  # edges
LEAST = 4.0  # smallest span of the delays shown [samples]: a calm record looks calm
LOOKS = {"data decide": "sure", "data do not decide": "prior", "degenerate": "doubt", "at a bound": "doubt"}
"""Class of the mark of a day by the class of its delay."""


def strip(recent: LastWeek, sample_time: float, rows: dict[dt.date, int]) -> dict[str, Any] | None:
    """Lay out the last week and the eight before it; `rows` gives the row of a day in the table of days.

    None where these weeks have fewer than two days with a value.
    """
    e = recent.estimator
    ago = weeks_ago(e.dates)
    shown, given = ago <= WEEKS, np.isfinite(recent.values)
    values = recent.values[shown & given]
    if values.size < 2:
        return None
    low, high = float(values.min()), float(values.max())
    short = max(LEAST - (high - low) - 1, 0.0) / 2
    low, high = max(low - 0.5 - short, 0.0), high + 0.5 + short  # with some air
    floor = HEIGHT - BOTTOM
    first = max(e.dates[-1] - dt.timedelta(days=WEEK * (WEEKS + 1) - 1), e.dates[0])
    step = (WIDTH - LEFT - RIGHT) / ((e.dates[-1] - first).days + 1)

    def x(date: dt.date) -> float:
        return round(LEFT + ((date - first).days + 0.5) * step, 1)

    def y(value: float) -> float:
        return round(TOP + (high - value) / (high - low) * (floor - TOP), 1)

    looks, marks = np.where(np.isfinite(recent.values), "sure", "none").astype(object), []
    for kind, alike in kinds(e).items() if recent.quantity != "t50" else ():
        looks[alike] = LOOKS[kind]
    for i in np.flatnonzero(shown):
        date, value = e.dates[i], float(recent.values[i])
        at = y(value) if np.isfinite(value) else floor + 7
        marks.append({
            "x": x(date), "y": at, "look": looks[i], "date": date, "value": value,
            "delay": float(e.delay[i]), "status": e.status[i], "row": rows.get(date),
        })  # fmt: skip
    begins = [e.dates[-1] - dt.timedelta(days=WEEK * (w + 1) - 1) for w in range(WEEKS, -1, -1)]
    medians = []
    for w, begin in zip(range(WEEKS, -1, -1), begins, strict=True):
        days = np.flatnonzero((ago == w) & given)
        if days.size >= FEWEST_DAYS:
            ends = x(max(first, begin)) - step / 2, x(begin + dt.timedelta(days=WEEK - 1)) + step / 2
            medians.append((round(ends[0], 1), round(ends[1], 1), y(float(np.median(recent.values[days])))))
    unit, seconds = time_unit(high * sample_time)
    scale = sample_time / seconds
    late = 0.5 if recent.quantity == "delay" else 0.0  # d is a time from d to d + 1: its middle
    times = ticks((low + late) * scale, (high + late) * scale)
    return {
        "marks": marks,
        "medians": medians,  # x of both ends and y, of each week
        "lags": [(y(lag), text) for lag, text in ticks(low, high)],  # samples, on the left
        "times": [(y(time / scale - late), text) for time, text in times],  # in `unit`, on the right
        "unit": unit,
        "dates": [(x(date), f"{date:%m-%d}") for date in begins if date >= first]
        or [(x(first), f"{first:%m-%d}")],
        "week": round(x(max(first, recent.first)) - step / 2, 1),  # x where the last week begins
        "floor": floor,  # y below which days without an answer are marked
    }


def ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Return round numbers inside a range of at most six steps, each with its text."""
    power, size = next(
        (power, size)
        for power in range(-3, 9)
        for size in (1, 2, 5)
        if (high - low) / (size * 10.0**power) <= 6
    )
    step = size * 10.0**power
    found = (k * step for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1))
    return [(value, f"{value:.{max(-power, 0)}f}") for value in found]
