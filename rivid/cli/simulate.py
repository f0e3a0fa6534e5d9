"""``rivid simulate``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, wrap

if TYPE_CHECKING:
    from rivid.simulation import Season


@click.command("simulate")
@click.argument("scenario", type=shared.PATH)
@shared.logs_out
@shared.value("--days", click.IntRange(1), "N", "Length of the season; default: the scenario's.")
@shared.value("--seed", click.IntRange(min=0), "N", "Seed of the random numbers; default: the scenario's.")
@shared.value("--truth", shared.FILE, "FILE", "File of the truth; default: <DATA_DIR>_truth.json.")
@shared.talk
def command(
    scenario: Path, out: Path, days: int | None, seed: int | None, truth: Path | None, console: Console,
) -> int:  # fmt: skip
    """Simulate daily logs of a reach, and write the truth apart from them.

    SCENARIO is a TOML file. The same scenario and seed give the same files. The truth is two files: the
    delays, the effects and the scenario as JSON, and the true flows and levels of each sample as Parquet,
    next to it. Each reach of a cascade has its own directory of logs and pair of truths.

    \b
    Examples:
      rivid simulate configs/scenarios/basse_isere.toml --out out/logs
      rivid simulate configs/scenarios/effects/leakage.toml -o out/leak --days 60
      rivid simulate configs/scenarios/cascade.toml --out out/cascade
    """
    from rivid.api.inputs import as_scenario
    from rivid.errors import ConfigError
    from rivid.logs import suffix_of
    from rivid.logs.write import stem_of
    from rivid.simulation import simulate_cascade
    from rivid.simulation.scenario import load_scenario

    console.begin(("scenario", scenario), ("logs to", out))
    loaded = load_scenario(scenario)
    if days is not None:
        loaded = as_scenario(loaded, {"days": days})
    place = out.resolve()
    truth = place.with_name(f"{place.name}_truth.json") if truth is None else truth
    if truth.resolve().is_relative_to(place):
        raise ConfigError(f"the truth {truth} would lie among the logs in {out}: choose another directory")
    if truth.suffix == ".parquet":
        raise ConfigError(f"--truth {truth}: expected a .json; the true flows go next to it as .parquet")
    console.phase("starting")
    seasons = simulate_cascade(loaded, seed)
    console.phase("simulating")
    places = [(out, truth)]
    if loaded.cascade:
        names = [season.scenario.reach.name for season in seasons]
        places = [(out / name, truth.with_stem(f"{truth.stem}_{name}")) for name in names]
    for season, (logs, _) in zip(seasons, places, strict=True):
        made = season.scenario.output
        mine = {f"{stem_of(date, made.layout)}.{made.format}" for date in season.dates}
        there = {path.name for path in logs.glob("*") if suffix_of(path.name)}
        if others := sorted(there - mine):
            raise ConfigError(
                f"{logs} holds other logs, such as {others[0]}, which would mix with these: "
                "choose an empty directory"
            )
    for season, (logs, truth_file) in zip(seasons, places, strict=True):
        console.say("\n".join(map(wrap, _write(season, logs, truth_file))))
    console.phase("writing logs and truth")
    return 0


def _write(season: "Season", logs: Path, truth: Path) -> list[str]:
    """Write logs and truth; return the summary."""
    import numpy as np

    from rivid.logs.write import write_days
    from rivid.simulation.truth import write_truth, write_water
    from rivid.text import count

    scenario = season.scenario
    columns = zip(season.inflow, season.outflow, season.level, strict=True)
    days = ({"u_Qi": u, "u_Qo": o, "h_L": h} for u, o, h in columns)
    files = write_days(
        logs, zip(season.dates, days, strict=True), sample_time=season.sample_time, offset=scenario.offset,
        format=scenario.output.format, layout=scenario.output.layout,
    )  # fmt: skip
    water = truth.with_suffix(".parquet")
    write_truth(season, truth)
    write_water(season, water)
    found = zip(*np.unique(season.delay, return_counts=True), strict=True)
    delays = ", ".join(f"{d} on {n} days" for d, n in found)
    hidden = ", ".join(effect.name for effect in season.effects)
    flow = season.inflow.mean(axis=1)
    level = np.nanmax(season.level, axis=1) - np.nanmin(season.level, axis=1)
    return [
        f"{scenario.name}, {scenario.reach.name}, seed {season.seed}: {len(season.dates)} days from "
        f"{season.dates[0]} to {season.dates[-1]}",
        f"discharge {flow.min():.0f} to {flow.max():.0f} m3/s; over a day the inflow moves by "
        f"{np.ptp(season.inflow, axis=1).mean():.0f} m3/s and the level by {level.mean():.2f} m",
        f"true delay [samples of {season.sample_time:g} s]: {delays}",
        *([f"effects: {hidden}"] if hidden else []),
        f"{count(len(files), 'file')} in {logs}; truth in {truth} and {water.name}",
    ]
