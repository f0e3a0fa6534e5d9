"""From the evidence of fronts to a day's travel time: flattened weights, and what a front's place means.

In a store the place of the front is the travel time. A sharp wave moves the level as it arrives, and the
sample after the arrival holds it whole: within most of a sample its place does not move, then it runs through
the rest. What the gate takes to move, and what blunts a wave on its way, make the place follow the arrival
more evenly, and a little before it.
"""

from functools import lru_cache

import numpy as np

from rivid.core.posterior.front import SHARES
from rivid.core.settings import PosteriorSettings
from rivid.types import Floats

STEPS = 10
"""Places in one sample at which the travel time's distribution is kept."""

TOLERANCE = 0.1
"""So close to a sampling instant [samples], the delays on both sides are right."""

KNEE = 0.62
"""Part of a sample in which the place of a sharp wave stays where it is."""

GROWTH = 0.05
"""By how much the error of a wave's place grows with each sample of its travel, as a share."""

BULGE = 0.5
"""By how much the error of a wave's place is larger amid two sampling instants, as a share."""


def weights(
    fronts: list[Floats], nothing: list[Floats], stores: list[bool], s: PosteriorSettings
) -> tuple[list[Floats], Floats]:
    """Flattened evidence, and the probability that there is a front at all.

    Parameters
    ----------
    fronts, nothing : list of ndarray
        From :func:`rivid.core.posterior.front.log_evidence`.
    stores : list of bool
        Which equations know volumes only.
    s : PosteriorSettings

    Returns
    -------
    q : list of ndarray, shape (candidates, shares, days)
        For each equation; together they sum to one for each day. NaN where nothing moves.
    link : ndarray, shape (days,)
    """
    q, mass, none = [], [], []
    top = np.max([f.max(axis=(0, 1, 2)) for f in fronts] + [z.max(axis=0) for z in nothing], axis=0)
    even = np.full(len(SHARES), 1.0 / len(SHARES))
    sharp = (1.0 - s.sharp) * even
    sharp[0] += s.sharp
    with np.errstate(invalid="ignore", divide="ignore"):
        for f, z, store in zip(fronts, nothing, stores, strict=True):
            prior = (even if store else sharp)[:, None]
            between = np.exp((f - top) / s.between_temperature).sum(axis=0) * prior
            mass.append(between.sum(axis=(0, 1)))
            none.append(np.exp((z - top) / s.between_temperature).sum(axis=0))
            own = s.store_temperature if store else s.wave_temperature
            inside = np.exp((f - f.max(axis=(0, 1, 2))) / own).sum(axis=0) * prior
            q.append(inside / inside.sum(axis=(0, 1)))
        total = np.sum(mass, axis=0)
        share = [np.where(m > 0.0, m / total, 0.0) for m in mass]
        q = [np.where(p > 0.0, p * inside, 0.0) for p, inside in zip(share, q, strict=True)]
        q = [np.where(total > 0.0, part, np.nan) for part in q]
        seen = total / fronts[0].shape[1]
        link = seen / (seen + np.sum(none, axis=0))
    return q, np.where(np.isfinite(link), link, 0.0)


def wave_place(travel: Floats, s: PosteriorSettings) -> Floats:
    """Place of the front [samples] of a wave with this travel time [samples]; it never falls."""
    whole = np.floor(travel)
    part = travel - whole
    sharp = np.clip(1.0 - s.wave_lag * travel, 0.0, 1.0)
    return (
        whole - s.wave_lead + (1.0 - sharp) * part + sharp * np.clip((part - KNEE) / (1.0 - KNEE), 0.0, None)
    )


def places(first: int, last: int) -> Floats:
    """Places of the front [samples] of the candidates, shape (candidates, shares)."""
    return np.arange(first, last + 1)[:, None] + 1.0 - SHARES


def meant(s: PosteriorSettings, first: int, last: int) -> tuple[Floats, Floats]:
    """The delay that each place of the front stands for, (candidates, shares): of stores, and of waves."""
    x = places(first, last)
    return np.floor(x + 1e-9), np.floor(x + s.wave_lead + 1e-9)


@lru_cache(maxsize=8)
def _kernel(s: PosteriorSettings, first: int, last: int) -> Floats:
    """Distribution function of the travel time for each place, shape (2, candidates * shares, edges): at
    steps of a sample, then a tolerance before and behind each whole sample."""
    whole = np.arange(first, last + 2, dtype=float)
    steps = np.arange(first * STEPS, (last + 1) * STEPS + 1) / STEPS
    edges = np.concatenate([steps, whole - TOLERANCE, whole + TOLERANCE])
    x = places(first, last).reshape(-1, 1)
    part = edges - np.floor(edges)
    width = s.wave_error * (1.0 + GROWTH * edges) * (1.0 + BULGE * 4.0 * part * (1.0 - part))
    order = np.argsort(edges, kind="stable")
    tables = []
    for away in ((edges - x) / s.store_error, (wave_place(edges, s) - x) / width):
        table = 1.0 / (1.0 + np.exp(-np.clip(away, -50.0, 50.0)))
        table[:, order] = np.maximum.accumulate(table[:, order], axis=1)  # where the width grows faster
        table[:, edges <= first], table[:, edges >= last + 1] = 0.0, 1.0  # what lies outside counts there
        tables.append(table)
    return np.stack(tables)


def fold(
    q: list[Floats], stores: list[bool], s: PosteriorSettings, first: int, last: int
) -> tuple[Floats, Floats, Floats]:
    """What the weights say of the travel time.

    Parameters
    ----------
    q, stores, s
        As for :func:`weights`.
    first, last : int
        The candidates.

    Returns
    -------
    probability : ndarray, shape (candidates, days)
        That the travel time lies in [d, d + 1).
    right : ndarray, shape (candidates, days)
        That it lies there or within a tenth of a sample of it: that d is a right answer.
    place : ndarray, shape (3, days)
        Median, 5 and 95 % of the travel time [samples].
    """
    days = q[0].shape[-1]
    both = np.zeros((days, 2, 1, q[0].shape[0] * q[0].shape[1]))
    for part, store in zip(q, stores, strict=True):
        both[:, 0 if store else 1, 0] += part.reshape(-1, days).T
    # one product of a fixed size for each day: a day's bits do not depend on its neighbours
    F = np.matmul(both, _kernel(s, first, last)).sum(axis=(1, 2)).T
    steps, before, behind = np.split(
        F, [(last + 1 - first) * STEPS + 1, (last + 1 - first) * (STEPS + 1) + 2]
    )
    probability = np.diff(steps[::STEPS], axis=0)
    right = behind[1:] - before[:-1]
    levels = np.array([0.5, 0.05, 0.95])
    at = np.maximum(np.array([np.argmax(steps >= level, axis=0) for level in levels]), 1)
    here = np.arange(days)
    with np.errstate(invalid="ignore", divide="ignore"):
        below = steps[at - 1, here]
        part = (levels[:, None] - below) / (steps[at, here] - below)
    return probability, right, first + (at - 1 + part) / STEPS
