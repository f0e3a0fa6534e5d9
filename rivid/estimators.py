"""What an estimator is given and what it says: arrays of days in, arrays of days out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rivid.config import Config
from rivid.core.cusum import CusumResult, cusum
from rivid.core.fir import FirResult, map_fir, ml
from rivid.core.jmap import jmap
from rivid.core.search import DIRECT_PARAMETERS, INDIRECT_PARAMETERS, SearchResult, direct, indirect
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.core.posterior.daily import PosteriorResult
    from rivid.core.posterior.river import RiverPosterior
    from rivid.core.posterior.settings import PosteriorSettings, RiverSettings


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


def build(config: Config) -> list[Estimator]:
    """The estimators that the configuration asks for, in its order.

    Raises
    ------
    ConfigError
        Where settings contradict each other, or an estimator has no equations for the reach.
    """
    return [_build(name, config) for name in config.run.estimators]


def _build(name: str, config: Config) -> Estimator:
    match name:
        case "ml" | "map":
            return _fir(name, config)
        case "cusum-ml" | "cusum-map":
            return _cusum(name, config)
        case "direct" | "indirect":
            return _search(name, config)
        case "posterior":
            return _posterior(name, config)
        case "jmap":
            settings = config.jmap_settings()
        case "jmap-uniform":
            settings = config.jmap_settings("uniform", fixed_alpha=True)
        case "jmap-uniform-estimated":
            settings = config.jmap_settings("uniform")
        case "jmap-degenerate":
            settings = config.jmap_settings(inverse_gamma=False)
        case _:
            raise AssertionError(f"{name} passed the configuration but is not built here")

    def estimate(days: Days) -> Answer:
        found = jmap(days.u, days.y, settings)
        return Answer(
            status=found.status,
            delay=found.delay,
            candidates=found.candidates,
            criterion=found.criterion,
            curve=found.criterion,
            fir=found.fir,
            alpha=found.alpha,
            noise_variance=found.noise_variance,
            roughness_variance=found.roughness_variance,
            condition=found.condition,
            iterations=found.iterations,
            prior_only=found.prior_only,
        )

    return Estimator(
        name, estimate, settings.order, _long_fir(settings.order), max_iterations=settings.max_iterations
    )


def _long_fir(order: int) -> tuple[str, str]:
    return f"an FIR of order {order}", "[jmap] order"


def _fir(name: str, config: Config) -> Estimator:
    """ML (17) or MAP (22), without a delay."""
    settings = config.jmap_settings()
    fit = _fit(name, settings.order, config.jmap.alpha, settings.free_start)

    def estimate(days: Days) -> Answer:
        return _of_fir(fit(days.u, days.y))

    return Estimator(name, estimate, settings.order, _long_fir(settings.order))


def _fit(name: str, M: int, alpha: float, free: bool) -> Callable[[Floats, Floats], FirResult]:
    if name.endswith("ml"):
        return lambda u, y: ml(u, y, M, free_start=free)
    return lambda u, y: map_fir(u, y, M, alpha, free_start=free)


def _of_fir(fit: FirResult) -> Answer:
    return Answer(fit.status, fir=fit.fir, noise_variance=fit.noise_variance, condition=fit.condition)


def _cusum(name: str, config: Config) -> Estimator:
    """A change in the mean of the ML or the MAP FIR."""
    settings, of_fir = config.cusum_settings(), config.jmap_settings()
    fit = _fit(name, of_fir.order, config.jmap.alpha, of_fir.free_start)
    candidates = np.arange(settings.d_min, settings.d_max + 1)

    def estimate(days: Days) -> Answer:
        fir = fit(days.u, days.y)
        found: CusumResult = cusum(fir.fir, settings)
        no_fir = fir.status == "unidentifiable"
        return Answer(
            status=found.status,
            delay=found.delay,
            candidates=candidates,
            curve=found.decision[:, candidates + 1],
            fir=fir.fir,
            noise_variance=fir.noise_variance,
            condition=fir.condition,
            reason=np.where(no_fir, "", found.reason),
        )

    return Estimator(name, estimate, of_fir.order, _long_fir(of_fir.order), says_at_bound=True)


def _search(name: str, config: Config) -> Estimator:
    """Table IV: least squares in (8) or in (10) for every delay."""
    settings = config.search_settings()
    table = "jmap" if config.search.d_max is None else "search"
    n_parameters = len(DIRECT_PARAMETERS if name == "direct" else INDIRECT_PARAMETERS)

    def estimate(days: Days) -> Answer:
        found: SearchResult
        if name == "direct":
            assert days.o is not None, "the configuration refuses direct where the outflow is not logged"
            found = direct(days.u, days.o, days.y, settings)
        else:
            found = indirect(days.u, days.y, settings)
        return Answer(
            status=found.status,
            delay=found.delay,
            candidates=found.candidates,
            criterion=found.criterion,
            curve=found.criterion,
            noise_variance=found.noise_variance,
            reason=found.reason,
        )

    because = f"d_max = {settings.d_max}", f"[{table}] d_max"
    return Estimator(name, estimate, settings.d_max + 1 + n_parameters, because, says_at_bound=True)


def _posterior(name: str, config: Config) -> Estimator:
    """The probability of every delay, by the equations of this water."""
    if config.reach.kind == "river":
        return _river_posterior(name, config)
    settings = config.posterior_settings()
    from rivid.core.posterior.blind import n_least, posterior_blind
    from rivid.core.posterior.daily import GUARD, posterior  # scipy.special, only where it is asked for

    def estimate(days: Days) -> Answer:
        if days.o is None:
            found = posterior_blind(days.u, days.y, settings)
        else:
            found = posterior(days.u, days.y, days.o, settings)
        return _of_posterior(found, settings, config)

    needed = 3 * (settings.d_max + GUARD + 4)
    if not config.input.u_Qo:
        needed = max(needed, n_least(settings))
    return Estimator(name, estimate, needed - 1, (f"d_max = {settings.d_max}", _key(config, "d_max")))


def _river_posterior(name: str, config: Config) -> Estimator:
    """The probability of a river's t50; the first samples of each window are history."""
    settings = config.river_settings()
    from rivid.core.posterior.river import LEAST_ROWS, posterior_river

    def estimate(days: Days) -> Answer:
        flow = days.u if days.base is None else days.u + days.base[:, None]
        return _of_posterior(posterior_river(flow, days.y, settings), settings, config)

    needed = settings.warm + LEAST_ROWS
    return Estimator(name, estimate, needed - 1, (f"d_max = {settings.d_max}", _key(config, "d_max")))


