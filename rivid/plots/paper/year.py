"""The logs behind the paper's figures: a year of days as arrays, read anew."""

import datetime as dt
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rivid.config import Config, parse
from rivid.core.hydraulics import TravelBounds, travel_bounds
from rivid.errors import ConfigError, DataError, NoDataError, RividError
from rivid.types import Floats, Ints


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
    from rivid.logs.catalog import find_days
    from rivid.logs.read import read_window

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
    import json

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
