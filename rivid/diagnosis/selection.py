"""Selection: which proposal is named, which are tied with it, whether it holds, and the verdict.

The guard against operators: they hold the level by the outflow, so a level that an unknown inflow raised is
lowered by hand, and a reach that seems to lose water at high levels may only have attentive operators. An
effect that depends on the level is therefore tested again with an instrument: the same effect in a reach
with the level driven by the logged inflow alone, which no operator and no unknown inflow has changed.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.candidates import Proposal
from rivid.diagnosis.data import Record
from rivid.diagnosis.fit import Evaluation, Linear, Model, limited
from rivid.diagnosis.response.base import leaky
from rivid.diagnosis.result import Gap, Unknown, Verdict
from rivid.effects import Effect
from rivid.errors import RividError
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
"""With fewer blocks of selecting days on which it acts, the gain alone decides, not t."""
MATERIAL = (0.06, 0.08, 0.20)
"""Least reduction of the error on the selecting days at 1, 4 or 24 h, at one of them."""
A_DAY = 2.5
"""Least gain a day [nats] of an effect that the response can absorb: what a plain response leaves of an
uneven reach gains up to 1.3."""
LEAST_EVENTS = 20.0
"""Least gain of events beyond their price, on the fitting and on the selecting days [nats]."""
LEAST_OFFSET = 2.0
"""Least offset of a clock that was always off [samples]."""
LEAST_STEP = 50.0
"""Least gain of a jump of the gauge [nats]."""
SAME = 0.95
"""Cosine of two whitened columns from which they cannot be separated."""
APART = 6.0
"""Least gain of a name over another one, on all open days, not to be tied with it [nats]."""
SIGNIFICANT_SHARE = 0.15
"""Share of the error, over all horizons, from which a flow's reduction of it is not by chance."""
CLOSE = 0.15
"""Gains this near to the best one's are weighed by likelihood on the fitting days."""


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

    Names it may be mistaken for are its ties.
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
) -> tuple[Proposal, list[Proposal]] | None:
    """The proposal to name, if any, and the best proposals of other names, best first.

    Parameters
    ----------
    proposals : list of Proposal
    model : Linear
    before : Evaluation
        The model as it is.
    round_number : int
        From 0; the error budget halves.
    taken : sequence of Effect
        Effects in the model; a second of the same name is refused unless it is repeatable.
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
    return named, others


def _by_error(able: dict[str, Proposal]) -> dict[str, Proposal]:
    """Without those that reduce the error less than another, where the error is informative.

    A flow where there is none adjusts the parameters of a poor response: likelier, but no nearer to the
    level.
    """
    flows = {
        name: float(p.improvement.mean())
        for name, p in able.items()
        if p.events is None and not p.level_noise and not p.effect.absorbed_by_response
    }
    best = max(flows.values(), default=0.0)
    if best < SIGNIFICANT_SHARE:
        return able
    return {name: p for name, p in able.items() if flows.get(name, best) >= (1.0 - CLOSE) * best}


def _ahead(one: Proposal, other: Proposal) -> bool:
    """Whether a proposal is better than another of its name."""
    if one.window == other.window:
        return one.gain_select > other.gain_select
    # a slow noise that stands for a constant inflow makes a part of the season likelier than the whole
    return float(one.improvement.mean()) > float(other.improvement.mean())


def tied_with(named: Proposal, others: list[Proposal], model: Linear, before: Evaluation) -> tuple[str, ...]:
    """Names that the data cannot separate: the same column, as good on selecting days, or as likely."""
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


MEMORIES = (3600.0, 4 * 3600.0, 12 * 3600.0)
"""Of the leaky integrals of the inflow [s]."""
LEAST = 2.0
"""Of the guard's t."""
Simulated = Callable[[Record, Sequence[Effect]], Floats]


def driven_level(record: Record) -> Floats:
    """The level [m] of a pool as far as leaky integrals of the inflow explain it, shape (days, n).

    Least squares of the used level on a constant, the day's mean inflow and three leaky means of it with
    memories of 1, 4 and 12 hours; each row's means begin at its first inflow.
    """
    inflow = record.inflow - record.usual_flow
    parts = [np.ones_like(inflow), np.broadcast_to(inflow.mean(axis=1, keepdims=True), inflow.shape)]
    for memory in MEMORIES:
        parts.append(leaky(inflow, record.sample_time, memory))
    X = np.stack([part[record.used] for part in parts])
    b = np.linalg.lstsq(X.T, record.output[record.used], rcond=None)[0]
    return np.asarray(np.tensordot(b, np.stack(parts), 1))


