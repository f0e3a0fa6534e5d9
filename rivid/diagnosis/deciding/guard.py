"""The guard against people: is an effect of the level seen in what the inflow alone does to the level?

People hold the level by the outflow. A level that an unknown inflow raised is lowered by hand, and a reach
that seems to lose water when the level is high may only have attentive operators. So an effect that depends
on the level is looked at a second time through an instrument: the same effect in a reach whose level moves
as the logged inflow drives it, which no hand and no unknown inflow has touched.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from rivid.diagnosis.data import Record
from rivid.diagnosis.fit import Evaluation, Linear
from rivid.diagnosis.search.proposal import Proposal
from rivid.effects import Effect
from rivid.types import Floats

MEMORIES = (3600.0, 4 * 3600.0, 12 * 3600.0)
"""Of the leaky integrals of the inflow [s]."""
LEAST = 2.0
"""Of the guard's t."""
Simulated = Callable[[Record, Sequence[Effect]], Floats]


def driven_level(record: Record) -> Floats:
    """The level [m] as far as leaky integrals of the inflow explain it, shape (days, n).

    Parameters
    ----------
    record : Record
        Of a pool.

    Notes
    -----
    Least squares of the level that counts on a constant, the day's mean inflow and three leaky means of it
    with memories of 1, 4 and 12 hours; each row's means begin at its first inflow.
    """
    inflow = record.inflow - record.usual_flow
    parts = [np.ones_like(inflow), np.broadcast_to(inflow.mean(axis=1, keepdims=True), inflow.shape)]
    for memory in MEMORIES:
        keep = math.exp(-record.sample_time / memory)
        start = keep * inflow[:, :1]
        parts.append(lfilter([1.0 - keep], [1.0, -keep], inflow, axis=1, zi=start)[0])
    X = np.stack([part[record.used] for part in parts])
    b = np.linalg.lstsq(X.T, record.output[record.used], rcond=None)[0]
    return np.asarray(np.tensordot(b, np.stack(parts), 1))


def guard(proposal: Proposal, model: Linear, evaluation: Evaluation, simulated: Simulated) -> float:
    """How clearly an effect of the level shows through the instrument: t over blocks of days.

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
        Positive where the instrument agrees in sign. With x the effect's whitened column, z the one of the
        instrument without what the response's parameters do, r the whitened residual without the same and
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
