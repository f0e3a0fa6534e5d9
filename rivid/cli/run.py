"""``rivid run``."""

import datetime as dt
import math
from pathlib import Path
from typing import Any

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, print_error
from rivid.estimators import ESTIMATORS

SCALED = {"order", "d_min", "d_max", "sigma_d"}
"""Settings that are in samples."""


@click.command("run")
@shared.data_dir()
@shared.config(shared.CONFIG_OF_FLEET, type=shared.PATH)
@shared.out()
@click.option(
    "--estimator",
    "estimators",
    multiple=True,
    type=shared.OneOf(ESTIMATORS),
    metavar="NAME",
    help=f"Ask this one, in place of [run] estimators; repeatable. {', '.join(ESTIMATORS)}.",
)
@click.option("--force", is_flag=True, help="Estimate again what is done already.")
@click.option("--verify", is_flag=True, help="Hash every file, also where size and time are unchanged.")
@click.option("--strict", is_flag=True, help="Exit 3 for any failed day, also one that had failed before.")
@click.option("--no-figures", is_flag=True, help="Tables only.")
@click.option("--shard", metavar="I/N", help="Do the I-th of N parts; a run without --shard merges them.")
@shared.days("estimate")
@shared.workers("Processes that estimate and draw; default: as many as pay off.")
@click.option(
    "--engine",
    type=shared.OneOf(["processes", "dask"]),
    metavar="NAME",
    help="Who works: processes or dask; default: processes.",
)
@click.option(
    "--scheduler", metavar="URL", help="A standing Dask scheduler, or its scheduler file; implies dask."
)
@shared.dry_run()
@shared.as_json("A JSON line per day, and one for the whole, on stdout.")
@shared.talk()
@shared.today()
def command(
    data_dir: Path,
    config: Path | None,
    out: Path | None,
    estimators: tuple[str, ...],
    force: bool,
    verify: bool,
    strict: bool,
    no_figures: bool,
    shard: str | None,
    first: dt.datetime | None,
    last: dt.datetime | None,
    workers: int | None,
    engine: str | None,
    scheduler: str | None,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
    today: dt.datetime | None,
) -> int:
    """Estimate every day of DATA_DIR that is new or changed.

    Reads daily logs, estimates the delay and the impulse response of each day, and writes tables, figures
    and a report to OUT.

    A DATA_DIR without logs that holds directories of logs is a fleet's: each is a reach, run into
    OUT/<reach>, and fleet.html speaks of all of them. The configuration is then a file for all, or a
    directory with a <reach>.toml for each over a defaults.toml; without --config, DATA_DIR/<reach>/rivid.toml
    stands over the rivid.toml of DATA_DIR or above it, key by key.

    --shard does one part of N: every N-th block of days of a reach, every N-th reach of a fleet. Parts run
    at the same time, on any machines that see OUT. The same command without --shard merges them; of a
    fleet, `rivid fleet OUT` is enough.

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
    from rivid.run.plan import Shard
    from rivid.run.workers import DRAWING, cores, warm

    on_dask = _on_dask(engine, scheduler, workers)
    console = Console(quiet, verbose)
    given, config = config, configuration(config, data_dir, console)
    place = results(out, config, data_dir)
    part = Shard.parse(shard) if shard else None
    if (
        not (on_dask or no_figures or dry_run or part or (place / "report.html").exists())
        and (workers or cores()) > 1
    ):
        if holds_logs(data_dir):
            warm(DRAWING)  # while this process imports, reads and estimates

    from rivid.cli.fleet_run import run_all, say_plan
    from rivid.config import ReachConfig, load_config, parse
    from rivid.results.record import assumed
    from rivid.run.plan import Options, make_plan
    from rivid.run.run import run
    from rivid.run.workers import without_pandas

    without_pandas()
    console.begin(("logs", data_dir), ("settings", config or "Table I"), ("results", place))
    console.phase("starting")
    if dry_run and as_json:
        raise click.UsageError("--dry-run has no JSON: leave out --dry-run or --json.")
    options = Options(
        workers=workers,
        first=first.date() if first else None,
        last=last.date() if last else None,
        force=force,
        verify=verify,
        figures=not no_figures,
        today=today.date() if today else None,
        shard=part,
    )
    reaches = find_fleet(data_dir, config, estimators, None if given else own)
    if reaches is not None:
        if dry_run:
            return say_plan(reaches, place)
        bar = console.timed(None if quiet or as_json else _progress, "reaches")
        with _engine(on_dask, scheduler, workers) as executing:
            code = run_all(
                data_dir, reaches, place, options,
                strict=strict, as_json=as_json, quiet=quiet, progress=bar, engine=executing,
            )  # fmt: skip
        console.phase("the fleet's report")
        return code
    settings = load_config(config)
    unsaid, papers = assumed(settings), ReachConfig().sample_time
    if estimators:
        raw = settings.model_dump(mode="json", exclude_none=True)
        raw["run"]["estimators"] = list(estimators)
        settings = parse(raw, type(settings), "--estimator")
    if dry_run:
        return _dry_run(make_plan(data_dir, settings, options), place, settings)
    with _engine(on_dask, scheduler, workers) as executing:
        bar = console.timed(None if quiet or as_json else _progress)
        summary = run(data_dir, place, settings, options, bar, executing)
    console.phase("bringing tables, figures and report up to date")
    if as_json:
        _print_json(summary, with_days=shard is None)
    for path, reason in summary.bad_files:
        print_error(f"{path}: {reason}")
    if summary.dropped:
        print_error(f"{summary.dropped} days of earlier runs have no log any more: dropped from OUT")
    if summary.unasked and not part:
        console.info(f"not asked any more, its rows leave the tables: {', '.join(summary.unasked)}")
    for name in summary.damaged:
        print_error(f"damaged, its days are computed again: {name}")
    if config and unsaid:
        console.info(f"[reach] lacks {', '.join(unsaid)}: the bounds take those of Table I")
    if not unsaid and settings.reach.sample_time != papers and not settings.jmap.model_fields_set & SCALED:
        console.info(
            f"[jmap] is not set: its delays and prior are the paper's, for samples of {papers:g} s; "
            "`rivid bounds` proposes those of this reach"
        )
    if part and not as_json and not quiet:
        click.echo(
            f"shard {part}: {len(summary.asked_keys):,} of {summary.windows:,} data sets, "
            f"{summary.computed:,} estimated now"
        )
        click.echo("when all shards are done, the same command without --shard merges them")
    elif not as_json and not quiet:
        from rivid.cli.summary import print_summary

        print_summary(summary, settings, "report.html" if options.figures else "delays.csv")
    elif not as_json and not part:
        from rivid.cli.summary import print_failures

        print_failures(summary)
    if part:
        return 0  # what failed is told by the run that merges
    if strict:
        return 3 if summary.failures or summary.bad_files else 0
    if 0 < summary.failures == summary.windows and not summary.new_failures:
        print_error(f"every data set fails: `message` in {summary.out / 'delays.csv'} says why")
    return summary.exit_code


def _on_dask(engine: str | None, scheduler: str | None, workers: int | None) -> bool:
    if scheduler and engine == "processes":
        raise click.UsageError("--scheduler is for --engine dask: leave out one of the two")
    if scheduler and workers:
        raise click.UsageError("the workers are the scheduler's: leave out --workers or --scheduler")
    return engine == "dask" or scheduler is not None


def _engine(on_dask: bool, scheduler: str | None, workers: int | None) -> Any:
    """A Dask cluster, or nothing: a run takes processes as they pay off."""
    from contextlib import nullcontext

    if not on_dask:
        return nullcontext()
    from rivid.run.dask import Dask
    from rivid.run.workers import cores

    return Dask(scheduler, workers or cores())


def _dry_run(planned: Any, out: Path, settings: Any) -> int:
    from rivid.results.store import read_rows

    rows, _ = read_rows(out / ".rivid" / "segments")
    done = set(rows.table["key"].to_pylist())
    new = [w for w in planned.asked if w.key not in done]
    click.echo(
        f"{len(planned.windows)} data sets in all, {len(planned.asked)} asked for, {len(new)} to estimate"
    )
    click.echo(f"estimators: {', '.join(settings.run.estimators)}; results would go to {out}")
    for window in new[:5]:
        click.echo(f"  {window.date}")
    if len(new) > 5:
        click.echo(f"  ... {new[-1].date}")
    return 0


def _progress(total: int) -> Any:
    """A progress bar on a terminal, silence elsewhere."""
    from contextlib import contextmanager

    @contextmanager
    def bar() -> Any:
        import sys

        if not sys.stderr.isatty():
            yield lambda _: None
            return
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("estimating"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task("days", total=total)
            yield lambda n: progress.advance(task, n)

    return bar()


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """JSON knows no infinity."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}


def _print_json(summary: Any, with_days: bool) -> None:
    import json

    import pyarrow.parquet as pq

    at = 0  # rows of the table are those of the summary, in the same order
    for batch in pq.ParquetFile(summary.out / "delays.parquet").iter_batches() if with_days else ():
        keys = summary.rows["key"].slice(at, len(batch)).to_pylist()
        at += len(batch)
        for key, row in zip(keys, batch.to_pylist(), strict=True):
            if key in summary.asked_keys:
                row["computed"] = key in summary.computed_keys
                click.echo(json.dumps(_finite(row), default=str))
    whole = {
        "summary": {
            "out": str(summary.out),
            "data_sets": summary.windows,
            "computed": summary.computed,
            "reused": summary.reused,
            "failed": summary.failures,
            "newly_failed": summary.new_failures,
            "counts": summary.counts,
            "bad_files": summary.bad_files,
            "seconds": round(summary.seconds, 3),
        }
    }
    click.echo(json.dumps(whole))
