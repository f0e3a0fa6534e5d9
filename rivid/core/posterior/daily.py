"""p(d | y) of every day: the probability of each delay, averaged over equations, noises and fronts.

Beyond the paper. The level follows one of a few equations (:mod:`rivid.core.posterior.front`) whose noise is
one of a few kinds (:mod:`rivid.core.posterior.noise`); coefficients are profiled, the rest is averaged by its
flattened evidence (:mod:`rivid.core.posterior.fold`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core.posterior.fir import averaged_fir
from rivid.core.posterior.fold import fold, meant, weights
from rivid.core.posterior.front import log_evidence, structures
from rivid.core.posterior.noise import gram, noise_bank
from rivid.core.settings import GUARD, PosteriorSettings
from rivid.errors import RividError
from rivid.types import Bools, Floats, Strings

BLOCK = 16
"""Days worked on together; a last block that is shorter is filled up, so that every block has one shape."""

HELD = 0.9
"""Probability that a day's set of delays holds."""


@dataclass(frozen=True)
class PosteriorResult:
    """What each day says of its delay; a leading axis of days.

    Attributes
    ----------
    candidates : ndarray of int, shape (D,)
        d_min to d_max.
    probability : ndarray, shape (days, D)
        p(d | y) within the range; NaN where the data say nothing at all.
    beyond : ndarray, shape (days, 2)
        Probability below d_min and above d_max, before `probability` was made to sum to one.
    delay : ndarray, shape (days,)
        The delay of highest probability [samples]; NaN unless the status is "ok".
    right : ndarray, shape (days,)
        Probability that this delay is right: that the travel time lies in its sample or within a tenth of a
        sample of it.
    in_set : ndarray of bool, shape (days, D)
        The smallest set of delays that holds 90 %.
    place, place_low, place_high : ndarray, shape (days,)
        Travel time [samples], fraction included: median, 5 and 95 %.
    fir, fir_sd : ndarray, shape (days, M)
        Response of the level to the inflow at that delay, the outflow held where it is logged, and its
        standard deviation [output unit per m3/s].
    link : ndarray, shape (days,)
        Probability that a front of the inflow is seen at all.
    status : ndarray of str, shape (days,)
        "ok", "at_bound" (the delay lies beyond the range) or "unidentifiable".
    message : ndarray of str, shape (days,)
        Why there is no answer.
    """

    candidates: NDArray[np.intp]
    probability: Floats
    beyond: Floats
    delay: Floats
    right: Floats
    in_set: Bools
    place: Floats
    place_low: Floats
    place_high: Floats
    fir: Floats
    fir_sd: Floats
    link: Floats
    status: Strings
    message: Strings


def posterior(
    u: ArrayLike, y: ArrayLike, o: ArrayLike | None = None, settings: PosteriorSettings | None = None
) -> PosteriorResult:
    """Probability of every delay, day by day.

    Parameters
    ----------
    u : array_like, shape (days, N)
        Inflow commands [m3/s].
    y : array_like, shape (days, N)
        Level [m]. Neither its unit nor a constant matters.
    o : array_like, shape (days, N), optional
        Outflow commands [m3/s], where they are logged.
    settings : PosteriorSettings, optional

    Returns
    -------
    PosteriorResult

    Raises
    ------
    RividError
        For shapes that do not fit, values that are not finite, or days too short for d_max.
    """
    s = settings or PosteriorSettings()
    inputs, outputs, regulated = _checked(u, y, o, s)
    days = len(inputs)
    found = [
        _block(inputs[take], outputs[take], None if regulated is None else regulated[take], s)
        for take in (np.minimum(np.arange(begin, begin + BLOCK), days - 1) for begin in range(0, days, BLOCK))
    ]
    probability, right, place, fir, sd, link = (
        np.concatenate([block[i] for block in found])[:days] for i in range(6)
    )
    still = (np.ptp(inputs, axis=1) <= 0.0) | (np.ptp(outputs, axis=1) <= 0.0)
    probability[still], link[still] = np.nan, 0.0
    return _answer(s, probability, right, place, fir, sd, link, still)


