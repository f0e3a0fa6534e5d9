"""report.html and the page of the paper's figures: numbers and files for the templates."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rivid.estimators import ESTIMATORS
from rivid.plots.files import FigureFile
from rivid.report import strip
from rivid.report.attention import SHOWN, attention, counted, dates_of
from rivid.report.page import data_uri, write_page
from rivid.report.summary import STEP_DAYS, WEEKS, facts, last_week, summarise
from rivid.results.read import CLEAR, Results, passage, rounded

if TYPE_CHECKING:
    from rivid.plots.paper_data import Year

MOST = 400  # rows of days to look at, which a browser lays out at once; delays.csv has all days

ORDER = ("t50", "t50_discharge", "tdr", "delay_map", "histogram", "delay_discharge")
"""Figures of an estimator in the order in which they are read; any other comes after."""
PARTS = (  # headings of the page of the paper's figures, and the figures under each
    ("The reach and its hydraulics", ("1", "2", "3", "4", "5", "6")),
    ("The data, and the simple models", ("7", "8", "9", "10")),
    ("One day", ("11", "12")),
    ("The year", ("13", "14", "15", "16", "17", "18")),
    ("The cascade", ("19",)),
)


def write_report(
    results: Results, figures: Sequence[FigureFile], out: Path, *, summary: Mapping[str, Any]
) -> Path:
    """Write OUT/report.html, which needs no other file and requests nothing from any server; return its path.

    `figures` are embedded in order of their estimators; `summary` is run.json.
    """
    recent = last_week(results)
    rows = attention(results, recent)
    s = summarise(results, recent)
    place = {  # of a day in the table, in its first row
        date: k
        for k, row in reversed(list(enumerate(rows)))
        if recent and recent.estimator.estimator in row["estimators"]
        for date in dates_of(row, results)
    }
    represents = s["passage"] or s["record"]
    context = {
        "s": s,
        "results": results,
        "recent": recent,
        "look": counted(results, recent, rows) if recent else None,
        "strip": strip.strip(recent, results.sample_time, place) if recent else None,
        "frame": strip.FRAME,
        "rows": list(enumerate(rows[:MOST])),
        "unlisted": max(len(rows) - MOST, 0),
        "open": SHOWN,
        "most": MOST,
        "weeks": WEEKS,
        "step_days": STEP_DAYS,
        "clear": CLEAR,
        "probable": any(ESTIMATORS[e.estimator].has_probability for e in results.estimators if e.dates),
        "rounded": {e.estimator for e in results.estimators if e.dates and rounded(results, e)},
        "not_judged": any(ESTIMATORS[e.estimator].unjudged for e in results.estimators),
        "estimators": [(e, facts(results, e), passage(results, e)) for e in results.estimators if e.dates],
        "groups": _groups(figures, represents["estimator"] if represents else ""),
        "bad_files": [(str(f), str(why)) for f, why in summary.get("bad_files") or ()][:MOST],
        "settings": _settings(summary),
        "versions": [(str(k), str(v)) for k, v in dict(summary.get("versions") or {}).items()],
    }
    return write_page(out / "report.html", "report", context)


def write_gallery(year: "Year", figures: Sequence[FigureFile], folder: Path) -> Path:
    """Write index.html, the page of the paper's figures, into the folder of the figures; return its path."""
    context = {
        "year": year,
        "parts": [
            (heading, f"part{i}", [f for f in figures if f.kind in numbers])
            for i, (heading, numbers) in enumerate(PARTS, 1)
        ],
    }
    return write_page(folder / "index.html", "paper", context)


def _groups(figures: Sequence[FigureFile], lead: str) -> list[tuple[str, list[tuple[int, FigureFile, str]]]]:
    """Figures by estimator: the leading one first, those of all estimators after it, then the others."""
    names = dict.fromkeys(f.estimator for f in figures)
    order = sorted(names, key=lambda name: (name != lead, name != ""))

    def read(file: FigureFile) -> int:
        # of a posterior's tdr, the response to the inflow alone, which a level keeps: no jump is seen
        last = file.kind not in ORDER or (file.kind == "tdr" and ESTIMATORS[file.estimator].has_probability)
        return len(ORDER) if last else ORDER.index(file.kind)

    shown = sorted(figures, key=lambda file: (order.index(file.estimator), read(file)))
    numbered = [(k, file, data_uri(file.path)) for k, file in enumerate(shown)]
    return [(name, [one for one in numbered if one[1].estimator == name]) for name in order]


def _settings(summary: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Sections of the configuration as text, and the values in use where the configuration has "bounds"."""
    keys = {"d_min": "d_min", "d_max": "d_max", "order": "order", "delay_scale": "sigma_d"}
    tables = {"in use": {key: summary[name] for name, key in keys.items() if name in summary}}
    tables |= {f"[{section}]": keys for section, keys in (summary.get("config") or {}).items()}
    return [
        (section, [(str(k), _plain(v)) for k, v in keys.items()])
        for section, keys in tables.items()
        if isinstance(keys, Mapping) and (keys or section != "in use")
    ]


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
