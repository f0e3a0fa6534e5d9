"""Units of the flows, and the water balance: inflow against outflow, both against [reach]."""

import datetime as dt
from collections.abc import Collection

import numpy as np

from rivid.check.findings import Finding, times
from rivid.check.fit import Fit
from rivid.check.fits import TOLD, Fits
from rivid.check.record import Record
from rivid.check.volume import FAR, factors_of, level, named
from rivid.config import Config

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
