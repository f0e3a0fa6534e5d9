"""Figures of a run: results in, PNG files out.

Importing this package loads no matplotlib; drawing does.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import datetime as dt

    from rivid.results import Results


KINDS = ("t50_", "tdr_", "histogram_", "delay_map_", "delay_discharge_", "fir_day.")
"""How the names of the figures begin that this package owns in OUT/figures."""


@dataclass(frozen=True)
class FigureFile:
    """A figure that has been written.

    Attributes
    ----------
    kind : str
        t50, t50_discharge, tdr, histogram, delay_map, delay_discharge or fir_day.
    estimator : str
        Whose results it shows; empty for all of them.
    path : Path
        The PNG file.
    title, caption : str
        What it is, and how to read it.
    width, height : int
        Size [pixels].
    """

    kind: str
    estimator: str
    path: Path
    title: str
    caption: str
    width: int
    height: int


def draw_all(results: "Results", out: Path, *, day: "dt.date | None" = None) -> list[FigureFile]:
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
    from rivid.figures import delay_map, discharge, fir_day, histogram, style, t50, tdr
    from rivid.figures.passage import leading_response
    from rivid.figures.selection import estimates_delay
    from rivid.figures.words import WITHOUT_FIR

    folder = out / "figures"
    files = []
    speaks = leading_response(results)
    with style.styled():
        for estimator in results.estimators:
            if not estimator.dates:
                continue
            if estimator is speaks:
                files.append(t50.draw(results, estimator, folder))
                files.append(t50.draw_discharge(results, estimator, folder))
            if estimator.estimator not in WITHOUT_FIR:
                files.append(tdr.draw(results, estimator, folder))
            if estimates_delay(estimator):
                for figure in (histogram, delay_map, discharge):
                    files.append(figure.draw(results, estimator, folder))
        one_day = fir_day.draw(results, folder, day=day)
        if one_day is not None:
            files.append(one_day)
    _drop_old(folder, files)
    return files


def _drop_old(folder: Path, files: list[FigureFile]) -> None:
    """Remove figures of estimators that are no longer part of the run."""
    kept = {file.path.name for file in files}
    for kind in KINDS:
        for path in folder.glob(f"{kind}*.png"):
            if path.name not in kept:
                path.unlink(missing_ok=True)
