"""``rivid run``."""

import datetime as dt
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, print_error
from rivid.estimators import ESTIMATORS
from rivid.text import count

if TYPE_CHECKING:
    from rivid.config import Config
    from rivid.run.dask import Dask
    from rivid.run.run import Options, Summary


@click.command("run")
@shared.data_dir
@shared.config(shared.CONFIG_OF_FLEET, shared.PATH)
@shared.out
@shared.value(
    "--estimator", shared.OneOf(ESTIMATORS), "NAME",
    f"Use this one in place of [run] estimators; repeatable. {', '.join(ESTIMATORS)}.", multiple=True,
)  # fmt: skip
@shared.flag("--force", "Estimate again what is done already.")
@shared.flag("--verify", "Hash every file, also where size and time are unchanged.")
@shared.flag("--strict", "Exit 3 for any failed day, also one that had failed before.")
@shared.flag("--no-figures", "Tables only.")
@shared.value("--shard", str, "I/N", "Process part I of N; a run without --shard merges the parts.")
@shared.days("estimate")
@shared.value(
    "--workers", click.IntRange(1, 512), "N", "Processes that estimate and draw; default: by the work."
)
@shared.value(
    "--engine", shared.OneOf(["processes", "dask"]), "NAME",
    "What executes the work: processes or dask; default: processes.",
)  # fmt: skip
@shared.value("--scheduler", str, "URL", "A standing Dask scheduler, or its scheduler file; implies dask.")
@shared.flag("--dry-run", "Print the plan, and stop.")
@shared.as_json("A JSON line per day, and one for the whole, on stdout.")
@shared.talk
@shared.today
def command(
    data_dir: Path, config: Path | None, out: Path | None, estimator: tuple[str, ...], force: bool,
    verify: bool, strict: bool, no_figures: bool, shard: str | None, first: dt.date | None,
    last: dt.date | None, workers: int | None, engine: str | None, scheduler: str | None, dry_run: bool,
    as_json: bool, console: Console, today: dt.date | None,
) -> int:  # fmt: skip
    """Estimate every day of DATA_DIR that is new or changed.

    Reads daily logs, estimates the delay and the impulse response of each day, and writes tables, figures
    and a report to OUT.

    A DATA_DIR without logs that holds directories of logs is a fleet's: each is a reach, run into
    OUT/<reach>, and fleet.html reports on all of them. The configuration is then a file for all, or a
    directory with a <reach>.toml for each over a defaults.toml; without --config, DATA_DIR/<reach>/rivid.toml
    overrides the rivid.toml of DATA_DIR or above it, key by key.

    --shard processes one part of N: every N-th block of days of a reach, every N-th reach of a fleet.
    Parts run at the same time, on any machines with access to OUT. The same command without --shard
    merges them; of a fleet, `rivid fleet OUT` is enough.

    \b
    Examples:
      rivid run sample_data/basse_isere --config configs/basse_isere.toml
      rivid run sample_data/basse_isere_csv --estimator posterior --out out/week
      rivid run sample_data --config configs/fleet --out out/fleet --shard 1/3

    \b
    Each morning, from cron, with a rivid.toml that has [run] out:
      15 6 * * *  rivid run /srv/reach/logs --quiet
    """
    from rivid.cli.locate import configuration, own, results
    from rivid.fleet.layout import find_fleet, holds_logs
    from rivid.run.workers import DRAWING, cores, warm, without_pandas

    dask = _dask(engine, scheduler, workers)
    if dry_run and as_json:
        raise click.UsageError("--dry-run has no JSON: leave out --dry-run or --json.")
    found = configuration(config, data_dir, console)
    place = results(out, found, data_dir)
    draws = not (dask or no_figures or dry_run or shard or (place / "report.html").exists())
    if draws and (workers or cores()) > 1 and holds_logs(data_dir):
        warm(DRAWING)  # while this process imports, reads and estimates
    from rivid.run.run import Options, Shard, run

    without_pandas()
    console.begin(("logs", data_dir), ("settings", found or "Table I"), ("results", place))
    console.phase("starting")
    options = Options(
        workers=workers, first=first, last=last, force=force, verify=verify, figures=not no_figures,
        today=today, shard=Shard.parse(shard) if shard else None,
    )  # fmt: skip
    reaches = find_fleet(data_dir, found, estimator, None if config else own)
    if reaches is not None:
        from rivid.cli.fleet import plan, run_all

        if dry_run:
            return plan(reaches, place)
        with dask or nullcontext():
            code = run_all(data_dir, reaches, place, options, dask, console, strict=strict, as_json=as_json)
        console.phase("the fleet's report")
        return code

    from rivid.cli.summary import print_json, print_summary

    settings, notes = _settings(found, estimator)
    if settings.run.window:
        options = replace(options, figures=False)
    if dry_run:
        return _dry_run(data_dir, place, settings, options)
    is_new = not (place / "run.json").exists()
    with dask or nullcontext():
        progress = console.progress(not as_json, "data sets")
        summary = run(data_dir, place, settings, options, progress, dask)
    console.phase("bringing tables, figures and report up to date")
    if as_json:
        print_json(summary, with_days=not shard)
    _print_notes(summary, console, notes, options)
    if not as_json:
        print_summary(summary, settings, options, console.quiet, is_new)
    return _exit_code(summary, strict, options)


