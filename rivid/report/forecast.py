"""forecast.csv, forecast.parquet, the JSON lines and the page of a forecast."""

import json
from pathlib import Path
from typing import Any

from rivid.config import Config
from rivid.forecast import Forecast
from rivid.report.page import data_uri, write_page
from rivid.results.store import described, finite, to_table, write_both
from rivid.types import HOUR

SCHEMA, MEANINGS = described("""
time | moment | | of the sample
reach | text | | its name
horizon_h | number | h | after the origin of the forecast
median | number | output unit | of the output: level or discharge
low_50 | number | output unit | lower end of the 50 % band
high_50 | number | output unit | its upper end
low_90 | number | output unit | lower end of the 90 % band
high_90 | number | output unit | its upper end
inflow_m3s | number | m3/s | u_Qi, announced or held at its last value
outflow_m3s | number | m3/s | u_Qo, announced or held at its last value; empty for a river
announced | flag | | the flows are those of the logs
output_unit | text | | `m` for a level, `m3/s` for a discharge
""")
"""A row for each sample after the origin."""


def columns(found: Forecast, config: Config) -> dict[str, list[Any]]:
    s, q = found.series, found.quantiles
    count, pool = q.shape[1], config.reach.kind == "pool"
    later = slice(s.now + 1, None)
    return {
        "time": [s.moment(s.now + 1 + k) for k in range(count)], "reach": [config.reach.name] * count,
        "horizon_h": [(k + 1) * config.reach.sample_time / 3600.0 for k in range(count)],
        "median": q[2].tolist(), "low_50": q[1].tolist(), "high_50": q[3].tolist(),
        "low_90": q[0].tolist(), "high_90": q[4].tolist(), "inflow_m3s": s.inflow[later].tolist(),
        "outflow_m3s": s.outflow[later].tolist() if pool else [None] * count,
        "announced": [k < found.announced for k in range(count)],
        "output_unit": [config.reach.output_unit] * count,
    }  # fmt: skip


def write_tables_of(found: Forecast, config: Config, out: Path) -> None:
    """Write forecast.csv and forecast.parquet into OUT, each atomically."""
    write_both(to_table(columns(found, config), SCHEMA), out / "forecast")


def lines(found: Forecast, config: Config) -> list[str]:
    """A JSON object for each row; times with the offset of the log."""
    given = columns(found, config)
    return [
        json.dumps(finite(dict(zip(given, row, strict=True))), default=lambda time: time.isoformat())
        for row in zip(*given.values(), strict=True)
    ]


def headline(found: Forecast, config: Config) -> str:
    """The forecast in a sentence: where the output goes, when, and how sure that is."""
    s, q = found.series, found.quantiles
    unit, pool = config.reach.output_unit.replace("m3", "m³"), config.reach.kind == "pool"
    digits, what = (2, "level") if pool else (0, "discharge")
    hours = q.shape[1] * config.reach.sample_time / HOUR
    ends = sorted(((int(q[2].argmin()), "lowest"), (int(q[2].argmax()), "highest")))
    parts = [
        f"{word} at {s.moment(s.now + 1 + k):%H:%M} with {q[2, k]:.{digits}f} {unit} "
        f"({q[0, k]:.{digits}f} to {q[4, k]:.{digits}f})"
        for k, word in ends
    ]
    return f"In the next {hours:.3g} h the {what} is {parts[0]} and {parts[1]}; in brackets 90 %."


def write_page_of(found: Forecast, config: Config, out: Path) -> Path:
    """Draw figures/forecast.png and write forecast.html; return the page."""
    from rivid.plots.forecast import draw

    s, q, reach = found.series, found.quantiles, config.reach
    figure = draw(found, reach.name, reach.output_unit, out / "figures")
    pool = reach.kind == "pool"
    digits, logged = (3, (s.inflow, s.outflow)) if pool else (1, (s.inflow,))
    rows = []
    each = max(round(HOUR / reach.sample_time), 1)
    for k in range(each - 1, q.shape[1], each):
        at = s.now + 1 + k
        rows.append((s.moment(at), [f"{v:.{digits}f}" for v in q[:, k]] + [f"{v[at]:.0f}" for v in logged]))
    assumed = found.announced < q.shape[1]
    context = {
        "reach": reach, "found": found, "at": s.moment(s.now), "rows": rows, "pool": pool,
        "headline": headline(found, config), "figure": figure, "uri": data_uri(figure.path),
        "assumed": s.moment(s.now + 1 + found.announced) if assumed else None,
    }  # fmt: skip
    return write_page(out / "forecast.html", "forecast", context)
