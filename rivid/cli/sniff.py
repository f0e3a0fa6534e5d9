"""``rivid sniff``."""

from pathlib import Path

import click

from rivid.cli import options as shared


@click.command("sniff")
@shared.exports()
@shared.value(
    "--time-zone", str, "NAME",
    "Zone of its clock, as Europe/Paris or America/Los_Angeles; Etc/GMT+8 is 8 h behind UTC.",
)  # fmt: skip
def command(exports: tuple[Path, ...], time_zone: str | None) -> int:
    """Propose an [input] block for EXPORTS, one exported file, or several of one dialect.

    Comments list what the files alone do not determine: which discharge is the inflow (a list of columns is
    a sum), the zone, whether a time is the start or end of an interval.

    \b
    Examples:
      rivid sniff sample_data/glen_canyon/2024-05-01.csv
      rivid sniff tests/data/exports/french/telereleve.csv --time-zone Etc/GMT-1
    """
    from rivid.config import parse
    from rivid.input_config import InputConfig
    from rivid.logs.sniff.propose import sniff

    parse({"time_zone": time_zone}, InputConfig, "--time-zone")
    click.echo(sniff(exports, time_zone).toml, nl=False)
    return 0
