"""Figures of a run: results in, PNG files out.

Importing this package loads no matplotlib; drawing does.
"""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import datetime as dt

    from rivid.plots.style import FigureFile
    from rivid.results.read import Results


KINDS = ("t50_", "tdr_", "histogram_", "delay_map_", "delay_discharge_", "fir_day.")
"""How the names of the figures begin that this package owns in OUT/figures."""


Job = tuple[str, str]
"""A figure to draw: its kind, and the estimator it shows; empty for all of them."""


def draw_all(results: "Results", out: Path, *, day: "dt.date | None" = None) -> "list[FigureFile]":
    """Draw every figure of a run into OUT/figures, over those that are there.

    Parameters
    ----------
    results : Results
        All of OUT.
    out : Path
        OUT; files are written to its folder ``figures``.
    day : datetime.date, optional
        The day whose impulse responses are shown; a typical one by default.

    Returns
    -------
    list of FigureFile
        Per estimator: tdr, where it has impulse responses, and histogram, delay_map and delay_discharge,
        where it estimates delays; then the responses of one day. Nothing for an estimator without a single
        row. For a river, t50 and t50_discharge of the one estimator whose t50 speaks for it.

    Raises
    ------
    ConfigError
        Where `day` is not among the results.
    RividError
        Where a file cannot be written.

    Notes
    -----
    Source: Figs 12-18. The same results give the same bytes.
    """
    folder = out / "figures"
    drawn = [draw(results, job, folder, day=day) for job in jobs(results)]
    files = [file for file in drawn if file is not None]
    drop_old(folder, files)
    return files


def jobs(results: "Results") -> list[Job]:
    """The figures of a run, in the order of the report."""
    from rivid.estimators import ESTIMATORS
    from rivid.results.passage import leading_response
    from rivid.results.selection import estimates_delay

    speaks = leading_response(results)
    found: list[Job] = []
    for e in results.estimators:
        if not e.dates:
            continue
        kinds = ["t50", "t50_discharge"] if e is speaks else []
        kinds += ["tdr"] if ESTIMATORS[e.estimator].has_fir else []
        kinds += ["histogram", "delay_map", "delay_discharge"] if estimates_delay(e) else []
        found += [(kind, e.estimator) for kind in kinds]
    return [*found, ("fir_day", "")]


def draw(results: "Results", job: Job, folder: Path, *, day: "dt.date | None" = None) -> "FigureFile | None":
    """Draw one figure; None where no day has what it shows.

    Parameters
    ----------
    results : Results
        All of OUT.
    job : Job
        One of :func:`jobs`.
    folder : Path
        Where the file goes.
    day : datetime.date, optional
        As of :func:`draw_all`.

    Returns
    -------
    FigureFile or None

    Raises
    ------
    ConfigError, RividError
        As :func:`draw_all`.
    """
    from rivid.plots import delay_map, discharge, fir_day, histogram, style, t50, tdr

    kind, name = job
    with style.styled():
        if kind == "fir_day":
            return fir_day.draw(results, folder, day=day)
        estimator = next(e for e in results.estimators if e.estimator == name)
        painter = {
            "t50": t50.draw,
            "t50_discharge": t50.draw_discharge,
            "tdr": tdr.draw,
            "histogram": histogram.draw,
            "delay_map": delay_map.draw,
            "delay_discharge": discharge.draw,
        }[kind]
        return painter(results, estimator, folder)


def drop_old(folder: Path, files: "list[FigureFile]") -> None:
    """Remove figures of estimators that are no longer part of the run."""
    kept = {file.path.name for file in files}
    for kind in KINDS:
        for path in folder.glob(f"{kind}*.png"):
            if path.name not in kept:
                path.unlink(missing_ok=True)
