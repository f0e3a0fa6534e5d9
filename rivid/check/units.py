"""The level's unit: its moves against the volume that came in, its height against its bed."""

import datetime as dt
from collections.abc import Collection

import numpy as np

from rivid.check.findings import Finding, times
from rivid.check.record import TOLD, Fit, Fits, Record
from rivid.config import UNITS, Config

MARGIN, MARGIN_OF_FEW, FEW = 1.5, 1.25, 5
"""A factor may be off by so much, as no area is known better; by less where there are few days."""
FAR = 4.0
"""How far the area of the balance may be from the declared one [ratio]."""
HEIGHT_MARGIN = 1.1
LEVEL_RANGE = 20.0
"""No forebay moves by more in the record of one reach [m]."""
DEEPEST = 200.0


def factors_of(config: Config, name: str) -> dict[str, float]:
    """How many times too large a column looks, in each unit that it may be in and is not declared to be."""
    known = UNITS["level" if name == "h_L" else "flow"]
    declared = config.input.units.get(name, "m" if name == "h_L" else "m3/s")
    return {unit: known[declared] / factor for unit, factor in known.items() if unit != declared}


def named(ratio: float, factors: dict[str, float], margin: float) -> str:
    """The unit whose factor is nearest, if it is near; or nothing."""
    off = {unit: abs(np.log(ratio / factor)) for unit, factor in factors.items() if ratio > 0}
    unit = min(off, key=off.__getitem__, default="")
    return unit if unit and off[unit] < np.log(margin) else ""


def level(
    record: Record, fits: Fits, config: Config, doubtful: Collection[dt.date], flows_odd: bool
) -> list[Finding]:
    """What is wrong with the level's unit, of all days or of some."""
    if some := _of_some_days(record, config):
        return some
    found = []
    if record.balanced and not flows_odd and 2 * len(doubtful) <= len(record.days):
        found += _against_volume(record, fits, config, doubtful)
    # a spike is the gauge's matter
    low = min(float(np.percentile(day["h_L"], 1)) for day in record.days.values())
    high = max(float(np.percentile(day["h_L"], 99)) for day in record.days.values())
    if high - low > LEVEL_RANGE and not found:
        said = f"h_L moves by {high - low:.4g} m over the record: more than {LEVEL_RANGE:g} m"
        found.append(Finding("unit", f"{said}; check [input.units] h_L and [input] sentinels"))
    return found or _against_bed(record, config)


def _of_some_days(record: Record, config: Config) -> list[Finding]:
    """Days whose level is that of the others in another unit: it lies above a datum."""
    heights = {date: float(np.median(day["h_L"])) for date, day in record.days.items()}
    low, high = min(heights.values()), max(heights.values())
    if low <= 0 or high - low < LEVEL_RANGE:
        return []
    usual = float(np.median(list(heights.values())))
    base = usual if usual < low * HEIGHT_MARGIN else low
    factors = {unit: max(f, 1 / f) for unit, f in factors_of(config, "h_L").items()}
    odd = {date: named(height / base, factors, HEIGHT_MARGIN) for date, height in heights.items()}
    units = {unit for unit in odd.values() if unit}
    if len(units) != 1 or any(not unit and heights[d] > base * HEIGHT_MARGIN for d, unit in odd.items()):
        return []
    (unit,) = units
    days = {date: f"h_L is {heights[date]:.4g} m" for date, there in odd.items() if there}
    one = min(days)
    read_as = config.input.units.get("h_L", "m")
    text = (
        f"h_L is {times(heights[one] / base)} times that of the other days ({heights[one]:.4g} m on {one}): "
        f"is it in {unit} there, and in {read_as} on the others?"
    )
    return [Finding("unit", text, days)]


def _against_bed(record: Record, config: Config) -> list[Finding]:
    bed = record.reach.bed_level
    median = float(np.median([np.median(day["h_L"]) for day in record.days.values()]))
    if bed is None or 0 < median - bed < DEEPEST:
        return []
    units = (
        f' ("{unit}" would make it {median / factor:.4g} m)'
        for unit, factor in factors_of(config, "h_L").items()
        if 0 < median / factor - bed < 5 * record.reach.depth
    )
    said = f"the median of h_L is {median:.4g} m where [reach] bed_level is {bed:g} m"
    return [Finding("unit", f"{said}: check [input.units] h_L and the datum{next(units, '')}")]


