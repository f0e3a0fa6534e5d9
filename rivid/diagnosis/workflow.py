"""The workflow: calibrate, search what is missing, name it, add it, repeat, and report the gap.

Steps as in docs/diagnose.md. Days that fit, that select and that confirm are separate; the sealed days are
used once, at the end.
"""

from collections.abc import Callable, Sequence

import numpy as np

from rivid.diagnosis.adding import (
    MOST_TRIALS,
    added,
    can_be_tried,
    contradicted,
    dropped,
    echoes,
    exchanged,
    in_simulator,
    patched,
    recoded,
    rivals,
    varied,
    worth_trying,
)
from rivid.diagnosis.answer import Evidence, conclude
from rivid.diagnosis.blocks import Split, split
from rivid.diagnosis.candidates import Proposal, proposals, trials_of
from rivid.diagnosis.choice import Calibrated, as_candidates, calibrated
from rivid.diagnosis.data import Record
from rivid.diagnosis.events import event_proposals
from rivid.diagnosis.fit import Evaluation, Linear, Model, evaluate
from rivid.diagnosis.response.base import Response, kernels_of
from rivid.diagnosis.result import Diagnosis
from rivid.diagnosis.selection import Round, Study, choose, guarded, tied_with
from rivid.effects import LEVEL_NOISES, Effect, Trial
from rivid.types import Floats

MOST_EFFECTS = 4
TRIM = {"pool": 0.0, "river": 0.4}
"""Share of days left out of the first calibration: while a release is missing nothing else holds a river's
gain near one; the equations of a pool cannot bend as far."""
FEWEST_DAYS = 15
"""One cycle of blocks."""
Report = Callable[[str], None]
Responses = Response | Sequence[Response]
Fitted = tuple[Model, Linear, Evaluation]


def diagnose(
    record: Record,
    response: Responses,
    classes: dict[str, type[Effect]],
    *,
    gauge_floor: float = 0.0,
    start: Sequence[Effect] = (),
    floor: Sequence[float] | None = None,
    most: int = MOST_EFFECTS,
    report: Report = lambda _: None,
) -> tuple[Diagnosis, Evidence | None]:
    """Find the effects that a simulation of the reach lacks.

    Parameters
    ----------
    record : Record
    response : Response, or a sequence of them
        Nominal; of several, in order of preference, the first that describes the selecting days well enough.
    classes : dict
        Effects that may be named, by name; see :func:`rivid.effects.effect_classes`.
    gauge_floor : float
        Lower limit of the gauge noise: the reading's step / sqrt(12) [m or m3/s].
    start : sequence of Effect
        Effects that are in the model from the start.
    floor : sequence of float, optional
        RMSE at 1, 4 and 24 h of the true model, where it is known.
    most : int
        Most effects.
    report : callable
        Called with a line for each step.

    Returns
    -------
    Diagnosis, Evidence or None
        None where there are too few days.
    """
    lacking = None
    if record.days < FEWEST_DAYS or not split(record.dates).complete:
        lacking = (
            f"{record.days} days can be used: expected {FEWEST_DAYS} or more, to have days that fit, that "
            "select and that confirm."
        )
    elif not np.ptp(record.inflow, axis=1).any() and not np.ptp(record.outflow, axis=1).any():
        lacking = (
            f"the flows of {record.days} days never move: expected commands that change, for a response to "
            "be seen; check the columns"
        )
    elif not classes:
        lacking = (
            "no effect may be named: expected one or more in the library; [diagnose] exclude leaves none"
        )
    if lacking is not None:
        return Diagnosis("insufficient_data", lacking, "none"), None
    study = find_effects(
        record, response, classes, gauge_floor=gauge_floor, start=start, most=most, report=report
    )
    return conclude(study, classes, floor)


