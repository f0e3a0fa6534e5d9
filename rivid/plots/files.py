"""The record of a written figure, in a module of its own: to read it, no matplotlib is loaded (0.4 s)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class FigureFile:
    """A figure that has been written."""

    #: as in `draw.FIGURES` or `diagnosis.KINDS`, fir_day, forecast, season, delay_law; "9" is of the paper
    kind: str
    estimator: str  # empty where it shows all of them
    path: Path  # of the PNG; one of the paper has an SVG of the same name as well
    title: str
    facts: dict[str, Any]  # numbers and codes of its caption, which the template `captions.j2` words
    width: int  # [pixels]
    height: int