def _against_volume(
    record: Record, fits: Fits, config: Config, doubtful: Collection[dt.date]
) -> list[Finding]:
    """How much the level moves for the volume that came in, against [reach] surface_area."""
    fit = fits.without(doubtful)
    if fit.explained < TOLD:
        return []
    declared = record.declared("surface_area")
    area = record.reach.surface_area
    ratio = 0.5 * (fit.gain_in - fit.gain_out) * area
    margin = MARGIN if len(record.days) >= FEW else MARGIN_OF_FEW
    levels, flows = factors_of(config, "h_L"), factors_of(config, "u_Qi")
    if not declared:  # whose area that is nobody knows: only what is far off tells
        levels, flows = ({u: f for u, f in of.items() if max(f, 1 / f) > 10} for of in (levels, flows))
    says = f"{times(ratio)} times as much as" if ratio > 1 else f"{times(1 / ratio)} times less than"
    default = "" if declared else " (not declared: that of Table I)"
    said = f"h_L moves {says} u_Qi and u_Qo let it on [reach] surface_area = {area:g} m2{default}"
    if unit := named(ratio, levels, margin):
        read_as = config.input.units.get("h_L", "m")
        return [Finding("unit", f'{said}: is h_L in {unit}, not in {read_as}? [input.units] h_L = "{unit}"')]
    if unit := named(1 / ratio, flows, margin):
        return [Finding("unit", f"{said}: are both flows in {unit}? Set [input.units], or check the area")]
    if declared and not doubtful and not 1 / FAR < ratio < FAR:
        return [Finding("balance", f"{said}: {area / ratio:.2g} m2 would fit. Check it, and the units")]
    return []


FLOW_MARGIN = 1.2
"""A factor between flows may be off by so much: gains, losses and storage."""
MOVES = 3.0
"""And that between their moves by so much more: a unit scales both, a reservoir does not."""
OPEN = 1.5
"""Inflow and outflow of a balance that does not close [ratio]."""
PART = 0.3
"""Part of the usual inflow that must be missing at least."""
FEWEST, MOST_DAYS = 3, 0.8
"""Days in a row, at least, that a missing part is told of; or the share of all days."""
RANGE_MARGIN = 10.0
"""How far beyond [reach] discharge_range a median is told of [ratio]."""


def units(record: Record, fits: Fits, config: Config, doubtful: Collection[dt.date]) -> list[Finding]:
    """What is wrong with units, as far as the flows and the level tell.

    Parameters
    ----------
    record : Record
    fits : Fits
    config : Config
    doubtful : collection of date
        Days whose columns do not belong together for another reason: their balance says nothing.
    """
    flows = Flows(record, fits.without(doubtful), config)
    found = [*flows.against_each_other(), *flows.against_range()]
    if record.reach.kind == "pool":
        found += level(record, fits, config, doubtful, flows_odd=bool(found))
    return found


