"""Which days agree in what they say, and whose clock it is that lags speak of."""

import datetime as dt

import numpy as np

from rivid.check.record import Record
from rivid.types import Floats

ALIKE = 15 * 60.0
"""Lags that differ by less are the same [s]."""
FEW = {"pool": 3, "river": 7}
"""Days in a row that must agree, where there are so many: the delay of a river changes by itself."""
DENSE = 0.6
"""Share of the days between the first and the last of a row that must agree."""
MOST_PAIRED = 300
"""Days of which every pair is looked at."""


def in_rows(record: Record, dates: list[dt.date], among: list[dt.date], whole: bool = False) -> list[dt.date]:
    """Those of the dates that stand in rows among others (`whole`: what lies between too); one is weather."""
    order = {date: k for k, date in enumerate(among)}
    least = min(FEW[record.reach.kind], len(among))
    rows: list[list[dt.date]] = []
    for date in dates:
        if rows and order[date] - order[rows[-1][-1]] <= 2:
            rows[-1].append(date)
        else:
            rows.append([date])
    dense = [r for r in rows if len(r) >= max(DENSE * (order[r[-1]] - order[r[0]] + 1), least)]
    if whole:
        return [date for row in dense for date in among[order[row[0]] : order[row[-1]] + 1]]
    return [date for row in dense for date in row]


def whose(record: Record, by_in: float, by_out: float) -> tuple[str, float]:
    """Whose clock is off, and by how much: positive where its stamps are late; "" where it is no one's."""
    if not record.balanced:
        return ("u_Qi", -by_in) if by_in else ("", 0.0)
    if abs(by_in - by_out) <= ALIKE:
        return record.output, 0.5 * (by_in + by_out)
    if abs(by_out) <= ALIKE:
        return "u_Qi", -by_in
    if abs(by_in) <= ALIKE:
        return "u_Qo", -by_out
    return "", 0.0


def slope_of(x: Floats, y: Floats) -> float:
    """The median of the slopes of all pairs (Theil and Sen)."""
    thin = slice(None, None, max(1, len(x) // MOST_PAIRED))
    apart, rises = x[thin][:, None] - x[thin], y[thin][:, None] - y[thin]
    ahead = apart > 0
    return float(np.median(rises[ahead] / apart[ahead])) if ahead.any() else 0.0
