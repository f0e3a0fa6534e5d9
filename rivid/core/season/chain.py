"""The hidden Markov chain of a season's travel time: its grid, its steps, and the delays it stands for.

The state is x0, the travel time at the discharge of the first day that has one, on a grid of a fraction of a
sample. The day's travel time is ``x = x0 (Q / Q0)^-b``; its delay is the sample in which x lies.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rivid.core.season.settings import SeasonSettings

Floats = NDArray[np.float64]

PARTS = 4
"""Grid points of a sample."""

COMMON = 2.0
"""Days that the even distribution counts for, before the season's own is learned."""


class Days(NamedTuple):
    """What each day says.

    Attributes
    ----------
    own : ndarray, shape (days, D)
        Its probability as given; even where it is missing.
    likely : ndarray, shape (days, D)
        The same as far as it is trusted, the rest even; rows sum to one.
    alike : ndarray, shape (days,)
        How likely it was where days have nothing to do with their neighbours: :func:`foretold_alike`.
    observed : ndarray of bool, shape (days,)
    """

    own: Floats
    likely: Floats
    alike: Floats
    observed: NDArray[np.bool_]


@dataclass(frozen=True)
class Chain:
    """Chains of B exponents and S drifts over K grid points.

    Attributes
    ----------
    exponents, drifts : ndarray, shape (B,), (S,)
    kernels : ndarray, shape (S, K, K)
        Chance to drift from one grid point to another; symmetric.
    jump : float
        Chance that a day's travel time is drawn anew.
    edges : ndarray, shape (K + 1,)
        Between the grid points [samples].
    d_min, D : int
    log_flow : ndarray, shape (days,)
        ln(Q / Q0); zero where none is known yet.
    start : ndarray, shape (B, S, K)
        Mass on the first day.
    alone : float
        Mass of independent days.
    """

    exponents: Floats
    drifts: Floats
    kernels: Floats
    jump: float
    edges: Floats
    d_min: int
    D: int
    log_flow: Floats
    start: Floats
    alone: float

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
        """Mass before day t speaks, from that after day t - 1, shape (B, S, K)."""
        moved = np.matmul(mass[:, :, None], self.kernels)[:, :, 0]
        drawn = mass.sum(axis=2, keepdims=True) * self.anew(t)[:, None]
        return np.asarray((1.0 - self.jump) * moved + self.jump * drawn)

    def back(self, value: Floats, t: int) -> Floats:
        """The transpose of :meth:`step`: expected value on day t, seen from each state of day t - 1."""
        moved = np.matmul(value[:, :, None], self.kernels)[:, :, 0]
        drawn = (value * self.anew(t)[:, None]).sum(axis=2, keepdims=True)
        return np.asarray((1.0 - self.jump) * moved + self.jump * drawn)


def chain_of(d_min: int, D: int, flow: Floats | None, days: int, s: SeasonSettings) -> Chain:
    """The chain of a season; `flow` is the discharge of its days [m3/s], shape (days,), or None."""
    K = PARTS * D
    drifts = np.array(s.drifts, float)
    exponents = np.array(s.exponents if flow is not None else (0.0,), float)
    edges = d_min + np.arange(K + 1) / PARTS
    start = np.full(
        (len(exponents), len(drifts), K), (1.0 - s.independent) / (len(exponents) * len(drifts) * K)
    )
    kernels = np.stack([drift_kernel(K, PARTS * drift) for drift in s.drifts])
    log_flow = np.zeros(days) if flow is None else _log_flow(flow)
    return Chain(exponents, drifts, kernels, s.jump, edges, d_min, D, log_flow, start, s.independent)


def foretold_alike(likely: Floats, observed: NDArray[np.bool_]) -> Floats:
    """How likely each day was, had the season's delays one distribution and no order, shape (days,).

    That distribution is learned from the days before: else a chain that wanders widely would be believed
    for no more than knowing which delays occur. A day that is not observed is as likely as its even row.
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
    """Chances of a random walk that never rests, after a day, on K points with walls at both ends.

    Parameters
    ----------
    K : int
    sd : float
        Standard deviation away from the walls [points].

    Returns
    -------
    ndarray, shape (K, K)
        ``exp(sd^2 L / 2)``, L the second difference that lets nothing through the walls: symmetric, so that
        an even distribution stays even.

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