def _dask(engine: str | None, scheduler: str | None, workers: int | None) -> "Dask | None":
    """A Dask cluster, or None: a run then decides on processes itself."""
    if scheduler and engine == "processes":
        raise click.UsageError("--scheduler is for --engine dask: leave out one of the two")
    if scheduler and workers:
        raise click.UsageError("the workers are the scheduler's: leave out --workers or --scheduler")
    if engine != "dask" and scheduler is None:
        return None
    from rivid.run.dask import Dask
    from rivid.run.workers import cores

    return Dask(scheduler, workers or cores())


def _settings(path: Path | None, estimators: tuple[str, ...]) -> "tuple[Config, list[str]]":
    """The configuration, and notes on defaults that another reach may need to change."""
    from rivid.config import Config, ReachConfig, load_config, merged, parse
    from rivid.results.store import assumed

    settings, notes = load_config(path), []
    lacking, papers = assumed(settings), ReachConfig().sample_time
    missing = [*lacking, *({"sample_time"} - settings.reach.model_fields_set)]
    if missing:
        what = f"[reach] lacks {', '.join(missing)}:" if path else "no configuration: [reach] is"
        notes.append(f"{what} taken from Table I")
    in_samples = settings.jmap.model_fields_set & {"order", "d_min", "d_max", "sigma_d"}
    if not lacking and settings.reach.sample_time != papers and not in_samples:
        notes.append(
            f"[jmap] is not set: its delays and prior are the paper's, for samples of {papers:g} s; "
            "`rivid bounds` proposes those of this reach"
        )
    if estimators:
        raw = settings.model_dump(mode="json", exclude_unset=True)  # what is assumed stays assumed
        settings = parse(merged(raw, {"run": {"estimators": list(estimators)}}), Config, "--estimator")
    return settings, notes


def _dry_run(data_dir: Path, out: Path, settings: "Config", options: "Options") -> int:
    from rivid.results.store import read_rows
    from rivid.run.run import make_plan, missing

    planned = make_plan(data_dir, settings, options)
    rows, _ = read_rows(out / ".rivid" / "segments")
    new = missing(planned.asked, rows)
    found = count(len(planned.windows), "data set")
    click.echo(f"{found} in all, {len(planned.asked)} selected, {len(new)} to estimate")
    click.echo(f"estimators: {', '.join(settings.run.estimators)}; results would go to {out}")
    for window in new[:5]:
        click.echo(f"  {window.start or window.date}")
    if len(new) > 5:
        click.echo(f"  ... {new[-1].date}")
    return 0


def _print_notes(summary: "Summary", console: Console, notes: list[str], options: "Options") -> None:
    """Print on stderr what is wrong with files and stored results, and the notes on the configuration."""
    for path, reason in summary.bad_files:
        print_error(f"{path}: {reason}")
    if summary.dropped:
        have = count(summary.dropped, "day of earlier runs has", "days of earlier runs have")
        print_error(f"{have} no log any more: dropped from OUT")
    if summary.unasked and not options.shard:
        console.info(f"no longer configured, their rows leave the tables: {', '.join(summary.unasked)}")
    for name in summary.damaged:
        print_error(f"damaged, its days are computed again: {name}")
    for note in notes:
        console.info(note)


def _exit_code(summary: "Summary", strict: bool, options: "Options") -> int:
    if options.shard:
        return 0  # the run that merges reports the failed days
    if strict:
        return 3 if summary.failures or summary.bad_files else 0
    if 0 < summary.failures == summary.windows and not summary.new_failures:
        print_error(f"every data set fails: see `message` in {summary.out / 'delays.csv'}")
    return summary.exit_code
