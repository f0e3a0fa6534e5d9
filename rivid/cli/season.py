"""``rivid season``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, abbreviate, wrap
from rivid.errors import ConfigError, NoDataError

if TYPE_CHECKING:
    from rivid.core.law import DelayLaw
    from rivid.results.season import Joined, SeasonDays


def _reaches(context: click.Context, param: click.Parameter, typed: str) -> list[str]:
    """The reaches in OUT, for shell completion."""
    from rivid.results.read import reaches_in

    given = context.params.get("out") or next(iter(context.args), None)  # an option still lacks its value
    return [name for name in reaches_in(Path(given)) if name.startswith(typed)] if given else []


@click.command("season")
@shared.results
@shared.flag("--both-ways", "Use the later days too: for a study of a pool.")
@shared.value("--reach", str, "NAME", "The reach, where OUT is a fleet's.", shell_complete=_reaches)
@shared.talk
def command(out: Path, both_ways: bool, reach: str | None, console: Console) -> int:
    """Join the days of a finished run of `posterior`.

    OUT is the directory that `rivid run` wrote. Nothing is estimated again. Writes season.csv and
    season.parquet, a row per day as posterior-season; delay_law.csv, delay by class of discharge for a
    controller, and delay_law.json, the law itself; figures/season.png and figures/delay_law.png. A day uses
    the days before it only, so that its result does not change when days are added.

    \b
    Examples:
      rivid run sample_data/basse_isere -c configs/posterior.toml -o out/sure
      rivid season out/sure
      rivid season out/sure --both-ways

    \b
    Of one reach of a fleet:
      rivid run sample_data -c configs/fleet --estimator posterior -o out/fleet
      rivid season out/fleet --reach basse_isere
    """
    from rivid.results.read import last_record
    from rivid.results.season import join, law_of, read_days, write_season
    from rivid.results.store import Store
    from rivid.run.workers import without_pandas

    without_pandas()
    out = _of_reach(out, reach)  # before the lock, which would make the directory
    console.begin(("results", out))
    console.phase("starting")
    with Store(out):
        run = last_record(out)
        if not run.get("outputs"):
            raise NoDataError(f"the last run into {out} did not finish: run it again")
        days = read_days(out, run)
        console.phase(f"reading {len(days.dates):,} days")
        joined, law = join(days, both_ways), law_of(days)
        console.phase("joining them, and the law")
        write_season(days, joined, law, out)
        from rivid.plots.season import draw

        draw(days, joined, law, out / "figures")
    console.phase("tables and figures")
    console.say(f"{_words(days, joined, law)}\n\nseason.csv, delay_law.csv and figures: {out}")
    return 0


def _of_reach(out: Path, reach: str | None) -> Path:
    """OUT itself, or that of one reach of a fleet."""
    from rivid.results.read import last_record, no_run, reaches_in

    if run := last_record(out):
        if reach is not None and reach != run["reach"]:
            raise ConfigError(f"--reach {reach}: {out} is of {run['reach']} alone: leave --reach out")
        return out
    names = reaches_in(out)
    if reach in names:
        return out / str(reach)
    if reach is None and not names:
        raise no_run(out)
    came = "no --reach" if reach is None else f"--reach {reach}"
    raise ConfigError(f"{came}: expected one of the reaches in {out}: {', '.join(names) or 'there are none'}")


def _words(days: "SeasonDays", joined: "Joined", law: "DelayLaw") -> str:
    import numpy as np

    from rivid.report.page import terminal

    had, has = np.isfinite(days.delay), np.isfinite(joined.delay)
    t = law.table
    flows, delays = (t.discharge_low, t.discharge_high, t.discharge), (t.delay, t.low, t.high)
    return terminal(
        "season", days=days, joined=joined, law=law, reach=abbreviate(days.reach), wrap=wrap,
        unseen=int((~joined.observed).sum()), alone=int(had.sum()), together=int(has.sum()),
        differ=int((had & has & (days.delay != joined.delay)).sum()), new=int((has & ~had).sum()),
        gone=int((had & ~has).sum()),
        classes=list(zip(*flows, *delays, t.day_low, t.day_high, t.n, strict=True)),
    )  # fmt: skip
