"""``rivid sniff``."""

from pathlib import Path

import click


@click.command("sniff", short_help="Propose an [input] block for a foreign CSV.")
@click.argument("export", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option("--time-zone", metavar="NAME", help="Zone of its clock, as Europe/Paris.")
def command(export: Path, time_zone: str | None) -> int:
    """Propose an [input] block for EXPORT, a CSV from elsewhere.

    What the file alone does not tell is said in comments.

    \b
    Example:
      rivid sniff export.csv --time-zone Europe/Paris > reach.toml
    """
    from rivid.config import InputConfig, parse
    from rivid.logs.sniff import sniff

    parse({"time_zone": time_zone}, InputConfig, "--time-zone")
    click.echo(sniff(export, time_zone).toml, nl=False)
    return 0
