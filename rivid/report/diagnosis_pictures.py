"""Figures of the page of a diagnosis, from the answer and its arrays."""

from pathlib import Path

import numpy as np

from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.result import Diagnosis, Gap
from rivid.plots import diagnosis as plots
from rivid.plots import style
from rivid.plots.style import FigureFile
from rivid.report.quantities import name, scale, sentence


def draw_pictures(out: Path, diagnosis: Diagnosis, evidence: Evidence | None) -> list[FigureFile]:
    """Draw the figures of a diagnosis into OUT/figures.

    Parameters
    ----------
    out : Path
    diagnosis : Diagnosis
    evidence : Evidence or None
        None: only the gap can be drawn.

    Returns
    -------
    list of FigureFile
        In the order of the page; those that have something to show.

    Raises
    ------
    RividError
        Where a file cannot be written.
    """
    folder, named = out / "figures", bool(diagnosis.effects)
    files: list[FigureFile | None] = []
    with style.styled():
        if diagnosis.gap is not None and np.isfinite(diagnosis.gap.rmse_baseline).any():
            files.append(_gap(folder, diagnosis.gap))
        loop = diagnosis.closed_loop
        if loop is not None and loop.shown is not None:
            words = sentence("loop", loop, named)
            files.append(plots.draw_loop(folder, loop.shown, words, named=named))
        if evidence is not None and evidence.record.used.any():
            windows = [(name(f.name), *f.where.dates) for f in diagnosis.effects if f.where.dates]
            files += [
                plots.draw_day(folder, evidence, named=named),
                plots.draw_map(folder, evidence, named=named),
                plots.draw_inflow(folder, evidence, named=named, windows=windows),
            ]
    return [file for file in files if file is not None]


def drop_pictures(out: Path, kept: list[FigureFile]) -> None:
    """Remove figures of an earlier diagnosis that are not among `kept`."""
    names = {file.path.name for file in kept}
    for kind in plots.KINDS:
        path = out / "figures" / f"{kind}.png"
        if path.name not in names:
            path.unlink(missing_ok=True)


def _gap(folder: Path, gap: Gap) -> FigureFile:
    factor, unit = scale(gap)

    def scaled(values: tuple[float, ...]) -> list[float]:
        return [factor * v for v in values]

    rows: list[plots.Row] = [("without any effect", scaled(gap.rmse_baseline), False)]
    for step in gap.steps:
        rows.append((f"+ {name(step.added)}", scaled(step.rmse), False))
        if step.rmse_described is not None:
            rows.append(("events timed on the day", scaled(step.rmse_described), True))
    return plots.draw_gap(
        folder, rows=rows, hours=gap.horizon_h, floor=scaled(gap.rmse_floor) if gap.rmse_floor else None,
        unit=unit, days=len(gap.heldout_dates),
    )  # fmt: skip
