"""The estimators of `rivid run`: a name, the settings it makes of the configuration, what it returns."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rivid.config import Config
from rivid.core.fir import FirResult, map_fir, ml
from rivid.core.jmap import JmapResult, jmap
from rivid.core.settings import JmapSettings

Floats = NDArray[np.float64]
Estimate = Callable[[Floats, Floats], JmapResult]


@dataclass(frozen=True)
class Estimator:
    """One estimator, ready to be called with u and y of shape (days, N).

    Attributes
    ----------
    name : str
        As in the configuration and in the tables.
    settings : JmapSettings
        What it works with; an FIR estimator uses `order` only.
    estimate : callable
        ``estimate(u, y)`` gives a :class:`JmapResult`; without a delay, its delays are NaN and its
        criterion has no columns.
    """

    name: str
    settings: JmapSettings
    estimate: Estimate


def build(config: Config) -> list[Estimator]:
    """The estimators that the configuration asks for, in its order.

    Raises
    ------
    ConfigError
        Where settings contradict each other.
    """
    return [_build(name, config) for name in config.run.estimators]


def _build(name: str, config: Config) -> Estimator:
    match name:
        case "ml" | "map":
            settings = config.jmap_settings()
            M, alpha, free = settings.order, config.jmap.alpha, settings.free_start

            def fit(u: Floats, y: Floats) -> JmapResult:
                if name == "ml":
                    return _without_delay(ml(u, y, M, free_start=free))
                return _without_delay(map_fir(u, y, M, alpha, free_start=free))

            return Estimator(name, settings, fit)
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
    return Estimator(name, settings, lambda u, y: jmap(u, y, settings))


def _without_delay(fit: FirResult) -> JmapResult:
    n = len(fit.fir)
    nothing = np.full(n, np.nan)
    return JmapResult(
        delay=nothing,
        fir=fit.fir,
        alpha=nothing,
        noise_variance=fit.noise_variance,
        roughness_variance=nothing,
        candidates=np.empty(0, np.intp),
        criterion=np.empty((n, 0)),
        iterations=np.zeros(n, np.intp),
        condition=fit.condition,
        status=fit.status,
        prior_only=np.zeros(n, bool),
    )
