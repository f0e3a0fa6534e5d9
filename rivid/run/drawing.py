"""Figures and report of a run, drawn by worker processes side by side, or by this one.

A painter reads the results from OUT itself; nothing heavy travels, and this process never holds them.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rivid.plots.draw import Job
    from rivid.plots.style import FigureFile
    from rivid.results.read import Results
    from rivid.run.workers import Engine


_read: "tuple[Path, Results] | None" = None
"""What this painter has read; it lives for one run."""


def draw_here(out: Path, summary: Mapping[str, Any]) -> list[Path]:
    """Draw all figures and the report in this process; gives the files written."""
    from rivid.plots.draw import draw_all
    from rivid.report.build import write_report
    from rivid.results.read import load_results

    results = load_results(out)
    figures = draw_all(results, out)
    return [*(figure.path for figure in figures), write_report(results, figures, out, summary=summary)]


def draw_with(engine: "Engine", out: Path, summary: Mapping[str, Any]) -> list[Path]:
    """Draw all figures with an engine's workers, then the report; gives the files written.

    Parameters
    ----------
    engine : Engine
        Its workers see OUT.
    out : Path
        OUT, with its tables and run.json written.
    summary : mapping
        run.json, for the report.

    Raises
    ------
    RividError
        Where a file cannot be written.
    """
    from rivid.plots.draw import drop_old

    try:
        wanted = engine.submit(_wanted, out).result()
        # the responses of one day take longest: first, so that they end with the others
        under_way = {job: engine.submit(_paint, out, job) for job in sorted(wanted, key=_slowest)}
        drawn = [under_way[job].result() for job in wanted]
        files = [file for file in drawn if file is not None]
        drop_old(out / "figures", files)
        page: Path = engine.submit(_report, out, files, dict(summary)).result()
    except engine.died:  # out of memory, perhaps: one at a time needs less
        engine.renew()
        return draw_here(out, summary)
    return [*(file.path for file in files), page]


def _slowest(job: "Job") -> int:
    return 0 if job[0] == "fir_day" else 1


def forget_results() -> None:
    """Let go of what this process has read as a painter."""
    global _read
    _read = None


def _results(out: Path) -> "Results":
    global _read
    if _read is None or _read[0] != out:
        from rivid.results.read import load_results

        _read = (out, load_results(out))
    return _read[1]


def _wanted(out: Path) -> "list[Job]":
    from rivid.plots.draw import jobs

    return jobs(_results(out))


def _paint(out: Path, job: "Job") -> "FigureFile | None":
    from rivid.plots.draw import draw

    return draw(_results(out), job, out / "figures")


def _report(out: Path, figures: "list[FigureFile]", summary: dict[str, Any]) -> Path:
    from rivid.report.build import write_report

    return write_report(_results(out), figures, out, summary=summary)
