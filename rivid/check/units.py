"""Units and the water balance: the flows against each other, the level against their volume."""

import datetime as dt
from collections import defaultdict
from collections.abc import Collection

import numpy as np

from rivid.check.findings import Finding
from rivid.check.record import BELIEVED, Fit, Fits, Record, consecutive
from rivid.config import Config
from rivid.input_config import UNITS

# Flows
RARE = ("m3/min", "MGD")  # units that are not suggested: their factors are within twice that of another
FLOW_MARGIN = 1.2  # tolerance of a unit's factor between two flows [ratio]: gains, losses and storage
MOVES = 3.0  # tolerance between the ratios of means and of moves: a unit scales both, a reservoir does not
OPEN = 1.5  # smallest ratio of inflow and outflow of an open balance
PART = 0.3  # smallest missing part of the usual inflow [-]
# fewest consecutive days of a missing part, or smallest share of all days: one odd day is weather
FEWEST, MOST_DAYS = 3, 0.8
# smallest ratio of a median flow to the ends of [reach] discharge_range that suggests another unit
RANGE_MARGIN = 10.0
OUTSIDE = 0.25  # smallest share of the inflow's samples outside [reach] discharge_range that is reported [-]

# Level
# tolerance of a unit's factor in the level [ratio], as areas are uncertain; smaller below FEW days
AREA_MARGIN, AREA_MARGIN_OF_FEW, FEW = 1.5, 1.25, 5
# smallest ratio between two areas, of the balance, of length and width or declared, that is reported
FAR = 4.0
# smallest explained share of days that are compared with others: by chance it is below 0.11 on a single day
COMPARED = 0.2
HEIGHT_MARGIN = 1.1  # tolerance of a unit's factor between the heights of days [ratio]
LEVEL_SPAN = 20.0  # largest motion of a forebay in the record [m]
DEEPEST = 200.0  # largest depth of a forebay [m]


def units(record: Record, fits: Fits, config: Config, doubtful: Collection[dt.date]) -> list[Finding]:
    """Find wrong units and open balances; `doubtful` days have another fault and are not balanced."""
    if record.balanced and (found := _flows_of_some_days(record, fits, config, doubtful)):
        return found  # what compares all days follows from it
    flows = Flows(record, fits.without(doubtful), config)
    found = [finding for name in record.flows[1:] for finding in flows.against_inflow(name)]
    found += flows.against_range()
    if record.reach.kind == "pool":
        found += _level(record, fits, config, doubtful, flows_odd=bool(found))
    return found or flows.outside_range()


def _factors(config: Config, name: str) -> dict[str, float]:
    """Return the factor by which a column is too large if it is in another unit than the declared one."""
    known, declared = UNITS[name], config.input.unit(name)
    return {u: known[declared] / factor for u, factor in known.items() if u not in (declared, *RARE)}


def _nearest(ratio: float, factors: dict[str, float], margin: float) -> tuple[float, str]:
    """Return how far off the nearest factor is [log] and its unit; infinity and "" beyond the margin."""
    off = ((abs(float(np.log(ratio / factor))), unit) for unit, factor in factors.items() if ratio > 0)
    return min((one for one in off if one[0] < np.log(margin)), default=(np.inf, ""))


