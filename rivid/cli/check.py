"""``rivid check``."""

import datetime as dt
from pathlib import Path
from typing import Any

import click

from rivid.cli import options as shared
from rivid.cli.telling import Teller


@click.command("check", short_help="Say what is wrong with the logs, without estimating.")
@shared.data_dir()
@shared.config()
@shared.as_json()
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
    """Say what is wrong with the logs in DATA_DIR, day by day, without estimating.

    Exit code: 0 all fine, 3 days that cannot be used, 10 no logs.

    \b
    Examples:
      rivid check sample_data/basse_isere_csv
      rivid check sample_data/basse_isere --config configs/basse_isere.toml --json
    """
    import json
    from zoneinfo import ZoneInfo

    from rivid.check import check
    from rivid.cli.found import configuration
    from rivid.config import load_config

    tell = Teller(quiet, verbose)
    config = configuration(config, data_dir, tell)
    tell.begin(("logs", data_dir), ("settings", config or "Table I"))
    settings = load_config(config)
    tell.phase("starting")
    zone = settings.input.time_zone
    # without a configured zone it is the log's own that says which day it is
    now = dt.datetime.now(ZoneInfo(zone)).date() if zone else dt.datetime.now(dt.UTC)
    report = check(data_dir, settings, today.date() if today else now)
    tell.phase("reading and looking")
    if as_json:
        click.echo(json.dumps(report.to_json()))
    elif not quiet or report.exit_code:
        _print(report, settings.reach.name)
    return report.exit_code


def _print(report: Any, reach: str) -> None:
    for path, reason in report.bad_files:
        click.echo(f"{path}  cannot be used: {reason}")
    for day in report.days:
        said = [day.reason] if day.reason else day.notes
        if said:
            click.echo(f"{day.date}  {day.status:7s}  {'; '.join(said)}")
    for warning in report.warnings:
        click.echo(f"warning: {warning}")
    count = {s: sum(day.status == s for day in report.days) for s in ("ok", "pending", "failed")}
    noted = sum(bool(day.notes) for day in report.days)
    filled = sum(day.n_filled for day in report.days)
    samples = sum(day.n_samples for day in report.days)
    rows = [
        ("days", f"{len(report.days)}, {report.days[0].date} to {report.days[-1].date}"),
        ("fine", f"{count['ok']}" + (f", {noted} of them with remarks" if noted else "")),
        ("failed", f"{count['failed']}"),
        ("pending", f"{count['pending']}"),
        ("no log", _absent(report.absent)),
        ("bad files", f"{len(report.bad_files)}"),
        ("samples", f"{samples:,}, {filled:,} of them filled"),
        ("warnings", f"{len(report.warnings)}"),
    ]
    click.echo(f"\n{reach}")
    for name, value in rows:
        click.echo(f"  {name:10s} {value}")


def _absent(days: list[dt.date]) -> str:
    shown = ", ".join(str(day) for day in days[:5])
    return f"{len(days)} days" + (f": {shown}{', ...' if len(days) > 5 else ''}" if days else "")
