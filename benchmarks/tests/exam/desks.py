"""Simple steps in place of the real ones: they simulate and diagnose nothing."""

import datetime as dt
import os
from pathlib import Path

import numpy as np

from benchmarks.exam.answering import Logs
from benchmarks.tests.exam.answers import answer, effect, truth
from rivid.errors import ConfigError


def planted(seed):
    flow = np.full((1, 4), float(seed))
    logs = Logs((dt.date(2008, 1, 1),), np.arange(4.0), flow, flow, flow, {"reach": {"name": "reach"}})
    return logs, truth({"name": "secret", "examiner": os.getpid()}) | {"known": [{"name": "secret"}]}


def answered(logs):
    given = answer(effect("secret")) if logs.inflow[0, 0] % 2 else answer()
    return given | {"seen": float(logs.inflow[0, 0]), "candidate": os.getpid(), "config": logs.config}


def floored(logs, known):
    assert known == [{"name": "secret"}]
    return [1.0, 2.0, 5.0]


def refused(logs):
    """Fail if it is called at all."""
    raise AssertionError(f"asked again in {Path.cwd()}")


def barren(seed):
    """Raise an error for one seed, as for a season that cannot be simulated."""
    if seed == 1:
        raise ConfigError("operators.level_gain is too strong")
    return planted(seed)
