"""The files of a diagnosis: page, figures, JSON and unexplained inflow; and its summary for a terminal.

This module computes and formats numbers; the sentences are in the templates ``diagnosis*.j2``.
"""

import datetime as dt
import textwrap
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import tomli_w

from rivid.atomic import write_text
from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.result import Diagnosis, Gap, NamedEffect
from rivid.effects import Effect, effect_classes
from rivid.plots import diagnosis as plots
from rivid.plots.files import FigureFile
from rivid.plots.style import drop_old, styled
from rivid.report import quantities
from rivid.report.page import data_uri, sentence, terminal, write_page
from rivid.results.store import described, to_table, write_parquet
from rivid.text import count, shown_in

BAND = 1.959964  # standard deviations to either side of a 95 % band
SCHEMA, MEANINGS = described("""
time | clock | | local time without zone, as in the logs
w_m3s | number | m3/s | inflow that no log explains, with the named effects in the model
low | number | m3/s | lower end of its 95 % band
high | number | m3/s | upper end of its 95 % band
w_before_m3s | number | m3/s | the same without the named effects
low_before | number | m3/s | lower end of its 95 % band
high_before | number | m3/s | upper end of its 95 % band
""")
"""unexplained_inflow.parquet: a row for each used sample."""
MOST_PARAMETERS = 12  # parameters on the card of an effect; diagnosis.json holds all
WIDTH, INDENT = 80, 11  # columns of the terminal summary, and of its keys
NOISE = {  # name and unit of each parameter of the noise model
    "gauge_sd": ("gauge noise", "output"), "walk_sd": ("random walk of the gauge error a sample", "output"),
    "inflow_sd": ("unknown inflow", "m³/s"), "inflow_memory": ("its correlation time", "s"),
    "level_sd": ("noise of the output", "output"), "level_memory": ("its correlation time", "s"),
    "wave": ("time of inflow by which its wave raises the level", "s"),
    "surface_area": ("water surface", "m²"), "misfit": ("fronts early or late by", "samples"),
    "sample_time": ("sample time", "s"), "recall": ("share of a level error left after a sample", ""),
}  # fmt: skip


def write_diagnosis(
    out: Path,
    diagnosis: Diagnosis,
    evidence: Evidence | None,
    *,
    draw: bool = True,
    reach: str = "Reach",
    classes: Mapping[str, type[Effect]] | None = None,
) -> Path:
    """Write the page (returned), diagnosis.json, unexplained_inflow.parquet and figures/diagnosis_*.png.

    Figures of an earlier diagnosis are removed, also without `draw`. `evidence` is None if there were too few
    data, and `classes` describe the effects by name, :func:`rivid.effects.effect_classes` by default. Each
    file is written atomically, diagnosis.json last, and equal results give equal bytes.
    """
    write_inflow(out / "unexplained_inflow.parquet", evidence)
    files = draw_pictures(out, diagnosis, evidence) if draw else []
    drop_old(out / "figures", files, plots.KINDS)
    known = effect_classes() if classes is None else classes
    shown, gap = quantities.as_shown(diagnosis), diagnosis.gap
    record = evidence.record if evidence is not None else None
    river = record is not None and record.kind == "river"
    context = {
        "d": shown,
        "reach": reach,
        "record": record,
        "output": "discharge" if river else "level",
        "ranking": quantities.explanations(diagnosis.ranking, diagnosis.verdict),
        "cards": [_card(e, known, record.dates[0] if record else None) for e in shown.effects],
        "noise": _noise(diagnosis.noise or {}, "m³/s" if river else "m"),
        "tables": [(e.name, _toml(e.table)) for e in diagnosis.effects if e.table],
        "figures": [(f, data_uri(f.path, "run the diagnosis again")) for f in files],
        "known": count(len(known), "effect"),
    }
    if gap is not None:
        factor, unit = quantities.scale(gap)
        hours = gap.horizon_h
        context |= {
            "factor": factor,
            "unit": unit,
            "rows": quantities.gap_rows(gap),
            "horizon": hours.index(4.0) if 4.0 in hours else len(hours) // 2,  # what a sentence states
            "grown": _grown(gap),
        }
    page = write_page(out / "diagnosis.html", "diagnosis", context)
    write_text(out / "diagnosis.json", diagnosis.to_json())
    return page


def draw_pictures(out: Path, diagnosis: Diagnosis, evidence: Evidence | None) -> list[FigureFile]:
    """Draw into OUT/figures, in the order of the page; without evidence the gap and the closed loop only."""
    folder, named = out / "figures", bool(diagnosis.effects)
    files: list[FigureFile | None] = []
    gap, loop = diagnosis.gap, diagnosis.closed_loop
    with styled():
        if gap is not None and np.isfinite(gap.rmse_baseline).any():
            rows, (_, unit) = quantities.gap_rows(gap), quantities.scale(gap)
            files.append(plots.draw_gap(folder, rows, gap.horizon_h, unit, len(gap.heldout_dates)))
        if loop is not None and loop.shown is not None:
            words = sentence("loop", loop, named)
            files.append(plots.draw_loop(folder, loop.shown, words, named=named))
        if evidence is not None and evidence.record.used.any():
            windows = [(quantities.name(f.name), *f.where.dates) for f in diagnosis.effects if f.where.dates]
            files += [draw(folder, evidence, named=named) for draw in (plots.draw_day, plots.draw_map)]
            files.append(plots.draw_inflow(folder, evidence, named=named, windows=windows))
    return [file for file in files if file is not None]


