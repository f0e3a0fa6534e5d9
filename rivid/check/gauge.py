"""Values that are not measured: a gauge that is stuck or jumps, copied days, constant or negative flows."""

import datetime as dt
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from hashlib import sha256
from itertools import pairwise
from typing import Any

import numpy as np

from rivid.check.findings import Finding
from rivid.check.record import BELIEVED, Fits, Record
from rivid.types import HOUR, ONE_DAY, Floats

# Gauges that stand still
SHORTEST = 2 * HOUR  # shortest reported spell without motion [s]
SAMPLES = 16  # fewest samples of such a spell
LONGER = 4.0  # smallest ratio of the spell to the usual longest one of a day
STEPS = 1.5  # smallest motion of the level that the flows imply for the spell [steps of the gauge]
FLOW_STEPS, FLOW_SHARE = 5.0, 0.15  # the same for a river: steps of the gauge, and share of the flow
FLICKER = 2  # range of a stuck gauge that flickers [steps of the gauge]: one step up and down
MOST = 3  # most spells of a day that are compared

# Jumps
JUMP = 8.0  # smallest jump, as a multiple of the 99th percentile of the moves
JUMP_STEPS = 6.0  # smallest jump [steps of the gauge]
AROUND = 6  # samples on either side of a jump, which must differ by it in the median
BACK = HOUR  # longest time within which a spike returns [s]
BACKS = range(-1, 4)  # samples by which the level may follow the gate's move

# Flows
MOMENT = 300.0  # longest excursion of a flow that is an error rather than an operation [s]
# largest difference before and after an excursion, and smallest one in it [share of the flow]
SAME, FAR = 0.1, 0.6
MOVED = 20  # fewest moves of the gauge in a day at which two equal days are no coincidence

Spells = dict[dt.date, list[tuple[int, int]]]


def gauge(record: Record, fits: Fits, others: Sequence[Finding] = ()) -> list[Finding]:
    """Find spells without motion, jumps and spikes of the output, given the other findings.

    Where the balance does not close, a level without motion may be right; where a finding of some days begins
    or ends, or a spell ends, the output jumps at midnight.
    """
    open_days = {date for finding in others if finding.kind == "balance" for date in finding.days}
    seams = {d for f in others for d in record.days if (d in f.days) != (d - ONE_DAY in f.days)}
    spells = {date: found for date, found in _still(record, fits).items() if date not in open_days}
    seams |= {date + ONE_DAY for date, found in spells.items() if found[-1][1] == len(record.days[date])}
    found = _jumps(record, spells, seams)
    days = {}
    for date, at in spells.items():
        values, unit = record.days[date][record.output], record.reach.output_unit
        items = [
            {
                "first": record.clock(a), "last": record.clock(b), "duration_s": (b - a) * record.step,
                "value": float(values[a]), "unit": unit,
            }
            for a, b in at
        ]  # fmt: skip
        days[date] = {"items": items}
    return [Finding("stuck", {"output": record.output}, days), *found] if days else found


def _spells(values: Floats, within: float) -> list[tuple[int, int]]:
    """Return the ranges of samples in which a series stays within a range, the longest first."""
    edges, low, high = [0], values[0], values[0]
    for k, value in enumerate(values.tolist()):
        low, high = min(low, value), max(high, value)
        if high - low > within:
            edges.append(k)
            low = high = value
    spells = [(a, b) for a, b in pairwise([*edges, len(values)]) if b - a > 1]
    return sorted(spells, key=lambda spell: spell[0] - spell[1])


def _still(record: Record, fits: Fits) -> Spells:
    """Return the spells in which the flows move and the output does not, or only flickers.

    An output that only flickers is compared where the flows explain it: operators hold levels, too.
    """
    still: Spells = {}
    explained = record.balanced and fits.together[0].explained >= BELIEVED
    for steps in (0, FLICKER) if explained else (0,):
        within = 1.001 * steps * record.resolution
        every = {date: _spells(day[record.output], within) for date, day in record.days.items()}
        # the second longest: a day's longest spell may be the fault
        usual = np.median([spells[1][1] - spells[1][0] if spells[1:] else 1 for spells in every.values()])
        least = max(SHORTEST, SAMPLES * record.step, LONGER * float(usual) * record.step)
        for date, spells in every.items():
            for first, last in spells[:MOST]:
                known = any(a < last and first < b for a, b in still.get(date, ()))
                long = (last - first) * record.step >= least
                if long and not known and _moved(record, fits, date, first, last, steps):
                    still.setdefault(date, []).append((first, last))
    return {date: sorted(still[date]) for date in sorted(still)}


