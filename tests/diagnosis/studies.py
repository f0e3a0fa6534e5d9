"""Hand-made explanations and studies: densities and errors of days, as left by a fit."""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from rivid.diagnosis.blocks import split
from rivid.diagnosis.decision import TEMPER, Study
from rivid.diagnosis.fit import DayErrors
from rivid.diagnosis.noise.model import NoiseModel
from rivid.effects import CATALOGUE
from tests.diagnosis.answers import record_of

RECORD = record_of(days=30)
SPLIT = split(RECORD.dates)
OPEN = ~SPLIT.sealed
HORIZONS = 4
LOUD = NoiseModel(100.0, 0.0, 0.0, 7200.0, 0.0, 7200.0, RECORD.sample_time, 6.7e5)
"""A noise with larger errors than those of the explanations here."""
QUIET = NoiseModel(1e-4, 0.0, 0.0, 7200.0, 0.0, 7200.0, RECORD.sample_time, 6.7e5)


MODEL = SimpleNamespace(
    reach=SimpleNamespace(name="linear"), flow=300.0, gauge_floor=0.0, effects=(), free=()
)


@dataclass(frozen=True, eq=False)
class Made:
    """The fields of an explanation that the decision reads."""

    names: tuple[str, ...]
    unknown: str
    parent: Any
    density: Any
    errors: DayErrors
    added: Any = None
    log_prior: float = 0.0
    inflation: float = 1.0
    noise: NoiseModel = LOUD
    count: tuple = (0, 0)  # no effect in the simulator: materiality compares with the errors of the parent
    events: tuple = ()
    active: Callable = lambda record, effect: np.ones(record.days, bool)
    errors_of: Callable = lambda index: {("place", None): 0.0}
    others: tuple = ()
    model: Any = field(default_factory=lambda: MODEL)
    residual: Any = field(default_factory=lambda: RECORD.output)
    predicted: Any = None
    bonus: Any = None
    way: Any = None

    @property
    def effects(self):
        before = () if self.parent is None else self.parent.effects
        return before if self.added is None else (*before, self.added)


def explained(added="", nats=0.0, removes=0.0, *, parent=None, unknown="", sealed=None, **others):
    """Return an explanation that gains `nats` of tempered score and removes a share of its parent's error.

    The gain is the same on all open days. `removes` is one number, or one for each horizon. On held-out days
    the gain and the removed share are `sealed`, by default the same.
    """
    days = RECORD.days
    names = (*(parent.names if parent else ()), *([added] if added else []))
    gain, share = np.full(days, nats), np.broadcast_to(np.reshape(removes, (-1, 1)), (HORIZONS, days)).copy()
    if sealed is not None:
        gain[~OPEN], share[:, ~OPEN] = sealed
    before = np.ones((HORIZONS, days)) if parent is None else parent.errors.squares
    density = gain / (TEMPER * OPEN.sum()) + (0.0 if parent is None else parent.density)
    return Made(
        names, unknown or (parent.unknown if parent else ""), parent, density,
        DayErrors((1.0 - share) * before, np.ones((HORIZONS, days))), CATALOGUE[added]() if added else None,
        **others,
    )  # fmt: skip


def study_of(*pool):
    return Study(RECORD, SPLIT, pool, ())
