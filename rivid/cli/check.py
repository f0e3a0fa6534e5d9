"""``rivid check``."""

import datetime as dt
import json
from pathlib import Path
from typing import Any

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, print_error
from rivid.errors import ConfigError, RividError
from rivid.text import count


@click.command("check")
@shared.data_dir
@shared.config(shared.CONFIG_OF_FLEET, shared.PATH)
@shared.value("--flags", shared.NEW_DIRECTORY, "DIR", "Write flags of single values: flags.csv and .parquet.")
@shared.value(
    "--maintenance", shared.FILE, "FILE", "Dates of work on the gauge: lines that begin as 2008-03-14."
)
@shared.as_json("One JSON object on stdout: every day, and a summary.")
@shared.talk
@shared.today
def command(
    data_dir: Path, config: Path | None, flags: Path | None, maintenance: Path | None, as_json: bool,
    console: Console, today: dt.date | None,
) -> int:  # fmt: skip
    """Report faults in the logs in DATA_DIR, without estimating.

    First the days that cannot be used, with the reason. Then faults that only many days together show:
    columns in another unit (a factor of 35.3 between inflow and outflow is cfs against m3/s), a water balance
    that does not close, a level that moves too much for the pool's area, exchanged inflow and outflow, clocks
    that are off by an hour or a day or that drift, a gauge that stands still or jumps, copied days, rows that
    come more or less often than sample_time, flows outside discharge_range. Each fault is reported once, with
    its dates. A fleet's directory is checked reach by reach. A jump of the gauge on a day of the maintenance
    file is explained, and no fault.

    Exit code: 0 no fault, 3 a fault, 2 an error in the configuration, 10 no logs.

    \b
    Examples:
      rivid check sample_data/basse_isere_csv
      rivid check sample_data/basse_isere --config configs/basse_isere.toml --json
      rivid check sample_data --config configs/fleet
      rivid check sample_data/basse_isere_csv --flags out/flags

    \b
    For a log with its outflow in another unit it prints:
      wrong: 2008-03-12 to 2008-03-16 (5 days): u_Qo is 35.3 times u_Qi, and
        1 m3/s is 35.3 cfs: is u_Qo in cfs? Set [input.units] u_Qo = "cfs"
    """
    from rivid.check import check
    from rivid.check import flags as of_values
    from rivid.check.findings import render
    from rivid.cli.locate import configuration, own
    from rivid.config import load_config
    from rivid.fleet.layout import find_fleet
    from rivid.logs.days import now_at
    from rivid.results.store import write_both

    given, config = config, configuration(config, data_dir, console)
    console.begin(("logs", data_dir), ("settings", config or "Table I"))
    console.phase("starting")
    fleet = find_fleet(data_dir, config, beside=None if given else own)
    if fleet is not None:
        if flags or maintenance:
            raise ConfigError("--flags and --maintenance are of one reach: give its directory of logs")
        return _fleet(fleet, as_json, console.quiet, today)
    settings = load_config(config)
    report = check(data_dir, settings, today or now_at(settings))
    if maintenance is not None:
        report = of_values.explained(report, of_values.read_maintenance(maintenance))
    if flags is not None:
        write_both(of_values.flags(report, data_dir, settings), flags / "flags")
    console.phase("reading and checking")
    if as_json:
        click.echo(json.dumps({"reach": settings.reach.name, **report.to_json()}))
    elif not console.quiet or report.exit_code:
        click.echo(render(report, settings.reach.name))
    return report.exit_code


def _fleet(reaches: Any, as_json: bool, quiet: bool, today: dt.date | None) -> int:
    """Check each reach by itself; an error of one does not stop the others."""
    from rivid.check import check
    from rivid.check.findings import render, render_sound
    from rivid.fleet.outcome import worst
    from rivid.logs.days import now_at
    from rivid.logs.spec import shown

    codes: list[int] = []
    answer: dict[str, Any] = {}
    for reach in reaches:
        name = shown(reach.name)
        try:
            settings = reach.config()
            report = check(reach.data_dir, settings, today or now_at(settings))
        except RividError as error:
            codes.append(error.exit_code)
            answer[name] = {"error": str(error), "exit_code": error.exit_code}
            if not as_json:
                print_error(f"{name}: {error}")
            continue
        codes.append(report.exit_code)
        answer[name] = report.to_json()
        if not as_json and (report.exit_code or not quiet):
            click.echo((render if report.exit_code else render_sound)(report, name) + "\n")
    code = worst(codes)
    if as_json:
        click.echo(json.dumps({"reaches": answer, "exit_code": code}))
    elif code or not quiet:
        faulty = sum(code != 0 for code in codes)
        click.echo(f"{count(len(codes), 'reach', 'reaches')}, {faulty} of them with faults")
    return code
