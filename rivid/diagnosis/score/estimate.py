"""How large a candidate is at its best window."""

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.score.base import Base, by_block, used_columns
from rivid.diagnosis.score.types import Candidate, Found
from rivid.diagnosis.score.windows import Windows, least_share

Floats = NDArray[np.float64]


def found_at(
    base: Base,
    candidate: Candidate,
    statistic: float,
    w: Windows,
    top: int,
    p_alone: float,
    p_family: float,
) -> Found:
    """The candidate's estimate at its best window, with the error that the blocks' scatter gives."""
    z = used_columns(np.asarray(candidate.columns, float), base.day, base.root, candidate.name)
    first, end, h0, h1 = w.place[top] if top >= 0 else (0, len(base.day), 0, len(z))
    if candidate.hours:
        z = z[h0:h1].sum(0, keepdims=True)
    k, n_blocks = len(z), len(base.e)
    inside = (np.arange(len(base.day)) >= first) & (np.arange(len(base.day)) < end)
    z = z * inside[:, None]
    raw = np.einsum("kdn,ldn->kl", z, z)
    z = z - np.tensordot(np.tensordot(z, base.X, ((1, 2), (1, 2))), base.X, 1)
    Q = np.einsum("kdn,ldn->kl", z, z)
    left = float(max(least_share(Q[None], raw[None])[0], 0.0))
    hours = (int(h0), int(h1)) if candidate.hours else None
    days = int(base.day[first]), int(base.day[end - 1])
    if top < 0:
        nothing = np.full(k, np.nan)
        return Found(candidate.name, 0.0, p_alone, p_family, days, hours, nothing, nothing, left)
    estimate = np.linalg.solve(Q, np.tensordot(z, base.r, 2))
    rest = base.r - np.tensordot(estimate, z, 1)
    u = by_block(np.einsum("kdn,dn->dk", z, rest), base.block, n_blocks)
    inverse = np.linalg.inv(Q)
    covariance = inverse @ (u.T @ u) @ inverse * n_blocks / (n_blocks - k)
    return Found(
        candidate.name,
        statistic,
        p_alone,
        p_family,
        days,
        hours,
        estimate,
        np.sqrt(np.diag(covariance)),
        left,
    )
