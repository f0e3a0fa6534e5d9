"""Which response is rich enough: the one under which days that it was not fitted to are most likely.

Everything else hangs on it. A response that cannot follow the waves of a reach leaves residuals that look
like effects; one with too many coefficients takes a true effect upon itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rivid.diagnosis.blocks import Split
from rivid.diagnosis.data import Record
from rivid.diagnosis.model.fit import Model, calibrate
from rivid.diagnosis.model.linear import Evaluation, Linear, evaluate
from rivid.diagnosis.response.base import Response
from rivid.errors import RividError

AS_GOOD = 2.0
"""Nats a selecting day by which a later candidate must be ahead of one that is preferred to it."""
PROMISE = 0.6
"""Share of what a response is behind that one effect must promise: it is tried at one size only."""
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
    behind : float
        By how much the selecting days are less likely than under the best candidate [nats].
    """

    model: Model
    linear: Linear
    evaluation: Evaluation
    behind: float = 0.0

    @property
    def as_good(self) -> bool:
        """Whether it is near enough to the best."""
        return self.lacks <= 0.0

    @property
    def lacks(self) -> float:
        """What it must gain on the selecting days to be near enough [nats]."""
        return self.behind - AS_GOOD * max(int(self.linear.split.select.sum()), 1)

    def lives_up(self, promise: float) -> bool:
        """Whether an effect that gains so much on the selecting days [nats] makes up for what it lacks."""
        return promise >= min(self.lacks, PROMISE * self.behind)


def calibrated(
    record: Record,
    dealt: Split,
    candidates: Sequence[Model],
    trim: float,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[list[Calibrated], tuple[str, ...]]:
    """Calibrate the candidates, and say how far each is behind the best.

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
    list of Calibrated
        In the same order, to the first that is within :data:`AS_GOOD` a day of the best.
    tuple of str
        What those said that cannot be run.

    Raises
    ------
    RividError
        Where no candidate can be calibrated; with what the first one said.

    Notes
    -----
    By likelihood, not by the error some hours ahead: this is mostly the unknown inflow's and hardly differs
    between a good response and a poor one. A candidate that is behind may still be the right one, if what it
    lacks is what the logs lack: coefficients enough take a slow gate or a late wave upon themselves.
    """
    done: list[Calibrated] = []
    refused: list[RividError] = []
    for model in candidates:
        report(f"calibrating the response: {model.reach.name}")
        try:
            done.append(_calibrated(model, record, dealt, trim, report))
        except RividError as error:
            refused.append(error)
    if not done:
        raise refused[0]
    gains = np.array([one.evaluation.likelihood[dealt.select].sum() for one in done])
    done = [replace(one, behind=float(gains.max() - gain)) for one, gain in zip(done, gains, strict=True)]
    last = next(i for i, one in enumerate(done) if one.as_good)
    return done[: last + 1], tuple(str(error) for error in refused)


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
