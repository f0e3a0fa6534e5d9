"""Figures and report of a run, drawn by the workers of an engine.

A worker reads the results from OUT itself, so that this process does not hold them.
"""

import datetime as dt
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rivid.run.workers import Engine

if TYPE_CHECKING:
    from rivid.plots.draw import Job
    from rivid.plots.files import FigureFile
    from rivid.results.read import Results

MOST_PAINTERS = 4  # processes that draw: there are few figures, and each process reads the results itself


def draw_with(
    engine: Engine, out: Path, summary: Mapping[str, Any], day: dt.date | None = None
) -> list[Path]:
    """Draw all figures with an engine's workers, which see OUT, then the report; return the files, it last.

    `summary` is run.json; `day` is that of the impulse responses, a typical one by default: ConfigError if no
    estimator has a response on it.
    """
    try:
        # once for each worker, so that all read the results now
        wanted = [engine.submit(_wanted, out) for _ in range(min(engine.slots, MOST_PAINTERS))][0].result()
        # the responses of one day take longest: first, so that they end with the others
        order = sorted(wanted, key=lambda job: job[0] != "fir_day")
        under_way = {job: engine.submit(_paint, out, job, day) for job in order}
        drawn = [under_way[job].result() for job in wanted]
        files = [file for file in drawn if file is not None]
        page: Path = engine.submit(_report, out, files, dict(summary)).result()
    except engine.died:  # out of memory, perhaps: one figure at a time needs less
        engine.renew()
        return draw_with(Engine(), out, summary, day)
    finally:
        read_once.cache_clear()  # of an engine that is this process
    return [*(file.path for file in files), page]


@lru_cache(maxsize=1)
def read_once(out: Path) -> "Results":
    """The results in OUT; they are kept until those of another directory are read."""
    from rivid.results.read import load_results

    return load_results(out)


def _wanted(out: Path) -> "list[Job]":
    from rivid.plots.draw import jobs

    return jobs(read_once(out))


def _paint(out: Path, job: "Job", day: dt.date | None) -> "FigureFile | None":
    from rivid.plots.draw import draw

    return draw(read_once(out), job, out / "figures", day=day)


def _report(out: Path, figures: "list[FigureFile]", summary: dict[str, Any]) -> Path:
    from rivid.plots.draw import KINDS
    from rivid.plots.style import drop_old
    from rivid.report.build import write_report

    drop_old(out / "figures", figures, KINDS)
    return write_report(read_once(out), figures, out, summary=summary)
