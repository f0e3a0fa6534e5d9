"""The workflow: calibrate, look for what is missing, name it, add it, look again, and show the gap.

Steps as in docs/diagnose.md. What fits, what selects and what confirms are days apart; the sealed days are
looked at once, at the end.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rivid.diagnose.blocks import Split, split
from rivid.diagnose.data import Floats, Record
from rivid.diagnose.evidence import Evidence
from rivid.diagnose.fit import Model, calibrate
from rivid.diagnose.gap import HOURS
from rivid.diagnose.happenings import as_effect, happenings, lock, rain, search
from rivid.diagnose.kernel import step_response
from rivid.diagnose.linear import Evaluation, Linear, evaluate
from rivid.diagnose.naming import Choice, choose
from rivid.diagnose.propose import Proposal, proposals
from rivid.diagnose.response import Response
from rivid.diagnose.result import Diagnosis
from rivid.diagnose.telling import tell, too_few
from rivid.diagnose.trials import Trial, pool_trials
from rivid.effects import Effect

MOST_EFFECTS = 4
DAYS_A_KNOT, MOST_KNOTS = 7, 20
"""Of a size that varies with the date."""
RECODINGS = 2
"""Times that events are looked for again once they are in."""
TRIM = {"pool": 0.0, "river": 0.4}
"""Share of days left out of the first calibration: nothing else holds a river's gain near one while a
release is missing; the equations of a pool cannot bend as far."""
FEWEST_DAYS = 15
"""One cycle of blocks."""
Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Round:
    """One turn: what stood to choose from, and what was chosen.

    Attributes
    ----------
    before : Evaluation
    proposals : tuple of Proposal
    choice : Choice or None
    after : Evaluation or None
        With the chosen effect in the simulator.
    """

    before: Evaluation
    proposals: tuple[Proposal, ...]
    choice: Choice | None
    after: Evaluation | None


@dataclass(frozen=True, eq=False)
class Study:
    """All that a diagnosis came by, for the telling.

    Attributes
    ----------
    record : Record
    split : Split
    first, last : Model
        Calibrated without and with the named effects.
    first_linear, last_linear : Linear
    first_evaluation, last_evaluation : Evaluation
    rounds : tuple of Round
    kernels : dict of str to ndarray
    notes : tuple of str
    """

    record: Record
    split: Split
    first: Model
    last: Model
    first_linear: Linear
    last_linear: Linear
    first_evaluation: Evaluation
    last_evaluation: Evaluation
    rounds: tuple[Round, ...]
    kernels: dict[str, Floats]
    notes: tuple[str, ...] = field(default=())


def diagnose(
    record: Record,
    response: Response,
    classes: dict[str, type[Effect]],
    *,
    gauge_floor: float = 0.0,
    start: Sequence[Effect] = (),
    floor: Sequence[float] | None = None,
    most: int = MOST_EFFECTS,
    report: Report = lambda _: None,
) -> tuple[Diagnosis, Evidence | None]:
    """Find what a simulation of the reach lacks.

    Parameters
    ----------
    record : Record
    response : Response
        Nominal, as the configuration knows the reach.
    classes : dict
        Effects that may be named, by name; see :func:`rivid.effects.effect_classes`.
    gauge_floor : float
        Lower limit of the gauge noise: the reading's step / sqrt(12) [m or m3/s].
    start : sequence of Effect
        Effects that are in the model from the start.
    floor : sequence of float, optional
        RMSE at 1, 4 and 24 h of the model that knows the truth, where one is known.
    most : int
        Effects at most.
    report : callable
        Told what is being done, a line each.

    Returns
    -------
    Diagnosis, Evidence or None
        None where there are too few days to look at anything.
    """
    if record.days < FEWEST_DAYS or not split(record.dates).complete:
        return too_few(record, FEWEST_DAYS), None
    study = look(record, response, classes, gauge_floor=gauge_floor, start=start, most=most, report=report)
    return tell(study, classes, floor)


def look(
    record: Record,
    response: Response,
    classes: dict[str, type[Effect]],
    *,
    gauge_floor: float = 0.0,
    start: Sequence[Effect] = (),
    most: int = MOST_EFFECTS,
    report: Report = lambda _: None,
) -> Study:
    """All steps but the telling; see :func:`diagnose`."""
    dealt = split(record.dates)
    fit = np.flatnonzero(dealt.fit)
    report("calibrating the response")
    model = Model(
        response, None, record.usual_output, record.usual_flow, gauge_floor, tuple(start), ((),) * len(start)
    )
    trim = TRIM[record.kind]
    if len(fit) >= 12:
        model = calibrate(model, record.take(fit[::3]), trim=trim, report=report)
    model = calibrate(model, record.take(fit), trim=trim, report=report)
    first, first_linear = model, model.linear(record, dealt)
    evaluation = first_evaluation = evaluate(first_linear)
    linear = first_linear
    kernels = kernels_of(model.reach, record)
    trials = trials_of(classes, record)
    rounds: list[Round] = []
    while True:
        report(f"round {len(rounds) + 1}: {len(trials)} trials, events, noises")
        current = model

        def baseline(more: Sequence[Effect], at: Model = current) -> Floats:
            return at.baseline(record, tuple(more))

        taken = tuple(effect.name for effect in model.effects)
        found = proposals(linear, evaluation, trials, baseline, kernels, seed=len(rounds))
        pulses = any(
            r.choice and r.choice.proposal.events and "down" in r.choice.proposal.name for r in rounds
        )
        found += happenings(linear, evaluation, classes, kernels, taken, pulses)
        found = [p for p in found if not _echoes(p, model.effects, record)]
        found.sort(key=lambda p: -p.gain_select)
        choice = choose(found, linear, evaluation, len(rounds), taken) if len(rounds) < most else None
        if choice is None or choice.proposal.effect is None:
            rounds.append(Round(evaluation, tuple(found), None, None))
            break
        report(f"adding {choice.proposal.name}")
        model = added(model, choice.proposal, record.take(fit), report)
        linear = model.linear(record, dealt)
        after = evaluate(linear)
        model, linear, after = varied(model, linear, after, record.take(fit), report)
        if choice.proposal.events is not None:
            model, choice, linear, after = recoded(
                model, choice, linear, after, kernels, record.take(fit), report
            )
        rounds.append(Round(evaluation, tuple(found), choice, after))
        evaluation = after
    if patched(rounds):
        report("releases at several hours of every day: no schedule, but a course that has no name here")
        rounds = [replace(rounds[0], choice=None, after=None)]
        model, linear, evaluation = first, first_linear, first_evaluation
    return Study(
        record,
        dealt,
        first,
        model,
        first_linear,
        linear,
        first_evaluation,
        evaluation,
        tuple(rounds),
        kernels,
    )


def patched(rounds: Sequence[Round]) -> bool:
    """Whether releases at several hours of every day stand in for something else.

    One schedule a dam is a release; a second one at other hours all the season long is a patch on a course
    that releases cannot follow.
    """
    chosen = [r.choice.proposal for r in rounds if r.choice is not None]
    daily = [p for p in chosen if "release" in p.name and p.window[0] is None and p.window[1] is not None]
    return len(daily) >= 2


def added(model: Model, proposal: Proposal, fit: Record, report: Report) -> Model:
    """The model with a proposal in the simulator, all parameters fitted together again."""
    assert proposal.effect is not None
    if proposal.level_noise:  # the noise carries it; the effect is its name and size
        return calibrate(
            replace(model, noise=proposal.evaluation.noise, level_noise=True), fit, steps=2, report=report
        )
    larger = replace(
        model, effects=(*model.effects, proposal.effect), free=(*model.free, proposal.free),
        noise=proposal.evaluation.noise,
    )  # fmt: skip
    return calibrate(larger, fit, steps=5, report=report)


def _echoes(proposal: Proposal, effects: Sequence[Effect], record: Record) -> bool:
    """Whether events are but what a dated release leaves of itself: all in its season."""
    if proposal.events is None:
        return False
    days = np.array([record.dates[e.day].toordinal() for e in proposal.events.events])
    inside = np.zeros(len(days), bool)
    share = 0.0
    for effect in effects:
        if effect.dates is not None and effect.family == "flow":
            first, last = (d.toordinal() for d in effect.dates)
            inside |= (days >= first) & (days <= last)
            share += float(np.mean([first <= d.toordinal() <= last for d in record.dates]))
    return bool(share < 0.7 and inside.mean() > 0.8)


def varied(
    model: Model, linear: Linear, after: Evaluation, fit: Record, report: Report
) -> tuple[Model, Linear, Evaluation]:
    """Let the size of the last effect vary with the date, if the selecting days are for it."""
    effect = model.effects[-1] if model.effects else None
    key = next((k for k in ("size", "inflow") if effect is not None and hasattr(effect, k)), None)
    if effect is None or key is None or effect.dates is None or not model.free[-1]:
        return model, linear, after
    knots = min(((effect.dates[1] - effect.dates[0]).days + 1) // DAYS_A_KNOT + 1, MOST_KNOTS)
    if knots < 2:
        return model, linear, after
    report(f"{effect.name}: a size that varies with the date")
    sizes = (float(getattr(effect, key)),) * knots
    larger = replace(model, effects=(*model.effects[:-1], effect.with_values(**{key: sizes})))
    larger = calibrate(larger, fit, steps=3, report=report)
    other = larger.linear(linear.record, linear.split)
    told = evaluate(other)
    select = linear.split.select
    gain = (told.likelihood - after.likelihood)[select].sum()
    return (larger, other, told) if gain > 2.0 * knots else (model, linear, after)


def recoded(
    model: Model,
    choice: Choice,
    linear: Linear,
    after: Evaluation,
    kernels: dict[str, Floats],
    fit: Record,
    report: Report,
) -> tuple[Model, Choice, Linear, Evaluation]:
    """Look for the events again with the refitted response and noise, until they no longer change."""
    effect = model.effects[-1]
    kind = rain(kernels) if effect.name == "rain_inflow" else lock(kernels)
    proposal = choice.proposal
    for _ in range(RECODINGS):
        report(f"coding the events of {effect.name} again")
        without = replace(model, effects=model.effects[:-1], free=model.free[:-1])
        bare = linear.record.output - without.baseline(linear.record)
        events = search(linear, replace(after, residual=bare + (after.residual - linear.residual)), kind)
        if not events.events:
            break
        effect = as_effect(type(effect), events, linear.record)
        model = calibrate(replace(model, effects=(*model.effects[:-1], effect)), fit, steps=2, report=report)
        before = after
        linear = model.linear(linear.record, linear.split)
        after = evaluate(linear)
        proposal = replace(proposal, effect=effect, events=events, columns=events.coded[None])
        if after.likelihood.sum() < before.likelihood.sum() + len(events.events):
            break
    return model, replace(choice, proposal=proposal), linear, after


def kernels_of(response: Response, record: Record) -> dict[str, Floats]:
    """Step responses: an inflow at the upper dam and in the middle, a release at the lower dam."""
    return {
        "up": step_response(response, record, 0.0),
        "middle": step_response(response, record, 0.5),
        "down": -step_response(response, record, 1.0),
    }


def trials_of(classes: dict[str, type[Effect]], record: Record) -> list[Trial]:
    """Trials that make sense for a record: a river reach has no outflow and no level."""
    found = pool_trials(classes, record.sample_time)
    if record.kind == "pool":
        return found
    from rivid.effects import CATALOGUE

    river = {"lateral_inflow", "diurnal_inflow", "unlogged_upstream_release", "inflow_gain_error",
             "clock_offset", "flow_dependent_delay", "wave_attenuation"}  # fmt: skip
    return [t for t in found if t.name in river or t.name not in CATALOGUE]


__all__ = ["HOURS", "Round", "Study", "added", "diagnose", "kernels_of", "look", "trials_of"]
