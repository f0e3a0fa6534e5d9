"""A proposal in the simulator: all parameters fitted together, events coded again, effects dropped.

The gain of a proposal as columns about the fit is a first estimate. A response fitted without a late wave, a
slow gate or a basin has absorbed part of it, and a constant inflow has bent its geometry; only a fit with the
effect in it shows the gain of the effect and of its rivals.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rivid.diagnosis.candidates import Proposal, Window, compared
from rivid.diagnosis.data import Record
from rivid.diagnosis.events import as_effect, kind_of, search
from rivid.diagnosis.fit import Evaluation, Linear, Model, calibrate, evaluate, limited, residual_of
from rivid.diagnosis.noise.model import day_weights
from rivid.diagnosis.response.base import vector_of
from rivid.diagnosis.selection import LEVEL, Round
from rivid.effects import Effect
from rivid.errors import RividError
from rivid.types import Floats

MOST_STEPS = 40
"""Most values tried of a parameter in which the output changes in steps."""
DAYS_A_KNOT, MOST_KNOTS = 7, 20
"""Days between the values of a size that varies with the date, and most values."""
COARSE = 3
"""A fit from the nominal reach starts on every third fitting day."""
RECODINGS = 2
"""Most searches for the events once they are in."""
NEEDED = 4.0
"""Least gain of an effect on the selecting days once others are in [nats]."""
Report = Callable[[str], None]


def added(model: Model, proposal: Proposal, fit: Record, report: Report) -> tuple[Model, dict[str, float]]:
    """The model with a proposal in the simulator, all parameters fitted again, and standard errors.

    A response fitted without a lag, a basin or a late wave has absorbed it in part, and steps from there end
    in that optimum: for these effects the fit starts at the nominal reach. The standard errors (by name) are
    those of parameters that are not fitted with the others.
    """
    if proposal.effect.found_as == "swing":  # the noise model has no swing: the effect is named only
        return model, proposal.spreads
    if proposal.level_noise:  # the noise carries it; the effect is its name and size
        windy = replace(model, noise=proposal.evaluation.noise, level_noise=True)
        return calibrate(windy, fit, steps=2, report=report), proposal.spreads
    steps = tuple(name for name in proposal.free if name in proposal.effect.stepwise)
    free = tuple(name for name in proposal.free if name not in proposal.effect.stepwise)
    p = len(model.reach.parameters)
    shift = proposal.evaluation.shift
    values = model.values() + shift[p:] if len(shift) > p else model.values()
    absorbed = proposal.effect.absorbed_by_response
    start = [f.mean for f in model.reach.parameters] if absorbed else vector_of(model.reach) + shift[:p]
    moved = replace(model, reach=model.reach.with_parameters(start)).with_values(values)
    larger = replace(
        moved, effects=(*moved.effects, proposal.effect), free=(*model.free, free),
        noise=proposal.evaluation.noise,
    )  # fmt: skip
    if absorbed:
        few = fit.take(np.arange(fit.days)[::COARSE])
        larger = calibrate(replace(larger, noise=None), few, steps=10, report=report)
    larger = calibrate(larger, fit, steps=6 if absorbed else 5, report=report)
    spreads = dict(proposal.spreads)
    for name in steps:
        larger, spreads[name] = stepped(larger, name, fit)
        larger = calibrate(larger, fit, steps=2, report=report)
    return larger, spreads


def stepped(model: Model, name: str, fit: Record) -> tuple[Model, float]:
    """The last effect with the best value of a parameter that acts in steps, and its standard error.

    Commands are quantised, and a band between two of them acts as the larger one: the likelihood is piecewise
    constant. All values half-way between commands are tried.
    """
    assert model.noise is not None
    effect = model.effects[-1]
    moves = np.abs(np.diff(fit.outflow, axis=1))
    step = float(np.quantile(moves[moves > 1e-6], 0.02)) if (moves > 1e-6).any() else 1.0
    now = float(getattr(effect, name))
    values = (np.arange(min(int(2.5 * now / step) + 2, MOST_STEPS)) + 0.5) * step
    noise = model.noise
    weights = day_weights(noise.whiten(np.where(fit.used, residual_of(fit, model.baseline(fit)), np.nan)))

    def at(value: float) -> Model:
        return replace(model, effects=(*model.effects[:-1], effect.with_values(**{name: value})))

    costs = []
    for value in values.tolist():
        left = np.where(fit.used, residual_of(fit, at(value).baseline(fit)), np.nan)
        costs.append(0.5 * float((weights[:, None] * noise.whiten(left) ** 2).sum()))
    cost = np.array(costs)
    near = values[cost <= cost.min() + 2.0]
    half = 0.5 * (near.max() - near.min() + step)
    return at(float(0.5 * (near.max() + near.min()))), half / 1.96


def varied(
    model: Model, linear: Linear, after: Evaluation, fit: Record, report: Report
) -> tuple[Model, Linear, Evaluation]:
    """Let the size of the last effect vary with the date, if the selecting days support it."""
    effect = model.effects[-1] if model.effects else None
    if effect is None or not effect.varies_with_date or effect.dates is None or not model.free[-1]:
        return model, linear, after
    key = effect.varies_with_date
    most = min(((effect.dates[1] - effect.dates[0]).days + 1) // DAYS_A_KNOT + 1, MOST_KNOTS)
    for knots in (most, most // 2):
        if knots < 2:
            break
        report(f"{effect.name}: a size that varies with the date")
        sizes = (float(getattr(effect, key)),) * knots
        larger = replace(model, effects=(*model.effects[:-1], effect.with_values(**{key: sizes})))
        larger = calibrate(larger, fit, steps=3, report=report)
        other = larger.linear(linear.record, linear.split)
        evaluation = evaluate(other)
        gain = limited((evaluation.likelihood - after.likelihood)[linear.split.select]).sum()
        if gain > 2.0 * knots:
            return larger, other, evaluation
    return model, linear, after


def recoded(
    model: Model,
    proposal: Proposal,
    linear: Linear,
    after: Evaluation,
    kernels: dict[str, Floats],
    fit: Record,
    report: Report,
) -> tuple[Model, Proposal, Linear, Evaluation]:
    """Search the events again with the refitted response and noise, until they no longer change."""
    effect = model.effects[-1]
    kind = kind_of(type(effect), kernels)
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
    return model, proposal, linear, after


def dropped(
    model: Model, linear: Linear, after: Evaluation, rounds: Sequence[Round], fit: Record, report: Report
) -> tuple[Model, Linear, Evaluation, list[Round]]:
    """Take out effects that later ones have made unnecessary.

    An effect named while another was missing may have stood in for it. Each but the last is left out once,
    the rest refitted; it is dropped if the selecting days lose less than :data:`NEEDED` without it.
    """
    kept = list(rounds)
    first = len(model.effects) - sum(not r.proposal.level_noise for r in kept)
    place = first
    for r in list(kept)[:-1]:
        if r.proposal.level_noise:
            continue
        without = replace(
            model,
            effects=model.effects[:place] + model.effects[place + 1 :],
            free=model.free[:place] + model.free[place + 1 :],
        )
        without = calibrate(without, fit, steps=2, report=report)
        other = without.linear(linear.record, linear.split)
        evaluation = evaluate(other)
        missed = float((after.likelihood - evaluation.likelihood)[linear.split.select].sum())
        if missed < NEEDED:
            report(f"{model.effects[place].name} is no longer needed")
            model, linear, after = without, other, evaluation
            kept.remove(r)
        else:
            place += 1
    return model, linear, after, kept


def echoes(proposal: Proposal, effects: Sequence[Effect], record: Record) -> bool:
    """Whether events are remainders of a dated release: nearly all in its season."""
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


def patched(rounds: Sequence[Round]) -> bool:
    """Whether releases at several hours of every day approximate something else.

    One schedule a dam is a release; a second one at other hours in the whole season approximates a course
    that releases cannot follow.
    """
    chosen = [r.proposal for r in rounds]
    daily = [p for p in chosen if p.effect.repeatable and p.window[0] is None and p.window[1] is not None]
    return len(daily) >= 2


MOST_TRIALS = 5
"""Most proposals tried in the simulator in a round."""
RIVALS, NEAR = 2, 0.7
"""Most rivals tried with a proposal, and least share of its gain."""
NEAR_ABSORBED = 0.15
"""The same share between effects that a response can absorb."""
CONFIRMED = 0.1
"""Largest gain a selecting day, in gains a fitting day, of a contradicted proposal."""
AGAINST = 2.0
"""Least t of the loss on the selecting blocks of a contradicted proposal."""
DOUBT = 0.05
"""Largest p of a contradicted proposal."""
WORTH = 40.0
"""Least gain of a proposal that cannot be named yet to be tried in the simulator [nats]."""


def in_simulator(
    model: Model,
    linear: Linear,
    before: Evaluation,
    proposal: Proposal,
    fit: Record,
    report: Callable[[str], None],
) -> tuple[Proposal, Model, Linear, Evaluation]:
    """Fit the model with a proposal in it, and measure the proposal again; without a run its gain is 0."""
    report(f"trying {proposal.name}")
    try:
        larger, spreads = added(model, proposal, fit, report)
        about = larger.linear(linear.record, linear.split)
    except RividError:
        return replace(proposal, gain_fit=0.0, gain_select=0.0), model, linear, before
    after = evaluate(about)
    active = np.abs(proposal.columns).max(axis=(0, 2))
    gain, select, t, better, blocks = compared(linear, before, after, np.zeros(linear.record.days), active)
    with_columns = replace(after, coefficients=proposal.evaluation.coefficients)
    measured = replace(
        proposal, evaluation=with_columns, gain_fit=gain, gain_select=select, t=t, improvement=better,
        blocks=blocks, spreads=spreads,
    )  # fmt: skip
    return measured, larger, about, after


def can_be_tried(proposal: Proposal) -> bool:
    """Whether a proposal can be simulated; events are coded again there, noises are not simulated."""
    return proposal.events is None and not proposal.level_noise and len(proposal.columns) > 0


def rivals(proposal: Proposal, pool: list[Proposal]) -> list[Proposal]:
    """Proposals of other names that may turn out better in the simulator, best first."""
    found: dict[str, Proposal] = {}
    for other in sorted(pool, key=lambda p: -p.gain_select):
        both = proposal.effect.absorbed_by_response and other.effect.absorbed_by_response
        share = NEAR_ABSORBED if both else NEAR
        near = other.gain_select >= share * proposal.gain_select
        if near and other.name != proposal.name and can_be_tried(other):
            found.setdefault(other.name, other)
    return list(found.values())[:RIVALS]


def worth_trying(pool: list[Proposal], taken: tuple[str, ...], count: int) -> list[Proposal]:
    """Proposals with a small p and a large gain where none can be named: best first."""
    able = [
        p for p in pool
        if can_be_tried(p) and p.name not in taken and not p.effect.absorbed_by_response
        and p.p_value <= LEVEL / 2**count and p.gain_fit > 0 and p.gain_fit + p.gain_select > WORTH
    ]  # fmt: skip
    found: dict[tuple[str, Window], Proposal] = {}
    for p in sorted(able, key=lambda p: -(p.gain_fit + p.gain_select)):
        found.setdefault((p.name, p.window), p)
    names = list(dict.fromkeys(name for name, _ in found))[:RIVALS]
    return [p for (name, _), p in found.items() if name in names]


def exchanged(pool: list[Proposal], old: Proposal, new: Proposal) -> list[Proposal]:
    """The pool with a proposal as fitted, in place of all of its name and window."""
    return [new, *(p for p in pool if p.name != old.name or p.window != old.window)]


def contradicted(pool: list[Proposal], model: Linear) -> Proposal | None:
    """The proposal of the largest gain on the fitting days that the selecting days contradict.

    Effects that a response can absorb are left out: their remainder varies with the flow. The test of the
    whole season is weaker here than for a name, as half of the season speaks against it.
    """
    share = CONFIRMED * float(model.split.select.sum() / model.split.fit.sum())
    found = [
        p for p in pool
        if can_be_tried(p) and not p.effect.absorbed_by_response and p.p_value <= DOUBT
        and p.gain_fit > WORTH and p.gain_select < share * p.gain_fit and p.t < -AGAINST
    ]  # fmt: skip
    return max(found, key=lambda p: p.gain_fit, default=None)
