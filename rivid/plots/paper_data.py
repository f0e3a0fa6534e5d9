"""The data of the paper's figures: a year of logs, the estimates of each day, the reaches of a cascade."""

import datetime as dt
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rivid.config import Config, parse
from rivid.core.hydraulics import TravelBounds
from rivid.errors import ConfigError, DataError, NoDataError, RividError
from rivid.estimators import ESTIMATORS, Days
from rivid.logs.days import find_days, read_window
from rivid.results.read import EstimatorResults, Results, no_run
from rivid.types import Floats, Ints


@dataclass(frozen=True, eq=False)
class Year:
    """Data sets of a pool, in date order: an array (N,) per date; N differs where a clock is changed."""

    config: Config
    dates: tuple[dt.date, ...]
    inflow: tuple[Floats, ...]  # u_Qi [m3/s]
    outflow: tuple[Floats, ...]  # u_Qo [m3/s]; empty where it is not logged
    level: tuple[Floats, ...]  # h_L [m]
    left_out: int = 0  # days with a log that cannot be used

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
        """Froude number and bounds of each day, (4)-(6), as in delays.csv."""
        return self.config.reach.bounds(self.discharge, self.mean_level)

    def groups(self, least: int) -> Iterator[tuple[Ints, Days]]:
        """The data sets of one length at a time, with their numbers; those of `least` samples or more."""
        length = np.array([len(inflow) for inflow in self.inflow])
        for N in np.unique(length[length >= least]):
            days = np.flatnonzero(length == N)
            inflow, level = (np.stack([logged[i] for i in days]) for logged in (self.inflow, self.level))
            outflow = np.stack([self.outflow[i] for i in days]) if self.outflow else None
            yield days, Days.of(inflow, level, outflow, self.config.run.min_motion)


def year_of(config: Config, dates: Sequence[dt.date], inflow: Floats, outflow: Floats, level: Floats) -> Year:
    """A year from arrays of shape (days, N), of a simulated season for example, without days with gaps."""
    kept = [int(i) for i in np.flatnonzero(np.isfinite(inflow + outflow + level).all(axis=1))]
    return Year(
        config=config, dates=tuple(dates[i] for i in kept), inflow=tuple(inflow[kept]),
        outflow=tuple(outflow[kept]), level=tuple(level[kept]), left_out=len(dates) - len(kept),
    )  # fmt: skip


def read_year(data_dir: Path, config: Config) -> Year:
    """Read all data sets of a directory of logs.

    ConfigError for a river: the paper's figures are those of a pool. NoDataError if no day can be used.
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
            with suppress(DataError):  # counted: `rivid check` reports the reason
                found.append(read_window(data_dir, [sources[day] for day in days], config))
    if not found:
        raise NoDataError(f"no day of {data_dir} can be used: see `rivid check {data_dir}`")
    logged = [data.outflow for data in found if data.outflow is not None]
    return Year(
        config=config, dates=tuple(data.date for data in found), inflow=tuple(data.inflow for data in found),
        outflow=tuple(logged) if len(logged) == len(found) else (),
        level=tuple(data.output for data in found), left_out=len(sources) - len(found),
    )  # fmt: skip


def read_run(out: Path, logs: Path | None = None) -> Year:
    """Read the logs of a finished run, with its configuration; `logs` replaces the directory that it names.

    NoDataError if `out` holds no finished run, or its logs are missing.
    """
    path = out / "run.json"
    try:
        run = json.loads(path.read_text(encoding="utf-8"))
        config, place = parse(run["config"], Config, str(path)), Path(run["data_dir"])
    except FileNotFoundError:
        raise no_run(out) from None
    except (ValueError, KeyError) as error:
        raise RividError(f"{path} cannot be read ({error}): run again") from None
    if logs is None and not place.exists():
        raise NoDataError(
            f"the logs of {out} are no longer in {place}: give their directory with --logs DATA_DIR"
        )
    return read_year(logs or place, config)


PAPER = (  # the paper's estimators: (17), (22), Tables IV, V and VI
    "ml", "map", "jmap-uniform", "jmap-uniform-estimated", "jmap", "jmap-degenerate", "direct", "indirect",
)  # fmt: skip


def estimate(year: Year) -> Results:
    """Apply :data:`PAPER` with the year's configuration; ``direct`` only where the outflow is logged."""
    config, reach = year.config, year.config.reach
    names = [name for name in PAPER if year.outflow or not ESTIMATORS[name].needs_outflow]
    made = [_estimates(year, name) for name in names]
    return Results(reach.name, year.sample_time, reach.output_unit, config.jmap_settings().delay_scale, made)


