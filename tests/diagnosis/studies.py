"""Explanations and studies by hand: densities and errors of days, as a fit would leave them."""

from types import SimpleNamespace

import numpy as np

from rivid.diagnosis.blocks import split
from rivid.diagnosis.decision import TEMPER, Study
from rivid.diagnosis.fit import DayErrors
from rivid.effects import CATALOGUE
from tests.diagnosis.answers import record_of

RECORD = record_of(days=30)
SPLIT = split(RECORD.dates)
OPEN = ~SPLIT.sealed
HORIZONS = 4


def explained(added="", nats=0.0, removes=0.0, *, parent=None, unknown="", sealed=None, **others):
    """An explanation that gains `nats` of tempered score and takes a share of the error of its parent.

    The gain is the same on all open days; `removes` is a number, or one for each horizon; on sealed days it
    gains and removes `sealed`, by default the same.
    """
    days = RECORD.days
    names = (*(parent.names if parent else ()), *([added] if added else []))
    gain, share = np.full(days, nats), np.broadcast_to(np.reshape(removes, (-1, 1)), (HORIZONS, days)).copy()
    if sealed is not None:
        gain[~OPEN], share[:, ~OPEN] = sealed
    before = np.ones((HORIZONS, days)) if parent is None else parent.errors.squares
    density = gain / (TEMPER * OPEN.sum()) + (0.0 if parent is None else parent.density)
    return SimpleNamespace(
        **{
            "names": names, "unknown": unknown or (parent.unknown if parent else ""), "parent": parent,
            "effects": tuple(CATALOGUE[name]() for name in names), "log_prior": 0.0, "density": density,
            "added": CATALOGUE[added]() if added else None,
            "errors": DayErrors((1.0 - share) * before, np.ones((HORIZONS, days))),
            "active": lambda record: np.ones(record.days, bool),
            "model": SimpleNamespace(reach=SimpleNamespace(name="linear")), **others,
        }
    )  # fmt: skip


def study_of(*pool, first=None):
    return Study(RECORD, SPLIT, pool, first or pool[0], {}, ())
