"""What a simulation of the reach lacks, as an answer that shows itself."""

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rivid.api.given import GivenConfig, GivenDate, as_config, as_date
from rivid.api.season import SimulatedSeason
from rivid.config import Config
from rivid.core.hydraulics import propose_delays
from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.data import Record, as_record
from rivid.diagnosis.result import Diagnosis, Gap, NamedEffect, Unknown, Verdict
from rivid.effects import Effect
from rivid.errors import NoDataError
from rivid.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rivid.api.picture import Picture


@dataclass(frozen=True, repr=False, eq=False)
class DiagnosisResult:
    """What :func:`diagnose` found.

    Attributes
    ----------
    answer : Diagnosis
        All of it, as in diagnosis.json.
    evidence : Evidence or None
        The arrays behind it; None where there were too few days to look at anything.
    config : Config
        The reach and the settings that were taken.
    start : tuple of Effect
        Effects that were in the model from the start.
    """

    answer: Diagnosis
    evidence: Evidence | None
    config: Config
    start: tuple[Effect, ...] = ()

    def __repr__(self) -> str:
        named = "".join(f", {effect.name}" for effect in self.effects)
        return f"DiagnosisResult({self.config.reach.name}: {self.verdict}{named})"

    def __str__(self) -> str:
        from rivid.report.diagnosis import summary

        return summary(self.answer)

    @property
    def verdict(self) -> Verdict:
        """One of :data:`rivid.diagnosis.result.VERDICTS`."""
        return self.answer.verdict

    @property
    def reason(self) -> str:
        """Why, in a sentence with numbers."""
        return self.answer.reason

    @property
    def effects(self) -> tuple[NamedEffect, ...]:
        """What was named and added."""
        return self.answer.effects

    @property
    def unknown(self) -> Unknown | None:
        """What is missing and has no name."""
        return self.answer.unknown

    @property
    def gap(self) -> Gap | None:
        """Error of the simulation on days kept apart, before and after."""
        return self.answer.gap

    @property
    def notes(self) -> tuple[str, ...]:
        """What the reader must know."""
        return self.answer.notes

    def write(self, out: Path | str, *, pictures: bool = True) -> Path:
        """Write what `rivid diagnose` writes: page, pictures, JSON, unexplained inflow, augmented model.

        Parameters
        ----------
        out : Path or str
            A directory; it is made where there is none.
        pictures : bool
            Draw them.

        Returns
        -------
        Path
            The page.

        Raises
        ------
        RividError
            Where a file cannot be written.
        """
        from rivid.diagnosis.choice import library_of
        from rivid.diagnosis.model.augmented import write_model
        from rivid.report.diagnosis import write_diagnosis

        page = write_diagnosis(
            Path(out), self.answer, self.evidence, draw=pictures, reach=self.config.reach.name,
            classes=library_of(self.config),
        )  # fmt: skip
        if self.evidence is not None:
            write_model(Path(out) / "model.toml", self.answer, self.evidence, self.config, self.start)
        return page

    def plot(self) -> "Picture":
        """The unexplained inflow of each day, and the error on the days kept apart, before and after."""
        from rivid.api.picture import date_axes, picture
        from rivid.plots import style
        from rivid.report.diagnosis import headline

        with style.styled():
            figure, (course, errors) = picture(
                f"{self.config.reach.name}: what the simulation lacks", headline(self.answer), (1.7, 1.3)
            )
            if self.evidence is None:
                style.say(course, self.reason)
            else:
                seen = self.evidence
                at = [date.toordinal() for date in seen.record.dates]
                named = bool(self.effects)
                for values, colour, words in (
                    (seen.inflow_before, style.ACCENT, "before"), (seen.inflow_after, style.WATER, "after"),
                )[: 1 + named]:  # fmt: skip
                    course.plot(at, _daily(values, seen.record), color=colour, lw=1.0, label=words)
                course.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
                course.axhline(0, color=style.LIGHT, lw=0.7)
                date_axes([course], seen.record.dates[0], seen.record.dates[-1])
            course.set_ylabel("unexplained [m³/s]")
            box = errors.get_position()  # room for the dates of the panel above
            errors.set_position((box.x0, box.y0, box.width, 0.82 * box.height))
            _draw_gap(errors, self.gap)
        return figure


