"""Probability of every delay, given the other days of a season too: a hidden Markov model.

The travel time at the first day's discharge drifts from day to day on a grid, jumps now and then, and falls
as a power of the discharge; drift and power are averaged over a few values. A further model takes the days
as independent.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rivid.core.posterior.daily import smallest_set
from rivid.core.settings import Checked, Limits, Share
from rivid.errors import ConfigError, RividError
from rivid.types import Bools, Floats


@dataclass(frozen=True)
class SeasonSettings(Checked):
    """Settings of the posterior of a season.

    Chosen on simulated seasons with a delay that drifts, steps or is independent from day to day, and tested
    on others (`benchmarks/peers/seasons.py`). Drifts, and exponents, are equally likely.
    """

    # standard deviations of the travel time's drift from day to day [samples]
    drifts: Annotated[tuple[float, ...], Limits(ge=0)] = (0.03, 0.1, 0.3)
    # powers by which the travel time falls as the discharge grows; 0 alone without a discharge
    exponents: Annotated[tuple[float, ...], Limits(ge=-2, le=2)] = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4)
    jump: Share = 0.03  # probability that the travel time of a day does not depend on the day before
    trust: Annotated[float, Limits(gt=0, lt=1)] = 0.98  # that the probability of a day is right
    independent: Share = 0.3  # prior probability that the days of the season are independent
    answer_above: Share = 0.72  # smallest probability at which a day has a delay

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.drifts or not self.exponents:
            raise ConfigError("drifts and exponents: expected one value or more of each")


PARTS = 4
"""Grid points of a sample."""

COMMON = 2.0
"""Days that the even distribution counts for, before the season's own is learned."""


Days = tuple[Floats, Floats, Floats, Bools]
"""Of each day: its probabilities as given, even where they are missing, shape (days, D); the same as far as
they are trusted, the rest even; the likelihood if days are independent, shape (days,); and whether it is
observed."""


class Chain:
    """Chains of B exponents and S drifts over K grid points; `flow` is the discharge of the days [m3/s]."""

    def __init__(self, d_min: int, D: int, flow: Floats | None, days: int, s: SeasonSettings) -> None:
        K = PARTS * D
        self.d_min, self.D, self.jump = d_min, D, s.jump
        self.exponents = np.array(s.exponents if flow is not None else (0.0,), float)
        self.kernels = np.stack([drift_kernel(K, PARTS * drift) for drift in s.drifts])  # (S, K, K)
        self.edges = d_min + np.arange(K + 1) / PARTS  # between the grid points [samples], (K + 1,)
        self.log_flow = np.zeros(days) if flow is None else _log_flow(flow)  # ln(Q / Q0), (days,)
        states = len(self.exponents), len(s.drifts), K
        self.start = np.full(states, (1.0 - s.independent) / np.prod(states))  # mass on the first day
        self.alone = s.independent  # mass of independent days

    def _edges_on(self, t: int) -> Floats:
        """The edges at the discharge of a day, shape (B, K + 1) [samples]."""
        return np.asarray(self.edges * np.exp(-self.exponents * self.log_flow[t])[:, None])

    def cells(self, t: int) -> Floats:
        """Share of each grid point that lies in each delay on a day, shape (B, K, D).

        What lies outside the range counts as its nearest delay.
        """
        edges = self._edges_on(t)
        bounds = np.arange(self.d_min, self.d_min + self.D + 1, dtype=float)
        bounds[0], bounds[-1] = -np.inf, np.inf
        low, high = edges[:, :-1, None], edges[:, 1:, None]
        inside = np.minimum(high, bounds[1:]) - np.maximum(low, bounds[:-1])
        return np.asarray(np.maximum(inside, 0.0) / (high - low))

    def anew(self, t: int) -> Floats:
        """Where a jump leads, shape (B, K): evenly to all travel times of a day that lie in the range."""
        edges = self._edges_on(t)
        middle = 0.5 * (edges[:, :-1] + edges[:, 1:])
        inside = ((middle > self.d_min) & (middle < self.d_min + self.D)).astype(float)
        count = inside.sum(axis=1, keepdims=True)
        return np.asarray(np.where(count > 0.0, inside / np.maximum(count, 1.0), 1.0 / inside.shape[1]))

    def step(self, mass: Floats, t: int) -> Floats:
        """Mass before day t, from that after day t - 1, shape (B, S, K)."""
        return self._drifted(mass, mass.sum(axis=2, keepdims=True) * self.anew(t)[:, None])

    def back(self, value: Floats, t: int) -> Floats:
        """The transpose of :meth:`step`: expected value on day t, seen from each state of day t - 1."""
        return self._drifted(value, (value * self.anew(t)[:, None]).sum(axis=2, keepdims=True))

    def _drifted(self, x: Floats, drawn: Floats) -> Floats:
        """Drift, which is its own transpose, and jumps to what is drawn anew."""
        moved = np.matmul(x[:, :, None], self.kernels)[:, :, 0]
        return np.asarray((1.0 - self.jump) * moved + self.jump * drawn)