def _moved(record: Record, fits: Fits, date: dt.date, first: int, last: int, steps: int) -> bool:
    """Return whether the flows must have moved the output in a spell, by more than these steps."""
    day, step = record.days[date], record.step
    fit = fits.together[0]
    late = round(fit.lag_in / step) if fit.explained >= BELIEVED else 0
    if not record.balanced:
        if fit.explained < BELIEVED or record.reach.kind == "pool":  # only a whole day is significant
            still, inflow = last - first == len(day), day["u_Qi"]
            return still and float(np.ptp(inflow)) > FLOW_SHARE * float(np.abs(inflow).mean())
        flows = [record.days[d]["u_Qi"] for d in (date - ONE_DAY, date) if d in record.days]
        flow = np.concatenate(flows)[-len(day) - late :] if len(flows) > 1 else np.roll(day["u_Qi"], late)
        due = fit.gain_in * float(np.ptp(flow[first:last]))
        return due > max(FLOW_STEPS * record.resolution, FLOW_SHARE * float(day[record.output].mean()))
    gain = 0.5 * (fit.gain_in - fit.gain_out) if fit.explained >= BELIEVED else 1 / record.area[0]
    late = max(late, 0)
    volumes = []
    # the least that they imply: an inflow may still be on its way, and the balance closes, or over the day
    for lag in range(late, max(late, min(round(fits.longest / step), len(day) - 1)) + 1):
        moved = np.roll(day["u_Qi"], lag) - day["u_Qo"]
        moved[:lag] = moved[lag]
        volumes += [np.ptp(np.cumsum(moved - rest)[first:last]) * step for rest in (0.0, moved.mean())]
    return float(min(volumes)) * gain > (STEPS + steps) * max(record.resolution, 1e-3)


def _jumps(record: Record, still: Spells, seams: Collection[dt.date]) -> list[Finding]:
    """Find jumps between samples that no flow explains."""
    rests = _residual_moves(record)
    if not rests:
        return []
    every = np.concatenate([np.abs(rest) for rest in rests.values()])
    least = max(JUMP * float(np.percentile(every, 99)), JUMP_STEPS * record.resolution)
    days: dict[str, dict[dt.date, dict[str, Any]]] = {"jump": {}, "spike": {}}
    for date, rest in rests.items() if least > 0 else ():
        at = np.flatnonzero(np.abs(rest) >= least).tolist()
        # a gauge that is freed after a spell jumps
        at = [k for k in at if not any(a - 1 <= k <= b + 2 for a, b in still.get(date, []))]
        at = [k for k in at if k > 0 or date not in seams]
        for kind, item in _jump_items(record, date, rest, at, 0.7 * least):
            days[kind].setdefault(date, {"items": []})["items"].append(item)
    return [Finding(kind, {"output": record.output}, some) for kind, some in days.items() if some]


