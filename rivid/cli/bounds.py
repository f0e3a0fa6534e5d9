"""``rivid bounds``."""

from pathlib import Path

import click


@click.command("bounds", short_help="Travel-time bounds of the reach, and what they propose.")
@click.option(
    "--config", "-c", type=click.Path(path_type=Path), help="Configuration (TOML); default: Table I."
)
@click.option("--json", "as_json", is_flag=True, help="As one JSON object.")
def command(config: Path | None, as_json: bool) -> int:
    """Travel-time bounds of the reach (section II), and the delays they propose.

    \b
    Examples:
      rivid bounds                                    the reach of Table I
      rivid bounds --config configs/glen_canyon.toml
    """
    import json
    from dataclasses import asdict

    import numpy as np

    from rivid.config import load_config
    from rivid.core.hydraulics import propose_delays, travel_bounds

    reach = load_config(config).reach
    low, high = reach.discharge_range
    T_s = reach.sample_time
    shape = {"length": reach.length, "width": reach.width, "depth": reach.depth}
    bounds = travel_bounds(np.linspace(low, high, 8), **shape)
    proposal = propose_delays((low, high), **shape, sample_time=T_s, kind=reach.kind)
    if as_json:
        table = {name: values.tolist() for name, values in asdict(bounds).items()}
        click.echo(json.dumps({"reach": reach.name, "bounds": table, "proposal": asdict(proposal)}))
        return 0
    click.echo(f"{reach.name}: {reach.length:g} m long, {reach.width:g} m wide, {reach.depth:g} m deep; "
               f"T_s = {T_s:g} s\n")  # fmt: skip
    click.echo("discharge  velocity  Froude    gravity wave        kinematic wave")
    click.echo("     m3/s       m/s       -      min  samples        min  samples")
    for Q, v, F, g, k in zip(
        bounds.discharge, bounds.velocity, bounds.froude, bounds.gravity, bounds.kinematic, strict=True
    ):
        click.echo(f"{Q:9.0f} {v:9.2f} {F:7.3f} {g / 60:8.1f} {g / T_s:8.1f} {k / 60:10.1f} {k / T_s:8.1f}")
    click.echo(
        f"\nThe first sign of an inflow arrives with the {proposal.wave} wave; a travel time of n samples\n"
        "is a delay d = n - 1, since the inflow first acts at lag d + 1. Proposed for [jmap]:\n"
    )
    click.echo(f"d_min = {proposal.d_min}\nd_max = {proposal.d_max}\norder = {proposal.order}")
    click.echo(f"sigma_d = {proposal.delay_scale:g}")
    return 0
