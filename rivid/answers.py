"""What an estimator is given and what it says: arrays of days in, arrays of days out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Days:
    """Data sets of one length, as deviations from their first samples.

    Attributes
    ----------
    u : ndarray, shape (days, N)
        Inflow [m3/s].
    y : ndarray, shape (days, N)
        Output [m for a level, m3/s for a discharge].
    o : ndarray, shape (days, N), or None
        Outflow [m3/s]; None where it is not logged.
    base : ndarray, shape (days,), or None
        Inflow at the first sample [m3/s]: high water is faster.
    """

    u: Floats
    y: Floats
    o: Floats | None = None
    base: Floats | None = None

    @classmethod
    def of(cls, inflow: Floats, output: Floats, outflow: Floats | None, min_motion: float) -> "Days":
        """Days as they were logged, each array of shape (days, N).

        An inflow that moves by less than `min_motion` of its largest value is taken for constant: rounding
        noise is not motion.
        """
        u = inflow - inflow[:, :1]
        u[np.ptp(u, axis=1) < min_motion * np.abs(inflow).max(axis=1)] = 0.0
        o = None if outflow is None else outflow - outflow[:, :1]
        return cls(u, output - output[:, :1], o, inflow[:, 0])


@dataclass(frozen=True)
class Answer:
    """What an estimator says of each day; None where it has no such thing.

    Attributes
    ----------
    status : ndarray of str, shape (days,)
        "ok", "degenerate" or "unidentifiable".
    delay : ndarray, shape (days,), or None
        d [samples]; NaN on a day without one.
    candidates : ndarray of int, shape (K,), or None
        The delays tried [samples].
    criterion : ndarray, shape (days, K), or None
        What the delay is the minimum of.
    curve : ndarray, shape (days, K), or None
        What is kept of every candidate, for whoever doubts: the criterion, CUSUM's g at lag d + 1, or the
        probability.
    fir, fir_sd : ndarray, shape (days, M), or None
        h and its standard deviation [output unit per m3/s].
    alpha, noise_variance, roughness_variance, condition : ndarray, shape (days,), or None
        As of :class:`rivid.core.jmap.JmapResult`.
    iterations : ndarray of int, shape (days,), or None
        Rounds of Table VI.
    prior_only : ndarray of bool, shape (days,), or None
        The delay is the prior's, or chance; None where the estimator cannot tell.
    reason : ndarray of str, shape (days,), or None
        Why there is no answer; empty where that is to be seen from u and y.
    travel : ndarray, shape (days,), or None
        The travel time with its fraction [samples], about d to d + 1; NaN on a day without a delay.
    probability : ndarray, shape (days,), or None
        That the likeliest delay is right; NaN on a day that has no probabilities to tell.
    delay_low, delay_high : ndarray, shape (days,), or None
        Ends of the smallest set of delays that holds 90 % [samples].
    outside : ndarray of bool, shape (days,), or None
        The delay lies beyond the candidates.
    """

    status: NDArray[np.str_]
    delay: Floats | None = None
    candidates: NDArray[np.intp] | None = None
    criterion: Floats | None = None
    curve: Floats | None = None
    fir: Floats | None = None
    alpha: Floats | None = None
    noise_variance: Floats | None = None
    roughness_variance: Floats | None = None
    condition: Floats | None = None
    iterations: NDArray[np.intp] | None = None
    prior_only: NDArray[np.bool_] | None = None
    reason: NDArray[np.str_] | None = None
    fir_sd: Floats | None = None
    travel: Floats | None = None
    probability: Floats | None = None
    delay_low: Floats | None = None
    delay_high: Floats | None = None
    outside: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Estimator:
    """One estimator, ready to be called.

    Attributes
    ----------
    name : str
        As in the configuration and in the tables.
    estimate : callable
        ``estimate(days)`` gives an :class:`Answer`.
    n_more_than : int
        A data set needs more samples than this.
    because : str
        What needs them, and the key that would need fewer.
    says_at_bound : bool
        A delay at the edge of what was tried is noted in the row's message. It is the usual case for some
        estimators, a rare one for others, whose rows have `at_bound` alone.
    max_iterations : int or None
        Rounds after which it gives up.
    """

    name: str
    estimate: Callable[[Days], Answer]
    n_more_than: int
    because: tuple[str, str]
    says_at_bound: bool = False
    max_iterations: int | None = None
