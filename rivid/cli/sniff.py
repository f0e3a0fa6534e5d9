"""``rivid sniff``."""

from pathlib import Path

import click


@click.command("sniff", short_help="Propose an [input] block for a foreign export.")
@click.argument(
    "exports", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True, dir_okay=False)
)
@click.option("--time-zone", metavar="NAME", help="Zone of its clock, as Europe/Paris.")
def command(exports: tuple[Path, ...], time_zone: str | None) -> int:
    """Propose an [input] block for EXPORTS, one file from elsewhere, or several of one dialect.

    What the files alone do not tell is said in comments.

    \b
    Example:
      rivid sniff export.csv --time-zone Europe/Paris > reach.toml
    """
    from rivid.config import InputConfig, parse
    from rivid.logs.sniff import sniff

    parse({"time_zone": time_zone}, InputConfig, "--time-zone")
    click.echo(sniff(exports, time_zone).toml, nl=False)
    return 0
