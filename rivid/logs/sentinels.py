"""Numbers that loggers write where nothing was measured, and whether a day's values hold one."""

import datetime as dt

import numpy as np

from rivid.logs.columns import Columns, Micros
from rivid.logs.spec import MICRO, Spec
from rivid.logs.times import day_bounds, local
from rivid.types import Floats

PLAIN = (
    *(-999.0, -999.9, -999.99, -999.999, -9999.0, -9999.9, -9999.99, -99999.0, -999999.0),
    *(-7777.0, -7999.0, -8888.0, -6999.0, -32767.0, -32768.0, 6999.0, 7999.0, 9999.0, 9999.9, 9999.99),
    *(32767.0, 65535.0, 99999.0, 99999.9, 99999.99, 999999.0),
)
"""Nobody sets a flow or builds a dam to these."""
ROUND = (-99.0, -99.9, -99.99, -777.0, -1000.0)
"""A pump may be set to these: they must lie farther off, and among values that are all above zero."""
SENTINELS = (*PLAIN, *ROUND)
NEAR = 0.1
"""What is off by less than the range of the values and this part of the largest may be one of them."""
FARTHER = 2.0
_NEGATIVE = frozenset(s for s in SENTINELS if s < 0)
_POSITIVE = frozenset(s for s in SENTINELS if s > 0)
_HOUR = 3600 * MICRO
_LONGEST_DAY = 26 * _HOUR


def may_hold(values: Floats) -> bool:
    """Whether sentinels may be among the values: quick, as every column of every log is asked.

    A sentinel far from all other values is the least or the greatest of them.
    """
    return float(np.fmin.reduce(values)) in _NEGATIVE or float(np.fmax.reduce(values)) in _POSITIVE


def sentinels_in(values: Floats) -> list[float]:
    """Well-known sentinels among the values of a column that lie far from all the others.

    Parameters
    ----------
    values : ndarray, (n,)
        Of one day, in the log's unit; NaN where nothing is there.

    Returns
    -------
    list of float
        Ascending.
    """
    known = np.isin(values, SENTINELS)
    if not known.any():
        return []
    others = values[~known & np.isfinite(values)]
    return [s for s in np.unique(values[known]).tolist() if _is_far(s, others)]


def _is_far(sentinel: float, others: Floats) -> bool:
    if not len(others):
        return sentinel in PLAIN
    low, high = float(others.min()), float(others.max())
    span = high - low + NEAR * max(abs(low), abs(high))
    off = max(low - sentinel, sentinel - high)
    if sentinel in ROUND:
        return low > 0 and off > FARTHER * span
    return off > span or (low >= 0 > sentinel)


def undeclared(columns: Columns, times: Micros, spec: Spec, zone: dt.tzinfo) -> list[tuple[int, str, bool]]:
    """Days with numbers that can only mean "not measured", and how to declare them.

    Parameters
    ----------
    columns : Columns
    times : ndarray, (n,)
        Of its rows [us UTC].
    spec : Spec
    zone : tzinfo
        Of the local days.

    Returns
    -------
    list of (int, str, bool)
        The first row of each, what to say, and False: it is no torn end.
    """
    many_days = int(times.max()) - int(times.min()) > _LONGEST_DAY
    found = []
    for source in spec.sources:
        if source not in columns.numbers:
            continue  # it stands in another file
        values = columns.numbers[source]
        if not many_days and not may_hold(values):
            continue
        there = ~np.isin(values, spec.sentinels)
        suspects = there & np.isin(values, SENTINELS)
        hours = np.unique(times[suspects] // _HOUR) * _HOUR
        for date in sorted({local(int(hour), zone).date() for hour in hours}):
            start, end = day_bounds(date, zone)
            rows = np.flatnonzero(there & (times >= start) & (times < end))
            known = sentinels_in(values[rows])
            found += [(source, rows, sentinel) for sentinel in known if sentinel not in spec.not_sentinels]
    declare = ", ".join(f"{s:.10g}" for s in dict.fromkeys([*spec.sentinels, *(s for *_, s in found)]))
    told = []
    for source, rows, sentinel in found:
        values = columns.numbers[source][rows]
        at = rows[values == sentinel]
        others = values[np.isfinite(values) & ~np.isin(values, SENTINELS)]
        count = f" {len(at)} times" if len(at) > 1 else ""
        apart = f", far from the day's {others.min():g} to {others.max():g}" if len(others) else ""
        text = (
            f"{columns.place(int(at[0]))}: column {source!r} holds {sentinel:.10g}{count}{apart}: if that "
            f'means "not measured", set [input] sentinels = [{declare}]; if it is measured, not_sentinels'
        )
        told.append((int(at[0]), text, False))
    return told