class Flows:
    """Discharges against each other and against [reach]; `fit` is that of all days that are balanced."""

    def __init__(self, record: Record, fit: Fit, config: Config) -> None:
        self.record, self.fit = record, fit
        days, names = record.days, record.flows
        self.means = {n: {d: float(day[n].mean()) for d, day in days.items()} for n in names}
        self.moves = {n: {d: float(day[n].std()) for d, day in days.items()} for n in names}
        self.median = {n: float(np.median([*of_days.values()])) for n, of_days in self.means.items()}
        self.config = config
        self.too_large = {n: _factors(config, n) for n in names}
        low, high = record.reach.discharge_range
        self.range = {"low": low, "high": high, "is_declared": record.declared("discharge_range")}
        self.reported: set[str] = set()

    def against_inflow(self, other: str) -> list[Finding]:
        """Compare the inflow with another discharge, day by day: another unit, or a missing part."""
        one = "u_Qi"
        groups: dict[tuple[str, str, bool], dict[dt.date, float]] = defaultdict(dict)
        stored, usual = self._stored(), self.median[one]
        for date in self.record.days:
            a, b = self.means[one][date], self.means[other][date]
            if a <= 0 or b <= 0:
                continue
            large, small = (one, other) if a > b else (other, one)
            ratio, still = max(a / b, b / a), min(self.moves[n][date] for n in (one, other)) <= 0
            moves = self.moves[large][date] / self.moves[small][date] if not still else 0.0
            unit = any(unit for _, unit in self._units(large, small, ratio))
            if unit and ratio / MOVES < moves < ratio * MOVES:
                groups[large, small, True][date] = ratio
            elif ratio > OPEN and not still and abs(a - b - stored.get(date, 0.0)) > PART * usual:
                groups[large, small, False][date] = ratio
        found = []
        for (large, small, is_unit), ratios in groups.items():
            dates = list(ratios) if is_unit else self._in_rows(list(ratios))
            if not is_unit and not self._is_open(large, small, dates, stored):
                continue
            ratio = float(np.median([ratios[date] for date in dates]))
            code, more = self._which_unit(large, small, ratio) if is_unit else ("balance.flows", {})
            values = {"large": large, "small": small, "ratio": ratio, **more}
            days = {d: {"ratio": ratios[d]} for d in dates} if len(dates) < len(self.record.days) else {}
            found.append(Finding(code, values, days))
            self.reported |= {large, small}
        return found

    def _units(self, large: str, small: str, ratio: float) -> list[tuple[float, str]]:
        """Return the units that the larger flow may be in, and the smaller one, as :func:`_nearest` does."""
        factors = (self.too_large[large], {unit: 1 / f for unit, f in self.too_large[small].items()})
        return [_nearest(ratio, of_flow, FLOW_MARGIN) for of_flow in factors]

    def _which_unit(self, large: str, small: str, ratio: float) -> tuple[str, dict[str, str | float]]:
        """Return which of two flows is in another unit, by the level or the usual range."""
        (off_large, of_large), (off_small, of_small) = self._units(large, small, ratio)
        of_large, of_small = (of_large, "") if off_large < off_small else ("", of_small)  # the nearer one
        sound, declared = [name for name in (large, small) if self._is_sound(name)], self.config.input.unit
        if of_large and sound != [large]:
            factor = self.too_large[large][of_large]
            return "unit.factor", {"unit": of_large, "declared": declared(large), "factor": factor}
        if of_small:
            return "unit.declared", {"unit": of_small, "declared": declared(small)}
        return "unit.twice", {"unit": of_large}

    def _is_sound(self, name: str) -> bool:
        """Return whether a flow moves the level as it should, or else lies in the usual range."""
        area, declared = self.record.area
        if self.record.balanced and declared and self.fit.explained >= BELIEVED:
            gain = self.fit.gain_in if name == "u_Qi" else -self.fit.gain_out
            return 1 / FAR < gain * area < FAR
        low, high = self.record.reach.discharge_range
        return low / 2 <= self.median[name] <= 2 * high

    def _is_open(self, large: str, small: str, dates: list[dt.date], stored: dict[dt.date, float]) -> bool:
        most, least = (sum(self.means[name][date] for date in dates) for name in (large, small))
        change = sum(stored.get(date, 0.0) for date in dates) * (1 if large == "u_Qi" else -1)
        return most - change > OPEN * least

    def _stored(self) -> dict[dt.date, float]:
        """Return the mean flow into the pool's storage, day by day [m3/s]."""
        if self.record.reach.kind != "pool":
            return {}
        area, _ = self.record.area
        if self.record.balanced and self.fit.explained >= BELIEVED:
            area = 2.0 / (self.fit.gain_in - self.fit.gain_out)
        levels = {date: day["h_L"] for date, day in self.record.days.items()}
        return {d: area * float(h[-1] - h[0]) / (len(h) * self.record.step) for d, h in levels.items()}

    def _in_rows(self, dates: list[dt.date]) -> list[dt.date]:
        """Return the dates that are consecutive days, or all of them if they are most of the record."""
        if len(dates) >= MOST_DAYS * len(self.record.days):
            return dates
        return [d for row in consecutive(dates, self.record.days) if len(row) >= FEWEST for d in row]

    def against_range(self) -> list[Finding]:
        """Find discharges far from [reach] discharge_range, on most days or in another unit on some."""
        low, high = self.record.reach.discharge_range
        least, most = low / RANGE_MARGIN, high * RANGE_MARGIN
        far: dict[str, list[dict[str, str | float]]] = defaultdict(list)
        dates: dict[str, set[dt.date]] = defaultdict(set)
        also: dict[str, list[str]] = {}
        for name, means in self.means.items():
            there = {d: q for d, q in means.items() if not least <= abs(q) <= most}
            flow = float(np.median([*there.values()])) if there else 0.0
            fitting = {u: flow / f for u, f in self.too_large[name].items() if low <= flow / f <= high}
            unit = next(iter(fitting), "")
            # reaches run dry, but no flood is far above a declared range
            some = bool(unit) and flow > high and bool(self.range["is_declared"])
            if not there or name in self.reported or not (some or 2 * len(there) > len(means)):
                continue
            converted: dict[str, str | float] = {"converted": fitting[unit]} if unit else {}
            far[unit].append({"column": name, "median": flow, **converted})
            dates[unit] |= there.keys()
            also[unit] = [u for u in fitting if u != unit and u in also.get(unit, fitting)]
            if unit:  # on days of less flow, too
                factor = self.too_large[name][unit]
                dates[unit] |= {d for d, q in means.items() if q > high and low <= q / factor <= high}
        found = []
        for unit, flows in far.items():
            days = sorted(dates[unit]) if len(dates[unit]) < len(self.record.days) else []
            values = self.range | {"flows": flows, "unit": unit, "also": also[unit]}
            code = "unit.range_unit" if unit else "unit.range"
            found.append(Finding(code, values, {date: {} for date in days}))
        return found

    def outside_range(self) -> list[Finding]:
        """Find an inflow outside [reach] discharge_range, which the travel-time bounds are computed for."""
        low, high = self.record.reach.discharge_range
        flow = np.concatenate([day["u_Qi"] for day in self.record.days.values()])
        share = float(((flow < low) | (flow > high)).mean())
        if share <= OUTSIDE:
            return []
        values = {"column": "u_Qi", "share": share, "lowest": float(flow.min()), "highest": float(flow.max())}
        return [Finding("range", self.range | values)]


