"""A proposal tried in the simulator: all parameters fitted together, and what it then gains.

What a proposal gains as columns about the fit is a first guess. A response that was fitted without a late
wave, a slow gate or a basin has taken part of it upon itself, and a constant inflow has bent its geometry;
only a fit with the effect in it shows what the effect is worth, and which of its rivals is worth more.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.deciding.naming import LEVEL
from rivid.diagnosis.fit import Evaluation, Linear, Model, evaluate
from rivid.diagnosis.model.adding import added
from rivid.diagnosis.search.proposal import Proposal, compared
from rivid.diagnosis.search.trials import Window
from rivid.errors import RividError

MOST_TRIALS = 5
"""A round tries so many proposals in the simulator."""
RIVALS, NEAR = 2, 0.7
"""So many rivals are tried beside a proposal; of other families' those that gain this share of it."""
NEAR_ABSORBED = 0.15
"""The same, between effects that a response can take upon itself."""
CONFIRMED = 0.1
"""Share of its gain a fitting day that a selecting day does not even reach where a name is contradicted."""
AGAINST = 2.0
"""t of the loss on the selecting blocks from which they speak against what the fitting days show."""
DOUBT = 0.05
"""Level at which something may be said not to hold."""
WORTH = 40.0
"""What a proposal that does not stand must gain to be tried all the same [nats]."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A proposal in the simulator.

    Attributes
    ----------
    proposal : Proposal
        With the gains, the likelihood and the noise of the fit.
    model : Model
    linear : Linear
    after : Evaluation
    """

    proposal: Proposal
    model: Model
    linear: Linear
    after: Evaluation


def in_simulator(
    model: Model,
    linear: Linear,
    before: Evaluation,
    proposal: Proposal,
    fit: Record,
    report: Callable[[str], None],
) -> Tried:
    """Fit the model with a proposal in it, and measure the proposal anew.

    A proposal whose reach cannot be simulated gains nothing.
    """
    report(f"trying {proposal.name}")
    try:
        larger, spreads = added(model, proposal, fit, report)
        about = larger.linear(linear.record, linear.split)
    except RividError:
        return Tried(replace(proposal, gain_fit=0.0, gain_select=0.0), model, linear, before)
    after = evaluate(about)
    active = np.abs(proposal.columns).max(axis=(0, 2))
    gain, select, t, better, blocks = compared(linear, before, after, np.zeros(linear.record.days), active)
    told = replace(
        after,
        coefficients=proposal.evaluation.coefficients,
        standard_errors=proposal.evaluation.standard_errors,
    )
    measured = replace(
        proposal, evaluation=told, gain_fit=gain, gain_select=select, t=t, improvement=better, blocks=blocks,
        spreads=spreads,
    )  # fmt: skip
    return Tried(measured, larger, about, after)


def can_be_tried(proposal: Proposal) -> bool:
    """Whether a proposal has a place in the simulator; events are coded again there, noises are none."""
    return proposal.events is None and not proposal.level_noise and len(proposal.columns) > 0


def rivals(proposal: Proposal, pool: list[Proposal]) -> list[Proposal]:
    """Those of other names that might turn out better once in the simulator, best first."""
    found: dict[str, Proposal] = {}
    for other in sorted(pool, key=lambda p: -p.gain_select):
        both = proposal.effect.absorbed_by_response and other.effect.absorbed_by_response
        share = NEAR_ABSORBED if both else NEAR
        near = other.gain_select >= share * proposal.gain_select
        if near and other.name != proposal.name and can_be_tried(other):
            found.setdefault(other.name, other)
    return list(found.values())[:RIVALS]


def worth_trying(pool: list[Proposal], taken: tuple[str, ...], count: int) -> list[Proposal]:
    """Of proposals none of which stands, those that are no chance and gain a lot: best first."""
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
    """The pool with a proposal as it turned out; what else its name was tried at in its window is gone."""
    return [new, *(p for p in pool if p.name != old.name or p.window != old.window)]


def contradicted(pool: list[Proposal], model: Linear) -> Proposal | None:
    """The proposal that gains most where it was fitted, and not where it was to be confirmed.

    What a poor response lacks of a wave is not asked: it comes and goes with the flow. The test of the whole
    season is blunter here than for a name, as half of the season speaks against it.
    """
    share = CONFIRMED * float(model.split.select.sum() / model.split.fit.sum())
    found = [
        p for p in pool
        if can_be_tried(p) and not p.effect.absorbed_by_response and p.p_value <= DOUBT
        and p.gain_fit > WORTH and p.gain_select < share * p.gain_fit and p.t < -AGAINST
    ]  # fmt: skip
    return max(found, key=lambda p: p.gain_fit, default=None)
