"""A simulated season with known truth."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rivid.api.day import Day
from rivid.api.inputs import GivenDate, GivenScenario, Result, as_date, as_scenario
from rivid.config import Config, ReachConfig
from rivid.errors import ConfigError, NoDataError
from rivid.simulation import Season, simulate_cascade

if TYPE_CHECKING:
    from rivid.plots.library import Curve, Panel


@dataclass(frozen=True, repr=False, eq=False)
class SimulatedSeason(Result, Season):
    """The result of :func:`simulate`: a :class:`rivid.simulation.Season` with a short repr and a figure."""

    def _facts(self) -> str:
        delays = np.unique(self.delay)
        hidden = "".join(f", {effect.name}" for effect in self.effects)
        return (
            f"{self.scenario.reach.name}, {len(self.dates)} days from {self.dates[0]}, "
            f"seed {self.seed}: true d {delays[0]} to {delays[-1]} samples of {self.sample_time:g} s{hidden}"
        )

    @property
    def config(self) -> Config:
        """The configuration of the reach: its nominal geometry, without the truth."""
        shared = set(ReachConfig.model_fields)
        reach = self.scenario.reach.model_dump(include=shared, exclude_unset=True)
        if self.scenario.channel is not None:
            reach.setdefault("bed_level", self.scenario.channel.bed_level)
        return Config(reach=ReachConfig(**reach))

    def day(self, which: int | GivenDate) -> Day:
        """Return a day as logged; gaps of the gauge are interpolated and counted.

        Parameters
        ----------
        which : int, datetime.date or str
            Its index or its date.

        Raises
        ------
        NoDataError
            If there is no such day, or the gauge has no reading on it.
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
            raise NoDataError(f"the gauge has no reading on {self.dates[i]}: take another day")
        filled = np.interp(self.seconds, self.seconds[~silent], level[~silent])
        return Day(self.inflow[i], filled, self.outflow[i], self.dates[i], self.config, int(silent.sum()))

    def _title(self) -> str:
        return f"{self.scenario.name}: a simulated season"

    def _panels(self) -> "list[Panel]":
        from rivid.plots import style
        from rivid.plots.library import daily

        flows: list[Curve] = [
            (self.inflow.mean(axis=1), style.INK, "inflow"),
            (self.outflow.mean(axis=1), style.WATER, "outflow"),
        ]
        level = [(self.true_level.mean(axis=1), style.INK, "")]
        travel = [(self.travel_time / self.sample_time, style.ACCENT, "")]
        return [
            (1.5, lambda axes: daily(axes, self.dates, flows, "flow [m³/s]", dated=False)),
            (1.2, lambda axes: daily(axes, self.dates, level, "level [m]", dated=False)),
            (1.0, lambda axes: daily(axes, self.dates, travel, "travel [samples]")),
        ]


def simulate(scenario: GivenScenario = None, *, seed: int | None = None, **changes: Any) -> SimulatedSeason:
    """Simulate a season of a reach, with its truth.

    Parameters
    ----------
    scenario : Scenario, path of a TOML file, or mapping, optional
        The reach of Table I by default.
    seed : int, optional
        Replaces the scenario's seed; the same seed gives the same season.
    **changes
        Keys of the scenario, ``simulate("pool.toml", days=60, effects=[{"name": "leakage"}])``. Where
        `days` is given and `missing_days` is not, the share of days without a log is kept.

    Raises
    ------
    ConfigError
        For an unknown key, an invalid value, an unstable operator loop, or a cascade.

    Examples
    --------
    >>> simulate(days=3, seed=1)
    SimulatedSeason(reach, 3 days from 2008-01-01, seed 1: true d 8 to 8 samples of 133 s)
    """
    loaded = as_scenario(scenario, changes)
    if loaded.cascade:
        raise ConfigError(
            f"{loaded.name} is a cascade of {len(loaded.cascade)} reaches: expected one reach; use "
            "rivid.simulation.simulate_cascade"
        )
    (season,) = simulate_cascade(loaded, seed)
    return SimulatedSeason(**vars(season))