def _flows_of_some_days(
    record: Record, fits: Fits, config: Config, doubtful: Collection[dt.date]
) -> list[Finding]:
    """Find days with both flows in another unit than on the others: the level moves by their volume."""
    mean = {d: float(day["u_Qi"].mean()) for d, day in record.days.items() if d not in doubtful}
    ordered = sorted((date for date, flow in mean.items() if flow > 0), key=lambda date: mean[date])
    for k in range(1, len(ordered)):
        if mean[ordered[k]] <= MOVES * mean[ordered[k - 1]]:
            continue
        groups = ordered[:k], ordered[k:]
        each = [fits.of(dates)[0] for dates in groups]
        if min(fit.explained for fit in each) < COMPARED:
            continue
        gains = [0.5 * (fit.gain_in - fit.gain_out) for fit in each]
        odd = int(np.argmax(np.abs(np.log(np.array(gains) * record.area[0]))))
        ratio = gains[1 - odd] / gains[odd]
        if unit := _nearest(ratio, _factors(config, "u_Qi"), AREA_MARGIN)[1]:
            values = {"ratio": ratio, "unit": unit, "declared": config.input.unit("u_Qi")}
            return [Finding("unit.flows_days", values, {date: {} for date in sorted(groups[odd])})]
    return []


def _level(
    record: Record, fits: Fits, config: Config, doubtful: Collection[dt.date], flows_odd: bool
) -> list[Finding]:
    """Find a wrong unit of the level, on all days or on some."""
    if some := _level_of_some_days(record, config):
        return some
    found = _against_itself(record)
    if record.balanced and not flows_odd and 2 * len(doubtful) <= len(record.days):
        found += _against_volume(record, fits, config, doubtful)
    # percentiles: spikes are findings of the gauge
    low = min(float(np.percentile(day["h_L"], 1)) for day in record.days.values())
    high = max(float(np.percentile(day["h_L"], 99)) for day in record.days.values())
    if high - low > LEVEL_SPAN and not found:
        found.append(Finding("unit.level_span", {"span": high - low, "limit": LEVEL_SPAN}))
    return found or _against_bed(record, config)


