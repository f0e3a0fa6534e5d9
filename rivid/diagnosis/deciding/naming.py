"""Which proposal is named, which are tied with it, and when none is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rivid.diagnosis.fit import Evaluation, Linear
from rivid.diagnosis.search.proposal import Proposal
from rivid.effects import Effect
from rivid.types import Floats

LEVEL = 0.01
"""Family-wise level of the first round; it halves from round to round."""
LEAST_T = 2.0
SURE, SURE_IF_MATERIAL = (1e-6, 12.0), (1e-4, 6.0)
"""p, and gain on the selecting days [nats], from which half that t is enough: few blocks scatter. The
second pair is for what takes enough from the error."""
MUCH = 0.25
"""Share of the error which, taken away at every horizon, lets a quarter of that t be enough."""
DOUBTLESS, SMALL_GAINS, SMALLEST = 1e-5, (20.0, 8.0), 0.02
"""p, gains on the fitting and the selecting days [nats] and share of the error of a name that is not
material: what no response takes upon itself can be small and sure."""
WEAK = 0.002, 10.0, 3.0, 1.5, 0.03
"""p, gains on the fitting and the selecting days [nats], t and mean share of the error of a flow that is weak
but clear: the error falls at every horizon."""
FEW_BLOCKS = 3
"""With fewer blocks of selecting days on which it acts, t says little, and the gain alone decides."""
MATERIAL = (0.06, 0.08, 0.20)
"""Share of the error on the selecting days that a name takes away at 1, 4 or 24 h, one of them."""
A_DAY = 2.5
"""Least gain a day [nats] of an effect that the response can absorb: what a plain response leaves of an
uneven reach gains up to 1.3."""
LEAST_EVENTS = 20.0
"""What events must gain beyond their price, on the fitting and on the selecting days [nats]."""
LEAST_OFFSET = 2.0
"""Samples that a clock must be off where it always was."""
LEAST_STEP = 50.0
"""What a jump of the gauge must gain, once [nats]."""
SAME = 0.95
"""Cosine of two whitened columns from which they are one to the data."""
APART = 6.0
"""What a name must gain beyond another one, on all open days, not to be tied with it [nats]."""
SPEAKS = 0.15
"""Share of the error, over all horizons, from which what a flow takes away is no chance of a few blocks."""
CLOSE = 0.15
"""Gains this near to the best one's are weighed by likelihood on the fitting days."""


@dataclass(frozen=True, eq=False)
class Choice:
    """What was named.

    Attributes
    ----------
    proposal : Proposal
    tied : tuple of str
        Other names that these data cannot tell from it.
    runner_up : Proposal or None
        The next best of another name.
    margin : float or None
        Share of the gain on the selecting days by which it is ahead.
    """

    proposal: Proposal
    tied: tuple[str, ...]
    runner_up: Proposal | None
    margin: float | None


def stands(proposal: Proposal, model: Linear, round_number: int) -> bool:
    """Whether a proposal may be named: unlikely by chance, confirmed on the selecting days, and material."""
    if proposal.p_value > LEVEL / 2**round_number or proposal.gain_select <= 0 or proposal.gain_fit <= 0:
        return False
    days = model.split.fit.sum(), model.split.select.sum()
    gains = proposal.gain_fit / days[0], proposal.gain_select / days[1]
    if proposal.events is not None:  # rare by nature, and each has paid its price
        return min(proposal.gain_fit, proposal.gain_select) > LEAST_EVENTS and is_material(proposal)
    if _is_weak_but_clear(proposal, round_number):
        return True
    limit, least = SURE_IF_MATERIAL if is_material(proposal) else SURE
    steady = 0.5 if proposal.improvement.min() >= MUCH else 1.0
    sure = proposal.p_value <= limit and proposal.gain_select > least and proposal.t >= steady
    sure = sure and not proposal.effect.absorbed_by_response
    if not sure and proposal.t < LEAST_T and (proposal.blocks >= FEW_BLOCKS or min(gains) < A_DAY):
        return False
    if proposal.effect.time_shift and proposal.window[0] is None:
        # a clock that was always off is a longer travel time: only a large offset is no geometry
        if _shift(proposal) < LEAST_OFFSET * model.record.sample_time:
            return False
    if proposal.effect.found_as == "jump":
        return proposal.gain_fit > LEAST_STEP
    if proposal.level_noise:
        return bool(min(gains) > A_DAY)
    if is_material(proposal):
        return proposal.gain_select > 6.0
    if proposal.effect.absorbed_by_response:
        return bool(min(gains) > A_DAY)
    return _is_small_but_sure(proposal)


def _shift(proposal: Proposal) -> float:
    """Size of the constant time shift of a proposal [s]; infinite where it has none."""
    key = proposal.effect.time_shift
    return abs(float(getattr(proposal.effect, key))) if key else np.inf


def _is_weak_but_clear(proposal: Proposal, round_number: int) -> bool:
    """Whether a flow of small likelihood is unlikely by chance, and seen in every part of the season.

    What such a name may be mistaken for is told by its ties.
    """
    if proposal.effect.absorbed_by_response or proposal.effect.family == "level":
        return False
    limit, fit, select, t, share = WEAK
    return bool(
        proposal.p_value <= limit / 2**round_number
        and proposal.gain_fit > fit
        and proposal.gain_select > select
        and proposal.t >= t
        and proposal.improvement.min() > 0.0
        and proposal.improvement.mean() >= share
    )


