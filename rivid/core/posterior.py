"""p(d | y) of every day: the probability of each delay, averaged over equations, noises and places of a front.

Beyond the paper. The level follows one of a few equations (:func:`rivid.core.posterior_front.structures`)
whose noise is one of a few kinds (:func:`rivid.core.posterior_noise.noise_bank`); coefficients are profiled,
the rest is averaged by evidence. The evidence is flattened before it is averaged: no equation is the truth,
and days of samples make the least wrong of them look far surer than it is.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core.posterior_fir import MODELS, averaged_fir
from rivid.core.posterior_front import SHARES, Structure, log_evidence, structures
from rivid.core.posterior_gram import gram
from rivid.core.posterior_noise import noise_bank
from rivid.errors import ConfigError, RividError

Floats = NDArray[np.float64]
Strings = NDArray[np.str_]

BLOCK = 16
"""Days whose matrices are worked on together."""

GUARD = 2
"""Candidates beyond each edge of the range: what lies there is no answer, but a reason not to give one."""

STEPS = 20
"""Places in one sample at which the fractional delay's distribution is kept."""


@dataclass(frozen=True)
class PosteriorSettings:
    """How the probability of the delay is made.

    Parameters
    ----------
    d_min, d_max : int
        The delays that can be answered [samples], ``1 <= d_min <= d_max``.
    order : int
        Length M of the FIR that is given [samples].
    temperature : float
        The log evidence is divided by it before models are averaged.
    sharp : float
        Prior share of fronts that lie at a sampling instant, between 0 and 1.
    wave_lead : float
        How far a front that is a jump of the level is seen before it arrives [samples]: the sample after
        the arrival holds it whole.
    wave_lag : float
        Share of the travel time by which such a front is blunted and late.
    edge_store, edge_wave : float
        Scale of the logistic error of a front's place [samples], for the two kinds of equation.
    answer_above : float
        Least probability of an answer.
    """

    d_min: int = 1
    d_max: int = 15
    order: int = 30
    temperature: float = 1.5
    sharp: float = 0.5
    wave_lead: float = 0.5
    wave_lag: float = 0.034
    edge_store: float = 0.05
    edge_wave: float = 0.07
    answer_above: float = 0.5

    def __post_init__(self) -> None:
        if not 1 <= self.d_min <= self.d_max:
            raise ConfigError(
                f"d_min = {self.d_min} and d_max = {self.d_max}: expected 1 <= d_min <= d_max (samples)"
            )
        if self.order <= self.d_max:
            raise ConfigError(
                f"order = {self.order} ends before the front of d_max = {self.d_max}: raise order"
                " or lower d_max"
            )
        for name in ("temperature", "edge_store", "edge_wave"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a positive number")
        for name in ("sharp", "answer_above"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a share, 0 to 1")


@dataclass(frozen=True)
class PosteriorResult:
    """What each day says of its delay; a leading axis of days.

    Attributes
    ----------
    candidates : ndarray of int, shape (D,)
        d_min to d_max.
    probability : ndarray, shape (days, D)
        p(d | y) within the range; NaN where nothing could be computed.
    beyond : ndarray, shape (days, 2)
        Probability below d_min and above d_max, before `probability` was made to sum to one.
    delay : ndarray, shape (days,)
        The delay of highest probability [samples]; NaN unless the status is "ok".
    in_set : ndarray of bool, shape (days, D)
        The smallest set of delays that holds 90 %.
    place, place_low, place_high : ndarray, shape (days,)
        Travel time in samples, fraction included: median, 5 and 95 %.
    fir, fir_sd : ndarray, shape (days, M)
        Response of the level to the inflow at that delay, the outflow held where it is logged, and its
        standard deviation [output unit per m3/s].
    link : ndarray, shape (days,)
        Probability that the inflow is seen at all.
    status : ndarray of str, shape (days,)
        "ok", "at_bound" (the delay lies beyond the range) or "unidentifiable".
    message : ndarray of str, shape (days,)
        Why there is no answer.
    """

    candidates: NDArray[np.intp]
    probability: Floats
    beyond: Floats
    delay: Floats
    in_set: NDArray[np.bool_]
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
        Level [m]. Constants do not matter, nor does the unit.
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
    first, last = max(s.d_min - GUARD, 0), s.d_max + GUARD
    bank, kinds = noise_bank(), structures(regulated is not None)
    D = s.d_max - s.d_min + 1
    probability, beyond, link = np.full((days, D), np.nan), np.full((days, 2), np.nan), np.zeros(days)
    places = np.full((3, days), np.nan)
    fir, sd = np.full((days, s.order), np.nan), np.full((days, s.order), np.nan)
    for begin in range(0, days, BLOCK):
        here = slice(begin, min(begin + BLOCK, days))
        out = None if regulated is None else regulated[here]
        G, n_rows = gram(inputs[here], outputs[here], out, bank, last + 4)
        fronts, nothing = log_evidence(G, n_rows, out is not None, first, last)
        q, link[here] = _weights(fronts, nothing, s)
        p, places[:, here] = _fold(q, s, first, last)
        beyond[here, 0], beyond[here, 1] = p[: s.d_min - first].sum(0), p[s.d_max + 1 - first :].sum(0)
        inside = p[s.d_min - first : s.d_max + 1 - first]
        with np.errstate(invalid="ignore", divide="ignore"):
            probability[here] = (inside / inside.sum(axis=0)).T
        for i in range(here.stop - here.start):
            if np.isfinite(probability[begin + i]).all():
                best = s.d_min + int(np.argmax(probability[begin + i]))
                fir[begin + i], sd[begin + i] = _response(
                    G[..., i], [f[..., i] for f in fronts], best, first, kinds, n_rows, s
                )
    return _answer(s, probability, beyond, places, fir, sd, link, inputs, outputs)


def _checked(
    u: ArrayLike, y: ArrayLike, o: ArrayLike | None, s: PosteriorSettings
) -> tuple[Floats, Floats, Floats | None]:
    """Deviations from the day's first sample."""
    arrays = [np.asarray(a, float) for a in (u, y)] + ([] if o is None else [np.asarray(o, float)])
    if arrays[0].ndim != 2 or any(a.shape != arrays[0].shape for a in arrays):
        shapes = ", ".join(str(a.shape) for a in arrays)
        raise RividError(f"inflow, level and outflow have shapes {shapes}: expected the same, (days, N)")
    needed = 2 * (s.d_max + GUARD + 4) + 10
    if arrays[0].shape[1] < needed:
        raise RividError(f"{arrays[0].shape[1]} samples a day: d_max = {s.d_max} needs {needed} or more")
    for name, a in zip(("inflow", "level", "outflow"), arrays, strict=False):
        bad = np.flatnonzero(~np.isfinite(a).all(axis=1))
        if len(bad):
            raise RividError(f"{name}: not finite on {len(bad)} days, first on row {bad[0]}: mask them")
    arrays = [a - a[:, :1] for a in arrays]
    return arrays[0], arrays[1], arrays[2] if o is not None else None


def _weights(fronts: list[Floats], nothing: list[Floats], s: PosteriorSettings) -> tuple[Floats, Floats]:
    """Flattened evidence over structures, candidates and shares, summing to one, and that of a link."""
    top = np.max([f.max(axis=(0, 1, 2)) for f in fronts] + [z.max(axis=0) for z in nothing], axis=0)
    with np.errstate(invalid="ignore"):
        e = np.stack([np.exp((f - top) / s.temperature).sum(axis=0) for f in fronts])
        z = np.sum([np.exp((f - top) / s.temperature).sum(axis=0) for f in nothing], axis=0)
    even = np.full(len(SHARES), 1.0 / len(SHARES))
    share = (1.0 - s.sharp) * even
    share[0] += s.sharp
    e *= np.array([share, share, even, even])[:, None, :, None]
    total = e.sum(axis=(0, 1, 2))
    with np.errstate(invalid="ignore", divide="ignore"):
        seen = total / e.shape[1] / (total / e.shape[1] + z)
        return e / total, np.where(np.isfinite(seen), seen, 0.0)


@lru_cache(maxsize=8)
def _kernel(s: PosteriorSettings, first: int, last: int) -> Floats:
    """Where each candidate's travel time lies: distribution function at steps of a sample, shape
    (2, candidates, shares, edges); first for the store's equations, then for waves."""
    x = np.arange(first, last + 1)[:, None] + 1.0 - SHARES
    edges = np.arange(first * STEPS, (last + 1) * STEPS + 1) / STEPS
    centre = np.stack([x, (x + s.wave_lead) / (1.0 + s.wave_lag)])
    width = np.array([s.edge_store, s.edge_wave])[:, None, None, None]
    cdf = 1.0 / (1.0 + np.exp(-np.clip((edges - centre[..., None]) / width, -50, 50)))
    cdf[..., 0], cdf[..., -1] = 0.0, 1.0  # what lies beyond the last candidate is counted there
    return cdf


def _fold(q: Floats, s: PosteriorSettings, first: int, last: int) -> tuple[Floats, Floats]:
    """Probability of the whole delays, shape (candidates, days), and 50, 5 and 95 % of the travel time."""
    cdf = _kernel(s, first, last)
    F = np.einsum("cwb,cwe->eb", q[0] + q[1], cdf[1]) + np.einsum("cwb,cwe->eb", q[2] + q[3], cdf[0])
    p = np.diff(F[::STEPS], axis=0)
    levels = (0.5, 0.05, 0.95)
    at = np.array([np.argmax(level <= F, axis=0) for level in levels])
    days = np.arange(F.shape[1])
    with np.errstate(invalid="ignore", divide="ignore"):
        below = F[np.maximum(at - 1, 0), days]
        part = (np.array(levels)[:, None] - below) / (F[at, days] - below)
    return p, np.where(np.isfinite(part), first + (at - 1 + part) / STEPS, np.nan)


def _response(
    G: Floats,
    fronts: list[Floats],
    best: int,
    first: int,
    kinds: tuple[Structure, ...],
    n_rows: int,
    s: PosteriorSettings,
) -> tuple[Floats, Floats]:
    """The FIR of a day from the models of greatest weight whose front belongs to the delay."""
    flat: list[tuple[float, tuple[int, int, int, int]]] = []
    for which, f in enumerate(fronts):
        low = max(best - first - (which < 2), 0)
        part = f[:, low : best - first + 1]
        order = np.argsort(part, axis=None)[::-1][:MODELS]
        for k in order:
            noise, d, w = np.unravel_index(k, part.shape)
            start = kinds[which].noises.start or 0
            flat.append((float(part[noise, d, w]), (which, int(noise) + start, int(d) + low + first, int(w))))
    flat = sorted((m for m in flat if np.isfinite(m[0])), reverse=True)[:MODELS]
    logs = np.array([m[0] for m in flat])
    weights = np.exp((logs - logs.max()) / s.temperature)
    return averaged_fir(G, weights, [m[1] for m in flat], kinds, kinds[2].parameters == 4, n_rows, s.order)


def _answer(
    s: PosteriorSettings,
    p: Floats,
    beyond: Floats,
    places: Floats,
    fir: Floats,
    sd: Floats,
    link: Floats,
    u: Floats,
    y: Floats,
) -> PosteriorResult:
    """Who answers, and why the others do not."""
    candidates = np.arange(s.d_min, s.d_max + 1)
    known = np.isfinite(p).all(axis=1)
    safe = np.where(known[:, None], p, 1.0 / len(candidates))
    order = np.argsort(-safe, axis=1, kind="stable")
    ranked = np.take_along_axis(safe, order, axis=1)
    member = np.cumsum(ranked, axis=1) - ranked < 0.9
    in_set = np.zeros_like(member)
    np.put_along_axis(in_set, order, member, axis=1)
    best = candidates[order[:, 0]].astype(float)
    highest = ranked[:, 0] * (1.0 - np.nan_to_num(beyond).sum(axis=1))
    outside = np.nan_to_num(beyond).max(axis=1) >= highest
    still = (np.ptp(u, axis=1) <= 0.0) | (np.ptp(y, axis=1) <= 0.0)
    vague = highest < s.answer_above
    message = np.select(
        [still, ~known, link < 0.5, outside, vague],
        ["inflow or level does not move", "inflow moves too little", "no front of the inflow is seen",
         "the delay lies beyond the range", "no delay is probable enough"], "",
    )  # fmt: skip
    refused = message != ""
    status = np.where(
        ~refused, "ok", np.where(known & outside & (link >= 0.5) & ~still, "at_bound", "unidentifiable")
    )
    return PosteriorResult(
        candidates=candidates, probability=p, beyond=beyond, delay=np.where(refused, np.nan, best),
        in_set=in_set & known[:, None], place=places[0], place_low=places[1], place_high=places[2],
        fir=fir, fir_sd=sd, link=link, status=status, message=message,
    )  # fmt: skip
