"""A day of a reach: its samples and their configuration."""

import datetime as dt
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rivid.api.inputs import GivenConfig, GivenDate, Result, as_config, as_date
from rivid.config import Config
from rivid.errors import ConfigError, DataError, NoDataError, RividError
from rivid.estimators import Days
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.plots.library import Curve, Panel


@dataclass(frozen=True, repr=False, eq=False)
class Day(Result):
    """Samples of a day at T_s, or of consecutive days.

    Attributes
    ----------
    inflow : ndarray, shape (N,)
        u_Qi [m3/s].
    output : ndarray, shape (N,)
        Level h_L [m], or a river's discharge Q_L [m3/s].
    outflow : ndarray, shape (N,), or None
        u_Qo [m3/s]; None where it is not logged, and for a river.
    date : datetime.date or None
        The last day's.
    config : Config
        The reach, and the default settings of its estimates.
    n_filled : int
        Samples interpolated over gaps.
    notes : str
        Dropped, masked or sorted samples; empty if there are none.

    Raises
    ------
    RividError
        If the series differ in length or are not finite.
    """

    inflow: Floats
    output: Floats
    outflow: Floats | None = None
    date: dt.date | None = None
    config: Config = field(default_factory=Config)
    n_filled: int = 0
    notes: str = ""

    def __post_init__(self) -> None:
        for name in ("inflow", "output", "outflow"):
            if getattr(self, name) is None:
                continue
            values = np.array(getattr(self, name), float)  # a copy, which the caller cannot change
            if values.shape != (len(values),) or len(values) != len(self.inflow):
                raise RividError(
                    f"{name} has shape {values.shape}: expected one series of {len(self.inflow)} samples"
                )
            if not np.isfinite(values).all():
                at = int(np.flatnonzero(~np.isfinite(values))[0])
                raise RividError(f"{name} is not finite at sample {at}: fill gaps or leave the day out")
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def _facts(self) -> str:
        low, high = self.inflow.min(), self.inflow.max()
        filled = f", {self.n_filled} filled" if self.n_filled else ""
        return (
            f"{self.date or 'no date'}, {self.config.reach.name}: {len(self.inflow)} samples of "
            f"{self.sample_time:g} s{filled}, inflow {low:.0f} to {high:.0f} m3/s"
        )

    @property
    def sample_time(self) -> float:
        """T_s [s]."""
        return self.config.reach.sample_time

    @property
    def hours(self) -> Floats:
        """Time of each sample after the first [h], shape (N,)."""
        return np.asarray(np.arange(len(self.inflow)) * self.sample_time / 3600.0, float)

    @property
    def u(self) -> Floats:
        """Inflow as deviation from the first sample [m3/s]; zero if it does not move (min_motion)."""
        return np.asarray(self._deviations.u[0])

    @property
    def y(self) -> Floats:
        """Output as deviation from the first sample [m or m3/s]."""
        return np.asarray(self._deviations.y[0])

    @property
    def o(self) -> Floats | None:
        """Outflow as deviation from the first sample [m3/s]."""
        o = self._deviations.o
        return None if o is None else np.asarray(o[0])

    @property
    def _deviations(self) -> Days:
        outflow = None if self.outflow is None else self.outflow[None]
        return Days.of(self.inflow[None], self.output[None], outflow, self.config.run.min_motion)

    def _title(self) -> str:
        return f"{self.config.reach.name}, {self.date or 'a day'}"

    def _note(self) -> str:
        notes = f" · {self.notes}" if self.notes else ""
        return f"{len(self.inflow)} samples of {self.sample_time:g} s{notes}"

    def _panels(self) -> "list[Panel]":
        from rivid.plots import library, style

        flows: list[Curve] = [(self.inflow, style.INK, "inflow")]
        if self.outflow is not None:
            flows.append((self.outflow, style.WATER, "outflow"))
        output: list[Curve] = [(self.output, style.INK, "")]
        label = "level [m]" if self.config.reach.kind == "pool" else "discharge [m³/s]"
        return [
            (1.7, lambda axes: library.samples(axes, self.hours, flows, "flow [m³/s]", held=True)),
            (1.5, lambda axes: library.samples(axes, self.hours, output, label)),
        ]


def read_day(path: Path | str, date: GivenDate = None, config: GivenConfig = None) -> Day:
    """Read a day from a log.

    Parameters
    ----------
    path : Path or str
        A file of one day or of many, or a directory of them.
    date : datetime.date or str, optional
        Which day; needed if there are several. Of `[run] window_days` consecutive days, the last.
    config : Config, path of a TOML file, or mapping, optional
        The reach and the format of its logs; Table I by default.

    Raises
    ------
    DataError
        If the day cannot be used; the message names file and line.
    NoDataError
        If there is no log of that day.
    ConfigError
        If `date` is missing and there are several days, or the configuration is invalid.

    Examples
    --------
    >>> read_day("sample_data/basse_isere_csv/2008-03-14.csv", config="configs/basse_isere.toml")
    Day(2008-03-14, basse-isere: 650 samples of 133 s, inflow 350 to 452 m3/s)
    """
    from rivid.logs.days import find_days, read_window
    from rivid.run.workers import without_pandas

    settings, wanted, root = as_config(config), as_date(date), Path(path)
    if not root.exists():
        raise NoDataError(f"{root} does not exist: expected a log, or a directory of logs")
    without_pandas()
    catalog = find_days(root, settings)
    sources = {source.date: source for source in catalog.days}
    if not sources:
        why = "; ".join(f"{name}: {reason}" for name, reason in catalog.bad_files[:1])
        raise DataError(f"{root}: no day can be read" + (f": {why}" if why else ""))
    if settings.run.window:
        raise ConfigError("[run] window is of `rivid run`: leave it out for whole days, or pass arrays")
    length = settings.run.window_days
    if wanted is None:
        if len(sources) > length:
            raise ConfigError(
                f"{root} holds {len(sources)} days, {min(sources)} to {max(sources)}: give date=..."
            )
        wanted = max(sources)
    dates = [wanted - dt.timedelta(days=k) for k in range(length - 1, -1, -1)]
    missing = [day for day in dates if day not in sources]
    if missing:
        raise NoDataError(f"{root} has no log of {missing[0]}: it holds {min(sources)} to {max(sources)}")
    data = read_window(root, [sources[day] for day in dates], settings)
    return Day(data.inflow, data.output, data.outflow, data.date, settings, data.n_filled, data.notes)