def _level_of_some_days(record: Record, config: Config) -> list[Finding]:
    """Find days with the level in another unit than on the others: it is measured above a datum."""
    heights = {date: float(np.median(day["h_L"])) for date, day in record.days.items()}
    low, high = min(heights.values()), max(heights.values())
    if low <= 0 or high - low < LEVEL_SPAN:
        return []
    usual = float(np.median(list(heights.values())))
    base = usual if usual < low * HEIGHT_MARGIN else low
    factors = {unit: max(f, 1 / f) for unit, f in _factors(config, "h_L").items()}
    odd = {date: _nearest(height / base, factors, HEIGHT_MARGIN)[1] for date, height in heights.items()}
    units = {unit for unit in odd.values() if unit}
    if len(units) != 1 or any(not unit and heights[d] > base * HEIGHT_MARGIN for d, unit in odd.items()):
        return []
    days = {date: {"height": heights[date]} for date, there in odd.items() if there}
    first = min(days)
    values = {
        "ratio": heights[first] / base, "height": heights[first], "date": str(first),
        "unit": units.pop(), "declared": config.input.unit("h_L"),
    }  # fmt: skip
    return [Finding("unit.level_days", values, days)]


def _against_itself(record: Record) -> list[Finding]:
    """Find a length, a width and a surface that are not of one reach."""
    area, product = record.reach.surface_area, record.reach.length * record.reach.width
    declared = all(record.declared(key) for key in ("surface_area", "length", "width"))
    odd = declared and not 1 / FAR < area / product < FAR
    return [Finding("reach.area", {"area": area, "product": product})] if odd else []


def _against_bed(record: Record, config: Config) -> list[Finding]:
    """Find a level below the bed or too far above it."""
    bed = record.reach.bed_level
    median = float(np.median([np.median(day["h_L"]) for day in record.days.values()]))
    if bed is None or 0 < median - bed < DEEPEST:
        return []
    values: dict[str, str | float] = {"median": median, "bed": bed}
    for unit, factor in _factors(config, "h_L").items():
        if 0 < median / factor - bed < 5 * record.reach.depth:
            return [Finding("unit.bed_unit", values | {"unit": unit, "converted": median / factor})]
    return [Finding("unit.bed", values)]


def _against_volume(
    record: Record, fits: Fits, config: Config, doubtful: Collection[dt.date]
) -> list[Finding]:
    """Compare the level's moves with the volume that came in, by the area that [reach] declares."""
    fit = fits.without(doubtful)
    area, declared = record.area
    if fit.explained < BELIEVED:
        missed = fits.volume() / area if declared and not doubtful and fit.explained < COMPARED else 0.0
        return (
            [Finding("balance.level", {"ratio": missed, "area": area, "area_of": declared})]
            if missed > FAR
            else []
        )
    ratio = 0.5 * (fit.gain_in - fit.gain_out) * area
    margin = AREA_MARGIN if len(record.days) >= FEW else AREA_MARGIN_OF_FEW
    levels, flows = _factors(config, "h_L"), _factors(config, "u_Qi")
    if not declared:  # the area of Table I is another reach's: only large factors are significant
        levels, flows = ({u: f for u, f in of.items() if max(f, 1 / f) > 10} for of in (levels, flows))
    values: dict[str, object] = {
        "ratio": ratio, "area": area, "area_of": declared or "surface_area", "is_declared": bool(declared)
    }  # fmt: skip
    if unit := _nearest(ratio, levels, margin)[1]:
        return [Finding("unit.level", values | {"unit": unit, "declared": config.input.unit("h_L")})]
    if unit := _nearest(1 / ratio, flows, margin)[1]:
        return [Finding("unit.flows", values | {"unit": unit})]
    if declared and not doubtful and not 1 / FAR < ratio < FAR:
        return [Finding("balance.area", values | {"fitting_area": area / ratio})]
    return []
