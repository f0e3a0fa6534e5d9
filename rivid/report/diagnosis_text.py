"""Numbers, names and times of a diagnosis as people write them."""

import datetime as dt
import math
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rivid.diagnosis.result import (
    VERDICTS,
    ClosedLoop,
    Diagnosis,
    Estimate,
    Gap,
    NamedEffect,
    Operators,
    Unknown,
    Where,
)
from rivid.text import count, day_range, listed


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


LABELS: dict[str, str] = {
    "no_gap": "No gap",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "cannot_tell": "Cannot tell which",
    "unknown": "Missing, without a name",
    "did_not_hold": "Did not hold",
    "insufficient_data": "Too few data",
}
"""Each verdict in a word or three."""

MAY_NOT_SAY: dict[str, str] = {
    "no_gap": "It does not say that nothing is missing: what is too small, too rare or too much like the "
    "weather to show in these days may be there all the same.",
    "explained": "It does not prove a cause. Something that is not on the list, but acts as a named effect "
    "does, would be given its name: look at the place before money is spent.",
    "partly_explained": "What is named was confirmed on its own; what is left has no name yet, and may "
    "change the sizes given here once it has one.",
    "cannot_tell": "Do not act on one of the names alone. The order in which they stand says which fits a "
    "little better, not which is true; the measurement that is asked for would tell.",
    "unknown": "The unexplained inflow is what would have to flow in for the simulation to follow the gauge. "
    "It may be water, or a gauge, a clock or a gate that acts as water would: it shows where and "
    "when to look, not what is there.",
    "did_not_hold": "What stood out may have ended, may come back, or may have been chance: these days "
    "cannot say. More days, or the diagnosis again in some weeks, can.",
    "insufficient_data": "It says nothing about the reach, neither that something is missing nor that "
    "nothing is. More days with few gaps will change that.",
}
"""What each verdict must not be taken for."""

MAIN_LAST = {"hour", "place", "start", "starts", "duration", "rise", "recession", "per_day", "per_month"}
"""Parameters that say when and where, not how much: the headline does not begin with them."""


FORECAST_APART = 0.02
"""Where the closed shares of forecast and description differ by more, both are told."""


def main_parameter(effect: NamedEffect) -> Estimate | None:
    """The parameter that says how much; None where an effect has none."""
    sizes = [p for p in effect.parameters if p.name.split("[")[0] not in MAIN_LAST]
    return next(iter([*sizes, *effect.parameters]), None)


def size_words(effect: NamedEffect) -> str:
    """The main parameter with its name; of one that changes with time, from where to where; else nothing."""
    main = main_parameter(effect)
    if main is None:
        return ""
    base = main.name.split("[")[0]
    values = [p.value for p in effect.parameters if p.name.startswith(f"{base}[")]
    name = base.replace("_", " ")
    if len(values) < 2:
        return f"{name} {estimate_words(main)}"
    low, high = (estimate_words(replace(main, value=v, low=v, high=v)) for v in (min(values), max(values)))
    return f"{name} from {low.partition(' ')[0]} to {high.partition(' (')[0]}"


def sure_words(effect: NamedEffect) -> str:
    """How sure a name is, in a sentence."""
    said = f"Of the whole list of effects, {probability(effect.p_value)}"
    others = [name_words(name) for name in effect.tied_with]
    if others:
        said += f"; these data cannot tell it from {listed(others, 'or')}"
    if effect.runner_up and effect.runner_up not in effect.tied_with:
        said += f"; the next best name is {name_words(effect.runner_up)}"
        if effect.margin is not None and math.isfinite(effect.margin):
            said += f", which removes {max(effect.margin, 0.0):.0%} less of the excess error"
    elif not others:
        said += "; no other name comes near"
    return said.replace("%", " %") + "."


def horizon(gap: Gap) -> int:
    """The horizon a sentence speaks of: 4 h, or else the middle one."""
    return gap.horizon_h.index(4.0) if 4.0 in gap.horizon_h else len(gap.horizon_h) // 2


def gap_sentences(diagnosis: Diagnosis) -> list[str]:
    """What the days kept apart say, at the horizon of :func:`horizon`."""
    gap = diagnosis.gap
    if gap is None or not gap.horizon_h:
        return []
    h = horizon(gap)
    factor, unit = scale_of(gap)
    before, after = gap.rmse_baseline[h], gap.rmse_augmented[h]
    output = "level" if gap.unit == "m" else "discharge"
    days = count(len(gap.heldout_dates), "day")
    if not math.isfinite(before):
        return []
    said = (
        f"On the {days} kept apart, {hours_words(gap.horizon_h[h])} ahead, the simulated {output} is off by "
    )
    if not diagnosis.effects:
        said += f"{error_words(before, factor)} {unit} (root mean square)."
        return [said + _floor_words(gap, h)]
    said += f"{error_words(before, factor)} {unit} without {_these(diagnosis)} and "
    said += f"{error_words(after, factor)} {unit} with {'it' if len(diagnosis.effects) == 1 else 'them'}."
    said += _floor_words(gap, h)
    return [said, *_closed_sentences(gap)]


