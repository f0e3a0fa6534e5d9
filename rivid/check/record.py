"""What is kept of the good days, for a look at the whole: their samples, at no more than one a minute."""

import datetime as dt
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from rivid.config import ReachConfig
from rivid.logs.read import DataSet
from rivid.types import Floats

Kept = NDArray[np.float32]
FINEST = 60.0
"""[s]; finer samples are averaged: what is looked for lasts longer, and decades must fit into memory."""


@dataclass(frozen=True, eq=False)
class Day:
    """The samples of a day.

    Attributes
    ----------
    date : date
    columns : dict of ndarray, (n,)
        u_Qi, u_Qo [m3/s] where it is logged, and the output: h_L [m] or Q_L [m3/s].
    content : str
        Digest of the samples as they were read.
    """

    date: dt.date
    columns: dict[str, Kept]
    content: str

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name].astype(float)

    def __len__(self) -> int:
        return len(self.columns["u_Qi"])


class Record:
    """The good days of a reach.

    Parameters
    ----------
    reach : ReachConfig

    Attributes
    ----------
    step : float
        Between two samples that are kept [s].
    days : dict of date to Day
        In date order.
    """

    def __init__(self, reach: ReachConfig) -> None:
        self.reach = reach
        self.output = reach.output
        self.merged = max(1, int(np.ceil(FINEST / reach.sample_time)))
        self.step = reach.sample_time * self.merged
        self.days: dict[dt.date, Day] = {}

    def add(self, data: DataSet) -> None:
        """Keep a day."""
        columns = {"u_Qi": data.inflow, self.output: data.output}
        if data.outflow is not None:
            columns["u_Qo"] = data.outflow
        digest = sha256()
        for name in sorted(columns):
            digest.update(np.ascontiguousarray(columns[name]).tobytes())
        kept = {name: self._coarser(values) for name, values in columns.items()}
        if len(kept["u_Qi"]):
            self.days[data.date] = Day(data.date, kept, digest.hexdigest())

    def _coarser(self, values: Floats) -> Kept:
        m = self.merged
        if m > 1:
            whole = len(values) // m * m
            values = values[:whole].reshape(-1, m).mean(axis=1)
        return values.astype(np.float32)

    @property
    def flows(self) -> list[str]:
        """Columns that are discharges."""
        names = list(next(iter(self.days.values())).columns) if self.days else []
        return [name for name in ("u_Qi", "u_Qo", "Q_L") if name in names]

    @property
    def balanced(self) -> bool:
        """Whether the level can be compared with inflow less outflow."""
        return self.reach.kind == "pool" and "u_Qo" in self.flows

    def declared(self, key: str) -> bool:
        """Whether a key of [reach] was given, not taken from Table I."""
        return key in self.reach.model_fields_set

    @cached_property
    def resolution(self) -> float:
        """The smallest step in which the output is logged on most days; 0 where it never moves."""
        smallest = []
        for day in self.days.values():
            values = day[self.output]
            steps = np.abs(np.diff(values))
            # single precision cannot tell steps below this from none
            steps = steps[steps > 4e-7 * max(float(np.abs(values).max()), 1.0)]
            if len(steps):
                smallest.append(float(steps.min()))
        return float(np.median(smallest)) if smallest else 0.0

    def clock(self, k: int) -> str:
        """The time of day of a sample, in words."""
        minutes = round(k * self.step / 60)
        return f"{minutes // 60:02d}:{minutes % 60:02d}"
