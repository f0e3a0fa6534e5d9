"""``rivid fleet``, and ``rivid run`` where DATA_DIR holds a fleet."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, abbreviate, print_error, wrap
from rivid.errors import NoDataError, RividError
from rivid.text import count

if TYPE_CHECKING:
    from rivid.fleet.layout import Reach
    from rivid.fleet.outcome import Outcome
    from rivid.run.run import Options
    from rivid.run.workers import Engine

MOST_LINES = 20
"""Reaches that are named on the terminal; the page has all of them."""


@click.command("fleet")
@shared.results
@shared.as_json("fleet.json on stdout, in one line.")
@shared.talk
def command(out: Path, as_json: bool, console: Console) -> int:
    """Write the report of a fleet from the results of its runs or shards in OUT.

    OUT is the directory that `rivid run` of a fleet wrote: a directory per reach. Writes fleet.html:
    which reaches fail, where the delay has moved or does not fit the waves, which have no recent logs,
    which changed since the report before; fleet.csv and fleet.parquet, a row per reach; and fleet.json.
    Nothing is estimated. The exit code is the worst of the reaches' last runs: 1, then 2, 11, 10, 3, 0.

    \b
    Examples:
      rivid run sample_data --config configs/fleet --out out/fleet --shard 1/2
      rivid run sample_data --config configs/fleet --out out/fleet --shard 2/2
      rivid fleet out/fleet
    """
    from rivid.fleet.outcome import kept, worst
    from rivid.results.store import Store
    from rivid.run.workers import without_pandas

    without_pandas()
    console.begin(("results", out))
    console.phase("starting")
    outcomes = kept(out)
    if not outcomes:
        raise NoDataError(f"{out} holds no results of a fleet: run `rivid run DATA_DIR --out {out}` first")
    console.phase(f"reading the outcomes of {_reaches(len(outcomes))}")
    with Store(out):
        _report(out, outcomes, None, None, as_json, console)
    console.phase("report")
    return worst(outcome.code for outcome in outcomes)


def run_all(
    data_dir: Path, reaches: "Sequence[Reach]", out: Path, options: "Options", engine: "Engine | None",
    console: Console, *, strict: bool, as_json: bool,
) -> int:  # fmt: skip
    """Run a fleet, or a shard of it; return the exit code."""
    from rivid.fleet.outcome import kept, worst
    from rivid.fleet.run import run_fleet

    outcomes = []
    progress = console.progress(not as_json, "reaches")
    for outcome in run_fleet(data_dir, reaches, out, options, progress, engine):
        outcomes.append(outcome)
        if as_json:
            click.echo(json.dumps(asdict(outcome)))
    outcomes.sort(key=lambda outcome: outcome.reach)
    for outcome in outcomes:
        if outcome.error:
            print_error(f"{outcome.reach}: {outcome.error}")
    computed = sum(outcome.computed for outcome in outcomes)
    if not options.shard:
        named = {outcome.reach for outcome in outcomes}
        others = [outcome for outcome in kept(out) if outcome.reach not in named]
        _report(out, [*outcomes, *others], data_dir.resolve().name, computed, as_json, console)
    elif as_json:
        click.echo(json.dumps({"shard": str(options.shard), "reaches": len(outcomes)}))
    else:
        console.say(
            f"shard {options.shard}: {len(outcomes):,} of {_reaches(len(reaches))}, "
            f"{count(computed, 'data set')} estimated now\nwhen all shards are done: rivid fleet {out}"
        )
    return worst(3 if strict and o.code == 0 and (o.failures or o.bad_files) else o.code for o in outcomes)


def _report(
    out: Path, outcomes: "Sequence[Outcome]", name: str | None, computed: int | None, as_json: bool,
    console: Console,
) -> None:  # fmt: skip
    """Write the files of the fleet and print its summary.

    `name` is of DATA_DIR, `computed` the data sets that this run has estimated; None of `rivid fleet`.
    """
    from rivid.fleet.report import write_fleet

    summary = write_fleet(out, outcomes, name)
    if as_json:
        del summary["contents"], summary["data_sets_of"], summary["before"]
        click.echo(json.dumps({"summary": summary}))
    elif not console.quiet:
        print_summary(summary, computed, out)


def _reaches(n: int) -> str:
    return count(n, "reach", "reaches")


def print_summary(summary: dict[str, Any], computed: int | None, out: Path) -> None:
    """Print the counts of fleet.json and name the reaches to look at; `computed` as of :func:`_report`."""
    from rivid.fleet.report import minute

    now = "" if computed is None else f", {computed:,} estimated now"
    since = minute(summary["before"].get("made", ""))
    click.echo(f"{_reaches(summary['reaches'])}, {count(summary['data_sets'], 'data set')}{now}")
    for kind, words in (
        ("failing", "failing"),
        ("left_band", "with a delay that has moved in the last nine weeks"),
        ("untested", "with too few answered days for the test of the last week"),
        ("doubtful", "with a delay that does not fit the waves of [reach]"),
        ("unanswered", "without an answer in the last week"),
        ("silent", "silent"),
        *([("changed", f"changed since the report of {since}")] if since else []),
    ):
        names = summary[kind]
        listed = ", ".join(map(abbreviate, names[:MOST_LINES])) + (", ..." if len(names) > MOST_LINES else "")
        text = f"{len(names):,} {words}" + (f": {listed}" if names and kind != "changed" else "")
        click.echo(click.style(wrap(text, 2), fg="red" if names and kind == "failing" else None))
    click.echo(f"report: {out / 'fleet.html'}")


def plan(reaches: "Sequence[Reach]", out: Path) -> int:
    """Print what a run would do, reach by reach; return 0, or 2 where a configuration is wrong."""
    code = 0
    for reach in reaches:
        try:
            names = ", ".join(reach.config().run.estimators)
        except RividError as error:
            click.echo(wrap(f"{reach.name}: {error}", 2))
            code = 2 if error.exit_code == 2 else code
        else:
            click.echo(wrap(f"{reach.name}: {names}; results would go to {out / reach.name}", 2))
    click.echo(_reaches(len(reaches)))
    return code
