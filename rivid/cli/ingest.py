"""``rivid ingest``."""

import datetime as dt
from pathlib import Path
from typing import Any

import click

_DATE = click.DateTime(["%Y-%m-%d"])
_PATH = click.Path(path_type=Path)


@click.command("ingest", short_help="Make daily logs of foreign exports.")
@click.argument(
    "exports", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True, dir_okay=False)
)
@click.option("--config", "-c", type=_PATH, required=True, help="What the exports look like: [input] (TOML).")
@click.option("--out", "-o", type=_PATH, required=True, metavar="DATA_DIR", help="Where the daily logs go.")
@click.option(
    "--format", "form", type=click.Choice(["csv", "csv.gz", "parquet"]), default="csv", show_default=True,
    help="Of the daily logs.",
)  # fmt: skip
@click.option("--from", "first", type=_DATE, metavar="DATE", help="First day to write.")
@click.option("--to", "last", type=_DATE, metavar="DATE", help="Last day to write.")
@click.option("--force", is_flag=True, help="Overwrite logs that are there and differ.")
@click.option("--dry-run", is_flag=True, help="Count, and write nothing.")
@click.option(
    "--run-config", type=_PATH, metavar="FILE",
    help="Where the configuration for `rivid run` goes; default: <DATA_DIR>_run.toml.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="As one JSON object.")
@click.option("--today", type=_DATE, metavar="DATE", hidden=True, help="Take DATE for today.")
def command(
    exports: tuple[Path, ...],
    config: Path,
    out: Path,
    form: Any,
    first: dt.datetime | None,
    last: dt.datetime | None,
    force: bool,
    dry_run: bool,
    run_config: Path | None,
    as_json: bool,
    today: dt.datetime | None,
) -> int:
    """Make daily logs of EXPORTS, files of one dialect, long or wide, of any number of days.

    Only what the configuration declares is applied, every value that is dropped is counted, and a day that
    `rivid run` could not use is refused. Nothing is overwritten unless it is identical, or --force is given.
    Exit code: 0 all well, 2 not as declared, 3 days refused, 10 no data.

    \b
    Examples:
      rivid sniff export.csv --time-zone Europe/Paris > export.toml
      rivid ingest export.csv --config export.toml --out logs
      rivid run logs --config logs_run.toml
    """
    import json

    from rivid.config import load_config
    from rivid.errors import ConfigError
    from rivid.logs.ingest.work import Wish, ingest, run_config_beside

    target = run_config or run_config_beside(out)
    if target.resolve() == config.resolve():
        raise ConfigError(f"{target} is the --config itself: choose another --run-config")
    wish = Wish(
        format=form,
        first=first.date() if first else None,
        last=last.date() if last else None,
        force=force,
        dry_run=dry_run,
        today=today.date() if today else None,
        run_config=target,
    )
    outcome = ingest(exports, out, load_config(config), wish)
    if as_json:
        click.echo(json.dumps({**outcome.to_json(), "out": str(out), "dry_run": dry_run}))
    else:
        _print(outcome, out, dry_run)
    if outcome.exit_code == 10:
        click.echo("rivid: no day in the exports is asked for", err=True)
    return outcome.exit_code


def _print(outcome: Any, out: Path, dry_run: bool) -> None:
    for day in outcome.days:
        if day.reason:
            click.echo(f"{day.date}  {day.status:8s}  {day.reason}")
    for note in outcome.notes:
        click.echo(note)
    ledger = outcome.ledger
    if ledger.flags:
        flags = ", ".join(f"{flag or 'none'} {count:,d}" for flag, count in ledger.flags.most_common(12))
        click.echo(f"flags of values that were dropped: {flags}")
    click.echo()
    for line in ledger.lines():
        click.echo(line)
    click.echo()
    counts = outcome.counts
    words = {"written": "would be written" if dry_run else "written"}
    words |= {
        "identical": "there already",
        "differs": "kept out",
        "refused": "refused",
        "pending": "unfinished",
    }
    told = ", ".join(f"{counts[status]} {word}" for status, word in words.items() if counts[status])
    click.echo(f"{len(outcome.days)} days: {told or 'none'}")
    if not dry_run and (counts["written"] or counts["identical"]):
        click.echo(f"next: rivid run {out} --config {outcome.run_config}")
