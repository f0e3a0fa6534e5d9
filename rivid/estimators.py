"""The estimators of `rivid run`: a name, the settings it makes of the configuration, what it returns."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from rivid.answers import Answer, Days, Estimator, Floats
from rivid.config import Config
from rivid.core.change import CusumResult, cusum
from rivid.core.fir import FirResult, map_fir, ml
from rivid.core.jmap import jmap
from rivid.core.search import DIRECT_PARAMETERS, INDIRECT_PARAMETERS, SearchResult, direct, indirect

if TYPE_CHECKING:
    from rivid.core.posterior.daily import PosteriorResult
    from rivid.core.posterior.settings import PosteriorSettings
    from rivid.core.river.posterior import RiverPosterior
    from rivid.core.river.settings import RiverSettings


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
    from rivid.core.river.posterior import LEAST_ROWS, posterior_river

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