def write_inflow(path: Path, evidence: Evidence | None) -> None:
    """Write the unexplained inflow with its 95 % band, a row per used sample; see :data:`SCHEMA`."""
    columns: dict[str, Any] = {name: [] for name in SCHEMA.names}
    if evidence is not None:
        record, kept = evidence.record, evidence.record.used
        since = np.round(1000.0 * record.time[kept]).astype("timedelta64[ms]")
        time = np.datetime64(record.dates[0], "ms") + since
        e = evidence
        series = (e.inflow_after, e.inflow_after_sd), (e.inflow_before, e.inflow_before_sd)
        bands = [w[kept] + k * sd[kept] for w, sd in series for k in (0.0, -BAND, BAND)]
        columns = dict(zip(SCHEMA.names, [pa.array(time), *bands], strict=True))
    write_parquet(to_table(columns, SCHEMA), path)


def _grown(gap: Gap) -> list[tuple[str, float]]:
    """Steps with an error more than 1 % above that of the step before: name, horizon [h]."""
    before = [gap.rmse_baseline, *(step.rmse for step in gap.steps)]
    return [
        (step.added, h)
        for step, old in zip(gap.steps, before, strict=False)
        for h, a, b in zip(gap.horizon_h, old, step.rmse, strict=True)
        if b > 1.01 * a
    ]


def _card(
    effect: NamedEffect, classes: Mapping[str, type[Effect]], first: dt.date | None
) -> tuple[NamedEffect, type[Effect] | None, list[tuple[str, str, str]], int]:
    """An effect, its entry in the catalogue, its parameters (name, values, meaning), and how many more."""
    one = classes.get(effect.name)
    meanings = {} if one is None else {key: q.meaning for key, q in one.parameters().items()}
    rows = []
    for base, group in groupby(effect.parameters[:MOST_PARAMETERS], key=lambda p: p.name.split("[")[0]):
        of = list(group)
        second = quantities.converted(of[0], first) if len(of) == 1 else "in the order of time"
        meaning = "; ".join(part for part in (second, meanings.get(base, "")) if part)
        rows.append((base.replace("_", " "), "; ".join(map(quantities.estimate, of)), meaning))
    return effect, one, rows, max(len(effect.parameters) - MOST_PARAMETERS, 0)


def _noise(noise: Mapping[str, float | None], output: str) -> list[tuple[str, str]]:
    """Rows of the noise model: name, value with unit."""
    rows = []
    for key, value in noise.items():
        if value is None:
            continue
        name, unit = NOISE.get(key, (quantities.name(key), ""))
        factor, unit = shown_in(output) if unit == "output" else (1.0, unit)
        text = f"{value:,.0f}" if abs(value) >= 1e3 else f"{factor * value:.3g}"
        rows.append((name, quantities.period(value) if unit == "s" else f"{text} {unit}".strip()))
    return rows


def _toml(table: Mapping[str, Any]) -> str:
    """An effect as a table of a scenario, numbers to six digits."""

    def rounded(value: Any) -> Any:
        if isinstance(value, float):
            return float(f"{value:.6g}")
        return [rounded(v) for v in value] if isinstance(value, list | tuple) else value

    lines = tomli_w.dumps({key: rounded(value) for key, value in table.items()})
    return f"[[effects]]\n{lines}".rstrip()


def headline(diagnosis: Diagnosis) -> str:
    """Return the result in a sentence: what is missing, its size and its time."""
    return sentence("headline", quantities.as_shown(diagnosis))


def summary(diagnosis: Diagnosis, page: Path | None = None) -> str:
    """Return the result for a terminal in lines of at most 80 columns, but for the path of the `page`."""
    diagnosis = quantities.as_shown(diagnosis)
    ranking, lines = quantities.explanations(diagnosis.ranking, diagnosis.verdict)[0], list[str]()
    for line in terminal("diagnosis", d=diagnosis, ranking=ranking).splitlines():
        key, _, text = line.partition("\t")
        if key == "Gap":
            lines += _gap_lines(diagnosis.gap) if diagnosis.gap is not None else []
        else:
            lines += _entry(key, text)
    if page is not None:
        lines.append("Page".ljust(INDENT) + quantities.printable(str(page)))
    return "\n".join(lines).replace("m³", "m3").replace("m²", "m2").replace("–", "-")


def _entry(key: str, text: str) -> list[str]:
    """A key and its text, wrapped; the headline has no key."""
    if not key:
        return textwrap.wrap(text, WIDTH)
    begin = key.ljust(INDENT)
    return textwrap.wrap(text, WIDTH, initial_indent=begin, subsequent_indent=" " * INDENT) or [begin]


def _gap_lines(gap: Gap) -> list[str]:
    """The table of the gap: a row per simulation, a column per horizon."""
    _, unit = quantities.scale(gap)
    table = [(f"error [{unit}]", [f"{h:g} h" for h in gap.horizon_h])]
    for row in quantities.gap_rows(gap):
        indent = "  " if row.kind == "described" else ""
        table.append((indent + row.name, [quantities.error(v) for v in row.sealed]))
    if gap.steps:
        table.append(("squared error removed", [quantities.percent(share) for share in gap.reduced]))
    longest = WIDTH - INDENT - 8 * len(gap.horizon_h)
    width = min(max(len(name) for name, _ in table[1:]), longest)
    lines = []
    for i, (name, cells) in enumerate(table):
        short = name if len(name) <= width else f"{name[: width - 3]}..."
        start = ("Gap" if i == 0 else "").ljust(INDENT) + short.ljust(width)
        lines.append(start + "".join(f"{cell:>8}" for cell in cells))
    share = sentence("closed", gap)
    return lines + (_entry(" ", share) if share else [])
