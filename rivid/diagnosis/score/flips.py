"""What chance would make of the scores: the largest statistic over the windows, for each flip of signs."""

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.score.windows import Windows

Floats = NDArray[np.float64]

CHUNK = 500_000
"""Numbers in one block of flipped scores: 4 MB stay near the processor."""


def statistic_of(sums: Floats, sign: int) -> Floats:
    """s'V^-1 s of sums of standard scores (..., k); 0 where the sign is wrong."""
    if sign:
        sums = np.maximum(sign * sums, 0.0)
    return np.asarray(np.einsum("...k,...k->...", sums, sums), float)


def flipped(w: Windows, signs: Floats) -> Floats:
    """Largest statistic over the windows for each flip (flips,)."""
    most = np.zeros(len(signs))
    many, n_blocks, k = w.scores.shape
    step = max(1, CHUNK // (len(signs) * k))
    for i in range(0, many, step):
        t = w.scores[i : i + step]
        if k == 1:  # the largest square is that of the largest or of the smallest sum
            sums = t[:, :, 0] @ signs.T
            if w.sign >= 0:
                np.maximum(most, sums.max(0), out=most)
            if w.sign <= 0:
                np.maximum(most, -sums.min(0), out=most)
            continue
        sums = signs @ t.transpose(1, 0, 2).reshape(n_blocks, -1)
        most = np.maximum(most, statistic_of(sums.reshape(len(signs), len(t), k), w.sign).max(1))
    return most * most if k == 1 else most


def surprise(statistic: Floats, k: int) -> Floats:
    """-log of the chance of more by chi-square: one scale for candidates of different k, no more."""
    from scipy.special import gammaincc

    return np.asarray(-np.log(np.maximum(gammaincc(0.5 * k, 0.5 * statistic), 1e-300)), float)


def p_of(chance: Floats, seen: float) -> float:
    """Share of flips with at least as much, the data among them."""
    return float((1 + (chance >= seen * (1.0 - 1e-9)).sum()) / (1 + len(chance)))
