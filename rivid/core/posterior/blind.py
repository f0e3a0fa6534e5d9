"""p(d | y) where the outflow is not logged: half each of two views of the day.

One view is a first- or second-order equation or a store with a front (:mod:`rivid.core.posterior.front`), as
:func:`rivid.core.posterior.daily.posterior` has it; the other a smooth response with a jump
(:mod:`rivid.core.posterior.blind_response`), which takes in what people do with the inflow. Their
probabilities are pooled, not their evidence: without the outflow both are wrong in some way, and evidence
picks the one that is wrong with more conviction.
"""

import numpy as np
from numpy.typing import ArrayLike

from rivid.core.posterior.blind_response import BEHIND, LENGTHS, BlindEvidence, blind_evidence, blind_fir
from rivid.core.posterior.daily import BLOCK, PosteriorResult, _answer, _checked
from rivid.core.posterior.fir import averaged_fir
from rivid.core.posterior.fold import fold, meant, weights
from rivid.core.posterior.front import SHARES, log_evidence, structures
from rivid.core.posterior.noise import gram, noise_bank
from rivid.core.settings import GUARD, PosteriorSettings
from rivid.errors import RividError
from rivid.types import Floats

TEMPERATURE = 2.0
"""By which the log evidence of the smooth response is divided."""

SHARE = 0.5
"""Of the smooth response in the pool."""

IS_STORE = tuple(length > 5.0 for length in LENGTHS)
"""Whether a jump means a store's: waves that run to and fro leave no response smooth over many lags."""


def posterior_blind(u: ArrayLike, y: ArrayLike, settings: PosteriorSettings | None = None) -> PosteriorResult:
    """Probability of every delay, day by day, from the inflow and the level alone.

    Parameters
    ----------
    u : array_like, shape (days, N)
        Inflow commands [m3/s].
    y : array_like, shape (days, N)
        Level [m]. Neither its unit nor a constant matters.
    settings : PosteriorSettings, optional

    Returns
    -------
    PosteriorResult
        Its `fir` is how the level answers the inflow with people as they are, not with the outflow held.

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or days too short for d_max.
    """
    s = settings or PosteriorSettings()
    inputs, outputs, _ = _checked(u, y, None, s)
    n_lags = _n_lags(s)
    if inputs.shape[1] < n_least(s):
        raise RividError(
            f"{inputs.shape[1]} samples a day: d_max = {s.d_max} and order = {s.order} need {n_least(s)}"
        )
    days = len(inputs)
    blocks = (np.minimum(np.arange(begin, begin + BLOCK), days - 1) for begin in range(0, days, BLOCK))
    found = [_block(inputs[take], outputs[take], n_lags, s) for take in blocks]
    probability, right, place, fir, sd, link = (
        np.concatenate([block[i] for block in found])[:days] for i in range(6)
    )
    still = (np.ptp(inputs, axis=1) <= 0.0) | (np.ptp(outputs, axis=1) <= 0.0)
    probability[still], link[still] = np.nan, 0.0
    return _answer(s, probability, right, place, fir, sd, link, still)


def n_least(s: PosteriorSettings) -> int:
    """Samples that a day needs."""
    return 3 * _n_lags(s)


def _n_lags(s: PosteriorSettings) -> int:
    return max(s.d_max + GUARD + BEHIND, s.order - 1)


def _block(u: Floats, y: Floats, n_lags: int, s: PosteriorSettings) -> tuple[Floats, ...]:
    """Probability and that of being right (days, candidates with guards), place, FIR, its spread, link."""
    first, last = max(s.d_min - GUARD, 0), s.d_max + GUARD
    kinds = structures(False)
    stores = [kind.is_store for kind in kinds]
    G, n_rows = gram(u, y, None, noise_bank(), last + 4)
    fronts, nothing = log_evidence(G, n_rows, False, first, last)
    q, link = weights(fronts, nothing, stores, s)
    days = [blind_evidence(a, b, first, last, n_lags) for a, b in zip(u, y, strict=True)]
    seen = [smooth_weights(day, s) for day in days]
    smooth = np.stack([weight for weight, _ in seen], axis=-1)

    pooled = [*((1.0 - SHARE) * part for part in q), *(SHARE * part for part in smooth)]
    probability, right, place = fold(pooled, [*stores, *IS_STORE], s, first, last)
    delay = s.d_min + np.argmax(probability[s.d_min - first : s.d_max + 1 - first], axis=0)
    means = meant(s, first, last)
    belongs = [means[0 if store else 1][..., None] == delay for store in stores]
    fir, sd = averaged_fir(G, n_rows, fronts, belongs, kinds, first, s.between_temperature, s.order, False)
    smooth_fir = [
        blind_fir(day, (means[0] == d) | (means[1] == d), TEMPERATURE)
        for day, d in zip(days, delay, strict=True)
    ]  # fmt: skip
    h, h_sd = (np.stack([part[i] for part in smooth_fir])[:, : s.order] for i in range(2))
    mean = (1.0 - SHARE) * fir + SHARE * h
    variance = (1.0 - SHARE) * (sd**2 + (fir - mean) ** 2) + SHARE * (h_sd**2 + (h - mean) ** 2)
    link = (1.0 - SHARE) * link + SHARE * np.array([part for _, part in seen])
    return probability.T, right.T, place.T, mean, np.sqrt(variance), link


def smooth_weights(found: BlindEvidence, s: PosteriorSettings) -> tuple[Floats, float]:
    """Flattened weight of each smoothness of f and place of the jump, and the probability of a jump.

    The weights have shape (lengths, candidates, shares).
    """
    prior = np.full(len(SHARES), (1.0 - s.sharp) / len(SHARES))
    prior[0] += s.sharp
    top = max(float(found.fronts.max()), float(found.nothing.max()))
    if not np.isfinite(top):
        return np.full((len(LENGTHS), *found.fronts.shape[-2:]), np.nan), 0.0
    weight = np.exp((found.fronts - top) / TEMPERATURE).mean(axis=(0, 2, 3)) * prior
    none = float(np.exp((found.nothing - top) / TEMPERATURE).mean())
    total = float(weight.sum())
    if total <= 0.0:
        return np.full_like(weight, np.nan), 0.0
    seen = total / len(LENGTHS) / weight.shape[1]
    return weight / total, seen / (seen + none)
