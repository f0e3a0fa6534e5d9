"""Make the simulated sample data again, the same bytes: the year, a week of CSV, the truth, the READMEs.

Usage, in the root of the repository: PYTHONPATH=. python sample_data/make.py
"""

import datetime as dt
from pathlib import Path

import numpy as np

from benchmarks.observables import ORDER, observables
from rivid.atomic import write_text
from rivid.core.fir import ml
from rivid.logs.write import write_days
from rivid.simulation import Season, simulate
from rivid.simulation.scenario import load_scenario
from rivid.simulation.truth import write_truth

HERE = Path(__file__).parent
SCENARIO = HERE.parent / "configs" / "scenarios" / "basse_isere.toml"
WEEK = [dt.date(2008, 3, 10) + dt.timedelta(days=k) for k in range(7)]

YEAR_README = """\
# A simulated year of a managed pool

{days} days of 2008, a Parquet file a month, {samples} samples a day, every {sample_time:g} s from local
midnight (UTC{offset}) on:

| column | what | unit |
|---|---|---|
| `time` | sample time | timestamp with offset |
| `u_Qi` | inflow command, upstream dam | m3/s |
| `u_Qo` | outflow command, downstream dam | m3/s |
| `h_L` | level at the downstream dam, to the centimetre | m |

Nothing here was measured. A pool of the paper's Table I (8200 m, 81.6 m, 4.9 m, 6.7e5 m2) carries a
gravity wave with the travel time of (5), {fast:.1f} to {slow:.1f} T_s by flow. A dispatcher upstream
follows the load. Operators downstream, in three shifts a day, follow (9) at every sample, in whole
m3/s, with gains that differ between operators. A slow trim brings the level back: (9) alone does not hold
it for a year. A small slow inflow is in no log. {missing} days of the year are left out.

Made by

    rivid simulate configs/scenarios/basse_isere.toml --out sample_data/basse_isere

(`make sample-data` does this and the rest). The truth is not here but beside, in
`../basse_isere_truth.json`: each day's travel time and delay. Where the travel time is within 0.1 sample of
a whole number, `near_edge` is true and `delay_other` counts as right too.

## Beside the paper's year

The scenario was set from what the paper states: the reach from Table I, the flows from section II, the
operators from (9) with the decay of Fig. 10. It was never set from the result of an estimator.

{table}
U has {order} columns and holds the inflow's deviation from the day's first sample.

Two things differ. The level moves less over a day than the paper's mean: feedback as strong as in Fig. 10
holds it (section III has "a few centimeters"). And the first jump of the response, h[0] > h[1], is there on
{jump:.0%} of days (ML), not on all: (10) begins from a stationary point, and a day at midnight does not.
`../../docs/paper.md` has the measurements.
"""

WEEK_README = """\
# A week of the simulated year as CSV

{first} to {last} of `../basse_isere`, a file a day: `time` (ISO 8601 with offset), `u_Qi` and
`u_Qo` [m3/s], `h_L` [m]. The same season, so the same truth: `../basse_isere_truth.json`.
Nothing here was measured.

Made by `make sample-data`. A whole year of such files comes from `configs/scenarios/basse_isere.toml` with
`format = "csv"` and `layout = "day"` under `[output]`:

    rivid simulate SCENARIO.toml --out DATA_DIR
"""


EXPORT_README = """\
# An export as a plant's historian writes it

`station_2008-03.txt`: {first} to {last} of a simulated pool like `../basse_isere`, every two
minutes, as such files come: lines of preamble, semicolons, decimal commas, `dd.mm.yyyy`, a row of units,
the level in centimetres, a column of flags, values that are not there. Nothing here was measured. The README
of the project walks from it to a report.

Made by `make sample-data` from `configs/scenarios/basse_isere.toml` with another sample time and seed.
"""


def main() -> None:
    """Write everything."""
    scenario = load_scenario(SCENARIO)
    season = simulate(scenario)
    when = {"sample_time": season.sample_time, "offset": scenario.offset}
    year = [(date, columns(season, i)) for i, date in enumerate(season.dates)]
    write_days(HERE / "basse_isere", year, **when, format="parquet", layout="month")
    write_days(HERE / "basse_isere_csv", [day for day in year if day[0] in WEEK], **when)
    write_truth(season, HERE / "basse_isere_truth.json")
    export(HERE / "export" / "station_2008-03.txt")
    fir = ml(season.inflow - season.inflow[:, :1], season.level - season.level[:, :1]).fir
    travel = season.travel_time / season.sample_time
    text = YEAR_README.format(
        days=len(season.dates), samples=len(season.seconds), sample_time=season.sample_time,
        offset=scenario.utc_offset, missing=scenario.missing_days, order=ORDER,
        table=observables(season).table(), jump=(fir[:, 0] > fir[:, 1]).mean(),
        fast=travel.min(), slow=travel.max(),
    )  # fmt: skip
    write_text(HERE / "basse_isere" / "README.md", text)
    write_text(HERE / "basse_isere_csv" / "README.md", WEEK_README.format(first=WEEK[0], last=WEEK[-1]))


def export(path: Path) -> None:
    """A fortnight in the dialect of a historian."""
    again = load_scenario(SCENARIO).model_copy(
        update={"first_day": dt.date(2008, 3, 3), "days": 14, "missing_days": 0, "seed": 11}
    )
    scenario = again.model_copy(update={"reach": again.reach.model_copy(update={"sample_time": 120.0})})
    season = simulate(scenario)
    rng = np.random.default_rng(11)
    lines = [
        "Historian Export;Station 4711",
        "created;17.03.2008 06:02:11",
        "",
        "Zeit;Q_Oberwasser;Q_Unterwasser;Pegel;Status",
        ";m\u00b3/s;m\u00b3/s;cm;",
    ]
    for i, date in enumerate(season.dates):
        bad = rng.random(len(season.seconds)) < 0.002
        for k, second in enumerate(season.seconds):
            moment = dt.datetime.combine(date, dt.time()) + dt.timedelta(seconds=float(second))
            level = -9999.0 if bad[k] else season.level[i, k] * 100
            cells = [
                f"{value:.1f}".replace(".", ",")
                for value in (season.inflow[i, k], season.outflow[i, k], level)
            ]
            lines.append(";".join([f"{moment:%d.%m.%Y %H:%M:%S}", *cells, "B" if bad[k] else "G"]))
    text = "\r\n".join(lines) + "\r\n"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(text.encode("latin-1"))
    write_text(path.parent / "README.md", EXPORT_README.format(first=season.dates[0], last=season.dates[-1]))


def columns(season: Season, i: int) -> dict:
    """Canonical columns of a day."""
    return {"u_Qi": season.inflow[i], "u_Qo": season.outflow[i], "h_L": season.level[i]}


if __name__ == "__main__":
    main()
