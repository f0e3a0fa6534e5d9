"""From an answer and its arrays to the pictures of the page."""

from pathlib import Path

import numpy as np

from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.result import ClosedLoop, Diagnosis, Gap, LoopDay
from rivid.plots.diagnosis import KINDS
from rivid.plots.style import FigureFile
from rivid.report.quantities import name as name_words
from rivid.report.quantities import scale as scale_of
from rivid.report.quantities import sentence
from rivid.text import count


def draw_pictures(out: Path, diagnosis: Diagnosis, evidence: Evidence | None) -> list[FigureFile]:
    """Draw the pictures of a diagnosis into OUT/figures.

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
    from rivid.plots import style
    from rivid.plots.diagnosis import heat, one_day, season
    from rivid.plots.diagnosis.panels import Window

    folder = out / "figures"
    files: list[FigureFile] = []
    with style.styled():
        if diagnosis.gap is not None and np.isfinite(diagnosis.gap.rmse_baseline).any():
            files.append(_gap(folder, diagnosis.gap))
        loop = diagnosis.closed_loop
        if loop is not None and loop.shown is not None:
            files.append(_loop(folder, loop, loop.shown, bool(diagnosis.effects)))
        if evidence is None or not evidence.record.used.any():
            return files
        r, named = evidence.record, bool(diagnosis.effects)
        pool = r.kind == "pool"
        day = one_day.draw(
            folder, dates=r.dates, hour=r.hour, used=r.used, lead=r.lead, apart=evidence.split.sealed,
            measured=r.output, before=evidence.run_before, after=evidence.run_after if named else None,
            inflow=r.inflow, outflow=r.outflow if pool else None,
        )  # fmt: skip
        drivers = [("inflow [m³/s]", r.inflow)]
        drivers += [("outflow [m³/s]", r.outflow), ("level [m]", r.output)] if pool else []
        drivers += [] if pool else [("discharge [m³/s]", r.output)]
        course = season.draw(
            folder, dates=r.dates, hour=r.hour, used=r.used, block=evidence.split.block,
            before=season.Series(evidence.inflow_before, evidence.inflow_before_sd),
            after=season.Series(evidence.inflow_after, evidence.inflow_after_sd) if named else None,
            drivers=drivers,
            windows=[Window(name_words(e.name), *e.where.dates) for e in diagnosis.effects if e.where.dates],
        )  # fmt: skip
        table = heat.draw(
            folder, dates=r.dates, hour=r.hour, used=r.used, before=evidence.inflow_before,
            after=evidence.inflow_after if named else None,
        )  # fmt: skip
    return [*files, *([day] if day else []), table, course]


def drop_pictures(out: Path, kept: list[FigureFile]) -> None:
    """Remove pictures of an earlier diagnosis that are not among `kept`."""
    names = {file.path.name for file in kept}
    for kind in KINDS:
        path = out / "figures" / f"{kind}.png"
        if path.name not in names:
            path.unlink(missing_ok=True)


def _gap(folder: Path, gap: Gap) -> FigureFile:
    from rivid.plots.diagnosis.gap import Row, draw

    factor, unit = scale_of(gap)

    def told(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(factor * v for v in values)

    rows = [Row("without any effect", told(gap.rmse_baseline))]
    for step in gap.steps:
        rows.append(Row(f"+ {name_words(step.added)}", told(step.rmse)))
        if step.rmse_described is not None:
            rows.append(Row("events timed on the day", told(step.rmse_described), described=True))
    return draw(
        folder, rows=rows, hours=gap.horizon_h, floor=told(gap.rmse_floor) if gap.rmse_floor else None,
        unit=unit, days=count(len(gap.heldout_dates), "day"),
    )  # fmt: skip


def _loop(folder: Path, loop: ClosedLoop, day: LoopDay, named: bool) -> FigureFile:
    from rivid.plots.diagnosis.loop import draw

    curves = 3 if named else 2
    return draw(
        folder, date=day.date, hour=np.array(day.hour), inflow=np.array(day.inflow),
        level=[np.array(v) for v in day.level[:curves]], outflow=[np.array(v) for v in day.outflow[:curves]],
        words=sentence("loop", loop, named),
    )  # fmt: skip
