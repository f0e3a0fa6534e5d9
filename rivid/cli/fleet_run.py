"""`rivid run` where DATA_DIR is a fleet's: what it says, and its exit code."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rivid.cli.console import abbreviate, print_error, wrap

if TYPE_CHECKING:
    from rivid.fleet.layout import Reach
    from rivid.fleet.outcome import Outcome
    from rivid.run.plan import Options
    from rivid.run.workers import Engine

MOST_LINES = 20
"""Reaches that are named on the terminal; the page has all of them."""


def run_all(
    data_dir: Path,
    reaches: "Sequence[Reach]",
    out: Path,
    options: "Options",
    *,
    strict: bool,
    as_json: bool,
    quiet: bool,
    progress: Callable[[int], Any] | None,
    engine: "Engine | None" = None,
) -> int:
    """Run a fleet, or a shard of it; the exit code."""
    from rivid.fleet.outcome import kept, worst
    from rivid.fleet.run import run_fleet

    def tell(outcome: "Outcome") -> None:
        if as_json:
            click.echo(json.dumps(outcome.to_json()))

    outcomes = run_fleet(data_dir, reaches, out, options, progress, engine, tell)
    for outcome in outcomes:
        if outcome.error:
            print_error(f"{outcome.reach}: {outcome.error}")
    codes = [3 if strict and o.code == 0 and (o.failures or o.bad_files) else o.code for o in outcomes]
    if options.shard:
        if as_json:
            click.echo(json.dumps({"shard": str(options.shard), "reaches": len(outcomes)}))
        elif not quiet:
            click.echo(
                f"shard {options.shard}: {len(outcomes)} of {len(reaches)} reaches, "
                f"{sum(o.computed for o in outcomes):,} data sets estimated now"
            )
            click.echo(f"when all shards are done: rivid fleet {out}")
        return worst(codes)
    named = {outcome.reach for outcome in outcomes}
    others = [outcome for outcome in kept(out) if outcome.reach not in named]
    report(out, [*outcomes, *others], data_dir.resolve().name, as_json=as_json, quiet=quiet)
    return worst(codes)


def report(out: Path, outcomes: "Sequence[Outcome]", name: str, *, as_json: bool, quiet: bool) -> None:
    """Write the fleet's files and say the main things."""
    from rivid.fleet.report import write_fleet

    told = write_fleet(out, outcomes, name)
    if as_json:
        told.pop("contents")
        told.pop("data_sets_of")
        click.echo(json.dumps({"summary": told}))
    elif not quiet:
        _say(told, outcomes, out)


def _say(told: dict[str, Any], outcomes: "Sequence[Outcome]", out: Path) -> None:
    click.echo(
        f"{told['reaches']:,} reaches, {told['data_sets']:,} data sets, "
        f"{sum(o.computed for o in outcomes):,} estimated now"
    )
    for kind, words in (
        ("failing", "fail"),
        ("left_band", "have left the band of their delay"),
        ("silent", "are silent"),
        ("changed", "changed since the report before"),
    ):
        names = told[kind]
        some = ", ".join(abbreviate(name) for name in names[:MOST_LINES]) + (
            ", ..." if len(names) > MOST_LINES else ""
        )
        said = f"{len(names):,} {words}" + (f": {some}" if names and kind != "changed" else "")
        click.echo(click.style(wrap(said, 2), fg="red" if names and kind == "failing" else None))
    click.echo(f"report: {out / 'fleet.html'}")


def say_plan(reaches: "Sequence[Reach]", out: Path) -> int:
    """What a run would do, reach by reach; exit code 0, or 2 where a configuration is wrong."""
    from rivid.errors import RividError

    code = 0
    for reach in reaches:
        try:
            config = reach.config()
        except RividError as error:
            click.echo(wrap(f"{reach.name}: {error}", 2))
            code = max(code, error.exit_code if error.exit_code == 2 else 0)
        else:
            names = ", ".join(config.run.estimators)
            click.echo(wrap(f"{reach.name}: {names}; results would go to {out / reach.name}", 2))
    click.echo(f"{len(reaches):,} reaches")
    return code
