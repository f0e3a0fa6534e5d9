"""Which response: the one that predicts days that it was not fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rivid.diagnose.blocks import Split
from rivid.diagnose.calibration import Calibration
from rivid.diagnose.data import Floats, Record
from rivid.diagnose.gap import day_errors
from rivid.errors import RividError

HOURS = (1.0, 4.0)
"""Horizons [h]: beyond these the unknown inflow decides, not the response."""
TIED = 0.03
"""Candidates whose errors are this close are equally good: the first of them is taken."""


@dataclass(frozen=True, eq=False)
class Choice:
    """A chosen response.

    Attributes
    ----------
    calibration : Calibration
        The chosen one.
    errors : dict of str to ndarray, shape (2,)
        Root mean square errors of every candidate on the days that select, 1 h and 4 h ahead [m or m3/s].
    """

    calibration: Calibration[Any]
    errors: dict[str, Floats]


def choose_response(record: Record, split: Split, candidates: Sequence[Calibration[Any]]) -> Choice:
    """The candidate of smallest error on the days that select.

    Parameters
    ----------
    record : Record
        That all were calibrated on.
    split : Split
        Of its days.
    candidates : sequence of Calibration
        In order of preference, each name once.

    Returns
    -------
    Choice
        The first candidate whose error, the geometric mean of both horizons, is within 3 % of the smallest.

    Raises
    ------
    RividError
        Where there is no candidate, or no error can be told.
    """
    names = [candidate.response.name for candidate in candidates]
    if not names or len(set(names)) < len(names):
        raise RividError(f"responses to choose from: {names}: expected one or more, each name once")
    errors = {
        name: day_errors(record, candidate.residual, candidate.noise, HOURS).rmse(split.select)
        for name, candidate in zip(names, candidates, strict=True)
    }
    means = np.array([np.exp(np.mean(np.log(error))) for error in errors.values()])
    if not np.isfinite(means).any():
        raise RividError(
            f"no reading on the {int(split.select.sum())} days that select: nothing to choose a response by"
        )
    best = float(np.nanmin(means))
    return Choice(candidates[int(np.argmax(means <= (1.0 + TIED) * best))], errors)
