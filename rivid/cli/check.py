"""``rivid check``."""

import datetime as dt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, print_error

if TYPE_CHECKING:
    from rivid.check import Report
    from rivid.config import Config


@click.command("check", short_help="Say what is wrong with the logs, without estimating.")
@shared.data_dir()
@shared.config(shared.CONFIG_OF_FLEET, type=shared.PATH)
@shared.as_json("One JSON object on stdout: every day, and a summary.")
@shared.talk()
@shared.today()
def command(
    data_dir: Path,
    config: Path | None,
    as_json: bool,
    quiet: bool,
    verbose: bool,
    today: dt.datetime | None,
) -> int:
    """Say what is wrong with the logs in DATA_DIR, without estimating.

    Days that cannot be used, and why; then what only many days together tell: columns in another unit (a
    factor of 35.3 between inflow and outflow is cfs against m3/s), a water balance that does not close, a
    level that moves too much for the pool's area, inflow and outflow swapped, clocks that are off by an hour
    or a day or drift, a gauge that stands still or jumps, days that are copies of others, rows that come more
    or less often than sample_time says. Each is said once, with its dates. A fleet's directory is checked
    reach by reach.

    Exit code: 0 all fine, 3 something is wrong, 2 the configuration is, 10 no logs.

    \b
    Examples:
      rivid check sample_data/basse_isere_csv
      rivid check sample_data/basse_isere --config configs/basse_isere.toml --json
      rivid check sample_data --config configs/fleet

    \b
    Of a log whose outflow is in another unit it says:
      wrong: 2008-03-12 to 2008-03-16 (5 days): u_Qo is 35.3 times u_Qi, and
        1 m3/s is 35.3 cfs: is u_Qo in cfs? Set [input.units] u_Qo = "cfs"
    """
    import json

    from rivid.cli.locate import configuration, own
    from rivid.config import load_config
    from rivid.fleet.layout import find_fleet

    console = Console(quiet, verbose)
    given, config = config, configuration(config, data_dir, console)
    console.begin(("logs", data_dir), ("settings", config or "Table I"))
    console.phase("starting")
    fleet = find_fleet(data_dir, config, beside=None if given else own)
    if fleet is not None:
        return _fleet(fleet, as_json, quiet, today)
    settings = load_config(config)
    report = _report(data_dir, settings, today)
    console.phase("reading and looking")
    if as_json:
        click.echo(json.dumps({"reach": settings.reach.name, **report.to_json()}))
    elif not quiet or report.exit_code:
        from rivid.check.findings import in_words

        click.echo(in_words(report, settings.reach.name))
    return report.exit_code


def _report(data_dir: Path, settings: "Config", today: dt.datetime | None) -> "Report":
    from zoneinfo import ZoneInfo

    from rivid.check import check

    zone = settings.input.time_zone
    # without a configured zone it is the log's own that says which day it is
    now = dt.datetime.now(ZoneInfo(zone)).date() if zone else dt.datetime.now(dt.UTC)
    return check(data_dir, settings, today.date() if today else now)


def _fleet(reaches: Any, as_json: bool, quiet: bool, today: dt.datetime | None) -> int:
    """Each reach by itself; what one lacks is its own."""
    import json

    from rivid.check.findings import in_a_line, in_words
    from rivid.errors import RividError
    from rivid.fleet.outcome import worst
    from rivid.logs.files import shown

    codes: list[int] = []
    told: dict[str, Any] = {}
    for reach in reaches:
        name = shown(reach.name)
        try:
            report = _report(reach.data_dir, reach.config(), today)
        except RividError as error:
            codes.append(error.exit_code)
            told[name] = {"error": str(error), "exit_code": error.exit_code}
            if not as_json:
                print_error(f"{name}: {error}")
            continue
        codes.append(report.exit_code)
        told[name] = report.to_json()
        if not as_json and (report.exit_code or not quiet):
            click.echo(in_words(report, name) + "\n" if report.exit_code else in_a_line(report, name) + "\n")
    code = worst(codes)
    if as_json:
        click.echo(json.dumps({"reaches": told, "exit_code": code}))
    elif code or not quiet:
        wrong = sum(code != 0 for code in codes)
        click.echo(f"{len(codes)} reaches, {wrong} of them with something wrong")
    return code
