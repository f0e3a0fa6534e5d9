"""``rivid bounds``."""

import json
import math
import re
from dataclasses import asdict
from pathlib import Path

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, abbreviate, wrap
from rivid.errors import ConfigError


@click.command("bounds")
@click.argument("data_dir", type=shared.PATH, default=".")
@shared.config()
@shared.flag("--toml", "Only the proposal, as lines of a configuration.", "as_toml")
@shared.value("--write", shared.FILE, "FILE", "Put the proposal into this configuration.")
@shared.as_json()
def command(data_dir: Path, config: Path | None, as_toml: bool, write: Path | None, as_json: bool) -> int:
    """Travel-time bounds of the reach (section II), and the delays they propose.

    DATA_DIR, by default this directory, is where the search for rivid.toml starts; no log is read.

    \b
    Examples:
      rivid bounds
      rivid bounds --config configs/glen_canyon.toml
      rivid bounds --config configs/glen_canyon.toml --toml > proposed.toml
      rivid bounds --config configs/glen_canyon.toml --write out/proposed.toml
    """
    import numpy as np

    from rivid.atomic import write_text
    from rivid.cli.locate import configuration
    from rivid.config import DAY, MOST_DAYS, load_config
    from rivid.core.settings import MAX_ORDER
    from rivid.report.page import terminal

    console = Console()
    settings = load_config(configuration(config, data_dir, console))
    reach = settings.reach
    (low, high), T_s = reach.discharge_range, reach.sample_time
    bounds = reach.bounds(np.linspace(low, high, 8))
    proposal = reach.proposal()

    geometry = ("length", "width", "depth", "discharge_range", "sample_time")
    missing = [key for key in geometry if key not in reach.model_fields_set]
    if missing:
        values = ((key, getattr(reach, key)) for key in missing)
        listed = ", ".join(f"{k} = {list(v) if isinstance(v, tuple) else f'{v:g}'}" for k, v in values)
        console.info(f"[reach] lacks {', '.join(missing)}: taken from another reach (Table I), {listed}")
    too_long = ""
    if proposal.order > MAX_ORDER:
        enough = T_s * (proposal.d_max + 6) / MAX_ORDER
        unit = 10.0 ** (math.floor(math.log10(enough)) - 1)
        enough = math.ceil(enough / unit) * unit
        too_long = (
            f"these bounds need an impulse response of {proposal.d_max + 3} samples at sample_time = {T_s:g} "
            f"s, {MAX_ORDER} is the most: set [reach] sample_time to {enough:g} s or more"
        )
    if as_json:
        table = {name: values.tolist() for name, values in asdict(bounds).items()}
        answer = {"reach": reach.name, "bounds": table, "proposal": asdict(proposal)}
        click.echo(json.dumps(answer | {"assumed": missing, "message": too_long}))
        return 0
    lines = (
        f"[jmap]\nd_min = {proposal.d_min}\nd_max = {proposal.d_max}\norder = {proposal.order}\n"
        f"sigma_d = {proposal.delay_scale:g}"
    )
    longest = float((bounds.kinematic if reach.kind == "river" else bounds.gravity).max())
    if longest < T_s:
        lines += f"\n# a wave takes {longest:.0f} s or less, a sample {T_s:g} s: no delay can be resolved;"
        lines += f"\n# log every {longest / 2.0:.0f} s or more often"
    days = math.ceil((3 if reach.kind == "river" else 2) * proposal.order * T_s / DAY)
    tables = {"jmap": lines}
    if days > settings.run.window_days and not settings.run.window:
        # the response needs two samples for each of its lags
        tables["run"] = f"[run]\nwindow_days = {min(days, MOST_DAYS)}"
        if as_toml and "run" in settings.model_fields_set:  # a second [run] would be no TOML
            tables["run"] = f"# set window_days = {min(days, MOST_DAYS)} in [run]: the response is long"
    lines = "\n\n".join(tables.values())
    if too_long and (write is not None or as_toml):
        raise ConfigError(too_long)
    if write is not None:
        write_text(write, updated(write, tables))
        click.echo(f"written: {write}")
        return 0
    if as_toml:
        click.echo(f"\n# From the travel times of the reach's waves, by `rivid bounds`.\n{lines}")
        return 0
    waves = (bounds.discharge, bounds.velocity, bounds.froude, bounds.gravity, bounds.kinematic)
    text = terminal(
        "bounds", name=abbreviate(reach.name), reach=reach, T_s=T_s, waves=list(zip(*waves, strict=True)),
        proposal=proposal, too_long=too_long, lines=lines, wrap=wrap,
    )  # fmt: skip
    click.echo(text)
    return 0


def updated(path: Path, tables: dict[str, str]) -> str:
    """The text of a configuration with these lines in its tables; other keys and comments stay."""
    from rivid.config import read_toml

    given, text = (read_toml(path), path.read_text(encoding="utf-8")) if path.exists() else ({}, "")
    for name, lines in tables.items():
        if name not in given:
            text = f"{text.rstrip()}\n\n{lines}\n".lstrip()
            continue
        new = lines.splitlines()
        stale = {"M", *map(_without_value, new)}  # M is the order
        kept, inside = [], False
        for line in text.splitlines():
            if line.lstrip().startswith("["):
                inside = re.fullmatch(rf"\s*\[\s*{name}\s*\]\s*(#.*)?", line) is not None
                kept += new if inside else [line]
            elif not (inside and _without_value(line) in stale):
                kept.append(line)
        if new[0] not in kept:
            raise ConfigError(
                f"{path}: {name} has no line [{name}]: `rivid bounds --toml` prints what to put there"
            )
        text = "\n".join(kept) + "\n"
    return text


def _without_value(line: str) -> str:
    """A key without its value, or a comment without its numbers."""
    return re.sub(r"\s*=.*|[\d.]+", "", line.strip())
