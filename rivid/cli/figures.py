"""``rivid figures``."""

import datetime as dt
from pathlib import Path

import click


@click.command("figures", short_help="Redraw figures and report from stored results.")
@click.argument("out", type=click.Path(path_type=Path))
@click.option(
    "--day",
    type=click.DateTime(["%Y-%m-%d"]),
    metavar="DATE",
    help="The day whose impulse responses are shown; a typical one by default.",
)
def command(out: Path, day: dt.datetime | None) -> int:
    """Redraw the figures and the report of a finished run.

    OUT is the directory that `rivid run` wrote. Nothing is estimated again.

    \b
    Examples:
      rivid figures out
      rivid figures out --day 2008-03-14
    """
    import json

    from rivid.figures import draw_all
    from rivid.report import write_report
    from rivid.results import load_results
    from rivid.store import Store

    results = load_results(out)  # before the lock, which would make the directory
    with Store(out):
        summary = json.loads((out / "run.json").read_text(encoding="utf-8"))
        figures = draw_all(results, out, day=day.date() if day else None)
        page = write_report(results, figures, out, summary=summary)
    click.echo(f"{len(figures)} figures in {out / 'figures'}; report: {page}")
    return 0
