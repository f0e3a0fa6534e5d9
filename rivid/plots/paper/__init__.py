"""The paper's figures of a year of logs: 2-7, 9-10, 12-19, as SVG and PNG, and one page that shows them.

Importing this package loads no matplotlib; drawing does.
"""

import datetime as dt
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rivid.plots.paper.cascade import CascadeReach
    from rivid.plots.paper.estimates import Estimates
    from rivid.plots.paper.sheets import PaperFigure
    from rivid.plots.paper.year import Year

STEPS = 10
"""How often :func:`draw_paper` reports progress."""


def draw_paper(
    year: "Year",
    estimates: "Estimates",
    cascade: "Sequence[CascadeReach]",
    folder: Path,
    *,
    day: "dt.date | None" = None,
    progress: Callable[[], Any] | None = None,
) -> "list[PaperFigure]":
    """Draw the paper's figures and the page that shows them.

    Parameters
    ----------
    year : Year
        The logs.
    estimates : Estimates
        What the estimators make of them.
    cascade : sequence of CascadeReach
        The reaches of Fig. 19; at least one.
    folder : Path
        Where ``index.html`` and the files of each figure go.
    day : datetime.date, optional
        The day of Figs 7 and 12; a typical one by default.
    progress : callable, optional
        Called :data:`STEPS` times.

    Returns
    -------
    list of PaperFigure
        In the paper's order.

    Raises
    ------
    ConfigError
        Where `day` has no impulse response.
    RividError
        Where a file cannot be written.

    Notes
    -----
    The same logs give the same bytes.
    """
    from rivid.plots import style
    from rivid.plots.paper import bars, delays, hydraulics, one_day, theory
    from rivid.plots.paper import cascade as row
    from rivid.report.build import write_gallery

    i = one_day.choose(estimates, day)
    T = year.sample_time
    jobs: list[Callable[[], Any]] = [
        lambda: hydraulics.draw(year, folder),
        lambda: one_day.logs(year, i, folder),
        lambda: delays.search_histograms(estimates, folder),
        lambda: theory.response(T, folder),
        lambda: theory.priors(estimates, i, folder),
        lambda: one_day.responses(estimates, i, folder),
        lambda: bars.draw(estimates, folder),
        lambda: delays.maps(estimates, folder),
        lambda: delays.jmap_histograms(estimates, folder),
        lambda: row.draw(cascade, folder),
    ]
    assert len(jobs) == STEPS
    figures: list[PaperFigure] = []
    with style.styled():
        for job in jobs:
            made = job()
            figures += made if isinstance(made, list) else [made]
            if progress is not None:
                progress()
    write_gallery(year, figures, folder)
    return figures