def find_effects(
    record: Record,
    response: Responses,
    classes: dict[str, type[Effect]],
    *,
    gauge_floor: float = 0.0,
    start: Sequence[Effect] = (),
    most: int = MOST_EFFECTS,
    report: Report = lambda _: None,
) -> Study:
    """All steps but the report; see :func:`diagnose`."""
    dealt = split(record.dates)
    noises = tuple(e for e in start if e.found_as in LEVEL_NOISES)
    start = tuple(e for e in start if e.found_as not in LEVEL_NOISES)
    windy = any(e.found_as == "level noise" for e in noises)
    nominal = [
        Model(
            one, None, record.usual_output, record.usual_flow, gauge_floor, start, ((),) * len(start), windy
        )
        for one in as_candidates(response)
    ]
    search, notes = _begun(record, dealt, classes, nominal, noises, report)
    chosen = search.start
    while search.round(most):
        pass
    rounds, last = search.rounds, (search.model, search.linear, search.evaluation)
    if patched(rounds):
        notes.append("releases at several hours of every day: no schedule, but a course without a name here")
        rounds = []
        last = (chosen.model, chosen.linear, chosen.evaluation)
    return Study(
        record, dealt, chosen.model, last[0], last[1], chosen.evaluation, last[2],
        tuple(rounds), search.kernels, tuple(notes), noises, search.contradicted,
    )  # fmt: skip


def _begun(
    record: Record,
    dealt: Split,
    classes: dict[str, type[Effect]],
    nominal: Sequence[Model],
    noises: tuple[Effect, ...],
    report: Report,
) -> tuple["_Search", list[str]]:
    """The search about the first acceptable response.

    A less likely response is rejected only if the best effect does not make up for its deficit: a response
    with many coefficients fits a late wave or a slow gate as well, and then nothing seems missing.
    """
    done, refused = calibrated(record, dealt, nominal, TRIM[record.kind], report)
    notes = [f"a response was passed over: {why}" for why in refused]
    for one in done:
        search = _Search(record, dealt, classes, one, noises, report)
        if one.acceptable() or one.acceptable(search.best_gain()):
            break
        notes.append(
            f"{one.model.reach.name} describes the selecting days worse than {done[-1].model.reach.name}, by "
            f"{one.deficit / dealt.select.sum():.0f} nats a day, and no effect makes it as good: check the "
            "reach's geometry"
        )
    return search, notes


