"""Numbers, names and times of a diagnosis as people write them."""

import datetime as dt
import math
from collections.abc import Sequence

from rivid.diagnosis.result import Estimate, Gap, Where
from rivid.plots.words import count, day_range


def name_words(name: str) -> str:
    """A name as people write it.

    Examples
    --------
    >>> name_words("diurnal_inflow")
    'diurnal inflow'
    """
    return printable(name.replace("_", " ")).strip() or "an effect without a name"


def printable(text: str) -> str:
    """The text on one line, without characters that steer a terminal."""
    return " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())


def capital(text: str) -> str:
    """The text with a capital letter in front; nothing else changes."""
    return text[:1].upper() + text[1:]


def unit_words(unit: str) -> str:
    """A unit behind a number: nothing for a share, and exponents as people print them."""
    return "" if unit == "-" else f" {unit.replace('m3', 'm³').replace('m2', 'm²')}"


def _decimals(spread: float, value: float) -> int:
    """Decimals that show the spread to within a tenth or so; three digits where there is no spread."""
    if math.isfinite(spread) and spread > 0:
        return max(0, -math.floor(math.log10(spread / 3.0)))
    return max(0, 2 - math.floor(math.log10(abs(value)))) if value else 1


def _fixed(value: float, decimals: int) -> str:
    if value != 0 and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.2e}"
    text = f"{value:,.{min(decimals, 8)}f}"
    return text.removeprefix("-") if float(text.replace(",", "")) == 0 else text


def estimate_words(e: Estimate) -> str:
    """A size with its unit and 95 % interval, no more digits than the interval allows.

    Examples
    --------
    >>> estimate_words(Estimate("amplitude", 6.0412, "m3/s", 5.83, 6.25))
    '6.04 m³/s (5.83 to 6.25)'
    >>> estimate_words(Estimate("place", 0.5, "-", math.nan, math.nan))
    '0.500 (no interval)'
    """
    if not math.isfinite(e.value):
        return "no value"
    half = (e.high - e.low) / 2
    known = math.isfinite(e.low) and math.isfinite(e.high)
    decimals = _decimals(half if known else math.nan, e.value)
    interval = f"{_fixed(e.low, decimals)} to {_fixed(e.high, decimals)}" if known else "no interval"
    if known and e.low == e.high:
        interval = "held fixed"
    return f"{_fixed(e.value, decimals)}{unit_words(e.unit)} ({interval})"


def aside(e: Estimate, first_day: dt.date | None = None) -> str:
    """A value once more as people say it: per cent, minutes, a time of day or a date; often nothing.

    Examples
    --------
    >>> aside(Estimate("error", -0.1, "-", -0.11, -0.09)), aside(Estimate("offset", 532.0, "s", 520, 544))
    ('-10.0 %', '8.9 min')
    >>> aside(Estimate("start", 30.5, "h", 30, 31), dt.date(2024, 5, 1))
    '2024-05-02 06:30'
    """
    if not math.isfinite(e.value):
        return ""
    name = e.name.split("[")[0]
    if e.unit == "-" and name == "error":
        return f"{100 * e.value:+.1f} %"
    if e.unit == "s" and abs(e.value) >= 120:
        return f"{e.value / 60:.1f} min"
    if e.unit == "h" and name == "hour":
        return clock(e.value % 24.0)
    if e.unit == "h" and name in ("start", "starts") and first_day is not None:
        days, hour = divmod(e.value, 24.0)
        return f"{first_day + dt.timedelta(days=int(days))} {clock(hour)}"
    return ""


def clock(hour: float) -> str:
    """An hour of the day.

    Examples
    --------
    >>> clock(6.5), clock(24.0)
    ('06:30', '24:00')
    """
    minutes = round(hour * 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


def when_words(where: Where) -> str:
    """When something acts.

    Examples
    --------
    >>> when_words(Where()), when_words(Where(hours=(22, 6), regime="at low flow"))
    ('on all days, at all hours', 'from 22:00 to 06:00, at low flow')
    """
    parts = []
    if where.dates is not None:
        first, last = where.dates
        parts.append(f"on {first}" if first == last else f"from {day_range(first, last)}")
    if where.hours is not None:
        parts.append(f"from {clock(where.hours[0])} to {clock(where.hours[1])}")
    if where.regime:
        parts.append(printable(where.regime))
    return ", ".join(parts) or "on all days, at all hours"


def probability(p: float) -> str:
    """A p-value, never as zero.

    Examples
    --------
    >>> probability(0.0002), probability(0.0), probability(0.0123)
    ('p = 0.0002', 'p < 0.0001', 'p = 0.012')
    """
    if not math.isfinite(p):
        return "p unknown"
    return f"p = {p:.2g}" if p >= 1e-4 else "p < 0.0001"


def scale_of(gap: Gap) -> tuple[float, str]:
    """Factor and unit in which the errors of a gap are told: mm for a level, m3/s for a discharge."""
    return (1000.0, "mm") if gap.unit == "m" else (1.0, "m³/s")


def error_words(value: float, factor: float = 1.0) -> str:
    """An error to three digits or fewer; a dash where nothing could be judged.

    Examples
    --------
    >>> error_words(0.1234, 1000), error_words(0.0043, 1000), error_words(math.nan)
    ('123', '4.3', '–')
    """
    if not math.isfinite(value):
        return "–"
    scaled = value * factor
    return f"{scaled:,.0f}" if scaled >= 19.95 else f"{scaled:.1f}" if scaled >= 0.95 else f"{scaled:.2g}"


def hours_words(hours: float) -> str:
    """A horizon: an hour, four hours, a day.

    Examples
    --------
    >>> hours_words(1.0), hours_words(4.0), hours_words(24.0), hours_words(2.5)
    ('an hour', 'four hours', 'a day', '2.5 hours')
    """
    return {1.0: "an hour", 4.0: "four hours", 24.0: "a day"}.get(hours, f"{hours:g} hours")


def period_words(seconds: float) -> str:
    """A period in minutes, hours or days.

    Examples
    --------
    >>> period_words(2700), period_words(43200), period_words(604800)
    ('45 min', '12 h', '7 days')
    """
    for limit, unit, size in ((7200.0, "min", 60.0), (172_800.0, "h", 3600.0)):
        if seconds < limit:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 86_400.0:.3g} days"


def closed_words(share: float) -> str:
    """A share of the gap that is closed.

    Examples
    --------
    >>> closed_words(0.974), closed_words(-0.2), closed_words(0.999)
    ('97 % of the gap is closed', 'the gap has not become smaller', '99.9 % of the gap is closed')
    """
    if share <= 0.005:
        return "the gap has not become smaller"
    if 0.995 <= share < 1.0:
        return f"{min(100 * share, 99.9):.1f} % of the gap is closed"
    return f"{100 * min(share, 1.0):.0f} % of the gap is closed"


def period(dates: Sequence[dt.date]) -> str:
    """The days of a record."""
    return f"{count(len(dates), 'day')}, {day_range(dates[0], dates[-1])}" if dates else "no days"