def _is_small_but_sure(proposal: Proposal) -> bool:
    """Whether an effect that takes little from the error is beyond doubt all the same."""
    return bool(
        proposal.p_value <= DOUBTLESS
        and proposal.gain_fit > SMALL_GAINS[0]
        and proposal.gain_select > SMALL_GAINS[1]
        and proposal.t >= LEAST_T
        and proposal.improvement.max() >= SMALLEST
    )


def is_material(proposal: Proposal) -> bool:
    """Whether it takes enough from the error on the selecting days, at one horizon or more."""
    return bool((proposal.improvement >= MATERIAL[: len(proposal.improvement)]).any())


def choose(
    proposals: list[Proposal], model: Linear, before: Evaluation, round_number: int, taken: Sequence[Effect]
) -> Choice | None:
    """The proposal to name, if any.

    Parameters
    ----------
    proposals : list of Proposal
    model : Linear
    before : Evaluation
        The model as it is.
    round_number : int
        From 0; the error budget halves.
    taken : sequence of Effect
        Effects that are in; a second of the same name is refused unless it is repeatable.
    """
    names = {effect.name for effect in taken}
    best: dict[str, Proposal] = {}
    able: dict[str, Proposal] = {}
    for p in proposals:
        if p.name in names and not p.effect.repeatable:
            continue
        if p.name not in best or p.gain_select > best[p.name].gain_select:
            best[p.name] = p
    if any(effect.delays_wave for effect in taken):
        apart = LEAST_OFFSET * model.record.sample_time / 2.0  # less is what the first one leaves of its form
        proposals = [
            p for p in proposals
            if not p.effect.delays_wave or p.window[0] is not None and _shift(p) >= apart
        ]  # fmt: skip
    proposals = [p for p in proposals if names.isdisjoint(p.effect.twins)]
    for p in proposals:  # of windows of the same name the one that takes most from the error
        if p.name in names and not p.effect.repeatable or not stands(p, model, round_number):
            continue
        if p.name not in able or _ahead(p, able[p.name]):
            able[p.name] = best[p.name] = p
    if not able:
        return None
    able = _by_error(able)
    top = max(p.gain_select for p in able.values())
    near = [p for p in able.values() if p.gain_select >= (1.0 - CLOSE) * top]
    named = max(near, key=lambda p: float(p.gain_fit + p.gain_select))
    others = sorted((p for p in best.values() if p.name != named.name), key=lambda p: -float(p.gain_select))
    runner = others[0] if others else None
    margin = None if runner is None else 1.0 - max(runner.gain_select, 0.0) / named.gain_select
    return Choice(named, tied_with(named, others, model, before), runner, margin)


def _by_error(able: dict[str, Proposal]) -> dict[str, Proposal]:
    """Without those that take less from the error than another, where the error speaks.

    A flow where there is none turns the knobs of a poor response: likelier, but no nearer to the level.
    """
    flows = {
        name: float(p.improvement.mean())
        for name, p in able.items()
        if p.events is None and not p.level_noise and not p.effect.absorbed_by_response
    }
    best = max(flows.values(), default=0.0)
    if best < SPEAKS:
        return able
    return {name: p for name, p in able.items() if flows.get(name, best) >= (1.0 - CLOSE) * best}


def _ahead(one: Proposal, other: Proposal) -> bool:
    """Whether a proposal is better than another of its name."""
    if one.window == other.window:
        return one.gain_select > other.gain_select
    # a slow noise that stands for a constant inflow makes a part of the season likelier than the whole
    return float(one.improvement.mean()) > float(other.improvement.mean())


def tied_with(named: Proposal, others: list[Proposal], model: Linear, before: Evaluation) -> tuple[str, ...]:
    """Names that the data cannot tell from it: the same column, as good where selected, or as likely."""
    found = []
    mine = _column(named, model, before)
    select = model.split.select
    for other in others:
        if other.gain_select <= 0 or other.level_noise != named.level_noise:
            continue
        theirs = _column(other, model, before)
        same = mine is not None and theirs is not None and abs(_cosine(mine, theirs)) > SAME
        lead = (named.evaluation.likelihood - other.evaluation.likelihood)[select]
        blocks = np.unique(model.split.block[select], return_inverse=True)[1]
        sums = np.bincount(blocks, lead)
        spread = sums.std(ddof=1) / np.sqrt(len(sums)) if len(sums) > 1 else np.inf
        as_good = (
            other.gain_select > 0.7 * named.gain_select
            and sums.mean() < 2.0 * spread
            and other.improvement.mean() >= (1.0 - CLOSE) * named.improvement.mean()
        )
        gains = other.gain_fit, named.gain_fit + named.gain_select - other.gain_fit - other.gain_select
        near = other.events is None and named.events is None and gains[0] > 0.0 and gains[1] < APART
        if same or as_good or near:
            found.append(other.name)
    return tuple(dict.fromkeys(found))


def _column(proposal: Proposal, model: Linear, before: Evaluation) -> Floats | None:
    """What a proposal does, whitened, without what the response's parameters can do as well."""
    if not len(proposal.columns):
        return None
    size = proposal.evaluation.coefficients if proposal.events is None else np.ones(1)
    column = np.tensordot(size, proposal.columns, 1) if len(size) == len(proposal.columns) else None
    if column is None:
        return None
    rows = model.split.fit | model.split.select
    like = model.used(model.residual)[rows]
    z = before.noise.whiten(column[rows][None], like=like)[0].ravel()
    X = before.noise.whiten(model.columns[:, rows], like=like).reshape(len(model.columns), -1)
    X = X * model.prior_sd[:, None]
    G = X @ X.T + np.eye(len(X))
    return np.asarray(z - X.T @ np.linalg.solve(G, X @ z))


def _cosine(a: Floats, b: Floats) -> float:
    return float(a @ b) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
