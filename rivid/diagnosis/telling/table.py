"""A diagnosis for the terminal: a few calm lines of at most 80 columns."""

import math
import textwrap
from pathlib import Path

from rivid.diagnosis.result import Diagnosis, NamedEffect
from rivid.diagnosis.telling.spelling import (
    closed_words,
    error_words,
    name_words,
    printable,
    probability,
    scale_of,
    when_words,
)
from rivid.diagnosis.telling.wording import (
    FORECAST_APART,
    headline,
    loop_words,
    size_words,
    unknown_words,
)
from rivid.plots.words import listed

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
