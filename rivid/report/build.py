"""report.html: one self-contained page that says what a run found, and shows it."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rivid.estimators import ESTIMATORS
from rivid.plots.style import FigureFile
from rivid.report.attention import SHOWN, Attention, missing, spans
from rivid.report.glance import glance
from rivid.report.headline import facts, headline, leading
from rivid.report.lately import Lately, lately
from rivid.report.looking import dates_of, to_look_at
from rivid.report.page import data_uri, write_page
from rivid.report.strip import sign, strip, svg
from rivid.results.passage import leading_response, passage
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import estimates_delay
from rivid.text import (
    count,
    day_range,
    delays,
    number,
    output_words,
    probability,
    samples_first,
    share,
)

MOST = 400
"""Rows of days to look at on the page at all; delays.csv has every one."""

UNITS = re.compile(r"(\d) (min|h|s|samples?|days?)\b")
"""A number and its unit: no line of the headline ends between them."""

MOST_SPANS = 40
"""Days or spans of days without a log that are listed at all, the latest."""

ORDER = ("t50", "t50_discharge", "tdr", "delay_map", "histogram", "delay_discharge")
"""Figures of an estimator in the order in which they are read; any other comes after."""

LOOKS = {
    "sure": "the data decide",
    "prior": "the data alone say otherwise, or nothing",
    "doubt": "at a bound or degenerate",
    "none": "no answer",
}
"""Marks of the last weeks, in the words of a legend."""


def write_report(
    results: Results, figures: Sequence[FigureFile], out: Path, *, summary: Mapping[str, Any]
) -> Path:
    """Write OUT/report.html.

    Parameters
    ----------
    results : Results
        All of OUT.
    figures : sequence of FigureFile
        Figures to embed, in order of their estimators.
    out : Path
        OUT.
    summary : mapping
        run.json; of it the page shows ``config`` (nested mappings), ``versions``, ``bad_files`` (pairs of
        file and reason) and, where they stand, d_min, d_max, order and delay_scale in use.

    Returns
    -------
    Path
        The page; it needs no other file and asks no server for anything.

    Raises
    ------
    RividError
        Where the page cannot be written or a figure cannot be read.
    """
    return write_page(out / "report.html", "report", _context(results, figures, summary))


def _context(results: Results, figures: Sequence[FigureFile], summary: Mapping[str, Any]) -> dict[str, Any]:
    recent = lately(results)
    rows = to_look_at(results, recent)
    dates = sorted({date for e in results.estimators for date in e.dates})
    sentences = headline(results)
    top = glance(results, recent, rows) if recent else None
    first = top.headline if top else sentences[0]
    lead, river = leading(results), leading_response(results)
    speaker = river or lead
    gone = missing(dates)
    by_prior = facts(results, lead).prior_only if lead and not river else 0
    numbered = list(enumerate(rows[:MOST]))
    return {
        "reach": results.reach,
        "period": day_range(dates[0], dates[-1]) if dates else "no days",
        "days": count(len(dates), "day"),
        "sample_time": number(results.sample_time),
        "output": output_words(results.output_unit),
        "unit": results.output_unit,
        "river": river is not None,
        "speaks": _speaks(lead, river),
        "names": [e.estimator for e in results.estimators],
        "unjudged": any(ESTIMATORS[e.estimator].unjudged for e in results.estimators),
        "probable": any(ESTIMATORS[e.estimator].has_probability for e in results.estimators),
        "headline": UNITS.sub("\\1\u00a0\\2", first),
        "lines": top.lines if top else (),
        "sentences": [text for text in sentences if text != first],
        **(_strip(results, recent, rows) if recent else {"strip": None}),
        "most": MOST,
        "attention": numbered[:SHOWN],
        "more": numbered[SHOWN:],
        "no_log": spans(gone)[-MOST_SPANS:],
        "most_spans": MOST_SPANS,
        "gone": count(len(gone), "day"),
        "by_prior": count(by_prior, "day") if by_prior else "",
        "unlisted": max(len(rows) - MOST, 0),
        "estimators": [_row(results, e) for e in results.estimators if e.dates],
        "groups": _groups(figures, speaker.estimator if speaker else ""),
        "bad_files": [(str(f), str(why)) for f, why in summary.get("bad_files") or ()][:MOST],
        "settings": _settings(summary),
        "versions": [(str(k), str(v)) for k, v in dict(summary.get("versions") or {}).items()],
    }


def _strip(results: Results, recent: Lately, rows: Sequence[Attention]) -> dict[str, Any]:
    """The drawing of the last weeks, its legend, and its words."""
    name = recent.estimator.estimator
    place = {
        date: k
        for k, row in reversed(list(enumerate(rows)))
        if name in row.estimators
        for date in dates_of(row, results)
    }
    drawn = strip(results, recent, place)
    if drawn is None:
        return {"strip": None}
    named = LOOKS | {"sure": "t50"} if recent.passage else LOOKS
    if ESTIMATORS[name].unchecked and not recent.passage:
        named = LOOKS | {"sure": "travel time" if recent.travel else "delay"}
    looks = [(sign(look), words) for look, words in named.items() if look in drawn.looks]
    what = "t50" if recent.passage else "Travel time" if recent.travel else "Delay"
    text = f"{what} of each day by {name}; the last week is shaded, the time is on the right."
    if not (recent.passage or recent.travel):
        text += " A delay of d samples is a travel time of d to d + 1 samples; the time stands at its middle."
    if drawn.medians:
        looks.append((sign("median"), "median of a week"))
    return {"strip": svg(drawn, text, MOST), "looks": looks, "strip_words": text}


def _speaks(lead: EstimatorResults | None, river: EstimatorResults | None) -> list[tuple[str, str]]:
    """The estimators the headline speaks of, each with what it says of it where they differ."""
    if river is None:
        return [(lead.estimator, "")] if lead else []
    if lead is None or lead is river or not estimates_delay(lead):
        return [(river.estimator, "")]
    return [(river.estimator, " for t50"), (lead.estimator, " for the jump delay")]


def _row(results: Results, e: EstimatorResults) -> dict[str, str]:
    """The line of one estimator in the table; a dash where it has no such number."""
    f = facts(results, e)
    with_delay = estimates_delay(e) and f.with_delay > 0
    T_s = results.sample_time

    def given(text: str) -> str:
        return text if with_delay else "–"

    p = passage(results, e)
    modal = ""
    if with_delay:
        days = f"{f.common_days:,} of {count(f.with_delay, 'day')}"
        modal = f"{' and '.join(number(d) for d in f.common)}: {days}"
    return {
        "name": e.estimator,
        "words": ESTIMATORS[e.estimator].words,
        "answered": f"{f.answered:,} of {f.days:,}",
        "t50": delays([round(p.median, 1)], T_s) if p.with_t50 else "–",
        "median": samples_first([f.median], T_s) if with_delay else "–",
        "modal": given(modal),
        "at_bound": given(f"{f.at_bound:,}"),
        "probability": "–" if e.probability is None else given(probability(f.probability)),
        "prior_only": "–"
        if ESTIMATORS[e.estimator].unchecked
        else given(f"{f.prior_only:,} ({share(f.prior_only, f.with_delay)})"),
        "condition": power(f.condition),
        "noise": power(f.noise_sd),
        "alpha": power(f.alpha),
    }


def power(value: float) -> str:
    """A number to two digits, with a power of ten where it is very large or small.

    Examples
    --------
    >>> power(24877.7), power(0.0041), power(12.3)
    ('2.5 × 10⁴', '0.0041', '12')
    """
    if not np.isfinite(value):
        return "–"
    if value == 0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:,.0f}" if abs(value) >= 10 else f"{value:.2g}"
    digits, exponent = f"{value:.1e}".split("e")
    superscript = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{digits} × 10{superscript}"


def _groups(figures: Sequence[FigureFile], lead: str) -> list[dict[str, Any]]:
    """Figures by estimator: the leading one first, those of all estimators after it, then the others."""
    names = list(dict.fromkeys(f.estimator for f in figures))
    order = sorted(names, key=lambda name: (name != lead, name != "", names.index(name)))

    def read(file: FigureFile) -> int:
        return ORDER.index(file.kind) if file.kind in ORDER else len(ORDER)

    shown = sorted(figures, key=lambda file: (order.index(file.estimator), read(file)))
    return [
        {
            "name": name,
            "words": ESTIMATORS[name].words if name else "",
            "figures": [(k, f, data_uri(f.path)) for k, f in enumerate(shown) if f.estimator == name],
        }
        for name in order
    ]


def _settings(summary: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Sections of the configuration as text, and what "bounds" came to."""
    sections = []
    used = [
        (name, _plain(summary[name]))
        for name in ("d_min", "d_max", "order", "delay_scale")
        if name in summary
    ]
    if used:
        sections.append(("in use", used))
    config = summary.get("config") or {}
    for section, keys in config.items():
        if isinstance(keys, Mapping):
            sections.append((f"[{section}]", [(str(k), _plain(v)) for k, v in keys.items()]))
    return sections


def _plain(value: Any) -> str:
    """A setting as TOML would show it."""
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Mapping):
        return ", ".join(f"{k} = {_plain(v)}" for k, v in value.items()) or "none"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_plain(v) for v in value)}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
