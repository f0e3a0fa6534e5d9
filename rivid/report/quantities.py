"""Numbers, names, dates and hours of a diagnosis as text, for its page, figures and terminal summary."""

import datetime as dt
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from rivid.diagnosis.result import Diagnosis, Estimate, Gap, NamedEffect, Ranked, Where
from rivid.text import day_range, listed, shown_in
from rivid.types import DAY, HOUR

NOT_A_SIZE = {"hour", "place", "start", "starts", "duration", "rise", "recession", "per_day", "per_month"}
"""Parameters that give a time or a place; the headline states the first of the others."""


MOST_NAMES = 4  # explanations with a name in a ranking; a model holds as many effects at most


UNITS = re.compile(r"(?<=\d) (?=(?:%|m³/s|mm|min|h|s|samples?|days?)(?!\w))")  # between a number and its unit


class Explanation(NamedTuple):
    """A row of the ranking."""

    kind: str  # "named", "unknown" or "nothing"
    words: str
    probability: float
    material: bool


class Errors(NamedTuple):
    """Errors of a simulation at each horizon, on the sealed and, where known, on the open days."""

    kind: str  # "baseline", "step", "described" (events timed on the day itself) or "floor"
    name: str
    sealed: Sequence[float]
    open: Sequence[float] | None = None


def printable(text: str) -> str:
    """Return the text on one line, without control characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())


def name(code: str) -> str:
    """Return the name of an effect in words."""
    return printable(code.replace("_", " ")) or "an effect without a name"


def tight(text: str) -> str:
    """Return the text with no-break spaces between numbers and units, and m³/s as pages write it."""
    return UNITS.sub("\u00a0", text.replace("m3/s", "m³/s"))


def _decimals(spread: float, value: float) -> int:
    """Decimals that resolve a third of the spread; without a spread, three significant digits."""
    if math.isfinite(spread) and spread > 0:
        return max(0, -math.floor(math.log10(spread / 3.0)))
    return max(0, 2 - math.floor(math.log10(abs(value)))) if value else 1


def _fixed(value: float, decimals: int) -> str:
    if value != 0 and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.2e}"
    return f"{value:z,.{min(decimals, 8)}f}"  # z: no minus sign before a zero


def estimate(e: Estimate) -> str:
    """Return a value with its unit and 95 % interval, to the digits that the interval supports."""
    if not math.isfinite(e.value):
        return "no value"
    known = math.isfinite(e.low) and math.isfinite(e.high)
    decimals = _decimals((e.high - e.low) / 2 if known else math.nan, e.value)
    interval = f"{_fixed(e.low, decimals)} to {_fixed(e.high, decimals)}" if known else "no interval"
    if known and e.low == e.high:
        interval = "held fixed"
    unit = "" if e.unit == "-" else f" {e.unit.replace('m3', 'm³').replace('m2', 'm²')}"
    return f"{_fixed(e.value, decimals)}{unit} ({interval})"


def size(effect: NamedEffect, brief: bool = False) -> str:
    """Return the main parameter of an effect, or the range of one that varies; empty without parameters."""
    sizes = [p for p in effect.parameters if p.name.split("[")[0] not in NOT_A_SIZE] or effect.parameters
    if not sizes:
        return ""
    base = sizes[0].name.split("[")[0]
    values = [p.value for p in effect.parameters if p.name.startswith(f"{base}[")]
    if len(values) < 2:
        text = estimate(sizes[0])
        return text.partition(" (")[0] if brief else f"{base.replace('_', ' ')} {text}"
    low, high = (estimate(replace(sizes[0], value=v, low=v, high=v)) for v in (min(values), max(values)))
    text = f"{low.partition(' ')[0]} to {high.partition(' (')[0]}"
    return text if brief else f"{base.replace('_', ' ')} from {text}"


def converted(e: Estimate, first_day: dt.date | None = None) -> str:
    """Return a value in a second form: per cent, minutes, a time of day, a date; empty where none applies."""
    base = e.name.split("[")[0]
    if not math.isfinite(e.value):
        return ""
    if e.unit == "-" and base == "error":
        return f"{100 * e.value:+.1f} %"
    if e.unit == "s" and abs(e.value) >= 120:
        return f"{e.value / 60:.1f} min"
    if e.unit == "h" and base == "hour":
        return clock(e.value % 24.0)
    if e.unit == "h" and base in ("start", "starts") and first_day is not None:
        days, hour = divmod(e.value, 24.0)
        return f"{first_day + dt.timedelta(days=int(days))} {clock(hour)}"
    return ""


def clock(hour: float) -> str:
    """Return an hour of the day as HH:MM."""
    minutes = round(hour * 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


def when(where: Where) -> str:
    """Return dates, hours and regime of an effect."""
    parts = []
    if where.dates is not None:
        parts.append(f"{'on' if where.dates[0] == where.dates[1] else 'from'} {day_range(*where.dates)}")
    if where.hours is not None:
        parts.append(f"from {clock(where.hours[0])} to {clock(where.hours[1])}")
    if where.regime:
        parts.append(printable(where.regime))
    return ", ".join(parts) or "on all days, at all hours"


def p_value(p: float) -> str:
    """Return a p-value, never as zero."""
    if not math.isfinite(p):
        return "p unknown"
    return f"p = {p:.2g}" if p >= 1e-4 else "p < 0.0001"


def error(value: float | None, factor: float = 1.0) -> str:
    """Return an error to three digits or fewer; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    scaled = value * factor
    return f"{scaled:,.0f}" if scaled >= 19.95 else f"{scaled:.1f}" if scaled >= 0.95 else f"{scaled:.2g}"


