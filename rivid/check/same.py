"""Values that cannot all be measured: a day logged twice, a flow that never moves, flows below zero."""

import datetime as dt
from hashlib import sha256

import numpy as np

from rivid.check.findings import Finding
from rivid.check.record import Record

MOVES = 20
"""Moves of the gauge in a day from which on two days are not the same by chance."""


def same(record: Record, min_motion: float) -> list[Finding]:
    """Copies, constants and negative flows."""
    return [*_copies(record), *_constant(record, min_motion), *_negative(record)]


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
