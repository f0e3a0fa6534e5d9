"""``rivid forecast``."""

import datetime as dt
from pathlib import Path
from zoneinfo import ZoneInfo

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, wrap

MOMENT = click.DateTime(
    ["%Y-%m-%dT%H:%M:%S%z", "%Y-%m-%dT%H:%M%z", "%Y-%m-%dT%H:%M:%S", "%Y-%m-%dT%H:%M", "%Y-%m-%d %H:%M"]
)


@click.command("forecast")
@shared.data_dir
@shared.config()
@shared.out
@shared.value(
    "--model", shared.PATH, "FILE", "model.toml of `rivid diagnose`, or its directory.", required=True
)
@shared.value(
    "--hours", click.FloatRange(0.1, 96.0), "H", "Longest horizon.", default=24.0, show_default=True
)
@shared.value("--at", MOMENT, "TIME", "Forecast from this time; default: the last output in the logs.")
@shared.flag("--no-figures", "Write no page and no figure.")
@shared.as_json("A JSON object for each time on stdout.")
@shared.talk
def command(
    data_dir: Path, config: Path | None, model: Path, out: Path | None, hours: float,
    at: dt.datetime | None, no_figures: bool, as_json: bool, console: Console,
) -> int:  # fmt: skip
    """Forecast the level or discharge of the next hours, with bands of 50 and 90 %.

    The reach of the model is simulated through the logs in DATA_DIR and beyond. Rows after the forecast's
    origin with flows and no output are announced flows; without them the flows are held, and the inflow
    of the day before is simulated as well. The weights of both, and the bands, are estimated from earlier
    forecasts in the logs. OUT receives forecast.csv, forecast.parquet and forecast.html.

    Exit code: 0 a forecast, 10 no logs to forecast from.

    \b
    Examples:
      rivid diagnose out/leaking --out out/found
      rivid forecast out/leaking --model out/found --out out/next
      rivid forecast out/leaking --model out/found --hours 6 --json
    """
    from rivid.cli.locate import configuration, results
    from rivid.config import load_config
    from rivid.diagnosis.calibrated import load_model
    from rivid.forecast import forecast, read_logs
    from rivid.report.forecast import headline, lines, write_page_of, write_tables_of

    config = configuration(config, data_dir, console)
    place = results(out, config, data_dir)
    console.begin(("logs", data_dir), ("settings", config or "Table I"), ("model", model), ("results", place))
    settings, reach = load_config(config), load_model(model)
    if at is not None and at.tzinfo is None:
        at = at.replace(tzinfo=ZoneInfo(settings.input.time_zone or "UTC"))
    series, notes = read_logs(data_dir, settings, reach, hours=hours, at=at)
    console.phase("reading the logs")
    found = forecast(reach, series, notes=notes)
    console.phase("forecasting")
    write_tables_of(found, settings, place)
    if not no_figures:
        page = write_page_of(found, settings, place)
    console.phase("writing")
    if as_json:
        click.echo("\n".join(lines(found, settings)))
    else:
        console.say(wrap(headline(found, settings)))
        console.say(f"forecast: {place / 'forecast.csv'}" if no_figures else f"page: {page}")
    return 0
