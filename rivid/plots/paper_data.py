"""The data of the paper's figures: a year of logs, the estimates of each day, the reaches of a cascade."""

import dataclasses
import datetime as dt
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rivid.config import Config, parse
from rivid.core.cusum import CusumSettings, cusum
from rivid.core.fir import map_fir, ml
from rivid.core.hydraulics import TravelBounds, propose_delays, travel_bounds
from rivid.core.jmap import jmap
from rivid.core.search import SearchSettings, direct, indirect
from rivid.core.settings import JmapSettings
from rivid.errors import ConfigError, DataError, NoDataError, RividError
from rivid.logs.catalog import find_days
from rivid.logs.read import read_window
from rivid.results.read import EstimatorResults, Results
from rivid.types import Floats, Ints, Strings

# Logs


@dataclass(frozen=True, eq=False)
class Year:
    """Data sets of a pool, in date order.

    Attributes
    ----------
    config : Config
        The reach and the settings in use.
    dates : tuple of datetime.date
        One per data set.
    inflow, level : tuple of ndarray, each of shape (N,)
        u_Qi [m3/s] and h_L [m]; N differs where a clock is changed.
    outflow : tuple of ndarray, each of shape (N,)
        u_Qo [m3/s]; empty where it is not logged.
    left_out : int
        Days whose log cannot be used.
    """

    config: Config
    dates: tuple[dt.date, ...]
    inflow: tuple[Floats, ...]
    outflow: tuple[Floats, ...]
    level: tuple[Floats, ...]
    left_out: int = 0

    @property
    def sample_time(self) -> float:
        """T_s [s]."""
        return self.config.reach.sample_time

    @property
    def discharge(self) -> Floats:
        """Mean daily discharge at the downstream dam [m3/s], the inflow's where no outflow is logged."""
        return np.array([flow.mean() for flow in self.outflow or self.inflow])

    @property
    def mean_level(self) -> Floats:
        """Mean daily level [m]."""
        return np.array([level.mean() for level in self.level])

    @property
    def bounds(self) -> TravelBounds:
        """Froude number and bounds of each day, (4)-(6), from its mean discharge and depth."""
        reach = self.config.reach
        depth = np.full(len(self.dates), reach.depth)
        if reach.bed_level is not None:
            above = self.mean_level - reach.bed_level
            depth = np.where(above > 0, above, depth)
        return travel_bounds(self.discharge, length=reach.length, width=reach.width, depth=depth)

    def groups(self, least: int) -> Iterator[tuple[Ints, Floats, Floats | None, Floats]]:
        """Days of one length at a time: their numbers, inflow, outflow and level, each (days, N).

        Days of `least` samples or fewer are left out; an inflow that hardly moves does not move.
        """
        by_length: dict[int, list[int]] = defaultdict(list)
        for i, inflow in enumerate(self.inflow):
            if len(inflow) > least:
                by_length[len(inflow)].append(i)
        for days in by_length.values():
            inflow = np.stack([self.inflow[i] for i in days])
            still = np.ptp(inflow, axis=1) < self.config.run.min_motion * np.abs(inflow).max(axis=1)
            inflow[still] = inflow[still, :1]
            outflow = np.stack([self.outflow[i] for i in days]) if self.outflow else None
            yield np.array(days, np.intp), inflow, outflow, np.stack([self.level[i] for i in days])


def year_of(config: Config, dates: Sequence[dt.date], inflow: Floats, outflow: Floats, level: Floats) -> Year:
    """A year from arrays of shape (days, N), of a simulated season for example, without days with gaps."""
    kept = [int(i) for i in np.flatnonzero(np.isfinite(inflow + outflow + level).all(axis=1))]
    return Year(
        config=config,
        dates=tuple(dates[i] for i in kept),
        inflow=tuple(inflow[kept]),
        outflow=tuple(outflow[kept]),
        level=tuple(level[kept]),
        left_out=len(dates) - len(kept),
    )


def read_year(data_dir: Path, config: Config) -> Year:
    """Read all data sets of a directory of logs.

    Parameters
    ----------
    data_dir : Path
        Daily logs.
    config : Config
        How to read them; the reach must be a pool.

    Returns
    -------
    Year

    Raises
    ------
    ConfigError
        For a river: the paper's figures are those of a pool.
    NoDataError
        Where no day can be used.
    """
    if config.reach.kind != "pool":
        raise ConfigError(
            f'[reach] kind = "{config.reach.kind}": the paper\'s figures show the level of a pool, '
            "a river has none; use `rivid figures OUT` without --paper"
        )
    sources = {day.date: day for day in find_days(data_dir, config).days}
    found = []
    for date in sources:
        days = [date - dt.timedelta(days=k) for k in range(config.run.window_days - 1, -1, -1)]
        if all(day in sources for day in days):
            try:
                found.append(read_window(data_dir, [sources[day] for day in days], config))
            except DataError:
                pass  # counted: `rivid check` says why
    if not found:
        raise NoDataError(f"no day of {data_dir} can be used: see `rivid check {data_dir}`")
    logged = [data.outflow for data in found if data.outflow is not None]
    return Year(
        config=config,
        dates=tuple(data.date for data in found),
        inflow=tuple(data.inflow for data in found),
        outflow=tuple(logged) if len(logged) == len(found) else (),
        level=tuple(data.output for data in found),
        left_out=len(sources) - len(found),
    )


