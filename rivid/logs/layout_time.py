"""How the times of a foreign table are written, and in which columns."""

import re
from dataclasses import dataclass

from rivid.logs.layout import Layout
from rivid.logs.times import read_text

_DATES = (
    "%d/%m/%Y",
    "%m/%d/%Y",
    "%d.%m.%Y",
    "%d-%m-%Y",
    "%m-%d-%Y",
    "%Y/%m/%d",
    "%d/%m/%y",
    "%m/%d/%y",
    "%d.%m.%y",
)
_CLOCKS = ("%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p", "%H:%M:%S.%f")
FORMATS: tuple[str | None, ...] = (
    None,
    *(f"{date} {clock}" for date in _DATES for clock in _CLOCKS),
    *("%Y%m%d%H%M%S", "%Y%m%d%H%M", "%Y%m%d %H%M", "%Y-%m-%d %I:%M:%S %p"),
)
"""Formats that are tried; None is ISO 8601."""

_CLOCK = re.compile(r"\d{1,2}:\d\d(:\d\d(\.\d+)?)?( ?[AaPp][Mm])?")
LONGEST_JUMP = 20 * 86_400 * 1_000_000


@dataclass(frozen=True)
class TimeLayout:
    """Which columns hold the time, and in which format.

    Attributes
    ----------
    columns : tuple of int
        One, or two: date and clock.
    time_format : str or None
        None is ISO 8601.
    zoned : bool
        Whether the times carry UTC offsets.
    doubt : str
        What could not be decided; empty where nothing is left open.
    steps : list of int
        Between rows [us].
    others : tuple of str
        Formats that mean other times and fit as well; then `time_format` is not decided.
    """

    columns: tuple[int, ...]
    time_format: str | None
    zoned: bool
    doubt: str
    steps: list[int]
    others: tuple[str, ...] = ()


def guess_time(layout: Layout) -> TimeLayout | None:
    """Find the time's columns and format; None where no column reads as times."""
    rows = layout.rows
    for at in range(len(layout.names)):
        texts = [row[at] for row in rows]
        clock = at + 1
        if clock < len(layout.names) and all(_CLOCK.fullmatch(row[clock]) for row in rows[:50]):
            both = [f"{row[at]} {row[clock]}" for row in rows]
            if found := _guess_format(both, (at, clock)):
                return found
        if found := _guess_format(texts, (at,)):
            return found
    for at, name in enumerate(layout.names):
        if re.search(r"unix|epoch|timestamp", name, re.I):
            for time_format, least in (("unix_ms", 1e11), ("unix", 1e8)):
                if all(_number(row[at]) >= least for row in rows):
                    times = [read_text(row[at], time_format) for row in rows]
                    return TimeLayout((at,), time_format, True, "", _steps([t[0] for t in times if t]))
    return None


def _guess_format(texts: list[str], columns: tuple[int, ...]) -> TimeLayout | None:
    fits: list[tuple[str | None, list[tuple[int, int | None]]]] = []
    few = texts[:: max(len(texts) // 40, 1)]
    for time_format in FORMATS:
        if sum(read_text(text, time_format) is not None for text in few) < 0.9 * len(few):
            continue
        times = [time for text in texts if (time := read_text(text, time_format)) is not None]
        if len(times) >= 0.95 * len(texts):
            fits.append((time_format, times))
    if not fits:
        return None
    best = max(len(times) for _, times in fits)
    fits = [fit for fit in fits if len(fit[1]) == best]
    doubt, others = "", []
    if len(fits) > 1 and fits[0][0] is not None:
        smooth = [
            fit for fit in fits if max(map(abs, _steps([t for t, _ in fit[1]])), default=0) < LONGEST_JUMP
        ]
        if len(smooth) == 1:
            fits = smooth
        elif len({tuple(t for t, _ in fit[1]) for fit in fits}) > 1:
            others = [fit[0] for fit in fits[1:] if fit[0]]
            doubt = f"{texts[0]!r} also reads as {', '.join(map(repr, others))}: day or month first?"
    time_format, times = fits[0]
    zoned = all(offset is not None for _, offset in times)
    return TimeLayout(columns, time_format, zoned, doubt, _steps([time for time, _ in times]), tuple(others))


def _steps(times: list[int]) -> list[int]:
    return [b - a for a, b in zip(times, times[1:], strict=False)]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0
