"""Which days agree in what they say, and whose clock it is that lags speak of."""

import datetime as dt
from itertools import compress

import numpy as np

from rivid.check.findings import Finding, hours
from rivid.check.record import TOLD, Fit, Fits, Record
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


WELL = 0.6
"""Share of the output's moves from which on a day is where it belongs."""
MORE, MAYBE = 0.2, 0.12
"""By how much the flows of another day must explain more: of all such days together, of one of them."""

SHIFTS = {
    (-1, 0): ("u_Qi", "early"),
    (1, 0): ("u_Qi", "late"),
    (0, -1): ("u_Qo", "early"),
    (0, 1): ("u_Qo", "late"),
    (-1, -1): ("", "late"),
    (1, 1): ("", "early"),
}
"""Days by which the flows are taken from another day: whose dates are off ("": the output's), and how."""


def dates(record: Record, fits: Fits) -> list[Finding]:
    """Days that fit only with the flows of the day before or after."""
    groups: dict[tuple[int, int], list[dt.date]] = {}
    for date, fit in fits.right.items():
        if fit.explained >= WELL:
            continue
        best = (fit.explained + MAYBE, (0, 0))
        for shift in SHIFTS:
            sums = fits.lags.sums(date, *shift) if record.balanced or not shift[1] else None
            if sums is not None:
                best = max(best, (fits.lags.best(sums).explained, shift))
        if best[1] != (0, 0):
            groups.setdefault(best[1], []).append(date)
    found = []
    for shift, some in groups.items():
        days = in_rows(record, some, list(fits.right), whole=True)
        if not days:
            continue
        shifted = fits.of(days, shift)[0].explained
        if shifted < max(TOLD, fits.of(days)[0].explained + MORE):
            continue
        column, off = SHIFTS[shift]
        column = column or record.output
        text = (
            f"the dates of {column} are a day too {off}: it fits the other columns of the day "
            f"{'after' if off == 'early' else 'before'}"
        )
        found.append(Finding("dates", text, dict.fromkeys(days, f"{column} looks dated a day too {off}")))
    return found


LEAST = {"pool": 20 * 60.0, "river": 90 * 60.0}
"""A clock that drifts by less over the record is not told of [s]: the delay of a river changes by itself."""
STRAIGHT = 4.0
"""How many times the lags' scatter about a straight line the drift is."""
FEWEST = 6
"""Days that a line needs."""


def drift(record: Record, told: dict[dt.date, Fit]) -> list[Finding]:
    """A clock that goes wrong a little more every day."""
    if len(told) < FEWEST:
        return []
    days = np.array([date.toordinal() for date in told], float)
    span = float(np.ptp(days))
    changes = []
    for lags in ([f.lag_in for f in told.values()], [f.lag_out for f in told.values()]):
        values = np.array(lags)
        slope, rest, jump = _line(days, values)
        straight = STRAIGHT * rest < abs(slope) * span and rest < jump
        changes.append(slope * span if straight and abs(slope) * span >= LEAST["pool"] else 0.0)
    if not any(changes):
        return []
    column, late = whose(record, *changes)
    if not column or abs(late) < LEAST[record.reach.kind]:
        return []
    first, last = min(told), max(told)
    faster = "fast" if late > 0 else "slow"
    text = (
        f"the clock of {column} goes {faster}: by {hours(abs(late))} from {first} to {last}, "
        f"{abs(late) / span:.0f} s a day, against the others'"
    )
    return [Finding("drift", text)]


