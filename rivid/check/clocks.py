"""Clocks: a column that is off against the others by an hour, by a day, more and more; columns swapped."""

import datetime as dt

import numpy as np

from rivid.check.findings import Finding, hours
from rivid.check.fit import Fit
from rivid.check.fits import TOLD, Fits
from rivid.check.record import Record

SMALLEST = {"pool": 30 * 60.0, "river": 45 * 60.0}
"""Clocks that are off by less are not told of [s]: people and waves need minutes."""
ALIKE = 15 * 60.0
NEAR = 20 * 60.0
"""Lags this near the usual ones are the usual ones [s]."""
AT_THE_GATE = 50 * 60.0
"""The level answers the outflow sooner than that, whatever the gate [s]."""
GAIN = 0.12
"""By how much a shift must explain more."""
REVERSED = 0.15
REVERSED_DAY = 0.25
WHOLE_DAY = 0.3
DRIFT = 20 * 60.0
STRAIGHT = 0.7
"""Share of the lags' variance that a straight line explains where a clock drifts."""
FEW = {"pool": 2, "river": 5}
"""Days in a row that must agree, where there are so many: the delay of a river changes by itself."""
DENSE = 0.6
"""Share of the days between the first and the last of a row that must agree."""


def clocks(record: Record, fits: Fits) -> list[Finding]:
    """What the lags between the columns say about their clocks."""
    if not fits.right:
        return []
    if swapped := _swapped(record, fits):
        return swapped
    told = _told(record, fits)
    usual = _usual(told, fits.lags.longest)
    found = _drift(record, fits, told) if usual else []
    if usual and not found:
        found = [*_off(record, fits, told, usual), *_always(record, fits, usual)]
    return [*found, *_by_a_day(record, fits, {date for finding in found for date in finding.days})]


def _told(record: Record, fits: Fits) -> dict[dt.date, Fit]:
    """The fits that are believed; of a river with what the flow makes of the lag taken off."""
    told = fits.told
    if record.reach.kind == "pool" or len(told) < 2 * FEW["river"]:
        return told
    flow = np.log([max(float(record.days[date]["u_Qi"].mean()), 1e-3) for date in told])
    lags = np.array([fit.lag_in for fit in told.values()])
    flow -= np.median(flow)
    slope = float(np.polyfit(flow, lags, 1)[0]) if np.ptp(flow) > 0 else 0.0
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
    most = int(np.argmax(alike.sum(axis=1) * np.where(possible, 3, 1)))
    lag_in, lag_out = np.median(lags[alike[most]], axis=0).tolist()
    return lag_in, lag_out


def _swapped(record: Record, fits: Fits) -> list[Finding]:
    right, reverse = fits.together
    if reverse.explained >= TOLD and reverse.explained - right.explained > REVERSED:
        days: list[dt.date] = []
    else:
        days = [
            date
            for date, fit in fits.reverse.items()
            if fit.explained >= TOLD and fit.explained - fits.right[date].explained > REVERSED_DAY
        ]
        days = _rows(record, days, list(fits.right), whole=True)
        if not days or not record.balanced:
            return []
        reverse = fits.of(days)[1]
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


def _column(record: Record, by_in: float, by_out: float) -> tuple[str, float]:
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


def _off(record: Record, fits: Fits, told: dict[dt.date, Fit], usual: tuple[float, float]) -> list[Finding]:
    """Days on which one clock is off against the usual lags."""
    groups: dict[tuple[str, int], dict[dt.date, float]] = {}
    least = SMALLEST[record.reach.kind]
    for date, fit in told.items():
        by_in, by_out = fit.lag_in - usual[0], fit.lag_out - usual[1]
        if max(abs(by_in), abs(by_out)) < least or not _better(record, fits, date, usual):
            continue
        column, late = _column(record, by_in, by_out)
        if column and abs(late) >= least:
            # the same hour, give or take minutes, is the same fault
            key = next(
                (k for k in groups if k[0] == column and abs(k[1] - late) <= ALIKE), (column, round(late))
            )
            groups.setdefault(key, {})[date] = late
    found = []
    for (column, _), days in groups.items():
        rows = _rows(record, list(days), list(told))
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


def _rows(record: Record, dates: list[dt.date], among: list[dt.date], whole: bool = False) -> list[dt.date]:
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


def _drift(record: Record, fits: Fits, told: dict[dt.date, Fit]) -> list[Finding]:
    """A clock that goes wrong a little more every day."""
    if len(told) < 6:
        return []
    days = np.array([date.toordinal() for date in told], float)
    span = float(np.ptp(days))
    changes = []
    for lags in ([f.lag_in for f in told.values()], [f.lag_out for f in told.values()]):
        values = np.array(lags)
        slope, rest, jump = _line(days, values)
        straight = rest < (1 - STRAIGHT) * float(values.var()) and rest < jump
        changes.append(slope * span if straight and abs(slope) * span >= DRIFT else 0.0)
    if not any(changes):
        return []
    column, late = _column(record, *changes)
    if not column or (not record.balanced and abs(late) < max(fits.lags.longest, 2 * DRIFT)):
        return []
    first, last = min(told), max(told)
    faster = "fast" if late > 0 else "slow"
    text = (
        f"the clock of {column} goes {faster}: by {hours(abs(late))} from {first} to {last}, "
        f"{abs(late) / span:.0f} s a day, against the others'"
    )
    return [Finding("drift", text)]


def _line(days: np.ndarray, values: np.ndarray) -> tuple[float, float, float]:
    """Slope of a line, the variance it leaves, and that which the best single jump leaves."""
    slope, level = np.polyfit(days - days.mean(), values, 1)
    rest = float(np.var(values - level - slope * (days - days.mean())))
    jump = min(
        (k * float(values[:k].var()) + (len(values) - k) * float(values[k:].var())) / len(values)
        for k in range(1, len(values))
    )
    return float(slope), rest, jump


SHIFTS = {
    (-1, 0): ("u_Qi", "early"),
    (1, 0): ("u_Qi", "late"),
    (0, -1): ("u_Qo", "early"),
    (0, 1): ("u_Qo", "late"),
    (-1, -1): ("", "late"),
    (1, 1): ("", "early"),
}
"""Days by which the flows are taken from another day: whose dates are off ("": the output's), and how."""


def _by_a_day(record: Record, fits: Fits, done: set[dt.date]) -> list[Finding]:
    """Days that fit only with the flows of the day before or after."""
    groups: dict[tuple[int, int], list[dt.date]] = {}
    for date, fit in fits.right.items():
        if date in done or fit.explained >= 0.6:
            continue
        best = (fit.explained, (0, 0))
        for shift in SHIFTS:
            if not record.balanced and shift[1]:
                continue
            sums = fits.lags.sums(date, *shift)
            if sums is not None:
                best = max(best, (fits.lags.best(sums).explained, shift))
        if best[0] >= fit.explained + WHOLE_DAY and best[0] >= 0.5:
            groups.setdefault(best[1], []).append(date)
    found = []
    for shift, days in groups.items():
        days = _rows(record, days, list(fits.right), whole=True)
        if not days:
            continue
        column, off = SHIFTS[shift]
        column = column or record.output
        text = (
            f"the dates of {column} are a day too {off}: it fits the other columns of the day "
            f"{'after' if off == 'early' else 'before'}"
        )
        found.append(Finding("dates", text, dict.fromkeys(days, f"{column} looks dated a day too {off}")))
    return found
