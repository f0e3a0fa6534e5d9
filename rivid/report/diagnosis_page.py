"""diagnosis.html: one self-contained page that says what is missing, how big, when, and how sure."""

import datetime as dt
import json
import math
import re
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.result import ClosedLoop, Diagnosis, Estimate, Gap, NamedEffect, Regime
from rivid.effects import Effect, effect_classes
from rivid.plots.style import FigureFile
from rivid.report import page
from rivid.report.diagnosis_text import (
    LABELS,
    MAY_NOT_SAY,
    aside,
    capital,
    error_words,
    estimate_words,
    gap_sentences,
    headline,
    name_words,
    operators_words,
    period,
    period_words,
    printable,
    scale_of,
    sure_words,
    unknown_words,
    when_words,
)
from rivid.text import count, number

MOST = 12
"""Parameters that a card shows; diagnosis.json has all."""


def write_page(
    out: Path,
    diagnosis: Diagnosis,
    evidence: Evidence | None,
    figures: Sequence[FigureFile],
    *,
    reach: str = "",
    classes: Mapping[str, type[Effect]] | None = None,
) -> Path:
    """Write OUT/diagnosis.html.

    Parameters
    ----------
    out : Path
    diagnosis : Diagnosis
    evidence : Evidence or None
        For the days and the kind of reach; None where there is none.
    figures : sequence of FigureFile
        To embed, in their order.
    reach : str
    classes : mapping of str to type of Effect, optional
        Words for the effects; default: :func:`rivid.effects.effect_classes`.

    Returns
    -------
    Path
        The page; it needs no other file and asks no server for anything.

    Raises
    ------
    RividError
        Where the page cannot be written or a figure cannot be read.
    """
    known = effect_classes() if classes is None else classes
    context = _context(diagnosis, evidence, figures, reach, known)
    return page.write_page(out / "diagnosis.html", "diagnosis", context)


def _context(
    diagnosis: Diagnosis,
    evidence: Evidence | None,
    figures: Sequence[FigureFile],
    reach: str,
    classes: Mapping[str, type[Effect]],
) -> dict[str, Any]:
    record = evidence.record if evidence is not None else None
    named, loop = bool(diagnosis.effects), diagnosis.closed_loop
    river = record is not None and record.kind == "river"
    return {
        "reach": reach or ("River reach" if river else "Reach"),
        "period": period(record.dates) if record is not None else "",
        "sample_time": number(record.sample_time) if record is not None else "",
        "river": river,
        "output": "discharge" if river else "level",
        "verdict": diagnosis.verdict,
        "label": LABELS[diagnosis.verdict],
        "headline": _tight(headline(diagnosis)),
        "sentences": [_tight(said) for said in (*gap_sentences(diagnosis), diagnosis.reason)],
        "effects": [_card(e, classes, record.dates[0] if record else None) for e in diagnosis.effects],
        "unknown": None if diagnosis.unknown is None else unknown_words(diagnosis.unknown),
        "gap": None if diagnosis.gap is None else _gap(diagnosis.gap, named),
        "loop": None if loop is None else _loop(loop, named),
        "figures": [(f, page.data_uri(f.path, "run the diagnosis again")) for f in figures],
        "notes": diagnosis.notes,
        "may_not_say": MAY_NOT_SAY[diagnosis.verdict],
        "known": count(len(classes), "effect"),
        "response": diagnosis.reach_response,
        "reach_parameters": [(p.name, estimate_words(p)) for p in diagnosis.reach_parameters],
        "noise": _noise(diagnosis.noise or {}, river),
        "tables": [(e.name, _toml(e.table)) for e in diagnosis.effects if e.table],
    }


def _noise(noise: Mapping[str, float | None], river: bool) -> list[tuple[str, str]]:
    """The noise model in words; what a reach does not have is left out."""
    output = " m³/s" if river else " m"
    said = {
        "gauge_sd": ("gauge noise", output),
        "walk_sd": ("walk of the error, a sample", output),
        "inflow_sd": ("unknown inflow", " m³/s"),
        "inflow_memory": ("its memory", " s"),
        "level_sd": ("noise of the output", output),
        "level_memory": ("its memory", " s"),
        "surface_area": ("water surface", " m²"),
    }
    rows = []
    for key, value in noise.items():
        words, unit = said.get(key, (name_words(key), ""))
        if value is None:
            continue
        spelt = (
            period_words(value) if unit == " s" else f"{value:,.0f}" if abs(value) >= 1e3 else f"{value:.3g}"
        )
        rows.append((words, spelt if unit == " s" else spelt + unit))
    return rows


