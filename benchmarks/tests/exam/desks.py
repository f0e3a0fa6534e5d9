"""Simple desks in place of the real ones: they simulate and diagnose nothing."""

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
    return logs, truth({"name": "secret", "examiner": os.getpid()}) | {"told": [{"name": "secret"}]}


def answered(logs):
    said = answer(effect("secret")) if logs.inflow[0, 0] % 2 else answer()
    return said | {"seen": float(logs.inflow[0, 0]), "candidate": os.getpid(), "config": logs.config}


def floored(logs, told):
    assert told == [{"name": "secret"}]
    return [1.0, 2.0, 5.0]


def refused(logs):
    """Fails where it is asked at all."""
    raise AssertionError(f"asked again in {Path.cwd()}")


def barren(seed):
    """A season that cannot be, at one seed."""
    if seed == 1:
        raise ConfigError("operators.level_gain is too strong")
    return planted(seed)
