"""``rivid sniff``."""

from pathlib import Path

import click

from rivid.cli import options as shared
from rivid.cli.console import WIDTH, wrap


@click.command("sniff")
@shared.exports()
@click.option(
    "--time-zone",
    metavar="NAME",
    help="Zone of its clock, as Europe/Paris or America/Los_Angeles; Etc/GMT+8 is 8 h behind UTC.",
)
def command(exports: tuple[Path, ...], time_zone: str | None) -> int:
    """Propose an [input] block for EXPORTS, one file from elsewhere, or several of one dialect.

    What the files alone do not tell is said in comments: which discharge is the inflow (a list of columns
    is a sum), the zone, what a time stands for.

    \b
    Examples:
      rivid sniff sample_data/glen_canyon/2024-05-01.csv
      rivid sniff tests/data/exports/french/telereleve.csv --time-zone Etc/GMT-1
    """
    from rivid.config import InputConfig, parse
    from rivid.logs.sniff.propose import sniff

    parse({"time_zone": time_zone}, InputConfig, "--time-zone")
    click.echo("\n".join(map(_narrow, sniff(exports, time_zone).toml.split("\n"))), nl=False)
    return 0


def _narrow(line: str) -> str:
    """A line of TOML in lines of at most 80 columns, where it is a comment or a list; they mean the same."""
    if len(line) <= WIDTH:
        return line
    if line.startswith("# "):
        choice = _narrow_list(line[2:], WIDTH - 2)
        if choice is not None:
            return "\n".join(f"# {one}" for one in choice.split("\n"))
        hanging = "#   " if line.startswith("# - ") else "# "
        first, *rest = wrap(line, hanging=0, width=WIDTH - 2).split("\n")
        return "\n".join([first, *(hanging + more for more in rest)])
    return _narrow_list(line, WIDTH) or line


def _narrow_list(line: str, width: int) -> str | None:
    """`key = [...]` with its values in lines of their own; None for anything else."""
    import json
    import tomllib

    try:
        said = tomllib.loads(line)
        ((key, values),) = said.items()
        if not isinstance(values, list):
            return None
        lines = [""]
        for value in values:
            word = json.dumps(value, ensure_ascii=False)
            if len(lines[-1]) + len(word) > width - 8:
                lines.append("")
            lines[-1] += f"{word}, "
        several = "\n".join([f"{line.partition('[')[0]}[", *(f"    {one.rstrip()}" for one in lines), "]"])
        return several if tomllib.loads(several) == said else None
    except (ValueError, TypeError):
        return None