def _card(effect: NamedEffect, classes: Mapping[str, type[Effect]], first: dt.date | None) -> dict[str, Any]:
    """What the page says of one effect."""
    one = classes.get(effect.name)
    meanings = {} if one is None else {key: q.meaning for key, q in one.parameters().items()}
    return {
        "name": name_words(effect.name),
        "code": effect.name,
        "family": effect.family,
        "sentence": "" if one is None else one.sentence,
        "looks": "" if one is None else one.looks,
        "parameters": [
            (
                name.replace("_", " "),
                "; ".join(map(estimate_words, of)),
                _meaning(of, first, meanings),
            )
            for name, of in _together(effect.parameters[:MOST])
        ],
        "more": max(len(effect.parameters) - MOST, 0),
        "when": when_words(effect.where),
        "events": count(effect.events, "event") if effect.events else "",
        "sure": _tight(sure_words(effect)),
        "tied": [name_words(name) for name in effect.tied_with],
        "breaker": printable(effect.breaker or ""),
    }


def _together(parameters: Sequence[Estimate]) -> list[tuple[str, list[Estimate]]]:
    """Parameters by name; the values of one that changes with time (``size[0]``, ...) together."""
    return [(name, list(of)) for name, of in groupby(parameters, key=lambda p: p.name.split("[")[0])]


def _meaning(of: Sequence[Estimate], first: dt.date | None, meanings: Mapping[str, str]) -> str:
    """What a row means; of a single value also as people say it, of several that they follow each other."""
    spelt = aside(of[0], first) if len(of) == 1 else "one after the other, as the season goes on"
    return "; ".join(part for part in (spelt, meanings.get(of[0].name.split("[")[0], "")) if part)


def _gap(gap: Gap, named: bool) -> dict[str, Any]:
    """The table of the gap, a row for each simulation, and that by regime."""
    factor, unit = scale_of(gap)

    def cells(values: Sequence[float]) -> list[str]:
        return [error_words(v, factor) for v in values]

    rows = [{"name": "Without any effect", "kind": "before", "cells": cells(gap.rmse_baseline)}]
    for step in gap.steps:
        rows.append({"name": f"+ {name_words(step.added)}", "kind": "", "cells": cells(step.rmse)})
        if step.rmse_described is not None:
            rows.append(
                {"name": "events timed on the day", "kind": "described", "cells": cells(step.rmse_described)}
            )
    if gap.rmse_floor is not None:
        rows.append({"name": "Weather and gauge alone", "kind": "floor", "cells": cells(gap.rmse_floor)})
    return {
        "unit": unit,
        "heads": [f"{h:g} h" for h in gap.horizon_h],
        "rows": rows,
        "described": any(row["kind"] == "described" for row in rows),
        "days": count(len(gap.heldout_dates), "day"),
        "dates": [str(date) for date in gap.heldout_dates],
        "regimes": [(_tight(capital(r.words)), _ends(r, factor, named)) for r in gap.by_regime],
        "named": named,
    }


def _ends(regime: Regime, factor: float, named: bool) -> list[str]:
    """Cells of a regime: the error before and, where something was named, after."""
    cells = []
    for before, after in zip(regime.rmse_baseline, regime.rmse_augmented, strict=True):
        ends = [error_words(v, factor) for v in ((before, after) if named else (before,))]
        cells.append("–" if set(ends) == {"–"} else " → ".join(ends))
    return cells


def _loop(loop: ClosedLoop, named: bool) -> dict[str, Any]:
    """The table of the closed loop, in mm and m3/s."""
    rows = []
    if loop.baseline is not None and loop.augmented is not None:
        rows = [("Without any effect", loop.baseline), ("With the named effects", loop.augmented)]
        rows = rows if named else [("Simulated", loop.baseline)]
    spread = loop.spread_measured
    return {
        "reason": loop.reason,
        "operators": "" if loop.operators is None else _tight(operators_words(loop.operators)),
        "days": count(loop.days, "day"),
        "measured": error_words(math.nan if spread is None else spread, 1000.0),
        "rows": [
            (name, [error_words(e.open_level, 1e3), error_words(e.level, 1e3), error_words(e.outflow),
                    error_words(e.spread, 1e3)])
            for name, e in rows
        ],
    }  # fmt: skip


def _tight(text: str) -> str:
    """The text with units that stay with their numbers at the end of a line."""
    return re.sub(r"(?<=\d) (?=(?:%|m³/s|mm|min|h)(?!\w))", "\u00a0", text)


def _toml(table: Mapping[str, Any]) -> str:
    """An effect's table as the lines of a scenario, to read and to copy."""
    lines = ["[[effects]]"]
    for key, value in table.items():
        lines.append(f"{key} = {_value(value)}")
    return "\n".join(lines)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(v) for v in value)}]"
    if isinstance(value, dt.date):
        return value.isoformat()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
