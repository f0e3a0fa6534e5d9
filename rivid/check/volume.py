"""The level's unit: its moves against the volume that came in, its height against its bed."""

import datetime as dt
from collections.abc import Collection

import numpy as np

from rivid.check.findings import Finding, times
from rivid.check.fits import TOLD, Fits
from rivid.check.record import Record
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
