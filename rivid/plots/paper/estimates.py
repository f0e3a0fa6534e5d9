"""What each of the paper's estimators makes of a year, as the results that figures draw."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rivid.core.cusum import CusumSettings, cusum
from rivid.core.fir import map_fir, ml
from rivid.core.jmap import jmap
from rivid.core.search import SearchSettings, direct, indirect
from rivid.core.settings import JmapSettings
from rivid.plots.paper.year import Year
from rivid.results.read import EstimatorResults, Results
from rivid.types import Floats

DELAYS = ("direct", "indirect", "jmap-uniform", "jmap-uniform-estimated", "jmap")
"""Estimators whose delays the paper counts (Figs 9, 17 and 18), in its order."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """A year through every estimator.

    Attributes
    ----------
    results : Results
        As of a run, for the figures of :mod:`rivid.plots`.
    settings : JmapSettings
        Of the estimator of Table VI.
    alpha : float
        Fixed regularisation weight of the MAP and of Table V [(m3/s)^2].
    """

    results: Results
    settings: JmapSettings
    alpha: float

    def of(self, name: str) -> EstimatorResults:
        """The results of one estimator."""
        return next(e for e in self.results.estimators if e.estimator == name)

    def has(self, name: str) -> bool:
        """Whether an estimator could be applied at all."""
        return any(e.estimator == name for e in self.results.estimators)


def estimate(year: Year) -> Estimates:
    """Apply every estimator of the paper to a year, with the settings of its configuration.

    Parameters
    ----------
    year : Year

    Returns
    -------
    Estimates
        ``ml``, ``map``, ``jmap-uniform``, ``jmap-uniform-estimated``, ``jmap``, ``jmap-degenerate``,
        ``indirect``, ``cusum-ml`` and, where the outflow is logged, ``direct``.

    Notes
    -----
    Source: (17), (22), Tables IV, V and VI.
    """
    config = year.config
    settings, alpha = config.jmap_settings(), config.jmap.alpha
    made = [_fir_only(year, "ml", settings, alpha), _fir_only(year, "map", settings, alpha)]
    for name, how in {
        "jmap-uniform": config.jmap_settings("uniform", fixed_alpha=True),
        "jmap-uniform-estimated": config.jmap_settings("uniform"),
        "jmap": settings,
        "jmap-degenerate": config.jmap_settings(inverse_gamma=False),
    }.items():
        made.append(_jmap(year, name, how))
    search = SearchSettings(settings.d_min, settings.d_max)
    if year.outflow:
        made.append(_search(year, "direct", search))
    made.append(_search(year, "indirect", search))
    made.append(_cusum(made[0], CusumSettings(d_min=settings.d_min, d_max=settings.d_max)))
    reach = config.reach
    return Estimates(
        Results(reach.name, year.sample_time, reach.output_unit, settings.delay_scale, made), settings, alpha
    )


def _blank(year: Year, name: str, order: int, candidates: Floats) -> dict[str, Any]:
    """The columns of an estimator that has not said anything yet."""
    n = len(year.dates)
    bounds = year.bounds
    columns: dict[str, Any] = {
        "estimator": name,
        "dates": list(year.dates),
        "status": ["unidentifiable"] * n,
        "messages": [""] * n,
        "at_bound": np.zeros(n, bool),
        "prior_only": np.zeros(n, bool),
        "fir": np.full((n, order), np.nan),
        "candidates": candidates,
        "criterion": np.full((n, candidates.size), np.nan),
        "mean_inflow": np.array([flow.mean() for flow in year.inflow]),
        "bound_gravity_s": bounds.gravity,
        "bound_kinematic_s": bounds.kinematic,
    }
    for key in ("delay", "t50", "alpha", "noise_sd", "roughness_sd", "condition"):
        columns[key] = np.full(n, np.nan)
    return columns


def _say(columns: dict[str, Any], days: NDArray[np.intp], status: NDArray[np.str_]) -> None:
    for i, word in zip(days, status, strict=True):
        columns["status"][i] = str(word)


def _fir_only(year: Year, name: str, settings: JmapSettings, alpha: float) -> EstimatorResults:
    M, free = settings.order, settings.free_start
    c = _blank(year, name, M, np.empty(0))
    for days, inflow, _, level in year.groups(M):
        u, y = inflow - inflow[:, :1], level - level[:, :1]
        fit = ml(u, y, M, free_start=free) if name == "ml" else map_fir(u, y, M, alpha, free_start=free)
        c["fir"][days], c["condition"][days] = fit.fir, fit.condition
        c["noise_sd"][days] = np.sqrt(fit.noise_variance)
        _say(c, days, fit.status)
    return EstimatorResults(**c)


def _jmap(year: Year, name: str, settings: JmapSettings) -> EstimatorResults:
    c = _blank(year, name, settings.order, np.arange(settings.d_min, settings.d_max + 1.0))
    for days, inflow, _, level in year.groups(settings.order):
        fit = jmap(inflow - inflow[:, :1], level - level[:, :1], settings)
        for key in ("delay", "fir", "alpha", "condition", "criterion", "prior_only"):
            c[key][days] = getattr(fit, key)
        c["noise_sd"][days] = np.sqrt(fit.noise_variance)
        c["roughness_sd"][days] = np.sqrt(fit.roughness_variance)
        _say(c, days, fit.status)
    c["at_bound"] = np.isin(c["delay"], (settings.d_min, settings.d_max))
    return EstimatorResults(**c)


def _search(year: Year, name: str, settings: SearchSettings) -> EstimatorResults:
    c = _blank(year, name, 0, np.arange(settings.d_min, settings.d_max + 1.0))
    for days, inflow, outflow, level in year.groups(settings.d_max + 4):
        if name == "direct" and outflow is not None:
            fit = direct(inflow, outflow, level, settings)
        else:
            fit = indirect(inflow, level, settings)
        c["delay"][days], c["criterion"][days] = fit.delay, fit.criterion
        c["noise_sd"][days] = np.sqrt(fit.noise_variance)
        _say(c, days, fit.status)
    c["at_bound"] = np.isin(c["delay"], (settings.d_min, settings.d_max))
    return EstimatorResults(**c)


def _cusum(fir: EstimatorResults, settings: CusumSettings) -> EstimatorResults:
    """A change in the mean of each FIR, by the untuned CUSUM."""
    import dataclasses

    fit = cusum(fir.fir, settings)
    return dataclasses.replace(
        fir,
        estimator="cusum-ml",
        delay=fit.delay,
        status=[str(word) for word in fit.status],
        at_bound=np.isin(fit.delay, (settings.d_min, settings.d_max)),
        candidates=np.arange(settings.d_min, settings.d_max + 1.0),
        criterion=np.full((len(fir.dates), settings.d_max - settings.d_min + 1), np.nan),
    )