def _estimates(year: Year, name: str) -> EstimatorResults:
    """The results of one estimator; a data set that is too short is unidentifiable."""
    prepared, n = ESTIMATORS[name].prepare(year.config), len(year.dates)
    order = year.config.jmap_settings().order if ESTIMATORS[name].has_fir else 0
    keys = ("delay", "alpha", "condition", "noise_variance", "roughness_variance")
    found: dict[str, NDArray[Any]] = {key: np.full(n, np.nan) for key in keys}
    found |= {"fir": np.full((n, order), np.nan), "prior_only": np.zeros(n, bool)}
    found["status"], candidates = np.full(n, "unidentifiable"), np.empty(0)
    for days, data in year.groups(prepared.min_samples):
        answer = prepared.estimate(data)
        if answer.candidates is not None:
            candidates = answer.candidates.astype(float)
        for key, values in found.items():
            if (given := getattr(answer, key)) is not None:
                values[days] = given
    return EstimatorResults(
        estimator=name, dates=list(year.dates), status=found.pop("status").tolist(), messages=[""] * n,
        at_bound=np.isin(found["delay"], candidates[[0, -1]] if candidates.size else ()),
        t50=np.full(n, np.nan), candidates=candidates, criterion=np.full((n, candidates.size), np.nan),
        noise_sd=np.sqrt(found.pop("noise_variance")),
        roughness_sd=np.sqrt(found.pop("roughness_variance")),
        mean_inflow=np.array([flow.mean() for flow in year.inflow]), bound_gravity_s=year.bounds.gravity,
        bound_kinematic_s=year.bounds.kinematic, **found,
    )  # fmt: skip


EMPIRICAL = 3  # the operators' uncertainty [samples] either side of their nominal value (section VI)

HELD = 0.9  # share of the days that a fluctuation interval holds


@dataclass(frozen=True, eq=False)
class CascadeReach:
    """One reach of Fig. 19."""

    name: str
    length: float  # [m]
    sample_time: float  # T_s [s]
    delay: Floats  # estimates with the uniform prior, shape (days,) [samples]
    nominal: int  # the operators' value [samples]; here of the gravity wave at the middle discharge
    truth: Floats  # true delays, shape (days,), or (0,) where they are unknown [samples]
    posterior: Floats  # estimates of `posterior`, NaN on days without an answer, shape (days,) [samples]

    @property
    def empirical(self) -> tuple[int, int]:
        """The operators' interval [samples]."""
        return max(self.nominal - EMPIRICAL, 1), self.nominal + EMPIRICAL

    @property
    def estimated(self) -> tuple[int, int]:
        """The fluctuation interval of the estimates [samples]."""
        return shortest(self.delay)


def shortest(delay: Floats, held: float = HELD) -> tuple[int, int]:
    """The shortest interval of whole delays that holds a share of the days; the lowest of equals."""
    d = np.sort(delay[np.isfinite(delay)]).astype(int)
    if not len(d):
        return 0, 0
    n = max(int(np.ceil(held * len(d) - 1e-9)), 1)
    widths = d[n - 1 :] - d[: len(d) - n + 1]
    i = int(np.argmin(widths))
    return int(d[i]), int(d[i + n - 1])


def of_year(year: Year, truth: Floats | None = None) -> CascadeReach:
    """A reach of the cascade from its logs and, where they are known, the true delays [samples]."""
    reach = year.config.reach
    bounds = reach.bounds(reach.discharge_range, year.mean_level.mean())
    return CascadeReach(
        name=reach.name, length=reach.length, sample_time=reach.sample_time,
        delay=_estimates(year, "jmap-uniform").delay, posterior=_estimates(year, "posterior").delay,
        nominal=round(float(bounds.gravity.mean()) / reach.sample_time),
        truth=np.empty(0) if truth is None else truth,
    )  # fmt: skip