class Flows:
    """Discharges against each other and against what is usual.

    Parameters
    ----------
    record : Record
    fit : Fit
        Of all days that can be compared.
    config : Config
    """

    def __init__(self, record: Record, fit: Fit, config: Config) -> None:
        self.record, self.fit, self.config = record, fit, config
        days = record.days
        self.means = {n: {d: float(day[n].mean()) for d, day in days.items()} for n in record.flows}
        self.moves = {n: {d: float(day[n].std()) for d, day in days.items()} for n in record.flows}
        self.median = {n: float(np.median([*of_days.values()])) for n, of_days in self.means.items()}
        self.told: set[str] = set()

    def against_each_other(self) -> list[Finding]:
        """The inflow against another discharge, day by day: another unit, or a part that is missing."""
        return [finding for name in self.record.flows[1:] for finding in self._pair("u_Qi", name)]

    def _pair(self, one: str, other: str) -> list[Finding]:
        groups: dict[tuple[str, str, bool], dict[dt.date, float]] = {}
        stored, usual = self._stored(), self.median[one]
        for date in self.record.days:
            a, b = self.means[one][date], self.means[other][date]
            if a <= 0 or b <= 0:
                continue
            large, small = (one, other) if a > b else (other, one)
            ratio, still = max(a / b, b / a), min(self.moves[n][date] for n in (one, other)) <= 0
            moves = self.moves[large][date] / self.moves[small][date] if not still else 0.0
            unit = named(ratio, factors_of(self.config, large), FLOW_MARGIN)
            unit = unit or named(ratio, self._inverse(small), FLOW_MARGIN)
            if unit and ratio / MOVES < moves < ratio * MOVES:
                groups.setdefault((large, small, True), {})[date] = ratio
            elif ratio > OPEN and not still and abs(a - b - stored.get(date, 0.0)) > PART * usual:
                groups.setdefault((large, small, False), {})[date] = ratio
        found = []
        for (large, small, is_unit), ratios in groups.items():
            dates = list(ratios) if is_unit else self._in_rows(list(ratios))
            if not is_unit and not self._is_open(large, small, dates, stored):
                continue
            ratio = float(np.median([ratios[date] for date in dates]))
            said = f"{large} is {times(ratio)} times {small}"
            text = self._unit_words(large, small, ratio) if is_unit else (
                f"{said}: the water balance does not close; is a part of {small} missing?"
            )  # fmt: skip
            whole = len(dates) == len(self.record.days)
            days = {} if whole else {d: f"{large} is {times(ratios[d])} times {small}" for d in dates}
            found.append(Finding("unit" if is_unit else "balance", text, days))
            self.told |= {large, small}
        return found

    def _inverse(self, name: str) -> dict[str, float]:
        """The factors by which a column looks too small: only where it is declared in another unit."""
        return {unit: 1 / factor for unit, factor in factors_of(self.config, name).items()}

    def _unit_words(self, large: str, small: str, ratio: float) -> str:
        """Which of two flows is in another unit; the level and the usual range may tell."""
        read_as = {name: self.config.input.units.get(name, "m3/s") for name in (large, small)}
        too_large = named(ratio, factors_of(self.config, large), FLOW_MARGIN)
        too_small = named(ratio, self._inverse(small), FLOW_MARGIN)
        if too_large and too_small:  # the nearer one
            large_by, small_by = factors_of(self.config, large)[too_large], self._inverse(small)[too_small]
            if abs(np.log(ratio / large_by)) < abs(np.log(ratio / small_by)):
                too_small = ""
            else:
                too_large = ""
        sound = [name for name in (large, small) if self._is_sound(name)]
        said = f"{large} is {times(ratio)} times {small}"
        if too_large and sound != [large]:
            factor = factors_of(self.config, large)[too_large]
            said += f", and 1 {read_as[large]} is {times(factor)} {too_large}" if factor > 1 else ""
            return f'{said}: is {large} in {too_large}? Set [input.units] {large} = "{too_large}"'
        if too_small:
            return (
                f"{said}: is {small} in {too_small}, not in {read_as[small]} as [input.units] says? "
                f'Set {small} = "{too_small}"'
            )
        return (
            f"{said}, as if {small} had been converted from {too_large} twice: set [input.units] {small}, "
            "or ask where it comes from"
        )

    def _is_sound(self, name: str) -> bool:
        """Whether a flow moves the level as it should, or else lies where flows usually lie."""
        reach = self.record.reach
        if self.record.balanced and self.record.declared("surface_area") and self.fit.explained >= TOLD:
            gain = self.fit.gain_in if name == "u_Qi" else -self.fit.gain_out
            return 1 / FAR < gain * reach.surface_area < FAR
        low, high = reach.discharge_range
        return low / 2 <= self.median[name] <= 2 * high

    def _is_open(self, large: str, small: str, dates: list[dt.date], stored: dict[dt.date, float]) -> bool:
        if not dates:
            return False
        most, least = (sum(self.means[name][date] for date in dates) for name in (large, small))
        change = sum(stored.get(date, 0.0) for date in dates) * (1 if large == "u_Qi" else -1)
        return most - change > OPEN * least

    def _stored(self) -> dict[dt.date, float]:
        """The mean flow that goes into the pool's level, day by day [m3/s]."""
        if self.record.reach.kind != "pool":
            return {}
        area = self.record.reach.surface_area
        if self.record.balanced and self.fit.explained >= TOLD:
            area = 2.0 / (self.fit.gain_in - self.fit.gain_out)
        spans = {date: len(day) * self.record.step for date, day in self.record.days.items()}
        levels = ((date, day["h_L"]) for date, day in self.record.days.items())
        return {date: area * float(level[-1] - level[0]) / spans[date] for date, level in levels}

    def _in_rows(self, dates: list[dt.date]) -> list[dt.date]:
        """Those dates that stand in rows of days, or are most of the record: one odd day is weather."""
        order = {date: k for k, date in enumerate(self.record.days)}
        if len(dates) >= MOST_DAYS * len(order):
            return dates
        rows: list[list[dt.date]] = []
        for date in dates:
            if rows and order[date] - order[rows[-1][-1]] == 1:
                rows[-1].append(date)
            else:
                rows.append([date])
        return [date for row in rows if len(row) >= FEWEST for date in row]

    def against_range(self) -> list[Finding]:
        """Discharges far from [reach] discharge_range."""
        low, high = self.record.reach.discharge_range
        by_default = "" if self.record.declared("discharge_range") else " (not declared: that of Table I)"
        far: dict[str, list[str]] = {}
        for name in self.record.flows:
            flow = self.median[name]
            if name in self.told or low / RANGE_MARGIN <= abs(flow) <= high * RANGE_MARGIN:
                continue
            fitting = [u for u, f in factors_of(self.config, name).items() if low <= flow / f <= high]
            far.setdefault(fitting[0] if fitting else "", []).append(name)
        found = []
        for unit, names in far.items():
            medians = " and ".join(f"{name} is {self.median[name]:.4g} m3/s" for name in names)
            said = f"the median of {medians}, far outside [reach] discharge_range, {low:g} to {high:g}"
            advice = "check [input.units]"
            if unit:
                inside = [f"{self.median[n] / factors_of(self.config, n)[unit]:.4g}" for n in names]
                advice += f' ("{unit}" would make it {" and ".join(inside)} m3/s)'
            found.append(Finding("unit", f"{said}{by_default}: {advice}"))
        return found
