"""p(d | y) of every day: the probability of each delay, averaged over equations, noises and fronts.

Beyond the paper. The level follows one of a few equations (:mod:`rivid.core.posterior.front`) with one of a
few kinds of noise (:mod:`rivid.core.posterior.noise`); coefficients are profiled, the rest is averaged with
flattened evidence as weights.

In a store the place of the front is the travel time. A wave moves the level as it passes, which takes it the
time of the gate's motion and longer the further friction has flattened it. Where it has passed before the
next sample, that sample holds it whole, and the place is the sampling instant before the arrival; else the
place follows the part of it that has yet to pass. No day shows how long its wave takes: the probability of a
travel time is averaged over the times that a gate may need. A store behind a stilling well follows the
equations of a wave too, with the place of a store.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core.fir import as_days
from rivid.core.posterior.front import LAG_TAPS, LAGS, SHARES, Fronts, averaged_fir, log_evidence, structures
from rivid.core.posterior.noise import gram, noise_bank
from rivid.core.settings import GUARD, PosteriorSettings
from rivid.types import Bools, Floats, Ints, Strings

BLOCK = 16
"""Days worked on together; a last block that is shorter is filled up, so that every block has one shape."""

HELD = 0.9
"""Probability of a day's set of delays."""

STEPS = 10
"""Places in one sample at which the travel time's distribution is kept."""

TOLERANCE = 1.0 / STEPS
"""So close to the edge between two delays [samples], both are right."""

GATES = (np.arange(8) + 0.5) / 8.0
"""Times that a gate may need, as shares of `wave_gate`."""

FINE = 2
"""Travel times per step at which the probability of a wave's place is computed."""


