"""The page that shows the paper's figures: light and dark, no script, nothing from outside."""

from collections.abc import Sequence
from pathlib import Path

from rivid.plots.paper.sheets import PaperFigure
from rivid.plots.paper.year import Year
from rivid.report import page
from rivid.text import count, day_range, number

PARTS = (
    ("The reach and its hydraulics", ("2", "3", "4", "5", "6")),
    ("The data, and the simple models", ("7", "9", "10")),
    ("One day", ("11", "12")),
    ("The year", ("13", "14", "15", "16", "17", "18")),
    ("The cascade", ("19",)),
)
"""Headings of the page, and the figures under each."""


def write(year: Year, figures: Sequence[PaperFigure], folder: Path) -> Path:
    """Write ``index.html`` beside the figures.

    Parameters
    ----------
    year : Year
    figures : sequence of PaperFigure
        All in `folder`: the page links to them by name.
    folder : Path

    Returns
    -------
    Path
        The page.
    """
    parts = [
        (heading, f"part{i}", [f for f in figures if f.number in numbers])
        for i, (heading, numbers) in enumerate(PARTS, 1)
    ]
    return page.write_page(
        folder / "index.html",
        "paper",
        dict(
            reach=year.config.reach.name,
            period=day_range(year.dates[0], year.dates[-1]),
            days=count(len(year.dates), "day"),
            left_out=year.left_out,
            sample_time=number(year.sample_time),
            parts=parts,
        ),
    )