def _checked(
    u: ArrayLike, y: ArrayLike, o: ArrayLike | None, s: PosteriorSettings
) -> tuple[Floats, Floats, Floats | None]:
    """Deviations from the day's first sample."""
    named = {"inflow": u, "level": y} | ({} if o is None else {"outflow": o})
    arrays = {name: np.asarray(values, float) for name, values in named.items()}
    shape = arrays["inflow"].shape
    for name, values in arrays.items():
        if values.ndim != 2 or values.shape != shape or not len(values):
            raise RividError(
                f"{name} has shape {values.shape}: expected (days, N), that of the inflow {shape}"
            )
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(bad):
            raise RividError(f"{name}: not finite on {len(bad)} days, first on row {bad[0]}: mask them")
    needed = 3 * (s.d_max + GUARD + 4)
    if shape[1] < needed:
        raise RividError(f"{shape[1]} samples a day: d_max = {s.d_max} needs {needed} or more")
    deviations = [values - values[:, :1] for values in arrays.values()]
    return deviations[0], deviations[1], None if o is None else deviations[2]


def _block(u: Floats, y: Floats, o: Floats | None, s: PosteriorSettings) -> tuple[Floats, ...]:
    """Probability and that of being right (days, candidates with guards), place, FIR, its spread, link."""
    first, last = max(s.d_min - GUARD, 0), s.d_max + GUARD
    kinds = structures(o is not None)
    stores = [kind.is_store for kind in kinds]
    G, n_rows = gram(u, y, o, noise_bank(), last + 4)
    fronts, nothing = log_evidence(G, n_rows, o is not None, first, last)
    q, link = weights(fronts, nothing, stores, s)
    probability, right, place = fold(q, stores, s, first, last)
    delay = s.d_min + np.argmax(probability[s.d_min - first : s.d_max + 1 - first], axis=0)
    means = meant(s, first, last)
    belongs = [means[0 if store else 1][..., None] == delay for store in stores]
    fir, sd = averaged_fir(
        G, n_rows, fronts, belongs, kinds, first, s.between_temperature, s.order, o is not None
    )
    return probability.T, right.T, place.T, fir, sd, link


def _answer(
    s: PosteriorSettings, p: Floats, right: Floats, place: Floats, fir: Floats, sd: Floats, link: Floats,
    still: Bools,
) -> PosteriorResult:  # fmt: skip
    """Who is answered, and why the others are not."""
    first = max(s.d_min - GUARD, 0)
    inside = slice(s.d_min - first, s.d_max + 1 - first)
    beyond = np.stack([p[:, : inside.start].sum(axis=1), p[:, inside.stop :].sum(axis=1)], axis=1)
    candidates = np.arange(s.d_min, s.d_max + 1)
    within, right = p[:, inside], right[:, inside]
    known: Bools = np.asarray(np.isfinite(p).all(axis=1))
    probability = within + 1e-300  # where all lies beyond the range, nothing tells its delays apart
    probability /= probability.sum(axis=1, keepdims=True)
    ranked = np.argsort(-np.where(known[:, None], within, 0.0), axis=1, kind="stable")
    best = ranked[:, 0]
    every = np.arange(len(p))
    sorted_p = np.take_along_axis(np.nan_to_num(probability), ranked, axis=1)
    before = np.cumsum(sorted_p, axis=1) - sorted_p
    in_set: Bools = np.zeros(probability.shape, bool)
    np.put_along_axis(in_set, ranked, before < HELD, axis=1)
    sure = right[every, best]
    outside = known & (beyond.max(axis=1) > within[every, best])
    unseen = known & ~(link >= 0.5)
    message = np.select(
        [still, ~known, unseen, outside & (beyond[:, 0] > beyond[:, 1]), outside, ~(sure >= s.answer_above)],
        [
            "inflow or level does not move",
            "the inflow moves too little",
            "no front of the inflow is seen in the level",
            "the delay lies below d_min",
            "the delay lies above d_max",
            "no delay is probable enough",
        ],
        "",
    )
    status = np.where(message == "", "ok", np.where(outside & ~unseen & ~still, "at_bound", "unidentifiable"))
    low, middle, high = place[:, 1], place[:, 0], place[:, 2]
    nothing = ~known | still
    for values in (beyond, sure, low, middle, high, fir, sd):
        values[nothing] = np.nan
    return PosteriorResult(
        candidates=candidates, probability=probability, beyond=beyond,
        delay=np.where(status == "ok", candidates[best], np.nan), right=sure, in_set=in_set & known[:, None],
        place=middle, place_low=low, place_high=high, fir=fir, fir_sd=sd, link=link, status=status,
        message=message,
    )  # fmt: skip