def weights(
    fronts: list[Floats], nothing: list[Floats], stores: list[bool], s: PosteriorSettings
) -> tuple[list[Floats], Floats]:
    """Flattened evidence of each equation, and the probability that there is a front, shape (days,).

    `fronts` and `nothing` are those of :func:`rivid.core.posterior.front.log_evidence`; `stores` marks the
    equations that are stores. The weights have shape (candidates, shares, days) and sum to one over all
    equations of a day; NaN where nothing moves.
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


def half_time(fronts: list[Floats], s: PosteriorSettings) -> Floats:
    """Mean time in which the lag of the gauge shows half of a step [samples], shape (days,).

    `fronts` are those of :func:`rivid.core.posterior.front.log_evidence` with lags, weighted as in
    :func:`weights`: a lag of first order with time constant T shows half after T ln 2.
    """
    top = np.max([f.max(axis=(0, 1, 2)) for f in fronts], axis=0)
    with np.errstate(invalid="ignore"):
        mass = [np.exp((f - top) / s.between_temperature).sum(axis=(1, 2)) for f in fronts]
        total = np.sum([m.sum(axis=0) for m in mass], axis=0)
        lagged = np.sum([m[-len(LAGS) :] for m in mass[1:]], axis=0) / total
    return np.asarray(np.log(2.0) * (np.array(LAGS) @ lagged), float)


def wave_place(travel: Floats, gate: float, s: PosteriorSettings) -> Floats:
    """Place of the front [samples] of a wave with this travel time, from a gate that needs `gate` [samples];
    it never falls."""
    end = np.floor(travel) + 1.0
    passing = np.clip(gate + s.wave_lag * travel, 1e-9, 1.0)
    return end - np.minimum((end - travel) / passing, 1.0)


def candidates_of(s: PosteriorSettings) -> tuple[int, int]:
    """First and last delay computed [samples]: the range and :data:`GUARD` beyond each edge."""
    return max(s.d_min - GUARD, 0), s.d_max + GUARD


def places(s: PosteriorSettings) -> Floats:
    """Places of the front [samples] of the candidates, shape (candidates, shares)."""
    first, last = candidates_of(s)
    return np.arange(first, last + 1)[:, None] + 1.0 - SHARES


def meant(s: PosteriorSettings) -> Floats:
    """The delay of each place of the front, shape (candidates, shares)."""
    return np.floor(places(s) + 1e-9)


@lru_cache(maxsize=8)
def _kernel(s: PosteriorSettings) -> Floats:
    """Distribution function of the travel time for each place, shape (2, candidates * shares, edges): at
    steps of a sample, then a tolerance before and behind each whole sample."""
    first, last = candidates_of(s)
    whole = np.arange(first, last + 2, dtype=float)
    steps = np.arange(first * STEPS, (last + 1) * STEPS + 1) / STEPS
    edges = np.concatenate([steps, whole - TOLERANCE, whole + TOLERANCE])
    x = places(s).reshape(-1, 1)
    store = _logistic((edges - x) / s.store_error)
    store[:, edges <= first], store[:, edges >= last + 1] = 0.0, 1.0  # what lies outside counts there
    travel = first + (np.arange((len(steps) - 1) * FINE) + 0.5) / (STEPS * FINE)
    likely = np.zeros((len(x), len(travel)))
    seen = [((1.0 - s.wave_store) / len(GATES), wave_place(travel, g, s)) for g in s.wave_gate * GATES]
    for share, place in [(s.wave_store, travel), *seen]:
        below = _logistic((place - x) / s.wave_error)
        likely += share * below * (1.0 - below)
    up_to = np.cumsum(likely, axis=1)[:, FINE - 1 :: FINE]
    wave = np.pad(up_to / up_to[:, -1:], [(0, 0), (1, 0)])  # from an even prior, by Bayes
    at = np.rint((edges - first) * STEPS).astype(int)
    return np.stack([store, wave[:, np.clip(at, 0, len(steps) - 1)]])


def _logistic(x: Floats) -> Floats:
    return 1.0 / (1.0 + np.exp(-np.clip(x, -50.0, 50.0)))


def fold(q: list[Floats], stores: list[bool], s: PosteriorSettings) -> tuple[Floats, Floats, Floats]:
    """Distribution of the travel time from the weights of the fronts (:func:`weights`).

    Returns the probability that it lies in [d, d + 1), the same within a tenth of a sample more (d is right),
    both of shape (candidates, days), and its median, 5 and 95 % [samples], shape (3, days).
    """
    first, last = candidates_of(s)
    days = q[0].shape[-1]
    both = np.zeros((days, 2, 1, q[0].shape[0] * q[0].shape[1]))
    for part, store in zip(q, stores, strict=True):
        both[:, 0 if store else 1, 0] += part.reshape(-1, days).T
    # one product of a fixed size for each day: a day's bits do not depend on its neighbours
    F = np.matmul(both, _kernel(s)).sum(axis=(1, 2)).T
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


@dataclass(frozen=True)
class PosteriorResult:
    """Probabilities of the delay, with a leading axis of days."""

    candidates: NDArray[np.intp]  # d_min to d_max, (D,)
    probability: Floats  # p(d | y) within the range; NaN where the data have no information, (days, D)
    beyond: Floats  # probability below d_min and above d_max, before the others were made to sum to one
    delay: Floats  # of highest probability [samples]; NaN unless the status is "ok"
    right: Floats  # probability that the travel time lies in its sample or within a tenth of it
    in_set: Bools  # the smallest set of delays that holds 90 %, (days, D)
    place: Floats  # median travel time [samples], fraction included
    place_low: Floats  # 5 %
    place_high: Floats  # 95 %
    half: Floats  # median with the half time of the gauge lag, NaN without outflow; t50 of a river
    fir: Floats  # response of the level to the inflow at that delay [output unit per m3/s], (days, M)
    fir_sd: Floats  # its standard deviation
    link: Floats  # probability that the level follows the inflow at all
    status: Strings  # "ok", "at_bound" (the delay lies beyond the range) or "unidentifiable"
    message: Strings  # why there is no delay


def posterior(
    u: ArrayLike, y: ArrayLike, o: ArrayLike | None = None, settings: PosteriorSettings | None = None
) -> PosteriorResult:
    """Probability of every delay, day by day.

    `u` and `y`, both (days, N), are the inflow commands [m3/s] and the level [m], of which neither the unit
    nor a constant matters; `o` are the outflow commands [m3/s], where they are logged. RividError for shapes
    that do not fit, values that are not finite, or days too short for d_max.
    """
    s = settings or PosteriorSettings()
    return in_blocks({"inflow": u, "level": y, "outflow": o}, 3 * (s.d_max + GUARD + 4), s, _block)


Block = Callable[[Floats, Floats, Floats | None, PosteriorSettings], tuple[Floats, ...]]
"""Probability and that of being right (days, candidates with guards), place, FIR, its spread, link."""


def in_blocks(
    series: dict[str, ArrayLike | None], least: int, s: PosteriorSettings, block: Block
) -> PosteriorResult:
    """Check the series, apply `block` to :data:`BLOCK` days at a time, and condense what it returns.

    A day without a delay has the reason.
    """
    arrays, _ = as_days(series, least, f"d_max = {s.d_max}, order = {s.order}", one=False)
    u, y, *rest = (values - values[:, :1] for values in arrays)
    o, n = rest[0] if rest else None, len(u)
    found = [
        block(u[take], y[take], None if o is None else o[take], s)
        for take in (np.minimum(np.arange(begin, begin + BLOCK), n - 1) for begin in range(0, n, BLOCK))
    ]
    p, right, place, fir, sd, link = (np.concatenate(parts)[:n] for parts in zip(*found, strict=True))
    still = (np.ptp(u, axis=1) <= 0.0) | (np.ptp(y, axis=1) <= 0.0)
    p[still], link[still] = np.nan, 0.0

    inside = slice(s.d_min - candidates_of(s)[0], s.d_max + 1 - candidates_of(s)[0])
    beyond = np.stack([p[:, : inside.start].sum(axis=1), p[:, inside.stop :].sum(axis=1)], axis=1)
    candidates = np.arange(s.d_min, s.d_max + 1)
    known: Bools = np.asarray(np.isfinite(p).all(axis=1))
    probability = normalised(p[:, inside])
    certain = np.where(known[:, None], p[:, inside], 0.0)
    best, every = np.argmax(certain, axis=1), np.arange(n)
    sure = right[:, inside][every, best]
    outside = known & (beyond.max(axis=1) > certain[every, best])
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
    status = np.where(message == "", "ok", np.where(outside & ~unseen, "at_bound", "unidentifiable"))
    for values in (beyond, sure, place, fir, sd):
        values[~known] = np.nan
    middle, low, high, *half = place.T
    return PosteriorResult(
        candidates=candidates, probability=probability, beyond=beyond,
        delay=np.where(status == "ok", candidates[best], np.nan), right=sure,
        in_set=smallest_set(certain, probability) & known[:, None], place=middle, place_low=low,
        place_high=high, half=half[0] if half else np.full(n, np.nan), fir=fir, fir_sd=sd, link=link,
        status=status, message=message,
    )  # fmt: skip


def _block(u: Floats, y: Floats, o: Floats | None, s: PosteriorSettings) -> tuple[Floats, ...]:
    """The equations of :func:`structures` alone."""
    fronts, q, stores, link = weighted_fronts(u, y, o, s)
    probability, right, place = fold(q, stores, s)
    if o is not None:
        place = np.vstack([place, place[0] + half_time(fronts[2], s)])
    fir, sd = fir_of(fronts, likeliest(probability, s), s)
    return probability.T, right.T, place.T, fir, sd, link


def weighted_fronts(
    u: Floats, y: Floats, o: Floats | None, s: PosteriorSettings
) -> tuple[Fronts, list[Floats], list[bool], Floats]:
    """Fronts, their weights (:func:`weights`), which equations are stores, and the probability of a front."""
    first, last = candidates_of(s)
    stores = [kind.is_store for kind in structures(o is not None)]
    more = LAG_TAPS - 1 if o is not None else 0  # only the outflow shows a lag of the gauge
    G, n_rows = gram(u, y, o, noise_bank(), last + 4, more)
    evidence, nothing = log_evidence(G, n_rows, o is not None, first, last, more)
    q, link = weights(evidence, nothing, stores, s)
    return (G, n_rows, evidence, o is not None), q, stores, link


def likeliest(probability: Floats, s: PosteriorSettings) -> Ints:
    """Delay of highest probability within the range [samples], shape (days,)."""
    first, _ = candidates_of(s)
    inside = probability[s.d_min - first : s.d_max + 1 - first]
    return np.asarray(s.d_min + np.argmax(inside, axis=0), np.int64)


def fir_of(fronts: Fronts, delay: Ints, s: PosteriorSettings) -> tuple[Floats, Floats]:
    """Mean and standard deviation of h (days, M) at the delay of each day."""
    belongs = meant(s)[..., None] == delay
    return averaged_fir(fronts, belongs, candidates_of(s)[0], s.between_temperature, s.order)


def smallest_set(values: Floats, probability: Floats) -> Bools:
    """The fewest delays of each row, by falling `values`, that hold a probability of :data:`HELD`."""
    ranked = np.argsort(-values, axis=1, kind="stable")
    falling = np.take_along_axis(np.nan_to_num(probability), ranked, axis=1)
    in_set: Bools = np.zeros(probability.shape, bool)
    np.put_along_axis(in_set, ranked, np.cumsum(falling, axis=1) - falling < HELD, axis=1)
    return in_set


def normalised(within: Floats) -> Floats:
    """Rows that sum to one, also where all of a row's probability lies beyond the range."""
    probability = within + 1e-300
    return np.asarray(probability / probability.sum(axis=1, keepdims=True), float)
