"""Values that cannot all be measured: a day logged twice, a flow that never moves, flows below zero."""

import datetime as dt
from collections.abc import Collection, Sequence
from hashlib import sha256

import numpy as np

from rivid.check.findings import Finding, hours
from rivid.check.record import TOLD, Fits, Record
from rivid.types import ONE_DAY, Floats

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


SHORTEST = 2 * 3600.0
"""A gauge that stands still for less is not told of [s]."""
SAMPLES = 16
"""Nor for fewer samples."""
LONGER = 4.0
"""How many times longer than usual it must stand still."""
STEPS = 1.5
"""By how many steps of the gauge the flows must have moved the level meanwhile."""
FLOW_STEPS, FLOW_SHARE = 5.0, 0.15
"""The same of a river: steps, and share of its flow."""
MOST = 3
"""Of a day's spells that are named."""
JUMP = 8.0
"""A jump is so many times the moves that one sample in a hundred exceeds."""
JUMP_STEPS = 6.0
"""And so many steps of the gauge."""
BESIDE = 6
"""Samples on either side of a jump whose means must be as far apart."""
BACK = 3600.0
"""A jump that is taken back within this time is a spike [s]."""


def gauge(record: Record, fits: Fits, others: Sequence[Finding] = ()) -> list[Finding]:
    """Spells without motion, jumps and spikes of the output.

    Parameters
    ----------
    record : Record
    fits : Fits
    others : sequence of Finding
        What is known already: where a balance does not close, what stands still may be right; where
        something begins or ends that is wrong with some days, the output jumps at midnight.
    """
    open_days = {date for finding in others if finding.kind == "balance" for date in finding.days}
    seams = {
        date
        for finding in others
        for date in record.days
        if (date in finding.days) != (date - ONE_DAY in finding.days)
    }
    spells = {date: told for date, told in _still(record, fits).items() if date not in open_days}
    return [*_said(record, spells), *_jumps(record, spells, seams)]