def _daily(values: Floats, record: Record) -> list[float]:
    """Mean of each day's samples that count; NaN where there are none."""
    counted = np.where(record.used, values, np.nan)
    return [float(np.nanmean(row)) if np.isfinite(row).any() else float("nan") for row in counted]


def _draw_gap(axes: "Axes", gap: Gap | None) -> None:
    """Two bars for each horizon."""
    from rivid.plots import style

    if gap is None:
        style.say(axes, "no days kept apart to judge by")
        return
    at = np.arange(len(gap.horizon_h))
    axes.bar(at - 0.2, gap.rmse_baseline, 0.38, color=style.ACCENT)
    axes.bar(at + 0.2, gap.rmse_augmented, 0.38, color=style.WATER)
    axes.set_xticks(at, [f"{hours:g} h ahead" for hours in gap.horizon_h])
    axes.set_ylabel(f"error [{gap.unit}]")


def diagnose(
    logs: Path | str | SimulatedSeason,
    config: GivenConfig = None,
    *,
    first: GivenDate = None,
    last: GivenDate = None,
    model: Path | str | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> DiagnosisResult:
    """Find what a simulation of the reach lacks, name it, add it, and show the gap.

    Parameters
    ----------
    logs : Path, str or SimulatedSeason
        DATA_DIR, one file of many days, or a season of :func:`rivid.simulate`.
    config : Config, path of a TOML file, or mapping, optional
        The reach; by default Table I, or what a user of the simulated reach would configure.
    first, last : datetime.date or str, optional
        Only days from and until these.
    model : Path or str, optional
        Begin with the effects of this augmented model (model.toml).
    report : callable
        Told what is being done, a line each.

    Returns
    -------
    DiagnosisResult

    Raises
    ------
    NoDataError
        Where no day can be used.
    ConfigError
        Where the configuration, the model or the geometry cannot be used.

    Notes
    -----
    Steps as in docs/diagnose.md. Takes half a minute for two months, minutes for a year.
    """
    from rivid.diagnosis import workflow
    from rivid.diagnosis.choice import gauge_floor_of, library_of, responses_of
    from rivid.diagnosis.data import read_record
    from rivid.diagnosis.model.augmented import read_effects

    begin, end = as_date(first), as_date(last)
    failed: tuple[tuple[dt.date | None, str], ...] = ()
    if isinstance(logs, SimulatedSeason):
        said = logs.config if config is None else as_config(config)
        record = _record_of(logs, said, begin, end)
    else:
        said = as_config(config)
        read = read_record(Path(logs), said, first=begin, last=end, today=dt.datetime.now(dt.UTC))
        record, failed = read.record, read.failed
    start = read_effects(Path(model), said) if model is not None else ()
    answer, evidence = workflow.diagnose(
        record, responses_of(said, record), library_of(said), gauge_floor=gauge_floor_of(said, record),
        start=start, most=said.diagnose.most_effects, report=report,
    )  # fmt: skip
    if failed:
        day, why = failed[0]
        which = f"{len(failed)} days or files could not be used; the first, {day or 'a file'}: {why}"
        answer = replace(answer, notes=(*answer.notes, which))
    return DiagnosisResult(answer, evidence, said, start)


def _record_of(
    season: SimulatedSeason, config: Config, first: dt.date | None, last: dt.date | None
) -> Record:
    """The logs of a season; nothing of its truth."""
    rows = [
        i
        for i, date in enumerate(season.dates)
        if (first is None or date >= first) and (last is None or date <= last)
    ]
    if not rows:
        raise NoDataError(f"no simulated day from {first} to {last}: expected days of {season.dates[0]} on")
    reach = config.reach
    proposal = propose_delays(
        reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth,
        sample_time=season.sample_time,
    )  # fmt: skip
    return as_record(
        [season.dates[i] for i in rows], season.seconds, season.inflow[rows], season.outflow[rows],
        season.level[rows], sample_time=season.sample_time, delay=proposal.d_max // 2,
    )  # fmt: skip
