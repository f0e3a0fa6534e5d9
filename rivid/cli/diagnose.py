"""``rivid diagnose``."""

import datetime as dt
from pathlib import Path

import click

from rivid.cli import options as shared
from rivid.cli.console import Console


@click.command("diagnose")
@shared.data_dir
@shared.config()
@shared.out
@shared.value("--model", shared.FILE, "FILE", "Start with the effects of this augmented model (model.toml).")
@shared.flag("--no-figures", "Draw no figures.")
@shared.days("use")
@shared.as_json("diagnosis.json on stdout.")
@shared.talk
def command(
    data_dir: Path, config: Path | None, out: Path | None, model: Path | None, no_figures: bool,
    first: dt.date | None, last: dt.date | None, as_json: bool, console: Console,
) -> int:  # fmt: skip
    """Find the missing effect: where simulation and measurement disagree, and why.

    The reach's response is calibrated on the logs in DATA_DIR, without and with each effect of a catalogue
    (`rivid effects`) and with unknown causes; each is scored on days that it was not fitted to. A probable
    effect that matters is named, added to the model, and confirmed on days that were not used in any fit.
    OUT receives diagnosis.json, diagnosis.html, figures, unexplained_inflow.parquet and the augmented model
    as model.toml.

    Exit code: 0 an answer, 3 too few days for one, 10 no logs.

    \b
    Examples:
      rivid simulate configs/scenarios/effects/leakage.toml --out out/leaking
      rivid diagnose out/leaking --out out/found --to 2008-02-15
      rivid diagnose out/leaking --model out/found/model.toml --out out/again
    """
    from rivid.api.diagnosis import diagnose
    from rivid.cli.locate import configuration, results
    from rivid.config import load_config
    from rivid.report.diagnosis import summary

    config = configuration(config, data_dir, console)
    place = results(out, config, data_dir)
    console.begin(("logs", data_dir), ("settings", config or "Table I"), ("model", model), ("results", place))
    settings = load_config(config)
    with console.steps() as step:
        step("reading the logs")
        diagnosed = diagnose(
            data_dir, settings, first=first, last=last, model=model,
            report=lambda done, what: step(what),
        )  # fmt: skip
        step("writing")
        page = diagnosed.write(place, pictures=not no_figures)
    if as_json:
        click.echo(diagnosed.answer.to_json(), nl=False)
    else:
        console.say(summary(diagnosed.answer, page))
    return 3 if diagnosed.verdict == "insufficient_data" else 0
