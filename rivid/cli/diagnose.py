"""``rivid diagnose``."""

import datetime as dt
from pathlib import Path

import click

PATH = click.Path(path_type=Path)
DATE = click.DateTime(["%Y-%m-%d"])


@click.command("diagnose", short_help="Find what a simulation of the reach still lacks.")
@click.argument("data_dir", type=PATH)
@click.option("--config", "-c", type=PATH, help="Configuration (TOML); default: Table I.")
@click.option("--out", "-o", type=PATH, help="Where the answer goes; default: rivid_out beside DATA_DIR.")
@click.option("--from", "first", type=DATE, metavar="DATE", help="Only days from this one on.")
@click.option("--to", "last", type=DATE, metavar="DATE", help="Only days up to this one.")
@click.option("--model", type=PATH, help="Begin with the effects of this augmented model (model.toml).")
@click.option("--no-figures", is_flag=True, help="No pictures.")
@click.option("--json", "as_json", is_flag=True, help="Print diagnosis.json on stdout.")
@click.option("--quiet", "-q", is_flag=True, help="No progress.")
def command(
    data_dir: Path,
    config: Path | None,
    out: Path | None,
    first: dt.datetime | None,
    last: dt.datetime | None,
    model: Path | None,
    no_figures: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Find the missing effect: where simulation and measurement disagree, and why.

    The reach's response is calibrated on the logs in DATA_DIR; what is left is compared with a catalogue of
    effects (`rivid effects`). An effect that stands out is named, added, and confirmed on days that nothing
    was fitted to. OUT gets diagnosis.json, diagnosis.html, pictures, unexplained_inflow.parquet and the
    augmented model as model.toml.

    Exit code: 0 an answer, 3 too few days for one, 10 no logs.

    \b
    Examples:
      rivid diagnose logs --config reach.toml --out results
      rivid diagnose logs --config reach.toml --model results/model.toml --out again
    """
    import sys
    from dataclasses import replace

    from rivid.config import load_config
    from rivid.diagnosis.days import read_record
    from rivid.diagnosis.model.augmented import read_effects, write_model
    from rivid.diagnosis.setting import gauge_floor_of, library_of, responses_of
    from rivid.diagnosis.telling.table import summary
    from rivid.diagnosis.telling.writing import write_diagnosis
    from rivid.diagnosis.workflow import diagnose

    settings = load_config(config)
    place = out if out is not None else data_dir.resolve().parent / "rivid_out"
    classes = library_of(settings)
    start = read_effects(model, settings) if model else ()

    def report(text: str) -> None:
        if quiet:
            return
        end = "\r" if sys.stderr.isatty() else "\n"
        click.echo(f"{text:<78.78}{end}", err=True, nl=False)

    report("reading the logs")
    logs = read_record(
        data_dir, settings, first=first.date() if first else None, last=last.date() if last else None,
        today=dt.datetime.now(dt.UTC),
    )  # fmt: skip
    record = logs.record
    answer, evidence = diagnose(
        record, responses_of(settings, record), classes, gauge_floor=gauge_floor_of(settings, record),
        start=start, most=settings.diagnose.most_effects, report=report,
    )  # fmt: skip
    if logs.failed:
        day, why = logs.failed[0]
        which = f"{len(logs.failed)} days or files could not be used; the first, {day or 'a file'}: {why}"
        answer = replace(answer, notes=(*answer.notes, which))
    report("writing")
    page = write_diagnosis(
        place, answer, evidence, draw=not no_figures, reach=settings.reach.name, classes=classes
    )
    if evidence is not None:
        write_model(place / "model.toml", answer, evidence, settings, start)
    if not quiet and sys.stderr.isatty():
        click.echo(" " * 78 + "\r", err=True, nl=False)
    click.echo(answer.to_json() if as_json else summary(answer, page), nl=not as_json)
    return 3 if answer.verdict == "insufficient_data" else 0
