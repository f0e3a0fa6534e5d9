"""Clocks: a column that is shifted against the others by an hour or a day, or drifts; exchanged columns."""

import datetime as dt
from collections import defaultdict
from itertools import compress, takewhile

import numpy as np

from rivid.check.findings import Finding
from rivid.check.record import BELIEVED, NEAR, Fit, Fits, Record, consecutive
from rivid.types import Floats

# Smallest shifts that are reported
# smallest clock offset [s]; smaller ones are within operator reaction and wave travel time
SMALLEST = {"pool": 30 * 60.0, "river": 50 * 60.0}
# smallest drift over the record [s]; the delay of a river changes by itself
DRIFT = {"pool": 20 * 60.0, "river": 90 * 60.0}
AT_THE_GATE = 50 * 60.0  # longest time in which the level answers the outflow [s]: the gauge is at the gate
GAIN = 0.12  # smallest increase of the explained share by a day's own lags instead of the usual ones
# smallest increase of the explained share by exchanged columns: of all days together, of one day
REVERSED, REVERSED_DAY = 0.15, 0.25
WELL = 0.6  # explained share from which on a day has its right date
# smallest increase of the explained share by another day's flows: of all such days together, of each
OTHER_DAY, OTHER_DAY_EACH = 0.2, 0.12

# Agreement between days
ALIKE = 15 * 60.0  # lags that differ by less agree [s]
# consecutive days that must agree: weather changes a single day, and a river's delay for some
FEW = {"pool": 3, "river": 7}
DENSE = 0.6  # share of the days between the first and the last of a group that must agree
ENOUGH = 0.4  # smallest share of days with a believed fit
# weight of lags that water can have against lags that it cannot have, in the choice of the usual ones
POSSIBLE = 10
UNUSUAL = 1.6  # largest logarithm of the flow over the median at which a river's delays are compared
STRAIGHT = 4.0  # smallest ratio of a drift to the scatter of the lags about its line
FEWEST = 6  # fewest days that a drift is estimated from
MOST_PAIRED = 300  # most days of which all pairs are compared

SHIFTS = {
    (-1, 0): ("u_Qi", "early"),
    (1, 0): ("u_Qi", "late"),
    (0, -1): ("u_Qo", "early"),
    (0, 1): ("u_Qo", "late"),
    (-1, -1): ("", "late"),
    (1, 1): ("", "early"),
}
"""The misdated column ("" is the output), and how, by the days that inflow and outflow are taken from."""


def clocks(record: Record, fits: Fits) -> list[Finding]:
    """Return the findings that the lags between the columns give."""
    if not fits.right:
        return []
    if swapped := _swapped(record, fits.together, []):
        return swapped
    found = _dates(record, fits)
    others = {date for date in fits.right if not any(date in finding.days for finding in found)}
    if 2 * len(others) < len(fits.right):
        return found
    odd = [
        date
        for date in others
        if fits.reverse[date].explained >= max(BELIEVED, fits.right[date].explained + REVERSED_DAY)
    ]
    if record.balanced and (days := _in_rows(record, sorted(odd), list(fits.right), whole=True)):
        found += _swapped(record, fits.of(days), days)
    believed = {date: fit for date, fit in _believed(record, fits).items() if date in others}
    usual = _usual(believed, fits.longest)
    if usual is None or len(believed) < ENOUGH * len(others):
        return found
    if drifting := _drift(record, believed):
        return [*found, *drifting]
    return [*found, *_shifted(record, fits, believed, usual), *_always(record, fits, usual)]


def _believed(record: Record, fits: Fits) -> dict[dt.date, Fit]:
    """Return the believed fits; for a river, without the lag's dependence on the flow."""
    believed = {date: fit for date, fit in fits.right.items() if fit.explained >= BELIEVED}
    if record.reach.kind == "pool" or len(believed) < 2 * FEW["river"]:
        return believed
    flow = np.log([max(float(record.days[date]["u_Qi"].mean()), 1e-3) for date in believed])
    flow -= np.median(flow)
    usual = np.abs(flow) <= UNUSUAL  # beyond it is another unit rather than a flood
    believed, flow = dict(compress(believed.items(), usual)), flow[usual]
    slope = _slope(flow, np.array([fit.lag_in for fit in believed.values()]))
    return {
        date: fit._replace(lag_in=fit.lag_in - slope * float(q))
        for (date, fit), q in zip(believed.items(), flow, strict=True)
    }