def _floor_words(gap: Gap, h: int) -> str:
    if gap.rmse_floor is None or not math.isfinite(gap.rmse_floor[h]):
        return ""
    factor, unit = scale_of(gap)
    return f" Weather and gauge alone would leave {error_words(gap.rmse_floor[h], factor)} {unit}."


def _closed_sentences(gap: Gap) -> list[str]:
    if gap.closed is None or not math.isfinite(gap.closed):
        return []
    said = closed_words(gap.closed)
    forecast = gap.closed_forecast
    if forecast is not None and abs(forecast - gap.closed) > FORECAST_APART:
        ahead = closed_words(forecast).replace("of the gap is closed", "is closed")
        return [f"With events timed on the day itself, {said}; by what is known beforehand, {ahead}."]
    return [f"{said[0].upper()}{said[1:]}."]


def _these(diagnosis: Diagnosis) -> str:
    return listed([name_words(e.name) for e in diagnosis.effects])


def _sized(effect: NamedEffect) -> str:
    """A name with its size and time."""
    said = ", ".join(filter(None, (name_words(effect.name), size_words(effect))))
    if effect.events:
        said += f", {count(effect.events, 'event')}"
    return said if effect.where == Where() else f"{said}, {when_words(effect.where)}"


def _named(effect: NamedEffect) -> str:
    """A name with its size alone."""
    size = size_words(effect).partition(" (")[0]
    main = main_parameter(effect)
    if main is not None:  # without the parameter's own name: "135 m3/s", "54 to 205 m3/s"
        size = size.removeprefix(main.name.split("[")[0].replace("_", " ")).removeprefix(" from").strip()
    return name_words(effect.name) + (f" ({size})" if size else "")


def unknown_words(unknown: Unknown, unit: str = "m³/s") -> str:
    """What is missing and has no name: size, when, and what it goes with."""
    parts = [f"about {error_words(unknown.size_m3s)} {unit}", when_words(unknown.where)]
    if unknown.period_s is not None and math.isfinite(unknown.period_s):
        parts.append(f"with a period of {period_words(unknown.period_s)}")
    if unknown.drivers:
        parts.append(f"going with {listed([printable(d) for d in unknown.drivers])}")
    return ", ".join(parts)


def loop_words(loop: ClosedLoop, named: bool) -> str:
    """What the days kept apart say with the operators in the loop, in a line; empty where there is none."""
    before, after = loop.baseline, loop.augmented
    if before is None or after is None:
        return ""

    def told(one: float, other: float, factor: float, unit: str) -> str:
        ends = [error_words(v, factor) for v in ((one, other) if named else (one,))]
        return f"{' to '.join(ends)} {unit}"

    off = "off by" if not named else "off by, without and with the named effects,"
    return (
        f"{count(loop.days, 'day')}: the level is {off} {told(before.level, after.level, 1000.0, 'mm')}, "
        f"the outflow by {told(before.outflow, after.outflow, 1.0, 'm³/s')}"
    )


def operators_words(o: Operators) -> str:
    """How the operators act, in sentences."""
    when = "at once" if o.lag_s == 0.0 else f"{period_words(o.lag_s)} later"
    said = f"They pass on {100 * o.feedforward:.0f} % of a change of the inflow, {when}"
    if o.level_gain > 0.0:
        said += f", and let out {o.level_gain:.0f} m³/s more for each metre of level"
        said += f" beyond {100 * o.dead_band:.1f} cm" if o.dead_band > 0.0 else ""
        said += f" about {o.set_point:.2f} m"
        if o.trim_time_s is not None:
            said += f", and as much again for each {period_words(o.trim_time_s)} that it lasts"
    else:
        said += "; no answer to the level is seen"
    said += f". They look every {period_words(o.look_s)}"
    if o.notice is not None:
        said += f", and when the inflow moves by more than {o.notice:.3g} m³/s"
    return (
        f"{said}. This explains {100 * o.r2:.1f} % of the hourly changes of the outflow on days that it was "
        f"not fitted to, the inflow alone {100 * max(o.r2_inflow, 0.0):.1f} %, and leaves "
        f"{error_words(o.left)} of {error_words(o.change)} m³/s."
    )