def guard(proposal: Proposal, model: Linear, evaluation: Evaluation, simulated: Simulated) -> float:
    """t over blocks of an effect of the level, seen through the instrument.

    Parameters
    ----------
    proposal : Proposal
        Of an effect with one column.
    model : Linear
    evaluation : Evaluation
        The model without the effect.
    simulated : callable
        Output of a record with further effects, as :meth:`rivid.diagnosis.fit.Model.baseline`.

    Returns
    -------
    float
        Positive where the instrument agrees in sign. With x the effect's whitened column, z that of the
        instrument and r the whitened residual, both without what the response's parameters explain, and
        s_b = z'r of a block: t = sign(z'x) sum s_b / sqrt(sum s_b^2).
    """
    record, effect = model.record, proposal.effect
    column = proposal.evaluation.coefficients[0] * proposal.columns[0]
    rows = np.flatnonzero(model.split.fit | model.split.select)
    clean = replace(record, output=driven_level(record))
    moved = simulated(clean, (effect,)) - simulated(clean, ())
    like = model.used(evaluation.residual)[rows]
    noise = proposal.evaluation.noise  # of the model with the effect: without, the noise stands for it
    r = noise.whiten(like)
    z = noise.whiten(moved[rows][None], like=like)[0]
    X = noise.whiten(model.columns[:, rows], like=like).reshape(len(model.columns), -1)
    X = X * model.prior_sd[:, None]
    b = np.linalg.solve(X @ X.T + np.eye(len(X)), X @ np.stack([z.ravel(), r.ravel()], axis=1))
    z, r = (v - (b[:, k] @ X).reshape(v.shape) for k, v in enumerate((z, r)))
    x = noise.whiten(column[rows][None], like=like)[0]
    s = (z * r).sum(axis=1)
    blocks = np.unique(model.split.block[rows], return_inverse=True)[1]
    sums = np.bincount(blocks, s)
    spread = float(np.sqrt((sums**2).sum()))
    agree = np.sign(float((z * x).sum()))
    return float(agree * sums.sum() / max(spread, 1e-300))


def guarded(proposal: Proposal, model: Linear, evaluation: Evaluation, simulated: Simulated) -> bool:
    """Whether the guard lets a proposal pass; effects that do not depend on the level always pass.

    An effect of a user depends on the level unless its class states that it does not.
    """
    if model.record.kind != "pool" or len(proposal.columns) != 1 or not proposal.effect.depends_on_level:
        return True
    return guard(proposal, model, evaluation, simulated) > LEAST


@dataclass(frozen=True, eq=False)
class Round:
    """One round of the search: the named proposal, and the models before and after."""

    before: Evaluation
    proposal: Proposal
    tied: tuple[str, ...]  # other names that the data cannot separate from it
    runner_up: str | None  # the next best name
    margin: float | None  # share of the gain on the selecting days by which it is ahead of that
    after: Evaluation  # with the named effect in the simulator


@dataclass(frozen=True, eq=False)
class Study:
    """Everything a diagnosis found, for its report."""

    record: Record
    split: Split
    first: Model  # calibrated without and with the named effects
    last: Model
    last_linear: Linear  # linearised about `last`
    first_evaluation: Evaluation
    last_evaluation: Evaluation
    named: tuple[Round, ...]
    # Step responses by place; see :func:`rivid.diagnosis.response.base.kernels_of`.
    kernels: dict[str, Floats]
    notes: tuple[str, ...] = field(default=())
    noises: tuple[Effect, ...] = ()  # noises (wind, a seiche) known from the start
    # Where nothing was named: a proposal that fits the fitting days well, and the selecting days not.
    contradicted: Proposal | None = None

    def swings(self) -> tuple[float, ...]:
        """Periods of the seiches that are known or named [s]."""
        named = (r.proposal.effect for r in self.named)
        swings = (e for e in (*self.noises, *named) if e.found_as == "swing")
        return tuple(float(getattr(e, "period")) for e in swings)  # noqa: B009 - every seiche has a period


LARGEST_ERROR = 0.2
"""Largest standard error of the share for which the sealed days decide."""


def held_share(model: Model, linear: Linear, after: Evaluation, name: str) -> tuple[float, float] | None:
    """Size of an effect on the sealed days over its size in the model, and its standard error.

    The effect's change of the output is fitted to the sealed days' residual, together with the response's
    parameters, which are as free as the fitting days leave them. None where the model holds no such effect,
    or the sealed days do not determine its size.
    """
    places = [i for i, effect in enumerate(model.effects) if effect.name == name]
    if not places or not linear.split.sealed.any():
        return None
    sealed = linear.split.sealed
    others = tuple(e for i, e in enumerate(model.effects) if i != places[0])
    free = tuple(f for i, f in enumerate(model.free) if i != places[0])
    record = linear.record
    try:
        without = replace(model, effects=others, free=free).baseline(record)
    except RividError:  # the reach runs dry
        return None
    change = model.baseline(record) - without
    z = linear.used(after.residual)[sealed]
    X = np.concatenate([change[None], linear.columns[: len(model.reach.parameters)]])[:, sealed]
    w = after.noise.whiten(X, like=z)
    e = after.noise.whiten(z)
    loose = np.append(0.0, 1.0 / np.maximum(after.shift_errors[: len(X) - 1], 1e-12) ** 2)
    G = np.einsum("kdn,ldn->kl", w, w) + np.diag(loose)
    if G[0, 0] <= LARGEST_ERROR**-2:
        return None
    inverse = np.linalg.inv(G)
    b = inverse @ np.einsum("kdn,dn->k", w, e)
    left = np.einsum("kdn,dn->dk", w, e - np.tensordot(b, w, 1))
    blocks = linear.split.block[sealed]
    sums = np.array([left[blocks == one].sum(axis=0) for one in np.unique(blocks)])
    scatter = inverse @ (sums.T @ sums) @ inverse
    error = float(np.sqrt(max(inverse[0, 0], scatter[0, 0])))
    return (1.0 + float(b[0]), error) if error < LARGEST_ERROR else None


