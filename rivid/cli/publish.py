"""``rivid publish``."""

import datetime as dt
from pathlib import Path

import click

from rivid.cli import options as shared


@click.command("publish")
@click.argument("out", type=shared.PATH)
@shared.value("--to", str, "URL", "SQLAlchemy URL of the database.", "url", required=True)
@shared.value("--table", str, "NAME", "Name of the table.", default="rivid_delays", show_default=True)
@shared.first_day("write")
@shared.quiet
def command(out: Path, url: str, table: str, first: dt.date | None, quiet: bool) -> int:
    """Write the delays of the run OUT to a table of a database, for dashboards.

    The table is made where it does not exist; its columns are those of delays.csv. A row of the same day,
    reach and estimator is replaced, all others stay. $NAME in URL is a variable of the environment: passwords
    need not be written into a cron job.

    \b
    Examples:
      rivid publish out --to sqlite:///delays.db
      rivid publish out --to 'postgresql+psycopg://rivid:$WORD@db/plant'
    """
    from rivid.database import publish
    from rivid.results.read import load_delays

    delays = load_delays(out)
    if first:
        delays = delays[delays["date"] >= str(first)]
    rows = publish(delays, url, table)
    if not quiet:
        click.echo(f"{rows:,d} rows written to {table}")
    return 0