def headline(diagnosis: Diagnosis) -> str:
    """The answer in a sentence: what is missing, how much, when."""
    effects, verdict = diagnosis.effects, diagnosis.verdict
    if verdict in ("explained", "partly_explained") and effects:
        more = " More is missing, and has no name yet." if verdict == "partly_explained" else ""
        return _were_missing(effects) + more
    if verdict == "cannot_tell" and effects:
        names = could_be(effects[0])
        if len(names) == 1:
            return f"Something is missing. It may be {names[0]}; these data cannot make sure."
        return f"Something is missing. It is {listed(names, 'or')}, and these data cannot tell which."
    if verdict == "unknown" and diagnosis.unknown is not None:
        return (
            f"Something is missing: {unknown_words(diagnosis.unknown)}. It is none of the effects known here."
        )
    if verdict == "did_not_hold" and effects:
        named = "; ".join(_sized(e) for e in effects)
        return f"The fitted days show {named}. The days kept apart do not confirm it."
    return VERDICTS[verdict]


def could_be(effect: NamedEffect) -> list[str]:
    """Names that the data cannot tell apart, the best first."""
    others = effect.tied_with or ((effect.runner_up,) if effect.runner_up else ())
    return [name_words(name) for name in (effect.name, *others)]


def _were_missing(effects: Sequence[NamedEffect]) -> str:
    if len(effects) > 1:
        return f"{_number(len(effects))} effects were missing: {listed([_named(e) for e in effects])}."
    (effect,) = effects
    name = capital(name_words(effect.name))
    rest = _sized(effect).removeprefix(name_words(effect.name)).removeprefix(", ")
    return f"{name} was missing: {rest}." if rest else f"{name} was missing."


def _number(n: int) -> str:
    return {2: "Two", 3: "Three", 4: "Four"}.get(n, str(n))


WIDTH = 80
INDENT = 11


def summary(diagnosis: Diagnosis, page: Path | None = None) -> str:
    """What was found, for a terminal.

    Parameters
    ----------
    diagnosis : Diagnosis
    page : Path, optional
        Where diagnosis.html is; its line alone may be longer than the others.

    Returns
    -------
    str
        Lines without a newline at the end.
    """
    lines = textwrap.wrap(printable(headline(diagnosis)), WIDTH)
    lines += _entry("Why", diagnosis.reason)
    for effect in diagnosis.effects:
        lines += _entry("Effect", _effect(effect))
        if effect.breaker:
            lines += _entry("To tell", effect.breaker)
    lines += _gap(diagnosis)
    if diagnosis.closed_loop is not None:
        loop = diagnosis.closed_loop
        lines += _entry("Loop", loop.reason or loop_words(loop, bool(diagnosis.effects)))
    if diagnosis.unknown is not None:
        lines += _entry("Unknown", unknown_words(diagnosis.unknown))
    if page is not None:
        lines.append("Page".ljust(INDENT) + printable(str(page)))
    return "\n".join(lines).replace("m³", "m3").replace("m²", "m2").replace("–", "-")


def _entry(key: str, text: str) -> list[str]:
    """A key and its words, indented under each other."""
    words = textwrap.wrap(printable(text), WIDTH - INDENT) or [""]
    return [(key if i == 0 else "").ljust(INDENT) + line for i, line in enumerate(words)]


def _effect(effect: NamedEffect) -> str:
    parts = [name_words(effect.name)]
    parts += filter(None, [size_words(effect)])
    parts += [when_words(effect.where), probability(effect.p_value)]
    if effect.tied_with:
        parts.append(f"tied with {listed([name_words(name) for name in effect.tied_with])}")
    return ", ".join(parts)


def _gap(diagnosis: Diagnosis) -> list[str]:
    """A line a simulation, with its error at each horizon."""
    gap = diagnosis.gap
    if gap is None:
        return []
    factor, unit = scale_of(gap)
    rows = [("without any effect", gap.rmse_baseline)]
    for step in gap.steps:
        rows.append((f"+ {name_words(step.added)}", step.rmse))
        if step.rmse_described is not None:
            rows.append(("  events timed on the day", step.rmse_described))
    if gap.rmse_floor is not None:
        rows.append(("weather and gauge alone", gap.rmse_floor))
    heads = [f"{h:g} h" for h in gap.horizon_h]
    longest = WIDTH - INDENT - 8 * len(heads)
    width = min(max(len(name) for name, _ in rows), longest)
    head = f"error [{unit}]"
    told = [(head, heads)] + [(name, [error_words(v, factor) for v in values]) for name, values in rows]
    lines = []
    for i, (name, cells) in enumerate(told):
        short = name if len(name) <= width else f"{name[: width - 3]}..."
        lines.append(
            ("Gap" if i == 0 else "").ljust(INDENT) + short.ljust(width) + "".join(f"{c:>8}" for c in cells)
        )
    if gap.closed is not None and math.isfinite(gap.closed):
        words = closed_words(gap.closed)
        forecast = gap.closed_forecast
        if forecast is not None and abs(forecast - gap.closed) > FORECAST_APART:
            words = f"{words} with events timed on the day; beforehand, {closed_words(forecast)}"
        lines += _entry("", words)
    return lines