def independent_likelihood(likely: Floats, observed: NDArray[np.bool_]) -> Floats:
    """Likelihood of each day if the season's delays have one distribution and no order, shape (days,).

    That distribution is learned from the days before: otherwise a chain with a large drift would win
    only because it knows which delays occur. A day that is not observed is as likely as its even row.
    """
    n, D = likely.shape
    seen, found = np.full(D, COMMON / D), np.empty(n)
    for t in range(n):
        both = seen * likely[t] / seen.sum()
        found[t] = both.sum()
        if observed[t]:
            seen = seen + both / found[t]
    return found


def drift_kernel(K: int, sd: float) -> Floats:
    """Transition probabilities (K, K) of a continuous random walk over a day, with walls at both ends.

    ``exp(sd^2 L / 2)``, L the second difference that lets nothing through the walls: symmetric, so that an
    even distribution stays even. `sd` is the standard deviation away from the walls [points].

    Examples
    --------
    >>> k = drift_kernel(9, 0.7)
    >>> bool(np.allclose(k.sum(axis=1), 1.0)), round(float(k[4] @ (np.arange(9) - 4) ** 2), 2)
    (True, 0.49)
    """
    # the cosines are what L leaves as they are
    k, j = np.arange(K)[:, None] + 0.5, np.arange(K)
    V = np.cos(np.pi * k * j / K) * np.sqrt(np.where(j == 0, 1.0, 2.0) / K)
    decay = np.exp(0.5 * sd**2 * (2.0 * np.cos(np.pi * j / K) - 2.0))
    return np.asarray(np.maximum((V * decay) @ V.T, 0.0))


def _log_flow(flow: Floats) -> Floats:
    """ln(Q / Q0), the last one known where one is missing; Q0 is the first."""
    known = np.flatnonzero(np.isfinite(flow))
    if not len(known):
        return np.zeros(len(flow))
    latest = np.maximum.accumulate(np.where(np.isfinite(flow), np.arange(len(flow)), known[0]))
    return np.asarray(np.log(flow[latest] / flow[known[0]]))


@dataclass(frozen=True)
class SeasonResult:
    """Probabilities of the delay, given other days; a leading axis of days."""

    candidates: NDArray[np.intp]  # the delays [samples], (D,)
    probability: Floats  # p(d | days up to this one), or with `both_ways` p(d | all days), (days, D)
    delay: Floats  # of highest probability [samples], NaN where that is below `answer_above`, (days,)
    sure: Floats  # the highest probability, (days,)
    in_set: Bools  # the smallest set of delays that holds 90 %, (days, D)
    observed: Bools  # the day had a probability of its own, (days,)
    independent: Floats  # probability that the days are independent, (days,)


_Belief = tuple[Floats, float]
"""Unnormalised masses: of the chains, shape (B, S, K), and of independent days."""


def season(
    probability: ArrayLike, link: ArrayLike | None = None, discharge: ArrayLike | None = None, *,
    d_min: int = 1, both_ways: bool = False, settings: SeasonSettings | None = None,
) -> SeasonResult:  # fmt: skip
    """Probability of every delay on every day, given the other days too.

    `probability`, shape (days, D), is p(d | y) of each calendar day for the delays from `d_min` on, made with
    an even prior: the day's likelihood; NaN on a day that is missing or has no information. `link`, shape
    (days,), is the probability that a front is seen at all. `discharge`, shape (days,), is the day's [m3/s];
    where it is NaN the last one known holds. Without `both_ways` only the days before a day count, so that no
    result changes when later days come. RividError for shapes that do not fit, or values that are no
    probabilities or no discharges.

    Source: L. R. Rabiner, "A tutorial on hidden Markov models", Proc. IEEE 77 (1989), 257-286, (18)-(27).

    Examples
    --------
    >>> vague = [0.5, 0.3, 0.2]
    >>> days = season([[0.8, 0.1, 0.1], vague, vague, [np.nan] * 3], d_min=4)
    >>> days.candidates.tolist(), days.observed.tolist()
    ([4, 5, 6], [True, True, True, False])
    >>> bool(days.probability[2, 0] > 0.5)
    True
    """
    s = settings or SeasonSettings()
    days, chain = _checked(probability, link, discharge, d_min, s)
    answers, independent, before = _forward(days, chain)
    if both_ways:
        answers, independent = _backward(days, chain, before)
    p = answers / answers.sum(axis=1, keepdims=True)
    candidates, sure = np.arange(d_min, d_min + chain.D), p.max(axis=1)
    delay = np.where(sure >= s.answer_above, candidates[np.argmax(p, axis=1)], np.nan)
    return SeasonResult(candidates, p, delay, sure, smallest_set(p, p), days[3], independent)


