"""A simulated season, whose truth is known."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from rivid.api.day import Day
from rivid.api.given import GivenDate, GivenScenario, as_date, as_scenario
from rivid.config import Config, ReachConfig
from rivid.errors import ConfigError, NoDataError
from rivid.simulation import Season, simulate_cascade

if TYPE_CHECKING:
    from rivid.api.picture import Picture


@dataclass(frozen=True, repr=False, eq=False)
class SimulatedSeason(Season):
    """What :func:`simulate` gives: all of :class:`rivid.simulation.Season`, in a few words and a picture."""

    def __repr__(self) -> str:
        delays = np.unique(self.delay)
        hidden = "".join(f", {effect.name}" for effect in self.effects)
        return (
            f"SimulatedSeason({self.scenario.reach.name}, {len(self.dates)} days from {self.dates[0]}, "
            f"seed {self.seed}: true d {delays[0]} to {delays[-1]} samples of {self.sample_time:g} s{hidden})"
        )

    @property
    def config(self) -> Config:
        """What a user of this reach would configure: its nominal geometry, nothing of the truth."""
        shared = set(ReachConfig.model_fields)
        reach = self.scenario.reach.model_dump(include=shared, exclude_unset=True)
        if self.scenario.channel is not None:
            reach.setdefault("bed_level", self.scenario.channel.bed_level)
        return Config(reach=ReachConfig(**reach))

    def day(self, which: int | GivenDate) -> Day:
        """One of the days as its logs have it; gaps of the gauge are bridged and counted.

        Parameters
        ----------
        which : int, datetime.date or str
            A row, or a date.

        Raises
        ------
        NoDataError
            Where there is no such day, or the gauge gave nothing on it.
        """
        if isinstance(which, int):
            if not -len(self.dates) <= which < len(self.dates):
                raise NoDataError(f"day {which}: expected one of {len(self.dates)} days, from 0")
            i = which
        else:
            date = as_date(which)
            if date not in self.dates:
                raise NoDataError(f"{date} is not simulated: expected {self.dates[0]} to {self.dates[-1]}")
            i = self.dates.index(date)
        level, silent = self.level[i], np.isnan(self.level[i])
        if silent.all():
            raise NoDataError(f"the gauge gave nothing on {self.dates[i]}: take another day")
        filled = np.interp(self.seconds, self.seconds[~silent], level[~silent])
        return Day(self.inflow[i], filled, self.outflow[i], self.dates[i], self.config, int(silent.sum()))

    def plot(self) -> "Picture":
        """Daily mean flows and level, and the true delay."""
        from rivid.api.picture import date_axes, picture
        from rivid.plots import style

        at = [date.toordinal() for date in self.dates]
        with style.styled():
            note = repr(self).removeprefix("SimulatedSeason(")[:-1]
            figure, panels = picture(f"{self.scenario.name}: a simulated season", note, (1.5, 1.2, 1.0))
            flows, level, delay = panels
            look: dict[str, Any] = {"lw": 1.0, "marker": "o", "ms": 1.8}
            flows.plot(at, self.inflow.mean(axis=1), color=style.INK, label="inflow", **look)
            flows.plot(at, self.outflow.mean(axis=1), color=style.WATER, label="outflow", **look)
            flows.set_ylabel("flow [m³/s]")
            flows.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
            level.plot(at, self.true_level.mean(axis=1), color=style.INK, **look)
            level.set_ylabel("level [m]")
            level.ticklabel_format(axis="y", useOffset=False)
            delay.plot(at, self.travel_time / self.sample_time, color=style.ACCENT, **look)
            delay.set_ylabel("travel [samples]")
            date_axes(panels, self.dates[0], self.dates[-1])
        return figure


def simulate(scenario: GivenScenario = None, *, seed: int | None = None, **changes: Any) -> SimulatedSeason:
    """Simulate a season of a reach whose truth is known.

    Parameters
    ----------
    scenario : Scenario, path of a TOML file, or mapping, optional
        The reach of Table I by default.
    seed : int, optional
        Instead of the scenario's own; the same seed gives the same season.
    **changes
        Keys of the scenario, ``simulate("pool.toml", days=60, effects=[{"name": "leakage"}])``.

    Returns
    -------
    SimulatedSeason

    Raises
    ------
    ConfigError
        For an unknown key, an impossible value, operators whose loop would swing, or a cascade.

    Examples
    --------
    >>> simulate(days=3, seed=1)
    SimulatedSeason(reach, 3 days from 2008-01-01, seed 1: true d 8 to 8 samples of 133 s)
    """
    said = as_scenario(scenario, changes)
    if said.cascade:
        raise ConfigError(
            f"{said.name} is a cascade of {len(said.cascade)} reaches: expected one reach; take "
            "rivid.simulation.simulate_cascade"
        )
    (season,) = simulate_cascade(said, seed)
    return SimulatedSeason(**{f.name: getattr(season, f.name) for f in fields(Season)})
