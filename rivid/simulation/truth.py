"""The truth of a season as files."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from rivid.atomic import replacing, write_text
from rivid.effects import worlds_of
from rivid.simulation.season import Season, Water


def write_truth(season: Season, path: Path) -> None:
    """Write the truth of a season with its scenario and seed as JSON, a line for each day."""
    reach = season.scenario.reach
    area = Water(season.scenario).surface_area
    record: dict[str, Any] = {
        "scenario": season.scenario.model_dump(mode="json", exclude_none=True),
        "seed": season.seed,
        "surface_area_m2": area,
        "alpha_i": reach.inflow_gain * reach.sample_time / area,
        "alpha_o": reach.outflow_gain * reach.sample_time / area,
        "effects": [],
    }
    for effect, world in zip(season.effects, worlds_of(season.effects, season.world), strict=True):
        events = getattr(effect, "events", None)  # of random effects
        record["effects"].append(effect.to_table() | ({} if events is None else {"events": events(world)}))
    rows = [
        json.dumps({
            "date": date.isoformat(), "travel_time_s": round(float(season.travel_time[i]), 3),
            "delay_samples": int(season.delay[i]), "delay_other": int(season.delay_other[i]),
            "near_edge": bool(season.near_edge[i]),
        })
        for i, date in enumerate(season.dates)
    ]  # fmt: skip
    head = json.dumps(record, indent=1, default=str).removesuffix("\n}")
    write_text(path, head + ',\n "days": [\n  ' + ",\n  ".join(rows) + "\n ]\n}\n")


def write_water(season: Season, path: Path) -> None:
    """Write true level and flows at each sample, as Parquet.

    Columns: date, seconds after local midnight, true level [m], real inflow and outflow of the dams, the
    weather, and all flows other than through the dams that do not depend on the level [m3/s].
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    n = len(season.seconds)
    days = np.repeat(np.array(season.dates, "datetime64[D]"), n)
    columns = {
        "date": pa.array(days),
        "seconds": pa.array(np.tile(season.seconds, len(season.dates))),
        "level_m": pa.array(season.true_level.ravel()),
        "inflow_m3s": pa.array(season.real_inflow.ravel()),
        "outflow_m3s": pa.array(season.real_outflow.ravel()),
        "weather_m3s": pa.array(season.weather.ravel()),
        "unlogged_m3s": pa.array(season.unlogged.ravel()),
    }
    with replacing(path) as scratch:
        pq.write_table(pa.table(columns), scratch, compression="zstd", write_page_checksum=True)