def _jump_items(
    record: Record, date: dt.date, rest: Floats, at: list[int], least: float
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each "jump" that stays, and each "spike", of a day."""
    unit, values = record.reach.output_unit, record.days[date][record.output]
    around = _extended(record, date, record.output, AROUND)
    until = -1
    for n, here in enumerate(at):
        if here <= until:
            continue
        later = (k for k in at[n + 1 :] if (k - here) * record.step <= BACK and rest[k] * rest[here] < 0)
        back = next((k for k in later if abs(rest[k] + rest[here]) < 0.4 * abs(rest[here])), None)
        if back is not None:  # this jump cancels the other
            until = back
            peak = values[here:back]
            height = float(peak[np.abs(peak - around[here + AROUND - 1]).argmax()])
            last = record.clock(back - 1)
            yield "spike", {"time": record.clock(here), "last": last, "value": height, "unit": unit}
            continue
        before, after = around[here : here + AROUND], around[here + AROUND : here + 2 * AROUND]
        change = float(np.median(after) - np.median(before))
        if abs(change) >= least and change * rest[here] > 0:
            yield "jump", {"time": record.clock(here), "change": change, "unit": unit}


def _extended(record: Record, date: dt.date, name: str, n: int) -> Floats:
    """Return a column with n samples of the adjacent days; without these, with its own end values."""
    days = record.days
    values = days[date][name]
    before, after = date - ONE_DAY, date + ONE_DAY
    left = days[before][name][-n:] if before in days else np.full(n, values[0])
    right = days[after][name][:n] if after in days else np.full(n, values[-1])
    return np.concatenate([left, values, right])


def _residual_moves(record: Record) -> dict[dt.date, Floats]:
    """Return the output's move into each sample, less what the outflow's moves around it explain."""

    def moves_of(date: dt.date, name: str) -> Floats:
        return np.asarray(np.diff(_extended(record, date, name, 1))[:-1])

    moves = {d: moves_of(d, record.output) for d, day in record.days.items() if len(day) > 2 * AROUND}
    if not record.balanced:
        return moves
    gates = {date: _lagged(moves_of(date, "u_Qo")) for date in moves}
    gram, right = np.zeros((len(BACKS), len(BACKS))), np.zeros(len(BACKS))
    for date, move in moves.items():
        # clipped, so that jumps are not fitted
        gram += gates[date] @ gates[date].T
        right += gates[date] @ np.clip(move, *np.percentile(move, [0.5, 99.5]))
    gains = np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ right
    return {date: move - gains @ gates[date] for date, move in moves.items()}


def _lagged(moves: Floats) -> Floats:
    """Moves later by each of BACKS, zero outside the day, shape (lags, n)."""
    padded = np.pad(moves, (BACKS[-1], -BACKS[0]))
    return np.stack([padded[BACKS[-1] - back :][: len(moves)] for back in BACKS])


def implausible(record: Record, min_motion: float) -> list[Finding]:
    """Find copied days, constant and negative flows, and flows that are far off for a moment."""
    return [*_copies(record), *_constant(record, min_motion), *_negative(record), *_moments(record)]


def _copies(record: Record) -> list[Finding]:
    """Find the same samples on several dates."""
    alike: dict[tuple[str, str], list[dt.date]] = defaultdict(list)
    for date, day in record.days.items():
        measured = day.columns[record.output]
        if np.count_nonzero(np.diff(measured)) > MOVED:
            alike[record.output, sha256(measured.tobytes()).hexdigest()].append(date)
        if any(np.ptp(values) > 0 for values in day.columns.values()):
            alike["", day.content].append(date)
    copied = [(name, dates) for (name, _), dates in alike.items() if len(dates) > 1]
    whole = {date for name, dates in copied if not name for date in dates}
    copies: dict[str, list[list[dt.date]]] = defaultdict(list)
    for name, dates in copied:
        if not (name and set(dates) <= whole):
            copies[name].append(dates)
    findings = []
    for name, groups in copies.items():
        first, second, *more = (date for dates in groups for date in dates)
        column = name or "all columns"
        days = {d: {"column": column, "other": str(o[0] if o[0] != d else o[1])} for o in groups for d in o}
        what = f"the same samples of {name}" if name else "the same samples"
        values = {"what": what, "first": str(first), "second": str(second)}
        findings.append(Finding("copy.many" if more else "copy.two", values, days))
    return findings


def _constant(record: Record, min_motion: float) -> list[Finding]:
    """Find flows that do not move all day; without motion of the inflow no delay can be estimated."""
    found = []
    for name, word in (("u_Qi", "inflow"), ("u_Qo", "outflow")):
        if name not in record.flows:
            continue
        columns = {date: day.columns[name] for date, day in record.days.items()}
        days = [d for d, values in columns.items() if np.ptp(values) <= min_motion * np.abs(values).max()]
        if name == "u_Qo":  # a gate may stand still with the inflow, or on a single day
            days = [date for date in days if np.ptp(record.days[date].columns["u_Qi"]) > 0]
            if len(days) < min(max(2, 0.2 * len(columns)), len(columns)):
                continue
        if days:
            flows = [float(columns[date][0]) for date in days]
            values = {"flow": [min(flows), max(flows)]}
            if 1 < len(days) == len(columns):
                found.append(Finding(f"constant.{word}_always", values))
            else:
                found.append(Finding(f"constant.{word}", values, {date: {} for date in days}))
    return found


def _negative(record: Record) -> list[Finding]:
    """Find flows below zero: on average, or at times."""
    found = []
    for name in record.flows:
        flows = {date: day.columns[name] for date, day in record.days.items()}
        below = {date: flow for date, flow in flows.items() if (flow < 0).any()}
        reversed_days = [date for date, flow in below.items() if flow.mean() < 0]
        for code, dates in (("mean", reversed_days), ("some", [d for d in below if d not in reversed_days])):
            if dates:
                days = {date: {"lowest": float(flows[date].min())} for date in dates}
                values = {"column": name, "lowest": min(day["lowest"] for day in days.values())}
                found.append(Finding(f"negative.{code}", values, days))
    return found


def _moments(record: Record) -> list[Finding]:
    """Find commands that are far off for minutes and return: a lost digit, a separator of thousands."""
    longest = int(MOMENT // record.step)
    found = []
    for name in record.flows:
        at = {d: _excursions(day[name], longest) for d, day in record.days.items() if name != record.output}
        days = {d: {"items": [{"time": record.clock(k)} for k in some]} for d, some in at.items() if some}
        if days:
            found.append(Finding("moment", {"column": name}, days))
    return found


def _excursions(flow: Floats, longest: int) -> list[int]:
    """Return where a flow leaves its value for at most so many samples."""
    found: list[int] = []
    for n in range(1, min(longest, len(flow) - 2) + 1):
        before, after = flow[: -n - 1], flow[n + 1 :]
        alike = np.abs(after - before) <= SAME * np.abs(before)
        away = np.min([np.abs(flow[1 + j : len(flow) - n + j] - before) for j in range(n)], axis=0)
        found += (np.flatnonzero(alike & (away > FAR * np.abs(before)) & (before != 0)) + 1).tolist()
    return sorted(set(found))