def _line(days: Floats, values: Floats) -> tuple[float, float, float]:
    """The slope of a line, how far values lie from it, and from the best single jump."""
    slope = slope_of(days, values)
    rest = _scatter(values - slope * days) * len(values)
    jump = min(
        k * _scatter(values[:k]) + (len(values) - k) * _scatter(values[k:])
        for k in range(2, len(values) - 1, max(1, len(values) // MOST_PAIRED))
    )
    return slope, rest / len(values), jump / len(values)


def _scatter(values: Floats) -> float:
    """The mean distance from the median."""
    return float(np.abs(values - np.median(values)).mean())


SMALLEST = {"pool": 30 * 60.0, "river": 50 * 60.0}
"""Clocks that are off by less are not told of [s]: people and waves need minutes."""
NEAR = 20 * 60.0
"""Lags this near the usual ones are the usual ones [s]."""
AT_THE_GATE = 50 * 60.0
"""The level answers the outflow sooner than that, whatever the gate [s]."""
GAIN = 0.12
"""By how much a shift must explain more."""
REVERSED, REVERSED_DAY = 0.15, 0.25
"""By how much swapped columns must explain more: of all days together, of one day."""
ENOUGH = 0.4
"""Share of the days that must be believed for their lags to say anything."""
POSSIBLE = 10
"""How many times rather lags that water can have are taken for the usual ones."""
UNUSUAL = 1.6
"""Logarithm of the flow against the usual one beyond which a river's delay is not compared."""


def clocks(record: Record, fits: Fits) -> list[Finding]:
    """What the lags between the columns say about their clocks."""
    if not fits.right:
        return []
    if swapped := _swapped(record, fits.together, []):
        return swapped
    found = dates(record, fits)
    others = {date for date in fits.right if not any(date in finding.days for finding in found)}
    if 2 * len(others) < len(fits.right):
        return found
    found += _swapped_on_some(record, fits, others)
    told = {date: fit for date, fit in _told(record, fits).items() if date in others}
    usual = _usual(told, fits.lags.longest)
    if usual is None or len(told) < ENOUGH * len(others):
        return found
    if drifting := drift(record, told):
        return [*found, *drifting]
    return [*found, *_off(record, fits, told, usual), *_always(record, fits, usual)]


def _told(record: Record, fits: Fits) -> dict[dt.date, Fit]:
    """The fits that are believed; of a river with what the flow makes of the lag taken off."""
    told = fits.told
    if record.reach.kind == "pool" or len(told) < 2 * FEW["river"]:
        return told
    flow = np.log([max(float(record.days[date]["u_Qi"].mean()), 1e-3) for date in told])
    flow -= np.median(flow)
    usual = np.abs(flow) <= UNUSUAL  # beyond it is another unit rather than a flood
    told, flow = dict(compress(told.items(), usual)), flow[usual]
    slope = slope_of(flow, np.array([fit.lag_in for fit in told.values()]))
    return {
        date: fit._replace(lag_in=fit.lag_in - slope * float(q))
        for (date, fit), q in zip(told.items(), flow, strict=True)
    }


def _usual(believed: dict[dt.date, Fit], longest: float) -> tuple[float, float] | None:
    """The lags [s] that most days have, rather such as water can have; None where no day is believed."""
    if not believed:
        return None
    lags = np.array([(fit.lag_in, fit.lag_out) for fit in believed.values()])
    lags = lags[:: max(1, len(lags) // 1000)]
    alike = (np.abs(lags[:, None] - lags[None]) <= ALIKE).all(axis=2)
    possible = (lags[:, 0] >= 0) & (lags[:, 0] <= longest) & (np.abs(lags[:, 1]) < AT_THE_GATE)
    most = int(np.argmax(alike.sum(axis=1) * np.where(possible, POSSIBLE, 1)))
    lag_in, lag_out = np.median(lags[alike[most]], axis=0).tolist()
    return lag_in, lag_out


def _swapped_on_some(record: Record, fits: Fits, among: set[dt.date]) -> list[Finding]:
    odd = [
        date
        for date in among
        if fits.reverse[date].explained - fits.right[date].explained > REVERSED_DAY
        and fits.reverse[date].explained >= TOLD
    ]
    days = in_rows(record, sorted(odd), list(fits.right), whole=True) if record.balanced else []
    return _swapped(record, fits.of(days), days) if days else []


def _swapped(record: Record, fit: tuple[Fit, Fit], days: list[dt.date]) -> list[Finding]:
    """Whether the flows act the other way round, on some days or (none given) all."""
    right, reverse = fit
    if reverse.explained < TOLD or reverse.explained - right.explained <= REVERSED:
        return []
    if not record.balanced:
        text = f"{record.output} falls where u_Qi rises: is a sign turned round, or is it another column?"
    elif reverse.lag_out >= reverse.lag_in:
        text = (
            "h_L falls with u_Qi and rises with u_Qo"
            + (f", {hours(reverse.lag_out)} later" if reverse.lag_out > 0 else "")
            + ": are inflow and outflow swapped? Check [input] u_Qi and u_Qo"
        )
    else:
        text = (
            "h_L falls with u_Qi and rises with u_Qo: is it measured downwards, or are inflow and outflow "
            "swapped?"
        )
    return [Finding("swapped", text, dict.fromkeys(days, "inflow and outflow look swapped"))]


def _off(record: Record, fits: Fits, told: dict[dt.date, Fit], usual: tuple[float, float]) -> list[Finding]:
    """Days on which one clock is off against the usual lags."""
    groups: dict[tuple[str, int], dict[dt.date, float]] = {}
    least = SMALLEST[record.reach.kind]
    for date, fit in told.items():
        by_in, by_out = fit.lag_in - usual[0], fit.lag_out - usual[1]
        if max(abs(by_in), abs(by_out)) < least or not _better(record, fits, date, usual):
            continue
        column, late = whose(record, by_in, by_out)
        if column and abs(late) >= least:
            # the same hour, give or take minutes, is the same fault
            key = next(
                (k for k in groups if k[0] == column and abs(k[1] - late) <= ALIKE), (column, round(late))
            )
            groups.setdefault(key, {})[date] = late
    found = []
    for (column, _), days in groups.items():
        rows = in_rows(record, list(days), list(told))
        if not rows:
            continue
        days = {date: days[date] for date in rows}
        late = float(np.median(list(days.values())))
        words = dict.fromkeys(_filled(record, fits, usual, column, late, days), _says(column, late, record))
        text = _says(column, late, record)
        if abs(abs(late) - 3600) < 10 * 60:
            text += ": is its clock an hour off, or does it keep summer time? Check time_zone and the logger"
        else:
            text += ": check the logger's clock"
        found.append(Finding("clock", text, words))
    return found


def _says(column: str, late: float, record: Record) -> str:
    against = "u_Qi" if not record.balanced and column != "u_Qi" else "the others"
    if not record.balanced:
        against = record.output
    return f"{column} is stamped {hours(abs(late))} too {'late' if late > 0 else 'early'} against {against}"


def _better(record: Record, fits: Fits, date: dt.date, usual: tuple[float, float]) -> bool:
    """Whether a day's own lags explain clearly more than the usual ones; a river's are never the same."""
    sums = fits.lags.sums(date) if record.balanced else None
    if sums is None:
        return not record.balanced
    return fits.right[date].explained - fits.lags.best(sums, near=usual, within=NEAR).explained > GAIN


def _filled(
    record: Record,
    fits: Fits,
    usual: tuple[float, float],
    column: str,
    late: float,
    days: dict[dt.date, float],
) -> list[dt.date]:
    """The days between that are too quiet to tell by themselves, and do not contradict."""
    shift = {"u_Qi": (-late, 0.0), "u_Qo": (0.0, -late)}.get(column, (late, late if record.balanced else 0.0))
    there = (usual[0] + shift[0], usual[1] + shift[1])
    found = set(days)
    inside = [d for d in record.days if record.balanced and min(days) <= d <= max(days) and d not in days]
    for date in inside:
        sums = fits.lags.sums(date)
        if sums is not None:
            fit_there = fits.lags.best(sums, near=there, within=NEAR).explained
            if fit_there > fits.lags.best(sums, near=usual, within=NEAR).explained:
                found.add(date)
    return sorted(found)


def _always(record: Record, fits: Fits, usual: tuple[float, float]) -> list[Finding]:
    """Lags that no water has, on all days."""
    lag_in, lag_out = usual
    longest = fits.lags.longest
    if record.balanced and abs(lag_out) >= AT_THE_GATE:
        column = "h_L" if -NEAR <= lag_in - lag_out <= longest else "u_Qo"
        late = lag_out if column == "h_L" else -lag_out
        said = f"h_L answers u_Qo {hours(abs(lag_out))} {'late' if lag_out > 0 else 'too early'}"
        text = f"{said}, though the gauge stands at the gate: is the clock of {column} {hours(abs(late))} "
        text += "fast?" if late > 0 else "slow?"
        return [Finding("clock", text)]
    if lag_in <= -SMALLEST["pool"]:
        what = record.output
        return [
            Finding(
                "clock",
                f"{what} moves {hours(-lag_in)} before u_Qi: is u_Qi's clock fast, or are columns swapped?",
            )
        ]
    if record.declared("length") and record.balanced and lag_in >= longest + SMALLEST["pool"]:
        said = (
            f"h_L answers u_Qi after {hours(lag_in)}, where a wave needs {hours(longest)} at most ([reach])"
        )
        return [Finding("clock", f"{said}: is the clock of u_Qi slow?")]
    return []