def period(seconds: float) -> str:
    """Return a duration in minutes, hours or days, to three digits."""
    if seconds < 7200.0:
        return f"{seconds / 60.0:.3g} min"
    return f"{seconds / HOUR:.3g} h" if seconds < 2 * DAY else f"{seconds / DAY:.3g} days"


def closed(share: float) -> str:
    """Return the share of the gap that is closed: 100 % only where it is exactly that."""
    if share <= 0.005:
        return "the gap is not smaller"
    if 0.995 <= share < 1.0:
        return f"{min(100 * share, 99.9):.1f} % of the gap is closed"
    return f"{100 * min(share, 1.0):.0f} % of the gap is closed"


def scale(gap: Gap) -> tuple[float, str]:
    """Return factor and unit of the errors of a gap: mm for a level, m³/s for a discharge."""
    factor, unit = shown_in(gap.unit)
    return factor, unit.replace("m3", "m³")


def as_shown(diagnosis: Diagnosis) -> Diagnosis:
    """Return the diagnosis with the sizes of its effects in the units of pages; diagnosis.json is in SI."""
    river = diagnosis.gap is not None and diagnosis.gap.unit != "m"

    def sized(e: Estimate) -> Estimate:
        factor, unit = shown_in(e.unit, river)
        return replace(e, unit=unit, value=factor * e.value, low=factor * e.low, high=factor * e.high)

    effects = (replace(f, parameters=tuple(map(sized, f.parameters))) for f in diagnosis.effects)
    return replace(diagnosis, effects=tuple(effects))


def gap_rows(gap: Gap) -> list[Errors]:
    """Return the simulations of a gap in their order, with errors in the unit of :func:`scale`."""
    factor, _ = scale(gap)
    rows = [Errors("baseline", "without any effect", gap.rmse_baseline, gap.rmse_open_baseline)]
    for i, step in enumerate(gap.steps, start=1):
        known = gap.rmse_open_augmented if i == len(gap.steps) else None
        rows.append(Errors("step", f"+ {name(step.added)}", step.rmse, known))
        if step.rmse_described is not None:
            rows.append(Errors("described", "events timed on the day", step.rmse_described))
    if gap.rmse_floor is not None:
        rows.append(Errors("floor", "weather and gauge alone", gap.rmse_floor))
    return [
        Errors(kind, words, [factor * e for e in sealed], known and [factor * e for e in known])
        for kind, words, sealed, known in rows
    ]


def percent(share: float) -> str:
    """Return a share, which may be negative, in per cent."""
    return f"{round(100 * share)} %" if math.isfinite(share) else "–"


def explanation(names: Sequence[str], unknown: str | None) -> str:
    """Return an explanation in words."""
    latent = {
        "flow": "an unknown flow or delay",
        "gauge": "an unknown gauge error",
        "dynamics": "unknown dynamics",
    }
    return listed([*map(name, names), *([latent[unknown]] if unknown else [])]) or "nothing missing"


def explanations(ranking: Sequence[Ranked], verdict: str) -> tuple[list[Explanation], int, float]:
    """Return the rows of a ranking, the number of explanations left out, and their joint probability.

    "Nothing missing" and those without any name are always among the rows. If the verdict is that something
    unknown is missing, as the error exceeds the fitted noise, "nothing missing" is "no known effect".
    """
    rows = [
        Explanation(
            "named" if one.names else "unknown" if one.unknown else "nothing",
            "no known effect" if verdict == "unknown" and not (one.names or one.unknown)
            else explanation(one.names, one.unknown),
            one.probability, one.material,
        )
        for one in sorted(ranking, key=lambda one: -one.probability)
    ]  # fmt: skip
    named = [row for row in rows if row.kind == "named"]
    left = named[MOST_NAMES:]
    return [row for row in rows if row not in left], len(left), sum(row.probability for row in left)