def _checked(
    probability: ArrayLike, link: ArrayLike | None, discharge: ArrayLike | None, d_min: int, s: SeasonSettings
) -> tuple[Days, Chain]:
    p = np.asarray(probability, float)
    if p.ndim != 2 or not p.size:
        raise RividError(f"probability has shape {p.shape}: expected (days, D), a row for each day")
    if d_min < 0:
        raise RividError(f"d_min = {d_min}: expected 0 or more (samples)")
    n, D = p.shape
    observed: Bools = np.asarray(np.isfinite(p).all(axis=1))
    rows = np.where(observed[:, None], p, 1.0 / D)
    wrong = np.flatnonzero((rows < 0.0).any(axis=1) | (np.abs(rows.sum(axis=1) - 1.0) > 1e-6))
    if len(wrong):
        raise RividError(
            f"probability of row {wrong[0]} is no distribution: expected 0 or more, sum 1, or NaN"
        )
    trust = np.full(n, s.trust)
    if link is not None:
        seen = np.asarray(link, float)
        if seen.shape != (n,):
            raise RividError(f"link has shape {seen.shape}: expected ({n},), a value for each row")
        if ((seen < 0.0) | (seen > 1.0)).any():
            raise RividError(f"link goes from {np.nanmin(seen):g} to {np.nanmax(seen):g}: expected 0 to 1")
        trust *= np.where(np.isfinite(seen), seen, 0.0)
    trust[~observed] = 0.0
    flow = None
    if discharge is not None:
        flow = np.asarray(discharge, float)
        if flow.shape != (n,):
            raise RividError(f"discharge has shape {flow.shape}: expected ({n},), a value for each row")
        if (flow <= 0.0).any() or np.isinf(flow).any():
            raise RividError(f"discharge goes down to {np.nanmin(flow):g} m3/s: expected it positive, or NaN")
    likely = trust[:, None] * rows + (1.0 - trust[:, None]) / D
    days = rows, likely, independent_likelihood(likely, observed), observed
    return days, Chain(d_min, D, flow, n, s)


def _forward(days: Days, chain: Chain) -> tuple[Floats, Floats, list[_Belief]]:
    """Filter: p(d | days up to this one), that of independent days, and the masses before each day."""
    mass, alone = chain.start, chain.alone
    answers, independent, beliefs = np.empty(days[0].shape), np.empty(len(days[0])), []
    for t, (own, likely, alike, _) in enumerate(zip(*days, strict=True)):
        if t:
            mass = chain.step(mass, t)
        beliefs.append((mass, alone))
        share = chain.cells(t)
        answers[t] = np.einsum("bsk,bkd->d", mass, share) * likely + alone * alike * own
        mass, alone = mass * (share @ likely)[:, None], alone * alike
        independent[t] = _part_alone(mass, alone)
        total = mass.sum() + alone
        mass, alone = mass / total, alone / total
    return answers, independent, beliefs


def _backward(days: Days, chain: Chain, before: list[_Belief]) -> tuple[Floats, Floats]:
    """Smoother: p(d | all days), and that of independent days."""
    own, likely, alike, _ = days
    answers, independent = np.empty(own.shape), np.empty(len(own))
    after, after_alone = np.ones_like(chain.start), 1.0
    for t in range(len(own) - 1, -1, -1):
        share = chain.cells(t)
        seen = (share @ likely[t])[:, None]
        mass, alone = before[t][0] * after, before[t][1] * after_alone
        answers[t] = np.einsum("bsk,bkd->d", mass, share) * likely[t] + alone * alike[t] * own[t]
        independent[t] = _part_alone(mass * seen, alone * alike[t])
        if t:
            after = chain.back(after * seen, t)
            after_alone *= alike[t]
            top = max(float(after.max()), after_alone)
            after, after_alone = after / top, after_alone / top
    return answers, independent


def _part_alone(mass: Floats, alone: float) -> float:
    """Share of independent days in the mass after a day."""
    return alone / (alone + float(mass.sum(axis=2).sum()))
