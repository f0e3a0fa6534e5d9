"""Formats of numbers: delays in samples and minutes or hours, shares, dates, counts.

Shared by figures, pages and the terminal; imports nothing heavy.
"""

import datetime as dt
import math
from collections.abc import Sequence
from itertools import pairwise

HOURS_FROM = 7200
"""Durations from here on [s] are given in hours."""

NO_ANSWER = ("failed", "unidentifiable", "pending")
"""Statuses of days without an answer, the gravest first."""


def count(n: int, noun: str, plural: str | None = None) -> str:
    """A counted noun, such as "1 day" or "1,332 days"."""
    return f"{n:,} {noun if n == 1 else plural or noun + 's'}"


def shown_in(unit: str, river: bool = False) -> tuple[float, str]:
    """Factor and unit of a size on pages: those of a level are in mm, as its errors are."""
    if unit == "m or m3/s":
        unit = "m3/s" if river else "m"
    return (1000.0, f"m{unit}") if unit in ("m", "m/day") else (1.0, unit)


def listed(parts: Sequence[str], last: str = "and") -> str:
    """Words joined as in a sentence, such as "a, b and c"."""
    if len(parts) < 2:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def number(value: float) -> str:
    """A number without needless decimals: up to one above 1, two digits below."""
    if not math.isfinite(value):
        return "-"
    if value != 0 and abs(value) < 1:
        return f"{value:.2g}"
    return f"{value:.1f}".removesuffix(".0")


def time_unit(longest: float) -> tuple[str, int]:
    """The unit for durations of up to `longest` seconds, and its seconds: minutes below two hours."""
    return ("hours", 3600) if longest >= HOURS_FROM else ("minutes", 60)


def _spelt(seconds: Sequence[float]) -> tuple[list[str], str]:
    """Durations [s] in one unit, and the unit: hours where all are long, seconds where all are brief."""
    if max(seconds) < 20:
        return [f"{s:.3g}" for s in seconds], "s"
    unit, size = ("min", 60) if min(seconds) < HOURS_FROM else ("h", 3600)
    values = [s / size for s in seconds]  # no decimal from 100 on
    return [f"{v:.{0 if v >= 100 else 1}f}" if v >= 1 else number(v) for v in values], unit


def duration(seconds: Sequence[float], joint: str = "to") -> str:
    """Durations [s] in seconds, minutes or hours, such as "13.3 to 15.5 min"."""
    texts, unit = _spelt(seconds)
    return f"{listed(list(dict.fromkeys(texts)), joint)} {unit}"


def samples(values: Sequence[float]) -> str:
    """Delays in samples, such as "6 or 7 samples"."""
    return f"{listed([number(v) for v in values], 'or')} {'sample' if list(values) == [1] else 'samples'}"


def delays(values: Sequence[float], sample_time: float) -> str:
    """Lags (delays or t50), the lowest first, such as "6 or 7 samples (13.3 to 15.5 min)"."""
    together = all(b - a == 1 for a, b in pairwise(values))
    span = duration([v * sample_time for v in values], "to" if together else "or")
    return f"{samples(values)} ({span})"


def minutes_first(value: float, sample_time: float) -> str:
    """A t50, such as "15.5 min (7 samples)"."""
    return f"{duration([value * sample_time])} ({samples([round(value, 1)])})"


def probability(p: float) -> str:
    """A probability with two digits; one that is nearly sure is not rounded to 1, nor a small one to 0."""
    return "above 0.99" if p > 0.99 else "below 0.01" if p < 0.01 else f"{p:.2f}"


def share(part: int, whole: int) -> str:
    """A share in per cent that is 0 or 100 only where it is exactly that."""
    if whole == 0:
        return "-"
    percent = 100 * part / whole
    if 0 < percent < 1 or 99 < percent < 100:
        return f"{min(max(percent, 0.1), 99.9):.1f} %"
    return f"{percent:.0f} %"


def day_range(first: dt.date, last: dt.date) -> str:
    """A day, or a range such as "2008-01-01 to 2008-12-31"."""
    return f"{first}" if first == last else f"{first} to {last}"


