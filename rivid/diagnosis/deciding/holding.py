"""Whether a named effect is as large on the days kept apart as on those that it was fitted to."""

from dataclasses import replace

import numpy as np

from rivid.diagnosis.fit import Evaluation, Linear, Model
from rivid.errors import RividError

TOLD = 0.2
"""Standard error of the share above which the sealed days do not tell."""


def held_share(model: Model, linear: Linear, after: Evaluation, name: str) -> tuple[float, float] | None:
    """Size of an effect on the sealed days over what the model gives it, and its standard error.

    What the effect does to the output is fitted to the sealed days' residual once more, beside the response's
    parameters, which are as free as the fitting days leave them.

    Parameters
    ----------
    model : Model
        With the effect.
    linear : Linear
        The record about it.
    after : Evaluation
        Of it.
    name : str
        Of the effect.

    Returns
    -------
    (float, float) or None
        None where the model holds no such effect, or the sealed days do not tell its size.
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
    except RividError:  # a flow that cannot be
        return None
    does = model.baseline(record) - without
    z = linear.used(after.residual)[sealed]
    X = np.concatenate([does[None], linear.columns[: len(model.reach.parameters)]])[:, sealed]
    w = after.noise.whiten(X, like=z)
    e = after.noise.whiten(z)
    loose = np.append(0.0, 1.0 / np.maximum(after.shift_errors[: len(X) - 1], 1e-12) ** 2)
    G = np.einsum("kdn,ldn->kl", w, w) + np.diag(loose)
    if G[0, 0] <= TOLD**-2:
        return None
    inverse = np.linalg.inv(G)
    b = inverse @ np.einsum("kdn,dn->k", w, e)
    left = np.einsum("kdn,dn->dk", w, e - np.tensordot(b, w, 1))
    blocks = linear.split.block[sealed]
    sums = np.array([left[blocks == one].sum(axis=0) for one in np.unique(blocks)])
    scatter = inverse @ (sums.T @ sums) @ inverse
    error = float(np.sqrt(max(inverse[0, 0], scatter[0, 0])))
    return (1.0 + float(b[0]), error) if error < TOLD else None