def _usual(believed: dict[dt.date, Fit], longest: float) -> tuple[float, float] | None:
    """Return the lags [s] that most days share, preferring lags that water can have; None without days."""
    if not believed:
        return None
    lags = np.array([(fit.lag_in, fit.lag_out) for fit in believed.values()])
    lags = lags[:: max(1, len(lags) // 1000)]
    alike = (np.abs(lags[:, None] - lags[None]) <= ALIKE).all(axis=2)
    possible = (lags[:, 0] >= 0) & (lags[:, 0] <= longest) & (np.abs(lags[:, 1]) < AT_THE_GATE)
    most = int(np.argmax(alike.sum(axis=1) * np.where(possible, POSSIBLE, 1)))
    lag_in, lag_out = np.median(lags[alike[most]], axis=0).tolist()
    return lag_in, lag_out


def _dates(record: Record, fits: Fits) -> list[Finding]:
    """Find days that fit only with the flows of the day before or after."""
    groups: dict[tuple[int, int], list[dt.date]] = defaultdict(list)
    shifts = [shift for shift in SHIFTS if record.balanced or not shift[1]]
    for date, fit in fits.right.items():
        if fit.explained < WELL:
            each = [(fits.of([date], shift)[0].explained, shift) for shift in shifts]
            _, best = max([(fit.explained + OTHER_DAY_EACH, (0, 0)), *each])
            groups[best].append(date)
    found = []
    for shift, some in groups.items():
        days = _in_rows(record, some, list(fits.right), whole=True) if any(shift) else []
        least = fits.of(days)[0].explained + OTHER_DAY
        if days and fits.of(days, shift)[0].explained >= least:
            column, sense = SHIFTS[shift]
            other_day = "after" if sense == "early" else "before"
            values = {"column": column or record.output, "sense": sense, "other_day": other_day}
            found.append(Finding("dates", values, {date: {} for date in days}))
    return found


def _swapped(record: Record, fit: tuple[Fit, Fit], days: list[dt.date]) -> list[Finding]:
    """Return whether the flows act the other way round, on some days or (none given) on all."""
    right, reverse = fit
    if reverse.explained < BELIEVED or reverse.explained - right.explained <= REVERSED:
        return []
    code = "river" if not record.balanced else "flows" if reverse.lag_out >= reverse.lag_in else "level"
    values = {"output": record.output, "lag_s": max(reverse.lag_out, 0.0)}
    return [Finding(f"swapped.{code}", values, {date: {} for date in days})]


def _drift(record: Record, believed: dict[dt.date, Fit]) -> list[Finding]:
    """Find a clock with an offset that grows every day."""
    if len(believed) < FEWEST:
        return []
    days = np.array([date.toordinal() for date in believed], float)
    length = float(np.ptp(days))
    changes = []
    for lags in np.array([(fit.lag_in, fit.lag_out) for fit in believed.values()]).T:
        slope, scatter, jump = _line(days, lags)
        straight = STRAIGHT * scatter < abs(slope) * length and scatter < jump
        changes.append(slope * length if straight and abs(slope) * length >= DRIFT["pool"] else 0.0)
    column, late = _late_column(record, *changes)
    if not column or abs(late) < DRIFT[record.reach.kind]:
        return []
    values = {
        "column": column, "speed": "fast" if late > 0 else "slow", "off_s": abs(late),
        "per_day_s": abs(late) / length, "first": str(min(believed)), "last": str(max(believed)),
    }  # fmt: skip
    return [Finding("drift", values)]


def _line(days: Floats, values: Floats) -> tuple[float, float, float]:
    """Return the slope of a line, the mean distance of the values from it, and that from the best jump."""

    def scatter(values: Floats) -> float:
        return float(np.abs(values - np.median(values)).mean())

    slope, n = _slope(days, values), len(values)
    jump = min(
        k * scatter(values[:k]) + (n - k) * scatter(values[k:])
        for k in range(2, n - 1, max(1, n // MOST_PAIRED))
    )
    return slope, scatter(values - slope * days), jump / n


def _slope(x: Floats, y: Floats) -> float:
    """Return the median of the slopes of all pairs (Theil and Sen)."""
    thin = slice(None, None, max(1, len(x) // MOST_PAIRED))
    apart, rises = x[thin][:, None] - x[thin], y[thin][:, None] - y[thin]
    ahead = apart > 0
    return float(np.median(rises[ahead] / apart[ahead])) if ahead.any() else 0.0


def _late_column(record: Record, by_in: float, by_out: float) -> tuple[str, float]:
    """Return the column with late stamps, and by how much [s] (negative: early); "" if it is unclear."""
    if not record.balanced:
        return ("u_Qi", -by_in) if by_in else ("", 0.0)
    if abs(by_in - by_out) <= ALIKE:
        return record.output, 0.5 * (by_in + by_out)
    if abs(by_out) <= ALIKE:
        return "u_Qi", -by_in
    if abs(by_in) <= ALIKE:
        return "u_Qo", -by_out
    return "", 0.0


def _shifted(
    record: Record, fits: Fits, believed: dict[dt.date, Fit], usual: tuple[float, float]
) -> list[Finding]:
    """Find days on which one clock is shifted against the usual lags."""
    groups: dict[tuple[str, int], dict[dt.date, float]] = defaultdict(dict)
    least = SMALLEST[record.reach.kind]
    for date, fit in believed.items():
        by_in, by_out = fit.lag_in - usual[0], fit.lag_out - usual[1]
        if max(abs(by_in), abs(by_out)) < least:
            continue
        # its own lags must explain clearly more than the usual ones; a river's always vary
        if record.balanced and fits.right[date].explained - fits.near(date, usual) <= GAIN:
            continue
        column, late = _late_column(record, by_in, by_out)
        if column and abs(late) >= least:
            # offsets that agree within minutes have the same cause
            known = (k for k in groups if k[0] == column and abs(k[1] - late) <= ALIKE)
            groups[next(known, (column, round(late)))][date] = late
    found = []
    reference = "the others" if record.balanced else record.output
    for (column, _), days in groups.items():
        if rows := _in_rows(record, list(days), list(believed)):
            late = float(np.median([days[date] for date in rows]))
            sense = "late" if late > 0 else "early"
            values = {"column": column, "off_s": abs(late), "sense": sense, "reference": reference}
            code = "clock.hour" if abs(abs(late) - 3600) < 10 * 60 else "clock.shift"
            dates = _with_quiet_days(record, fits, usual, column, late, rows)
            found.append(Finding(code, values, {date: {} for date in dates}))
    return found


def _with_quiet_days(
    record: Record, fits: Fits, usual: tuple[float, float], column: str, late: float, days: list[dt.date]
) -> list[dt.date]:
    """Return the days, and those between and next to them that are too quiet for a fit but agree."""
    shift = {"u_Qi": (-late, 0.0), "u_Qo": (0.0, -late)}.get(column, (late, late if record.balanced else 0.0))
    there = (usual[0] + shift[0], usual[1] + shift[1])
    if not record.balanced:
        return days

    def better(date: dt.date) -> float:
        return fits.near(date, there) - fits.near(date, usual)

    between = [d for d in record.days if days[0] < d < days[-1] and d not in days and better(d) > 0]
    before = takewhile(lambda d: better(d) > GAIN, reversed([d for d in record.days if d < days[0]]))
    after = takewhile(lambda d: better(d) > GAIN, [d for d in record.days if d > days[-1]])
    return sorted([*days, *between, *before, *after])


def _always(record: Record, fits: Fits, usual: tuple[float, float]) -> list[Finding]:
    """Find lags that water cannot have, on all days."""
    (lag_in, lag_out), longest = usual, fits.longest
    if record.balanced and abs(lag_out) >= AT_THE_GATE:
        column = "h_L" if -NEAR <= lag_in - lag_out <= longest else "u_Qo"
        speed = "fast" if (lag_out > 0) == (column == "h_L") else "slow"
        sense = "late" if lag_out > 0 else "early"
        values = {"column": column, "off_s": abs(lag_out), "sense": sense, "speed": speed}
        return [Finding("clock.gate", values)]
    if lag_in <= -SMALLEST["pool"]:
        return [Finding("clock.before", {"output": record.output, "off_s": -lag_in})]
    # what delays the answer to both flows, in a gauge or its clock, is no travel of a wave
    travel = lag_in - max(lag_out, 0.0)
    if record.declared("length") and record.balanced and travel > longest + record.step:
        values = {"lag_s": lag_in, "longest_s": longest, "length": record.reach.length}
        return [Finding("clock.slow", values)]
    return []


def _in_rows(
    record: Record, dates: list[dt.date], among: list[dt.date], whole: bool = False
) -> list[dt.date]:
    """Return the dates that form dense rows among others (`whole`: with the days between them)."""
    found = []
    for row in consecutive(dates, among, gap=2):
        span = among[among.index(row[0]) : among.index(row[-1]) + 1]
        if len(row) >= max(DENSE * len(span), min(FEW[record.reach.kind], len(among))):
            found += span if whole else row
    return found
