"""The season's tables in OUT: answers a day, the law, and the law as a controller's table."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from rivid.atomic import replacing, write_text
from rivid.core.law.delay_law import DelayLaw
from rivid.seasons.days import SeasonDays
from rivid.seasons.joined import Joined
from rivid.tables import to_table, write_parquet

NAME = "posterior-season"

SCHEMA = pa.schema(
    [
        ("date", pa.date32()),
        ("reach", pa.string()),
        ("estimator", pa.string()),
        ("delay_samples", pa.float64()),
        ("delay_s", pa.float64()),
        ("probability", pa.float64()),
        ("delay_low", pa.float64()),
        ("delay_high", pa.float64()),
        ("observed", pa.bool_()),
        ("direction", pa.string()),
    ]
)
"""season.csv and season.parquet: a row per calendar day."""

MEANINGS: dict[str, tuple[str, str]] = {
    "date": ("", "the calendar day, with a log or without"),
    "reach": ("", "its name"),
    "estimator": ("", f"`{NAME}`"),
    "delay_samples": ("samples", "likeliest delay, the days joined; empty where it is not probable enough"),
    "delay_s": ("s", "the travel time, of a river t50"),
    "probability": ("", "that this delay is right"),
    "delay_low": ("samples", "shortest delay of the 90 % set"),
    "delay_high": ("samples", "longest delay of the 90 % set"),
    "observed": ("", "the day had probabilities of its own"),
    "direction": ("", "`forward`: from the days before; `both`: from all days"),
}
"""Unit and meaning of each column of :data:`SCHEMA`."""

LAW_SCHEMA = pa.schema(
    [
        *((f"{name}_m3s", pa.float64()) for name in ("discharge_low", "discharge_high", "discharge")),
        *((f"{name}_s", pa.float64()) for name in ("delay", "delay_low", "delay_high")),
        *((f"{name}_s", pa.float64()) for name in ("day_low", "day_high", "observed")),
        ("n", pa.int64()),
    ]
)
"""delay_law.csv: a row per class of discharge."""

LAW_MEANINGS: dict[str, tuple[str, str]] = {
    "discharge_low_m3s": ("m3/s", "lower edge of the class"),
    "discharge_high_m3s": ("m3/s", "upper edge of the class"),
    "discharge_m3s": ("m3/s", "median discharge of its days"),
    "delay_s": ("s", "travel time by the law; of a river t50"),
    "delay_low_s": ("s", "lower end of the law's 90 % interval"),
    "delay_high_s": ("s", "upper end of it"),
    "day_low_s": ("s", "lower end of the 90 % interval of a single day"),
    "day_high_s": ("s", "upper end of it"),
    "observed_s": ("s", "median of the days' own answers"),
    "n": ("days", "in the class"),
}
"""Unit and meaning of each column of :data:`LAW_SCHEMA`."""


def write_season(days: SeasonDays, joined: Joined, law: DelayLaw, out: Path) -> None:
    """Write season.csv, season.parquet, delay_law.csv and delay_law.json into OUT, each atomically."""
    n = len(days.dates)
    columns: dict[str, list[Any]] = {
        "date": list(days.dates), "reach": [days.reach] * n, "estimator": [NAME] * n,
        "delay_samples": joined.delay.tolist(), "delay_s": joined.travel.tolist(),
        "probability": joined.sure.tolist(), "delay_low": joined.low.tolist(),
        "delay_high": joined.high.tolist(), "observed": joined.observed.tolist(),
        "direction": [joined.direction] * n,
    }  # fmt: skip
    table = to_table(columns, SCHEMA)
    write_parquet(table, out / "season.parquet")
    _write_csv(table, out / "season.csv")
    t = law.table
    values = (t.discharge_low, t.discharge_high, t.discharge, t.delay, t.low, t.high, t.day_low, t.day_high,
              t.observed, t.n)  # fmt: skip
    classes = {name: v.tolist() for name, v in zip(LAW_SCHEMA.names, values, strict=True)}
    _write_csv(to_table(classes, LAW_SCHEMA), out / "delay_law.csv")
    write_text(out / "delay_law.json", json.dumps(law_json(days, law), indent=2, sort_keys=True) + "\n")


def law_json(days: SeasonDays, law: DelayLaw) -> dict[str, Any]:
    """delay_law.json: the law in seconds and m3/s; null where there is none."""
    said = {name: v for name, v in asdict(law).items() if name != "table"}
    said["covariance"] = law.covariance.tolist() if law.status == "ok" else None
    finite = {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in said.items()}
    units = {"T0": "s", "Q0": "m3/s", "b": "-", "scatter": "-", "covariance": "of (ln T0, b)"}
    return finite | {
        "reach": days.reach, "estimator": "posterior", "law": "T = T0 (Q / Q0)^-b", "units": units,
        "quantity": "t50" if days.river else "travel time", "sample_time": days.sample_time,
        "first": str(days.dates[0]), "last": str(days.dates[-1]),
    }  # fmt: skip


def _write_csv(table: pa.Table, path: Path) -> None:
    with replacing(path) as scratch:
        pyarrow.csv.write_csv(table, scratch, pyarrow.csv.WriteOptions(quoting_style="needed"))
