"""What is known of a figure that has been written.

Apart from the module that draws: a process that only receives it need not import matplotlib (0.4 s).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class FigureFile:
    """A figure that has been written as `path`, a PNG of `width` and `height` [pixels].

    `kind` is t50, t50_discharge, tdr, histogram, delay_map, delay_discharge, fir_day, season, delay_law or
    one of :data:`rivid.plots.diagnosis.KINDS`; the number of a figure of the paper, "9" for example,
    which has an SVG of the same name as well. `estimator` is empty where it shows all of them. `facts` are
    numbers and codes of its caption, which the template ``captions.j2`` words.
    """

    kind: str
    estimator: str
    path: Path
    title: str
    facts: dict[str, Any]
    width: int
    height: int
