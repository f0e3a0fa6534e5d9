"""``rivid figures``."""

import datetime as dt
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rivid.cli import options as shared
from rivid.cli.console import Console

if TYPE_CHECKING:
    from rivid.plots.paper_data import CascadeReach

CASCADE = Path("configs", "scenarios", "cascade.toml")
"""Default cascade of Fig. 19, in this directory or next to the package."""


@click.command("figures")
@shared.results
@shared.value("--day", shared.DATE, "DATE", "The day of the impulse responses; default: a typical one.")
@shared.flag("--paper", "Draw the paper's figures instead, into OUT/paper.")
@shared.value("--logs", shared.PATH, "DATA_DIR", "With --paper: the run's logs, if they have been moved.")
@shared.value(
    "--cascade", shared.PATH, "PATH",
    "With --paper, for Fig. 19: a scenario to simulate, or OUT of a reach's run. Repeatable.", multiple=True,
)  # fmt: skip
@shared.talk
def command(
    out: Path, day: dt.date | None, paper: bool, logs: Path | None, cascade: tuple[Path, ...],
    console: Console,
) -> int:  # fmt: skip
    """Redraw the figures and the report of a finished run.

    OUT is the directory that `rivid run` wrote. Nothing is estimated again. With --paper: the paper's
    figures 1 to 19 as SVG and PNG, from the logs and settings of the run, and a page with all of
    them, OUT/paper/index.html.

    \b
    Examples:
      rivid run sample_data/basse_isere --config configs/basse_isere.toml
      rivid figures out --day 2008-03-14
      rivid figures out --paper
      rivid figures out --paper --cascade configs/scenarios/cascade.toml
    """
    if not paper and (logs or cascade):
        raise click.UsageError("--logs and --cascade are options of --paper: add --paper, or leave them out.")
    console.begin(("results", out), ("logs", logs))
    if paper:
        return _paper(out, day, logs, cascade, console)
    from rivid.results.read import last_record
    from rivid.results.store import Store
    from rivid.run.drawing import draw_with, read_once
    from rivid.run.workers import Engine

    console.phase("starting")
    read_once(out)  # before the lock, which creates the directory
    console.phase("reading the results")
    with Store(out):
        *figures, page = draw_with(Engine(), out, last_record(out), day)
    console.phase("figures and report")
    console.say(f"{len(figures)} figures in {out / 'figures'}\nreport: {page}")
    return 0


def _paper(
    out: Path, day: dt.date | None, logs: Path | None, cascade: tuple[Path, ...], console: Console
) -> int:
    from rivid.plots.paper import draw_paper
    from rivid.plots.paper_data import estimate, of_year, read_run
    from rivid.report.build import write_gallery
    from rivid.results.store import Store

    default = (CASCADE, Path(__file__).parents[2] / CASCADE)
    given = list(cascade) or [path for path in default if path.is_file()][:1]
    with console.steps() as step:
        step("reading the logs")
        year = read_run(out, logs)
        step("estimating")
        estimates = estimate(year)
        reaches: list[CascadeReach] = []
        for path in given:
            step(f"the cascade: {path}")
            reaches += simulated_cascade(path) if path.suffix == ".toml" else [of_year(read_run(path))]
        if not reaches:
            reaches = [of_year(year)]
            console.info(f"no --cascade, and no {CASCADE} here: Fig. 19 shows {reaches[0].name} alone")
        with Store(out):
            place = out / "paper"
            figures = draw_paper(
                year, estimates, reaches, place, day=day, progress=lambda num: step(f"drawing Fig. {num}")
            )
            step("writing the page")
            page = write_gallery(year, figures, place)
    console.say(f"{len(figures)} figures of the paper in {out / 'paper'}\npage: {page}")
    return 0


def simulated_cascade(scenario: Path) -> "list[CascadeReach]":
    """Simulate the reaches of a scenario; the settings of their estimates come from their hydraulics."""
    from rivid.config import Config, JmapConfig, ReachConfig
    from rivid.plots.paper_data import of_year, year_of
    from rivid.simulation import simulate_cascade
    from rivid.simulation.scenario import load_scenario

    reaches = []
    for season in simulate_cascade(load_scenario(scenario)):
        reach = season.scenario.reach.model_dump(include=set(ReachConfig.model_fields))
        jmap = JmapConfig(order="bounds", d_max="bounds", sigma_d="bounds")
        config = Config(reach=ReachConfig(**reach), jmap=jmap)
        year = year_of(config, season.dates, season.inflow, season.outflow, season.level)
        reaches.append(of_year(year, season.delay.astype(float)))
    return reaches