USUAL: dict[str, str] = {
    "flow": (
        "Gauge the flow below each dam once during the hours found, and look into the gate books for them."
    ),
    "timing": "Compare the clocks of both logs and log one step of each gate with seconds.",
    "level": "Read the gauge against a staff or a second sensor.",
}
"""By family, for effects without a measurement of their own."""


def breaker(effect: type[Effect] | Effect, tied: Iterable[type[Effect]]) -> str | None:
    """Measurement that separates an effect from those it is tied with; None where nothing is tied."""
    others = tuple(tied)
    if not others:
        return None
    for other in others:
        text = effect.confounded_with.get(other.name) or other.confounded_with.get(effect.name)
        if text:
            return text
    return USUAL[effect.family]


WORSE = 1.01
"""A name does not hold where the sealed error grows by more than this factor at every horizon."""
HELD = 0.25
"""Or where less than this share of what it gained on the selecting days is found on the sealed ones."""
HALF = 0.5
"""Or where, with two standard errors, its size on the sealed days is below this share of its size."""


def verdict_of(study: Study, gap: Gap, unknown: Unknown | None) -> tuple[Verdict, str]:
    """Verdict and its reason in a sentence; `unknown` is a periodic or localised remainder."""
    base, end = np.array(gap.rmse_baseline), study.last_evaluation.errors.rmse(study.split.sealed)
    named, unit = study.named, gap.unit
    if not named:
        if study.contradicted is not None:
            return (
                "did_not_hold",
                f"{study.contradicted.name} fits the days that it was fitted to, but not the days kept for "
                "the choice: what was there on the former is not there on the latter.",
            )
        if unknown is None:
            return "no_gap", "No candidate stands out, and what is left shows neither rhythm nor place."
        return "unknown", f"Something is left that no known effect explains: {unknown.drivers[0]}."
    all_names = [r.proposal.name.replace("_", " ") for r in named]
    names = ", ".join(
        f"{name}, {n} times" if (n := all_names.count(name)) > 1 else name
        for name in dict.fromkeys(all_names)
    )
    shown = f"{base[1]:.3g} {unit} to {end[1]:.3g} {unit} after 4 h"
    if fails(study, base, end):
        return "did_not_hold", f"{names} fits, but on the days kept apart the error goes from {shown}."
    first = named[0]
    if first.tied:
        others = ", ".join(first.tied)
        return (
            "cannot_tell",
            f"{first.proposal.name} or {others}: these data do not separate them. The error: {shown}.",
        )
    if unknown is not None:
        return "partly_explained", f"Named: {names}. Left: {unknown.drivers[0]}. The error: {shown}."
    return "explained", f"{names}. On days kept apart the error goes from {shown}."


def fails(study: Study, base: Floats, end: Floats) -> bool:
    """Whether the sealed days contradict the names: by size, error (base, end: (horizons,)) or likelihood.

    The error hours ahead is mostly due to the unknown inflow; for a lag or a slow gate the likelihood
    decides.
    """
    first = study.named[0]
    held = held_share(study.last, study.last_linear, study.last_evaluation, first.proposal.name)
    if held is not None:  # the size itself is more informative than its gain
        share, error = held
        return share + 2.0 * error < HALF
    if _likelier(study):
        return False
    if bool((end > WORSE * base).all()):
        return True
    promised = first.proposal.improvement
    columns = first.proposal.columns
    active = np.abs(columns).max(axis=(0, 2)) if len(columns) else np.ones(study.record.days)
    sealed = study.split.sealed & (active > 0)
    if not sealed.any() or promised.max() < 0.1:
        return False
    found = 1.0 - first.after.errors.rmse(sealed) / first.before.errors.rmse(sealed)
    return bool((np.nan_to_num(found) < HELD * np.maximum(promised, 0.1)).all())


def _likelier(study: Study) -> bool:
    """Whether the sealed days gain a fair share of what the selecting days gain."""
    noise = study.named[0].proposal.gains
    change = study.last_evaluation.likelihood - study.first_evaluation.likelihood if noise is None else noise
    gain = limited(change)
    sealed, select = gain[study.split.sealed].mean(), gain[study.split.select].mean()
    return bool(sealed > max(HELD * select, 0.0))