class _Search:
    """The growing model and its rounds."""

    def __init__(
        self,
        record: Record,
        dealt: Split,
        classes: dict[str, type[Effect]],
        start: Calibrated,
        noises: tuple[Effect, ...],
        report: Report,
    ) -> None:
        self.record, self.dealt, self.classes, self.report = record, dealt, classes, report
        self.fit = record.take(dealt.fit)
        self.start = start
        self.ahead: list[Proposal] | None = None
        """Proposals found before the first round."""
        self.model: Model = start.model
        self.linear: Linear = start.linear
        self.evaluation: Evaluation = start.evaluation
        self.noises = noises
        self.contradicted: Proposal | None = None
        self.kernels = kernels_of(start.model.reach, record)
        self.trials: list[Trial] = trials_of(classes, record)
        self.rounds: list[Round] = []
        self.count = 0
        """Rounds that named an effect, dropped later or not: they spend the error budget."""

    def round(self, most: int) -> bool:
        """One round; whether an effect was named."""
        self.report(f"round {len(self.rounds) + 1}: {len(self.trials)} trials, events, noises")
        found = self._found() if self.ahead is None else self.ahead
        self.ahead = None
        chosen = self._chosen(found) if self.count < most else None
        if chosen is None:
            return False
        self._add(*chosen)
        self.count += 1
        return True

    def best_gain(self) -> float:
        """Gain of the best proposal on the selecting days [nats]."""
        self.ahead = self._found()
        return max((p.gain_select for p in self.ahead), default=0.0)

    def _found(self) -> list[Proposal]:
        """All proposals about the model as it is, best first."""
        model = self.model

        def baseline(more: Sequence[Effect]) -> Floats:
            return model.baseline(self.record, tuple(more))

        found = proposals(
            self.linear, self.evaluation, self.trials, baseline, self.kernels, seed=len(self.rounds)
        )
        pulses = any(r.proposal.events and r.proposal.effect.repeatable for r in self.rounds)
        names = self._names()
        found += event_proposals(self.linear, self.evaluation, self.classes, self.kernels, names, pulses)
        found = [p for p in found if not echoes(p, model.effects, self.record)]
        return sorted(found, key=lambda p: -p.gain_select)

    def _taken(self) -> tuple[Effect, ...]:
        """Effects that are in the model or were named."""
        named = (r.proposal.effect for r in self.rounds)
        return (*self.noises, *self.model.effects, *named)

    def _names(self) -> tuple[str, ...]:
        return tuple(effect.name for effect in self._taken())

    def _chosen(self, found: list[Proposal]) -> tuple[Proposal, list[Proposal], Fitted | None] | None:
        """The best proposal once it and its rivals were in the simulator, if the guard agrees.

        Returns
        -------
        Proposal
        list of Proposal
            The best of other names.
        Fitted or None
            Model, linearised model and evaluation with it, where it was tried in the simulator.
        """
        pool, fitted = list(found), dict[Proposal, Fitted]()
        while True:
            chosen = choose(pool, self.linear, self.evaluation, self.count, self._taken())
            if chosen is None:
                trials = worth_trying(pool, self._names(), self.count)
            elif can_be_tried(chosen[0]):
                trials = [chosen[0], *rivals(chosen[0], pool)]
            else:
                trials = []
            trials = [p for p in trials if p not in fitted][: MOST_TRIALS - len(fitted)]
            if chosen is not None and can_be_tried(chosen[0]) and chosen[0] not in fitted:
                if not trials:  # enough were tried; a proposal that was not tried is not named
                    pool = [p for p in pool if p.name != chosen[0].name]
                    continue
            if not trials and chosen is None:
                if not self.rounds:
                    self.contradicted = contradicted(pool, self.linear)
                return None
            for p in trials:
                one, model, linear, after = in_simulator(
                    self.model, self.linear, self.evaluation, p, self.fit, self.report
                )
                pool, fitted[one] = exchanged(pool, p, one), (model, linear, after)
            if trials or chosen is None:
                continue
            if self._guarded(chosen[0]):
                return *chosen, fitted.get(chosen[0])
            self.report(f"{chosen[0].name} does not show where the inflow alone moves the level")
            pool = [p for p in pool if p.name != chosen[0].name]

    def _guarded(self, proposal: Proposal) -> bool:
        model = self.model
        return guarded(
            proposal, self.linear, self.evaluation, lambda record, more: model.baseline(record, tuple(more))
        )

    def _add(self, proposal: Proposal, others: list[Proposal], fitted: Fitted | None) -> None:
        """The chosen effect in the simulator, all refitted, and unnecessary effects taken out."""
        report, fit, before = self.report, self.fit, self.evaluation
        report(f"adding {proposal.name}")
        tied = tied_with(proposal, others, self.linear, before)
        runner_up = others[0].name if others else None
        margin = 1.0 - max(others[0].gain_select, 0.0) / proposal.gain_select if others else None
        if fitted is not None:
            model, linear, after = fitted
        else:
            model, _ = added(self.model, proposal, fit, report)
            linear = model.linear(self.record, self.dealt)
            after = evaluate(linear)
        model, linear, after = varied(model, linear, after, fit, report)
        if proposal.events is not None:
            model, proposal, linear, after = recoded(
                model, proposal, linear, after, self.kernels, fit, report
            )
        self.rounds.append(Round(before, proposal, tied, runner_up, margin, after))
        model, linear, after, self.rounds = dropped(model, linear, after, self.rounds, fit, report)
        self.model, self.linear, self.evaluation = model, linear, after
