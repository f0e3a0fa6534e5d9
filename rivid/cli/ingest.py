"""``rivid ingest``."""

import datetime as dt
import json
import re
import shlex
from itertools import groupby
from pathlib import Path
from typing import Any

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, print_error, wrap
from rivid.text import count


@click.command("ingest")
@shared.exports(required=False)
@shared.config("Description of the exports: [input] (TOML).", required=True)
@shared.logs_out
@shared.value(
    "--format", shared.OneOf(["csv", "csv.gz", "parquet"]), "NAME",
    "Of the daily logs: csv, csv.gz or parquet.", default="csv", show_default=True,
)  # fmt: skip
@shared.value(
    "--run-config", shared.FILE, "FILE",
    "Where the configuration for `rivid run` goes; default: <DATA_DIR>_run.toml. As <DATA_DIR>/rivid.toml it "
    "is found without --config.",
)  # fmt: skip
@shared.flag("--force", "Overwrite logs that are there and differ.")
@shared.days("write")
@shared.flag("--dry-run", "Count, and write nothing.")
@shared.as_json()
@shared.talk
@shared.today
def command(
    exports: tuple[Path, ...], config: Path, out: Path, format: Any, run_config: Path | None, force: bool,
    first: dt.date | None, last: dt.date | None, dry_run: bool, as_json: bool, console: Console,
    today: dt.date | None,
) -> int:  # fmt: skip
    """Make daily logs of EXPORTS, files of one dialect, long or wide, of any number of days.

    Only what the configuration declares is applied, every value that is dropped is counted, and a day that
    `rivid run` could not use is refused. Nothing is overwritten unless it is identical, or --force is given.
    --config is required: exports and the logs made of them have different columns. Without EXPORTS, the rows
    come from its [input] database and query.

    Exit code: 0 all well, 2 not as declared, 3 days refused, 10 no data.

    \b
    Examples:
      rivid sniff tests/data/exports/historian/historian.csv
      rivid ingest tests/data/exports/historian/historian.csv \\
        --config tests/data/exports/historian/config.toml --out out/logs
      rivid run out/logs --config out/logs_run.toml --out out/ingested
    """
    from rivid.config import load_config
    from rivid.errors import ConfigError
    from rivid.logs.exports import ingest, run_config_of

    settings = load_config(config)
    if bool(exports) == bool(settings.input.query):
        came = "both were given" if exports else "neither was given"
        raise ConfigError(f"the rows come from EXPORTS or from [input] query: {came}")
    console.begin(*(("export", path) for path in exports), ("settings", config), ("logs to", out))
    console.phase("starting")
    target = run_config or run_config_of(out)
    if target.resolve() == config.resolve():
        raise ConfigError(f"{target} is the --config itself: choose another --run-config")
    outcome = ingest(
        exports, out, settings, format=format, first=first, last=last, force=force,
        dry_run=dry_run, today=today, run_config=target,
    )  # fmt: skip
    console.phase(f"reading, judging and writing {len(outcome.days):,} days")
    if as_json:
        click.echo(json.dumps({**outcome.to_json(), "out": str(out), "dry_run": dry_run}))
    elif console.quiet:
        _print_days(outcome)
    else:
        _print(outcome, out, dry_run)
    if outcome.exit_code == 10:
        came = f"from {first or 'the first'} to {last or 'the last'}"
        print_error(f"no day of the exports lies {came}: look at --from and --to")
    return outcome.exit_code


def _print_days(outcome: Any) -> None:
    """The days that were not written, and why; days in succession with like reasons in one line."""
    given = (day for day in outcome.days if day.reason)
    for _, same in groupby(given, key=lambda day: (day.status, re.sub(r"\d+", "0", day.reason))):
        first, *more = same
        when = f"{first.date} to {more[-1].date}, {len(more) + 1} days" if more else first.date
        of = " (on the first)" if any(day.reason != first.reason for day in more) else ""
        click.echo(wrap(f"{when}  {first.status:8s}  {first.reason}{of}", 0, 22))


def _print(outcome: Any, out: Path, dry_run: bool) -> None:
    from rivid.logs.exports import ledger_lines

    _print_days(outcome)
    for note in outcome.notes:
        click.echo(wrap(note))
    if given := outcome.ledger["flags"]:
        most = sorted(given.items(), key=lambda flag: -flag[1])[:12]
        flags = ", ".join(f"{flag or 'none'} {times:,d}" for flag, times in most)
        click.echo(wrap(f"flags of values that were dropped: {flags}"))
    if outcome.notes or given or any(day.reason for day in outcome.days):
        click.echo()
    for line in ledger_lines(outcome.ledger):
        click.echo(line)
    click.echo()
    counts = outcome.counts
    words = {"written": "would be written" if dry_run else "written"}
    words |= {"identical": "there already", "differs": "kept out", "refused": "refused"}
    words |= {"pending": "unfinished"}
    shown = ", ".join(f"{counts[status]} {word}" for status, word in words.items() if counts[status])
    click.echo(f"{count(len(outcome.days), 'day')}: {shown or 'none'}")
    if not dry_run and (counts["written"] or counts["identical"]):
        what = f"{shlex.quote(str(out))} --config {shlex.quote(str(outcome.run_config))}"
        click.echo(f"next: rivid check {what}\nthen: rivid run {what}")
