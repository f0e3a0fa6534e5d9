"""Diagnosis of the effects that a simulation of the reach lacks."""

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rivid.api.inputs import GivenConfig, GivenDate, Result, as_config, as_date
from rivid.api.season import SimulatedSeason
from rivid.config import Config
from rivid.diagnosis.answer import Evidence
from rivid.diagnosis.data import Known, Record, as_record, joined, lead_of
from rivid.diagnosis.result import Diagnosis, Gap, NamedEffect, Ranked, Unknown, Verdict
from rivid.effects import Effect
from rivid.errors import NoDataError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rivid.plots.library import Panel


@dataclass(frozen=True, repr=False, eq=False)
class DiagnosisResult(Result):
    """The result of :func:`diagnose`.

    Attributes
    ----------
    answer : Diagnosis
        As in diagnosis.json.
    evidence : Evidence or None
        The arrays behind it; None if there are too few days.
    config : Config
        The reach and the settings.
    start : tuple of Effect
        Effects that were in the model from the start.
    """

    answer: Diagnosis
    evidence: Evidence | None
    config: Config
    start: tuple[Effect, ...] = ()

    def _facts(self) -> str:
        named = "".join(f", {effect.name}" for effect in self.effects)
        return f"{self.config.reach.name}: {self.verdict}{named}"

    def __str__(self) -> str:
        from rivid.report.diagnosis import summary

        return summary(self.answer)

    @property
    def verdict(self) -> Verdict:
        """One of :data:`rivid.diagnosis.result.VERDICTS`."""
        return self.answer.verdict

    @property
    def reason(self) -> str:
        """Reason of the verdict, with numbers."""
        return self.answer.reason

    @property
    def effects(self) -> tuple[NamedEffect, ...]:
        """The effects named and added to the model."""
        return self.answer.effects

    @property
    def ranking(self) -> tuple[Ranked, ...]:
        """All explanations with their probabilities, the most probable first."""
        return self.answer.ranking

    @property
    def unknown(self) -> Unknown | None:
        """A missing flow that no effect of the catalogue explains."""
        return self.answer.unknown

    @property
    def gap(self) -> Gap | None:
        """Error of the simulation on validation days, before and after."""
        return self.answer.gap

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the data and the model."""
        return self.answer.notes

    def write(self, out: Path | str, *, pictures: bool = True) -> Path:
        """Write the files of `rivid diagnose`: page, figures, JSON, unexplained inflow, augmented model.

        Parameters
        ----------
        out : Path or str
            A directory; it is created if it does not exist.
        pictures : bool
            Draw the figures.

        Returns
        -------
        Path
            The page.

        Raises
        ------
        RividError
            If a file cannot be written.
        """
        from rivid.diagnosis.calibrated import write_model
        from rivid.diagnosis.choice import library_of
        from rivid.report.diagnosis import write_diagnosis

        page = write_diagnosis(
            Path(out), self.answer, self.evidence, draw=pictures, reach=self.config.reach.name,
            classes=library_of(self.config),
        )  # fmt: skip
        if self.evidence is not None:
            write_model(
                Path(out) / "model.toml", self.answer, self.evidence.record, self.config, self.start,
                self.evidence.model,
            )  # fmt: skip
        return page

    _between = 0.57  # room for the dates of the upper panel

    def _title(self) -> str:
        return f"{self.config.reach.name}: what the simulation lacks"

    def _note(self) -> str:
        from rivid.report.diagnosis import headline

        return headline(self.answer)

    def _panels(self) -> "list[Panel]":
        from rivid.plots.library import horizon_errors

        gap = self.gap
        errors = (gap.horizon_h, gap.rmse_baseline, gap.rmse_augmented, gap.unit) if gap else ((), (), (), "")
        return [(1.7, self._draw_unexplained), (1.07, lambda axes: horizon_errors(axes, *errors))]

    def _draw_unexplained(self, axes: "Axes") -> None:
        """Draw the daily mean of the unexplained inflow, before and after."""
        from rivid.plots import style
        from rivid.plots.diagnosis import daily_means
        from rivid.plots.library import daily

        label = "unexplained [m³/s]"
        if self.evidence is None:
            style.message(axes, self.reason)
            axes.set_ylabel(label)
            return
        evidence, used = self.evidence, self.evidence.record.used
        curves = [
            (daily_means(evidence.inflow_before, used), style.ACCENT, "before"),
            (daily_means(evidence.inflow_after, used), style.WATER, "after"),
        ]
        daily(axes, evidence.record.dates, curves if self.effects else curves[:1], label, marks=False)
        axes.axhline(0, color=style.LIGHT, lw=0.7)


def diagnose(
    logs: Path | str | SimulatedSeason,
    config: GivenConfig = None,
    *,
    first: GivenDate = None,
    last: GivenDate = None,
    model: Path | str | None = None,
    report: Callable[[float, str], None] = lambda done, what: None,
) -> DiagnosisResult:
    """Find the effects that a simulation of the reach lacks, add them to the model, and validate it.

    Parameters
    ----------
    logs : Path, str or SimulatedSeason
        DATA_DIR, one file of many days, or a season of :func:`rivid.simulate`.
    config : Config, path of a TOML file, or mapping, optional
        The reach; default: Table I, or the nominal geometry of the simulated reach.
    first, last : datetime.date or str, optional
        First and last day used.
    model : Path or str, optional
        Start with the effects of this augmented model (model.toml).
    report : callable
        Called with the share of the work that is done, from 0 to 1, and the step that begins.

    Raises
    ------
    NoDataError
        If no day can be used.
    ConfigError
        If the configuration, the model or the geometry is invalid.

    Notes
    -----
    The steps are described in docs/diagnose.md. Two months take half a minute, a year some minutes.
    """
    from rivid.diagnosis import workflow
    from rivid.diagnosis.calibrated import read_effects
    from rivid.diagnosis.choice import gauge_floor_of, library_of, responses_of
    from rivid.diagnosis.data import read_record

    begin, end = as_date(first), as_date(last)
    known = Known()
    if isinstance(logs, SimulatedSeason):
        settings = logs.config if config is None else as_config(config)
        record = _record_of(logs, settings, begin, end)
    else:
        settings = as_config(config)
        today = dt.datetime.now(dt.UTC)
        record, known = read_record(Path(logs), settings, first=begin, last=end, today=today)
    start = read_effects(Path(model), settings) if model is not None else ()
    answer, evidence = workflow.diagnose(
        record, responses_of(settings, record), library_of(settings),
        gauge_floor=gauge_floor_of(settings, record), start=start,
        dated=known.dated, most=settings.diagnose.most_effects, report=report,
    )  # fmt: skip
    answer = replace(answer, notes=(*known.notes, *answer.notes))
    return DiagnosisResult(answer, evidence, settings, start)


def _record_of(
    season: SimulatedSeason, config: Config, first: dt.date | None, last: dt.date | None
) -> Record:
    """Return the logs of a season, without its truth."""
    begin, end = first or dt.date.min, last or dt.date.max
    rows = [i for i, date in enumerate(season.dates) if begin <= date <= end]
    if not rows:
        raise NoDataError(f"no simulated day from {first} to {last}: expected days of {season.dates[0]} on")
    inflow, T_s = season.inflow[rows], season.sample_time
    every = joined(config, T_s)
    return as_record(
        [season.dates[i] for i in rows], season.seconds, inflow, season.outflow[rows], season.level[rows],
        sample_time=T_s, lead=lead_of(config, inflow, every * T_s), every=every,
    )  # fmt: skip