def spans(days: Sequence[dt.date]) -> list[tuple[dt.date, dt.date]]:
    """First and last days of unbroken sequences of days, which are in order."""
    found: list[tuple[dt.date, dt.date]] = []
    for day in days:
        if found and (day - found[-1][1]).days == 1:
            found[-1] = found[-1][0], day
        else:
            found.append((day, day))
    return found


def output_words(unit: str) -> str:
    """The output that the estimators explain: a pool's level or a river's discharge."""
    return "level" if unit == "m" else "discharge"


def response_unit(unit: str) -> str:
    """Unit of the impulse response: m per m³/s for a level, none for a discharge."""
    return "m per m³/s" if unit == "m" else "m³/s per m³/s"


def statuses(status: Sequence[str]) -> str:
    """The days without an answer, counted by status, such as "2 failed and 1 pending"."""
    return listed([f"{n:,} {name}" for name in NO_ANSWER if (n := list(status).count(name))])


def shorten(text: str, width: int) -> str:
    """Cut a long text to `width` characters, with an ellipsis."""
    return text if len(text) <= width else text[: width - 1] + "…"


def step(sample_time: float) -> str:
    """The length of a sample, in minutes or hours where these are whole, such as "5 min" or "133 s"."""
    for size, unit in ((3600, "h"), (60, "min")):
        if sample_time % size == 0:
            return f"{sample_time / size:.0f} {unit}"
    return f"{number(sample_time)} s"


def travel(values: Sequence[float], sample_time: float, rounded: bool = False) -> str:
    """The travel time that a delay stands for, or several alternatives, the lowest first [samples].

    At a delay of d samples the inflow arrives between d T_s and (d + 1) T_s; where d is a `rounded` t50,
    between (d - 1/2) T_s and (d + 1/2) T_s. A median between two delays stands for both. Spans that are apart
    are joined as in "13.3 to 15.5 or 19.9 to 22.2 min".
    """
    spans: list[tuple[float, float]] = []
    early = 0.5 if rounded else 0.0
    for d in values:
        low, high = ((end - early) * sample_time for end in (math.floor(d), math.ceil(d) + 1))
        if spans and low <= spans[-1][1]:
            spans[-1] = spans[-1][0], high
        else:
            spans.append((low, high))
    ends = [end for span in spans for end in span]
    texts, unit = _spelt(ends)
    if all(text.endswith(".0") or "." not in text for text in texts):
        texts = [text.removesuffix(".0") for text in texts]
    spans_given = [f"{low} to {high}" for low, high in zip(texts[::2], texts[1::2], strict=True)]
    return f"{listed(spans_given, 'or')} {unit}"


def travel_within(low: float, high: float, sample_time: float, rounded: bool = False) -> str:
    """The travel times that the delays from `low` to `high` [samples] stand for, as :func:`travel`."""
    return travel([float(d) for d in range(math.floor(low), math.ceil(high) + 1)], sample_time, rounded)


def samples_first(values: Sequence[float], sample_time: float, rounded: bool = False) -> str:
    """Delays and their :func:`travel` time, such as "5 samples (25 to 30 min)"."""
    return f"{samples(values)} ({travel(values, sample_time, rounded)})"


def travel_first(values: Sequence[float], sample_time: float) -> str:
    """Delays, after their travel time, such as "25 to 30 min (delay d = 5 samples of 5 min)"."""
    return f"{travel(values, sample_time)} (delay d = {samples(values)} of {step(sample_time)})"


def flow(value: float) -> str:
    """A discharge [m3/s] to three digits or to whole units."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def power(value: float) -> str:
    """A number to two digits, with a power of ten where it is very large or small, such as "2.5 × 10⁴"."""
    if not math.isfinite(value):
        return "–"
    if value == 0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:,.0f}" if abs(value) >= 10 else f"{value:.2g}"
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits} × {ten_to(int(exponent))}"


def ten_to(exponent: int) -> str:
    """A power of ten, such as "10⁻⁴"."""
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
