"""The truth of a season as a file, apart from its logs."""

import json
from pathlib import Path

from rivid.atomic import write_text
from rivid.simulate.season import Season


def write_truth(season: Season, path: Path) -> None:
    """Write what an estimator should find, with the scenario and seed that made it, as JSON.

    Parameters
    ----------
    season : Season
    path : Path
        The file; it is replaced as a whole. A line for each day, so that two versions can be compared.
    """
    reach = season.scenario.reach
    record = {
        "scenario": season.scenario.model_dump(mode="json"),
        "seed": season.seed,
        "alpha_i": reach.inflow_gain * reach.sample_time / reach.surface_area,
        "alpha_o": reach.outflow_gain * reach.sample_time / reach.surface_area,
    }
    rows = [
        json.dumps(
            {
                "date": date.isoformat(),
                "travel_time_s": round(float(season.travel_time[i]), 3),
                "delay_samples": int(season.delay[i]),
                "delay_other": int(season.delay_other[i]),
                "near_edge": bool(season.near_edge[i]),
            }
        )
        for i, date in enumerate(season.dates)
    ]
    head = json.dumps(record, indent=1).removesuffix("\n}")
    write_text(path, head + ',\n "days": [\n  ' + ",\n  ".join(rows) + "\n ]\n}\n")
