"""Times: texts to microseconds of UTC, local days, and the two nights a year when clocks change."""

import datetime as dt
import re
from collections.abc import Iterable
from functools import lru_cache
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from rivid.logs.spec import MICRO
from rivid.types import Ints

EPOCH = dt.datetime(1970, 1, 1)
FIRST, LAST = (int((dt.datetime(y, 1, 1) - EPOCH).total_seconds()) * MICRO for y in (1850, 2200))
"""Times beyond these are damage, not history [us]."""
_QUARTER = 900 * MICRO
_DAY = 86_400 * MICRO
_MICROSECOND = dt.timedelta(microseconds=1)
_HOUR_24 = re.compile(r"(?<![\d:])24(:?00(?::?00(?:[.,]0+)?)?)(?![\d:])")
UNIX = {"unix": MICRO, "unix_ms": 1000}
"""Time formats that count seconds or milliseconds of UTC since 1970, as [us]."""


LAST_ZONE = dt.timezone(dt.timedelta(hours=-12))
"""Where a day ends last: what is not yet over there may not be over at a clock of unknown zone."""


def zone_named(name: str) -> dt.tzinfo:
    """The zone of `[input] time_zone`."""
    return ZoneInfo(name)


def fixed_zone(offset: int) -> dt.tzinfo:
    """The zone of an offset [s], the same all year."""
    return dt.timezone(dt.timedelta(seconds=offset))


@lru_cache(maxsize=4096)
def day_bounds(date: dt.date, zone: dt.tzinfo) -> tuple[int, int]:
    """First instant of a local day and of the next one [us UTC]; 23 or 25 h apart when clocks change."""
    return _midnight(date, zone), _midnight(date + dt.timedelta(days=1), zone)


def _midnight(date: dt.date, zone: dt.tzinfo) -> int:
    midnight = dt.datetime(date.year, date.month, date.day, tzinfo=zone)
    return round(midnight.timestamp()) * MICRO


def local(time: int, zone: dt.tzinfo) -> dt.datetime:
    """A time [us UTC] on the local clock."""
    return dt.datetime.fromtimestamp(time // MICRO, zone)


def clock(time: int, zone: dt.tzinfo, with_date: bool = False) -> str:
    """A local time for messages: 13:05, or with its date."""
    moment = local(time, zone)
    text = f"{moment:%H:%M:%S}" if moment.second else f"{moment:%H:%M}"
    return f"{moment.date()} {text}" if with_date else text


def to_utc(naive: Ints, zone: dt.tzinfo, ambiguous: str) -> tuple[Ints, list[tuple[int, str]]]:
    """UTC (n,) [us] of local times (n,) [us since 1970 on that clock], and the refused rows with reasons.

    `ambiguous` states which turn of the hour that occurs twice is meant: "error", "first", "second", or
    "order": the second turn begins where the log steps back.
    """
    day = naive // _DAY
    days = np.unique(day)
    edges = np.array([[_offset(int(d) * _DAY, zone), _offset(int(d + 1) * _DAY, zone)] for d in days])
    row = np.searchsorted(days, day)
    utc: Ints = naive - edges[row, 0]
    refused: list[tuple[int, str]] = []
    for d in days[edges[:, 0] != edges[:, 1]]:
        rows = np.flatnonzero(day == d)
        _change_clocks(naive, utc, rows, zone, ambiguous, refused)
    return utc, refused


def _change_clocks(
    naive: Ints,
    utc: Ints,
    rows: NDArray[np.intp],
    zone: dt.tzinfo,
    ambiguous: str,
    refused: list[tuple[int, str]],
) -> None:
    """The rows of a day on which clocks change; offsets change at quarters of an hour only."""
    quarter = naive[rows] // _QUARTER
    quarters = np.unique(quarter)
    offsets = {
        int(q): (_offset(int(q) * _QUARTER, zone), _offset(int(q) * _QUARTER, zone, 1)) for q in quarters
    }
    second_turn, before = ambiguous == "second", None
    for i, q in zip(rows, quarter, strict=True):
        first, second = offsets[int(q)]
        if first < second:
            moment = EPOCH + int(naive[i]) * _MICROSECOND
            refused.append((int(i), f"{moment} does not exist in {zone} (clocks go forward)"))
        elif first > second:
            if ambiguous == "error":
                moment = EPOCH + int(naive[i]) * _MICROSECOND
                advice = 'log offsets, or set [input] ambiguous = "first", "second" or "order"'
                refused.append((int(i), f"{moment} occurs twice in {zone} (clocks go back): {advice}"))
            elif ambiguous == "order":
                second_turn = second_turn or (before is not None and naive[i] < before)
                before = int(naive[i])
        utc[i] = naive[i] - (second if first > second and second_turn else first)


def _offset(naive: int, zone: dt.tzinfo, fold: int = 0) -> int:
    """UTC offset of a local time [us]."""
    moment = (EPOCH + naive * _MICROSECOND).replace(tzinfo=zone, fold=fold)
    offset = moment.utcoffset()
    assert offset is not None
    return round(offset.total_seconds()) * MICRO


def clock_turns_back(texts: Iterable[str], time_format: str | None, time_zone: str) -> bool:
    """Whether times of a local clock go through an hour twice, as that zone's do when summer ends."""
    moments = [time for text in texts if (time := read_text(text, time_format)) and time[1] is None]
    naive = np.array([time for time, _ in moments], np.int64)
    if not len(naive) or not to_utc(naive, zone_named(time_zone), "error")[1]:
        return False
    utc, refused = to_utc(naive, zone_named(time_zone), "order")
    return not refused and bool((np.diff(utc) > 0).all()) and bool((np.diff(naive) < 0).any())


def read_text(text: str, time_format: str | None) -> tuple[int, int | None] | None:
    """A time's text as (microseconds, offset [s]); None where it is no such time or in a year of no log.

    With an offset the time is [us UTC], without (None) [us] on the local clock. `time_format` is that of
    strptime, None for ISO 8601, "unix" or "unix_ms" for UTC. Hour 24:00 is the next day's 00:00.
    """
    text = text.strip()
    if time_format in UNIX:
        try:
            time = round(float(text) * UNIX[time_format])
        except (ValueError, OverflowError):
            return None
        return (time, 0) if FIRST <= time < LAST else None
    moment, extra = _moment(text, time_format), 0
    if moment is None and (match := _HOUR_24.search(text)):
        moment, extra = _moment(text[: match.start()] + "00" + text[match.start() + 2 :], time_format), 1
    if moment is None:
        return None
    offset = moment.utcoffset()
    time = (moment.replace(tzinfo=None) - EPOCH) // _MICROSECOND + extra * _DAY
    if not FIRST <= time < LAST:
        return None
    if offset is None:
        return time, None
    seconds = round(offset.total_seconds())
    return time - seconds * MICRO, seconds


def _moment(text: str, time_format: str | None) -> dt.datetime | None:
    try:
        if time_format is None:
            return dt.datetime.fromisoformat(text)
        return dt.datetime.strptime(text, time_format)
    except ValueError:
        return None