def read_run(out: Path, logs: Path | None = None) -> Year:
    """Read the logs of a finished run, with its configuration.

    Parameters
    ----------
    out : Path
        OUT of the run.
    logs : Path, optional
        Where its logs are now; by default where they were.

    Returns
    -------
    Year

    Raises
    ------
    NoDataError
        Where `out` holds no finished run, or its logs are gone.
    """
    path = out / "run.json"
    try:
        run = json.loads(path.read_text(encoding="utf-8"))
        config, place = parse(run["config"], Config, str(path)), Path(run["data_dir"])
    except FileNotFoundError:
        raise NoDataError(
            f"{out} holds no finished run (run.json is missing): run `rivid run DATA_DIR --out OUT` first"
        ) from None
    except (ValueError, KeyError) as error:
        raise RividError(f"{path} cannot be read ({error}): run again") from None
    if logs is None and not place.exists():
        raise NoDataError(f"the logs of {out} are not in {place} any more: say where with --logs DATA_DIR")
    return read_year(logs or place, config)


# Estimates

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


def _say(columns: dict[str, Any], days: Ints, status: Strings) -> None:
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


# Cascade

EMPIRICAL = 3
"""The operators' uncertainty: three sampling periods either side of their nominal value (section VI)."""

HELD = 0.9
"""Share of the days that a fluctuation interval holds."""


@dataclass(frozen=True, eq=False)
class CascadeReach:
    """One reach of Fig. 19.

    Attributes
    ----------
    name : str
    length : float
        [m].
    sample_time : float
        T_s [s].
    delay : ndarray, shape (days,)
        Estimates with the uniform prior [samples].
    nominal : int
        The operators' value [samples]; nobody can be asked in a simulation, so it is the gravity wave's
        travel time in the middle of the usual discharges.
    truth : ndarray, shape (days,) or (0,)
        True delays [samples], where they are known.
    """

    name: str
    length: float
    sample_time: float
    delay: Floats
    nominal: int
    truth: Floats

    @property
    def empirical(self) -> tuple[int, int]:
        """The operators' interval [samples]."""
        return max(self.nominal - EMPIRICAL, 1), self.nominal + EMPIRICAL

    @property
    def estimated(self) -> tuple[int, int]:
        """The fluctuation interval of the estimates [samples]."""
        return shortest(self.delay)


def shortest(delay: Floats, held: float = HELD) -> tuple[int, int]:
    """The shortest interval of whole delays that holds a share of the days; the lowest of equals.

    Examples
    --------
    >>> shortest(np.array([1.0, 6, 6, 6, 7, 7, 7, 7, 7, 15]), 0.8)
    (6, 7)
    """
    d = np.sort(delay[np.isfinite(delay)]).astype(int)
    if not len(d):
        return 0, 0
    n = max(int(np.ceil(held * len(d) - 1e-9)), 1)
    widths = d[n - 1 :] - d[: len(d) - n + 1]
    i = int(np.argmin(widths))
    return int(d[i]), int(d[i + n - 1])


def of_year(year: Year, truth: Floats | None = None, settings: JmapSettings | None = None) -> CascadeReach:
    """A reach of the cascade from its logs: the JMAP with uniform prior and fixed alpha.

    Parameters
    ----------
    year : Year
    truth : ndarray, shape (days,), optional
        True delays [samples].
    settings : JmapSettings, optional
        The configuration's by default, with the uniform prior.
    """
    settings = settings or year.config.jmap_settings("uniform", fixed_alpha=True)
    delay = np.full(len(year.dates), np.nan)
    for days, inflow, _, level in year.groups(settings.order):
        delay[days] = jmap(inflow - inflow[:, :1], level - level[:, :1], settings).delay
    reach = year.config.reach
    bounds = travel_bounds(reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth)
    nominal = round(float(bounds.gravity.mean()) / reach.sample_time)
    known = np.empty(0) if truth is None else truth
    return CascadeReach(reach.name, reach.length, reach.sample_time, delay, nominal, known)


def own_bounds(config: Config) -> Config:
    """The same configuration, with order, d_max and sigma_d from the reach's hydraulics."""
    reach = config.reach
    proposal = propose_delays(
        reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth,
        sample_time=reach.sample_time, kind=reach.kind,
    )  # fmt: skip
    changes = {"order": proposal.order, "d_max": proposal.d_max, "sigma_d": proposal.delay_scale}
    return config.model_copy(update={"jmap": config.jmap.model_copy(update=changes)})
