"""Name effects by a naive regression: least squares of level differences on flows and candidates.

    h[k+1] - h[k] = a + b Qi[k - d] - c Qo[k] + g x[k] + e[k]

for each candidate x, as if the measured regressors had no errors and e no memory. Candidates with |t| above
3.3 are named. Operators hold the level by the outflow, so level and unexplained inflow are correlated, and
the regression finds leaks that do not exist. The exam must refuse this method.
"""

from typing import Any

import numpy as np

from rivid.diagnosis.data import Record
from rivid.diagnosis.result import Diagnosis, NamedEffect, Where
from rivid.effects import CATALOGUE
from rivid.types import Floats

SURE = 3.3
"""Threshold of |t|."""
DELAY = 6
"""Approximate travel time of the inflow [samples]."""


def candidates(record: Record) -> dict[str, Floats]:
    """Return the course that each effect would add to the difference, shape (days, n) each."""
    h = record.output - record.usual_output
    turn = 2.0 * np.pi * record.hour / 24.0
    late = np.roll(record.inflow, DELAY, axis=1)
    flow = record.inflow if record.kind == "river" else record.outflow
    return {
        "leakage": -h,
        "gate_head_effect": -h * flow,
        "storage_area_slope": -h * (late - flow),
        "diurnal_inflow": np.cos(turn),
        "sensor_drift": record.time - record.time.mean(),
    }


def named_by_regression(
    record: Record, response: Any, classes: dict[str, Any], **_: Any
) -> tuple[Diagnosis, None]:
    """Diagnose by the regression alone, with the signature of :func:`rivid.diagnosis.workflow.diagnose`."""
    kept = record.used[:, 1:] & record.used[:, :-1]
    y = np.diff(record.output, axis=1)[kept]
    late = np.roll(record.inflow, DELAY, axis=1)
    plain = [np.ones_like(late), late, -record.outflow]
    found = {
        name: abs(_t([column[:, :-1][kept] for column in (*plain, x)], y))
        for name, x in candidates(record).items()
        if name in classes
    }
    sure = sorted((name for name, t in found.items() if t > SURE), key=lambda name: -found[name])
    effects = tuple(_named(name) for name in sure)
    return Diagnosis(
        "explained" if effects else "no_gap", "by regression", "regression", effects=effects
    ), None


def _t(columns: list[Floats], y: Floats) -> float:
    """Return t of the last column."""
    X = np.stack(columns, axis=1)
    X = X / np.maximum(np.sqrt((X * X).mean(axis=0)), 1e-12)
    G = np.linalg.pinv(X.T @ X)
    b = G @ X.T @ y
    spread = float(((y - X @ b) ** 2).sum() / (len(y) - len(b)))
    return float(b[-1] / np.sqrt(max(G[-1, -1] * spread, 1e-300)))


def _named(name: str) -> NamedEffect:
    return NamedEffect(name, CATALOGUE[name].family, 0.0, (), None, None, (), Where(), None, {"name": name})
