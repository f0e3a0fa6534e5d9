"""The level that the operators aim at, which may follow the day's flow."""

from dataclasses import dataclass, replace

import numpy as np

from rivid.diagnosis.data import Record
from rivid.types import Floats

HINGES = 20
"""Flows that are tried as the one above which the set point changes with it."""
SURE = 3.0
"""Standard errors from which a set point that follows the flow is believed."""
BESIDE = (0.0, -0.01, 0.01, -0.02, 0.02, -0.03, 0.03)
"""Levels that are tried beside the days' mean [m]."""
FEWEST_DAYS = 6
"""From which a set point that follows the flow can be seen."""


@dataclass(frozen=True)
class SetPoint:
    """The level aimed at: ``level + slope max(flow - hinge, 0)``, flow the day's mean inflow.

    Attributes
    ----------
    level : float
        [m].
    slope : float
        [m per m3/s].
    hinge : float
        [m3/s].
    """

    level: float
    slope: float = 0.0
    hinge: float = 0.0

    def at(self, flow: Floats) -> Floats:
        """The level aimed at on days of a mean inflow [m3/s]; any shape."""
        return np.asarray(self.level + self.slope * np.maximum(flow - self.hinge, 0.0))


def set_points(record: Record) -> list[SetPoint]:
    """Levels that may be aimed at: about the days' means, one level or one that follows the inflow.

    Within a dead-band the mean is not what they aim at: so levels beside it are tried too.
    """
    flow, level = day_flow(record), _day_means(record.output, record)
    known = np.isfinite(level)
    flow, level = flow[known], level[known]
    best, least = None, np.inf
    for hinge in np.linspace(flow.min(), flow.max(), HINGES, endpoint=False).tolist():
        x = np.maximum(flow - hinge, 0.0)
        if len(x) < FEWEST_DAYS or np.ptp(x) == 0.0:  # the same every day
            continue
        X = np.stack([np.ones_like(x), x], axis=1)
        found = np.linalg.lstsq(X, level, rcond=None)[0]
        left = float(((level - X @ found) ** 2).sum())
        error = np.sqrt(left / (len(x) - 2) / ((x - x.mean()) ** 2).sum())
        if abs(found[1]) > SURE * error and left < least:
            best, least = SetPoint(float(found[0]), float(found[1]), hinge), left
    means = [SetPoint(float(np.median(level)))] + ([] if best is None else [best])
    return [replace(aim, level=aim.level + beside) for aim in means for beside in BESIDE]


def day_flow(record: Record) -> Floats:
    """Mean inflow of each day [m3/s], shape (days,)."""
    return np.asarray(record.inflow[:, record.lead :].mean(axis=1))


def _day_means(values: Floats, record: Record) -> Floats:
    """Mean of each day's samples that count, shape (days,); NaN where there are none."""
    kept = record.used & np.isfinite(values)
    number = kept.sum(axis=1)
    total = np.where(kept, values, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, number, out=np.full(len(values), np.nan), where=number > 0))
