"""Which response is rich enough: the one under which days that it was not fitted to are most likely.

Everything else hangs on it. A response that cannot follow the waves of a reach leaves residuals that look
like effects; one with too many coefficients takes a true effect upon itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rivid.diagnose.blocks import Split
from rivid.diagnose.data import Record
from rivid.diagnose.fit import Model, calibrate
from rivid.diagnose.linear import Evaluation, Linear, evaluate
from rivid.diagnose.response import Response
from rivid.errors import RividError

AS_GOOD = 2.0
"""Nats a selecting day by which a later candidate must be ahead of one that is preferred to it."""
FEW = 12
"""Fitting days from which every third is fitted to first."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A candidate, calibrated.

    Attributes
    ----------
    model : Model
    linear : Linear
    evaluation : Evaluation
    note : str
        What to say of the choice; empty where the first candidate stands.
    """

    model: Model
    linear: Linear
    evaluation: Evaluation
    note: str = ""


def choose_response(
    record: Record,
    dealt: Split,
    candidates: Sequence[Model],
    trim: float,
    report: Callable[[str], None] = lambda _: None,
) -> Calibrated:
    """Calibrate the candidates and take the one that predicts.

    Parameters
    ----------
    record : Record
    dealt : Split
    candidates : sequence of Model
        In order of preference, not calibrated.
    trim : float
        Share of the noisiest days that count for nothing.
    report : callable

    Returns
    -------
    Calibrated
        The first candidate whose log-likelihood on the selecting days is within :data:`AS_GOOD` a day of the
        best one's.

    Raises
    ------
    RividError
        Where no candidate can be calibrated; with what the first one said.

    Notes
    -----
    By likelihood, not by the error some hours ahead: this is mostly the unknown inflow's and hardly differs
    between a good response and a poor one.
    """
    done: list[Calibrated] = []
    refused: list[RividError] = []
    for model in candidates:
        report(f"calibrating the response: {model.reach.name}")
        try:
            done.append(_calibrated(model, record, dealt, trim, report))
        except RividError as error:
            if len(candidates) == 1:
                raise
            refused.append(error)
    if not done:
        raise refused[0]
    days = max(int(dealt.select.sum()), 1)
    gains = np.array([one.evaluation.likelihood[dealt.select].sum() for one in done]) / days
    best = int(np.argmax(gains >= gains.max() - AS_GOOD))
    chosen = done[best]
    if refused and best == 0:
        return replace(chosen, note=f"another response than the first was taken: {refused[0]}")
    if best == 0:
        return chosen
    taken, first = chosen.model.reach.name, done[0].model.reach.name
    return replace(
        chosen,
        note=f"{taken} describes the selecting days better than {first}, by {gains[best] - gains[0]:.0f} "
        "nats a day: check the reach's geometry",
    )


def _calibrated(
    model: Model, record: Record, dealt: Split, trim: float, report: Callable[[str], None]
) -> Calibrated:
    fit = np.flatnonzero(dealt.fit)
    if len(fit) >= FEW:
        model = calibrate(model, record.take(fit[::3]), trim=trim, report=report)
    model = calibrate(model, record.take(fit), trim=trim, report=report)
    linear = model.linear(record, dealt)
    return Calibrated(model, linear, evaluate(linear))


def as_candidates(response: Response | Sequence[Response]) -> tuple[Response, ...]:
    """One response, or several in order of preference."""
    return tuple(response) if isinstance(response, Sequence) else (response,)
