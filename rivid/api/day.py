"""A day of a reach: its samples, and where they come from."""

import datetime as dt
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rivid.api.given import GivenConfig, GivenDate, as_config, as_date
from rivid.config import Config
from rivid.errors import ConfigError, DataError, NoDataError, RividError
from rivid.estimators import Days
from rivid.types import Floats

if TYPE_CHECKING:
    from rivid.api.picture import Picture


@dataclass(frozen=True, repr=False, eq=False)
class Day:
    """Samples of a day at T_s, or of several days in a row.

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
        The reach and the settings that its estimates take unless told otherwise.
    n_filled : int
        Samples that bridge a gap.
    notes : str
        What was dropped, masked or sorted; empty where nothing was.

    Raises
    ------
    RividError
        Where the series differ in length or are not finite.
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
            values = np.array(getattr(self, name), float)  # a copy: frozen is meant
            if values.shape != (len(values),) or len(values) != len(self.inflow):
                raise RividError(
                    f"{name} has shape {values.shape}: expected one series of {len(self.inflow)} samples"
                )
            if not np.isfinite(values).all():
                at = int(np.flatnonzero(~np.isfinite(values))[0])
                raise RividError(f"{name} is not finite at sample {at}: fill gaps or leave the day out")
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def __repr__(self) -> str:
        low, high = self.inflow.min(), self.inflow.max()
        filled = f", {self.n_filled} filled" if self.n_filled else ""
        return (
            f"Day({self.date or 'no date'}, {self.config.reach.name}: {len(self.inflow)} samples of "
            f"{self.sample_time:g} s{filled}, inflow {low:.0f} to {high:.0f} m3/s)"
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
        """Inflow as deviation from the first sample [m3/s]; zero where it does not move (min_motion)."""
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

    def plot(self) -> "Picture":
        """The flows, and below them the level or the discharge."""
        from rivid.api.picture import picture
        from rivid.plots import style

        reach = self.config.reach
        with style.styled():
            figure, (flows, output) = picture(
                f"{reach.name}, {self.date or 'a day'}",
                f"{len(self.inflow)} samples of {self.sample_time:g} s"
                + (f" · {self.notes}" if self.notes else ""),
                (1.7, 1.5),
            )
            flows.step(self.hours, self.inflow, where="post", color=style.INK, lw=1.0, label="inflow")
            if self.outflow is not None:
                flows.step(self.hours, self.outflow, where="post", color=style.WATER, lw=1.0, label="outflow")
            flows.set_ylabel("flow [m³/s]")
            flows.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
            flows.tick_params(labelbottom=False)
            output.plot(self.hours, self.output, color=style.INK, lw=1.0)
            output.set_ylabel("level [m]" if reach.kind == "pool" else "discharge [m³/s]")
            output.set_xlabel("hours")
            output.ticklabel_format(axis="y", useOffset=False)
            for axes in (flows, output):
                axes.set_xlim(0, float(self.hours[-1]))
        return figure


def read_day(path: Path | str, date: GivenDate = None, config: GivenConfig = None) -> Day:
    """Read a day from a log.

    Parameters
    ----------
    path : Path or str
        A file of one day or of many, or a directory of them.
    date : datetime.date or str, optional
        Which day; needed where there are several. Of `[run] window_days` days in a row, the last.
    config : Config, path of a TOML file, or mapping, optional
        The reach and how its logs are to be read; Table I by default.

    Returns
    -------
    Day

    Raises
    ------
    DataError
        Where the day cannot be used; the message names file and line.
    NoDataError
        Where there is no log of that day.
    ConfigError
        Where it is not said which of several days is meant, or the configuration cannot be used.

    Examples
    --------
    >>> read_day("sample_data/basse_isere_csv/2008-03-14.csv", config="configs/basse_isere.toml")
    Day(2008-03-14, basse-isere: 650 samples of 133 s, inflow 350 to 452 m3/s)
    """
    from rivid.logs.catalog import find_days
    from rivid.logs.read import read_window
    from rivid.run.workers import without_pandas

    said, wanted, root = as_config(config), as_date(date), Path(path)
    if not root.exists():
        raise NoDataError(f"{root} does not exist: expected a log, or a directory of logs")
    without_pandas()
    catalog = find_days(root, said)
    sources = {source.date: source for source in catalog.days}
    if not sources:
        why = "; ".join(f"{name}: {reason}" for name, reason in catalog.bad_files[:1])
        raise DataError(f"{root}: no day can be read" + (f": {why}" if why else ""))
    length = said.run.window_days
    if wanted is None:
        if len(sources) > length:
            raise ConfigError(
                f"{root} holds {len(sources)} days, {min(sources)} to {max(sources)}: say which, date=..."
            )
        wanted = max(sources)
    asked = [wanted - dt.timedelta(days=k) for k in range(length - 1, -1, -1)]
    missing = [day for day in asked if day not in sources]
    if missing:
        raise NoDataError(f"{root} has no log of {missing[0]}: it holds {min(sources)} to {max(sources)}")
    data = read_window(root, [sources[day] for day in asked], said)
    return Day(data.inflow, data.output, data.outflow, data.date, said, data.n_filled, data.notes)
