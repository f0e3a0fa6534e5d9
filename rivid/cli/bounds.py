"""``rivid bounds``."""

from pathlib import Path

import click

from rivid.cli import options as shared
from rivid.cli.console import Console, abbreviate, wrap


@click.command("bounds", short_help="Travel-time bounds of the reach, and what they propose.")
@click.argument("data_dir", type=shared.PATH, default=".")
@shared.config()
@click.option("--toml", "as_toml", is_flag=True, help="Only what is proposed, as lines of a configuration.")
@shared.as_json()
def command(data_dir: Path, config: Path | None, as_toml: bool, as_json: bool) -> int:
    """Travel-time bounds of the reach (section II), and the delays they propose.

    DATA_DIR, by default this directory, is where rivid.toml is looked for; no log is read.

    \b
    Examples:
      rivid bounds
      rivid bounds --config configs/glen_canyon.toml
      rivid bounds --config configs/glen_canyon.toml --toml > proposed.toml
    """
    import json
    from dataclasses import asdict

    import numpy as np

    from rivid.cli.locate import configuration
    from rivid.config import load_config
    from rivid.core.hydraulics import propose_delays, travel_bounds

    reach = load_config(configuration(config, data_dir, Console())).reach
    low, high = reach.discharge_range
    T_s = reach.sample_time
    shape = {"length": reach.length, "width": reach.width, "depth": reach.depth}
    bounds = travel_bounds(np.linspace(low, high, 8), **shape)
    proposal = propose_delays((low, high), **shape, sample_time=T_s, kind=reach.kind)
    if as_json:
        table = {name: values.tolist() for name, values in asdict(bounds).items()}
        click.echo(json.dumps({"reach": reach.name, "bounds": table, "proposal": asdict(proposal)}))
        return 0
    lines = (
        f"[jmap]\nd_min = {proposal.d_min}\nd_max = {proposal.d_max}\norder = {proposal.order}\n"
        f"sigma_d = {proposal.delay_scale:g}"
    )
    if as_toml:
        click.echo(f"\n# From the travel times of the reach's waves, by `rivid bounds`.\n{lines}")
        return 0
    size = f"{reach.length:g} m long, {reach.width:g} m wide, {reach.depth:g} m deep; T_s = {T_s:g} s"
    click.echo(wrap(f"{abbreviate(reach.name)}: {size}") + "\n")
    click.echo("discharge  velocity  Froude    gravity wave        kinematic wave")
    click.echo("     m3/s       m/s       -      min  samples        min  samples")
    for Q, v, F, g, k in zip(
        bounds.discharge, bounds.velocity, bounds.froude, bounds.gravity, bounds.kinematic, strict=True
    ):
        click.echo(f"{Q:9.0f} {v:9.2f} {F:7.3f} {g / 60:8.1f} {g / T_s:8.1f} {k / 60:10.1f} {k / T_s:8.1f}")
    said = (
        f"The first sign of an inflow arrives with the {proposal.wave} wave; a travel time of n samples is a "
        "delay d = n - 1, since the inflow first acts at lag d + 1. Proposed for the configuration "
        "(--toml prints these lines alone):"
    )
    click.echo(f"\n{wrap(said, hanging=0)}\n")
    click.echo(lines)
    return 0
