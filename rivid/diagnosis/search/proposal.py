"""A proposal: an effect that might be missing, and what the model would be with it."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rivid.diagnosis.fit import Evaluation, Linear
from rivid.diagnosis.search.trials import Window
from rivid.effects import Effect
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.diagnosis.events import Events

MOST_USUAL = 4.0
"""A day counts for at most so many times the usual day's gain."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """An effect that might be missing.

    Attributes
    ----------
    name, label : str
        Of the effect, and which of its trials.
    effect : Effect
        With its window.
    free : tuple of str
        Parameters to refit.
    window : Window
        Dates and hours; None where it is always there.
    p_value : float
        Family-wise, of the whole library.
    evaluation : Evaluation
    columns : ndarray, shape (k, days, n)
        What was tried; empty where `coded` or the noise is what is new.
    gain_fit, gain_select : float
        Log-likelihood gained on the days that fit (priors included) and that select [nats].
    t : float
        Paired gain on the selecting blocks over its standard error.
    improvement : ndarray, shape (horizons,)
        Share by which the error of the simulation falls on the selecting days.
    blocks : int
        Selecting blocks on which it acts.
    events : Events or None
        Events, as found one by one.
    level_noise : bool
        Whether the proposal is a noise of the level (wind, a seiche).
    spreads : dict of str to float
        Standard errors of a noise's parameters, where they are known.
    gains : ndarray of shape (days,), or None
        Of a noise: what each day gains by it [nats].
    """

    name: str
    label: str
    effect: Effect
    free: tuple[str, ...]
    window: Window
    p_value: float
    evaluation: Evaluation
    columns: Floats
    gain_fit: float
    gain_select: float
    t: float
    improvement: Floats
    blocks: int
    events: "Events | None" = None
    level_noise: bool = False
    spreads: dict[str, float] = field(default_factory=dict)
    gains: Floats | None = None


def compared(
    model: Linear, before: Evaluation, after: Evaluation, price: Floats, active: Floats
) -> tuple[float, float, float, Floats, int]:
    """Gains on fitting and selecting days, t of the latter by blocks, and what the error falls by.

    `price` [nats], shape (days,), is what the days pay for events; t and error are of the selecting days
    that are `active`, where the candidate does something; the last number is how many blocks these are.
    """
    gain = after.likelihood - before.likelihood
    gain = gain * np.minimum(before.weights, after.weights) - price
    if not price.any():  # one odd day does not decide; events are odd days
        usual = np.median(np.abs(gain[active > 0])) if (active > 0).any() else 0.0
        gain = np.clip(gain, -MOST_USUAL * usual - 5.0, MOST_USUAL * usual + 5.0)
    split = model.split
    chosen = split.select & (active > 0)
    blocks = split.block[chosen]
    sums = np.array([gain[chosen][blocks == b].sum() for b in np.unique(blocks)])
    if len(sums) > 1:
        t = float(sums.mean() / max(sums.std(ddof=1) / np.sqrt(len(sums)), 1e-9))
    else:  # one block has no spread: its days stand for it
        days = gain[chosen]
        t = float(days.mean() / max(days.std(ddof=1) / np.sqrt(len(days)), 1e-9)) if len(days) > 1 else 0.0
    old, new = before.errors.rmse(chosen), after.errors.rmse(chosen)
    return (
        float(gain[split.fit].sum() + before.penalty - after.penalty), float(gain[split.select].sum()), t,
        np.nan_to_num(1.0 - new / old), len(sums),
    )  # fmt: skip