def _spells(values: Floats) -> list[tuple[int, int]]:
    """From where to where a series does not change, the longest first."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0) + 1, [len(values)]])
    spells = [(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:], strict=True) if b - a > 1]
    return sorted(spells, key=lambda spell: spell[0] - spell[1])


Spells = dict[dt.date, list[tuple[int, int]]]


def _still(record: Record, fits: Fits) -> Spells:
    """The spells, from sample to sample, in which the flows move and the output does not."""
    every = {date: _spells(day[record.output]) for date, day in record.days.items()}
    # what the gauge does on a usual day, the odd spell itself left out
    usual = float(np.median([_length(spells[1:2]) for spells in every.values()])) * record.step
    least = max(SHORTEST, SAMPLES * record.step, LONGER * usual)
    still = {}
    for date, spells in every.items():
        told = [
            (first, last)
            for first, last in spells[:MOST]
            if (last - first) * record.step >= least and _moved(record, fits, date, first, last)
        ]
        if told:
            still[date] = sorted(told)
    return still


def _said(record: Record, still: Spells) -> list[Finding]:
    if not still:
        return []
    output, days, whole = record.output, {}, 0
    for date, spells in still.items():
        if spells[0] == (0, len(record.days[date])):
            whole += 1
            days[date] = f"{output} is {record.days[date][output][0]:.6g} {record.reach.output_unit} all day"
        else:
            words = [
                f"{record.clock(a)} to {record.clock(b)} ({hours((b - a) * record.step)})" for a, b in spells
            ]
            days[date] = f"{output} stands still from {', '.join(words)}"
    one = min(days)
    if len(days) == 1:
        text = f"{days[one]} while the flows move: is the gauge stuck?"
    else:
        text = f"{output} stands still while the flows move, "
        text += "all day" if whole == len(days) else f"{whole} days as a whole" if whole else "for hours"
        text += f": is the gauge stuck? On {one}: {days[one]}"
    return [Finding("stuck", text, days)]


def _length(spells: list[tuple[int, int]]) -> int:
    return spells[0][1] - spells[0][0] if spells else 1


def _moved(record: Record, fits: Fits, date: dt.date, first: int, last: int) -> bool:
    """Whether the flows must have moved the output meanwhile."""
    day, step = record.days[date], record.step
    fit = fits.together[0]
    late = round(fit.lag_in / step) if fit.explained >= TOLD else 0
    if not record.balanced:
        if fit.explained < TOLD or record.reach.kind == "pool":  # then only a day without any motion tells
            still, inflow = last - first == len(day), day["u_Qi"]
            return still and float(np.ptp(inflow)) > FLOW_SHARE * float(np.abs(inflow).mean())
        flows = [record.days[d]["u_Qi"] for d in (date - ONE_DAY, date) if d in record.days]
        flow = np.concatenate(flows)[-len(day) - late :] if len(flows) > 1 else np.roll(day["u_Qi"], late)
        due = fit.gain_in * float(np.ptp(flow[first:last]))
        return due > max(FLOW_STEPS * record.resolution, FLOW_SHARE * float(day[record.output].mean()))
    moved = np.roll(day["u_Qi"], max(late, 0)) - day["u_Qo"]
    moved[: max(late, 0)] = moved[max(late, 0)] if late < len(moved) else 0.0
    volume = np.cumsum(moved - moved.mean())[first:last] * step
    gain = 0.5 * (fit.gain_in - fit.gain_out) if fit.explained >= TOLD else 1 / record.reach.surface_area
    return float(np.ptp(volume)) * gain > STEPS * max(record.resolution, 1e-3)


def _jumps(record: Record, still: Spells, seams: Collection[dt.date]) -> list[Finding]:
    """Jumps from one sample to the next that no flow explains, and that stay."""
    rests = _rest(record)
    if not rests:
        return []
    every = np.concatenate([np.abs(rest) for rest in rests.values()])
    least = max(JUMP * float(np.percentile(every, 99)), JUMP_STEPS * record.resolution)
    jumps: dict[dt.date, str] = {}
    spikes: dict[dt.date, str] = {}
    for date, rest in rests.items() if least > 0 else ():
        at = np.flatnonzero(np.abs(rest) >= least).tolist()
        # a gauge that comes free again jumps
        at = [k for k in at if not any(a - 1 <= k <= b + 2 for a, b in still.get(date, []))]
        at = [k for k in at if k > 0 or date not in seams]
        if at:
            steps, thorns = _kinds(record, date, rest, at, 0.7 * least)
            if steps:
                jumps[date] = f"{record.output} jumps by {_some(steps)}"
            if thorns:
                spikes[date] = f"{record.output} leaps away and back at {_some(thorns)}"
    found = []
    for kind, days, why in (
        ("jump", jumps, "no flow explains it: was the gauge moved, or its datum?"),
        ("spike", spikes, "is it a fault of the gauge? If a number means not measured: [input] sentinels"),
    ):
        if days:
            first = min(days)
            text = f"{days[first]}: {why}" if len(days) == 1 else (
                f"{days[first]} on {first}, and the like on {len(days) - 1} more days: {why}"
            )  # fmt: skip
            found.append(Finding(kind, text, days))
    return found


def _back(rest: Floats, here: int, later: list[int], step: float) -> int | None:
    """The jump that takes one back, if there is one soon."""
    for other in later:
        if (other - here) * step > BACK:
            break
        if rest[other] * rest[here] < 0 and abs(rest[other] + rest[here]) < 0.4 * abs(rest[here]):
            return other
    return None


def _kinds(
    record: Record, date: dt.date, rest: Floats, at: list[int], least: float
) -> tuple[list[str], list[str]]:
    """Jumps that stay and jumps that are taken back, in words."""
    unit, values = record.reach.output_unit, record.days[date][record.output]
    around = _beside(record, date, record.output, BESIDE)
    steps, thorns, until = [], [], -1
    for n, here in enumerate(at):
        if here <= until:
            continue
        back = _back(rest, here, at[n + 1 :], record.step)
        if back is not None:
            until = back
            peak = values[here:back]
            height = peak[np.abs(peak - around[here + BESIDE - 1]).argmax()]
            thorns.append(f"{record.clock(here)} ({height:.6g} {unit})")
            continue
        before, after = around[here : here + BESIDE], around[here + BESIDE : here + 2 * BESIDE]
        stays = float(np.median(after) - np.median(before))
        if abs(stays) >= least and stays * rest[here] > 0:
            steps.append(f"{stays:+.3g} {unit} at {record.clock(here)}")
    return steps, thorns


def _some(words: list[str]) -> str:
    return ", ".join(words[:MOST]) + (f" and {len(words) - MOST} times more" if len(words) > MOST else "")


def _beside(record: Record, date: dt.date, name: str, n: int) -> Floats:
    """A column with n samples of the day before and after; where there is none, with its own ends."""
    days = record.days
    values = days[date][name]
    before, after = date - ONE_DAY, date + ONE_DAY
    left = days[before][name][-n:] if before in days else np.full(n, values[0])
    right = days[after][name][:n] if after in days else np.full(n, values[-1])
    return np.concatenate([left, values, right])


def _rest(record: Record) -> dict[dt.date, Floats]:
    """The output's move into each sample, less what the outflow's moves of these minutes explain."""
    moves = {
        date: np.diff(_beside(record, date, record.output, 1))[:-1]
        for date, day in record.days.items()
        if len(day) > 2 * BESIDE
    }
    if not record.balanced:
        return moves
    gates = {date: _gates(np.diff(_beside(record, date, "u_Qo", 1))[:-1]) for date in moves}
    gram, right = np.zeros((len(BACKS), len(BACKS))), np.zeros(len(BACKS))
    for date, move in moves.items():
        # jumps must not be learnt: they are cut
        cut = np.clip(move, *np.percentile(move, [0.5, 99.5]))
        gram += gates[date] @ gates[date].T
        right += gates[date] @ cut
    gains = np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ right
    return {date: move - gains @ gates[date] for date, move in moves.items()}


BACKS = range(-1, 4)
"""Samples by which the gate's move may be earlier than the level's."""


def _gates(moves: Floats) -> Floats:
    rows = []
    for back in BACKS:
        row = np.roll(moves, back)
        if back > 0:
            row[:back] = 0.0
        elif back < 0:
            row[back:] = 0.0
        rows.append(row)
    return np.stack(rows)