def _of_posterior(
    found: "PosteriorResult | RiverPosterior", s: "PosteriorSettings | RiverSettings", config: Config
) -> Answer:
    """A day whose front is not seen, or lies outside, has no probabilities to tell."""
    outside = found.status == "at_bound"
    below = found.beyond[:, 0] > found.beyond[:, 1]
    told = np.isfinite(found.probability).all(axis=1) & (found.link >= 0.5) & ~outside
    candidates = found.candidates
    too_short = (
        f"the delay is shorter than d_min = {s.d_min}: lower {_key(config, 'd_min')}"
        if s.d_min > 1
        else "the delay is shorter than one sample: a shorter [reach] sample_time would show it"
    )
    too_long = f"the delay is longer than d_max = {s.d_max}: raise {_key(config, 'd_max')}"
    least = getattr(s, "answer_above", None)  # a river's answer needs a band that is narrow enough instead
    unsure = found.message
    if least is not None:
        said = f"no delay is right with a probability of {least:g} ([posterior] answer_above)"
        unsure = np.full(len(outside), said)
    return Answer(
        status=np.where(found.status == "ok", "ok", "unidentifiable"),
        delay=found.delay,
        candidates=candidates,
        curve=np.where(told[:, None], found.probability, np.nan),
        fir=found.fir,
        fir_sd=found.fir_sd,
        reason=np.select(
            [outside & below, outside, told & (found.status != "ok")],
            [too_short, too_long, unsure],
            found.message,
        ),
        travel=np.where(found.status == "ok", found.place, np.nan),
        probability=np.where(told, found.right, np.nan),
        delay_low=np.where(told, candidates[np.argmax(found.in_set, axis=1)], np.nan),
        delay_high=np.where(told, candidates[::-1][np.argmax(found.in_set[:, ::-1], axis=1)], np.nan),
        outside=outside,
    )


def _key(config: Config, name: str) -> str:
    """The key that `name` is taken from: the posterior's own, or that of `[jmap]`."""
    return f"[{'jmap' if getattr(config.posterior, name) is None else 'posterior'}] {name}"
