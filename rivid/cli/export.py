"""``rivid export``."""

from pathlib import Path

import click

from rivid.cli import options as shared
from rivid.cli.console import print_error

FORMATS = ("state-space", "rtc-tools", "pypsa", "csv")


@click.command("export")
@click.argument("source", type=shared.PATH)
@shared.value("--out", shared.NEW_DIRECTORY, "DIR", "Directory of the files; default: SOURCE/export.", "-o")
@shared.value("--to", shared.OneOf(FORMATS), "|".join(FORMATS), "The format.", required=True)
@shared.value(
    "--snapshot", click.FloatRange(min=0, min_open=True), "SECONDS",
    "Of pypsa, the time of a snapshot with the weighting 1, in which delays are counted; default: 3600.",
    default=3600.0,
)  # fmt: skip
@shared.quiet
def command(source: Path, to: str, out: Path | None, snapshot: float, quiet: bool) -> int:
    """Write a calibrated reach, or its delays, for other software.

    SOURCE is, for state-space and rtc-tools, the model.toml of `rivid diagnose` or its directory; for pypsa
    and csv the directory of a run that `rivid season` has joined.

    \b
    state-space  discrete A, B, C, D with dead time, and noise covariances
    rtc-tools    parameters of an IDZ block (pool) or a LagAndK block (river)
    pypsa        a link for each class of discharge, with its delay in snapshots
    csv          delay against discharge, with its interval

    \b
    Examples:
      rivid export out/found --to state-space
      rivid export out/sure --to csv --out out/law
      rivid export out/sure --to pypsa --out out/links --snapshot 900
    """
    from rivid.export import export, unresolved

    folder = source if source.is_dir() else source.parent
    for path in export(source, out or folder / "export", to, snapshot):
        if not quiet:
            click.echo(str(path))
    if to == "pypsa" and (remark := unresolved(source, snapshot)):
        print_error(remark)
    return 0
