"""``rivid simulate``."""

from pathlib import Path

import click

PATH = click.Path(path_type=Path)


@click.command("simulate", short_help="Make daily logs of a simulated reach, and their truth.")
@click.argument("scenario", type=PATH)
@click.option("--out", "-o", type=PATH, required=True, metavar="DATA_DIR", help="Where the daily logs go.")
@click.option("--seed", type=click.IntRange(min=0), help="Another season; default: the scenario's seed.")
@click.option(
    "--truth", type=PATH, metavar="FILE", help="Where the truth goes; default: <DATA_DIR>_truth.json."
)
def command(scenario: Path, out: Path, seed: int | None, truth: Path | None) -> int:
    """Make daily logs of a simulated reach, and apart from them the truth.

    SCENARIO is a TOML file. The same scenario and seed give the same files.

    \b
    Examples:
      rivid simulate configs/scenarios/basse_isere.toml --out simulated
      rivid simulate configs/scenarios/long.toml --out long_7 --seed 7
    """
    from rivid.errors import ConfigError
    from rivid.logs.write import stem_of, write_days
    from rivid.scenario import load_scenario
    from rivid.simulate import observables, simulate
    from rivid.simulate.truth import write_truth

    said = load_scenario(scenario)
    place = out.resolve()
    truth = place.with_name(f"{place.name}_truth.json") if truth is None else truth
    if truth.resolve().is_relative_to(place):
        raise ConfigError(f"the truth {truth} would lie among the logs in {out}: choose a place outside")
    season = simulate(said, seed)
    form, layout = said.output.format, said.output.layout
    ours = {f"{stem_of(date, layout)}.{form}" for date in season.dates}
    logs = {p.name for p in out.glob("*") if p.name.endswith((".csv", ".csv.gz", ".parquet"))}
    if logs - ours:
        raise ConfigError(
            f"{out} holds other logs ({sorted(logs - ours)[0]}, for one), which would mix with these: "
            "choose an empty directory"
        )

    columns = zip(season.inflow, season.outflow, season.level, strict=True)
    days = ({"u_Qi": u, "u_Qo": o, "h_L": h} for u, o, h in columns)
    files = write_days(
        out, zip(season.dates, days, strict=True), sample_time=season.sample_time, offset=said.offset,
        format=form, layout=layout,
    )  # fmt: skip
    write_truth(season, truth)
    seen = observables(season)
    delays = ", ".join(f"{d} on {n} days" for d, n in seen.delays.items())
    click.echo(
        f"{said.name}, seed {season.seed}: {seen.days} days from {season.dates[0]} to {season.dates[-1]}\n"
        f"discharge {seen.discharge_lowest:.0f} to {seen.discharge_highest:.0f} m3/s; over a day the inflow "
        f"moves by {seen.inflow_range:.0f} m3/s and the level by {seen.level_range:.2f} m\n"
        f"true delay [samples of {season.sample_time:g} s]: {delays}\n"
        f"{len(files)} files in {out}; truth in {truth}"
    )
    return 0
