"""``rivid fleet``."""

from pathlib import Path

import click

from rivid.cli import options as shared
from rivid.cli.console import Console


@click.command("fleet")
@shared.results()
@shared.as_json("fleet.json on stdout, in one line.")
@shared.talk()
def command(out: Path, as_json: bool, quiet: bool, verbose: bool) -> int:
    """Write the report of a fleet from what its runs, or their shards, have left in OUT.

    OUT is the directory that `rivid run` of a fleet wrote: a directory per reach. Writes fleet.html: which
    reaches fail, whose delay left its band in the last week, which are silent, which changed since the report
    before; fleet.csv and fleet.parquet, a row per reach; and fleet.json. Nothing is estimated. The exit code
    is the worst of the reaches' last runs: 1, then 2, 11, 10, 3, 0.

    \b
    Examples:
      rivid run sample_data --config configs/fleet --out out/fleet --shard 1/2
      rivid run sample_data --config configs/fleet --out out/fleet --shard 2/2
      rivid fleet out/fleet
    """
    from rivid.cli.fleet_run import report
    from rivid.fleet.outcome import worst
    from rivid.fleet.run import fleet_of
    from rivid.results.store import Store
    from rivid.run.workers import without_pandas

    console = Console(quiet, verbose)
    without_pandas()
    console.begin(("results", out))
    console.phase("starting")
    outcomes = fleet_of(out)
    console.phase(f"reading what {len(outcomes):,} reaches have left")
    with Store(out):
        report(out, outcomes, out.resolve().name, as_json=as_json, quiet=quiet)
    console.phase("report")
    return worst(outcome.code for outcome in outcomes)
