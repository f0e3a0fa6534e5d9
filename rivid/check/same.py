"""Values that cannot all be measured: a day logged twice, a flow that never moves, flows below zero."""

import datetime as dt
from hashlib import sha256

import numpy as np

from rivid.check.findings import Finding
from rivid.check.record import Record
from rivid.types import Floats

MOMENT = 300.0
"""A flow that is far off for longer may be what was done [s]."""
SAME, FAR = 0.1, 0.6
"""Before and after a moment a flow is the same; in it, off by more than this part."""
MOVES = 20
"""Moves of the gauge in a day from which on two days are not the same by chance."""


def same(record: Record, min_motion: float) -> list[Finding]:
    """Copies, constants, flows below zero and for a moment in another world."""
    return [*_copies(record), *_constant(record, min_motion), *_negative(record), *_moments(record)]


def _copies(record: Record) -> list[Finding]:
    """The same samples under several dates."""
    found: dict[tuple[str, str], list[dt.date]] = {}
    for date, day in record.days.items():
        measured = day.columns[record.output]
        if np.count_nonzero(np.diff(measured)) > MOVES:
            key = (record.output, sha256(measured.tobytes()).hexdigest())
            found.setdefault(key, []).append(date)
        if any(np.ptp(values) > 0 for values in day.columns.values()):
            found.setdefault(("", day.content), []).append(date)
    whole = {date for (name, _), dates in found.items() if not name and len(dates) > 1 for date in dates}
    copies: dict[str, list[list[dt.date]]] = {}
    for (name, _), dates in found.items():
        if len(dates) > 1 and not (name and set(dates) <= whole):
            copies.setdefault(name, []).append(dates)
    said = []
    for name, groups in copies.items():
        what = f"the samples of {name}" if name else "the same samples"
        one = " and ".join(str(date) for date in groups[0][:2])
        all_days = {
            d: f"{name or 'all columns'} as on {o[0] if o[0] != d else o[1]}" for o in groups for d in o
        }
        verb = "stand" if not name else "are the same"
        if len(groups) == 1 and len(groups[0]) == 2:
            text = f"{what} {verb} under {one}: is one a copy of the other?"
        else:
            text = f"{what} {verb} under several dates, {one} for one: are some copies of others?"
        said.append(Finding("copy", text, all_days if len(all_days) > 2 else {}))
    return said


def _constant(record: Record, min_motion: float) -> list[Finding]:
    """Flows that do not move all day; an inflow without motion tells no delay."""
    found = []
    for name in record.flows:
        if name == record.output:
            continue  # the gauge's own matter
        days = [
            date
            for date, day in record.days.items()
            if np.ptp(day.columns[name]) <= min_motion * np.abs(day.columns[name]).max()
        ]
        if name == "u_Qo":
            # a gate that stands still is nothing odd where the inflow stands still, or on a single day
            days = [date for date in days if np.ptp(record.days[date].columns["u_Qi"]) > 0]
            if len(days) < max(2, 0.2 * len(record.days)) and len(days) < len(record.days):
                continue
        if not days:
            continue
        wrong = len(days) == len(record.days) and len(days) > 1
        value = sorted({float(record.days[d].columns[name][0]) for d in days})
        one = f" ({value[0]:g} m3/s)" if len(value) == 1 else ""
        which = {"u_Qi": "the inflow", "u_Qo": "the outflow"}[name]
        whole = " on every day" if len(days) == len(record.days) > 1 else ""
        says = f"{which} is constant{one}{whole}"
        if name == "u_Qi":
            says += ": no delay can be told"
        elif wrong:
            says += " while the inflow moves: is it a set-point, or a dead line?"
        found.append(
            Finding("constant", says, {d: f"{which} is constant" for d in days} if not whole else {}, wrong)
        )
    return found


def _negative(record: Record) -> list[Finding]:
    found = []
    for name in record.flows:
        days = {
            date: f"negative {name}, down to {float(day.columns[name].min()):.4g} m3/s"
            for date, day in record.days.items()
            if (day.columns[name] < 0).any()
        }
        if days:
            lowest = min(float(record.days[date].columns[name].min()) for date in days)
            text = f"{name} is negative, down to {lowest:.4g} m3/s: a sign, a sentinel, or pumping?"
            found.append(Finding("negative", text, days, wrong=False))
    return found


def _moments(record: Record) -> list[Finding]:
    """Commands that are far off for minutes, and then what they were: a lost digit, a mark of thousands."""
    longest = int(MOMENT // record.step)
    found = []
    for name in record.flows:
        days = {}
        for date, day in record.days.items() if name != record.output else ():
            times = [record.clock(k) for k in _thorns(day[name], longest)]
            if times:
                more = f" and {len(times) - 3} times more" if len(times) > 3 else ""
                days[date] = f"{name} is far off for a moment at {', '.join(times[:3])}{more}"
        if days:
            one = min(days)
            text = (
                f"{name} is far off for a moment, and then what it was: a lost digit? On {one}: {days[one]}"
            )
            found.append(Finding("moment", text if len(days) > 1 else days[one], days, wrong=False))
    return found


def _thorns(flow: Floats, longest: int) -> list[int]:
    """Where a flow leaves for no more than so many samples."""
    found: list[int] = []
    for n in range(1, longest + 1):
        if len(flow) < n + 2:
            break
        before, after = flow[: -n - 1], flow[n + 1 :]
        alike = np.abs(after - before) <= SAME * np.abs(before)
        away = np.min([np.abs(flow[1 + j : len(flow) - n + j] - before) for j in range(n)], axis=0)
        found += (np.flatnonzero(alike & (away > FAR * np.abs(before)) & (before != 0)) + 1).tolist()
    return sorted(set(found))
