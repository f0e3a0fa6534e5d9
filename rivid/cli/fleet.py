"""``rivid fleet``."""

from pathlib import Path

import click


@click.command("fleet", short_help="Say what is to be said of all reaches together.")
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="fleet.json on stdout, in one line.")
@click.option("--quiet", "-q", is_flag=True, help="Say nothing.")
def command(out: Path, as_json: bool, quiet: bool) -> int:
    """Write the report of a fleet from what its runs, or their shards, have left in OUT.

    OUT is the directory that `rivid run` of a fleet wrote: a directory per reach. Writes fleet.html: which
    reaches fail, whose delay left its band in the last week, which are silent, which changed since the report
    before; fleet.csv and fleet.parquet, a row per reach; and fleet.json. Nothing is estimated. The exit code
    is the worst of the reaches' last runs: 1, then 2, 11, 10, 3, 0.

    \b
    Examples:
      rivid run fleet_logs --config configs/fleet --out out --shard 1/2
      rivid run fleet_logs --config configs/fleet --out out --shard 2/2
      rivid fleet out
    """
    from rivid.cli.fleet_run import report
    from rivid.fleet.outcome import worst
    from rivid.fleet.run import fleet_of
    from rivid.lean import spare_pandas
    from rivid.store import Store

    spare_pandas()
    outcomes = fleet_of(out)
    with Store(out):
        report(out, outcomes, out.resolve().name, as_json=as_json, quiet=quiet)
    return worst(outcome.code for outcome in outcomes)
